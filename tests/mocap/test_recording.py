import numpy as np
import pytest

from maniport.errors import InvalidInputError
from maniport.mocap import Recording


def wave(n=101, rate=100.0, missing=()):
    time = np.arange(n) / rate
    circle = np.stack([np.cos(2 * time), np.sin(2 * time), np.zeros(n)], axis=-1)
    for start, stop in missing:
        circle[start:stop] = np.nan
    return Recording(("circle", "still"), np.stack([circle, np.ones((n, 3))], axis=1), time, "wave")


def test_short_gaps_are_interpolated_and_long_ones_stay():
    filled = wave(missing=[(0, 3), (20, 30), (40, 70), (99, 101)]).fill_gaps()
    lost = np.isnan(filled.point("circle")[:, 0])
    assert np.flatnonzero(lost).tolist() == [0, 1, 2, *range(40, 70), 99, 100]
    assert np.abs(filled.positions - wave().positions)[~lost].max() < 1e-3
    assert any("circle" in note and "interpolated (10 frames)" in note for note in filled.notes)


def test_a_crop_beyond_the_end_causes_a_warning():
    end = float(wave().time[-1])
    assert wave().crop(stop=end + 0.01).quality_warnings == ()
    assert "beyond the end of the recording" in wave().crop(0.2, end + 1.0).quality_warnings[0]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"time": [0.0, 0.0, 1.0]}, "time"),
        ({"time": [0.0, np.nan, 1.0]}, "time"),
        ({"time": []}, "time"),
        ({"names": ("a", "a")}, "names"),
        ({"positions": np.zeros((3, 1, 3))}, "positions"),
        ({"positions": np.full((3, 2, 3), np.inf)}, "positions"),
        ({"positions": "no"}, "positions"),
    ],
)
def test_wrong_values_are_rejected(change, message):
    good = {"names": ("a", "b"), "positions": np.zeros((3, 2, 3)), "time": [0.0, 1.0, 2.0]}
    with pytest.raises(InvalidInputError, match=message):
        Recording(**(good | change))
