import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from maniport import Arm, load_arm
from maniport.errors import FileFormatError
from maniport.report.page.animation import surfaces_of
from maniport.viewer.scene import SIZE, shell


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
