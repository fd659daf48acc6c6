"""Meshes: solids, reduction, every file format, search paths, hostile files, surfaces of arms."""

import os
from itertools import product
from pathlib import Path
from time import process_time

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from drawn_arms import drawn, one_link, ordered, volume, write_digger
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

from fuzz.mesh_examples import CORNERS, GOOD, OBJ, PLY, POINT_LINES, SHOWN, dae, gltf, stl
from maniport.arms import Arm, Surface, load_arm
from maniport.arms.collisions import Collisions
from maniport.arms.meshes import reduced, solid
from maniport.arms.meshes.mesh_files import load_mesh
from maniport.arms.restriction import mirrored
from maniport.cli import app
from maniport.errors import FileFormatError

SOLIDS = {
    "box": (solid("box", 0.1, 0.2, 0.3), 0.006, (0.1, 0.2, 0.3)),
    "ball": (solid("sphere", 0.1), 4 / 3 * np.pi * 1e-3, (0.2, 0.2, 0.2)),
    "ellipsoid": (solid("ellipsoid", 0.1, 0.2, 0.3), 4 / 3 * np.pi * 6e-3, (0.2, 0.4, 0.6)),
    "cylinder": (solid("cylinder", 0.1, 0.3), np.pi * 3e-3, (0.2, 0.2, 0.3)),
    "capsule": (solid("capsule", 0.1, 0.3), np.pi * 3e-3 + 4 / 3 * np.pi * 1e-3, (0.2, 0.2, 0.5)),
}


@pytest.mark.parametrize("name", SOLIDS)
def test_solids_are_closed_and_have_their_size(name):
    (points, triangles), exact, size = SOLIDS[name]
    edges = {
        tuple(edge) for edge in np.concatenate([triangles[:, [i, (i + 1) % 3]] for i in range(3)])
    }
    assert len(edges) == 3 * len(triangles)
    assert all((b, a) in edges for a, b in edges)
    np.testing.assert_allclose(np.ptp(points, axis=0), size, atol=1e-12)
    np.testing.assert_allclose(points.max(axis=0), -points.min(axis=0), atol=1e-12)
    assert 0.975 * exact < volume(Surface(0, points, triangles)) < (1 + 1e-9) * exact


@given(most=st.integers(1, 400), noise=st.floats(0, 0.02), seed=st.integers(0, 99))
def test_reducing_keeps_to_the_number_and_the_box(most, noise, seed):
    x, y = (axis.reshape(-1) for axis in np.meshgrid(*(np.linspace(0, 1, 16),) * 2))
    points = np.stack([x, y, 0.02 * np.sin(7 * x) * np.cos(5 * y)], axis=1)
    points += noise * np.random.default_rng(seed).normal(size=points.shape)
    corner = (np.arange(15)[:, None] * 16 + np.arange(15)).reshape(-1, 1)
    triangles = np.concatenate([np.add(corner, row) for row in ((0, 1, 17), (0, 17, 16))]).astype(
        np.int32
    )
    new_points, new_triangles = reduced((points, triangles), most)
    assert len(new_triangles) <= most
    assert np.all(np.isfinite(new_points))
    if len(new_points):
        assert np.all(new_points >= points.min(axis=0) - 1e-6)
        assert np.all(new_points <= points.max(axis=0) + 1e-6)
        np.testing.assert_array_equal(np.unique(new_triangles), np.arange(len(new_points)))


