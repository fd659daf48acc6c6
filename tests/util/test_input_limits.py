"""Input files that are endless, too large, damaged or odd are refused with an error of maniport, and at once."""

import io
import os
import zipfile
from itertools import pairwise

import numpy as np
import pytest

from maniport.arms import load_arm
from maniport.arms.meshes.mesh_files import load_mesh
from maniport.errors import FileFormatError, ManiportError
from maniport.mocap import read_recording
from maniport.pipeline.config import Config
from maniport.pipeline.settings import marker_roles
from maniport.transfer import IdentityMap, load_adapter
from maniport.util import files
from maniport.util.files import (
    array_names,
    load_arrays,
    load_ellipsoids,
    load_path,
    read_settings,
    save_ellipsoids,
)

READERS = {
    "r.bvh": read_recording,
    "r.c3d": read_recording,
    "r.urdf": load_arm,
    "r.xml": load_arm,
    "r.stl": load_mesh,
    "m.json": lambda path: marker_roles(Config(markers=str(path))),
    "r.npz": load_ellipsoids,
    "r.yaml": lambda path: read_settings(path, ("a",)),
}


@pytest.mark.parametrize("name", READERS)
def test_pipes_devices_and_huge_files_are_not_opened(tmp_path, name):
    path = tmp_path / name
    os.mkfifo(path)
    for kind in ("pipe", "device"):
        with pytest.raises(FileFormatError, match=f"is a .*{kind}"):
            READERS[name](path)
        path.unlink()
        path.symlink_to("/dev/zero")
    path.unlink()
    with open(path, "wb") as stream:
        stream.truncate(2**40)
    with pytest.raises(FileFormatError, match=r"1\.049e\+06 MB"):
        READERS[name](path)


def test_only_needed_arrays_are_unpacked(tmp_path, monkeypatch):
    path = tmp_path / "bomb.npz"
    np.savez_compressed(path, manipulability=np.eye(3)[None], bomb=np.zeros(2_000_000))
    monkeypatch.setattr(files, "ARRAYS_BYTES", 10_000_000)
    np.testing.assert_array_equal(load_ellipsoids(path)[0], np.eye(3)[None])
    assert array_names(path, "file") == ["bomb", "manipulability"]
    with pytest.raises(FileFormatError, match=r"15\.26 MB.*9\.537 MB"):
        load_arrays(path, "file")


TIMES = np.arange(24) / 10
ARM = np.broadcast_to([[0.0, 0.0, 1.4], [0.0, 0.0, 1.1], [0.0, 0.0, 0.85]], (24, 3, 3))
ELLIPSOIDS = (lambda x: x @ x.transpose(0, 2, 1) + 0.1 * np.eye(3))(
    np.random.default_rng(0).normal(size=(24, 3, 3))
)
WRITERS = {
    "ellipsoids": (lambda path: save_ellipsoids(path, ELLIPSOIDS, TIMES), load_ellipsoids),
    "path": (lambda path: files.save_path(path, ARM[:, 2], TIMES), load_path),
    "recording": (
        lambda path: np.savez(
            path, names=["RSHO", "RELB", "RWRA"], positions=ARM, time=TIMES, unit="m"
        ),
        read_recording,
    ),
    "poses": (
        lambda path: np.savez(
            path, poses=np.zeros((24, 66)), trans=np.zeros((24, 3)), mocap_framerate=10.0
        ),
        read_recording,
    ),
    "adapter": (lambda path: IdentityMap().fit(ELLIPSOIDS, ELLIPSOIDS).save(path), load_adapter),
}


def npy(array):
    stream = io.BytesIO()
    np.lib.format.write_array(stream, np.asarray(array))
    return stream.getvalue()


def headed(descr, shape, content=b""):
    header = repr({"descr": descr, "fortran_order": False, "shape": shape}).encode()
    header += b" " * (-(len(header) + 11) % 64) + b"\n"
    return b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header + content


DAMAGED = {
    "text": b"hello",
    "nothing": b"",
    "half a header": npy(np.eye(3))[:20],
    "half": npy(np.eye(3))[:-8],
    "more than there is": headed("<f8", (10**15,)),
    "larger than any integer": headed("<f8", (10**22, 0)),
    "huge, of no bytes": headed("|S0", (10**13,)),
    "negative": headed("<f8", (-1,)),
    "objects": headed("|O", (1,), b"\x80\x04N."),
    "no Unicode": headed("<U1", (), b"\xff" * 4),
}
ODD = {
    "0-d": npy(1.0),
    "empty": npy(np.zeros(0)),
    "complex": npy(1j * np.ones(24)),
    "dates": npy(np.arange(24).astype("M8[s]")),
    "fields": npy(np.zeros(24, [("a", "f8")])),
    "words": npy(["a", "b"]),
    "bytes": npy([b"\xff"]),
    "long text": npy("[" * 20_000),
}


