"""A part of a recording is the same whether it is read or cut out, and tables are parsed in blocks."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from dialect_files import POINTS, SKELETONS, mirrored, write_bvh
from format_files import (
    SAUL,
    write_csv,
    write_mot,
    write_motive,
    write_mvnx,
    write_nexus,
    write_qualisys,
    write_trc,
)
from maniport.errors import FileFormatError, InvalidInputError
from maniport.mocap import read_recording
from maniport.mocap.readers import text

WRITERS = {
    "a.trc": write_trc,
    "a.csv": write_csv,
    "long.csv": lambda path, markers: write_csv(path, markers, long=True),
    "motive.csv": write_motive,
    "nexus.csv": write_nexus,
    "a.tsv": write_qualisys,
}


@pytest.fixture(scope="module")
def files(tmp_path_factory, made, markers):
    """One file of each format that is read in parts, and of some that are cropped afterwards."""
    folder = tmp_path_factory.mktemp("files")
    for name, write in WRITERS.items():
        write(folder / name, markers)
    write_bvh(folder / "a.bvh", SKELETONS["LAFAN1"], made)
    write_mot(folder / "a.mot", made.time, made.joint_angles, SAUL)
    write_mvnx(folder / "a.mvnx", made.recording(mirrored(POINTS["MVNX"])))
    markers.save(folder / "a.npz")
    return sorted(folder.iterdir())


@pytest.mark.parametrize("blocks", [400, 2**20])
@pytest.mark.parametrize(
    ("start", "stop"), [(0.2, 0.5), (None, 0.31), (0.4, None), (0.78, 0.78), (-1.0, 9.0)]
)
def test_a_part_equals_the_crop_of_the_whole(files, monkeypatch, start, stop, blocks):
    monkeypatch.setattr(text, "BLOCK_CHARACTERS", blocks)
    for file in files:
        expected = read_recording(file).crop(start, stop)
        part = read_recording(file, start=start, stop=stop)
        assert part.names == expected.names, file
        assert_array_equal(part.time, expected.time)
        assert_allclose(part.positions, expected.positions, rtol=0, atol=1e-12)
        assert part.quality_warnings == expected.quality_warnings, file


def test_a_part_without_frames_is_an_error(files):
    for file in files:
        with pytest.raises(InvalidInputError, match=r"0\.78 s"):
            read_recording(file, start=2.0)
        with pytest.raises(InvalidInputError):
            read_recording(file, start=0.5, stop=0.1)


@pytest.mark.parametrize("rest", [1, 5, 100])
def test_the_times_of_a_part_begin_after_a_rest_pose(tmp_path, made, rest):
    file = write_bvh(tmp_path / "a.bvh", SKELETONS["LAFAN1"], made)
    expected = read_recording(file)
    lines = file.read_text().splitlines()
    row = lines.index("MOTION") + 3
    still = ["0"] * len(lines[row].split())
    lines[row - 2] = f"Frames: {40 + rest}"
    lines[row:row] = [" ".join(still)] * rest
    file.write_text("\n".join(lines))
    assert_allclose(read_recording(file).positions, expected.positions)
    for start, stop in ((0.2, 0.5), (None, 0.5), (0.0, None)):
        part = read_recording(file, start=start, stop=stop)
        whole = expected.crop(start, stop)
        assert_allclose(part.time, whole.time, atol=1e-12)
        assert_allclose(part.positions, whole.positions)
        assert any("rest pose" in note for note in part.notes)


def test_frames_outside_the_part_are_not_parsed(tmp_path, markers):
    """Damage beyond the part does not matter, while it is an error for the whole."""
    for name in ("a.trc", "a.csv"):
        file = WRITERS[name](tmp_path / name, markers)
        lines = file.read_text().splitlines()
        lines[-3] = lines[-3].replace(".", "x").replace("x", ".", 1)
        file.write_text("\n".join(lines))
        with pytest.raises(FileFormatError, match=f"line {len(lines) - 2}"):
            read_recording(file)
        assert len(read_recording(file, stop=0.5)) == 26


@pytest.mark.parametrize("separator", [",", ";", "\t", None])
def test_blocks_equal_rows(tmp_path, monkeypatch, separator):
    """Blocks of plain numbers, of gaps and of placeholders are what Python reads field by field."""
    monkeypatch.setattr(text, "BLOCK_CHARACTERS", 300)
    random = np.random.default_rng(0)
    numbers = random.normal(size=(60, 4)) * 10.0 ** random.integers(-9, 9, (60, 4))
    rows = [[repr(float(value)) for value in row] for row in numbers]
    expected = numbers.copy()
    if separator is not None:
        for i, word in ((20, ""), (33, "NA"), (41, " "), (42, "nan"), (59, "")):
            rows[i][i % 4] = word
            expected[i, i % 4] = np.nan
        rows[50] = [f'"{field}"' for field in rows[50]]
        rows[12].append("")
    rows[7][0] = "1_0"
    expected[7, 0] = 10.0
    if separator != ",":
        rows[8] = [field.replace(".", ",") for field in rows[8]]
    file = tmp_path / "a.txt"
    file.write_text("\n\n".join((separator or "  ").join(row) for row in rows))
    groups = ([0, 1, 2, 3],) if separator is None else ([2, 0], [3])
    tables = text.NumberTable(4, groups, separator).read(text.row_blocks(file))
    for table, group in zip(tables, groups, strict=True):
        assert_array_equal(table, expected[:, group])


def test_the_first_faulty_line_is_named(tmp_path, monkeypatch):
    monkeypatch.setattr(text, "BLOCK_CHARACTERS", 50)
    lines = ["1,2,3"] * 100
    file = tmp_path / "a.csv"
    for number, line, words in (
        (70, "1,2", "broken at line 70: 2 values"),
        (70, "1,2,3,4", "broken at line 70: 4 values"),
        (70, "1,two,3", "line 70: .*'two'"),
        (100, "1,2", "cut off at line 100"),
    ):
        file.write_text("\n".join([*lines[: number - 1], line, *lines[number:]]))
        with pytest.raises(ValueError, match=words):
            text.NumberTable(3, [[0, 1, 2]], ",").read(text.row_blocks(file))


@pytest.mark.parametrize("blocks", [400, 2**20])
@pytest.mark.parametrize("quote", ["", '"'])
def test_rows_of_points_have_names_of_any_length(tmp_path, markers, monkeypatch, quote, blocks):
    monkeypatch.setattr(text, "BLOCK_CHARACTERS", blocks)
    shown = {name: name for name in markers.names}
    shown[markers.names[-1]] = "a name of more letters than the others have; é " + "long" * 40
    lines = ["time,subject,name,x,y,z"]
    for time, places in zip(markers.time, markers.positions, strict=True):
        for name, place in zip(markers.names, places, strict=True):
            numbers = ",".join(f"{value:.9f}" for value in place)
            lines.append(f"{time:.6f},someone,{quote}{shown[name]}{quote} ,{numbers}")
    file = tmp_path / "a.csv"
    file.write_text("\n".join(lines), encoding="utf-8")
    recording = read_recording(file)
    assert recording.names == tuple(shown.values())
    expected = read_recording(write_csv(tmp_path / "b.csv", markers))
    assert_allclose(recording.positions, expected.positions, rtol=0, atol=2e-6)


ORDERS = {
    "as in the first frame": lambda i, names: names,
    "other in the middle": lambda i, names: names[::-1] if i in (17, 18) else names,
    "turned": lambda i, names: names[i % 5 :] + names[: i % 5],
    "with a lost row": lambda i, names: names[1:] if i == 20 else names,
    "with lost frames": lambda i, names: [] if i in (20, 21) else names,
}


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("with_persons", [False, True])
def test_orders_of_rows_in_long_tables(tmp_path, monkeypatch, markers, order, with_persons):
    """Rows in blocks of a few frames, whose names mostly repeat those of the frame before."""
    monkeypatch.setattr(text, "BLOCK_CHARACTERS", 1500)
    names = list(markers.names)
    persons = {name: "ab"[i % 2] if with_persons else "a" for i, name in enumerate(names)}
    expected = np.full(markers.positions.shape, np.nan)
    lines = ["time,person,name,x,y,z"]
    for i, time in enumerate(markers.time):
        for name in ORDERS[order](i, names):
            x, y, z = markers.positions[i, names.index(name)]
            expected[i, names.index(name)] = (x, y, z)
            lines.append(f"{time:.6f},{persons[name]},{name},{x:.9f},{y:.9f},{z:.9f}")
    file = tmp_path / "a.csv"
    file.write_text("\n".join(lines) + "\n")
    recording = read_recording(file, unit="m")
    assert set(recording.names) == {
        f"{persons[name]}:{name}" if with_persons else name for name in names
    }
    kept = np.isfinite(expected).any(axis=(1, 2))
    for i, name in enumerate(names):
        found = recording.point(f"{persons[name]}:{name}" if with_persons else name)
        assert_allclose(found, expected[kept, i], atol=1e-8)