@pytest.mark.parametrize("name", GOOD)
def test_every_kind_of_mesh_is_read_alike(tmp_path, name):
    content = GOOD[name]
    (tmp_path / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    (surface,) = one_link(tmp_path, f'<mesh filename="{name}"/>').surfaces()
    np.testing.assert_allclose(ordered(surface.points), ordered(CORNERS), atol=1e-7)
    assert volume(surface) == pytest.approx(0.2 * 0.1 * 0.05 / 6, rel=1e-5)
    assert len(surface.triangles) == 4


def doubling(n):
    return (
        "".join(
            f'<node id="n{i}"><instance_node url="#n{i + 1}"/><instance_node url="#n{i + 1}"/></node>'
            for i in range(n)
        )
        + f'<node id="n{n}">{SHOWN}</node>'
    )


LIST = '<input semantic="VERTEX" source="#v" offset="0"/>'
HOSTILE = {
    "itself.dae": (
        dae(nodes='<node id="n"><instance_node url="#n"/></node>'),
        "has 20001 nodes, counted for each instance; at most 20000",
    ),
    "doubling.dae": (
        dae(nodes='<node><instance_node url="#n0"/></node>', library=doubling(40)),
        "20001 nodes",
    ),
    "deep.dae": (dae(nodes="<node>" * 30_000 + SHOWN + "</node>" * 30_000), "20001 nodes"),
    "corners.dae": (
        dae(f"<polylist>{LIST}<vcount>4000000000</vcount><p>0 1 2</p></polylist>"),
        "announce 4000000000 corners; there are 3",
    ),
    "points.dae": (
        dae(accessor='count="4000000000" stride="3"'),
        "cannot be read as a mesh: cannot reshape",
    ),
    "wild.ply": (
        PLY.format(4, 1) + POINT_LINES + "\n3 0 1 2147483647\n",
        "point number 2147483647; there are 4",
    ),
    "count.ply": (PLY.format(4_000_000_000, 1), "4000000000 elements announced, more than bytes"),
    "wild.obj": (OBJ + "f 1 2 900000\n", "index 899999 is out of bounds"),
    "count.gltf": (
        gltf(positions=4_000_000_000),
        "4000000000 entries announced by an accessor, more than bytes",
    ),
    "no view.gltf": (
        gltf(accessors=[{"componentType": 5126, "count": 4_000_000_000, "type": "MAT4"}]),
        "of view None",
    ),
    "circle.gltf": (gltf(nodes=({"children": [1]}, {"children": [0, 1], "mesh": 0})), "circle"),
    "buffer.gltf": (gltf(buffer="../../../../../../etc/passwd"), "lies outside its folder"),
    "device.gltf": (gltf(buffer="pipe"), "is a pipe, a socket or a device"),
    "deep.gltf": ('{"a":' * 100_000, "cannot be read"),
}


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_meshes_are_refused(tmp_path, name):
    content, message = HOSTILE[name]
    file = tmp_path / name
    file.write_bytes(content if isinstance(content, bytes) else content.encode())
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(FileFormatError, match=message) as caught:
        load_mesh(file)
    assert str(tmp_path) in str(caught.value)
    assert caught.value.__cause__ is None


def many_polygon_lists(n):
    shape = f'<triangles count="1">{LIST}<p>0 1 2</p></triangles>'
    return dae(shape * n)


def many_nodes(n):
    nodes = tuple({"mesh": 0, "children": [i + 1]} for i in range(n - 1))
    return gltf(nodes=(*nodes, {"mesh": 0}))


FACET = "facet normal 0 0 1 outer loop vertex 0 0 0 vertex 1 0 0 vertex 0 1 1 endloop endfacet"
MANY = {
    "o.obj": lambda n: OBJ + "".join(f"o part{i}\nf 1 2 3\n" for i in range(n)),
    "g.obj": lambda n: OBJ + "".join(f"g a b{i}\nf 1/1/1 2//2 3/3\n" for i in range(n)),
    "usemtl.obj": lambda n: OBJ + "".join(f"usemtl m{i}\n  f 1 2 3\n" for i in range(n)),
    "solids.stl": lambda n: "".join(f"solid a{i}\n{FACET}\nendsolid\n" for i in range(n)),
    "lists.dae": many_polygon_lists,
    "nested.gltf": many_nodes,
}


@pytest.mark.parametrize("name", MANY)
def test_time_is_linear_in_the_number_of_groups(tmp_path, name):
    """A twelvefold number takes much less than 144 times as long; quadratic readers took minutes."""
    times = []
    for count in (250, 3000):
        (tmp_path / name).write_text(MANY[name](count))
        started = process_time()
        triangles = load_mesh(tmp_path / name)[1]
        times.append(process_time() - started)
        assert len(triangles) >= count
    assert times[1] < 50 * max(times[0], 0.02)


def test_groups_of_an_obj_change_no_triangle(tmp_path):
    faces = ["f 1 3 2", "f 1//1 2//1 4//1", "f -4/1/1 -1/1/1 -2/1/1", "f 2 \\\n3 4"]
    words = ["o a", "g", "usemtl steel", "s off"]
    text = "v 0 0 0\nv 0.2 0 0\nv 0 0.1 0\nv 0 0 0.05\nvn 0 0 1\nvt 0 0\n"
    (tmp_path / "a.obj").write_text(text + "\n".join(faces))
    grouped = "".join(f"{word}\n{face}\n" for word, face in zip(words, faces, strict=True))
    (tmp_path / "b.obj").write_text(text + grouped)
    plain, groups = (load_mesh(tmp_path / name) for name in ("a.obj", "b.obj"))
    np.testing.assert_array_equal(plain[0], groups[0])
    np.testing.assert_array_equal(plain[1], groups[1])
    assert volume(Surface(0, *groups)) == pytest.approx(0.2 * 0.1 * 0.05 / 6)


OUTSIDE = {
    "up": "../../secret.stl",
    "up and down": "../urdf/../../secret.stl",
    "absolute": "{top}/secret.stl",
    "file": "file://{top}/secret.stl",
    "package up": "package://kit/../../../secret.stl",
    "link": "link.stl",
    "package far above": "package://far/secret.stl",
    "the root": "package:///{top}/secret.stl",
}


@pytest.mark.parametrize(
    ("case", "suffix"),
    [*((case, "urdf") for case in OUTSIDE), ("up", "xml"), ("absolute", "xml"), ("link", "xml")],
)
def test_meshes_outside_are_refused_unless_allowed(tmp_path, case, suffix):
    folder = tmp_path / "a" / "b" / "c" / "kit" / "urdf"
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
    with pytest.raises(FileFormatError, match=r"mesh_folders=|missing"):
        arm.surfaces()
    if "package" not in name:
        allowed = load_arm(folder / f"one.{suffix}", mesh_folders=[tmp_path])
        assert len(allowed.surfaces()) == 1


def test_folders_are_allowed_on_the_command_line(tmp_path):
    (tmp_path / "secret.stl").write_bytes(stl())
    arm = one_link(tmp_path / "a" / "b" / "c", '<mesh filename="../../../secret.stl"/>')
    words = ["info", arm.chain.source, "--mesh-folders"]
    assert CliRunner().invoke(app, [*words, str(tmp_path), "--json"]).exit_code == 0
    assert CliRunner().invoke(app, [*words, str(tmp_path / "gone")]).exit_code != 0


NAMES = {
    "beside": ("part.stl", "part.stl"),
    "relative": ("../meshes/part.stl", "../meshes/part.stl"),
    "package above": ("package://kit/meshes/part.stl", "../../kit/meshes/part.stl"),
    "inside its package": ("package://robot/meshes/part.stl", "../meshes/part.stl"),
    "model": ("model://kit/part.stl", "../../kit/part.stl"),
    "three slashes": ("package:///kit/part.stl", "../../kit/part.stl"),
    "package under another name": ("package://other/meshes/part.stl", "../meshes/part.stl"),
    "ROS": ("package://kit/part.stl", "../../../elsewhere/ros/kit/part.stl"),
    "ROS 2": ("package://kit/part.stl", "../../../elsewhere/ros2/share/kit/part.stl"),
}


TAILS = {
    "absolute": ("/home/else/ws/robot/meshes/arm/part.stl", "meshes/arm/part.stl"),
    "file": ("file:///opt/robot/meshes/part.stl", "meshes/part.stl"),
    "Windows": (r"C:\Users\me\robot\part.stl", "urdf/part.stl"),
    "backslashes": (r"..\meshes\part.stl", "meshes/part.stl"),
}


@pytest.mark.parametrize("suffix", ["urdf", "xml"])
@pytest.mark.parametrize("case", TAILS)
def test_ends_of_absolute_names_are_searched(tmp_path, case, suffix):
    name, place = TAILS[case]
    file = tmp_path / "robot" / place
    file.parent.mkdir(parents=True)
    file.write_bytes(stl())
    arm = with_mesh(tmp_path / "robot" / "urdf", name, suffix)
    assert len(arm.surfaces()[0].points) == 4
    assert Collisions.of(arm).shapes.missing == {}


@pytest.mark.parametrize(
    ("name", "suffix"),
    [
        ("package://kit/meshes/part.stl", "urdf"),  # MJCF has no packages
        *product(
            ["/home/else/kit/meshes/part.stl", "meshes/part.stl", "part.stl"], ["urdf", "xml"]
        ),
    ],
)
def test_mesh_folders_reach_every_name(tmp_path, name, suffix):
    (tmp_path / "far" / "meshes").mkdir(parents=True)
    (tmp_path / "far" / "meshes" / "part.stl").write_bytes(stl())
    arm = with_mesh(tmp_path / "robot" / "urdf", name, suffix)
    with pytest.raises(FileFormatError, match=r"part\.stl.*is missing.*--mesh-folders"):
        arm.surfaces()
    folder = tmp_path / "far" if "meshes/" in name else tmp_path / "far" / "meshes"
    found = load_arm(arm.chain.source, mesh_folders=[folder])
    assert len(found.surfaces()[0].points) == 4


def with_mesh(folder, name, suffix):
    """An arm whose moving link shows a mesh of that name."""
    if suffix == "urdf":
        return one_link(folder, f'<mesh filename="{name}"/>')
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "one.xml").write_text(
        f'<mujoco><asset><mesh name="m" file="{name}"/></asset><worldbody><body name="b"><joint name="j" '
        'range="-9 9"/><geom type="mesh" mesh="m"/></body></worldbody></mujoco>'
    )
    return load_arm(folder / "one.xml")