@pytest.fixture(scope="module", params=WRITERS)
def members_and_loader(request, tmp_path_factory):
    write, load = WRITERS[request.param]
    path = tmp_path_factory.mktemp("valid") / "valid.npz"
    write(path)
    load(path)
    with zipfile.ZipFile(path) as archive:
        return {name: archive.read(name) for name in archive.namelist()}, load


def pack(path, members, compression=zipfile.ZIP_STORED):
    with zipfile.ZipFile(path, "w", compression) as archive:
        for name, content in members.items():
            archive.writestr(name, content)


@pytest.mark.parametrize("content", [*DAMAGED.values(), *ODD.values()], ids=[*DAMAGED, *ODD])
def test_damaged_members_are_refused(members_and_loader, content, tmp_path):
    """Each member is replaced: a damaged one is a `FileFormatError`, an odd one is read or a `ManiportError`."""
    members, load = members_and_loader
    for name in members:
        pack(tmp_path / "odd.npz", members | {name: content})
        try:
            load(tmp_path / "odd.npz")
        except ManiportError as error:
            assert isinstance(error, FileFormatError) or content not in DAMAGED.values()  # noqa: PT017 - odd may be read
        else:
            assert content not in DAMAGED.values()


LIMIT = '<limit lower="-1" upper="1" effort="1" velocity="1"/>'
ENDS = '<parent link="{}"/><child link="{}"/>'


def serial(n, extra=""):
    links = "".join(f'<link name="l{i}"/>' for i in range(n + 1))
    joints = "".join(
        f'<joint name="j{i}" type="revolute">{ENDS.format(f"l{i}", f"l{i + 1}")}{LIMIT}</joint>'
        for i in range(n)
    )
    return f'<robot name="r">{links}{joints}{extra}</robot>'


def nested(n):
    bodies = (
        "".join(f'<body name="b{i}"><joint name="j{i}" range="-9 9"/>' for i in range(n))
        + "</body>" * n
    )
    return f"<mujoco><worldbody>{bodies}</worldbody></mujoco>"


def entities():
    """Write an XML of entities that expand to 10^10 letters."""
    steps = [f'<!ENTITY {b} "{f"&{a};" * 10}">' for a, b in pairwise("abcdefghij")]
    return f'<!DOCTYPE r [<!ENTITY a "aaaaaaaaaa">{"".join(steps)}]><robot>&j;</robot>'


def small(asset="", body="", joint="", shape=""):
    joint = f'<joint name="j" range="-9 9" {joint}/>'
    return f'<mujoco>{asset}<worldbody><body name="b" {body}>{joint}{shape}</body></worldbody></mujoco>'


CIRCLE = '<link name="x"/><link name="y"/>' + "".join(
    f'<joint name="{a}{b}" type="fixed">{ENDS.format(a, b)}</joint>' for a, b in ("xy", "yx")
)
OWN_MESH = '<asset><mesh name="m" vertex="{}"/></asset>'
LONG_MESH = f'<asset><mesh name="m" file="{"x" * 300}.stl"/></asset>'
GEOM = '<geom type="mesh" mesh="m"/>'
HOSTILE = {
    "20 000 links": (serial(20_000), "20001 elements <link>; at most 1000"),
    "900 in a row": (serial(900), "links in a row; at most 128"),
    "5000 nested bodies": (nested(5000), "at most 128"),
    "200 nested bodies": (nested(200), "at most 128"),
    "a million tags": (
        "<robot>" + "<a>" * 500_000 + "</a>" * 500_000 + "</robot>",
        "tags; at most 500000",
    ),
    "a circle": (serial(2, CIRCLE), "cycle"),
    "included": (
        '<mujoco><include file="/dev/zero"/><worldbody><body/></worldbody></mujoco>',
        "includes '/dev/zero', which lies outside",
    ),
    "entities": (entities(), "not readable as XML"),
    "two numbers": (small(body='pos="1 2"'), "<body> 'b' needs pos with 3 numbers.*found '1 2'"),
    "a word": (small(joint='pos="0 x 0"'), "<joint> 'j' needs pos with 3 numbers.*found '0 x 0'"),
    "nan": (small(body='quat="1 0 nan 0"'), "<body> 'b' needs quat with 4 numbers"),
    "no rotation": (small(body='quat="0 0 0 0"'), "is no rotation"),
    "huge": (small(body='pos="1e308 0 0"'), "each below 1e"),
    "huge mesh": (small(OWN_MESH.format("1e308 0 0 1 0 0 0 1 0 0 0 1"), shape=GEOM), "mesh 'm'"),
    "flat mesh": (small(OWN_MESH.format("0 0 0 1 0 0 0 1 0 1 1 0"), shape=GEOM), "mesh 'm'"),
    "long name": (small(LONG_MESH, shape=GEOM), "is missing"),
}


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_robots_are_refused(tmp_path, name):
    text, message = HOSTILE[name]
    path = tmp_path / ("robot.xml" if "<mujoco" in text else "robot.urdf")
    path.write_text(text)
    with pytest.raises(FileFormatError, match=message):
        load_arm(path).surfaces()
