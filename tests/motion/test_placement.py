"""Where a hand path lets an arm make the target ellipsoids."""

from dataclasses import replace
from unittest import mock

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.linalg import block_diag

from arm_problems import arm_problem
from maniport.arms import VELOCITY, Arm, EllipsoidSpec, load_arms
from maniport.arms.chain import rotation_about
from maniport.arms.collisions import Collisions
from maniport.errors import InvalidInputError
from maniport.motion import (
    MotionLimits,
    PlacementOptions,
    Planner,
    PlanOptions,
    TargetTrajectory,
    place_path,
)
from maniport.motion.demands import demands_of
from maniport.motion.directions import DirectionTarget
from maniport.motion.placement.cost import PlacedMotions, PlacementCost
from maniport.motion.placement.placement import SCALE, TILT, ArmPath, PlacementProblem
from maniport.motion.plan.optimizer import TrajectoryCost, TrajectoryTerms, levenberg_marquardt
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
TERMS = TrajectoryTerms(0.02, 1e-4)
PLACE = np.array([0.1, 0.5, 0.4, 0.7, 0.4, 0.1, 0.5])


@pytest.fixture(scope="module")
def motion(panda):
    joints = START + 0.4 * np.sin(np.outer(TIME, [1.0, 0.8, 1.2, 0.9, 1.1, 1.0, 0.5]))
    return panda.forward(joints)[:, :3, 3], panda.manipulability(joints)


@pytest.fixture(scope="module", autouse=True)
def few_samples():
    """A small reachability map suffices."""
    with mock.patch("maniport.motion.plan.reachability_map.SAMPLES", 20_000):
        yield


@pytest.fixture(scope="module")
def planner(panda, few_samples):
    """Return a planner without collisions."""
    return planner_of(panda)


def planner_of(robot, spec=VELOCITY, collisions=False):
    """Return a planner within the whole ranges of the joints."""
    limits = MotionLimits.of(robot, joint_limit_margin=0.0)
    return Planner.of(limits, spec, collisions)


def target_of(arm, path, profile, spec=VELOCITY, damping=DAMPING):
    """Return targets at even times."""
    time = np.linspace(0.0, 2.0, len(path))
    return TargetTrajectory.checked(arm, time, profile, positions=path, spec=spec, damping=damping)


def placed_best(path, profile, planner, spec=VELOCITY, **options):
    """Return the best placement of one arm."""
    arm = planner.group.arms[0]
    target = target_of(arm, path, profile, spec)
    return place_path(arm, target, PlacementOptions(**options), planner=planner)[0]


@pytest.mark.slow
def test_own_paths_of_two_arms_keep_their_relation():
    pandas = load_arms("panda", bases=[(0.0, 0.3, 0.0), (0.0, -0.3, 0.0)])
    planner = planner_of(pandas)
    joints = START + 0.4 * np.sin(np.outer(TIME, [1.0, 0.8, 1.2, 0.9, 1.1, 1.0, 0.5]))
    tips = []
    ellipsoids = []
    for arm, q in zip(pandas.arms, (joints, joints[::-1]), strict=True):
        tips.append(arm.forward(q)[:, :3, 3])
        ellipsoids.append(arm.manipulability(q))
    turn = rotation_about(2, 0.7)
    middle = np.concatenate(tips).mean(axis=0)
    world = [(tip - middle) @ turn for tip in tips]
    targets = []
    for arm, path, profile in zip(planner.group.arms, world, ellipsoids, strict=True):
        targets.append(target_of(arm, path, congruence(turn.T, profile)))
    fixed = PlacementOptions(scale=1.0, yaw=0.7, offset=middle)
    best = place_path(pandas, targets, fixed, planner=planner)[0]
    for placed, tip in zip(best, tips, strict=True):
        assert_allclose(placed.path, tip, atol=1e-12)
        assert np.median(placed.distance) < 0.3
    inside = PlacementOptions(scale=(0.2, 2.0), workspace=[(0.1, 0.9)] * 3)
    first, second = place_path(pandas, targets, inside, planner=planner)[0]
    assert (first.scale, first.yaw, *first.offset) == (second.scale, second.yaw, *second.offset)
    assert_allclose(
        first.path - second.path, first.scale * (world[0] - world[1]) @ first.rotation.T, atol=1e-12
    )
    assert min(first.path.min(), second.path.min()) >= 0.1 - 1e-8


def test_own_path_is_found_again(planner, motion):
    path, profile = motion
    turn = rotation_about(2, 0.7)
    moved = 0.8 * (path - [1.0, 2.0, 3.0]) @ turn.T
    turned = congruence(turn, profile)
    placed = placed_best(moved, turned, planner)
    fixed = placed_best(moved, turned, planner, scale=1.0, yaw=0.0, offset=(0.45, 0.0, 0.4))
    assert placed.reachable.all()
    assert placed.rms < min(0.2, 0.5 * fixed.rms)
    assert_allclose(placed.path, placed.apply(moved), atol=1e-12)


