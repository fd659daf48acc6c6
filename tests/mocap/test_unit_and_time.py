"""Contradictions between the points of a recording and its unit or times."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from dialect_files import POINTS, SKELETONS, mirrored, write_bvh
from format_files import write_csv, write_json, write_mvnx
from maniport.errors import FileFormatError
from maniport.mocap import Recording, read_recording
from maniport.mocap.roles import assign_roles


def test_right_options_cause_no_warning():
    for name, unit in (("ladder", "CMU"), ("freeform", "mm")):
        assert read_recording(name, unit=unit).quality_warnings == ()


@pytest.mark.parametrize("unit", ["m", "mm", "inch"])
def test_an_impossible_unit_is_rejected(tmp_path, made, unit):
    skeleton_file = write_bvh(tmp_path / "small.bvh", SKELETONS["LAFAN1"], made)
    with pytest.raises(FileFormatError, match=f"small.bvh.*unit='{unit}'.*unit='cm'"):
        read_recording(skeleton_file, unit=unit)


def test_of_several_bodies_one_is_used(tmp_path, made):
    markers = made.recording(mirrored(POINTS["Plug-in Gait"]))
    names = tuple(f"{body}:{name}" for body in "AB" for name in markers.names)
    positions = np.concatenate([markers.positions, markers.positions + 0.1], axis=1)
    file = tmp_path / "two.npz"
    Recording(names, positions, markers.time).save(file)
    both = read_recording(file)
    assert "several bodies: A, B" in both.quality_warnings[0]
    for own, body in ((None, "A"), ({"shoulder": "B:RSHO"}, "B")):
        roles = assign_roles(both, own)
        assert {name[:2] for role in ("shoulder", "elbow", "wrist") for name in roles[role]} == {
            f"{body}:"
        }
        assert roles["trunk_up"][0][0].startswith(body)
    positions[:, names.index("A:RELB")] = np.nan
    Recording(names, positions, markers.time).save(file)
    assert assign_roles(read_recording(file))["wrist"] == ("B:RWRA", "B:RWRB")


@pytest.mark.parametrize(
    ("scale", "word"), [(1e3, "milliseconds"), (1e6, "microseconds"), (1e9, "nanoseconds")]
)
def test_times_that_cannot_be_seconds_are_recognized(tmp_path, markers, scale, word):
    file = tmp_path / "slow.npz"
    np.savez(
        file, names=np.array(markers.names), positions=markers.positions, time=markers.time * scale
    )
    recording = read_recording(file)
    assert any(f"recognized as {word}" in note for note in recording.notes)
    np.testing.assert_allclose(recording.time, markers.time, atol=1e-12)


LOST = np.r_[0:20, 30:40]
"""Frames that are left when ten are lost."""


def lost_frames(markers):
    return replace(markers, positions=markers.positions[LOST], time=markers.time[LOST])


@pytest.mark.parametrize("word", ["frame", "Frame#", "frame_id", "Index"])
@pytest.mark.parametrize("long", [False, True])
def test_frame_numbers_of_tables_show_lost_frames(tmp_path, markers, word, long):
    file = write_csv(tmp_path / "a.csv", lost_frames(markers), long=long)
    head, *rows = file.read_text().splitlines()
    lines = [head.replace("time", word, 1)]
    for row in rows:
        time, rest = row.split(",", 1)
        lines.append(f"{float(time) * markers.rate:.0f},{rest}")
    file.write_text("\n".join(lines))
    recording = read_recording(file, rate=markers.rate)
    assert_allclose(recording.time, markers.time[LOST], atol=1e-9)
    assert any("gap" in text for text in (*recording.notes, *recording.quality_warnings))


@pytest.mark.parametrize("key", ["frame", "frame_id", "frameNumber"])
def test_frame_numbers_of_keypoints_show_lost_frames(tmp_path, markers, key):
    frames = []
    for number in LOST:
        places = np.nan_to_num(markers.positions[number]).tolist()
        points = dict(zip(markers.names, places, strict=True))
        frames.append({key: int(number), "joints": points})
    file = write_json(tmp_path / "a.json", {"fps": markers.rate, "frames": frames})
    recording = read_recording(file, unit="m")
    assert_allclose(recording.time, markers.time[LOST], atol=1e-9)


@pytest.mark.parametrize(
    "head",
    [
        "time,joint_name,x,y,z",
        "Time,Bone,PosX,PosY,PosZ",
        "time,name,pos_x,pos_y,pos_z",
        "time,marker,x (m),y (m),z (m)",
    ],
)
def test_columns_of_points(tmp_path, markers, head):
    file = write_csv(tmp_path / "a.csv", markers, long=True)
    before = read_recording(file)
    file.write_text(file.read_text().replace("time,name,x,y,z", head))
    after = read_recording(file)
    assert after.names == before.names
    assert_allclose(after.positions, before.positions, atol=1e-12)


def test_a_unit_of_columns_of_points(tmp_path, markers):
    file = write_csv(tmp_path / "a.csv", markers, long=True)
    file.write_text(file.read_text().replace("x,y,z", "x_mm,y_mm,z_mm"))
    with pytest.raises(FileFormatError, match="mm"):
        read_recording(file)
    assert len(read_recording(file, unit="m")) == len(markers)


def test_times_in_a_column_of_an_array(tmp_path, markers):
    file = tmp_path / "a.npz"
    time = markers.time[:, None]
    np.savez(file, names=list(markers.names), positions=markers.positions, time=time)
    assert_allclose(read_recording(file).time, markers.time, atol=1e-9)


def test_decimal_commas_of_mvnx(tmp_path, markers):
    file = write_mvnx(
        tmp_path / "a.mvnx", replace(markers, positions=np.nan_to_num(markers.positions))
    )
    before = read_recording(file)
    text = re.sub(r"<position>[^<]*", lambda found: found[0].replace(".", ","), file.read_text())
    file.write_text(text)
    assert_allclose(read_recording(file).positions, before.positions, atol=1e-12)


def test_bodies_of_kinect_in_json(tmp_path, markers):
    frames = []
    for time, places in zip(markers.time, np.nan_to_num(markers.positions).tolist(), strict=True):
        joints = []
        for name, place in zip(markers.names, places, strict=True):
            joints.append({"name": name, "position": dict(zip("xyz", place, strict=True))})
        frames.append({"timestamp_usec": 1e6 * time, "bodies": [{"joints": joints}]})
    file = write_json(tmp_path / "a.json", {"frames": frames})
    recording = read_recording(file, unit="m")
    assert recording.names == markers.names
    assert_allclose(recording.time, markers.time, atol=1e-9)


@pytest.mark.parametrize(
    ("column", "unit"),
    [
        ("time_ms", 1e3),
        ("Time [milliseconds]", 1e3),
        ("timestamp_us", 1e6),
        ("time (microseconds)", 1e6),
        ("t_ns", 1e9),
        ("time [s]", 1.0),
    ],
)
@pytest.mark.parametrize("long", [False, True])
def test_units_of_time_in_the_name_of_a_column(tmp_path, markers, column, unit, long):
    file = write_csv(tmp_path / "a.csv", markers, long=long)
    head, *rows = file.read_text().splitlines()
    lines = [head.replace("time", column, 1)]
    for row in rows:
        seconds, _, others = row.partition(",")
        lines.append(f"{unit * float(seconds):.6f},{others}")
    file.write_text("\n".join(lines) + "\n")
    assert_allclose(read_recording(file, unit="m").time, markers.time, atol=1e-9)


@pytest.mark.parametrize("key", ["fps", "frameRate", "framerate", "frame_rate", "sampling_rate"])
@pytest.mark.parametrize("suffix", [".npz", ".json"])
def test_keys_of_frame_rates(tmp_path, markers, key, suffix):
    positions = np.nan_to_num(markers.positions)
    content = {"names": list(markers.names), "positions": positions.tolist(), key: 50}
    file = tmp_path / f"a{suffix}"
    if suffix == ".npz":
        np.savez(file, **content)
    else:
        file.write_text(json.dumps(content))
    assert_allclose(read_recording(file, unit="m").time, markers.time, atol=1e-12)
