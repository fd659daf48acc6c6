"""Damaged, incomplete and hostile files end with a FileFormatError: soon, and in little memory."""

import time

import numpy as np
import pytest

from dialect_files import SKELETONS, motion, write_bvh
from format_files import write_motive, write_nexus, write_qualisys
from fuzz.c3d_writer import Writer
from maniport.errors import FileFormatError, InvalidInputError
from maniport.mocap import READERS, Recording, read_recording, readers, shipped_recording
from maniport.mocap.readers import mvnx

QUALISYS = "NO_OF_FRAMES\t2\n{}MARKER_NAMES\tA\n1\t2\t3\n1\t2\t4\n"
MVNX = '<mvnx version="4"><subject frameRate="60"><segments><segment label="A"/></segments>{}</subject></mvnx>'
FRAME = '<frame type="normal"><position>{}</position><position>9</position></frame>'


def npy(header, content=b""):
    return b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header.encode() + content


def c3d_with(used):
    writer = Writer()
    content = writer.content()
    at = content.index(b"USED") + 8
    return content[:at] + writer.short(used) + content[at + 2 :]


FAULTS = [
    ("a.csv", "date,price\n1,2\n", "line of names first.* date, price"),
    ("a.csv", "time,elbow_x,elbow_y\n0,1,2\n", "no column elbow_z"),
    ("a.csv", "time,elbow_x,elbow_y,elbow_z\n0,1,2\n", "cut off at line 2"),
    ("a.csv", "time,elbow_x,elbow_y,elbow_z\n0,1,2,a\n", "line 2: could not convert"),
    ("a.csv", "time,name,x,y,z\n0,a,1,2,3\n0,a,1,2,3\n", "line 3: .* twice"),
    ("a.csv", "time,elbow_x,elbow_y,elbow_z\n0,1,2,3\n", r"missing: shoulder \(.*wrist \("),
    ("a.csv", "elbow_x,elbow_y,elbow_z\n1,2,3\n", "no frame rate"),
    ("a.csv", "time,a_x,a_y,a_z,a_X\n0,1,2,3,4\n", "'a_X' occurs twice"),
    ("line.csv", b"," * 3_000_000, "3000000 characters in a line"),
    (
        "line.trc",
        b"PathFileType\n1\n1\n" + b"a\t\t" * 10**6 + b"\nX\n1\t2\n",
        "characters in a line",
    ),
    (
        "quoted.csv",
        'time,"' + "a" * 140_000 + '_x",b_y,b_z\n0,1,2,3\n',
        "140004 characters in the name",
    ),
    ("cuts.csv", "time," + "_" * 20_000 + "q,b_y,b_z\n0,1,2,3\n", "20001 characters in the name"),
    ("frame.csv", "Format Version,1.2\nType\nName\nx\ny\nFrame\n1\n", "no positions of points"),
    ("rate.tsv", QUALISYS.format("FREQUENCY\n"), "no frame rate"),
    ("a.mvnx", MVNX.format("<a/>" * 60), "51 elements; at most 50"),
    ("a.mvnx", MVNX.format(FRAME.format("1 " * 10**6)), "more than 3 numbers"),
    ("a.mvnx", MVNX.format(FRAME.format("1 2")), "2 numbers for 1 segments"),
    ("a.mvnx", MVNX.format("<frame/>"), "no <position>"),
    ("a.mvnx", '<?xml version="1.0" encoding="rot13"?><mvnx/>', "not readable as .mvnx"),
    ("a.mvnx", '<?xml version="1.0" encoding="zzz"?><mvnx/>', "not readable as .mvnx"),
    ("a.npy", npy("  a\n b\n  ("), "not a readable .npy file"),
    (
        "a.npy",
        npy("{'descr': '<f8', 'fortran_order': False, 'shape': (1000000, 22, 3)}"),
        "declares the shape",
    ),
    (
        "a.npy",
        npy("{'descr': '|u1', 'fortran_order': False, 'shape': (9, 22, 3)}", bytes(9 * 66)),
        "has 198 places",
    ),
    ("a.c3d", c3d_with(60_000), "60000 points; at most 5000"),
    ("a.c3d", c3d_with(0), "holds no points"),
    ("a.c3d", Writer().content(frames=0xFFFF), "announces 65535 frames"),
    ("a.fbx", b"Kaydara FBX Binary  \0", "Blender.*Export"),
    ("a.bvh.gz", b"\x1f\x8b\x08", "gunzip"),
    ("a.pkl", b"\x80\x04\x95", "np.savez"),
    ("arm.urdf", b"<robot name='arm'/>", "--robot"),
    ("a.glb", b"glTF\2\0\0\0", "Blender"),
    ("a.xlsx", b"PK\3\4", "save it as CSV"),
    ("a.mp4", b"\0\0\0\x18ftypmp42", "MediaPipe"),
    ("a.odd", b"nothing", "'.odd' is not known"),
]


@pytest.mark.parametrize(("name", "content", "words"), FAULTS)
def test_faulty_files_are_rejected(tmp_path, monkeypatch, name, content, words):
    monkeypatch.setattr(mvnx, "ELEMENTS", 50)
    if name.endswith("npy"):
        monkeypatch.setattr(readers, "PLACES", 100)
    file = tmp_path / name
    file.write_bytes(content if isinstance(content, bytes) else content.encode())
    options = {"rate": 30} if name.endswith("npy") else {} if name == "a.csv" else {"unit": "mm"}
    begin = time.process_time()
    with pytest.raises(FileFormatError, match=words) as caught:
        read_recording(file, **options)
    assert time.process_time() - begin < 2
    assert name in str(caught.value)


