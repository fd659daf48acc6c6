"""A planned motion: from rest to rest within all limits, never quicker than the person, near its pointwise optimum."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.interpolate import CubicSpline

from maniport import motion
from maniport.arms import Arm, EllipsoidSpec
from maniport.errors import InvalidInputError, NotSPDError, UnknownNameError
from maniport.pipeline import follow_profile
from maniport.pipeline.results import ArmResult
from maniport.report import as_numbers, report_of

CRANE = Arm.from_dh(
    "crane", [[0, 0, 0, np.pi / 2], [0, 0.1, 0.5, 0], [0, 0, 0.4, 0.7], [0, 0, 0.2, 0]],
    [-0.5, -2, -2, -2], [0.5, 2, 2, 2], kinds=["prismatic", *["revolute"] * 3],
)  # fmt: skip
TIME = 3.0 + np.linspace(0.0, 1.2, 13)
TOUCH = 1e-3
"""A motion may be so much nearer than the floor, which is found by a search, with its tip in place."""


def plan_motion(arm, profile, path=None, **options):
    """Plan with little effort."""
    return motion.plan_motion(arm, profile, paths=path, **{"planning_effort": "quick"} | options)


def motion_of(arm, pace=1.5, seed=0):
    """Joint positions of a smooth motion well within the limits of an arm, at `TIME`."""
    generator = np.random.default_rng(seed)
    middle, half = 0.5 * (arm.lower + arm.upper), np.minimum(0.5 * (arm.upper - arm.lower), 1.5)
    waves = np.sin(np.outer(TIME - TIME[0], generator.uniform(0.6, 1.4, arm.dof) * pace))
    return middle + half * (generator.uniform(-0.4, 0.4, arm.dof) + 0.25 * waves)


def wanted_of(arm, stretch=1.0, **motion):
    """Ellipsoids and path of such a motion; other ellipsoids where they are stretched."""
    q = motion_of(arm, **motion)
    frame = np.diag([stretch, 1.0, 1.0 / stretch])
    return {"profile": frame @ arm.manipulability(q) @ frame, "path": arm.forward(q)[:, :3, 3], "time": TIME}


def part_of(wanted):
    """The first points."""
    return {name: values[:5] for name, values in wanted.items()}


@pytest.fixture(scope="module")
def wanted(panda):
    """Ellipsoids that the Panda cannot make along its path."""
    return wanted_of(panda, 1.5)


@pytest.fixture(scope="module")
def planned(panda, planner, wanted):
    """The Panda's motion along them."""
    return plan_motion(panda, **wanted, planner=planner)


def require_laws(plan, speed_scale=1.0):
    """What holds for every planned motion."""
    limits, q = plan.limits, plan.arms[0].control_positions
    step = np.diff(plan.arms[0].control_time)
    assert_allclose(step, step[0])
    for order, most in enumerate((limits.velocity, limits.acceleration, limits.jerk), 1):
        share = np.abs(np.diff(q, order, axis=0)) / step[0] ** order / most
        assert share.max() <= 1.0 + 1e-9
        assert_allclose(share.max(axis=0), plan.limit_use.shares[order], atol=1e-9)
    assert limits.arm.within_limits(q).all()
    for end in (q[:4], q[-4:]):
        assert_array_equal(np.diff(end, axis=0), 0.0)
    assert (np.diff(plan.arms[0].time) >= np.diff(plan.arms[0].demonstrated_time) / speed_scale * (1.0 - 1e-9)).all()
    assert plan.arms[0].control_time[0] == 0.0
    assert (plan.arms[0].pointwise_best >= 0.0).all()


def test_the_tip_stays_on_its_path_between_sparse_points(panda, planner):
    """Where points are far apart the motion is planned with others between them: the tip takes no other way there."""
    q = motion_of(panda, pace=1.0, seed=2)
    every = slice(None, None, 3)
    frame = np.diag([2.0, 1.0, 0.5])
    plan = plan_motion(
        panda, (frame @ panda.manipulability(q) @ frame)[every], path=panda.forward(q)[every, :3, 3], time=TIME[every],
        planner=planner, rate=200.0,
    )  # fmt: skip
    way = CubicSpline(TIME[every], plan.arms[0].path)(np.linspace(TIME[0], TIME[-1], 400))
    tips = panda.forward(plan.arms[0].control_positions)[:, :3, 3]
    assert np.linalg.norm(tips[:, None] - way, axis=2).min(axis=1).max() < 0.02


def test_leaps_of_the_recording_are_named(planned):
    """Points at either end of a step that is far and quicker than those around are jumps, of path or ellipsoids."""
    n = len(TIME)
    path, ellipsoids = np.linspace([0.0, 0.0, 0.0], [0.1, 0.0, 0.0], n), np.tile(np.eye(3), (n, 1, 1))
    assert not replace(planned.arms[0], path=path, target=ellipsoids).jumps.any()
    path[9:] += 0.2
    ellipsoids[4:] *= 3.0
    leaping = replace(planned.arms[0], path=path, target=ellipsoids)
    assert np.flatnonzero(leaping.jumps).tolist() == [3, 4, 8, 9]
    told = as_numbers(report_of(leaping))["motion"]["jumps"]
    assert told["points"] == 4
    assert told["there"]["position_error_mm"] == pytest.approx(1e3 * planned.arms[0].position_error[[3, 4, 8, 9]].max())


