"""A planned motion: from rest to rest within all limits, never quicker than the person, near its pointwise optimum."""

from dataclasses import replace
from unittest import mock

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.interpolate import CubicSpline

from arm_problems import arm_problem
from maniport.arms import VELOCITY, EllipsoidSpec
from maniport.errors import InvalidInputError, NotSPDError
from maniport.motion import MotionLimits, Planner, TargetTrajectory
from maniport.motion.problem import MotionProblem
from maniport.pipeline import follow_profile
from maniport.pipeline.results import ArmResult
from maniport.report import as_numbers, report_of
from motion_plans import planned_arm
from sizes import little_search

TIME = 3.0 + np.linspace(0.0, 1.2, 13)


def targets_of(arm, stretch=1.0, pace=1.5, seed=0):
    """Path and ellipsoids, perhaps stretched, of a smooth motion well within the limits of an arm, at `TIME`."""
    generator = np.random.default_rng(seed)
    middle = 0.5 * (arm.lower + arm.upper)
    half = np.minimum(0.5 * (arm.upper - arm.lower), 1.5)
    waves = np.sin(np.outer(TIME - TIME[0], generator.uniform(0.6, 1.4, arm.dof) * pace))
    q = middle + half * (generator.uniform(-0.4, 0.4, arm.dof) + 0.25 * waves)
    frame = np.diag([stretch, 1.0, 1.0 / stretch])
    return {
        "profile": frame @ arm.manipulability(q) @ frame,
        "path": arm.forward(q)[:, :3, 3],
        "time": TIME,
    }


def rows_of(targets, rows):
    return {name: values[rows] for name, values in targets.items()}


@pytest.fixture(scope="module")
def targets(panda):
    return targets_of(panda, 1.5)


@pytest.fixture(scope="module")
def planned(panda, planner, targets):
    return planned_arm(panda, **targets, planner=planner)


def require_laws(plan, speed_scale=1.0):
    """Whatever `retime` keeps is tested with it: limits, and rest at either end."""
    (arm,) = plan.arms
    assert max(share for _, share, _ in plan.trajectory.limit_use.values()) <= 1.0 + 1e-9
    assert (np.diff(arm.time) >= np.diff(arm.demonstrated_time) / speed_scale * (1.0 - 1e-9)).all()
    assert (arm.pointwise_best >= 0.0).all()
    assert (arm.pointwise_best <= arm.distance).all()
    assert plan.pointwise_ratio >= 1.0
    return arm


def test_path_is_followed_between_sparse_waypoints(panda, planner):
    sparse = rows_of(targets_of(panda, 2.0, pace=1.0, seed=2), slice(None, None, 3))
    plan = planned_arm(panda, **sparse, planner=planner, rate=200.0).arms[0]
    path = CubicSpline(sparse["time"], sparse["path"])(np.linspace(TIME[0], TIME[-1], 400))
    tips = panda.forward(plan.control_positions)[:, :3, 3]
    assert np.linalg.norm(tips[:, None] - path, axis=2).min(axis=1).max() < 0.02


def test_an_exceeded_torque_is_reported(planned):
    arm = planned.arms[0]
    report = report_of(
        replace(arm, limits=replace(arm.limits, effort=np.array([87.0, 5.0, *[87.0] * 5])))
    )
    (text,) = (text for text in report.warnings if "torque" in text)
    joint, share, _at = arm.limit_use["torque"]
    assert joint == "panda_joint2"
    assert "torques-exceeded" in report.warning_keys
    assert f"{joint} at {share * arm.limits.effort[1] / 5.0:.2f} times its torque limit at" in text


def test_clearance_is_measured_between_the_waypoints(planned, planner):
    arm = planned.arms[0]
    at = int(np.argmin(planner.collisions.clearance(arm.joint_positions)))
    near = np.abs(arm.control_time - arm.time[at]) < 0.02
    assert (
        planned.clearance.distance
        <= planner.collisions.clearance(arm.control_positions[near]).min() + 1e-4
    )


@pytest.mark.parametrize("name", ["panda", "crane"])
def test_any_arm_follows_itself(panda, crane, planner, name):
    arm = {"panda": panda, "crane": crane}[name]
    plan = planned_arm(
        arm, **targets_of(arm), rate=500.0, planner=planner if name == "panda" else None
    )
    result = require_laws(plan)
    assert np.median(result.distance) < 0.1
    assert np.percentile(result.position_error, 95) <= result.position_tolerance
    assert plan.clearance.share == 0.0
    assert plan.clearance.checked == (name == "panda")
    assert ("shapes of links" in plan.clearance.reason) != plan.clearance.checked


