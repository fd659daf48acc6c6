"""Tables as programs and people write them: names of columns, titles, times as text, several persons, frames."""

import json
import zipfile
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from format_files import write_csv, write_trc
from maniport.errors import FileFormatError
from maniport.mocap import fit_arm, read_recording

DIGITS = 2e-6  # of the files [m]


def table(recording, column, times=None, separator=",", decimal=".", factor=1.0):
    """Return the lines of a table with a row for each frame; `column` names a point and an axis."""
    names = [column(name, axis) for name in recording.names for axis in "xyz"]
    times = [f"{time:.6f}" for time in recording.time] if times is None else times
    lines = [separator.join(["time", *names])]
    for time, places in zip(times, recording.positions, strict=True):
        numbers = [f"{factor * value:.6f}".replace(".", decimal) for value in places.reshape(-1)]
        lines.append(separator.join([time.replace(".", decimal), *numbers]))
    return lines


def read_lines(tmp_path, lines, name="a.csv", **options):
    file = tmp_path / name
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return read_recording(file, **options)


def assert_same(recording, expected):
    assert recording.names == expected.names
    assert_allclose(recording.positions, expected.positions, rtol=0, atol=DIGITS)
    assert_allclose(
        recording.time - recording.time[0], expected.time - expected.time[0], rtol=0, atol=2e-6
    )


COLUMNS = {
    "joined": lambda name, axis: f"{name}{axis.upper()}",
    "joined small": lambda name, axis: f"{name}{axis}",
    "joined position": lambda name, axis: f"{name}Pos{axis.upper()}",
    "word before": lambda name, axis: f"{name}Position_{axis}",
    "word between": lambda name, axis: f"{name}_pos_{axis}",
    "word and axis": lambda name, axis: f"{name}_Pos{axis.upper()}",
    "word behind": lambda name, axis: f"{name}.{axis.upper()}position",
    "t": lambda name, axis: f"{name}_T{axis}",
    "t and dot": lambda name, axis: f"{name}.t{axis}",
    "translate": lambda name, axis: f"{name}.translate{axis.upper()}",
    "dot": lambda name, axis: f"{name}.{axis}",
    "blank": lambda name, axis: f"{name} {axis.upper()}",
    "slash": lambda name, axis: f"{name}/{axis}",
    "colon": lambda name, axis: f"{name}:{axis.upper()}",
    "bracket": lambda name, axis: f"{name} [{axis.upper()}]",
    "bracket joined": lambda name, axis: f"{name}({axis})",
    "axis first": lambda name, axis: f"{axis}_{name}",
    "axis around": lambda name, axis: f"{axis.upper()}({name})",
    "pairs": lambda name, axis: f"\"('{name}', '{axis}')\"",
}


@pytest.mark.parametrize("column", COLUMNS.values(), ids=COLUMNS)
def test_names_of_columns(tmp_path, markers, column):
    assert_same(read_lines(tmp_path, table(markers, column)), markers)


def test_t_joined_to_a_name(tmp_path, markers):
    names = tuple(f"{name.rpartition(':')[2].lower()}" for name in markers.names)
    small = replace(markers, names=names)
    lines = table(small, lambda name, axis: f"{name}T{axis}")
    assert read_lines(tmp_path, lines, unit="m").names == names


@pytest.mark.parametrize("unit", ["_{axis}_mm", " {axis} (mm)", "{axis} [mm]", "_{axis} mm"])
def test_units_behind_columns(tmp_path, markers, unit):
    lines = table(markers, lambda name, axis: name + unit.format(axis=axis), factor=1000.0)
    recording = read_lines(tmp_path, lines)
    assert_same(recording, markers)
    assert any("unit mm, of the file" in note for note in recording.notes)


def test_rotations_and_velocities_are_no_points(tmp_path, markers):
    lines = table(markers, lambda name, axis: f"{name}_pos_{axis}")
    first = markers.names[0]
    more = [f"{first}_{what}_{axis}" for what in ("rot", "vel") for axis in "xyz"]
    lines = [lines[0] + "," + ",".join(more), *(line + ",1,2,3,4,5,6" for line in lines[1:])]
    assert_same(read_lines(tmp_path, lines), markers)


def test_an_incomplete_joined_name_is_no_point(tmp_path, markers):
    lines = table(markers, lambda name, axis: f"{name}_{axis}")
    lines = [lines[0] + ",indexX,indexY", *(line + ",1,2" for line in lines[1:])]
    assert_same(read_lines(tmp_path, lines), markers)


