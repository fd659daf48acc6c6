"""Spellings of known formats that other programs and people write."""

import re
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from format_files import SAUL, write_csv, write_mot, write_nexus, write_trc
from fuzz.c3d_writer import Writer
from maniport.errors import FileFormatError
from maniport.mocap import read_recording

CASES = Path(__file__).parent / "cases"
CONTROL = (CASES / "control.bvh").read_text()


@pytest.fixture(scope="module")
def control():
    return read_recording(CASES / "control.bvh")


def compact(text):
    """Write braces and offsets on the lines of names and channels."""
    lines = text.splitlines()
    motion = lines.index("MOTION")
    head = " ".join(line.strip() for line in lines[:motion])
    for word in ("ROOT", "JOINT", "End Site", "}"):
        head = head.replace(word, f"\n{word}")
    return "\n".join([head, *lines[motion:]])


@pytest.mark.parametrize(
    "change",
    [
        lambda text: text.replace("\n", "\r\n"),
        lambda text: "\n".join(
            line.rstrip() + (" {" if line.split()[:1] in (["ROOT"], ["JOINT"], ["End"]) else "")
            for line in text.splitlines()
            if line.strip() != "{"
        ),
        lambda text: text.replace("\n}", " }"),
        compact,
    ],
)
def test_places_of_braces_do_not_matter(tmp_path, control, change):
    file = tmp_path / "a.bvh"
    file.write_text(change(CONTROL))
    recording = read_recording(file)
    assert recording.names == control.names
    assert_allclose(recording.positions, control.positions, atol=1e-12)


@pytest.mark.parametrize("name", ["brace_on_the_line_of_the_name.bvh", "comma_decimals.bvh"])
def test_braces_and_decimal_commas_of_the_cases(control, name):
    recording = read_recording(CASES / name)
    assert recording.names == control.names
    assert_allclose(recording.positions, control.positions, atol=1e-12)
    assert_allclose(recording.time, control.time)


def test_one_label_above_each_column_of_a_trc(tmp_path, markers):
    case = read_recording(CASES / "label_above_each_column.trc")
    assert case.names[:3] == ("C7", "RShoulder", "RElbow")
    assert len(case.names) == 10
    expected = read_recording(write_trc(tmp_path / "a.trc", markers))
    lines = (tmp_path / "a.trc").read_text().splitlines()
    thrice = [[name] * 3 for name in markers.names]
    axes = [[f"{name}_{axis}" for axis in "XYZ"] for name in markers.names]
    for labels, count in ((thrice, 14), (axes, 14), (thrice, 42)):
        assert len(markers.names) == 14
        changed = list(lines)
        changed[2] = changed[2].replace("\t14\t", f"\t{count}\t")
        changed[3] = "\t".join(["Frame#", "Time", *(label for group in labels for label in group)])
        file = tmp_path / "b.trc"
        file.write_text("\n".join(changed))
        recording = read_recording(file)
        assert recording.names == expected.names
        assert_allclose(recording.positions, expected.positions)
    changed[2] = lines[2]
    changed[3] = "\t".join(["Frame#", "Time", *(f"P{i}" for i in range(42))])
    file.write_text("\n".join(changed))
    with pytest.raises(FileFormatError, match=r"line 4.*42.*14"):
        read_recording(file)


@pytest.mark.parametrize("section", ["Model Outputs", "Devices", "Joints"])
def test_an_export_of_nexus_without_trajectories(tmp_path, markers, section):
    text = (CASES / "nexus_model_outputs_only.csv").read_text()
    file = tmp_path / "a.csv"
    file.write_text(text.replace("Model Outputs", section))
    with pytest.raises(FileFormatError, match=f"export Trajectories.*{section}"):
        read_recording(file)
    both = write_nexus(tmp_path / "b.csv", markers).read_text()
    file.write_text(text + "\n" + both[both.index("Trajectories") :])
    assert len(read_recording(file)) == len(markers)


@pytest.mark.parametrize("separator", [",", ";", ", "])
@pytest.mark.parametrize("filled", [False, True])
def test_separators_of_opensim_tables(tmp_path, made, separator, filled):
    file = write_mot(tmp_path / "a.mot", made.time, made.joint_angles, SAUL)
    expected = read_recording(file)
    text = file.read_text().replace("\t", separator)
    if filled:  # by a spreadsheet
        head, _, table = text.partition("endheader\n")
        text = head.replace("\n", ",,,\n") + "endheader,,,,\n" + table
    file.write_text(text)
    recording = read_recording(file)
    assert recording.format == ".mot"
    assert_allclose(recording.positions, expected.positions, atol=1e-9)
    file.write_text("\n".join(text.splitlines()[:-9]))
    with pytest.raises(FileFormatError, match="40 rows"):
        read_recording(file)


def test_capitals_in_the_columns_of_opensim(tmp_path, made):
    file = write_mot(tmp_path / "a.mot", made.time, made.joint_angles, SAUL)
    expected = read_recording(file)
    text = file.read_text()
    names = "\t".join(["time", *SAUL])
    file.write_text(text.replace(names, names.upper()))
    assert_allclose(read_recording(file).positions, expected.positions, atol=1e-9)


