"""Motions of several arms: as each alone where they do not meet, free of collisions where they do."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import maniport as mp
from arm_problems import arm_problem
from crane import two_arms
from maniport.errors import InvalidInputError
from maniport.motion import Planner, TargetTrajectory, plan_motion
from maniport.motion.costs.position import RelativePositionCost
from maniport.motion.exports import export_motion
from maniport.motion.motion_limits import MotionLimits
from maniport.motion.problem import MotionProblem
from motion_plans import planned_arm, planned_motion
from sizes import little_search

TIME = np.linspace(0.0, 3.0, 10)
MIDDLE = np.array([0.2, -0.4, 0.3, -1.9, 0.4, 1.8, 0.5])


def swung(phase=0.0, size=0.4):
    return MIDDLE + size * np.sin(np.outer(TIME, [1.0, 0.8, 1.2, 0.9, 1.1, 1.0, 0.5]) + phase)


def task(arms, *joints):
    """Ellipsoids that are a little larger than at these configurations of each arm, and their paths."""
    parts = list(zip(arms.arms, joints, strict=True))
    profiles = [1.2 * arm.manipulability(q) for arm, q in parts]
    paths = [arm.forward(q)[:, :3, 3] for arm, q in parts]
    return {"profiles": profiles, "paths": paths, "time": TIME}


def planner_of(arms, collisions=False):
    with little_search():
        return Planner.of(MotionLimits.of(arms), mp.EllipsoidSpec(), collisions)


def single(planner, i):
    own = planner.arms[i]
    return Planner(own.limits, planner.spec, (own,), own.reachability_map.collisions)


@pytest.fixture(scope="module")
def apart():
    arms = mp.load_arms("panda", bases=[(0.0, 2.0, 0.0), (0.0, -2.0, 0.0, 0.3)])
    return arms, planner_of(arms)


@pytest.fixture(scope="module")
def separate(apart):
    arms, planner = apart
    return planned_motion(arms, **task(arms, swung(), swung(1.0)), planner=planner)


def test_arms_that_do_not_meet_move_as_each_alone(apart, separate):
    """They are two single runs, but for what the common time makes of jerks: one motion, at rest at either end."""
    arms, planner = apart
    targets = task(arms, swung(), swung(1.0))
    assert not separate.coupled
    assert max(share for _, share, _ in separate.trajectory.limit_use.values()) <= 1.0 + 1e-9
    assert separate.trajectory.joint_names == arms.joint_names
    assert_array_equal(separate.trajectory.control_velocities[[0, -1]], 0.0)
    for name in ("control_positions", "joint_positions"):
        together = np.hstack([getattr(motion, name) for motion in separate.arms])
        assert_array_equal(together, getattr(separate.trajectory, name))
    distance, best = (
        np.concatenate([getattr(arm, name) for arm in separate.arms])
        for name in ("distance", "pointwise_best")
    )
    assert_allclose(separate.pointwise_ratio, np.linalg.norm(distance) / np.linalg.norm(best))
    for i, motion in enumerate(separate.arms):
        alone = planned_arm(
            arms.arms[i],
            targets["profiles"][i],
            targets["paths"][i],
            time=TIME,
            planner=single(planner, i),
        ).arms[0]
        assert_allclose(motion.joint_positions, alone.joint_positions, atol=2e-4)
        assert_allclose(motion.distance, alone.distance, atol=1e-3)
        assert_allclose(motion.pointwise_best, alone.pointwise_best, atol=1e-3)
        assert (motion.pointwise_best <= motion.distance).all()


@pytest.mark.slow
def test_the_way_between_the_tips_may_be_all_that_is_kept():
    """Tips that leave their paths go as the paths do beside one another, and the ellipsoids get better."""
    arms = mp.load_arms("panda", bases=[(0.0, 0.3, 0.0), (0.0, -0.3, 0.0)])
    planner = planner_of(arms, True)
    targets = task(arms, *(joints - np.eye(7)[0] for joints in (swung(), swung(0.3))))
    targets["profiles"] = [1.5 * profile for profile in targets["profiles"]]
    placed, plan = (
        planned_motion(arms, **targets, planner=planner, hand_targets=kind)
        for kind in ("placed", "relative")
    )
    assert_allclose(plan.relative[:, 0], targets["paths"][1] - targets["paths"][0])
    tips = arms.forward(plan.trajectory.joint_positions)[:, :, :3, 3]
    assert_allclose(
        np.linalg.norm(tips[:, 1] - tips[:, 0] - plan.relative[:, 0], axis=1),
        plan.relative_error[:, 0],
        atol=1e-9,
    )
    assert np.percentile(plan.relative_error, 95) < 5e-3
    assert placed.relative is None
    for arm, other in zip(plan.arms, placed.arms, strict=True):
        assert arm.path is None
        assert np.linalg.norm(arm.distance) < 0.95 * np.linalg.norm(other.distance)
    assert 1.0 <= plan.pointwise_ratio < 1.2
    assert plan.clearance.share == 0.0
    assert max(share for _, share, _ in plan.trajectory.limit_use.values()) <= 1.0 + 1e-9


def test_slopes_in_the_joints_of_both():
    """The gradient over all joints, the shared ones among them, is that of finite differences; costs add up."""
    crane = two_arms()
    q = 0.5 * crane.sample(4, 0)
    each = [
        arm_problem(
            arm,
            1.3 * arm.manipulability(arm.sample(4, 2)),
            arm.forward(arm.sample(4, 3))[:, :3, 3],
        )
        for arm in crane.arms
    ]
    time = np.arange(4.0)
    both = MotionProblem(time, tuple(each), MotionLimits.of(crane)).with_position_weight(20.0)
    alone = sum(
        one.with_position_weight(20.0).cost(p) for one, p in zip(each, crane.split(q), strict=True)
    )
    assert_allclose(both.normal_equations(q).distance ** 2, alone)
    assert both.position_errors(q).shape == (4, 2)
    cost = RelativePositionCost((0, 1), time, each[1].path - each[0].path)
    free = tuple(own.without_positions() for own in each)
    between = replace(both, arms=free, costs=(cost,)).with_position_weight(20.0)
    assert between.position_errors(q).shape == (4, 1)
    for one in (both, between):
        equations = one.normal_equations(q)
        hessian = equations.hessian
        steps = 1e-6 * np.eye(crane.dof)
        numeric = [
            (one.normal_equations(q + h).square - one.normal_equations(q - h).square) / 4e-6
            for h in steps
        ]
        assert_allclose(equations.gradient, np.stack(numeric, axis=1), rtol=1e-5, atol=1e-4)
        assert_allclose(hessian, np.swapaxes(hessian, 1, 2), atol=1e-9)


@pytest.mark.slow
def test_three_arms_of_which_two_have_crossing_paths_keep_clear_of_one_another():
    arms = mp.load_arms(
        "panda", bases=[(0.75, 0.0, 0.0, np.pi), (-0.75, 0.0, 0.0), (0.0, 3.0, 0.0)]
    )
    options = task(arms, swung(0.0, 0.2), swung(1.0, 0.2), swung(2.0, 0.2))
    *crossing, other = options["paths"]
    options["paths"] = [*(path - 0.8 * path.mean(axis=0) * [1, 1, 0] for path in crossing), other]
    plan = planned_motion(arms, **options, planner=planner_of(arms, True), position_tolerance=0.02)
    assert plan.coupled  # only where arms come near one another
    assert plan.trajectory.control_positions.shape[1] == 21
    assert plan.clearance.checked
    assert plan.clearance.share == 0.0 < plan.clearance.distance
    assert max(share for _, share, _ in plan.trajectory.limit_use.values()) <= 1.0 + 1e-9
    # clearance precedes the tolerance: it is halved only where errors exceed three tolerances
    for arm in plan.arms:
        assert np.percentile(arm.position_error, 95) < 1.5 * 0.02


@pytest.mark.slow
def test_arms_that_must_pass_one_another_are_planned_in_turn():
    """Without prioritized planning they collide in 14 % of the time, whatever the tolerance."""
    arms = mp.load_arms(
        "panda", bases=[(0.336, -0.16, 0.0, np.pi + 0.3), (-0.336, 0.16, 0.0, 0.08)]
    )
    options = task(arms, swung(), swung(0.28))
    options["paths"] = [path - 0.77 * path.mean(axis=0) * [1, 1, 0] for path in options["paths"]]
    plan = planned_motion(arms, **options, planner=planner_of(arms, True), position_tolerance=0.01)
    assert plan.clearance.share == 0.0 < plan.clearance.distance
    for arm in plan.arms:
        assert np.percentile(arm.position_error, 95) < 0.01


class Elbow:
    def __init__(self, joint, weight):
        self.joint = joint
        self.weight = weight

    def wanted(self, time):
        return -1.9 + 0.1 * time

    def residual(self, at):
        offset = at.joint_positions[:, self.joint] - self.wanted(at.time)
        return self.weight * offset[:, None]

    def jacobian(self, at):
        row = np.eye(at.robot.dof)[self.joint]
        return self.weight * np.tile(row, (len(at), 1, 1))


@pytest.mark.slow
@pytest.mark.parametrize("count", [1, 2])
def test_a_cost_of_the_user_changes_the_motion(apart, count):
    arms, planner = apart
    targets = task(arms, swung(), swung(1.0))
    joint = 3
    if count == 1:
        targets = {"profiles": targets["profiles"][:1], "paths": targets["paths"][:1], "time": TIME}
        arms = arms.arms[0]
        planner = single(planner, 0)
    errors = []
    for weight in (0.01, 10.0):
        cost = Elbow(joint, weight)
        plan = planned_motion(arms, **targets, costs=[cost], planner=planner)
        errors.append(np.abs(plan.trajectory.joint_positions[:, joint] - cost.wanted(TIME)).mean())
    assert errors[1] < 0.5 * errors[0]
    assert plan.coupled == (count > 1)
    wrong = Elbow(joint, 1.0)
    wrong.jacobian = lambda at: np.zeros((len(at), 1, 2))
    with pytest.raises(InvalidInputError, match=r"costs\[0\].jacobian"):
        planned_motion(arms, **targets, costs=[wrong], planner=planner)


def test_files_name_the_joints_of_both(separate, apart, tmp_path):
    arms, _ = apart
    separate.save_joints(tmp_path / "joints.npz")
    with np.load(tmp_path / "joints.npz") as file:
        assert_array_equal(file["right_distance"], separate.arms[1].distance)
    export_motion(tmp_path / "m.parquet", separate, "parquet", arms)
    table = pytest.importorskip("pyarrow.parquet").read_table(tmp_path / "m.parquet")
    tips = arms.forward(separate.trajectory.control_positions)[:, :, :3, 3]
    assert_array_equal(table["right_end_effector_y"].to_numpy(), tips[:, 1, 1])
    for i, name in enumerate(arms.joint_names):
        assert_array_equal(
            table[f"{name}_position"].to_numpy(), separate.trajectory.control_positions[:, i]
        )


def test_wrong_arguments_are_named(apart):
    arms, planner = apart
    options = task(arms, swung(), swung()) | {"planner": planner}
    (path, other) = options["paths"]
    for change, message in (
        ({"paths": [path, other[:-1]]}, "path"),
        ({"paths": [path, None]}, "positions must be of all arms or of none"),
        ({"hand_targets": "absolute"}, "unknown hand_targets 'absolute'"),
        ({"paths": None, "hand_targets": "relative"}, "hand_targets='relative'"),
    ):
        with pytest.raises(InvalidInputError, match=message):
            planned_motion(arms, **options | change)


def test_targets_are_one_for_each_arm_at_the_same_times(apart):
    arms, planner = apart
    profiles = task(arms, swung(), swung())["profiles"]
    first = TargetTrajectory.checked(arms.arms[0], TIME, profiles[0])
    later = TargetTrajectory.checked(arms.arms[1], TIME + 1.0, profiles[1])
    for targets, message in (
        (first, "targets must be 2"),
        ([first, later], r"targets\[1\] must have the times"),
        ([first, profiles[1]], r"targets\[1\] must be a TargetTrajectory"),
        (None, "targets must be a TargetTrajectory"),
    ):
        with pytest.raises(InvalidInputError, match=message):
            plan_motion(arms, targets, planner=planner)
    with pytest.raises(InvalidInputError, match=r"^robot"):
        plan_motion("panda", [first, first])