TITLES = {
    "title": ["Recording of Monday"],
    "entries": ["subject,7", "date,2024-01-01", ""],
    "comments": ["# written by a program", "# version 2"],
    "quoted": ['"A title, with a comma"', '"x,y,z of markers"'],
    "slashes": ["// written by a program"],
    "percent": ["% a, b, c"],
}


@pytest.mark.parametrize("title", TITLES.values(), ids=TITLES)
def test_lines_above_the_names(tmp_path, markers, title):
    lines = table(markers, lambda name, axis: f"{name}_{axis}")
    assert_same(read_lines(tmp_path, [*title, *lines]), markers)


def test_names_in_a_comment(tmp_path, markers):
    lines = table(markers, lambda name, axis: f"{name}_{axis}", separator=" ")
    lines[0] = f"# {lines[0]}"  # as numpy.savetxt writes it
    assert_same(read_lines(tmp_path, lines), markers)


@pytest.mark.parametrize("title", ["fps,50", "# Frame rate: 50", "Sampling frequency (Hz),50.0"])
def test_a_rate_and_a_unit_above_the_names(tmp_path, markers, title):
    lines = table(markers, lambda name, axis: f"{name}_{axis}", factor=100.0)
    lines = [line.partition(",")[2] for line in lines]
    recording = read_lines(tmp_path, [title, "units,cm", *lines])
    assert recording.rate == pytest.approx(50.0)
    assert_allclose(recording.positions, markers.positions, rtol=0, atol=DIGITS)


def clock_of(seconds, kind):
    minutes, rest = divmod(seconds, 60)
    hours, minutes = divmod(int(minutes), 60)
    return {
        "hours": f"{hours % 24:02}:{minutes:02}:{rest:09.6f}",
        "minutes": f"{minutes:02}:{rest:09.6f}",
        "date": f"2024-02-{28 + hours // 24} {hours % 24:02}:{minutes:02}:{rest:09.6f}",
        "zone": f"2024-02-{28 + hours // 24}T{hours % 24:02}:{minutes:02}:{rest:09.6f}+01:00",
    }[kind]


