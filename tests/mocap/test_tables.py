"""Tables as programs of optical motion capture, spreadsheets and people in many languages write them."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from dialect_files import POINTS, SKELETONS, mirrored, motion, write_bvh
from format_files import SAUL, write_csv, write_mot, write_motive, write_nexus, write_qualisys, write_trc
from maniport.errors import FileFormatError
from maniport.mocap import read_recording


@pytest.fixture(scope="module")
def made():
    """A right arm moves."""
    return motion()


@pytest.fixture(scope="module")
def markers(made):
    """It under the names of Plug-in Gait, one point missing once."""
    recording = made.recording(mirrored(POINTS["Plug-in Gait"]))
    positions = recording.positions.copy()
    positions[3, 1] = np.nan
    return type(recording)(recording.names, positions, recording.time, "z")


def bare(names):
    """Names without what stands before a colon."""
    return tuple(name.rpartition(":")[2] for name in names)


@pytest.mark.parametrize(
    ("write", "name", "up", "options"),
    [
        (write_motive, "a.csv", "y", {}),
        (write_motive, "a.csv", "y", {"solved": False}),
        (write_nexus, "a.csv", "z", {}),
        (write_qualisys, "a.tsv", "z", {}),
        (write_qualisys, "a.tsv", "z", {"columns": False}),
        (write_qualisys, "a.txt", "z", {}),
    ],
)
def test_exports_of_optical_motion_capture(tmp_path, markers, write, name, up, options):
    """Points, what is missing, and times are those that were written, to a micrometre."""
    recording = read_recording(write(tmp_path / name, markers, **options))
    turn = np.eye(3)[[1, 2, 0]] if up == "y" else np.eye(3)
    assert (bare(recording.names), recording.up) == (markers.names, up)
    assert_allclose(recording.positions, markers.positions @ turn.T, atol=1e-6)
    assert_allclose(recording.time, markers.time, atol=1e-6)
    assert any("unit mm" in note for note in recording.notes)


@pytest.mark.parametrize(
    ("name", "change", "told"),
    [
        ("a.csv", (",Position", ",Rotation"), "table of Motive holds no positions of points; export markers or bones"),
        ("a.csv", ("Frame,Time", "Time"), "cut off in its header: there is no line that begins with Frame"),
        ("b.csv", ("X,Y,Z", "FX,FY,FZ"), "table of Nexus holds no positions of points; export trajectories"),
        ("a.tsv", ("DATA_INCLUDED\t3D", "DATA_INCLUDED\t6D"), "holds 6D, not positions of markers; export 3D data"),
    ],
)
def test_exports_without_positions_are_refused(tmp_path, markers, name, change, told):
    """The message names the program and what to export."""
    file = tmp_path / name
    {"a.csv": write_motive, "b.csv": write_nexus, "a.tsv": write_qualisys}[name](file, markers)
    file.write_text(file.read_text().replace(*change))
    with pytest.raises(FileFormatError, match=told):
        read_recording(file)


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16-be"])
def test_text_of_windows_is_read(tmp_path, made, markers, encoding):
    """A mark of the encoding in front, and UTF-16, change nothing in any format of text."""
    write_bvh(tmp_path / "a.bvh", SKELETONS["LAFAN1"], made)
    write_trc(tmp_path / "a.trc", markers)
    write_mot(tmp_path / "a.mot", made.time, made.joint_angles, SAUL)
    write_csv(tmp_path / "a.csv", markers)
    for file in list(tmp_path.iterdir()):
        before = read_recording(file)
        text = ("\ufeff" if encoding == "utf-16-be" else "") + file.read_text()
        file.write_bytes(text.replace("\n", "\r\n").encode(encoding))
        again = read_recording(file)
        assert again.names == before.names, file
        assert_allclose(again.positions, before.positions, atol=1e-12)


def test_fractions_with_a_comma(tmp_path, markers):
    """As spreadsheets write them in many languages: fields are parted by semicolons or tabs."""
    file = write_csv(tmp_path / "a.csv", markers)
    before = read_recording(file).positions
    file.write_text(file.read_text().replace(",", ";").replace(".", ","))
    assert_allclose(read_recording(file).positions, before)
    trc = write_trc(tmp_path / "a.trc", markers)
    lines = trc.read_text().splitlines()
    trc.write_text("\n".join([*lines[:6], *(line.replace(".", ",") for line in lines[6:])]))
    assert_allclose(read_recording(trc).positions, before, atol=1e-12)


@pytest.mark.parametrize(("sign", "comma"), [(",", "."), (";", "."), (";", ",")])
def test_trc_with_other_separators(tmp_path, markers, sign, comma):
    """As spreadsheets save them: all columns and the header are read, with a warning."""
    file = write_trc(tmp_path / "a.trc", markers, "mm", 0.001)
    before = read_recording(file)
    file.write_text(file.read_text().replace(".", comma).replace("\t", sign))
    after = read_recording(file)
    assert (after.names, after.up, len(after.time)) == (before.names, before.up, len(before.time))
    assert_allclose(after.positions, before.positions, atol=1e-12)
    assert_allclose(after.time, before.time, atol=1e-12)
    assert (len(before.quality_warnings), len(after.quality_warnings)) == (0, 1)


def test_what_stands_for_a_missing_number(tmp_path, markers):
    """Words of R, pandas and spreadsheets; any other word is refused with its line. Excel's first line is skipped."""
    file = write_csv(tmp_path / "a.csv", markers)
    wanted, text = read_recording(file).positions, file.read_text()
    for word in ("NA", "n/a", "NULL", "None", "nan"):
        file.write_text("sep=,\n" + text.replace(",,,", f",{word},{word},", 1))
        assert_allclose(read_recording(file).positions, wanted)
    file.write_text(text.replace(",,,", ",,lost,", 1))
    with pytest.raises(FileFormatError, match="line 5: could not convert string to float: 'lost'"):
        read_recording(file)
