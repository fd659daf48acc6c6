"""The smallest arm: one joint, for which Pinocchio gives vectors where it gives matrices else."""

import pytest

from maniport.bodies import Arm, EllipsoidSpec, load_arm


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
