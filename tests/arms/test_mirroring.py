"""Left arms are the mirror images of right arms; lengths of an arm from the body height."""

from dataclasses import replace

import numpy as np
import pytest

from maniport.arms import Arm, load_arm
from maniport.arms.chain import PRISMATIC, Shape
from maniport.arms.restriction import mirrored

S = np.diag([1.0, -1.0, 1.0])
ENDS = ("shoulder", "elbow", "wrist", "hand")


@pytest.mark.parametrize("name", ["myoarm", "rhuman"])
def test_equal_angles_are_mirrored_postures(name):
    """Poses are S T S, ellipsoids of turning and moving S M S, joint axes −S a, at the same joint angles."""
    right, left = load_arm(name), load_arm(name, side="left")
    q = right.sample(64, random_state=0)
    np.testing.assert_array_equal(left.sample(64, random_state=0), q)
    one, other = right.forward(q), left.forward(q)
    np.testing.assert_allclose(other[:, :3, :3], S @ one[:, :3, :3] @ S, atol=1e-14)
    np.testing.assert_allclose(other[:, :3, 3], one[:, :3, 3] @ S, atol=1e-14)
    np.testing.assert_allclose(left.point_positions(q, ENDS), right.point_positions(q, ENDS) @ S, atol=1e-14)
    for part in ("translation", "rotation"):
        np.testing.assert_allclose(
            left.manipulability(q, part=part), S @ right.manipulability(q, part=part) @ S, atol=1e-13
        )
    np.testing.assert_allclose(left.axis_direction(q, "pro_sup"), -right.axis_direction(q, "pro_sup") @ S, atol=1e-14)
    np.testing.assert_allclose(left.skeleton(q), right.skeleton(q) @ S, atol=1e-14)


def test_the_mirror_image_of_the_mirror_image_is_the_arm():
    """Mirroring twice gives the same chain, bit for bit, its name and side included; slides and shapes turn, too."""
    mesh = (np.array([[0.0, 0.1, 0.2], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]), np.array([[0, 1, 2]], np.int32))
    chain = load_arm("rhuman").chain
    slide = replace(chain.joints[2], kind=PRISMATIC)
    chain = replace(chain, joints=(*chain.joints[:2], slide, *chain.joints[3:]), shapes=_shapes_of(mesh))
    left, again = mirrored(chain), mirrored(mirrored(chain))
    assert (chain.name, left.name, again.name) == ("rhuman", "rhuman_left", "rhuman")
    assert (chain.side, left.side, again.side) == ("right", "left", "right")
    for one, other in zip(chain.joints, again.joints, strict=True):
        np.testing.assert_array_equal(one.placement, other.placement)
        np.testing.assert_array_equal(one.axis, other.axis)
    q = chain.lower + 0.3 * (chain.upper - chain.lower)
    np.testing.assert_allclose(Arm(left).forward(q)[:3, 3], S @ Arm(chain).forward(q)[:3, 3], atol=1e-14)
    (of_left,), (of_right,) = Arm(left).surfaces(None), Arm(chain).surfaces(None)
    world = [arm.link_poses(q)[piece.joint] for arm, piece in ((Arm(left), of_left), (Arm(chain), of_right))]
    placed = [pose[:3, :3] @ piece.points.T for pose, piece in zip(world, (of_left, of_right), strict=True)]
    np.testing.assert_allclose(np.sort(placed[0], axis=1), np.sort(S @ placed[1], axis=1), atol=1e-14)
    volume = [np.linalg.det(piece.points[piece.triangles[0]]) for piece in (of_left, of_right)]
    assert volume[0] == pytest.approx(volume[1])  # triangles are counter-clockwise from outside in both


def _shapes_of(mesh):
    return lambda links: [Shape("elbow", mesh)]
