"""Seed configurations, nearest feasible ellipsoids, feasibility gap and projector."""

import numpy as np
import pytest
from joblib import parallel_config
from numpy.testing import assert_allclose, assert_array_equal

from maniport import spd
from maniport.arms import Arm, EllipsoidSpec, load_arm
from maniport.errors import InvalidInputError, NotSPDError
from maniport.motion import FeasibleProjector, SeedBank, feasibility_gap, nearest_feasible
from maniport.motion.kernels import step_within_limits
from maniport.spd.regularization import Regularization

EPSILON = 0.003
DAMPING = Regularization.absolute(EPSILON)
"""About a hundredth of the mean eigenvalue of the Panda's ellipsoids."""


def test_samples_of_a_bank_are_retrieved(panda, bank):
    """The first result for the ellipsoid and hand position of a sample is that sample."""
    nearest = bank.query(bank.ellipsoids[:50], bank.tip_positions[:50], k=3)
    assert nearest.shape == (50, 3, 7)
    # the last joint changes neither
    assert_allclose(nearest[:, 0, :6], bank.joint_positions[:50, :6], atol=0)
    assert_allclose(panda.manipulability(bank.joint_positions), bank.ellipsoids, atol=0)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"n": 0}, "n must be a whole number of at least 1"),
        ({"damping": 0.0}, "damping must be a number above 0"),
        ({"damping": None}, "damping must be above 0"),
        ({"damping": Regularization(eigenvalue_floor=1e-4)}, "found a floor"),
    ],
)
def test_wrong_banks_are_refused(panda, options, message):
    """Wrong numbers of samples and dampings are errors."""
    with pytest.raises(InvalidInputError, match=message):
        SeedBank.build(panda, **{"n": 16, **options})


def test_banks_of_other_arms_are_refused(panda, bank):
    """A bank of another arm or end effector is an error, as are indefinite ellipsoids."""
    for other in (load_arm("myoarm"), load_arm("panda", frame="panda_hand_tcp")):
        with pytest.raises(InvalidInputError, match="seed bank was built for 'panda'; it does not fit"):
            bank.require_fits(other, bank.spec)
    with pytest.raises(NotSPDError, match="indefinite"):
        bank.query(np.diag([-1.0, 1.0, 1.0])[None])


def test_own_ellipsoids_are_found_again(panda, bank):
    """Ellipsoids of new joint positions score nearly zero, and the joints found make them, within the limits."""
    wanted = panda.manipulability(panda.sample(100, random_state=99, sequence="uniform"))
    found = nearest_feasible(panda, wanted, damping=DAMPING, bank=bank)
    assert np.mean(found.distance < 0.01) >= 0.98
    assert np.median(found.distance) < 1e-5
    assert np.all((found.joint_positions >= panda.lower) & (found.joint_positions <= panda.upper))
    assert found.position_error is None
    assert_array_equal(found.ellipsoids, panda.manipulability(found.joint_positions))
    damping = EPSILON * np.eye(3)
    assert_allclose(found.distance, spd.distance(wanted + damping, found.ellipsoids + damping), atol=1e-7)


def test_hand_position_is_reached_together_with_the_ellipsoid(panda, bank):
    """Reachable pairs of ellipsoid and hand position are met: d below 0.05 and position within a millimetre."""
    q = panda.sample(60, random_state=17, sequence="uniform")
    wanted, hands = panda.manipulability(q), panda.forward(q)[:, :3, 3]
    found = nearest_feasible(panda, wanted, positions=hands, damping=DAMPING, bank=bank)
    met = (found.distance < 0.05) & (found.position_error < 1e-3)
    assert met.mean() >= 0.95
    reached = panda.forward(found.joint_positions)[:, :3, 3]
    assert_allclose(found.position_error, np.linalg.norm(reached - hands, axis=1), atol=1e-12)