def test_a_bug_in_a_reader_of_the_user_shows(tmp_path, monkeypatch):
    (tmp_path / "a.own").write_text("1")
    for error in (TypeError("int + str"), ValueError("no")):

        def read(file, options, error=error):
            raise error

        monkeypatch.setitem(READERS, ".own", read)
        with pytest.raises(FileFormatError, match=str(error.args[0]).replace("+", ".")) as caught:
            read_recording(tmp_path / "a.own")
        assert caught.value.__cause__ is error


def write_skeleton(path, recording):
    return write_bvh(path, SKELETONS["LAFAN1"], motion())


@pytest.mark.parametrize(
    ("write", "name", "damage", "words"),
    [
        (
            write_skeleton,
            "a.bvh",
            lambda text: text[: text.index("JOINT RightForeArm")],
            "cut off in its hierarchy",
        ),
        (
            write_skeleton,
            "a.bvh",
            lambda text: text[: text.index("Frame Time")],
            "must be followed by 'Frames:'",
        ),
        (
            write_skeleton,
            "a.bvh",
            lambda text: "\n".join(text.splitlines()[:-3]),
            "cut off: .* 40 frames.* 37",
        ),
        (write_skeleton, "a.bvh", ("Frames: 40", "Frames: 600"), "cut off: .* 600 frames"),
        (write_skeleton, "a.bvh", ("0.020000", "0.00"), "positive number; found '0.00'"),
        (write_skeleton, "a.bvh", ("10.000000", "abc", 1), "not readable as BVH"),
        (write_skeleton, "a.bvh", ("}", "", 1), "closing braces"),
        (write_skeleton, "a.bvh", ("CHANNELS 3 Z", "CHANNELS 4 Z", 1), "number of channels"),
        (write_skeleton, "a.bvh", ("CHANNELS 3", "CHANNELS 1 Xrotation\nCHANNELS 3", 1), "twice"),
        (
            write_skeleton,
            "a.bvh",
            ("Frames: 40", "Frames: " + "9" * 5000),
            "must be followed by 'Frames:'",
        ),
        (
            write_skeleton,
            "a.bvh",
            lambda text: text[: text.index("Frame Time")] + "Frame Time: 0.02\n",
            "holds no frames",
        ),
        (
            write_skeleton,
            "a.bvh",
            lambda text: "\x00\xff\x17" * 300,
            "does not begin with HIERARCHY",
        ),
        (write_motive, "a.csv", (",Position", ",Rotation"), "no positions of points; in Motive"),
        (write_motive, "a.csv", ("Frame,Time", "Time"), "cut off"),
        (write_nexus, "b.csv", ("X,Y,Z", "FX,FY,FZ"), "no positions of points; in Nexus"),
        (write_qualisys, "a.tsv", ("DATA_INCLUDED\t3D", "DATA_INCLUDED\t6D"), "6D"),
    ],
)
def test_damaged_texts_are_rejected(tmp_path, markers, write, name, damage, words):
    file = write(tmp_path / name, markers)
    text = file.read_text()
    file.write_text(text.replace(*damage) if isinstance(damage, tuple) else damage(text))
    with pytest.raises(FileFormatError, match=f"{name}: .*{words}") as caught:
        read_recording(file)
    assert caught.value.__cause__ is None


@pytest.mark.parametrize("size", [1, 512, 1500, 40000, 83743])
def test_truncated_c3d_is_rejected(tmp_path, size):
    file = tmp_path / "cut.c3d"
    file.write_bytes(shipped_recording("freeform").read_bytes()[:size])
    with pytest.raises(FileFormatError, match=r"cut\.c3d.*(cut off|damaged)"):
        read_recording(file)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"names": None}, "14 joints without names"),
        ({"positions": np.array([[["a"] * 3] * 14] * 40)}, "positions"),
        ({"names": np.arange(14)}, "names"),
        ({"time": None}, "rate="),
        ({"time": None, "rate": -1}, "rate is '-1'"),
        ({"time": None, "rate": 1e-320}, "rate is '1e-320'"),
        ({"time": np.zeros(40)}, "time"),
    ],
)
def test_faulty_arrays_are_rejected(markers, tmp_path, change, words):
    names = np.array(markers.names)
    file = tmp_path / "x.npz"
    good = {"names": names, "positions": markers.positions, "time": markers.time, "unit": "m"}
    np.savez(file, **{key: value for key, value in (good | change).items() if value is not None})
    with pytest.raises(FileFormatError, match=words):
        read_recording(file)


@pytest.mark.filterwarnings("error")
def test_points_out_of_reach(tmp_path):
    np.savez(
        tmp_path / "a.npz", names=["a", "b"], positions=[[[1e300, 0, 0], [1, 2, 3]]] * 2, rate=30.0
    )
    assert read_recording(tmp_path / "a.npz", unit="m").missing.tolist() == [1, 0]
    np.save(tmp_path / "b.npy", np.full((2, 22, 3), 1e300) * np.linspace(0, 1, 66).reshape(22, 3))
    with pytest.raises(FileFormatError, match="22 joints"):
        read_recording(tmp_path / "b.npy", rate=30)
    with pytest.raises(InvalidInputError, match=r"^positions"):
        Recording(("a",), np.full((2, 1, 3), -1e300), [0, 1])


@pytest.mark.parametrize("suffix", [".bvh", ".c3d"])
def test_empty_missing_and_folder(tmp_path, suffix):
    (tmp_path / f"empty{suffix}").touch()
    (tmp_path / f"folder{suffix}").mkdir()
    for name, words in (
        ("empty", "is empty"),
        ("emty", f"no such file; there are 'empty{suffix}'"),
        ("folder", "fold"),
    ):
        with pytest.raises(FileFormatError, match=words):
            read_recording(tmp_path / f"{name}{suffix}")
