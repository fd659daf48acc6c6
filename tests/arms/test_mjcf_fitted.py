"""Solids that an MJCF fits to meshes have MuJoCo's sizes and poses."""

import mujoco
import numpy as np
import pytest
from scipy.spatial import ConvexHull

from maniport.arms import load_arm
from maniport.arms.collisions import Collisions

# a bent prism along x, its faces outward: no axis of it is one of the frame
POINTS = "0 0 0 .5 0 .1 .5 .1 .15 0 .1 .02 0 0 .08 .5 0 .2 .5 .1 .22 0 .1 .1"
FACES = "0 2 1 0 3 2 4 5 6 4 6 7 0 1 5 0 5 4 1 2 6 1 6 5 2 3 7 2 7 6 3 0 4 3 4 7"
KINDS = ("", "sphere", "capsule", "cylinder", "ellipsoid", "box")
MESHES = {
    "plain": "",
    "convex": 'inertia="convex"',
    "exact": 'inertia="exact"',
    "shell": 'inertia="shell"',
    "mirrored": 'inertia="exact" scale="1 -0.7 1.3" refpos=".1 .2 0" refquat="1 .2 .3 0"',
}


def robot(kind, mesh="", compiler="", faces=FACES, geom=""):
    form = f'type="{kind}"' if kind else ""
    return (
        f'<mujoco><compiler {compiler}/><asset><mesh name="m" vertex="{POINTS}" face="{faces}" {mesh}/></asset>'
        '<worldbody><body name="base"><geom size=".01"/><body name="link" pos="0 0 .5">'
        f'<joint name="j" range="-1 1"/><geom {form} mesh="m" pos=".1 0 .2" euler="10 20 30" {geom}/>'
        "</body></body></worldbody></mujoco>"
    )


def shape_of(tmp_path, text):
    path = tmp_path / "robot.xml"
    path.write_text(text)
    arm = load_arm(path)
    (shape,) = (one for one in arm.geometry.checked.shapes if one.link == "link")
    return shape


def extents_of_mujoco(text, directions):
    """Extents along directions (n, 3) of the last geom, in the frame of its body, shape (n,)."""
    model = mujoco.MjModel.from_xml_string(text)
    turn = np.zeros(9)
    mujoco.mju_quat2Mat(turn, model.geom_quat[-1])
    local = directions @ turn.reshape(3, 3)
    size = model.geom_size[-1]
    across = np.linalg.norm(local[:, :2], axis=1)
    kind = mujoco.mjtGeom(model.geom_type[-1])
    extents = {
        mujoco.mjtGeom.mjGEOM_SPHERE: np.full(len(local), size[0]),
        mujoco.mjtGeom.mjGEOM_CAPSULE: size[0] + size[1] * np.abs(local[:, 2]),
        mujoco.mjtGeom.mjGEOM_CYLINDER: size[0] * across + size[1] * np.abs(local[:, 2]),
        mujoco.mjtGeom.mjGEOM_ELLIPSOID: np.linalg.norm(local * size, axis=1),
        mujoco.mjtGeom.mjGEOM_BOX: np.abs(local) @ size,
    }
    return directions @ model.geom_pos[-1] + extents[kind]


def require_mujocos_size(tmp_path, text):
    shape = shape_of(tmp_path, text)
    directions = np.random.default_rng(0).normal(size=(200, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    expected = extents_of_mujoco(text, directions)
    found = (shape.core @ directions.T).max(axis=0) + shape.radius
    np.testing.assert_allclose(found, expected, atol=0.01 * np.ptp(shape.mesh[0]))


@pytest.mark.parametrize("bounds", ["", 'fitaabb="true"'])
@pytest.mark.parametrize("kind", KINDS)
def test_a_solid_fitted_to_a_mesh_has_mujocos_size(tmp_path, kind, bounds):
    require_mujocos_size(tmp_path, robot(kind, compiler=bounds))


@pytest.mark.parametrize("mesh", MESHES)
def test_the_inertia_of_the_mesh_decides(tmp_path, mesh):
    text = robot("box", MESHES[mesh], geom='fitscale="0.9"')
    require_mujocos_size(tmp_path, text)
    require_mujocos_size(tmp_path, text.replace("<compiler ", '<compiler fitaabb="true" '))


def test_points_without_faces_are_their_hull(tmp_path):
    text = robot("box", 'inertia="exact"', faces="").replace('face=""', "")
    require_mujocos_size(tmp_path, text)
    points = np.array(POINTS.split(), dtype=float).reshape(-1, 3)
    points = points * (1.0, 1.0, 3.0)
    text = text.replace(" inertia", ' scale="1 1 3" inertia')
    require_mujocos_size(tmp_path, text)
    shape = shape_of(tmp_path, text.replace('type="box"', 'type="mesh"'))
    corners = shape.mesh[0][shape.mesh[1]]
    corners = corners - corners.mean(axis=(0, 1))
    volumes = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6
    assert volumes.sum() == pytest.approx(ConvexHull(points).volume)


@pytest.mark.parametrize(
    ("kind", "mesh", "faces"),
    [
        ("box", "", "0 1 2"),
        ("capsule", 'inertia="exact"', FACES[::-1]),
        ("sphere", 'inertia="hollow"', FACES),
    ],
    ids=["flat", "inward", "unknown inertia"],
)
def test_a_mesh_that_nothing_fits_leaves_the_rest_checked(tmp_path, kind, mesh, faces):
    path = tmp_path / "robot.xml"
    path.write_text(robot(kind, mesh, faces=faces).replace("</body>", "<geom size='.01'/></body>"))
    collisions = Collisions.of(load_arm(path))
    assert collisions.checked
    assert "'m'" in collisions.shapes.missing["link"]
