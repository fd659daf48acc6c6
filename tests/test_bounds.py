"""The door for files: what has no end or is too large is refused at once, and the message names the bound."""

import os
import zipfile
from itertools import pairwise

import numpy as np
import pytest

from maniport import files, input_limits
from maniport.bodies import load_arm
from maniport.bodies.looks.mesh_files import load_mesh
from maniport.cli.recorded import Recorded
from maniport.demonstrations import read_recording
from maniport.errors import FileFormatError, ManiportError
from maniport.files import array_names, load_arrays, load_ellipsoids, read_settings
from maniport.transfer import load_adapter

READERS = {
    "r.bvh": read_recording, "r.c3d": read_recording, "r.urdf": load_arm, "r.xml": load_arm,
    "r.stl": load_mesh, "r.glb": load_mesh,
    "m.json": lambda path: Recorded(*[None] * 5, path).markers(), "r.npz": load_ellipsoids,
    "a.npz": load_adapter,
    "r.yaml": lambda path: read_settings(path, ("a",)),
}  # fmt: skip


@pytest.mark.parametrize("name", READERS)
def test_pipes_devices_and_huge_files_end_at_once(tmp_path, name):
    """A pipe that nobody writes to, an endless device and a sparse terabyte are refused before they are opened."""
    path = tmp_path / name
    os.mkfifo(path)
    with pytest.raises(FileFormatError, match="is a pipe, a socket or a device"):
        READERS[name](path)
    path.unlink()
    path.symlink_to("/dev/zero")
    with pytest.raises(FileFormatError, match="is a pipe, a socket or a device"):
        READERS[name](path)
    path.unlink()
    with open(path, "wb") as stream:
        stream.truncate(2**40)
    with pytest.raises(FileFormatError, match=r"has 1\.049e\+06 MB; at most [\d.]+ MB are read"):
        READERS[name](path)


@pytest.mark.parametrize("name", ["x" * 300 + ".npz", "a\0b.npz", "loop.npz"])
def test_names_that_no_file_has_are_refused(tmp_path, name):
    """Too long a name, one with a zero byte and a link to itself are files that cannot be read, nothing else."""
    (tmp_path / "loop.npz").symlink_to(tmp_path / "loop.npz")
    with pytest.raises(FileFormatError, match="cannot be read"):
        load_ellipsoids(tmp_path / name)


def test_only_wanted_arrays_are_unpacked(tmp_path, monkeypatch):
    """A bomb beside the ellipsoids is not unpacked, one in their place is refused before it is."""
    path = tmp_path / "bomb.npz"
    np.savez_compressed(path, manipulability=np.eye(3)[None], bomb=np.zeros(2_000_000))
    monkeypatch.setattr(files, "ARRAYS_BYTES", 10_000_000)
    assert path.stat().st_size < 20_000
    np.testing.assert_array_equal(load_ellipsoids(path)[0], np.eye(3)[None])
    assert array_names(path, "file") == ["bomb", "manipulability"]
    with pytest.raises(FileFormatError, match=r"its arrays have 15\.26 MB; at most 9\.537 MB are read"):
        load_arrays(path, "file")


def test_an_array_that_announces_more_than_there_is(tmp_path):
    """A header of 10^15 numbers is refused before room is made for them."""
    path = tmp_path / "liar.npz"
    with zipfile.ZipFile(path, "w") as archive, archive.open("manipulability.npy", "w") as stream:
        np.lib.format.write_array_header_1_0(stream, {"descr": "<f8", "fortran_order": False, "shape": (10**15,)})
    with pytest.raises(FileFormatError, match="more than there is"):
        load_ellipsoids(path)


LIMIT = '<limit lower="-1" upper="1" effort="1" velocity="1"/>'
ENDS = '<parent link="{}"/><child link="{}"/>'


def serial(n, extra="", first=0):
    """A URDF of n joints in a row."""
    links = "".join(f'<link name="l{i}"/>' for i in range(first, first + n + 1))
    joints = "".join(
        f'<joint name="j{i}" type="revolute">{ENDS.format(f"l{i}", f"l{i + 1}")}{LIMIT}</joint>'
        for i in range(first, first + n)
    )
    return f'<robot name="r">{links}{joints}{extra}</robot>'


def nested(n):
    """An MJCF of n bodies, each within the one before."""
    bodies = "".join(f'<body name="b{i}"><joint name="j{i}" range="-9 9"/>' for i in range(n)) + "</body>" * n
    return f"<mujoco><worldbody>{bodies}</worldbody></mujoco>"


def entities():
    """An XML that names ten times what names ten times what ..., 10^10 letters in all."""
    steps = [f'<!ENTITY {b} "{f"&{a};" * 10}">' for a, b in pairwise("abcdefghij")]
    return f'<!DOCTYPE r [<!ENTITY a "aaaaaaaaaa">{"".join(steps)}]><robot>&j;</robot>'


