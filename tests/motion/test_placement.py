"""Where a hand path lets an arm make the target ellipsoids."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.linalg import block_diag

from arm_problems import arm_problem
from maniport.arms import VELOCITY, Arm, EllipsoidSpec
from maniport.arms.chain import pose, rotation_about
from maniport.arms.collisions import Collisions
from maniport.arms.restriction import standing
from maniport.errors import InvalidInputError
from maniport.motion import MotionLimits, SeedBank, place_path
from maniport.motion.demands import demands_of
from maniport.motion.placement.place_path import as_workspace, fixed_place
from maniport.motion.placement.placement import SCALE, TILT, ArmPath, PlacementProblem
from maniport.motion.placement.search import PlacementTrajectoryCost
from maniport.motion.plan.optimizer import TrajectoryCost, TrajectoryTerms, levenberg_marquardt
from maniport.motion.plan.reachability_map import ReachabilityMap
from maniport.motion.problem import CostWeights
from maniport.report import report_of
from maniport.spd.kernels import congruence
from maniport.spd.regularization import Regularization

DAMPING = Regularization(epsilon=0.003)
TIME = np.linspace(0.0, 2.0, 12)
START = np.array([0.2, -0.4, 0.3, -1.9, 0.4, 1.8, 0.5])
FOUR = Arm.from_dh(
    "four", [[0, 0.2, 0.1, 1.5], [0, 0, 0.4, 0], [0, 0, 0.3, -1.5], [0, 0.1, 0.2, 0]], -2, 2
)
COUNT = 6
TERMS = TrajectoryTerms(0.02, 1e-4, np.full(COUNT, 1.0 / COUNT))
PLACE = np.array([0.1, 0.5, 0.4, 0.7, 0.4, 0.1, 0.5])


@pytest.fixture(scope="module")
def motion(panda):
    joints = START + 0.4 * np.sin(np.outer(TIME, [1.0, 0.8, 1.2, 0.9, 1.1, 1.0, 0.5]))
    return panda.forward(joints)[:, :3, 3], panda.manipulability(joints)


@pytest.fixture(scope="module")
def common(panda, bank):
    """Options of all searches: little effort and a small reachability map suffice."""
    reachability_map = ReachabilityMap(panda, VELOCITY, 20_000)
    return {"damping": DAMPING, "bank": bank, "reachability_map": reachability_map}


@pytest.mark.slow
def test_own_paths_of_two_arms_keep_their_relation(panda, common, motion):
    aside = Arm(standing(panda.chain, pose([0.1, 0.6, 0.0])))
    maps = common["reachability_map"], ReachabilityMap(aside, VELOCITY, 20_000)
    both = common | {"reachability_map": maps, "bank": (common["bank"], SeedBank(aside, 4096))}
    path, profile = motion
    tips, turn = (path, path[::-1] + np.array([0.1, 0.6, 0.0])), rotation_about(2, 0.7)
    middle = np.concatenate(tips).mean(axis=0)
    world = [(tip - middle) @ turn for tip in tips]
    turned = [congruence(turn.T, ellipsoids) for ellipsoids in (profile, profile[::-1])]
    placements = place_path(
        world, turned, (panda, aside), scale=1.0, yaw=0.7, offset=middle, **both
    )
    for placed, tip in zip(placements, tips, strict=True):
        assert_allclose(placed.path, tip, atol=1e-12)
        assert placed.pointwise_best.max() < 1e-3
    first, second = place_path(world, turned, (panda, aside), **both, workspace=[(0.2, 0.8)] * 3)
    assert (first.scale, first.yaw, *first.offset) == (second.scale, second.yaw, *second.offset)
    assert_allclose(
        first.path - second.path, first.scale * (world[0] - world[1]) @ first.rotation.T, atol=1e-12
    )
    assert min(first.path.min(), second.path.min()) >= 0.2 - 1e-8


def test_own_path_is_found_again(panda, common, motion):
    path, profile = motion
    turn = rotation_about(2, 0.7)
    moved, turned = 0.8 * (path - [1.0, 2.0, 3.0]) @ turn.T, congruence(turn, profile)
    placed = place_path(moved, turned, panda, **common)
    fixed = place_path(moved, turned, panda, scale=1.0, yaw=0.0, offset=(0.45, 0.0, 0.4), **common)
    assert placed.reachable.all()
    assert np.median(placed.pointwise_best) < min(0.15, 0.5 * np.median(fixed.pointwise_best))
    assert_allclose(placed.path, placed.apply(moved), atol=1e-12)


def test_far_path_is_reported(panda, common, motion):
    path, profile = motion
    far = path.copy()
    far[5:] += [0.0, 0.0, 2.0]
    placed = place_path(far, profile, panda, scale=1.0, yaw=0.0, offset=far.mean(axis=0), **common)
    assert_array_equal(placed.reachable, np.arange(12) < 5)
    assert placed.position_error[5:].min() > 1.0
    assert "7 of 12" in " ".join(report_of(placed).warnings)
    assert "7 out of reach" in repr(placed)
    assert np.all(panda.within_limits(placed.joint_positions))
    assert np.all(np.isfinite(placed.pointwise_best))


@pytest.mark.parametrize("part", ["rotation", "full"])
def test_other_parts_turn_too(panda, motion, part):
    """Rotational and full ellipsoids turn with the path; the arm's own have distance 0 in their place."""
    joints, spec = START + 0.2 * np.sin(np.outer(TIME[:6], np.ones(7))), EllipsoidSpec(part=part)
    path, profile = panda.forward(joints)[:, :3, 3], panda.ellipsoids(joints, spec)
    turn = rotation_about(2, -0.5)
    placed = place_path(
        path @ turn.T, congruence(block_diag(turn, turn) if part == "full" else turn, profile), panda, scale=1.0,
        yaw=0.5, offset=path.mean(axis=0), damping=DAMPING, spec=spec,
        reachability_map=ReachabilityMap(panda, spec, 4096), bank=SeedBank(panda, 4096, spec=spec),
    )  # fmt: skip
    assert_allclose(placed.profile, profile, atol=1e-12)
    assert placed.pointwise_best.max() < 1e-2


