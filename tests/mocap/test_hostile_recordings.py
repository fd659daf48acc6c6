"""Recordings made to harm, or damaged in a way that nobody foresaw, end with a message: soon, and in little memory."""

import time

import numpy as np
import pytest

from maniport.errors import FileFormatError, InvalidInputError
from maniport.mocap import Recording, read_recording
from maniport.mocap.readers import mvnx, npz

QUALISYS = "NO_OF_FRAMES\t2\n{}MARKER_NAMES\tA\n1\t2\t3\n1\t2\t4\n"

TABLES = {
    "line.csv": (b"," * 3_000_000, "has 3000000 characters in a line; at most 2097152 are read"),
    "line.trc": (b"PathFileType\n1\n1\n" + b"a\t\t" * 10**6 + b"\nX\n1\t2\n", "characters in a line"),
    "quoted.csv": ('time,"' + "a" * 140_000 + '_x",b_y,b_z\n0,1,2,3\n', "140004 characters in the name of a column"),
    "cuts.csv": ("time," + "_" * 20_000 + "q,b_y,b_z\n0,1,2,3\n", "20001 characters in the name of a column"),
    "twice.csv": ("time,a_x,a_y,a_z,a_X\n0,1,2,3,4\n", "the column 'a_X' is there twice"),
    "frame.csv": ("Format Version,1.2\nType\nName\nx\ny\nFrame\n1\n", "Motive holds no positions of points"),
    "rate.tsv": (QUALISYS.format("FREQUENCY\n"), "does not say how fast its frames follow"),
}


@pytest.mark.parametrize("name", TABLES)
def test_tables_that_are_none_end_soon(tmp_path, name):
    """Endless lines, names that take hours to be taken apart, columns twice and headers cut off are told."""
    content, told = TABLES[name]
    (tmp_path / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    begin = time.process_time()
    with pytest.raises(FileFormatError, match=told):
        read_recording(tmp_path / name, unit="mm")
    assert time.process_time() - begin < 2


MVNX = '<mvnx version="4"><subject frameRate="60"><segments><segment label="A"/></segments>{}</subject></mvnx>'
FRAME = '<frame type="normal"><position>{}</position><position>9</position></frame>'


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (MVNX.format("<a/>" * 60), "has 51 elements; at most 50 are read"),
        (MVNX.format(FRAME.format("1 " * 10**6)), "frame 1 holds more than 3 numbers for 1 segments"),
        (MVNX.format(FRAME.format("1 2")), "frame 1 holds 2 numbers for 1 segments"),
        (MVNX.format("<frame/>"), "frame 1 holds no <position>"),
        ('<?xml version="1.0" encoding="rot13"?><mvnx/>', "not readable as XML.*'rot13'"),
        ('<?xml version="1.0" encoding="zzz"?><mvnx/>', "not readable as XML.*unknown encoding: zzz"),
    ],
)
def test_mvnx_that_is_too_much(tmp_path, monkeypatch, content, told):
    """Elements without end, numbers without end and encodings that are none are told."""
    monkeypatch.setattr(mvnx, "ELEMENTS", 50)
    (tmp_path / "a.mvnx").write_text(content)
    with pytest.raises(FileFormatError, match=told):
        read_recording(tmp_path / "a.mvnx")


def header(text):
    """An NPY file with this header."""
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text.encode()


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (header("  a\n b\n  ("), "not a readable .npy file"),
        (
            header("{'descr': '<f8', 'fortran_order': False, 'shape': (1000000, 22, 3)}"),
            "its header declares the shape",
        ),
        (header("{'descr': '|u1', 'fortran_order': False, 'shape': (9, 22, 3)}") + bytes(9 * 66), "has 198 places"),
    ],
)
def test_arrays_that_are_too_much(tmp_path, monkeypatch, content, told):
    """Headers that are no Python, that promise too much, and small numbers that would become large ones."""
    monkeypatch.setattr(npz, "PLACES", 100)
    (tmp_path / "a.npy").write_bytes(content)
    with pytest.raises(FileFormatError, match=told):
        read_recording(tmp_path / "a.npy", rate=30)


@pytest.mark.filterwarnings("error")
def test_points_out_of_reach(tmp_path):
    """In a file they are missing; in an array they are refused: their squares would be no numbers."""
    np.savez(tmp_path / "a.npz", names=["a", "b"], positions=[[[1e300, 0, 0], [1, 2, 3]]] * 2, rate=30.0)
    assert read_recording(tmp_path / "a.npz", unit="m").missing.tolist() == [1, 0]
    np.save(tmp_path / "b.npy", np.full((2, 22, 3), 1e300) * np.linspace(0, 1, 66).reshape(22, 3))
    with pytest.raises(FileFormatError, match="22 joints without names"):
        read_recording(tmp_path / "b.npy", rate=30)
    np.savez(tmp_path / "c.npz", names=["a"], positions=np.zeros((2, 1, 3)), rate=1e-320)
    with pytest.raises(FileFormatError, match="or rate, the frames per second; found"):
        read_recording(tmp_path / "c.npz", unit="m")
    with pytest.raises(InvalidInputError, match=r"positions must be within ±1e\+12 m; found 1e\+300 m"):
        Recording(("a",), np.full((2, 1, 3), -1e300), [0, 1])