def test_room_is_measured_between_the_points(planned, planner):
    """No control step next to the closest point is nearer to a collision than what is told."""
    at = int(np.argmin(planner.collisions.clearance(planned.arms[0].joint_positions)))
    beside = np.abs(planned.arms[0].control_time - planned.arms[0].time[at]) < 0.02
    nearest = planner.collisions.clearance(planned.arms[0].control_positions[beside]).min()
    assert planned.clearance.distance <= nearest + 1e-4


@pytest.mark.parametrize("name", ["panda", "crane"])
def test_any_arm_follows_itself(panda, planner, name):
    """With 7 or 4 joints, revolute or prismatic: an arm's own motion is made again, within its limits."""
    arm = {"panda": panda, "crane": CRANE}[name]
    plan = plan_motion(arm, **wanted_of(arm), rate=500.0, planner=planner if name == "panda" else None)
    require_laws(plan)
    assert np.median(plan.arms[0].distance) < 0.1
    assert np.percentile(plan.arms[0].position_error, 95) <= plan.arms[0].position_tolerance
    assert plan.clearance.share == 0.0
    assert plan.clearance.known == (name == "panda")
    assert ("shapes of links" in plan.clearance.why) != plan.clearance.known


def test_what_the_arm_cannot_make_stays_above_its_floor(planned, wanted):
    """The floor is below the distance where the tip is in place; the ratio of both is the pointwise_ratio."""
    require_laws(planned)
    assert_array_equal(planned.arms[0].target, wanted["profile"])
    in_place = planned.arms[0].position_error < 1e-4
    assert (planned.arms[0].distance - planned.arms[0].pointwise_best)[in_place].min(initial=0.0) > -TOUCH
    ratio = np.sqrt(np.mean(planned.arms[0].distance ** 2) / np.mean(planned.arms[0].pointwise_best ** 2))
    assert planned.pointwise_ratio == pytest.approx(ratio)
    assert ratio < 1.2
    assert as_numbers(report_of(planned))["motion"]["pointwise_ratio"] == pytest.approx(ratio)


def test_a_smaller_tolerance_keeps_the_tip_nearer(panda, planner, wanted, planned):
    """Of two tolerances each is kept, and what is allowed brings the ellipsoids nearer."""
    near = plan_motion(panda, **wanted, planner=planner, position_tolerance=2e-4)
    assert (
        np.percentile(near.arms[0].position_error, 95)
        <= 2e-4
        < np.percentile(planned.arms[0].position_error, 95)
        <= 5e-3
    )
    assert np.mean(planned.arms[0].distance ** 2) < np.mean(near.arms[0].distance ** 2)
    assert near.arms[0].position_tolerance == 2e-4


def test_tempo_is_the_largest_speed(panda, planner):
    """Slowly, the motion takes as much longer; fast, as long as the limits make it."""
    wanted = wanted_of(panda, pace=0.7)
    slow, fast = (
        plan_motion(panda, **wanted, planner=planner, speed_scale=speed_scale, rate=500.0)
        for speed_scale in (0.5, 20.0)
    )
    require_laws(slow, 0.5)
    require_laws(fast, 20.0)
    assert 2.4 <= slow.arms[0].control_time[-1] < 2.6
    assert fast.arms[0].control_time[-1] < 1.0
    assert fast.limit_use.shares[1:].max() > 0.95


def test_same_seed_same_bytes(panda, planner, wanted):
    """Two runs from the same seed are equal bit for bit."""
    first, again = (plan_motion(panda, **part_of(wanted), planner=planner, random_state=3) for _ in range(2))
    assert_array_equal(first.arms[0].control_positions, again.arms[0].control_positions)
    assert_array_equal(first.arms[0].pointwise_best, again.arms[0].pointwise_best)


def test_without_a_path_ellipsoids_alone_are_followed(panda, planner, wanted, planned):
    """There is no error of the tip, and the distance is no larger than with the tip on its path."""
    alone = plan_motion(panda, wanted["profile"], time=TIME, planner=planner)
    require_laws(alone)
    assert alone.arms[0].position_error is None
    assert np.mean(alone.arms[0].pointwise_best) < np.mean(planned.arms[0].pointwise_best)
    assert np.mean(alone.arms[0].distance) < np.mean(planned.arms[0].distance)


def test_out_of_reach_is_told_and_no_error(panda, planner, wanted):
    """Where the path leaves what the arm can reach, the result says so at each point, and keeps all limits."""
    far = plan_motion(panda, **wanted | {"path": wanted["path"] + [2.0, 0.0, 0.0]}, planner=planner)
    require_laws(far)
    assert set(far.arms[0].status) <= {"position missed", "joint limit"}
    assert far.arms[0].position_error.min() > 1.0
    assert {"position-error", "targets-missed"} <= set(report_of(far).warning_keys)