@pytest.mark.parametrize("long", [False, True])
@pytest.mark.parametrize("kind", ["hours", "minutes", "date", "zone"])
@pytest.mark.parametrize("begin", [0.0, 59.7, 86_399.5])
def test_times_as_text(tmp_path, markers, kind, begin, long):
    if kind == "minutes" and begin > 60:
        begin = 3000.0
    times = [clock_of(begin + time, kind) for time in markers.time]
    file = write_csv(tmp_path / "a.csv", markers, long=long)
    lines = file.read_text().splitlines()
    every = len(markers.names) if long else 1
    for i in range(1, len(lines)):
        lines[i] = f"{times[(i - 1) // every]},{lines[i].partition(',')[2]}"
    recording = read_lines(tmp_path, lines)
    assert_same(recording, markers)
    middle = float(recording.time[len(recording) // 2])
    part = read_lines(tmp_path, lines, start=middle)
    assert part.time[0] == pytest.approx(middle)
    assert len(part) < len(recording)


def test_a_wrong_time_is_named(tmp_path, markers):
    lines = table(markers, lambda name, axis: f"{name}_{axis}")
    lines[2:] = ["00:00:01:05:07" + line[line.index(",") :] for line in lines[2:]]
    lines[1] = "00:00:01:05:06" + lines[1][lines[1].index(",") :]
    with pytest.raises(FileFormatError, match="hh:mm:ss"):
        read_lines(tmp_path, lines)


def trc_lines(tmp_path, markers):
    """Return the lines of a TRC file: kind, keys, values, names, axes, a blank line, numbers."""
    lines = write_trc(tmp_path / "whole.trc", markers, unit="mm", scale=0.001).read_text()
    lines = lines.splitlines()
    numbers = next(i for i, line in enumerate(lines) if line[:1].isdigit() and i > 2)
    return lines[:5], [line for line in lines[numbers:] if line.strip()]


TRC = {
    "without the kind": lambda head, rows: [*head[1:], "", *rows],
    "without the blank line": lambda head, rows: [*head, *rows],
    "with blank lines": lambda head, rows: [line for part in (*head, *rows) for line in (part, "")],
    "with three blank lines": lambda head, rows: [*head, "", "", "\t\t", *rows],
    "without axes": lambda head, rows: [*head[:4], "", *rows],
    "commas": lambda head, rows: [line.replace("\t", ",") for line in [*head, "", *rows]],
    "small keys": lambda head, rows: [
        *head[:3],
        head[3].replace("Frame#", "frame#"),
        head[4],
        *rows,
    ],
    "names and axes alone": lambda head, rows: [*head[3:5], *rows],
}


@pytest.mark.parametrize("lines_of", TRC.values(), ids=TRC)
@pytest.mark.parametrize("suffix", ["trc", "csv"])
def test_variants_of_trc(tmp_path, markers, lines_of, suffix):
    head, rows = trc_lines(tmp_path, markers)
    if suffix == "csv" and lines_of is TRC["without axes"]:
        head = head[1:] if not head[0].startswith("PathFileType") else head
    file = tmp_path / f"a.{suffix}"
    file.write_text("\n".join(lines_of(head, rows)) + "\n")
    recording = read_recording(file, unit="mm")
    assert recording.names == markers.names
    assert_allclose(recording.positions, markers.positions, rtol=0, atol=1e-5)
    assert_allclose(recording.time, markers.time, rtol=0, atol=1e-5)


@pytest.mark.parametrize("repeated", [True, False])
def test_names_above_axes(tmp_path, markers, repeated):
    lines = table(markers, lambda name, axis: f"{name}_{axis}")
    names = ["bodyparts"]
    axes = ["coords"]
    for name in markers.names:
        names += [name] * 3 if repeated else [name, "", ""]
        axes += ["x", "y", "z"]
    head = ["scorer" + ",DLC_3D" * (len(axes) - 1), ",".join(names), ",".join(axes)]
    rows = [f"{i},{line.partition(',')[2]}" for i, line in enumerate(lines[1:])]
    recording = read_lines(tmp_path, [*head, *rows], rate=markers.rate)
    assert_same(recording, markers)


PERSONS = {
    "P1_": "{person}_{name}",
    "space": "{person} {name}",
    "dot": "{person}.{name}",
    "colon": "{person}:{name}",
    "slash": "{person}/{name}",
    "behind": "{name}_{person}",
}


@pytest.mark.parametrize(
    ("pattern", "persons"),
    [
        *((pattern, ("P1", "P2")) for pattern in PERSONS.values()),
        (PERSONS["P1_"], ("Person_01", "Person_02")),
        (PERSONS["colon"], ("Subject1", "Subject2")),
    ],
)
def test_several_persons(tmp_path, control, pattern, persons):
    names = []
    for person in persons:
        names += [pattern.format(person=person, name=name) for name in control.names]
    positions = np.concatenate([control.positions, control.positions * [1, 1.1, 1]], axis=1)
    both = replace(control, names=tuple(names), positions=positions)
    recording = read_recording(write_csv(tmp_path / "a.csv", both), unit="m")
    warning = next(text for text in recording.quality_warnings if "several bodies" in text)
    assert all(person in warning for person in persons)

    first = fit_arm(recording, side="right")
    points = {name for group in first.roles.values() for name in np.ravel(group)}
    assert points <= set(names[: len(control.names)])
    shoulder = pattern.format(person=persons[1], name="RightArm")
    second = fit_arm(recording, side="right", markers={"shoulder": shoulder})
    points = {name for group in second.roles.values() for name in np.ravel(group)}
    assert points <= set(names[len(control.names) :])


@pytest.fixture
def control(request):
    """Return the points of a recording of a whole body, without the ends of chains."""
    recording = read_recording(request.path.parent / "cases" / "control.bvh")
    return recording.select(name for name in recording.names if not name.startswith("EndSite"))


@pytest.mark.parametrize("word", ["person", "subject", "track_id"])
def test_a_column_of_persons(tmp_path, control, word):
    lines = [f"time,{word},name,x,y,z"]
    for time, places in zip(control.time, control.positions, strict=True):
        for person in ("A", "B"):
            for name, place in zip(control.names, places, strict=True):
                x, y, z = place
                lines.append(f"{time:.6f},{person},{name},{x:.6f},{y:.6f},{z:.6f}")
    recording = read_lines(tmp_path, lines, unit="m")
    assert recording.names[0] == f"A:{control.names[0]}"
    assert len(recording.names) == 2 * len(control.names)
    assert_allclose(recording.positions[:, : len(control.names)], control.positions, atol=DIGITS)
    one = read_lines(tmp_path, [lines[0], *(line for line in lines if ",B," in line)], unit="m")
    assert one.names == control.names


@pytest.mark.parametrize("folder", ["", "frames/"])
def test_frames_in_an_archive(tmp_path, control, folder):
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
        for i, places in enumerate(control.positions):  # in an order that is not that of letters
            frame = dict(zip(control.names, places.tolist(), strict=True))
            archive.writestr(f"{folder}frame{i}.json", json.dumps(frame))
        archive.writestr("readme.txt", "about")
    recording = read_recording(tmp_path / "a.zip", unit="m", rate=control.rate)
    assert recording.names == control.names
    assert_allclose(recording.positions, control.positions, rtol=0, atol=1e-9)


def test_a_faulty_frame_in_an_archive_is_named(tmp_path, control):
    frame = dict(zip(control.names, control.positions[0].tolist(), strict=True))
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
        archive.writestr("frame1.json", json.dumps(frame))
        archive.writestr("frame2.json", "{")
    with pytest.raises(FileFormatError, match=r"frame2\.json") as caught:
        read_recording(tmp_path / "a.zip", rate=30)
    assert "/tmp" not in str(caught.value).replace(str(tmp_path), "")


@pytest.mark.parametrize("units", ["s", "(s)", ""])
@pytest.mark.parametrize("unit", ["mm", "(mm)", "[mm]"])
def test_a_row_of_units(tmp_path, markers, units, unit):
    lines = table(markers, lambda name, axis: f"{name}_{axis}", factor=1000.0)
    row = ",".join([units] + [unit] * 3 * len(markers.names))
    recording = read_lines(tmp_path, [lines[0], row, *lines[1:]])
    assert_same(recording, markers)
    assert any("unit mm, of the file" in note for note in recording.notes)


@pytest.mark.parametrize("separator", ["|", " ", "   ", ";", "\t"])
def test_separators(tmp_path, markers, separator):
    complete = replace(markers, positions=markers.positions[4:], time=markers.time[4:])
    lines = table(complete, lambda name, axis: f"{name}_{axis}", separator=separator)
    assert_same(read_lines(tmp_path, lines), complete)


def bvh_lines(request):
    """Return the lines of a hierarchy, the number of frames and the frames of a BVH file."""
    file = request.path.parent / "cases" / "control.bvh"
    lines = file.read_text().splitlines()
    motion = lines.index("MOTION")
    return lines[:motion], lines[motion + 1], lines[motion + 2], lines[motion + 3 :]


BVH = {
    "one line": lambda tree, count, step, rows: [" ".join(tree), "MOTION", count, step, *rows],
    "other order": lambda tree, count, step, rows: [*tree, "MOTION", step, count, *rows],
    "comments": lambda tree, count, step, rows: [
        *tree,
        "MOTION",
        "# a",
        count,
        "// b",
        step,
        *rows,
    ],
    "one header line": lambda tree, count, step, rows: [*tree, "MOTION", f"{count} {step}", *rows],
}


@pytest.mark.parametrize("lines_of", BVH.values(), ids=BVH)
def test_variants_of_bvh(tmp_path, request, lines_of):
    expected = read_recording(request.path.parent / "cases" / "control.bvh")
    recording = read_lines(tmp_path, lines_of(*bvh_lines(request)), "a.bvh")
    assert recording.names == expected.names
    assert_allclose(recording.positions, expected.positions, rtol=0, atol=0)
    assert_allclose(recording.time, expected.time, rtol=0, atol=0)


@pytest.mark.parametrize("layout", ["tracks", "array", "capitals"])
def test_layouts_of_json(tmp_path, control, layout):
    tracks = {name: control.point(name).tolist() for name in control.names}
    contents = {
        "tracks": {**tracks, "time": control.time.tolist()},
        "array": {
            "names": list(control.names),
            "positions": control.positions.tolist(),
            "fps": control.rate,
        },
        "capitals": {"fps": control.rate, "frames": []},
    }
    for places in control.positions.tolist():
        points = {
            name: dict(zip("XYZ", place, strict=True))
            for name, place in zip(control.names, places, strict=True)
        }
        contents["capitals"]["frames"].append(points)
    recording = read_lines(tmp_path, [json.dumps(contents[layout])], "a.json", unit="m")
    assert recording.names == control.names
    assert_allclose(recording.positions, control.positions, rtol=0, atol=1e-9)
    assert_allclose(recording.time, control.time, rtol=0, atol=1e-6)
