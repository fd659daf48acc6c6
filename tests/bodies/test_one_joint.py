"""The smallest arm: one joint, for which Pinocchio gives vectors where it gives matrices else."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from maniport import sample_domain
from maniport.bodies import Arm, EllipsoidSpec, load_arm
from maniport.errors import NotSPDError
from maniport.tracking import StartBank


@pytest.fixture(params=["hinge_urdf", "hinge_mjcf", "dh"])
def hinge(request: pytest.FixtureRequest) -> Arm:
    """One arm with one joint, by each way there is to make it."""
    if request.param == "dh":
        return Arm.from_dh("hinge", [[0, 0.1, 0.4, 0]], -1, 1.5)
    return load_arm(request.getfixturevalue(request.param), frame="tip")


def test_every_array_of_an_arm_with_one_joint_has_its_shape(hinge):
    """Whatever takes configurations answers in the shape that it has for other arms."""
    q = hinge.sample(6, random_state=0).reshape(2, 3, 1)
    assert hinge.dof == 1
    assert hinge.forward(q).shape == (2, 3, 4, 4)
    assert hinge.jacobian(q).shape == (2, 3, 6, 1)
    assert hinge.point_jacobians(q, [hinge.frame]).shape == (2, 3, 1, 3, 1)
    assert hinge.axis_direction(q, hinge.joint_names[0]).shape == (2, 3, 3)
    assert hinge.skeleton(q).shape[:2] == hinge.link_poses(q).shape[:2] == (2, 3)
    assert hinge.surfaces() == () or hinge.surfaces()[0].joint in (0, 1)
    for part, d in (("translation", 3), ("rotation", 3), ("full", 6)):
        spec = EllipsoidSpec(part=part)
        jacobian, ellipsoids, changes = hinge.differentials(q, spec)
        assert (jacobian.shape, ellipsoids.shape, changes.shape) == ((2, 3, 6, 1), (2, 3, d, d), (2, 3, 1, d, d))
        assert hinge.principal_axes(q, spec)[0].shape == (2, 3, d)


def test_ellipsoids_of_one_joint_are_its_velocity(hinge):
    """They have one axis: along the way of the tip, as long as its distance from the axis of rotation."""
    for column, ellipsoid in zip(hinge.jacobian(hinge.sample(4, 1)), sample_domain(hinge, 4, 1), strict=True):
        assert_allclose(ellipsoid, column[:3] @ column[:3].T, atol=1e-15)
        assert np.linalg.norm(column[:3]) > 0.3
    with pytest.raises(NotSPDError, match="singular"):
        hinge.manipulability([0.2], kind="force")


def test_derivative_of_one_joint_is_that_of_finite_differences(hinge):
    """The change of the ellipsoid with the one joint agrees with central differences."""
    q, step = hinge.sample(5, random_state=2), 1e-6
    expected = (hinge.manipulability(q + step) - hinge.manipulability(q - step)) / (2 * step)
    assert_allclose(hinge.manipulability_jacobian(q)[:, 0], expected, atol=1e-8)


def test_start_bank_finds_the_posture_of_one_joint(hinge):
    """The nearest of its samples has nearly the angle that made the ellipsoid."""
    found = StartBank.build(hinge, 512).query(hinge.manipulability([[0.3]]), k=1)
    assert found.shape == (1, 1, 1)
    assert abs(found[0, 0, 0] - 0.3) < 0.02
