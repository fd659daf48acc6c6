import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

from maniport.mocap import Recording, read_recording

pytestmark = pytest.mark.filterwarnings("error::RuntimeWarning")


@st.composite
def recordings(draw):
    frames = draw(st.integers(2, 30))
    points = draw(st.integers(1, 5))
    seed = draw(st.integers(0, 2**32 - 1))
    rng = np.random.default_rng(seed)
    positions = rng.standard_normal((frames, points, 3))
    positions[rng.random((frames, points)) < draw(st.sampled_from([0.0, 0.2, 0.6]))] = np.nan
    time = draw(st.sampled_from([0.0, -5.0, 1.7e9])) + np.cumsum(rng.uniform(0.005, 0.05, frames))
    return Recording([f"p{k}" for k in range(points)], positions, time)


def same(one, other):
    assert one.names == other.names
    assert_array_equal(one.positions, other.positions)
    assert_array_equal(one.time, other.time)


@given(recording=recordings(), low=st.floats(0, 1), high=st.floats(0, 1))
def test_crop_select_and_save_keep_the_points(recording, low, high, tmp_path_factory):
    assume(recording.observed)  # a file without any point is refused
    first, last = sorted(int(share * (len(recording) - 1)) for share in (low, high))
    start, stop = recording.time[[first, last]]
    part = recording.crop(start, stop)
    assert len(part) == last - first + 1
    same(part.crop(start, stop), part)
    same(recording.crop(), recording)
    same(recording.select(recording.names), recording)
    back = recording.select(recording.names[::-1])
    same(back.select(recording.names), recording)
    assert not recording.positions.flags.writeable
    assert not np.may_share_memory(
        Recording(recording.names, given_to := part.positions.copy(), part.time).positions, given_to
    )
    path = tmp_path_factory.mktemp("recording") / "recording.npz"
    recording.save(path)
    same(read_recording(path), recording)
