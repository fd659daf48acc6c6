"""Recordings made to harm, or damaged in a way that nobody foresaw, end with a message: soon, and in little memory."""

import time

import numpy as np
import pytest
from numpy.testing import assert_allclose

from maniport.demonstrations import read_recording
from maniport.errors import FileFormatError

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


def test_each_event_of_qualisys_has_a_line(tmp_path):
    """However many lines of a header begin alike, the numbers begin below them."""
    events = "FREQUENCY\t100\nEVENT\tbegin\t1\t0.00\nEVENT\tend\t2\t0.01\n"
    (tmp_path / "a.tsv").write_text(QUALISYS.format(events))
    assert_allclose(read_recording(tmp_path / "a.tsv", unit="m").point("A"), [[1, 2, 3], [1, 2, 4]])


def test_quoted_numbers_with_a_comma(tmp_path):
    """A decimal comma within quotes parts no fields, in either layout."""
    (tmp_path / "a.csv").write_text('time,a_x,a_y,a_z\n0,"1,5",2,3\n1,"1,5",2,3\n')
    (tmp_path / "b.csv").write_text('time,name,x,y,z\n0,a,"1,5",2,3\n1,a,"1,5",2,3\n')
    for name in ("a.csv", "b.csv"):
        assert_allclose(read_recording(tmp_path / name, unit="m").point("a"), np.tile([1.5, 2, 3], (2, 1)))
