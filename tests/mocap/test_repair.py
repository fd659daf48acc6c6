"""Faults of real recordings, made on purpose in recordings of which the truth is known."""

from dataclasses import replace

import numpy as np
import pytest

from maniport import arms
from maniport.errors import InvalidInputError, RecordingError
from maniport.mocap import read_recording
from maniport.mocap.cleaning import exchanged_back, in_one_unit, in_order, without_leaps, without_zeros
from maniport.mocap.roles import assign_roles
from maniport.mocap.smoothing import smoothed


@pytest.fixture
def swinging(slow_motion, record):
    """Ten seconds of a whole arm at 30 Hz that swings beside a trunk, without a fault."""
    arm = arms.rhuman(0.3, 0.27, 0.06)
    return record(arm, *slow_motion(arm, n=300, seconds=10.0, curved=True))


def changed(recording, name, frames, value):
    """The recording with other positions of one point in some frames."""
    positions = recording.positions.copy()
    positions[frames, recording.names.index(name)] = value
    return replace(recording, positions=positions)


# ---- without faults ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["ladder", "freeform"])
def test_real_recordings_come_back_as_they_are(name):
    """Nothing is repaired where nothing is wrong: not one of the steps makes a new recording."""
    recording = read_recording(name)
    assert without_zeros(recording) is recording
    assert exchanged_back(recording, recording.names) is recording
    assert in_one_unit(recording, assign_roles(recording)) is recording
    assert without_leaps(recording) is recording
    assert smoothed(recording) is recording


# ---- times -------------------------------------------------------------------------------------------------------


def test_late_frames_are_sorted_and_doubled_ones_dropped():
    """Frames in disorder come back in order, each time once, with their positions, and both is said."""
    time, positions = np.arange(40) / 30, np.arange(40.0)[:, None]
    order = np.arange(40)
    order[[10, 12]] = order[[12, 10]]
    order = np.insert(order, 20, 19)
    found, places, notes = in_order(time[order], positions[order])
    np.testing.assert_array_equal(found, time)
    np.testing.assert_array_equal(places, positions)
    assert "out of order in time and were sorted" in notes[0]
    assert "1 frames with the time of another one were left out" in notes[1]
    assert in_order(time, positions)[0] is time


@pytest.mark.parametrize(
    ("time", "words"),
    [
        (np.r_[np.arange(90), np.arange(90)] / 30, r"time goes back by 2.97 s at index 90, to 0 s"),
        (np.round(np.arange(90) / 30, 1), r"59 of 90 frames bear the time of another one, the first at index 1"),
    ],
)
def test_two_recordings_in_one_and_coarse_times_are_refused(time, words):
    """What sorting would shuffle, and dropping would thin out, is refused with the place."""
    with pytest.raises(InvalidInputError, match=words):
        in_order(time, np.zeros((len(time), 1)))


def test_a_body_of_another_size_is_refused(swinging):
    """A change of size that is no metric unit may be another person: refused with the time."""
    positions = swinging.positions.copy()
    positions[200:] *= 2.5
    with pytest.raises(RecordingError, match=r"6.69 to 10.00 s: the body is 2.5 times as large"):
        in_one_unit(replace(swinging, positions=positions), assign_roles(swinging))


def test_a_point_that_is_elsewhere_for_a_moment_is_missing(swinging):
    """A frame or two far from the way there and back are taken out, exactly these; a step that stays is not."""
    far = changed(swinging, "wrist", 70, swinging.point("wrist")[70] + np.array([0.0, 0.2, 0.0]))
    far = changed(far, "wrist", slice(90, 92), swinging.point("wrist")[90:92] + np.array([0.3, 0.0, 0.0]))
    clean = without_leaps(far)
    assert np.flatnonzero(np.isnan(clean.point("wrist")[:, 0])).tolist() == [70, 90, 91]
    assert any("wrist: elsewhere for a moment in 3 frames" in note for note in clean.notes)
    away = changed(swinging, "wrist", slice(150, 300), swinging.point("wrist")[150:] + np.array([0.3, 0.0, 0.0]))
    assert without_leaps(away) is away


# ---- jitter ------------------------------------------------------------------------------------------------------


def test_jitter_is_smoothed_as_far_as_the_data_say(swinging):
    """Noise of 10 mm falls to less than half, outliers draw nothing along, and what does not jitter stays."""
    generator = np.random.default_rng(1)
    track = swinging.point("wrist") + generator.normal(0.0, 0.01, (300, 3))
    track[generator.random(300) < 0.03] += [0.0, 0.2, 0.0]
    clean = smoothed(changed(swinging, "wrist", slice(None), track))
    error = np.linalg.norm(clean.point("wrist") - swinging.point("wrist"), axis=-1)
    assert np.sqrt(np.mean(error**2)) < 0.5 * 0.01 * np.sqrt(3)
    np.testing.assert_array_equal(clean.point("elbow"), swinging.point("elbow"))
    assert "wrist jitter by" in clean.quality_warnings[0]
    assert "smooth='off' leaves them as they are" in clean.quality_warnings[0]
