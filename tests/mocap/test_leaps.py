import numpy as np
import pytest

from maniport.mocap.jumps import (
    FASTEST_JOINT,
    calibration_pose,
    joint_jumps,
    treated,
    without_leaps,
)

TIME = np.arange(120) / 30
FRAMES = np.arange(120)
SWING = np.stack([0.5 * np.sin(2 * np.pi * 0.5 * TIME), 0.3 * TIME], axis=1)


@pytest.fixture
def leaping():
    """Two joints, one of which leaps by 80° into frame 50 and by 70° into frame 52."""
    q = SWING.copy()
    q[50:, 0] += np.radians(80)
    q[52:, 0] += np.radians(70)
    return q


def test_leaps_are_found_where_they_are_and_nowhere_else(leaping):
    """Steps faster than joints are told with time, joint and size; what is missing between frames is none."""
    assert joint_jumps(leaping, TIME, FRAMES).tolist() == [50, 52]
    assert not len(joint_jumps(SWING, TIME, FRAMES))
    assert not len(joint_jumps(SWING[:1], TIME[:1], FRAMES[:1]))
    assert not len(joint_jumps(leaping[[0, 50]], TIME[[0, 50]], FRAMES[[0, 50]]))
    _, kept, text = treated(leaping, TIME, FRAMES, ("elv_angle", "elbow_flexion"), "split")
    assert "2 of 120 frames" in text
    assert "1.67 s, 1.73 s" in text
    assert "most elv_angle, by 8" in text
    assert (kept.start, kept.stop) == (52, 120)


def test_joints_go_evenly_over_leaps(leaping):
    """No joint leaps on, none leaves the range of the frames around, and frames elsewhere stay to the last bit."""
    even, around = without_leaps(leaping, TIME, FRAMES, joint_jumps(leaping, TIME, FRAMES))
    assert not len(joint_jumps(even, TIME, FRAMES))
    near = np.minimum(np.abs(TIME - TIME[50]), np.abs(TIME - TIME[52])) < around + 1e-9
    np.testing.assert_array_equal(even[~near], leaping[~near])
    assert around == 0.15
    assert even[near, 0].min() >= leaping[40:62, 0].min()
    assert even[near, 0].max() <= leaping[40:62, 0].max()
    assert np.degrees(np.abs(np.diff(even, axis=0)).max()) * 30 < FASTEST_JOINT


@pytest.mark.parametrize(
    ("upper", "held", "words"),
    [
        ((0.0, -1.0, 0.0), 30, "in a T-pose, as for calibration, held for 0.97 s"),
        ((0.1, 0.7, -0.7), 30, "in an A-pose, as for calibration, held for 0.97 s"),
        ((0.0, -1.0, 0.0), 1, "in a T-pose, as for calibration, left at once"),
        ((0.0, -1.0, 0.0), 10, ""),  # not long enough, and left gently
        ((0.0, 0.0, -1.0), 30, ""),  # the arm hangs
        ((0.0, -1.0, 0.0), 120, ""),  # nothing else is recorded
    ],
)
def test_poses_for_calibration_are_told(upper, held, words):
    """A straight arm to the side that is held at the beginning, or left in one frame, is told with the cure."""
    step = 1.0 if held == 1 else 0.1
    angle = step * np.maximum(FRAMES - held + 1, 0)[:, None]
    direction = np.cos(angle) * np.array(upper) / np.linalg.norm(upper) + np.sin(angle) * np.array([0.6, 0.0, -0.8])
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    found = calibration_pose({"upper arm": direction, "forearm": direction}, TIME)
    assert words in found if words else not found