def test_home_is_where_it_begins_and_ends(panda, planner, wanted):
    """The robot comes from the home posture and returns; the points are passed in between."""
    home = 0.5 * (planner.limits.lower + planner.limits.upper)
    plan = plan_motion(panda, **wanted, planner=planner, home=home)
    require_laws(plan)
    assert_allclose(plan.arms[0].control_positions[[0, -1]], [home, home], atol=1e-9)
    assert 0.0 < plan.arms[0].time[0] < plan.arms[0].time[-1] < plan.arms[0].control_time[-1]


def test_two_points_are_a_motion(panda, planner, wanted):
    """The shortest profile has a beginning and an end; where both are the same the robot hardly moves."""
    two = {name: values[:2] for name, values in wanted.items()}
    require_laws(plan_motion(panda, **two, planner=planner))
    same = {name: values[[0, 0]] for name, values in two.items()} | {"time": TIME[:2]}
    rest = plan_motion(panda, **same, planner=planner)
    require_laws(rest)
    assert np.ptp(rest.arms[0].control_positions, axis=0).max() < 0.01


def test_lowest_points_are_those_of_the_links(panda, planned):
    """The lowest point is below all origins, each link's is at its time, and fingers count."""
    run = ArmResult(name="panda", robot=panda, motion=planned.arms[0])
    lowest = {point.link: point for point in run.lowest_of_links}
    poses = panda.link_poses(planned.arms[0].control_positions)
    assert run.lowest == run.lowest_of_links[0]
    for link, (points, _) in panda.geometry.shapes:
        joint = panda.chain.frames[link].joint
        if joint:
            heights = (poses[:, joint, 2, :3] @ points.T).min(axis=1) + poses[:, joint, 2, 3]
            assert run.lowest.height <= lowest[link].height <= heights.min() + 1e-9
            row = int(np.argmin(np.abs(planned.arms[0].control_time - lowest[link].time)))
            assert heights[row] < lowest[link].height + 3e-3 + 0.2 * (link == "panda_hand")


def test_options_of_the_tracker_make_it_follow(panda, planner, wanted):
    """With options of the controller it follows the plan; without, the plan is the motion."""
    targets = part_of(wanted)
    options = {"profiles": [targets["profile"]], "time": targets["time"], "paths": [targets["path"]], "place": False}
    options |= {"planner": planner, "planning_effort": "quick"}
    plain = follow_profile(panda, **options, position_tolerance=0.01)
    tracked = follow_profile(panda, **options, tracking={"lm_damping": 1.0}, position_tolerance=0.01)
    assert_array_equal(tracked.arm.motion.time, plain.arm.motion.time)
    assert not np.array_equal(tracked.arm.motion.joint_positions, plain.arm.motion.joint_positions)
    assert tracked.arm.motion.pointwise_best is not None
    with pytest.raises(UnknownNameError, match="sped"):
        follow_profile(panda, **options, tracking={"sped": 2.0})


@pytest.mark.parametrize(
    ("change", "error", "words"),
    [
        ({"profile": np.eye(3)[None], "time": TIME[:1], "path": np.zeros((1, 3))}, InvalidInputError, "n ≥ 2"),
        ({"time": TIME[::-1]}, InvalidInputError, "time must increase"),
        ({"profile": np.tile(-np.eye(3), (13, 1, 1))}, NotSPDError, "profile"),
        ({"speed": 2.0}, TypeError, "speed"),
        ({"position_tolerance": 0.0}, InvalidInputError, "position_tolerance"),
        ({"planning_effort": "quik"}, InvalidInputError, "effort.*'quik'.*quick"),
        ({"home": np.full(7, 9.0)}, InvalidInputError, "home.*outside the limits"),
        ({"home": np.tile([0, -0.5, 0, -2, 0, 1.8, 0], (2, 1))}, InvalidInputError, "home must be one configuration"),
        ({"collisions": "yes"}, InvalidInputError, "collisions"),
        ({"motion_limits": {"joints": {"elbow": {"velocity": 1.0}}}}, InvalidInputError, "'elbow'.*panda_joint1"),
        ({"time": TIME * 1e6}, InvalidInputError, "samples"),
    ],
)
def test_bad_arguments_are_named(panda, wanted, change, error, words):
    """The message names the argument and what is allowed."""
    with pytest.raises(error, match=words):
        plan_motion(panda, **{"collisions": False} | wanted | change)


def test_a_planner_of_another_arm_is_refused(planner, wanted):
    """It would move another robot, or look at other ellipsoids."""
    with pytest.raises(InvalidInputError, match=r"planner was made for 'panda'.*does not fit 'crane'"):
        plan_motion(CRANE, **wanted, planner=planner)
    spec = EllipsoidSpec(part="rotation")
    with pytest.raises(InvalidInputError, match="does not fit"):
        plan_motion(planner.limits.arm, **wanted, planner=planner, spec=spec)
