import numpy as np
import pytest

from maniport.errors import FileFormatError, UnknownNameError
from maniport.mocap import read_recording, shipped_recording
from maniport.mocap.import_options import UNITS

ARM = ("RSHO", "RELB", "C7", "T10")
PLACES = np.array([[0, -200, 1400], [0, -200, 1100], [0, 0, 1450], [0, 0, 1200]], dtype=float)


def still(frames=10):
    """Four markers of a person who stands still [mm]."""
    return np.tile(PLACES, (frames, 1, 1))


# ---- BVH ----------------------------------------------------------------------------------------------------------


def test_bvh_points_are_forward_kinematics(bvh_file):
    """Joint origins follow from offsets and rotations, in metres, with the time of the frames."""
    recording = read_recording(bvh_file())
    np.testing.assert_allclose(recording.time, np.arange(6) / 50)
    np.testing.assert_allclose(recording.point("RightArm")[0], [-0.18, 1.48, 0], atol=1e-9)
    forearm = recording.point("RightHand") - recording.point("RightForeArm")
    np.testing.assert_allclose(np.linalg.norm(forearm, axis=1), 0.26, atol=1e-9)
    assert recording.rate == pytest.approx(50)
    assert recording.up == "y"


@pytest.mark.parametrize("unit", ["m", "cm", "mm", "inch", "CMU"])
def test_bvh_unit_is_recognised(bvh_file, unit):
    """The same skeleton in any unit gives the same metres, and a note names the unit."""
    recording = read_recording(bvh_file(scale=0.01 / UNITS[unit]))
    reference = read_recording(bvh_file(name="reference.bvh"))
    np.testing.assert_allclose(recording.positions, reference.positions, atol=2e-5)
    assert any(f"recognised as {unit} " in note for note in recording.notes)


def test_bvh_rest_pose_in_front_is_left_out(bvh_file):
    """A first frame from which the whole body jumps away is dropped, with a note."""
    file = bvh_file(frames=8)
    lines = file.read_text().splitlines()
    row = lines.index("MOTION") + 3
    lines[row] = " ".join(["500", "0", "0", "170", *lines[row].split()[4:]])
    file.write_text("\n".join(lines))
    recording = read_recording(file)
    assert len(recording) == 7
    assert recording.time[0] == 0
    assert any("rest pose" in note for note in recording.notes)


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda text: text[: text.index("JOINT RightForeArm")], "cut off in its hierarchy"),
        (lambda text: text[: text.index("Frame Time")], "must be followed by 'Frames:'"),
        (lambda text: "\n".join(text.splitlines()[:-3]), "cut off: its header says 6 frames, and there are 3"),
        (lambda text: text.replace("Frames: 6", "Frames: 600"), "cut off: its header says 600 frames, and there are 6"),
        (lambda text: text.replace("0.02", "0.00"), "Frame Time at line .* positive number; found '0.00'"),
        (lambda text: text.replace("100", "abc", 1), "not readable as BVH"),
        (lambda text: text.replace("}", "", 1), "closing braces"),
        (lambda text: text.replace("CHANNELS 3 Z", "CHANNELS 4 Z", 1), "does not list the channels"),
        (lambda text: text.replace("CHANNELS 3", "CHANNELS 1 Xrotation\nCHANNELS 3", 1), "of this joint stand twice"),
        (lambda text: text.replace("Frames: 6", "Frames: " + "9" * 5000), "must be followed by 'Frames:'"),
        (lambda text: text[: text.index("Frame Time")] + "Frame Time: 0.02\n", "holds no frames"),
        (lambda text: "\x00\xff\x17" * 300, "does not begin with HIERARCHY"),
    ],
)
def test_damaged_bvh_gets_one_clear_error(bvh_file, damage, message):
    """Truncated and garbled files raise FileFormatError that names the file and what is wrong."""
    file = bvh_file()
    file.write_text(damage(file.read_text()))
    with pytest.raises(FileFormatError, match=message) as caught:
        read_recording(file)
    assert "small.bvh" in str(caught.value)
    assert caught.value.__cause__ is None


# ---- C3D ----------------------------------------------------------------------------------------------------------


def test_c3d_drop_outs_are_missing(c3d_file):
    """Zeros and negative residuals are missing, and the note tells how much."""
    points, residuals = still(), np.zeros((10, 4))
    points[3, 0] = 0
    residuals[5, 1] = -1
    points[:, 2] = 0
    recording = read_recording(c3d_file(points, ARM, residuals=residuals))
    np.testing.assert_allclose(recording.missing, [0.1, 0.1, 1.0, 0.0])
    assert any("30.0%" in note and "never seen: C7" in note for note in recording.notes)


def test_c3d_names_are_cleaned(c3d_file):
    """Prefix, quotes and blanks are taken off; names that would then clash keep their prefix."""
    file = c3d_file(still(), ["Nick01:RSHO", "'Nick01:RELB'", '"C7"', " T10 "])
    assert read_recording(file).names == ARM
    file = c3d_file(still(), ["A:RSHO", "B:RSHO", "A:RELB", "B:RELB"])
    assert read_recording(file, unit="mm").names == ("A:RSHO", "B:RSHO", "A:RELB", "B:RELB")


@pytest.mark.parametrize(("order", "up"), [((0, 1, 2), "z"), ((0, 2, 1), "y"), ((2, 0, 1), "x")])
def test_c3d_up_axis_is_seen_in_the_body(c3d_file, order, up):
    """The axis along which the neck lies above the trunk is up, whatever it is called."""
    file = c3d_file(still()[..., order], ARM)
    assert read_recording(file).up == up
    assert read_recording(file, up="-x").up == "-x"


@pytest.mark.parametrize("size", [1, 512, 1500, 40000, 83900])
def test_truncated_c3d_gets_one_clear_error(tmp_path, size):
    """Wherever a file is cut off, the error names it and no library speaks."""
    whole = shipped_recording("freeform").read_bytes()
    file = tmp_path / "cut.c3d"
    needed = 83744  # the data end here; the rest of the last block is padding
    file.write_bytes(whole[: min(size, needed - 1)])
    with pytest.raises(FileFormatError, match=r"cut\.c3d: .*(cut off|damaged)") as caught:
        read_recording(file)
    assert caught.value.__cause__ is None


@pytest.mark.parametrize("suffix", [".bvh", ".c3d"])
def test_empty_missing_and_folder(tmp_path, suffix):
    """An empty file, no file and a folder are told apart, and neighbours are suggested."""
    (tmp_path / f"empty{suffix}").touch()
    (tmp_path / f"folder{suffix}").mkdir()
    with pytest.raises(FileFormatError, match="the file is empty"):
        read_recording(tmp_path / f"empty{suffix}")
    with pytest.raises(FileFormatError, match=f"no such file; there are 'empty{suffix}'"):
        read_recording(tmp_path / f"emty{suffix}")
    with pytest.raises(FileFormatError, match="is a folder"):
        read_recording(tmp_path / f"folder{suffix}")


def test_shipped_recordings_read_by_name_and_path():
    """All are found by name, and an unknown name lists them."""
    for name, frames, rate in (("ladder", 1128, 30), ("freeform", 367, 40), ("both-arms", 367, 40)):
        recording = read_recording(name)
        assert len(recording) == frames
        assert recording.rate == pytest.approx(rate, rel=1e-4)
        assert recording.up == "y"
        np.testing.assert_array_equal(recording.positions, read_recording(shipped_recording(name)).positions)
    with pytest.raises(UnknownNameError, match=r"unknown shipped recording 'leader'.*'ladder'"):
        shipped_recording("leader")