@pytest.mark.parametrize("case", NAMES)
def test_meshes_are_found_by_their_names(tmp_path, monkeypatch, case):
    monkeypatch.setenv(
        "ROS_PACKAGE_PATH", f"{tmp_path / 'nowhere'}{os.pathsep}{tmp_path / 'elsewhere/ros'}"
    )
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path / "elsewhere/ros2"))
    name, place = NAMES[case]
    folder = tmp_path / "ws" / "robot" / "urdf"
    file = Path(os.path.normpath(folder / place))
    file.parent.mkdir(parents=True)
    file.write_bytes(stl())
    monkeypatch.chdir(tmp_path)
    assert len(one_link(folder, f'<mesh filename="{name}"/>').surfaces()[0].points) == 4


def test_missing_meshes_are_named_only_when_they_are_drawn(tmp_path):
    arm = one_link(tmp_path, '<mesh filename="package://kit/part.stl"/>')
    assert arm.forward([0.1]).shape == (4, 4)
    with pytest.raises(
        FileFormatError,
        match=r"one\.urdf.*'package://kit/part\.stl'.*'kit'.*ROS_PACKAGE_PATH",
    ):
        arm.surfaces()
    with pytest.raises(FileFormatError, match=r"'part\.stl'.*looked at '.*part\.stl'"):
        one_link(tmp_path, '<mesh filename="part.stl"/>').surfaces()