def test_leaning_base_sees_the_path_turned_the_other_way(panda, common, motion):
    path, profile = motion
    placed = place_path(
        path, profile, panda, tilt=0.6, scale=0.8, yaw=0.2, offset=(None, None, 0.5), **common
    )
    assert (placed.scale, placed.yaw, placed.offset[2]) == pytest.approx((0.8, 0.2, 0.5), abs=1e-12)
    lean = [np.sin(0.6) * np.cos(placed.heading), np.sin(0.6) * np.sin(placed.heading), np.cos(0.6)]
    assert_allclose(placed.base_orientation @ [0, 0, 1], lean, atol=1e-12)
    world, yaw = (placed.path - placed.offset) @ placed.base_orientation.T, rotation_about(2, 0.2)
    assert_allclose(world, 0.8 * (path - path.mean(axis=0)) @ yaw.T, atol=1e-12)
    assert_allclose(
        congruence(placed.base_orientation, placed.profile), congruence(yaw, profile), atol=1e-12
    )
    assert_allclose(placed.turned(profile), placed.profile, atol=1e-12)
    assert "tilted by 34.4°" in repr(placed)


@pytest.mark.slow
def test_path_stays_in_its_workspace(panda, common, motion):
    bounds, scale = ((0.3, 0.45), (-0.1, 0.2), (None, 0.5)), (0.1, 2.0)
    placed = place_path(*motion, panda, workspace=bounds, scale=scale, tilt="free", **common)
    low, high = np.array([0.3, -0.1, -np.inf]), np.array([0.45, 0.2, 0.5])
    assert np.all((placed.path >= low - 1e-8) & (placed.path <= high + 1e-8))
    above = ReachabilityMap(panda, VELOCITY, 4096, collisions=Collisions.of(panda, table=0.0))
    options = common | {"reachability_map": above}
    placed = place_path(*motion, panda, offset=(0.4, 0.0, None), scale=(0.8, 1.0), **options)
    assert placed.path[:, 2].min() >= -1e-8
    with pytest.raises(InvalidInputError, match="a table is level in the frame of the base"):
        place_path(*motion, panda, tilt=0.3, **options)


@pytest.mark.slow
def test_candidates_are_ranked(panda, common, motion):
    """The placement itself is the first candidate; `rank` takes another one, and an error names the largest rank."""
    first, second = (place_path(*motion, panda, scale=0.7, rank=rank, **common) for rank in (1, 2))
    for placed, candidate in ((first, first.candidates[0]), (second, second.candidates[1])):
        assert_array_equal(placed.offset, candidate.offset)
        assert placed.yaw == candidate.yaw
        assert candidate.planned_distance.shape == (12,)
        assert_allclose(placed.apply(motion[0]), placed.path, atol=1e-12)
    assert [place.rms for place in second.candidates] == [place.rms for place in first.candidates]
    assert not np.allclose(second.path, first.path)
    for rank in (0, len(first.candidates) + 1):
        with pytest.raises(InvalidInputError, match="rank"):
            place_path(*motion, panda, scale=0.7, rank=rank, **common)


