"""A rest pose at either end, from which the motion jumps, is removed; stillness of a person is kept."""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from format_files import write_csv
from maniport.mocap import Recording, read_recording
from maniport.mocap.cleaning import without_rest_poses

CASES = Path(__file__).parent / "cases"


@pytest.fixture(scope="module")
def control():
    return read_recording(CASES / "control.bvh")


@pytest.fixture(scope="module")
def rest(tmp_path_factory):
    """The T-pose of the skeleton [m], shape (n_points, 3)."""
    lines = (CASES / "rest_pose_5_frames.bvh").read_text().splitlines()
    first = lines.index("MOTION") + 3
    file = tmp_path_factory.mktemp("rest") / "still.bvh"
    text = "\n".join([*lines[:first], *[lines[first]] * 4])
    file.write_text(text.replace("Frames: 65", "Frames: 4"))
    return read_recording(file).positions[0]


def recording_of(control, positions, rate=30.0):
    return Recording(control.names, positions, np.arange(len(positions)) / rate)


def smooth_path(control, speed, count=60):
    """The motion of the control at a multiple of its speed, back and forth."""
    phase = np.abs((np.arange(count) * speed + 3.0) % (2 * 59) - 59)
    index = np.clip(phase, 0, 58.999)
    low = index.astype(int)
    part = (index - low)[:, None, None]
    return (1 - part) * control.positions[low] + part * control.positions[low + 1]


def test_frames_of_a_rest_pose_are_omitted(control):
    recording = read_recording(CASES / "rest_pose_5_frames.bvh")
    assert_allclose(recording.positions, control.positions, atol=1e-9)
    assert_allclose(recording.time, control.time, atol=1e-9)
    assert any("first 5 frames" in note and "rest pose" in note for note in recording.notes)


@pytest.mark.parametrize("rate", [25.0, 30.0, 60.0, 120.0])
@pytest.mark.parametrize("speed", [0.3, 1.0, 3.0])
@pytest.mark.parametrize("count", [1, 2, 7, 80])
def test_its_length_and_the_speed_of_the_motion_do_not_matter(control, rest, count, speed, rate):
    motion = smooth_path(control, speed * 30 / rate)
    still = np.tile(rest, (count, 1, 1))
    at_start = without_rest_poses(recording_of(control, np.concatenate([still, motion]), rate))
    assert_allclose(at_start.positions, motion)
    assert at_start.time[0] == pytest.approx(count / rate)
    at_end = without_rest_poses(recording_of(control, np.concatenate([motion, still]), rate))
    assert_allclose(at_end.positions, motion)
    assert_allclose(at_end.time, np.arange(len(motion)) / rate)
    both = without_rest_poses(
        recording_of(control, np.concatenate([still, motion, still]), rate), restarts=True
    )
    assert_allclose(both.positions, motion)
    assert_allclose(both.time, np.arange(len(motion)) / rate, atol=1e-12)
    assert len(both.notes) == 2


def test_two_rest_poses_in_a_row_are_omitted(control, rest):
    other = rest + [0.0, 0.3, 0.2] * np.linspace(0, 1, len(rest))[:, None]
    parts = [np.tile(rest, (4, 1, 1)), np.tile(other, (3, 1, 1)), control.positions]
    cleaned = without_rest_poses(recording_of(control, np.concatenate(parts)))
    assert_allclose(cleaned.positions, control.positions)


@pytest.mark.parametrize("rate", [5.0, 30.0, 120.0])
@pytest.mark.parametrize("speed", [0.5, 1.0, 4.0])
def test_stillness_before_and_after_a_motion_is_kept(control, speed, rate):
    """A frozen beginning that the motion continues, a person who starts smoothly, and repeated frames."""
    motion = smooth_path(control, speed * 30 / rate)
    frozen = motion.copy()
    frozen[:10] = motion[10]
    frozen[-10:] = motion[-11]
    ease = np.clip(np.arange(60) - 12, 0, 36)
    phase = 36 * (10 * (ease / 36) ** 3 - 15 * (ease / 36) ** 4 + 6 * (ease / 36) ** 5)
    low = phase.astype(int)
    part = (phase - low)[:, None, None]
    eased = (1 - part) * control.positions[low] + part * control.positions[low + 1]
    repeated = np.repeat(motion, 3, axis=0)
    for positions in (motion, frozen, eased, repeated, np.tile(motion[:1], (20, 1, 1))):
        recording = recording_of(control, positions, rate)
        assert without_rest_poses(recording) is recording


def test_an_outlier_in_the_first_frame_is_no_rest_pose(control):
    positions = control.positions.copy()
    positions[0, 3] += 1.0
    positions[5:9, 7] = np.nan
    recording = recording_of(control, positions)
    assert without_rest_poses(recording) is recording


def test_missing_points_do_not_hide_a_rest_pose(control, rest):
    positions = np.concatenate([np.tile(rest, (3, 1, 1)), control.positions])
    positions[:, 4] = np.nan
    positions[4, 6] = np.nan
    assert len(without_rest_poses(recording_of(control, positions))) == len(control)


def test_times_of_a_file_are_kept(tmp_path, control, rest):
    """The times of a table are its own; those of a file with a rate alone begin at zero."""
    positions = np.concatenate([np.tile(rest, (6, 1, 1)), control.positions])
    recording = read_recording(
        write_csv(tmp_path / "a.csv", recording_of(control, positions)), unit="m"
    )
    assert len(recording) == len(control)
    assert recording.time[0] == pytest.approx(0.2)
    np.savez(tmp_path / "b.npz", names=list(control.names), positions=positions, fps=30.0, unit="m")
    assert read_recording(tmp_path / "b.npz").time[0] == 0.0


@pytest.mark.parametrize("name", ["ladder", "freeform", "both-arms"])
def test_bundled_recordings_have_none(name):
    recording = read_recording(name)
    assert not any("rest pose" in note for note in recording.notes)
