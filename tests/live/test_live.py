"""Live: whatever frames come, the robot keeps its limits; where they are good it follows."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.interpolate import make_interp_spline
from scipy.spatial.transform import Rotation
from toy import require_limits

import maniport as mp
from maniport.errors import InvalidInputError
from maniport.live.state import FAR, FOLLOWING, HOLDING, LAGGING, NEAR, REACHING, RECOVERING, STATES
from maniport.mocap import shipped_recording


@pytest.fixture(scope="module")
def frames(small_result):
    """Two seconds of the recording of which one calibrated the person, three times as slow, at 50 Hz."""
    recording = mp.read_recording(shipped_recording("ladder")).crop(9.5, 11.5)
    points = np.stack([recording.point(name) for name in mp.Live.of(small_result, clock=None).points], axis=1)
    time, slow = np.arange(0.0, 5.7, 0.02), 3.0 * (recording.time - recording.time[0])
    return make_interp_spline(slow, points)(time), time


def played(live, points, time):
    """Every moment of a run."""
    return [live.step(point, t) for point, t in zip(points, time, strict=True)]


def require_safe(result, time, moments):
    """Commands are finite and within limits, nothing collides, and states are those of the list."""
    q = np.array([moment.joint_positions for moment in moments])
    assert np.isfinite(q).all()
    require_limits(result.arm.motion.limits, time, q, velocity_tolerance=1e-9, acceleration_tolerance=1e-6)
    assert not result.arm.collisions.collides(q).any()
    assert {moment.state for moment in moments} <= set(STATES)


def test_limits_are_kept_whatever_comes(small_result, frames):
    """Drop-outs, jumps, nonsense and pauses at random times: no limit is passed, nothing collides, nothing is nan."""
    points, _ = frames
    draw = np.random.default_rng(0)
    live = mp.Live.of(small_result, clock=None)
    count = 250
    time = np.cumsum(draw.choice([0.002, 0.005, 0.01, 0.03, 0.3], count, p=[0.2, 0.3, 0.3, 0.18, 0.02]))
    at, shown = 0, []
    for kind in draw.choice(6, count, p=[0.7, 0.06, 0.06, 0.06, 0.06, 0.06]):
        at += draw.integers(0, 3)
        frame = points[at % len(points)].copy()
        if kind == 1:
            frame[draw.integers(len(frame))] = np.nan
        elif kind == 2:
            frame = None
        elif kind == 3:
            frame = frame[draw.permutation(len(frame))]
        elif kind == 4:
            frame = draw.normal(0.0, 10.0 ** draw.uniform(-3, 3), frame.shape)
        elif kind == 5:
            frame[:] = 0.0
        shown.append(frame)
    moments = played(live, shown, time)
    require_safe(small_result, time, moments)
    again = played(mp.Live.of(small_result, clock=None), shown, time)
    assert_array_equal([one.joint_positions for one in moments], [one.joint_positions for one in again])


def test_a_person_is_followed_as_offline(small_result, frames):
    """Joint angles are those that `fit_arm` finds of all frames together; the end effector is on its path.

    Within the cost of causality: over whole recordings the largest median of a joint is 0.24° (freeform) and, of
    joints that the points determine, 0.41° (ladder).
    """
    points, time = frames
    live = mp.Live.of(small_result, clock=None)
    moments = played(live, points, time)
    fit = mp.fit_arm(mp.Recording(live.points, points, time))
    found = np.array([one.person for one in moments])
    seen = fit.observable_share > 0.9
    assert np.median(np.abs(np.degrees(found - fit.joint_angles)), axis=0)[seen].max() < 1.0
    offline = small_result.arm.placement.turned(
        small_result.arm.adapter.transform(fit.arm.ellipsoids(fit.joint_angles))
    )
    differences = np.linalg.norm(np.array([one.target for one in moments]) - offline, axis=(1, 2))
    assert np.median(differences / np.linalg.norm(offline, axis=(1, 2))) < 0.1
    errors = np.array([one.tip_error for one in moments])
    assert np.median(errors) < 1e-3
    assert moments[0].state == REACHING
    assert moments[-1].state == FOLLOWING
    require_safe(small_result, time, moments)


def test_who_is_not_seen_is_waited_for(small_result, frames):
    """Without frames the arm brakes and rests, to the last bit; seen again, the person is followed again."""
    points, time = frames
    live = mp.Live.of(small_result, clock=None)
    played(live, points[:100], time[:100])
    gone = [live.step(None, time[99] + 0.02 * (i + 1)) for i in range(60)]
    assert (gone[0].state, gone[-1].state) == (FOLLOWING, HOLDING)
    assert not gone[-1].joint_velocities.any()
    assert_array_equal(gone[-1].joint_positions, gone[-5].joint_positions)
    assert np.isfinite(gone[-1].distance)
    back = [live.step(points[200], gone[-1].time + 0.02 * (i + 1)) for i in range(150)]
    assert (back[0].state, back[-1].state) == (RECOVERING, FOLLOWING)
    assert back[-1].tip_error < 0.01


def test_points_that_leap_are_not_followed(small_result, frames):
    """A hand that is elsewhere for a frame, half a metre away, changes nothing of what is believed of the person."""
    points, time = frames
    live = mp.Live.of(small_result, clock=None)
    before = played(live, points[:20], time[:20])[-1]
    leaping = points[20].copy()
    leaping[live.points.index("RightHand")] += [0.0, 0.0, 0.5]
    after = live.step(leaping, time[19] + 0.01)
    assert_array_equal(after.person, before.person)
    assert live.step(points[20], time[19] + 0.02).person is not before.person


def test_the_robot_comes_from_where_it_is(small_result, frames):
    """From another start the arm gets to the person's within its limits; names may be given, in any order."""
    points, _ = frames
    start = 0.5 * (small_result.arm.robot.lower + small_result.arm.robot.upper)
    live = mp.Live.of(small_result, start=start, clock=None)
    clock = 0.02 * np.arange(1, 300)
    named = dict(zip(live.points[::-1], points[0][::-1], strict=True))
    moments = [live.step(named, t) for t in clock]
    assert_allclose(moments[0].joint_positions, start)
    assert moments[1].state == REACHING
    assert moments[-1].tip_error < 0.02
    require_safe(small_result, clock, moments)