def problem_of(spec=VELOCITY, demands=(), **fixed):
    """A placement problem of a small arm in which all is free that is not fixed."""
    profile, path = (
        FOUR.ellipsoids(FOUR.sample(COUNT, 1), spec),
        np.random.default_rng(0).normal(size=(COUNT, 3)),
    )
    place = fixed_place(*(fixed.get(name) for name in ("scale", "yaw", "tilt", "offset")))
    weights = CostWeights(200.0)
    target = arm_problem(FOUR, profile, 0.1 * path, spec=spec, damping=0.05).target
    arm = ArmPath(FOUR, target, weights, None, demands)
    return PlacementProblem((arm,), arm.path, np.arange(COUNT) * 0.3, *place, as_workspace(None))


@pytest.mark.parametrize("kind", ["velocity", "force"])
def test_slopes_are_those_of_the_cost(kind):
    vectors = np.random.default_rng(2).normal(size=(COUNT, 3))
    demands = (
        (EllipsoidSpec(joint_weights=np.full(4, 2.0)), vectors[::-1]),
        (EllipsoidSpec(), vectors),
    )
    problem, q, step = (
        problem_of(EllipsoidSpec(kind), demands, tilt="free"),
        FOUR.sample(COUNT, 3),
        1e-6,
    )
    (arm,) = problem.arms
    backwards = replace(arm.target, positions=arm.path[::-1])
    turned_around = replace(arm, target=backwards)
    both = PlacementTrajectoryCost(replace(problem, arms=(arm, turned_around)), [TERMS, TERMS])
    _, (arms, place_gradient, place_hessian) = both.evaluate((PLACE, (q, q)))
    for k, change in enumerate(step * np.eye(len(PLACE))):
        ends = [both.evaluate((PLACE + side * change, (q, q))) for side in (1.0, -1.0)]
        assert (ends[0][0] - ends[1][0]) / (4.0 * step) == pytest.approx(
            place_gradient[k], rel=1e-5, abs=1e-4
        )
    assert np.linalg.eigvalsh(place_hessian).min() > -1e-9 * np.trace(place_hessian)
    change = step * np.random.default_rng(5).normal(size=q.shape)
    ends = [both.evaluate((PLACE, (q + side * change, q)))[0] for side in (1.0, -1.0)]
    assert (ends[0] - ends[1]) / 4.0 == pytest.approx(np.sum(arms[0][0] * change), rel=1e-3)


@pytest.mark.slow
def test_demands_make_the_path_smaller(panda, common, motion):
    path, profile = motion
    acceleration = np.gradient(np.gradient(path, TIME, axis=0), TIME, axis=0)
    spec, options = (
        EllipsoidSpec(joint_weights=MotionLimits.of(panda).acceleration),
        common | {"scale": (0.2, 1.0)},
    )
    free, slow, fast = (
        place_path(path, profile, panda, **options, demands=[(spec, factor * acceleration)])
        for factor in (0.0, 1e-3, 30.0)
    )
    assert_array_equal(slow.path, free.path)
    assert fast.scale < 0.7 * free.scale
    fixed = place_path(
        path, profile, panda, **common | {"scale": 0.8}, demands=[(spec, 30.0 * acceleration)]
    )
    assert fixed.scale == pytest.approx(0.8)
    with pytest.raises(InvalidInputError, match="demands must have shape"):
        place_path(path, profile, panda, **common, demands=[(spec, acceleration[1:])])


def test_demands_of_a_circle(panda):
    time, rows, limits = np.arange(0.0, 4.0, 0.01), np.arange(0, 400, 40), MotionLimits.of(panda)
    path = 0.2 * np.stack([np.cos(3.0 * time), np.sin(3.0 * time), 0.0 * time], axis=1)
    (_, velocity), (_, acceleration) = demands_of(limits, time, path, rows)
    assert_allclose(np.linalg.norm(velocity, axis=1), 0.6, rtol=0.05)
    assert_allclose(np.linalg.norm(acceleration, axis=1)[1:-1], 1.8, rtol=0.05)
    path[200, 2] = 0.1
    (_, velocity), _ = demands_of(limits, time, path, rows, smoothing=1e-3)
    assert np.linalg.norm(velocity, axis=1).max() < 0.65