def test_step_minimizes_the_model_within_limits():
    """Steps stay inside, keep joints that the cost holds at a limit, and equal the free solution where none binds."""
    rng = np.random.default_rng(0)
    factor = rng.standard_normal((50, 6, 4))
    hessian, gradient = np.swapaxes(factor, 1, 2) @ factor, rng.standard_normal((50, 4))
    lower, upper, damping = np.full(4, -0.3), np.full(4, 0.3), np.full(50, 0.1)
    q = np.clip(rng.uniform(-0.5, 0.5, (50, 4)), lower, upper)
    trial, expected = np.empty_like(q), np.empty(50)
    step_within_limits(q, gradient, hessian, damping, lower, upper, trial, expected)
    assert np.all((trial >= lower) & (trial <= upper))
    held = ((q == lower) & (gradient > 0)) | ((q == upper) & (gradient < 0))
    assert_array_equal(trial[held], q[held])
    step = trial - q
    model = np.einsum("nk,nk->n", gradient, step) + 0.5 * np.einsum("nk,nkl,nl->n", step, hessian, step)
    assert_allclose(expected, -model, atol=1e-14)
    wide = np.full(4, 100.0)
    step_within_limits(q, gradient, hessian, damping, -wide, wide, trial, expected)
    assert_allclose(trial - q, -np.linalg.solve(hessian + 0.1 * np.eye(4), gradient[..., None])[..., 0], atol=1e-12)


def test_results_do_not_depend_on_jobs_or_company(panda, bank):
    """Two jobs give the same bits as one, and an ellipsoid fares the same alone as among others."""
    wanted = panda.manipulability(panda.sample(140, random_state=3))
    settings = {"damping": DAMPING, "bank": bank, "n_starts": 4}
    alone = nearest_feasible(panda, wanted, **settings)
    with parallel_config(backend="threading"):  # processes take seconds to start
        shared = nearest_feasible(panda, wanted, n_jobs=2, **settings)
    assert_array_equal(alone.joint_positions, shared.joint_positions)
    assert_array_equal(alone.distance, shared.distance)
    assert_allclose(nearest_feasible(panda, wanted[5:6], **settings).distance, alone.distance[5], atol=1e-6)


def test_gap_is_the_distance_of_the_nearest(panda, bank):
    """With as many points as ellipsoids it is what `nearest_feasible` finds; fewer are interpolated."""
    own = panda.manipulability(np.linspace([0, -0.5, 0, -2, 0, 1.8, 0], [0.5, 0.2, 0.3, -1.2, 0.4, 2.4, 0], 9))
    settings = {"damping": DAMPING, "bank": bank}
    found = nearest_feasible(panda, 3.0 * own, **settings)
    assert found.distance.min() > 0.05
    assert_array_equal(feasibility_gap(panda, 3.0 * own, **settings), found.distance)
    few = feasibility_gap(panda, 3.0 * own, n_points=3, **settings)
    assert_allclose(few[[0, 4, 8]], found.distance[[0, 4, 8]], atol=1e-6)
    assert feasibility_gap(panda, own, **settings).max() < 0.01
    for profile, error in ((own[0], InvalidInputError), (own[:0], InvalidInputError), (-own, NotSPDError)):
        with pytest.raises(error, match="profile"):
            feasibility_gap(panda, profile)
    with pytest.raises(InvalidInputError, match="n_points"):
        feasibility_gap(panda, own, n_points=0)


def test_flat_ellipsoids_need_damping(panda, bank):
    """A singular ellipsoid has a distance; without damping it is an error that advises it. So with arms always flat."""
    flat = np.diag([0.0, 0.1, 0.3])[None]
    with pytest.raises(NotSPDError, match=r"ellipsoids\[0\] is singular.*Give a damping"):
        nearest_feasible(panda, flat, damping=None)
    assert np.isfinite(nearest_feasible(panda, flat, n_starts=4, bank=bank).distance).all()
    planar = Arm.from_dh("planar", [[0, 0, 1, 0], [0, 0, 1, 0]])
    with pytest.raises(NotSPDError, match="'planar' is singular at all starts"):
        nearest_feasible(planar, np.eye(3)[None], damping=None)
    target = planar.manipulability(planar.sample(20, random_state=0))
    assert nearest_feasible(planar, target).distance.max() < 1e-3


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"ellipsoids": np.eye(3)}, r"shape \(n, d, d\)"),
        ({"ellipsoids": np.empty((0, 3, 3))}, "at least 1"),
        ({"ellipsoids": np.eye(2)[None]}, "ellipsoids must hold 3×3 matrices; found 2×2"),
        ({"ellipsoids": np.array([[[1.0, 2, 0], [0, 1, 0], [0, 0, 1]]])}, "not symmetric"),
        ({"damping": -0.1}, "damping must be a number above 0; found -0.1"),
        ({"spec": EllipsoidSpec(joint_weights=[1.0])}, "joint_weights must be 7 numbers above 0; found shape"),
        ({"positions": np.zeros((2, 3))}, r"positions must have shape \(1, 3\)"),
        ({"n_starts": 0}, "n_starts must be a whole number of at least 1"),
        ({"tol": 0.0}, "tol must be a number above 0"),
        ({"spec": EllipsoidSpec("force"), "bank": "panda"}, r"built for 'panda'.*kind='force'"),
    ],
)
def test_wrong_arguments_are_named(panda, bank, arguments, message):
    """A wrong argument gets an error that says what was found and what is allowed."""
    given = {"ellipsoids": np.eye(3)[None], **arguments}
    if "bank" in given:
        given["bank"] = bank
    with pytest.raises(InvalidInputError, match=message):
        nearest_feasible(panda, **given)


