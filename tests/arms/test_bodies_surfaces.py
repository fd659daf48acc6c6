"""What arms look like: where their surfaces are, and how many triangles they have."""

import os
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from drawn_arms import drawn, ordered, volume, write_digger

from fuzz.mesh_examples import CORNERS, stl
from maniport.arms import load_arm


@pytest.fixture
def digger(tmp_path) -> Path:
    """The file of the digger."""
    return write_digger(tmp_path)


def test_surfaces_are_where_pinocchio_has_them(digger):
    """At random poses, the corners of box, mesh, cylinder and lamp are those of Pinocchio's own placements."""
    arm = load_arm(digger, frame="bucket")
    assert [surface.joint for surface in arm.surfaces()] == [0, 1, 2]
    q = np.array([0.7, -0.3])
    model = pin.buildModelFromUrdf(str(digger))
    text = digger.read_text().replace("boom.stl", str(digger.parent / "boom.stl"))
    geometry = pin.buildGeomFromUrdfString(model, text, pin.VISUAL)
    data, places = model.createData(), geometry.createData()
    pin.updateGeometryPlacements(model, data, geometry, places, np.array([*q, 0.0]))
    where = dict(zip([thing.name for thing in geometry.geometryObjects], places.oMg, strict=True))
    cube = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
    expected = {
        "base_0": cube * (0.3, 0.2, 0.1), "boom_0": CORNERS * (2, 1, 1), "lamp_0": cube * 0.02,
        "boom_1": np.array([[0.04, 0, 0.1], [0, 0.04, -0.1]]), "bucket_0": np.array([[0, 0, 0.06], [0.06, 0, 0]]),
    }  # fmt: skip
    found = drawn(arm, q)
    for name, corners in expected.items():
        for corner in corners:
            assert np.linalg.norm(found - where[name].act(corner), axis=1).min() < 1e-7, name


def test_mjcf_surfaces_are_where_mujoco_has_them(tmp_path):
    """Corners of an MJCF's meshes agree with MuJoCo; of a body's shapes only those that touch nothing are drawn."""
    if os.environ.get("CI"):
        import mujoco
    else:
        mujoco = pytest.importorskip("mujoco")
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
    arm, model = load_arm(path), mujoco.MjModel.from_xml_path(str(path))
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
    np.testing.assert_allclose(drawn(arm, q), ordered(np.concatenate(expected)), atol=1e-6)  # MuJoCo stores floats
    assert [surface.joint for surface in arm.surfaces()] == [0, 2, 3]
    assert volume(arm.surfaces()[0]) == pytest.approx(2 * 0.2 * 0.1 * 0.05 / 6, rel=1e-5)