def test_distances_stay_above_the_pointwise_optimum(planned, targets):
    arm = require_laws(planned)
    assert_array_equal(arm.target, targets["profile"])
    ratio = np.sqrt(np.mean(arm.distance**2) / np.mean(arm.pointwise_best**2))
    assert planned.pointwise_ratio == pytest.approx(ratio)
    assert ratio < 1.2
    assert as_numbers(report_of(planned))["motion"]["pointwise_ratio"] == pytest.approx(ratio)


def test_a_start_is_a_further_chance(panda, planner, targets, planned):
    """The motion that a plan ended with, given as a start, is not lost."""
    before = planned.arms[0]
    plan = planned_arm(panda, **targets, planner=planner, starts=[before.joint_positions])
    after = require_laws(plan)
    assert np.mean(after.distance**2) < 1.05 * np.mean(before.distance**2)
    for starts in ([], [before.joint_positions[1:]], [before.joint_positions[:, 1:]]):
        with pytest.raises(InvalidInputError, match="starts"):
            planned_arm(panda, **targets, planner=planner, starts=starts)


@pytest.mark.parametrize("best", [9.0, 0.0])
def test_the_achieved_configuration_is_a_candidate_of_the_pointwise_optimum(
    panda, planner, targets, planned, best
):
    """Where a search found nothing better than the motion, no comparison is reported."""
    bests = np.full(len(TIME), best)
    with mock.patch("maniport.motion.plan.plan_motion._pointwise_bests", return_value=[bests]):
        plan = planned_arm(panda, **targets, planner=planner)
    arm = require_laws(plan)
    assert_array_equal(arm.distance, planned.arms[0].distance)
    assert_array_equal(arm.pointwise_best, np.minimum(arm.distance, best))
    shown = [metric for metric in report_of(plan).metrics if metric.key == "pointwise_ratio"]
    assert all(not metric.text and metric.value == 1.0 for metric in shown)


def test_a_smaller_tolerance_keeps_the_end_effector_nearer(panda, planner, targets, planned):
    near = planned_arm(panda, **targets, planner=planner, position_tolerance=2e-4).arms[0]
    errors = [np.percentile(arm.position_error, 95) for arm in (near, planned.arms[0])]
    assert errors[0] <= 2e-4 < errors[1] <= 5e-3
    assert np.mean(planned.arms[0].distance ** 2) < np.mean(near.distance**2)
    assert near.position_tolerance == 2e-4


def test_speed_scale_is_the_largest_speed(panda, planner):
    options = targets_of(panda, pace=0.7) | {"planner": planner, "rate": 500.0}
    slow, fast = (planned_arm(panda, **options, speed_scale=scale) for scale in (0.5, 20.0))
    assert 2.4 <= require_laws(slow, 0.5).control_time[-1] < 2.6
    assert require_laws(fast, 20.0).control_time[-1] < 1.0
    assert (
        max(
            share for name, (_, share, _) in fast.trajectory.limit_use.items() if name != "position"
        )
        > 0.95
    )


def test_without_a_path_ellipsoids_alone_are_followed(panda, planner, targets, planned):
    alone = require_laws(planned_arm(panda, targets["profile"], time=TIME, planner=planner))
    assert alone.position_error is None
    for name in ("pointwise_best", "distance"):
        assert np.mean(getattr(alone, name)) < np.mean(getattr(planned.arms[0], name))


def test_out_of_reach_is_reported_and_no_error(panda, planner, targets):
    far = planned_arm(
        panda, **targets | {"path": targets["path"] + [2.0, 0.0, 0.0]}, planner=planner
    )
    arm = require_laws(far)
    assert set(arm.status) <= {"position missed", "joint limit"}
    assert arm.position_error.min() > 1.0
    assert {"position-error", "targets-missed"} <= set(report_of(far).warning_keys)


def test_two_waypoints_are_a_motion(panda, planner, targets):
    home = 0.5 * (planner.limits.arm.lower + planner.limits.arm.upper)
    arm = require_laws(planned_arm(panda, **rows_of(targets, slice(2)), planner=planner, home=home))
    assert_allclose(arm.control_positions[[0, -1]], [home, home], atol=1e-9)
    assert 0.0 < arm.time[0] < arm.time[-1] < arm.control_time[-1]
    same = rows_of(targets, [0, 0]) | {"time": TIME[:2]}
    rest = require_laws(planned_arm(panda, **same, planner=planner))
    assert np.ptp(rest.control_positions, axis=0).max() < 0.01