ROD = '<collision name="rod"><origin xyz="0.1 0 0" rpy="0 1 0"/><geometry>{}</geometry></collision>'


def test_collision_shapes_stand_in_for_missing_meshes(tmp_path):
    digger = write_digger(tmp_path)
    whole = load_arm(digger, frame="bucket")
    volumes = [volume(surface) for surface in whole.surfaces()]
    rod = ROD.format('<cylinder radius="0.05" length="0.3"/>')
    text = digger.read_text().replace('<link name="boom">', f'<link name="boom">{rod}')
    digger.write_text(text.replace('filename="boom.stl"', 'filename="gone.stl"'))
    arm = load_arm(digger, frame="bucket")
    lamp = 0.02**3
    assert arm.geometry.stand_ins == ("boom",)
    assert whole.geometry.stand_ins == ()
    actual = [volume(surface) for surface in arm.surfaces()]
    assert actual[1] - lamp == pytest.approx(
        np.pi * 0.05**2 * 0.3, rel=0.02
    )  # a mesh of flat sides
    assert [actual[0], actual[2]] == [volumes[0], volumes[2]]
    assert Arm(mirrored(arm.chain)).geometry.stand_ins == ("boom",)
    digger.write_text(
        digger.read_text().replace(
            '<cylinder radius="0.05" length="0.3"/>', '<mesh filename="no.stl"/>'
        )
    )
    with pytest.raises(FileFormatError, match=r"'gone\.stl'.*\(1 of 1"):
        load_arm(digger, frame="bucket").surfaces()


SENSELESS = {
    "": "has no <geometry>",
    "<mesh/>": "names no file",
    '<cone radius="1"/>': "has the shape <cone>; allowed",
    '<box size="1 2"/>': "needs size with 3 numbers.*found '1 2'",
    "<box/>": "needs size.*found None",
    '<sphere radius="-1"/>': "needs radius with 1 number.* not negative; found '-1'",
    '<cylinder radius="1" length="nan"/>': "needs length",
    '<sphere radius="1e8"/>': "reaches farther than",
    '<mesh filename="part.stl" scale="2"/>': "needs scale with 3 numbers.*; found '2'",
}