def test_far_path_is_reported(panda, planner, motion):
    path, profile = motion
    far = path.copy()
    far[5:] += [0.0, 0.0, 2.0]
    placed = placed_best(far, profile, planner, scale=1.0, yaw=0.0, offset=far.mean(axis=0))
    assert not placed.reachable[6:].any()
    assert placed.position_error[6:].min() > 1.0
    assert "path-out-of-reach" in report_of(placed).warning_keys
    assert np.all(panda.within_limits(placed.joint_positions))
    assert np.all(np.isfinite(placed.distance))


@pytest.mark.parametrize("part", ["rotation", "full"])
def test_other_parts_turn_too(panda, motion, part):
    """Rotational and full ellipsoids turn with the path; the arm's own have distance 0 in their place."""
    joints = START + 0.2 * np.sin(np.outer(TIME[:6], np.ones(7)))
    spec = EllipsoidSpec(part=part)
    path = panda.forward(joints)[:, :3, 3]
    profile = panda.ellipsoids(joints, spec)
    turn = rotation_about(2, -0.5)
    turned = congruence(block_diag(turn, turn) if part == "full" else turn, profile)
    planner = planner_of(panda, spec)
    center = path.mean(axis=0)
    placed = placed_best(path @ turn.T, turned, planner, spec, scale=1.0, yaw=0.5, offset=center)
    assert_allclose(placed.profile, profile, atol=1e-12)


def test_leaning_base_sees_the_path_turned_the_other_way(planner, motion):
    path, profile = motion
    placed = placed_best(
        path, profile, planner, tilt=0.6, scale=0.8, yaw=0.2, offset=(None, None, 0.5)
    )
    assert (placed.scale, placed.yaw, placed.offset[2]) == pytest.approx((0.8, 0.2, 0.5), abs=1e-12)
    lean = [np.sin(0.6) * np.cos(placed.heading), np.sin(0.6) * np.sin(placed.heading), np.cos(0.6)]
    assert_allclose(placed.base_orientation @ [0, 0, 1], lean, atol=1e-12)
    world = (placed.path - placed.offset) @ placed.base_orientation.T
    yaw = rotation_about(2, 0.2)
    assert_allclose(world, 0.8 * (path - path.mean(axis=0)) @ yaw.T, atol=1e-12)
    assert_allclose(
        congruence(placed.base_orientation, placed.profile), congruence(yaw, profile), atol=1e-12
    )
    assert_allclose(placed.turned(profile), placed.profile, atol=1e-12)
    assert "tilted by 34.4°" in repr(placed)


@pytest.mark.slow
def test_path_stays_in_its_workspace(panda, planner, motion):
    bounds = ((0.3, 0.45), (-0.1, 0.2), (None, 0.5))
    scale = (0.1, 2.0)
    placed = placed_best(*motion, planner, workspace=bounds, scale=scale, tilt="free")
    low = np.array([0.3, -0.1, -np.inf])
    high = np.array([0.45, 0.2, 0.5])
    assert np.all((placed.path >= low - 1e-8) & (placed.path <= high + 1e-8))
    above = planner_of(panda, collisions=Collisions.of(panda, table=0.0))
    placed = placed_best(*motion, above, offset=(0.4, 0.0, None), scale=(0.8, 1.0))
    assert placed.path[:, 2].min() >= -1e-8
    with pytest.raises(InvalidInputError, match=r"table.*level"):
        placed_best(*motion, above, tilt=0.3)


def test_placements_are_ranked_and_have_their_own_trajectories(panda, planner, motion):
    target = target_of(panda, *motion)
    ranked = place_path(panda, target, PlacementOptions(scale=0.7), planner=planner)
    assert len(ranked) > 1
    for placed in ranked:
        assert_allclose(placed.apply(motion[0]), placed.path, atol=1e-12)
        there = arm_problem(panda, placed.profile, placed.path, damping=DAMPING)
        assert_allclose(there.distance(placed.joint_positions), placed.distance, atol=1e-6)
        assert_allclose(
            there.position_error(placed.joint_positions), placed.position_error, atol=1e-9
        )
    changes = np.abs(ranked[0].joint_positions - ranked[1].joint_positions)
    assert changes.max() > 0.2


def test_a_placement_moves_other_targets_of_the_motion(panda, planner, motion):
    target = target_of(panda, *motion)
    placed = place_path(panda, target, planner=planner)[0]
    moved = placed.moved(target[:5])
    assert_allclose(moved.path, placed.path[:5], atol=1e-12)
    assert_allclose(moved.ellipsoids, placed.profile[:5], atol=1e-12)


