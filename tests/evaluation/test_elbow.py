"""The angle of the elbow, and the motion that keeps it."""

from unittest import mock

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from maniport.bodies import Arm, load_arm
from maniport.errors import InvalidInputError
from maniport.evaluation.elbow import angle_of, elbow_angle, elbow_frames, turned_by
from maniport.studies import elbow

RNG = np.random.default_rng(0)
POINTS = RNG.standard_normal((50, 3, 3))


@pytest.fixture(scope="module")
def panda():
    """The Panda with its hand."""
    return load_arm("panda")


def test_an_elbow_that_swivels_changes_the_angle_by_as_much():
    """Turned about the line from shoulder to wrist by δ, the elbow is at an angle that is larger by δ."""
    shoulder, elbow_at, wrist = np.moveaxis(POINTS, 1, 0)
    turn = RNG.uniform(-3.0, 3.0, 50)
    along = (wrist - shoulder) / np.linalg.norm(wrist - shoulder, axis=1)[:, None]
    moved = shoulder + Rotation.from_rotvec(turn[:, None] * along).apply(elbow_at - shoulder)
    change = turned_by(angle_of(np.stack([shoulder, moved, wrist], axis=1)), angle_of(POINTS))
    assert_allclose(turned_by(change, turn), 0.0, atol=1e-9)


def test_place_and_size_do_not_matter_and_the_mirror_image_has_the_opposite_angle():
    """Moved and scaled points have the same angle; a left arm in the mirror the negative one."""
    assert_allclose(angle_of(2.5 * POINTS + [1.0, 2.0, 3.0]), angle_of(POINTS), atol=1e-9)
    assert_allclose(angle_of(POINTS * [1.0, -1.0, 1.0]), -angle_of(POINTS), atol=1e-9)


def test_a_left_arm_has_the_opposite_angle():
    """The mirrored model in the same joint positions."""
    right, left = load_arm("myoarm"), load_arm("myoarm", side="left")
    q = right.sample(20, 0)
    assert_allclose(elbow_angle(left, q), -elbow_angle(right, q), atol=1e-9)


def test_arms_are_compared_in_one_frame(panda):
    """In a frame that is turned with the arm, the angle is that of the arm before it was turned."""
    q, turn = panda.sample(20, 0), Rotation.from_rotvec([0.3, -0.8, 0.5]).as_matrix()
    points = panda.point_positions(q, elbow_frames(panda))
    assert_allclose(elbow_angle(panda, q, turn), angle_of(points @ turn), atol=1e-12)
    assert_allclose(angle_of(points), elbow_angle(panda, q), atol=1e-12)


@pytest.mark.parametrize("name", ["panda", "rhuman"])
def test_what_is_called_an_elbow_is_one(name):
    """Its distances from shoulder and wrist are the same in all postures, and the wrist's from the shoulder is not."""
    arm = load_arm(name)
    shoulder, middle, wrist = np.moveaxis(arm.point_positions(arm.sample(50, 0), elbow_frames(arm)), 1, 0)
    assert np.ptp(np.linalg.norm(middle - shoulder, axis=1)) < 1e-9
    assert np.ptp(np.linalg.norm(wrist - middle, axis=1)) < 1e-9
    assert np.ptp(np.linalg.norm(wrist - shoulder, axis=1)) > 0.1


def test_arms_without_an_elbow_are_refused(panda):
    """The message says of which arms an elbow is known; frames may be named; a straight arm has no angle."""
    planar = Arm.from_dh("planar", [[0, 0, 0.4, 0], [0, 0, 0.3, 0], [0, 0, 0.2, 0]])
    with pytest.raises(InvalidInputError, match=r"elbow angle of 'planar' with 3 joints is not defined.*'panda'"):
        elbow_angle(planar, np.zeros(3))
    with pytest.raises(InvalidInputError, match="must be those of shoulder, elbow and wrist"):
        elbow_angle(planar, np.zeros(3), frames=["link1"])
    assert np.isnan(elbow_angle(planar, np.zeros(3), frames=["link1", "link2", "link3"]))
    assert np.isfinite(elbow_angle(planar, [0.0, 0.5, 0.5], frames=["link1", "link2", "link3"]))


def test_slopes_are_those_of_differences(panda):
    """The Jacobian of what is minimised agrees with finite differences."""
    q, before, turn = *panda.sample(2, 3), np.eye(3)
    known = (panda, np.array([0.4, 0.1, 0.5]), 0.7, turn, before)
    steps = 1e-6 * np.eye(7)
    slopes = [(elbow._residual(q + d, *known) - elbow._residual(q - d, *known)) / 2e-6 for d in steps]
    assert_allclose(elbow._jacobian(q, *known), np.transpose(slopes), atol=1e-3)


def test_a_robot_keeps_what_it_did_itself(panda):
    """Asked for the tip path and the elbow of a motion of its own, it has both, within its limits."""
    q = np.linspace([0.2, -0.5, 0.1, -2.0, 0.0, 1.8, 0.0], [0.5, -0.3, 0.3, -1.7, 0.2, 1.6, 0.1], 8)
    path, angles, turn = panda.forward(q)[:, :3, 3], elbow_angle(panda, q), np.eye(3)
    with mock.patch.object(elbow, "STARTS", 2):
        found = elbow.keep_elbow(panda, path, angles, turn)
    assert panda.within_limits(found).all()
    assert_allclose(panda.forward(found)[:, :3, 3], path, atol=1e-4)
    assert_allclose(turned_by(elbow_angle(panda, found), angles), 0.0, atol=2e-3)
