from dataclasses import replace

import numpy as np
import pytest

from maniport import arms
from maniport.errors import InvalidInputError
from maniport.mocap import read_recording
from maniport.mocap.cleaning import in_order, smoothed, unswapped, without_outliers, without_zeros


def changed(recording, name, frames, value):
    positions = recording.positions.copy()
    positions[frames, recording.names.index(name)] = value
    return replace(recording, positions=positions)


@pytest.mark.parametrize("name", ["ladder", "freeform"])
def test_recordings_without_faults_stay_as_they_are(name):
    recording = read_recording(name)
    assert without_zeros(recording) is recording
    assert unswapped(recording, recording.names) is recording
    assert without_outliers(recording) is recording
    assert smoothed(recording) is recording


def test_frames_whose_time_does_not_increase_are_omitted():
    time = np.arange(40) / 30
    positions = np.arange(40.0)[:, None]
    order = np.insert(np.arange(40), [20, 30], [19, 10])
    times, places, notes = in_order(time[order], positions[order])
    np.testing.assert_array_equal(times, time)
    np.testing.assert_array_equal(places, positions)
    assert "2 frames" in notes[0]
    assert in_order(time, positions)[0] is time
    twice = np.r_[np.arange(90), np.arange(90)] / 30
    rounded = np.round(np.arange(90) / 30, 1)
    for wrong, words in (
        (twice, "90 of 180 frames .* index 90, 0 s"),
        (rounded, "59 of 90 frames .* index 1"),
    ):
        with pytest.raises(InvalidInputError, match=words):
            in_order(wrong, np.zeros((len(wrong), 1)))


def test_outliers_are_missing(slow_motion, record):
    arm = arms.rhuman(0.3, 0.27, 0.06)
    swinging = record(arm, *slow_motion(arm, n=300, seconds=10.0, curved=True))
    far = changed(swinging, "wrist", 70, swinging.point("wrist")[70] + np.array([0.0, 0.2, 0.0]))
    far = changed(
        far, "wrist", slice(90, 92), swinging.point("wrist")[90:92] + np.array([0.3, 0.0, 0.0])
    )
    clean = without_outliers(far)
    assert np.flatnonzero(np.isnan(clean.point("wrist")[:, 0])).tolist() == [70, 90, 91]
    assert any("wrist: outlier in 3 frames" in note for note in clean.notes)
    away = changed(
        swinging,
        "wrist",
        slice(150, 300),
        swinging.point("wrist")[150:] + np.array([0.3, 0.0, 0.0]),
    )
    assert without_outliers(away) is away
