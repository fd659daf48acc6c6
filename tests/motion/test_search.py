import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from arm_problems import arm_problem
from maniport import spd
from maniport.arms import Arm, EllipsoidSpec, load_arm
from maniport.errors import InvalidInputError, NotSPDError
from maniport.motion import FeasibleProjector, SeedBank, nearest_feasible
from maniport.spd.regularization import Regularization

DAMPING = Regularization(epsilon=0.003)
"""About a hundredth of the mean eigenvalue of the Panda's ellipsoids."""


def test_samples_of_a_bank_are_starts(panda, bank):
    q = bank.joint_positions[:50]
    problem = arm_problem(panda, panda.manipulability(q), panda.forward(q)[:, :3, 3])
    assert_array_equal(bank.starts_for(problem.target, 3)[:, 0, :6], q[:, :6])
    with pytest.raises(InvalidInputError, match=r"^n must"):
        SeedBank(panda, 0)
    with pytest.raises(InvalidInputError, match=r"seed bank.*'panda'"):
        nearest_feasible(load_arm("panda", frame="panda_hand_tcp"), np.eye(3)[None], bank=bank)


def test_own_ellipsoids_are_found_again(panda, bank):
    q = panda.sample(100, random_state=99, sequence="uniform")
    target = panda.manipulability(q)
    hands = panda.forward(q)[:, :3, 3]
    nearest = nearest_feasible(panda, target, damping=DAMPING, bank=bank)
    assert np.mean(nearest.distance < 0.01) >= 0.98
    assert np.median(nearest.distance) < 1e-5
    assert nearest.position_error is None
    both = nearest_feasible(panda, target, positions=hands, damping=DAMPING, bank=bank)
    assert np.mean((both.distance < 0.05) & (both.position_error < 1e-3)) >= 0.95
    reached = panda.forward(both.joint_positions)[:, :3, 3]
    assert_allclose(both.position_error, np.linalg.norm(reached - hands, axis=1), atol=1e-12)


def test_results_do_not_depend_on_company(panda, bank):
    target = panda.manipulability(panda.sample(140, 3))
    settings = {"damping": DAMPING, "bank": bank, "n_starts": 4}
    among = nearest_feasible(panda, target, **settings)
    assert_allclose(
        nearest_feasible(panda, target[5:6], **settings).distance, among.distance[5], atol=1e-6
    )


def test_flat_ellipsoids_need_damping(panda, bank):
    flat = np.diag([0.0, 0.1, 0.3])[None]
    with pytest.raises(NotSPDError, match=r"ellipsoids\[0\].*damping"):
        nearest_feasible(panda, flat, damping=None)
    assert np.isfinite(nearest_feasible(panda, flat, n_starts=4, bank=bank).distance).all()
    planar = Arm.from_dh("planar", [[0, 0, 1, 0], [0, 0, 1, 0]])
    with pytest.raises(NotSPDError, match=r"'planar'.*singular"):
        nearest_feasible(planar, np.eye(3)[None], damping=None)
    assert (
        nearest_feasible(planar, planar.manipulability(planar.sample(20, 0))).distance.max() < 1e-3
    )


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"ellipsoids": np.eye(3)}, r"shape \(n, d, d\)"),
        ({"ellipsoids": np.eye(2)[None]}, "ellipsoids"),
        ({"spec": EllipsoidSpec(joint_weights=[1.0])}, "joint_weights"),
        ({"positions": np.zeros((2, 3))}, "positions"),
        ({"n_starts": 0}, "n_starts"),
        ({"spec": EllipsoidSpec("force"), "bank": "panda"}, r"built for 'panda'.*kind='force'"),
    ],
)
def test_wrong_arguments_are_named(panda, bank, arguments, message):
    options = {"ellipsoids": np.eye(3)[None], **arguments} | (
        {"bank": bank} if "bank" in arguments else {}
    )
    with pytest.raises(InvalidInputError, match=message):
        nearest_feasible(panda, **options)


@pytest.fixture(scope="module")
def projector(panda, bank):
    return FeasibleProjector(panda, bank=bank)


@pytest.fixture(scope="module")
def points(panda, projector):
    """Ellipsoids of the Panda that are a little too long, with the damping."""
    return 1.2 * panda.ellipsoids(panda.sample(40, 7)) + shift_of(projector)


def shift_of(projector):
    return projector.regularization.epsilon * np.eye(3)


def test_projections_are_feasible_and_about_as_near_as_a_thorough_search(
    panda, bank, projector, points
):
    damping = projector.regularization
    search = projector.search(damping.epsilon)
    nearest, changes = search.nearest(points)
    q = search.joint_positions
    assert np.all(panda.within_limits(q))
    assert np.all(changes[(q <= panda.lower) | (q >= panda.upper)] == 0.0)
    assert_allclose(nearest, panda.ellipsoids(q) + shift_of(projector), rtol=1e-12)
    thorough = nearest_feasible(panda, points - shift_of(projector), damping=damping, bank=bank)
    first = spd.distance(points, nearest)
    assert first.mean() < 1.05 * thorough.distance.mean()
    assert_array_equal(projector(points), nearest)
    neighbors = np.stack([np.roll(np.arange(len(points)), k) for k in (1, 2, 3)], axis=1)
    assert np.all(spd.distance(points, search.nearest(points, neighbors)[0]) <= first + 1e-9)
    moved = spd.distance(1.01 * points, search.nearest(1.01 * points)[0])
    assert moved.mean() < first.mean() + 0.02


def test_projections_do_not_depend_on_earlier_calls(panda, bank, projector, points):
    """Any number of points after any other; what was searched before changes no bit of a result."""
    first, changes = projector.nearest(points[:8])
    fewer, _ = projector.nearest(points[:4])
    assert fewer.shape == (4, 3, 3)
    more, _ = projector.nearest(points[:12])
    assert more.shape == (12, 3, 3)
    again, changes_again = projector.nearest(points[:8])
    fresh, _ = FeasibleProjector(panda, bank=bank).nearest(points[:8])
    assert_array_equal(again, first)
    assert_array_equal(changes_again, changes)
    assert_array_equal(fresh, first)
    assert_array_equal(projector(points[:8]), first)


def test_bad_input_of_projections_is_refused(panda, bank, projector, points):
    search = projector.search(0.01)
    search.nearest(points[:3])
    for call, error, message in (
        (
            lambda: projector(np.array([np.eye(3), -np.eye(3)])),
            NotSPDError,
            r"points\[1\] is indefinite",
        ),
        (
            lambda: search.nearest(points[:2]),
            InvalidInputError,
            r"points must have shape \(3, 3, 3\), as in the first",
        ),
        (
            lambda: FeasibleProjector(panda, damping=None, bank=bank),
            InvalidInputError,
            "damping must be above 0",
        ),
    ):
        with pytest.raises(error, match=message):
            call()
