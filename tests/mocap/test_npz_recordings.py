"""Recordings as NumPy arrays: what is written is read again, and what is wrong is named."""

import numpy as np
import pytest

from maniport.errors import FileFormatError
from maniport.mocap import performed, read_recording


@pytest.fixture
def played(arm, slow_motion):
    """A recording of a model's motion."""
    time, q = slow_motion(arm, n=12)
    return performed(arm, q, time)


def test_what_is_saved_is_read_again(played, tmp_path):
    """Names, positions, times and the axis up are the same, bit by bit."""
    played.save(tmp_path / "played.npz")
    again = read_recording(tmp_path / "played.npz")
    assert (again.names, again.up) == (played.names, played.up)
    assert np.array_equal(again.positions, played.positions)
    assert np.array_equal(again.time, played.time)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"names": None}, "12 joints without names"),
        ({"positions": np.array([[["a"] * 3] * 11] * 12)}, "positions must be numbers"),
        ({"names": np.arange(11)}, "names must be text"),
        ({"time": None}, "give rate="),
        ({"time": None, "rate": -1}, "or rate"),
        ({"time": np.zeros(12)}, "time"),
        ({"up": "w"}, None),
        ({"unit": "mile"}, None),
    ],
)
def test_what_is_wrong_is_named(played, tmp_path, change, told):
    """Arrays that are missing or of another shape; a unit or axis that is none is recognised instead."""
    good = {"names": np.array(played.names), "positions": played.positions, "time": played.time, "up": "z", "unit": "m"}
    file = tmp_path / "x.npz"
    np.savez(file, **{key: value for key, value in (good | change).items() if value is not None})
    if told is None:
        assert read_recording(file).positions == pytest.approx(played.positions)
        return
    with pytest.raises(FileFormatError, match=told):
        read_recording(file)
