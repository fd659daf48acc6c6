"""How the robot looks: its surface moves with its joints, and a skeleton stands in for it."""

from types import SimpleNamespace

import numpy as np
import pytest

from maniport import Arm, load_arm
from maniport.bodies import Surface
from maniport.errors import FileFormatError
from maniport.view.bodies import RobotBody, find_surfaces, rotation_of

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


def picture_of(arm, joints):
    """What a body needs of a picture."""
    return SimpleNamespace(student_links=arm.link_poses(joints), student_skeleton=arm.skeleton(joints))


def drawn(node, points):
    """Where points of a node are, in the frame of the robot's base."""
    return points @ rotation_of(np.asarray(node.wxyz)).T + node.position


def test_each_piece_of_the_surface_moves_with_its_joint(panda):
    """Corners of the meshes are drawn where the pose of their joint puts them, in any posture; joint 0 is the base."""
    surfaces = tuple(Surface(joint, CORNERS, SIDES) for joint in (0, 3, 7))
    scene, first, later = Notes(), *panda.sample(2, 0)
    body = RobotBody(scene, "/robot", surfaces, picture_of(panda, first))
    for joints in (first, later):
        picture = picture_of(panda, joints)
        body.draw(picture, covered=True)
        for joint in (0, 3, 7):
            pose = picture.student_links[joint]
            at = drawn(scene.nodes[f"/robot/surface/{joint}"], CORNERS)
            assert at == pytest.approx(CORNERS @ pose[:3, :3].T + pose[:3, 3], abs=1e-12)
    assert drawn(scene.nodes["/robot/surface/0"], CORNERS) == pytest.approx(CORNERS)


def test_the_shipped_robot_has_its_surface(panda):
    """Every mesh of the Panda is on the page, as it is, and its pieces fit together along the skeleton."""
    (surfaces,), bare = find_surfaces(panda)
    scene, joints = Notes(), panda.sample(1, 3)[0]
    RobotBody(scene, "/robot", surfaces, picture_of(panda, joints))
    assert bare == ""
    assert len(surfaces) > 5
    cloud = [drawn(scene.nodes[f"/robot/surface/{surface.joint}"], surface.points) for surface in surfaces]
    for corner in panda.skeleton(joints)[:-1]:
        assert min(np.linalg.norm(points - corner, axis=1).min() for points in cloud) < 0.15


def test_either_the_surface_is_seen_or_the_skeleton(panda):
    """The wish decides; without a surface it is the skeleton in any case, and what is unseen is left where it is."""
    picture, other = (picture_of(panda, joints) for joints in panda.sample(2, 1))
    for surfaces in ((Surface(5, CORNERS, SIDES),), ()):
        scene = Notes()
        body = RobotBody(scene, "/robot", surfaces, picture)
        for covered in (True, False, True):
            body.draw(other if covered else picture, covered)
            shown = covered and bool(surfaces)
            assert scene.nodes["/robot/surface"].visible is shown
            assert scene.nodes["/robot/skeleton"].visible is not shown
        at = scene.nodes["/robot/skeleton/hand"].position
        assert np.allclose(at, (picture if surfaces else other).student_skeleton[-1])


def test_why_a_robot_is_bare_is_told(panda, monkeypatch):
    """Missing meshes and descriptions without shapes leave a reason, in one line, and no error."""
    found, why = find_surfaces(Arm.from_dh("planar", [[0, 0, 1, 0], [0, 0, 1, 0]]))
    assert (found, why) == ([()], "the description of planar names no shapes")

    def fail(self):
        raise FileFormatError("robot.urdf: a mesh is missing:\n  'hand.dae'")

    monkeypatch.setattr(Arm, "surfaces", fail)
    assert find_surfaces(panda) == ([()], "robot.urdf: a mesh is missing: 'hand.dae'")