def test_a_rate_replaces_one_that_is_zero(tmp_path, made, markers):
    writer = Writer()
    content = writer.content()
    at = content.index(b"RATE") + 8
    rate = np.frombuffer(content[at : at + 4], "<f4")[0]
    assert rate == 50
    file = tmp_path / "a.c3d"
    file.write_bytes(content[:at] + bytes(4) + content[at + 4 :])
    with pytest.raises(FileFormatError, match=r"RATE.*rate="):
        read_recording(file)
    assert read_recording(file, rate=50).rate == pytest.approx(50)
    np.savez(tmp_path / "b.npz", names=list(markers.names), positions=markers.positions, fps=0)
    with pytest.raises(FileFormatError, match="rate="):
        read_recording(tmp_path / "b.npz", unit="m")
    assert read_recording(tmp_path / "b.npz", unit="m", rate=50).rate == pytest.approx(50)


ENCODINGS = [
    "utf-8-sig",
    "utf-16",
    "utf-16-le",
    "utf-16-be",
    "utf-32",
    "utf-32-le",
    "cp932",
    "euc_jp",
]
MMD = {
    "Hips": "センター",
    "Spine": "上半身",
    "Spine1": "上半身2",
    "Neck": "首",
    "Head": "頭",
    "LeftShoulder": "左肩",
    "LeftArm": "左腕",
    "LeftForeArm": "左ひじ",
    "LeftHand": "左手首",
    "RightShoulder": "右肩",
    "RightArm": "右腕",
    "RightForeArm": "右ひじ",
    "RightHand": "右手首",
}


def hierarchy(names):
    """The control with other names of joints."""
    return re.sub(r"(ROOT|JOINT) (\w+)", lambda found: f"{found[1]} {names(found[2])}", CONTROL)


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_encodings_are_recognized(tmp_path, control, encoding):
    file = tmp_path / "a.bvh"
    file.write_bytes(hierarchy(lambda name: MMD.get(name, name)).encode(encoding))
    recording = read_recording(file)
    assert "右腕" in recording.names
    assert_allclose(recording.positions, control.positions, atol=1e-9)


@pytest.mark.parametrize("encoding", ["utf-16-le", "utf-16-be", "utf-32-le", "cp1252"])
def test_tables_in_other_encodings(tmp_path, markers, encoding):
    for name, write in (("a.csv", write_csv), ("a.trc", write_trc)):
        file = write(tmp_path / name, markers)
        before = read_recording(file)
        file.write_bytes(file.read_text().encode(encoding))
        assert_allclose(read_recording(file).positions, before.positions, atol=1e-12)


def test_bytes_of_no_encoding_do_not_change_other_names(tmp_path, control):
    file = tmp_path / "a.bvh"
    file.write_bytes(hierarchy(lambda name: name.replace("Head", "Schädel")).encode("latin-1"))
    recording = read_recording(file)
    assert recording.names[:4] == control.names[:4]
    assert_allclose(recording.positions, control.positions, atol=1e-9)


@pytest.mark.parametrize(
    "change",
    [
        lambda text: re.sub(
            "HIERARCHY|ROOT|JOINT|End Site|OFFSET|CHANNELS|MOTION|Frames|Frame Time",
            lambda found: found[0].lower(),
            text,
        ),
        lambda text: text.replace("Frames", "FRAMES").replace("Frame Time", "FRAME TIME"),
        lambda text: re.sub(r"(Frames: \d+)\n", r"\1\t", text),
        lambda text: (
            text[: text.index("MOTION")]
            + re.sub(r"(?<=\d) +(?=[-\d])", ", ", text[text.index("MOTION") :]).replace(
                "\n-", "\n-"
            )
        ),
        lambda text: (
            text[: text.index("MOTION")]
            + re.sub(r"(?<=\d) +(?=[-\d])", ";", text[text.index("MOTION") :])
        ),
    ],
    ids=["small letters", "capitals", "one line", "commas", "semicolons"],
)
def test_words_and_separators_of_bvh(tmp_path, control, change):
    file = tmp_path / "a.bvh"
    file.write_text(change(CONTROL))
    assert_allclose(read_recording(file).positions, control.positions, atol=1e-9)
    part = read_recording(file, start=0.5, stop=1.0)
    assert_allclose(part.positions, control.crop(0.5, 1.0).positions, atol=1e-9)


def test_rotations_in_radians_are_a_warning(tmp_path, control):
    """The remedy that it names, degrees, is the control itself, which has no warning."""
    head, _, rows = CONTROL.partition("Frame Time: ")
    step, *rows = rows.splitlines()
    table = np.array([row.split() for row in rows], dtype=float)
    table[:, 3:] = np.radians(table[:, 3:])
    lines = [" ".join(f"{value:.8f}" for value in row) for row in table]
    file = tmp_path / "a.bvh"
    file.write_text("\n".join([f"{head}Frame Time: {step}", *lines]) + "\n")
    assert any("radians" in warning for warning in read_recording(file).quality_warnings)
    assert control.quality_warnings == ()


def test_a_frame_time_in_milliseconds_is_a_warning(tmp_path, control):
    file = tmp_path / "a.bvh"
    file.write_text(re.sub(r"Frame Time: .*", "Frame Time: 33.3333", CONTROL))
    recording = read_recording(file)
    assert_allclose(recording.time, control.time, atol=1e-4)
    assert any("milliseconds" in warning for warning in recording.quality_warnings)
    assert read_recording(file, rate=30.0).quality_warnings == ()


@pytest.mark.parametrize("form", ["{} ({})", "{}[{}]", "({1}) {0}"])
def test_brackets_around_the_side(tmp_path, control, form):
    def named(name):
        side = next((side for side in ("Left", "Right") if name.startswith(side)), "")
        return form.format(name.removeprefix(side), side[0]) if side else name

    file = tmp_path / "a.bvh"
    file.write_text(hierarchy(named))
    assert_allclose(read_recording(file).positions, control.positions, atol=1e-9)
