"""Mesh files of every kind, those that crashed or hung native readers, and where a robot's file may send its reader."""

import os

import numpy as np
import pytest
from drawn_arms import one_link, ordered, volume
from typer.testing import CliRunner

from fuzz.mesh_examples import CORNERS, GOOD, OBJ, PLY, POINT_LINES, SHOWN, dae, gltf, stl
from maniport.arms import load_arm
from maniport.arms.meshes.mesh_files import load_mesh
from maniport.cli import app
from maniport.errors import FileFormatError


@pytest.mark.parametrize("name", GOOD)
def test_every_kind_of_mesh_is_read_alike(tmp_path, name):
    """One tetrahedron in each format, binary, as text, indirect and moved about, is the same solid."""
    content = GOOD[name]
    (tmp_path / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    (surface,) = one_link(tmp_path, f'<mesh filename="{name}"/>').surfaces()
    np.testing.assert_allclose(ordered(surface.points), ordered(CORNERS), atol=1e-7)
    assert volume(surface) == pytest.approx(0.2 * 0.1 * 0.05 / 6, rel=1e-5)
    assert len(surface.triangles) == 4


def doubling(n):
    """Nodes each of which shows the next one twice."""
    return "".join(f'<node id="n{i}"><instance_node url="#n{i + 1}"/><instance_node url="#n{i + 1}"/></node>'
                   for i in range(n)) + f'<node id="n{n}">{SHOWN}</node>'  # fmt: skip


LIST = '<input semantic="VERTEX" source="#v" offset="0"/>'
HOSTILE = {
    "itself.dae": (dae(nodes='<node id="n"><instance_node url="#n"/></node>'),
                   "has 20001 nodes, each counted as often as it is shown; at most 20000"),
    "doubling.dae": (dae(nodes='<node><instance_node url="#n0"/></node>', library=doubling(40)), "20001 nodes"),
    "deep.dae": (dae(nodes="<node>" * 30_000 + SHOWN + "</node>" * 30_000), "20001 nodes"),
    "corners.dae": (dae(f'<polylist>{LIST}<vcount>4000000000</vcount><p>0 1 2</p></polylist>'),
                    "announce 4000000000 corners; there are 3"),
    "points.dae": (dae(accessor='count="4000000000" stride="3"'), "4000000000 points of 3 numbers are announced"),
    "wild.ply": (PLY.format(4, 1) + POINT_LINES + "\n3 0 1 2147483647\n", "point number 2147483647; there are 4"),
    "count.ply": (PLY.format(4_000_000_000, 1), "4000000000 elements announced, more than bytes"),
    "wild.obj": (OBJ + "f 1 2 900000\n", "index 899999 is out of bounds"),
    "count.gltf": (gltf(positions=4_000_000_000), "4000000000 entries announced by an accessor, more than bytes"),
    "no view.gltf": (gltf(accessors=[{"componentType": 5126, "count": 4_000_000_000, "type": "MAT4"}]), "of view None"),
    "circle.gltf": (gltf(nodes=({"children": [1]}, {"children": [0, 1], "mesh": 0})), "circle"),
    "buffer.gltf": (gltf(buffer="../../../../../../etc/passwd"), "lies outside its folder"),
    "device.gltf": (gltf(buffer="pipe"), "is a pipe, a socket or a device"),
    "deep.gltf": ('{"a":' * 100_000, "cannot be read"),
}  # fmt: skip


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_meshes_are_refused(tmp_path, name):
    """Each ends in a message; natively they ended the process, hung, took all memory or read another's files."""
    content, message = HOSTILE[name]
    file = tmp_path / name
    file.write_bytes(content if isinstance(content, bytes) else content.encode())
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(FileFormatError, match=message) as caught:
        load_mesh(file)
    assert str(tmp_path) in str(caught.value)
    assert caught.value.__cause__ is None


OUTSIDE = {
    "up": "../../secret.stl", "up and down": "../urdf/../../secret.stl", "absolute": "{top}/secret.stl",
    "file": "file://{top}/secret.stl", "package up": "package://kit/../../../secret.stl", "link": "link.stl",
    "package far above": "package://far/secret.stl", "the root": "package:///{top}/secret.stl",
}  # fmt: skip


@pytest.mark.parametrize(
    ("case", "suffix"), [*((case, "urdf") for case in OUTSIDE), ("up", "xml"), ("absolute", "xml"), ("link", "xml")]
)
def test_meshes_outside_are_refused_unless_allowed(tmp_path, case, suffix):
    """What a robot's file names outside its folders and packages is not read; the message says how to allow it."""
    folder = tmp_path / "a" / "b" / "c" / "kit" / "urdf"
    (tmp_path / "far").mkdir()
    for place in (tmp_path / "far", tmp_path / "a" / "b" / "c", tmp_path):
        place.mkdir(parents=True, exist_ok=True)
        (place / "secret.stl").write_bytes(stl())
    name = OUTSIDE[case].format(top=tmp_path)
    arm = one_link(folder, f'<mesh filename="{name}"/>')
    (folder / "link.stl").symlink_to(tmp_path / "secret.stl")
    if suffix == "xml":
        (folder / "one.xml").write_text(
            f'<mujoco><asset><mesh name="m" file="{name}"/></asset><worldbody><body name="b"><joint name="j" '
            'range="-9 9"/><geom type="mesh" mesh="m"/></body></worldbody></mujoco>'
        )
        arm = load_arm(folder / "one.xml")
    with pytest.raises(FileFormatError, match=r"lies outside its folder and its packages.*mesh_folders=|is missing"):
        arm.surfaces()
    if "package" not in name:
        allowed = load_arm(folder / f"one.{suffix}", mesh_folders=[tmp_path])
        assert len(allowed.surfaces()) == 1


def test_folders_are_allowed_on_the_command_line(tmp_path, monkeypatch):
    """``--mesh-folders`` allows folders as the argument does."""
    (tmp_path / "a" / "b" / "c").mkdir(parents=True)
    (tmp_path / "secret.stl").write_bytes(stl())
    folder = tmp_path / "a" / "b" / "c"
    arm = one_link(folder, '<mesh filename="../../../secret.stl"/>')
    words = ["info", arm.chain.source, "--mesh-folders"]
    assert CliRunner().invoke(app, [*words, str(tmp_path), "--json"]).exit_code == 0
    assert CliRunner().invoke(app, [*words, str(tmp_path / "gone")]).exit_code != 0