def test_the_lowest_point_is_below_all_links(panda, planned):
    arm = planned.arms[0]
    run = ArmResult(name="panda", robot=panda, motion=arm)
    poses = panda.link_poses(arm.control_positions)
    for link, (points, _) in panda.geometry.shapes.items():
        joint = panda.chain.frames[link].joint
        if joint:
            heights = (poses[:, joint, 2, :3] @ points.T).min(axis=1) + poses[:, joint, 2, 3]
            assert run.lowest.height <= heights.min() + 1e-9
            if link == run.lowest.link:
                row = int(np.argmin(np.abs(arm.control_time - run.lowest.time)))
                assert heights[row] < run.lowest.height + 3e-3 + 0.2 * (link == "panda_hand")


@pytest.mark.parametrize(
    ("change", "error", "words"),
    [
        (
            {"profile": np.eye(3)[None], "time": TIME[:1], "path": np.zeros((1, 3))},
            InvalidInputError,
            "n ≥ 2",
        ),
        ({"time": TIME[::-1]}, InvalidInputError, "time"),
        ({"profile": np.tile(-np.eye(3), (13, 1, 1))}, NotSPDError, "profile"),
        ({"position_tolerance": 0.0}, InvalidInputError, "position_tolerance"),
        ({"home": np.full(7, 9.0)}, InvalidInputError, "home.*outside the limits"),
        ({"collisions": "yes"}, InvalidInputError, "collisions"),
        (
            {"motion_limits": {"joints": {"elbow": {"velocity": 1.0}}}},
            InvalidInputError,
            "'elbow'.*panda_joint1",
        ),
        ({"time": TIME * 1e6}, InvalidInputError, "samples"),
    ],
)
def test_bad_arguments_are_named(panda, targets, change, error, words):
    with pytest.raises(error, match=words):
        planned_arm(panda, **{"collisions": False} | targets | change)


def test_a_payload_is_held_on_the_path_or_the_plan_fails_before_it_is_optimized(panda):
    """Nodes hold it where they can; where the arm must stretch, the error names joint, torque and time."""
    robot = panda.with_payload(1.0)
    limits = MotionLimits.of(robot, {"joints": {"panda_joint2": {"effort": 25.0}}})
    ends = np.array([[0.0, -0.6, 0.0, -2.6, 0.0, 2.0, 0.0], [0.0, 1.1, 0.0, -0.6, 0.0, 1.7, 0.0]])
    q = ends[0] + np.linspace(0.0, 1.0, len(TIME))[:, None] * (ends[1] - ends[0])
    targets = {
        "profile": robot.manipulability(q),
        "path": robot.forward(q)[:, :3, 3],
        "time": TIME,
    }
    with little_search():
        loaded = Planner.of(limits, VELOCITY, collisions=False)
        with pytest.raises(
            InvalidInputError,
            match=r"path.*panda_joint2.*25 N",
        ):
            planned_arm(robot, **targets, planner=loaded)
    part = arm_problem(loaded.limits.arm, targets["profile"][:4], targets["path"][:4])
    problem = MotionProblem(TIME[:4], (part,), loaded.limits)
    nodes = loaded.arms[0].roadmap(problem, 100, np.random.default_rng(0))
    torques = np.abs(loaded.limits.arm.gravity_torques(nodes.q))
    assert np.all(torques < loaded.limits.effort)
    light = replace(
        loaded.arms[0].limits, arm=panda.narrowed(loaded.limits.arm.lower, loaded.limits.arm.upper)
    )
    free = replace(loaded.arms[0], limits=light).roadmap(problem, 100, np.random.default_rng(0))
    assert len(free.q) > len(nodes.q)


def test_a_planner_of_another_arm_is_refused(crane, planner, targets):
    with pytest.raises(InvalidInputError, match=r"planner.*'panda'.*'crane'"):
        planned_arm(crane, **targets, planner=planner)
    with pytest.raises(InvalidInputError, match="planner"):
        planned_arm(
            planner.limits.arm, **targets, planner=planner, spec=EllipsoidSpec(part="rotation")
        )


@pytest.mark.slow
def test_ellipsoids_of_joint_torques_are_planned(panda):
    robot = panda.with_payload(1.0, (0.0, 0.0, 0.1))
    spec = EllipsoidSpec("force", joint_weights="joint-limits")
    middle = 0.5 * (robot.lower + robot.upper) + 0.3
    q = middle + 0.2 * np.sin(np.outer(TIME - TIME[0], np.linspace(0.5, 2.0, 7)))
    payload = {"payload": 1.0, "payload_center": (0.0, 0.0, 0.1)}
    options = {"ellipsoids": "force", "joint_weights": "joint-limits", **payload}
    targets = TargetTrajectory.checked(
        robot, TIME, robot.ellipsoids(q, spec), positions=robot.forward(q)[:, :3, 3], spec=spec
    )
    result = follow_profile(panda, targets, **options)
    arm = require_laws(result.motion)
    assert arm.spec == spec.bounded
    assert np.median(arm.distance) < 0.1
    assert np.percentile(arm.position_error, 95) < 5e-3