@pytest.mark.parametrize("missing", [
    lambda time: time % 1.0 > 0.7, lambda time: time % 2.0 > 1.0, lambda time: time % 0.05 < 0.009,
    lambda time: time % 0.5 > 0.42, lambda time: (time > 1.0) & (time < 3.0) & (time % 0.3 > 0.009),
], ids=["0.3 s", "1 s", "each fifth row", "0.08 s", "single rows"])  # fmt: skip
def test_gaps_of_a_recording_demand_nothing(panda, missing):
    """The path jumps from one side of a gap to the other only in the rows, not in time."""
    time = np.arange(0.0, 6.0, 0.01)
    path = 0.2 * np.stack([np.cos(1.5 * time), np.sin(1.5 * time), 0.0 * time], axis=1)
    kept = ~missing(time)
    rows = np.arange(0, kept.sum(), 10)
    demands = demands_of(MotionLimits.of(panda), time[kept], path[kept], rows)
    (_, velocity), (_, acceleration) = demands
    assert_allclose(np.linalg.norm(velocity, axis=1).max(), 0.3, rtol=0.1)
    sizes = np.linalg.norm(acceleration, axis=1)[2:-2]  # the smoothed path is bent at its ends
    assert sizes.max() < 1.0
    assert np.median(sizes) == pytest.approx(0.45, rel=0.1)


@pytest.mark.parametrize(
    "fixed", [{}, {"tilt": "free"}, {"scale": 0.9, "offset": (None, 0.1, None)}]
)
def test_placement_and_motion_improve_together(fixed):
    problem = problem_of(**fixed)
    place, q, (arm,) = (
        np.where(problem.free, PLACE, problem.fixed),
        FOUR.sample(COUNT, 3),
        problem.arms,
    )
    moved, (improved,) = PlacementTrajectoryCost(problem, [TERMS]).improved((place, (q,)))
    alone = TrajectoryCost(FOUR, arm.problem(place), problem.time, TERMS)
    there = TrajectoryCost(FOUR, arm.problem(moved), problem.time, TERMS)
    without = levenberg_marquardt(alone, q, TERMS.rel_tol)
    assert there.evaluate(improved)[0] < alone.evaluate(without)[0] < alone.evaluate(q)[0]
    assert np.all((improved >= FOUR.lower) & (improved <= FOUR.upper))
    assert np.all(
        (moved[SCALE:TILT] >= problem.lower[SCALE:TILT])
        & (moved[SCALE:TILT] <= problem.upper[SCALE:TILT])
    )
    assert_array_equal(moved[~problem.free], place[~problem.free])


@pytest.mark.parametrize(("change", "message"), [
    ({"path": np.zeros((3, 3))}, "path"), ({"profile": np.tile(np.eye(2), (12, 1, 1))}, "profile"),
    ({"map_rotation": -np.eye(3)}, "map_rotation"), ({"scale": 0.0}, "scale"),
    ({"scale": (1.0, 0.5)}, "scale.1. must be a number above 1"), ({"yaw": "left"}, "yaw"),
    ({"offset": (0.0, 1.0)}, "offset"), ({"spec": EllipsoidSpec(part="rotation")}, "does not fit"),
    ({"tilt": 4.0}, "tilt"), ({"collisions": 3, "reachability_map": None}, "collisions"),
    ({"workspace": ((0.0, 1.0), (0.5, 0.5), (None, None))}, "workspace.1..1. must be a number above 0.5"),
    ({"workspace": ((3.0, 4.0), (None, None), (None, None))}, "reaches nothing in x 3.00 to 4.00"),
    ({"workspace": ((0.4, 0.41), (None, None), (None, None))}, "does not fit into it"),
])  # fmt: skip
def test_bad_input_is_refused(panda, common, motion, change, message):
    with pytest.raises(InvalidInputError, match=message):
        place_path(**{"path": motion[0], "profile": motion[1], "arm": panda, **common} | change)


def test_paths_of_several_arms_must_be_as_many(panda, common, motion):
    path, profile = motion
    both = {"reachability_map": (common["reachability_map"],) * 2, "bank": (common["bank"],) * 2}
    for paths, profiles, message in (
        ((path, path), (profile,), "profile"),
        ((path, path[:-1]), (profile, profile), r"paths\[1\] must have shape"),
        ((path, path), (profile, profile[:-1]), r"profiles\[1\] must have shape"),
    ):
        with pytest.raises(InvalidInputError, match=message):
            place_path(paths, profiles, (panda, panda), **both)