def problem_of(spec=VELOCITY, demands=(), **fixed):
    """A placement problem of a small arm in which all is free that is not fixed."""
    profile = FOUR.ellipsoids(FOUR.sample(COUNT, 1), spec)
    path = np.random.default_rng(0).normal(size=(COUNT, 3))
    options = PlacementOptions(**fixed)
    target = arm_problem(FOUR, profile, 0.1 * path, spec=spec, damping=0.05).target
    arm = ArmPath(FOUR, target, None, demanded=demands)
    place = options.components((0.5, 2.0))
    return PlacementProblem((arm,), arm.path, np.arange(COUNT) * 0.3, *place, options.bounds())


def cost_of(problem):
    """Return the cost of placements with trajectories, without collisions."""
    return PlacementCost(problem, TERMS, 200.0, avoiding=False)


def motions_of(problem, place, *trajectories):
    """Return one placement (7,) with trajectories (n, dof) of the arms."""
    q = tuple(trajectory[None] for trajectory in trajectories)
    return PlacedMotions(problem.time, place[None], q, np.full(1, np.nan))


def directions_of(kinds):
    """Return lines along which the small arm shall be strong and fast; those of speeds stay in the base frame."""
    lines = np.random.default_rng(7).normal(size=(COUNT, 2, 3))
    lines /= np.linalg.norm(lines, axis=2, keepdims=True)
    weights = np.full((COUNT, 2), 0.4)
    results = []
    for kind in kinds:
        results.append(DirectionTarget(kind, lines, weights, 100.0, kind == "force"))
    return tuple(results)


@pytest.mark.parametrize("kinds", [(), ("force", "velocity")])
@pytest.mark.parametrize("kind", ["velocity", "force"])
def test_slopes_are_those_of_the_cost(kind, kinds):
    vectors = np.random.default_rng(2).normal(size=(COUNT, 3))
    demands = (
        (EllipsoidSpec(joint_weights=np.full(4, 2.0)), vectors[::-1]),
        (EllipsoidSpec(), vectors),
    )
    problem = problem_of(EllipsoidSpec(kind), demands, tilt="free")
    q = FOUR.sample(COUNT, 3)
    step = 1e-6
    limited = FOUR.with_limits(velocity=2.0, effort=10.0)
    (arm,) = problem.arms
    target = replace(arm.target, directions=directions_of(kinds))
    arm = replace(arm, arm=limited, target=target)
    backwards = replace(arm.target, positions=arm.path[::-1])
    turned_around = replace(arm, target=backwards)
    pair = replace(problem, arms=(arm, turned_around))
    both = cost_of(pair)
    equations = both.evaluate(motions_of(pair, PLACE, q, q))
    for k, change in enumerate(step * np.eye(len(PLACE))):
        ahead = both.evaluate(motions_of(pair, PLACE + change, q, q)).cost[0]
        behind = both.evaluate(motions_of(pair, PLACE - change, q, q)).cost[0]
        slope = (ahead - behind) / (4.0 * step)
        assert slope == pytest.approx(equations.gradient[0, k], rel=1e-5, abs=1e-4)
    hessian = equations.hessian[0]
    assert np.linalg.eigvalsh(hessian).min() > -1e-9 * np.trace(hessian)
    change = step * np.random.default_rng(5).normal(size=q.shape)
    ahead = both.evaluate(motions_of(pair, PLACE, q + change, q)).cost[0]
    behind = both.evaluate(motions_of(pair, PLACE, q - change, q)).cost[0]
    expected = np.sum(equations.arms[0].gradient[0] * change)
    assert (ahead - behind) / 4.0 == pytest.approx(expected, rel=1e-3)


def test_many_placements_at_once_are_as_each_alone():
    problem = problem_of(tilt="free")
    cost = cost_of(problem)
    places = np.stack([PLACE, PLACE + 0.1])
    q = np.stack([FOUR.sample(COUNT, 3), FOUR.sample(COUNT, 4)])
    together = cost.improved(PlacedMotions(problem.time, places, (q,), np.full(2, np.nan)), 20)
    for i in range(2):
        alone = cost.improved(motions_of(problem, places[i], q[i]), 20)
        assert_allclose(together.cost[i], alone.cost[0], rtol=1e-9)
        assert_allclose(together.q[0][i], alone.q[0][0], atol=1e-6)