def test_without_a_path_ellipsoids_alone_are_followed(small_result, frames):
    """Made of its parts, without a path and with a start that is found, the arm comes nearer to its targets."""
    points, time = frames
    result = small_result
    live = mp.Live(result.arm.fit, result.arm.adapter, result.arm.robot, clock=None)
    assert not result.arm.collisions.collides(live._robot.q)
    moments = played(live, points[:40], time[:40])
    assert moments[-1].tip_error is None
    assert moments[-1].distance < 2.0


def test_wrong_frames_are_refused_and_change_nothing(small_result, frames):
    """The error names what is wrong; the next good frame is processed as if nothing had happened."""
    live, other = mp.Live.of(small_result, clock=None), mp.Live.of(small_result, clock=None)
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
    assert_array_equal(live.step(frames[0][1], 0.02).joint_positions, other.step(frames[0][1], 0.02).joint_positions)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"start": np.zeros(3)}, "start"),
        ({"start": [0.0, 1.6, 0.0, -2.9, 0.0, 0.1, 0.0]}, "start: "),
        ({"hold_after": 0.0}, "hold_after"),
        ({"clock": 5}, "clock"),
        ({"spec": "velocity"}, "spec"),
        ({"random_state": -1}, "random_state"),
        ({"path": np.zeros((3, 3))}, "Placement"),
        ({"reference": np.zeros(7)}, "reference"),
        ({"spec": mp.EllipsoidSpec(part="full")}, "6×6"),
    ],
)
def test_wrong_arguments_are_errors(small_result, options, words):
    """Before anything moves."""
    with pytest.raises(InvalidInputError, match=words):
        mp.Live.of(small_result, **options)
    with pytest.raises(InvalidInputError, match="person"):
        mp.Live(small_result.recording, small_result.arm.adapter, small_result.arm.robot)
    with pytest.raises(InvalidInputError, match="result"):
        mp.Live.of(small_result.arm)


def test_a_robot_whose_tip_is_far_away_is_said_to_lag(small_result, frames):
    """A person three times as fast leaves it behind: then it lags, and follows once its tip is near; never else."""
    points, time = frames
    live = mp.Live.of(small_result, clock=None)
    moments = played(live, points, time / 6.0)
    moments += [live.step(points[-1], time[-1] / 6.0 + 0.01 * i) for i in range(1, 150)]
    errors = {state: [one.tip_error for one in moments if one.state == state] for state in (FOLLOWING, LAGGING)}
    assert max(errors[FOLLOWING]) <= FAR
    assert max(errors[LAGGING]) > FAR
    assert min(errors[LAGGING]) > NEAR
    assert moments[-1].state == FOLLOWING


def test_neither_unit_nor_axes_of_frames_matter(small_result, frames):
    """Turned about any axis, moved, and in millimeters, the same frames give the same joint positions."""
    turn = Rotation.from_rotvec([0.4, -1.2, 2.0]).as_matrix()
    one, other = mp.Live.of(small_result, clock=None), mp.Live.of(small_result, clock=None)
    for points, t in zip(frames[0][:15], frames[1][:15], strict=True):
        there = 1e3 * points @ turn.T + [50.0, -7.0, 300.0]
        assert_allclose(one.step(points, t).joint_positions, other.step(there, t).joint_positions, atol=1e-6, rtol=0.0)