@pytest.mark.parametrize("geometry", SENSELESS)
def test_senseless_shapes_are_named(tmp_path, geometry):
    (tmp_path / "part.stl").write_bytes(stl())
    with pytest.raises(FileFormatError, match=rf"link 'tip'.*{SENSELESS[geometry]}"):
        one_link(tmp_path, geometry).surfaces()


def test_surfaces_are_where_pinocchio_has_them(tmp_path):
    """At random poses, the corners of box, mesh, cylinder and lamp are those of Pinocchio's own placements."""
    digger = write_digger(tmp_path)
    arm = load_arm(digger, frame="bucket")
    assert [surface.joint for surface in arm.surfaces()] == [0, 1, 2]
    q = np.array([0.7, -0.3])
    model = pin.buildModelFromUrdf(str(digger))
    text = digger.read_text().replace("boom.stl", str(digger.parent / "boom.stl"))
    geometry = pin.buildGeomFromUrdfString(model, text, pin.VISUAL)
    data = model.createData()
    places = geometry.createData()
    pin.updateGeometryPlacements(model, data, geometry, places, np.array([*q, 0.0]))
    where = dict(zip([thing.name for thing in geometry.geometryObjects], places.oMg, strict=True))
    cube = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
    expected = {
        "base_0": cube * (0.3, 0.2, 0.1),
        "boom_0": CORNERS * (2, 1, 1),
        "lamp_0": cube * 0.02,
        "boom_1": np.array([[0.04, 0, 0.1], [0, 0.04, -0.1]]),
        "bucket_0": np.array([[0, 0, 0.06], [0.06, 0, 0]]),
    }
    actual = drawn(arm, q)
    for name, corners in expected.items():
        for corner in corners:
            assert np.linalg.norm(actual - where[name].act(corner), axis=1).min() < 1e-7, name


def test_mjcf_surfaces_are_where_mujoco_has_them(tmp_path):
    """Corners of an MJCF's meshes agree with MuJoCo; of a body's shapes only those that touch nothing are drawn."""
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "wedge.stl").write_bytes(stl())
    path = tmp_path / "arm.xml"
    show = 'contype="0" conaffinity="0" group="2" type="mesh" mesh="wedge"'
    path.write_text(f"""<mujoco><compiler angle="radian" meshdir="parts"/>
      <asset><mesh name="wedge" file="wedge.stl" scale="1 2 -1"/></asset>
      <worldbody><geom type="plane" size="1 1 1"/><body name="foot">
        <geom name="foot" {show}/>
        <body name="upper" pos="0.2 0 0"><joint name="a" axis="0 0 1" range="-1 1"/>
          <joint name="b" axis="0 1 0" pos="0.1 0 0" range="-1 1"/>
          <geom name="upper" {show} pos="0.1 0 0" euler="0.3 0 1"/><geom type="capsule" size="0.05 0.1"/>
          <body name="fore" pos="0.3 0 0.1"><joint name="c" type="slide" axis="1 0 0" range="-1 1"/>
            <geom name="fore" type="box" size="0.1 0.02 0.03" euler="0.1 0 0"/></body></body></body></worldbody>
    </mujoco>""")
    arm = load_arm(path)
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    q = arm.sample(1, random_state=0)[0]
    data.qpos[:] = q
    mujoco.mj_kinematics(model, data)
    mesh = model.mesh_vert[: model.mesh_vertnum[0]]
    cube = np.array([[x, y, z] for x in (-0.1, 0.1) for y in (-0.02, 0.02) for z in (-0.03, 0.03)])
    expected = [
        corners @ data.geom(name).xmat.reshape(3, 3).T + data.geom(name).xpos
        for name, corners in (("foot", mesh), ("upper", mesh), ("fore", cube))
    ]
    np.testing.assert_allclose(
        drawn(arm, q), ordered(np.concatenate(expected)), atol=1e-6
    )  # MuJoCo stores floats
    assert [surface.joint for surface in arm.surfaces()] == [0, 2, 3]
    assert volume(arm.surfaces()[0]) == pytest.approx(2 * 0.2 * 0.1 * 0.05 / 6, rel=1e-5)