@pytest.mark.slow
def test_real_time_makes_the_path_smaller(panda, planner, motion):
    """The same motion in less time has larger velocities and accelerations."""
    path, profile = motion
    scales = []
    for seconds in (60.0, 0.6):
        target = replace(target_of(panda, path, profile), time=np.linspace(0.0, seconds, len(path)))
        options = PlacementOptions(scale=(0.2, 1.0))
        plan = PlanOptions(real_time=True)
        scales.append(place_path(panda, target, options, planner=planner, plan=plan)[0].scale)
    assert scales[1] < 0.8 * scales[0]


def test_demands_of_a_circle(panda):
    time = np.arange(0.0, 4.0, 0.01)
    rows = np.arange(0, 400, 40)
    limits = MotionLimits.of(panda)
    path = 0.2 * np.stack([np.cos(3.0 * time), np.sin(3.0 * time), 0.0 * time], axis=1)
    (_, velocity), (_, acceleration) = demands_of(limits, time, path, rows)
    assert_allclose(np.linalg.norm(velocity, axis=1), 0.6, rtol=0.05)
    assert_allclose(np.linalg.norm(acceleration, axis=1)[1:-1], 1.8, rtol=0.05)
    path[200, 2] = 0.1
    (_, velocity), _ = demands_of(limits, time, path, rows, smoothing=1e-3)
    assert np.linalg.norm(velocity, axis=1).max() < 0.65


@pytest.mark.parametrize(
    "missing",
    [
        lambda time: time % 1.0 > 0.7,
        lambda time: time % 2.0 > 1.0,
        lambda time: time % 0.05 < 0.009,
        lambda time: time % 0.5 > 0.42,
        lambda time: (time > 1.0) & (time < 3.0) & (time % 0.3 > 0.009),
    ],
    ids=["0.3 s", "1 s", "each fifth row", "0.08 s", "single rows"],
)
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


def problem_at(arm, place):
    """Return the costs of an arm at a placement (7,)."""
    return arm.problem(place[None]).with_position_weight(200.0)


@pytest.mark.parametrize(
    "fixed", [{}, {"tilt": "free"}, {"scale": 0.9, "offset": (None, 0.1, None)}]
)
def test_placement_and_motion_improve_together(fixed):
    problem = problem_of(**fixed)
    place = np.where(problem.free, PLACE, problem.fixed)
    q = FOUR.sample(COUNT, 3)
    (arm,) = problem.arms
    improved = cost_of(problem).improved(motions_of(problem, place, q), 60)
    moved = improved.places[0]
    after = improved.q[0][0]
    alone = TrajectoryCost(FOUR, problem_at(arm, place), problem.time, TERMS)
    there = TrajectoryCost(FOUR, problem_at(arm, moved), problem.time, TERMS)
    without = levenberg_marquardt(alone, q, TERMS.rel_tol)
    assert there.evaluate(after)[0] < alone.evaluate(without)[0] < alone.evaluate(q)[0]
    assert improved.cost[0] == pytest.approx(there.evaluate(after)[0])
    assert np.all((after >= FOUR.lower) & (after <= FOUR.upper))
    assert np.all(
        (moved[SCALE:TILT] >= problem.lower[SCALE:TILT])
        & (moved[SCALE:TILT] <= problem.upper[SCALE:TILT])
    )
    assert_array_equal(moved[~problem.free], place[~problem.free])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"scale": 0.0}, "scale"),
        ({"scale": (1.0, 0.5)}, "scale.1. must be a number above 1"),
        ({"yaw": "left"}, "yaw"),
        ({"offset": (0.0, 1.0)}, "offset"),
        ({"tilt": 4.0}, "tilt"),
        (
            {"workspace": ((0.0, 1.0), (0.5, 0.5), (None, None))},
            "workspace.1..1. must be a number above 0.5",
        ),
    ],
)
def test_bad_options_are_refused(options, message):
    with pytest.raises(InvalidInputError, match=message):
        PlacementOptions(**options)


@pytest.mark.parametrize(
    ("workspace", "message"),
    [
        (((3.0, 4.0), (None, None), (None, None)), "reaches nothing in x 3.00 to 4.00"),
        (((0.4, 0.41), (None, None), (None, None)), "does not fit into it"),
    ],
)
def test_a_workspace_out_of_reach_is_refused(planner, motion, workspace, message):
    with pytest.raises(InvalidInputError, match=message):
        placed_best(*motion, planner, workspace=workspace)


def test_bad_targets_are_refused(panda, planner, motion):
    target = target_of(panda, *motion)
    with pytest.raises(InvalidInputError, match="positions"):
        place_path(panda, replace(target, positions=None), planner=planner)
    with pytest.raises(InvalidInputError, match=r"^targets"):
        place_path(panda, [target, target], planner=planner)
    with pytest.raises(InvalidInputError, match="map_rotation"):
        place_path(panda, target, planner=planner, map_rotation=-np.eye(3))
