"""C3D files of every kind, compared with ezc3d, and those at which native code crashed or took all memory."""

import time
import tracemalloc

import ezc3d
import numpy as np
import pytest

from fuzz.c3d_writer import LABELS, Writer
from maniport.errors import FileFormatError
from maniport.mocap import read_recording, shipped_recording
from maniport.mocap.readers.c3d import DEC, MIPS

KINDS = [(processor, integer, analog) for processor in (84, DEC, MIPS) for integer in (False, True)
         for analog in (0, 3)]  # fmt: skip


@pytest.mark.parametrize(("processor", "integer", "analog"), KINDS)
def test_every_kind_is_read(tmp_path, processor, integer, analog):
    """Points of each processor, as integers and as floats, with and without analog channels, are those of ezc3d."""
    writer, file = Writer(processor, integer, analog), tmp_path / "a.c3d"
    file.write_bytes(writer.content())
    recording = read_recording(file)
    seen = ~writer.lost
    np.testing.assert_allclose(recording.positions[seen], writer.points[seen] / 1000, rtol=0, atol=1e-7)
    np.testing.assert_array_equal(np.isnan(recording.positions[..., 0]), writer.lost)
    assert recording.names == LABELS
    assert recording.rate == pytest.approx(50.0)
    if processor != MIPS:  # which ezc3d does not read
        points = ezc3d.c3d(str(file))["data"]["points"][:3]
        np.testing.assert_allclose(recording.positions[seen], points.T[seen] / 1000, atol=1e-9)


def test_shifted_parameters_end_at_once(tmp_path):
    """Parameters shifted by any number of bytes, which took ezc3d 133 s and 4.3 GB, end in a message or a recording."""
    whole, file = shipped_recording("freeform").read_bytes(), tmp_path / "shifted.c3d"
    tracemalloc.start()
    started = time.process_time()
    for shift in range(1, 60):
        file.write_bytes(whole[:516] + bytes([shift]) * shift + whole[516:])
        try:
            read_recording(file)
        except FileFormatError as error:
            assert "shifted.c3d" in str(error)  # noqa: PT017 - either outcome is right
    assert time.process_time() - started < 10
    assert tracemalloc.get_traced_memory()[1] < 20e6
    tracemalloc.stop()


def test_long_recordings_say_their_length_elsewhere(tmp_path):
    """Where two bytes do not hold the number of frames, TRIAL or POINT:FRAMES do."""
    writer, file = Writer(), tmp_path / "a.c3d"
    file.write_bytes(writer.content(frames=0xFFFF))
    with pytest.raises(FileFormatError, match="announces 65535 frames"):
        read_recording(file)
    more = writer.group(3, "TRIAL") + writer.parameter(3, "ACTUAL_START_FIELD", 2, (2,), writer.short(1, 0))
    more += writer.parameter(3, "ACTUAL_END_FIELD", 2, (2,), writer.short(7, 0))
    file.write_bytes(writer.content(frames=0xFFFF, more=more))
    assert len(read_recording(file)) == 7


@pytest.mark.parametrize(("used", "message"), [(60_000, "has 60000 points; at most 5000"), (0, "holds no points")])
def test_what_a_c3d_announces_is_bounded(tmp_path, used, message):
    """Points and frames beyond the bounds, and none, are refused."""
    writer, file = Writer(), tmp_path / "a.c3d"
    content = writer.content()
    at = content.index(b"USED") + 8
    file.write_bytes(content[:at] + writer.short(used) + content[at + 2 :])
    with pytest.raises(FileFormatError, match=message):
        read_recording(file)