@pytest.fixture(scope="module")
def projector(panda, bank):
    """A projector of the Panda."""
    return FeasibleProjector(panda, bank=bank)


@pytest.fixture(scope="module")
def points(panda, projector):
    """Ellipsoids of the Panda that are a little too long, with the damping."""
    return projector.objective.damped(1.2 * panda.ellipsoids(panda.sample(40, 7)))


def test_what_it_finds_is_feasible_and_about_as_near_as_a_thorough_search(panda, bank, projector, points):
    """The arm makes what is returned at the postures that are told, and the distances are those of a long search."""
    search = projector.search(projector.objective.damping.epsilon)
    found, _ = search.nearest(points)
    q = search.joint_positions
    assert np.all(panda.within_limits(q))
    assert_allclose(found, projector.objective.damped(panda.ellipsoids(q)), rtol=1e-12)
    thorough = nearest_feasible(
        panda, projector.objective.undamped(points), damping=projector.objective.damping, bank=bank
    )
    away = spd.distance(points, found)
    assert away.mean() < 1.05 * thorough.distance.mean()
    assert_array_equal(projector(points), found)


def test_asking_again_comes_no_less_near(projector, points):
    """Each further round starts where the last one ended, and where its neighbors did."""
    search = projector.search(projector.objective.damping.epsilon)
    first = spd.distance(points, search.nearest(points)[0])
    beside = np.stack([np.roll(np.arange(len(points)), k) for k in (1, 2, 3)], axis=1)
    again = spd.distance(points, search.nearest(points, beside)[0])
    assert np.all(again <= first + 1e-9)
    moved = spd.distance(1.01 * points, search.nearest(1.01 * points)[0])
    assert moved.mean() < first.mean() + 0.02


@pytest.mark.parametrize("kind", ["velocity", "force"])
def test_ways_are_derivatives_of_the_logarithm(panda, kind):
    """Each way is the change of log(A^-½ M A^-½) along a joint, by central differences; zero at a limit."""
    spec = EllipsoidSpec(kind)
    projector = FeasibleProjector(panda, spec, bank=SeedBank.build(panda, 512, spec=spec))
    objective = projector.objective
    points = objective.damped(1.1 * panda.ellipsoids(panda.sample(6, 1), spec))
    search = projector.search(objective.damping.epsilon)
    _, ways = search.nearest(points)
    q, targets = search.joint_positions, objective.targets(objective.undamped(points))
    held = (q <= panda.lower) | (q >= panda.upper)
    assert np.all(ways[held] == 0.0)
    for k in range(panda.dof):
        step = 1e-5 * np.eye(panda.dof)[k]
        wanted = (targets.ellipsoid_cost.logarithms(q + step) - targets.ellipsoid_cost.logarithms(q - step)) / 2e-5
        free = ~held[:, k]
        assert_allclose(ways[free, k], wanted[free], atol=1e-5 * max(1.0, np.abs(wanted).max()))


def test_bad_input_is_refused(panda, bank, projector, points):
    """Wrong shapes, what is not SPD, other numbers of points and no damping are refused by name."""
    with pytest.raises(InvalidInputError, match=r"points must hold 3×3"):
        projector(np.array([np.eye(2)]))
    with pytest.raises(NotSPDError, match=r"points\[1\] is indefinite"):
        projector(np.array([np.eye(3), -np.eye(3)]))
    search = projector.search(0.01)
    search.nearest(points[:3])
    with pytest.raises(InvalidInputError, match=r"points must have shape \(3, 3, 3\), as in the first call"):
        search.nearest(points[:2])
    with pytest.raises(InvalidInputError, match="damping must be a number above 0"):
        projector.search(0.0)
    with pytest.raises(InvalidInputError, match="damping must be above 0"):
        FeasibleProjector(panda, damping=None, bank=bank)
    with pytest.raises(InvalidInputError, match="seed bank was built for"):
        FeasibleProjector(panda, EllipsoidSpec(part="rotation"), bank=bank)