CIRCLE = '<link name="x"/><link name="y"/>' + "".join(
    f'<joint name="{a}{b}" type="fixed">{ENDS.format(a, b)}</joint>' for a, b in ("xy", "yx")
)
HOSTILE = {
    "20 000 links": (serial(20_000), "has 20001 elements <link>; at most 1000"),
    "900 in a row": (serial(900), "has 901 links in a row; at most 128"),
    "5000 nested bodies": (nested(5000), "levels of elements within elements; at most 128"),
    "200 nested bodies": (nested(200), "levels of elements within elements; at most 128"),
    "a million tags": ("<robot>" + "<a>" * 500_000 + "</a>" * 500_000 + "</robot>", "tags; at most 500000"),
    "many bodies": ("<mujoco><worldbody>" + "<body/>" * 2000 + "</worldbody></mujoco>", "2000 elements <body>"),
    "a circle": (serial(2, CIRCLE), "hang on one another in a circle"),
    "included": (
        '<mujoco><include file="/dev/zero"/><worldbody><body/></worldbody></mujoco>',
        "includes '/dev/zero', which lies outside",
    ),
    "entities": (entities(), "not readable as XML"),
}


@pytest.mark.parametrize("name", HOSTILE)
def test_robots_that_native_readers_do_not_bear(tmp_path, name):
    """Links, bodies and levels beyond the input_limits are refused before Pinocchio, which crashes, sees them."""
    text, message = HOSTILE[name]
    path = tmp_path / ("robot.xml" if "<mujoco" in text else "robot.urdf")
    path.write_text(text)
    with pytest.raises(FileFormatError, match=message):
        load_arm(path)


SMALL = '<mujoco>{}<worldbody><body name="b" {}><joint name="j" range="-9 9" {}/>{}</body></worldbody></mujoco>'
OWN = '<asset><mesh name="m" vertex="{}"/></asset>'
GEOM = '<geom type="mesh" mesh="m"/>'
SENSELESS = {
    "two numbers": (SMALL.format("", 'pos="1 2"', "", ""), r"<body> needs pos with 3 numbers.*found '1 2'"),
    "a word": (SMALL.format("", "", 'pos="0 x 0"', ""), r"<joint> needs pos with 3 numbers.*found '0 x 0'"),
    "nan": (SMALL.format("", 'quat="1 0 nan 0"', "", ""), "<body> needs quat with 4 numbers"),
    "an endless turn": (SMALL.format("", 'quat="1 inf 0 0"', "", ""), "<body> needs quat with 4 numbers"),
    "no turn": (SMALL.format("", 'quat="0 0 0 0"', "", ""), "<body> has quat '0 0 0 0', which is no rotation"),
    "huge": (SMALL.format("", 'pos="1e308 0 0"', "", ""), "each below 1e"),
    "wild points": (SMALL.format(OWN.format("1e308 0 0 1 0 0 0 1 0 0 0 1"), "", "", GEOM), "'m' make no solid"),
    "flat points": (SMALL.format(OWN.format("0 0 0 1 0 0 0 1 0 1 1 0"), "", "", GEOM), "'m' make no solid"),
    "long name": (SMALL.format(f'<asset><mesh name="m" file="{"x" * 300}.stl"/></asset>', "", "", GEOM), "is missing"),
}


@pytest.mark.parametrize("name", SENSELESS)
def test_numbers_that_native_readers_take_for_what_they_are_not(tmp_path, name):
    """Missing numbers were taken from memory, wild points ended the process by a signal; now they are named."""
    text, message = SENSELESS[name]
    (tmp_path / "robot.xml").write_text(text)
    with pytest.raises(FileFormatError, match=message):
        load_arm(tmp_path / "robot.xml").surfaces()


def test_robots_within_the_input_limits_are_read(tmp_path):
    """127 joints in a row are read from a URDF and 120 from an MJCF."""
    (tmp_path / "robot.urdf").write_text(serial(127))
    (tmp_path / "robot.xml").write_text(nested(120))
    assert load_arm(tmp_path / "robot.urdf").dof == 127
    assert load_arm(tmp_path / "robot.xml").dof == 120


def test_long_rows_of_mimics_are_followed(tmp_path):
    """Each of 900 joints beside one another mimics the one before: all follow the first, and none goes too deep."""
    child = '<link name="c{0}"/><joint name="k{0}" type="revolute"><mimic joint="{1}" multiplier="1"/>{2}{3}</joint>'
    names = ["j0", *(f"k{i}" for i in range(900))]
    text = "".join(child.format(i, names[i], ENDS.format("l1", f"c{i}"), LIMIT) for i in range(900))
    path = tmp_path / "robot.urdf"
    path.write_text(serial(1, text))
    np.testing.assert_array_equal(load_arm(path, frame="c899").chain.coupling, [[1], [1]])


def test_the_bound_is_named():
    """The message says what there is and what is read."""
    with pytest.raises(ManiportError, match=r"a\.bvh: has 7 points; at most 5 are read"):
        input_limits.require_at_most(7, 5, "points", "a.bvh")
