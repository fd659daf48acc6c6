"""Live: whatever frames come, the robot keeps its limits; where they are good it follows."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.interpolate import make_interp_spline
from scipy.spatial.transform import Rotation
from toy import require_limits

import maniport as mp
from maniport.arms.human import human_arm
from maniport.errors import InvalidInputError
from maniport.live.state import FAR, NEAR, STATES
from maniport.mocap import shipped_recording, synthetic_recording
from sizes import SMALL, little_search


@pytest.fixture(scope="module")
def frames(small_result):
    """Two seconds of the recording of which one calibrated the person, three times as slow, at 50 Hz, and times."""
    recording = mp.read_recording(shipped_recording("ladder")).crop(9.5, 11.5)
    points = np.stack([recording.point(name) for name in following(small_result).points], axis=1)
    time = np.arange(0.0, 5.7, 0.02)
    slow = 3.0 * (recording.time - recording.time[0])
    return make_interp_spline(slow, points)(time), time


@pytest.fixture
def live(small_result):
    return following(small_result)


def following(result, **options):
    """A robot in simulated time that follows whenever the person is visible."""
    return mp.Live.of(result, clock=None, auto_engage=True, **options)


def played(live, points, time):
    return [live.step(point, t) for point, t in zip(points, time, strict=True)]


def require_safe(motion, collisions, time, states):
    """Commands are finite and within limits, nothing collides, and states are those of the list."""
    q = np.array([state.joint_positions for state in states])
    assert np.isfinite(q).all()
    require_limits(motion.limits, time, q, velocity_tolerance=1e-9, acceleration_tolerance=1e-6)
    assert not collisions.collides(q).any()
    assert {state.state for state in states} <= set(STATES)


def test_limits_are_kept_whatever_comes(small_result, frames):
    """Drop-outs, jumps, nonsense and pauses at random times: no limit is passed, nothing collides, nothing is nan."""
    points, _ = frames
    draw = np.random.default_rng(0)
    count = 250
    time = np.cumsum(
        draw.choice([0.002, 0.005, 0.01, 0.03, 0.3], count, p=[0.2, 0.3, 0.3, 0.18, 0.02])
    )
    at = 0
    shown = []
    for kind in draw.choice(6, count, p=[0.7, 0.06, 0.06, 0.06, 0.06, 0.06]):
        at += draw.integers(0, 3)
        frame = points[at % len(points)].copy()
        if kind == 1:
            frame[draw.integers(len(frame), size=2), draw.integers(3, size=2)] = np.nan
        elif kind == 2:
            frame = None
        elif kind == 3:
            frame = frame[draw.permutation(len(frame))]
        elif kind == 4:
            frame = draw.normal(0.0, 10.0 ** draw.uniform(-3, 3), frame.shape)
        elif kind == 5:
            frame[:] = 0.0
        shown.append(frame)
    first, second = (played(following(small_result), shown, time) for _ in range(2))
    require_safe(small_result.arm.motion, small_result.arm.collisions, time, first)
    assert_array_equal(
        [state.joint_positions for state in first], [state.joint_positions for state in second]
    )


def test_a_person_is_followed_as_offline(small_result, live, frames):
    """Joint angles are those that `fit_arm` finds of all frames together; the end effector is on its path."""
    points, time = frames
    states = played(live, points, time)
    fit = mp.fit_arm(mp.Recording(live.points, points, time))
    angles = np.array([state.arm.person for state in states])
    seen = fit.observable
    assert np.median(np.abs(np.degrees(angles - fit.joint_angles)), axis=0)[seen].max() < 1.0
    offline = small_result.arm.placement.turned(
        small_result.arm.adapter.transform(fit.arm.ellipsoids(fit.joint_angles))
    )
    differences = np.linalg.norm(
        np.array([state.arm.target for state in states]) - offline, axis=(1, 2)
    )
    assert np.median(differences / np.linalg.norm(offline, axis=(1, 2))) < 0.1
    assert np.median([state.position_error for state in states]) < 1e-3
    assert (states[0].state, states[-1].state) == ("approaching", "following")
    require_safe(small_result.arm.motion, small_result.arm.collisions, time, states)


@pytest.mark.slow
def test_robot_keeps_the_pace_of_the_person(second):
    with little_search(candidates=256):
        result = mp.transfer_recording(second, real_time=True, **SMALL)
    live = following(result)
    points = np.stack([second.point(name) for name in live.points], axis=1)
    states = played(live, points, second.time)
    errors = [state.position_error for state in states]
    assert 0.3 <= result.arm.placement.scale <= 1.0
    assert np.percentile(errors, 95.0) < 0.03
    assert max(errors) < 0.08
    require_safe(result.arm.motion, result.arm.collisions, second.time, states)


@pytest.mark.slow
def test_gaps_of_the_calibration_do_not_make_the_motion_small():
    """The hand is elsewhere after a gap, which is no speed: the scale is near that of the whole recording."""
    time = np.arange(0.0, 6.0, 1.0 / 60.0)
    rest = np.radians([40.0, 40.0, -20.0, 70.0, 5.0, 2.0, 5.0])
    change = np.radians([25.0, 25.0, 15.0, 30.0, 10.0, 0.0, 0.0])
    speeds = 1.2 * np.array([1.0, 0.8, 0.6, 1.1, 0.7, 1.0, 1.0])
    q = rest + change * np.sin(speeds * time[:, None] + np.arange(7))
    whole = synthetic_recording(human_arm("myoarm"), q, time)
    positions = whole.positions.copy()
    positions[time % 1.5 > 1.2] = np.nan
    options = {"real_time": True, "method": "parallel-transport", **SMALL}
    scales = []
    with little_search():
        for recording in (whole, replace(whole, positions=positions)):
            result = mp.transfer_recording(recording, **options)
            scales.append(result.arm.placement.scale)
    assert scales[1] > 0.8 * scales[0]  # four seeds: 0.90 to 0.99


def test_both_arms_lead_two_robots(two_arm_result):
    result = two_arm_result
    arms = two_arm_result.robot
    recording = result.recording
    live = following(result)
    slow = np.arange(0.0, 0.3, 0.003)
    time = recording.time - recording.time[0]
    columns = [
        np.interp(slow, time[~np.isnan(x)], x[~np.isnan(x)])
        for name in live.points
        for x in recording.point(name).T
    ]
    points = np.reshape(np.transpose(columns), (len(slow), -1, 3))
    hidden = points[-1].copy()
    hidden[[live.points.index(name) for name in result.arms[1].fit.roles["elbow"]]] = np.nan
    times = 0.02 * np.arange(260)
    states = played(live, [*points, *[points[-1]] * 60, *[hidden] * 40, *[points[-1]] * 60], times)
    followed = states[159]
    held = states[199]
    last = states[-1]
    for state in (followed, last):
        assert (state.state, len(state.arms)) == ("following", 2)
        assert state.position_error == max(arm.position_error for arm in state.arms) < 0.01
        for arm, own, columns in zip(state.arms, result.arms, arms.columns, strict=True):
            pose = own.robot.forward(state.joint_positions[columns])
            assert_allclose(arm.position, pose[:3, 3], atol=1e-9)
            assert_allclose(
                arm.achieved, own.robot.manipulability(state.joint_positions[columns]), atol=1e-9
            )
    assert held.state == "holding"
    assert not held.joint_velocities.any()
    require_safe(result.motion.trajectory, mp.Collisions.of(arms), times, states)
    with pytest.raises(InvalidInputError, match="arms"):
        _ = last.arm


def test_force_ellipsoids_are_followed_within_limits(second, frames):
    """With the kind "force" the hand follows its path, and the target is that of velocity."""
    with little_search():
        result = mp.transfer_recording(second, ellipsoids="force", speed_scale=0.5, **SMALL)
    points, time = frames
    live = following(result, delay=0.0)
    states = played(live, points, time)
    require_safe(result.arm.motion, result.arm.collisions, time, states)
    assert states[-1].state == "following"
    assert np.median([state.position_error for state in states[100:]]) < 1e-3
    last = states[-1].arm
    forces = result.arm.adapter.transform(
        live._arms[0].person.arm.ellipsoids(last.person, result.config.spec)[None]
    )[0]
    turn = result.arm.placement.rotation
    assert_allclose(last.target @ turn @ forces @ turn.T, np.eye(3), atol=1e-6)


def test_who_is_not_seen_is_waited_for(live, frames):
    points, time = frames
    played(live, points[:100], time[:100])
    gone = [live.step(None, time[99] + 0.02 * (i + 1)) for i in range(60)]
    assert (gone[0].state, gone[-1].state) == ("following", "holding")
    assert not gone[-1].joint_velocities.any()
    assert_array_equal(gone[-1].joint_positions, gone[-5].joint_positions)
    assert np.isfinite(gone[-1].distance)
    back = [live.step(points[200], gone[-1].time + 0.02 * (i + 1)) for i in range(150)]
    assert (back[0].state, back[2].state, back[-1].state) == (
        "approaching",
        "approaching",
        "following",
    )
    assert_allclose(
        back[0].arm.target_position, back[-1].arm.target_position, atol=0.005
    )  # without a delay
    assert back[-1].position_error < 0.01
    live.hold()
    assert live.step(None, back[-1].time + 0.02).state == "holding"


def test_points_that_leap_are_not_followed(live, frames):
    points, time = frames
    before = played(live, points[:20], time[:20])[-1]
    leaping = points[20].copy()
    leaping[live.points.index("RightHand")] += [0.0, 0.0, 0.5]
    after = live.step(leaping, time[19] + 0.01)
    assert_array_equal(after.arm.person, before.arm.person)
    assert live.step(points[20], time[19] + 0.02).arm.person is not before.arm.person


def test_the_robot_comes_from_where_it_is(small_result, frames):
    start = 0.5 * (small_result.arm.robot.lower + small_result.arm.robot.upper)
    live = following(small_result, start=start)
    time = 0.02 * np.arange(1, 300)
    named = dict(zip(live.points[::-1], frames[0][0][::-1], strict=True))
    states = [live.step(named, t) for t in time]
    assert_allclose(states[0].joint_positions, start)
    assert states[1].state == "approaching"
    assert states[-1].position_error < 0.02
    require_safe(small_result.arm.motion, small_result.arm.collisions, time, states)


def test_without_a_path_ellipsoids_alone_are_followed(small_result, frames):
    points, time = frames
    arm = small_result.arm
    live = mp.Live(
        arm.fit,
        arm.adapter,
        arm.robot,
        start=arm.motion.joint_positions[0],
        clock=None,
        auto_engage=True,
    )
    assert not arm.collisions.collides(live.joint_positions)
    states = played(live, points[:40], time[:40])
    assert states[-1].position_error is None
    assert states[-1].distance < 2.0


def test_wrong_frames_are_refused_and_change_nothing(small_result, live, frames):
    other = following(small_result)
    live.step(frames[0][0], 0.0), other.step(frames[0][0], 0.0)
    for points, time, words in (
        (np.zeros((3, 3)), 1.0, "points must have shape"),
        ("nothing", 1.0, "points must be numbers"),
        ({"Spine": [0.0, 0.0]}, 1.0, "Spine"),
        ({"Nose": [0.0, 0.0, 0.0]}, 1.0, "unknown point 'Nose'.*'Spine'"),
        ({3: None}, 1.0, "unknown point 3"),
        ([[np.inf] * 3] * 7, 1.0, "within ±1e\\+12"),
        ([[10**400] * 3] * 7, 1.0, "points must be numbers"),
        (np.full((7, 3), 1j), 1.0, "points must be numbers"),
        (None, np.nan, "time"),
        (None, 0.0, "later than 0"),
        (None, "now", "time"),
        (None, None, "time is required"),
    ):
        with pytest.raises(InvalidInputError, match=words):
            live.step(points, time)
    assert_array_equal(
        live.step(frames[0][1], 0.02).joint_positions,
        other.step(frames[0][1], 0.02).joint_positions,
    )


@pytest.mark.parametrize(
    ("options", "word"),
    [
        ({"start": np.zeros(3)}, "start"),
        ({"start": [0.0, 1.6, 0.0, -2.9, 0.0, 0.1, 0.0]}, "start: "),
        ({"auto_engage": "yes"}, "auto_engage"),
        ({"delay": 0.6}, "delay"),
        ({"clock": 5}, "clock"),
        ({"spec": "velocity"}, "spec"),
        ({"path": np.zeros((3, 3))}, "Placement"),
        ({"path": [None, None]}, "path"),
        ({"reference": np.zeros(7)}, "reference"),
        ({"spec": mp.EllipsoidSpec(part="full")}, "6×6"),
    ],
)
def test_wrong_arguments_are_errors(small_result, options, word):
    with pytest.raises(InvalidInputError, match=word):
        mp.Live.of(small_result, **options)


def test_wrong_types_are_errors(small_result):
    arm = small_result.arm
    pair = mp.ArmGroup(arm.robot, mp.load_arm("ur5"))
    for arguments, name in (
        ((small_result.recording, arm.adapter, arm.robot), "person"),
        ((arm.fit, arm.adapter, "panda"), "robot"),
        ((arm.fit, arm.adapter, pair), "person .* 2"),
        (
            (mp.mocap.HumanMotion((arm.fit,) * 2, np.zeros((2, 3))), arm.adapter, pair),
            "adapter .* 2",
        ),
    ):
        with pytest.raises(InvalidInputError, match=name):
            mp.Live(*arguments, start=np.zeros(7))
    with pytest.raises(InvalidInputError, match="result"):
        mp.Live.of(small_result.arm)


def test_a_delay_shifts_targets_and_lowers_errors(small_result, frames):
    """Targets are means around the delayed time, also over a gap, and the robot plans with them until they end."""
    points, time = frames
    fast = time / 2.0
    present, late = (following(small_result, delay=delay) for delay in (0.0, 0.15))
    states = played(present, points, fast)
    delayed = played(late, points, fast)
    delayed += [late.step(None, fast[-1] + t) for t in (0.05, 0.1, 0.15, 0.19)]
    at = np.array([[state.time - 0.15] for state in delayed])
    around = at + np.clip(fast[-1] - at, 0.0, 0.05) * ((np.arange(200) + 0.5) / 100.0 - 1.0)
    for name, tolerance in (("target_position", 1e-5), ("target", 1e-4)):
        path, later = (
            np.array([getattr(state.arm, name) for state in own]) for own in (states, delayed)
        )
        new = np.append(
            True, np.diff(path.reshape(len(path), -1), axis=0).any(axis=1)
        )  # a frame that is followed
        wanted = make_interp_spline(fast[new], path[new], k=1)(np.clip(around, 0.0, fast[new][-1]))
        assert_allclose(later, wanted.mean(axis=1), atol=tolerance)
    first, new = (
        live.step(points[0], fast[-1] + 0.2).arm.target_position for live in (late, present)
    )
    last = states[-1].arm.target_position
    assert_allclose(first, last + (new - last) / 12.0, atol=1e-9)
    after = [late.step(None, fast[-1] + 0.2 + t) for t in (0.05, 0.1, 0.15, 0.24, 0.26)]
    shares = np.array([[1.0 / 3.0], [2.0 / 3.0], [1.0], [1.0], [1.0]])
    assert_allclose(
        [state.arm.target_position for state in after], last + shares * (new - last), atol=1e-9
    )
    delayed += after
    assert {state.state for state in delayed[-9:-1]} <= {"following", "lagging"}
    assert delayed[-1].state == "holding"
    high = [
        np.percentile([state.position_error for state in own[50:]], 95.0)
        for own in (states, delayed)
    ]
    assert high[1] < 0.6 * high[0]
    require_safe(
        small_result.arm.motion,
        small_result.arm.collisions,
        [state.time for state in delayed],
        delayed,
    )


def test_a_robot_whose_tip_is_far_away_is_said_to_lag(small_result, frames):
    """The motion is repeated at growing speeds until the robot cannot follow; then the person stands still."""
    points, time = frames
    back_and_forth = np.concatenate([points, points[::-1], points, points[::-1]])
    errors = {"following": [], "lagging": []}
    for speed in (2.0, 4.0, 8.0, 16.0):
        live = following(small_result, delay=0.0)
        step = (time[-1] - time[0]) / (len(time) - 1) / speed
        times = step * np.arange(len(back_and_forth))
        states = played(live, points[:1].repeat(200, axis=0), 0.01 * np.arange(-200, 0))
        states += played(live, back_and_forth, times)
        states += [live.step(points[0], times[-1] + 0.01 * i) for i in range(1, 200)]
        for state in states:
            if state.state in errors:
                errors[state.state].append(state.position_error)
        if errors["lagging"]:
            break
    assert max(errors["following"]) <= FAR
    assert max(errors["lagging"]) > FAR
    assert min(errors["lagging"]) > NEAR
    assert states[-1].state == "following"


def test_neither_unit_nor_axes_of_frames_matter(small_result, live, frames):
    turn = Rotation.from_rotvec([0.4, -1.2, 2.0]).as_matrix()
    other = following(small_result)
    for points, t in zip(frames[0][:15], frames[1][:15], strict=True):
        there = 1e3 * points @ turn.T + [50.0, -7.0, 300.0]
        assert_allclose(
            live.step(points, t).joint_positions,
            other.step(there, t).joint_positions,
            atol=1e-6,
            rtol=0.0,
        )
