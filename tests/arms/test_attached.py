import numpy as np
import pytest

from maniport import arms


def sliding():
    """An arm whose second joint slides."""
    rows = [[0.1, 0.3, 0.2, 0.5], [0.4, 0.1, 0.3, -1.0], [0.2, 0.0, 0.4, 0.7]]
    return arms.Arm.from_dh("sliding", rows, kinds=["revolute", "prismatic", "revolute"])


@pytest.mark.parametrize("arm", [arms.myoarm(), arms.rhuman(), sliding()], ids=lambda arm: arm.name)
def test_points_agree_with_pinocchio(arm):
    """Positions and derivatives are those that Pinocchio finds of the tips of arms that end there, to 1e-13."""
    q = arm.sample(600, random_state=0)  # more than are worked on together
    values, slopes = arm.point_positions(q, arm.frames), arm.point_jacobians(q, arm.frames)
    for k, name in enumerate(arm.frames):
        if arm.chain.frames[name].joint:
            part = arm.restricted(frame=name)
            own = [arm.joint_names.index(joint) for joint in part.joint_names]
            np.testing.assert_allclose(values[:, k], part.forward(q[:, own])[:, :3, 3], atol=1e-13)
            np.testing.assert_allclose(slopes[:, k][..., own], part.jacobian(q[:, own])[:, :3], atol=1e-13)
