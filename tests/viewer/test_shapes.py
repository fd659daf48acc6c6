"""Shapes of the page: ellipsoids, bones, and a robot's surface that moves with its joints."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from maniport import Arm, load_arm
from maniport.arms import Surface
from maniport.errors import FileFormatError
from maniport.viewer.shapes import (
    SIZE,
    RobotBody,
    find_surfaces,
    from_roll_pitch_yaw,
    roll_pitch_yaw,
    shell,
)


def rotation_of_quaternion(wxyz):
    """Return the rotation matrix of a quaternion w, x, y, z."""
    return Rotation.from_quat(wxyz, scalar_first=True).as_matrix()


angle = st.floats(-180.0, 180.0)


@given(angle, angle, angle)
def test_roll_pitch_yaw_give_the_rotation_back(roll, pitch, yaw):
    """The angles on the sliders mean the rotation that is shown, also where they are not unique."""
    rotation = from_roll_pitch_yaw(np.array([roll, pitch, yaw]))
    assert from_roll_pitch_yaw(roll_pitch_yaw(rotation)) == pytest.approx(rotation, abs=1e-7)


def test_a_scaled_and_turned_ball_is_the_ellipsoid():
    """Axes and turn put together give the matrix, in the size that it is drawn in."""
    root = np.random.default_rng(0).normal(size=(3, 3))
    semi_axes, turn = shell(root @ root.T)
    rotation = rotation_of_quaternion(turn)
    drawn = rotation @ np.diag(np.square(semi_axes)) @ rotation.T
    assert drawn == pytest.approx(SIZE**2 * root @ root.T)
    assert min(shell(np.diag([1.0, 0.5, 0.0]))[0]) > 0, "a flat ellipsoid can be seen"


CORNERS = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.2, 0.0], [0.0, 0.0, 0.3]])
SIDES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], dtype=np.int32)


class Notes:
    """A page's space that only notes what is put there."""

    def __init__(self):
        self.nodes = {}

    def __getattr__(self, call):
        def add(name, *args, wxyz=(1.0, 0.0, 0.0, 0.0), position=(0.0, 0.0, 0.0), **others):
            assert name not in self.nodes
            node = SimpleNamespace(call=call, args=args, wxyz=wxyz, position=position, visible=True, **others)
            return self.nodes.setdefault(name, node)

        return add


@pytest.fixture
def panda():
    """The shipped robot, which brings its surface."""
    return load_arm("panda")


def frame_of(arm, joints):
    """What a body needs of a frame."""
    return SimpleNamespace(at_limit=(), student_links=arm.link_poses(joints), student_skeleton=arm.skeleton(joints))


def drawn(node, points):
    """Where points of a node are, in the frame of the robot's base."""
    return points @ rotation_of_quaternion(np.asarray(node.wxyz)).T + node.position


def test_each_piece_of_the_surface_moves_with_its_joint(panda):
    """Corners of the meshes are drawn where the pose of their joint puts them, in any posture; joint 0 is the base."""
    surfaces = tuple(Surface(joint, CORNERS, SIDES) for joint in (0, 3, 7))
    scene, first, later = Notes(), *panda.sample(2, 0)
    body = RobotBody(scene, "/robot", surfaces, frame_of(panda, first))
    for joints in (first, later):
        frame = frame_of(panda, joints)
        body.draw(frame)
        for joint in (0, 3, 7):
            pose = frame.student_links[joint]
            at = drawn(scene.nodes[f"/robot/surface/{joint}"], CORNERS)
            assert at == pytest.approx(CORNERS @ pose[:3, :3].T + pose[:3, 3], abs=1e-12)
    assert drawn(scene.nodes["/robot/surface/0"], CORNERS) == pytest.approx(CORNERS)


def test_why_a_robot_is_bare_is_told(panda, monkeypatch):
    """Missing meshes and descriptions without shapes leave a reason, in one line, and no error."""
    found, why = find_surfaces(Arm.from_dh("planar", [[0, 0, 1, 0], [0, 0, 1, 0]]))
    assert (found, why) == ([()], "the description of planar names no shapes")

    def fail(self):
        raise FileFormatError("robot.urdf: a mesh is missing:\n  'hand.dae'")

    monkeypatch.setattr(Arm, "surfaces", fail)
    assert find_surfaces(panda) == ([()], "robot.urdf: a mesh is missing: 'hand.dae'")
