from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from maniport import Arm, load_arm
from maniport.errors import FileFormatError
from maniport.report.page.animation import surfaces_of
from maniport.viewer.scene import SIZE, Skeleton, rod_pose, shell


def test_a_scaled_and_rotated_ball_is_the_ellipsoid():
    root = np.random.default_rng(0).normal(size=(3, 3))
    semi_axes, quaternion = shell(root @ root.T)
    rotation = Rotation.from_quat(quaternion, scalar_first=True).as_matrix()
    drawn = rotation @ np.diag(np.square(semi_axes)) @ rotation.T
    assert drawn == pytest.approx(SIZE**2 * root @ root.T)
    assert min(shell(np.diag([1.0, 0.5, 0.0]))[0]) > 0


def test_missing_surfaces_have_a_reason(monkeypatch):
    planar = Arm.from_dh("planar", [[0, 0, 1, 0], [0, 0, 1, 0]])
    assert surfaces_of([planar], [np.zeros(2)]) == (
        [[]],
        "the description of planar names no shapes",
    )
    panda = load_arm("panda")

    def fail(self):
        raise FileFormatError("robot.urdf: a mesh is missing:\n  'hand.dae'")

    monkeypatch.setattr(Arm, "surfaces", fail)
    assert surfaces_of([panda], [np.zeros(7)]) == (
        [[]],
        "robot.urdf: a mesh is missing: 'hand.dae'",
    )


@pytest.mark.parametrize(
    "end", [(0.0, 0.0, 1.0), (0.0, 0.0, -0.3), (0.2, -0.1, 0.4), (-0.2, 0.1, -0.4), (0.0, 0.0, 0.0)]
)
def test_a_rod_connects_two_points(end):
    start = np.array([0.1, 0.2, 0.3])
    pose = rod_pose(start, start + end)
    half = Rotation.from_quat(pose.wxyz, scalar_first=True).apply([0.0, 0.0, 0.5 * pose.length])
    np.testing.assert_allclose(pose.position - half, start, atol=1e-4)
    np.testing.assert_allclose(pose.position + half, start + end, atol=1e-4)


class RecordingScene:
    """A scene that keeps what is added to it."""

    def __init__(self):
        self.shapes = []

    def add_cylinder(self, name, radius, height, color, **pose):
        self.shapes.append(SimpleNamespace(name=name, height=height, **pose))
        return self.shapes[-1]

    def add_icosphere(self, name, **look):
        self.shapes.append(SimpleNamespace(name=name, **look))
        return self.shapes[-1]


def test_arms_move_by_poses_alone():
    """Browsers show poses at once and new shapes later, so the rods of a moving arm keep their shapes."""
    person = load_arm("rhuman")
    first, second = person.skeleton(person.sample(2, 0))
    scene = RecordingScene()
    skeleton = Skeleton(scene, "arm", first, 0.03, (1, 2, 3))
    heights = [rod.height for rod in skeleton.rods]
    skeleton.draw(second)
    assert [rod.height for rod in skeleton.rods] == heights
    for rod, start, end in zip(skeleton.rods, second[:-1], second[1:], strict=True):
        rotation = Rotation.from_quat(rod.wxyz, scalar_first=True)
        half = rotation.apply([0.0, 0.0, 0.5 * rod.height])
        np.testing.assert_allclose(
            [rod.position - half, rod.position + half], [start, end], atol=2e-4
        )
