"""Largest forces and speeds against linear programs, and comparisons of motions."""

import numpy as np
import pytest
from scipy.optimize import linprog

from maniport import load_arm
from maniport.arms.directional import ellipsoid_extent, half_sphere, polytope_extent
from maniport.errors import InvalidInputError
from maniport.evaluation.capability import compare_capabilities, follow_positions, resemblance


def largest(equalities, bounds):
    """Maximize the first variable, from 0 on."""
    program = linprog(
        [-1.0] + [0.0] * len(bounds),
        A_eq=equalities[0],
        b_eq=equalities[1],
        bounds=[(0, None), *bounds],
    )
    return program.x[0] if program.success else 0.0


def reference(arm, q, u, kind):
    jacobian, gravity = arm.jacobian(q)[:3], arm.gravity_torques(q)
    if kind == "force":
        if np.any(np.abs(gravity) > arm.effort_limits):
            return 0.0
        matrix = np.column_stack([jacobian.T @ u, -np.eye(arm.dof)])
        return largest((matrix, -gravity), [(-limit, limit) for limit in arm.effort_limits])
    limits = [(-limit, limit) for limit in arm.velocity_limits]
    return largest((np.column_stack([-u, jacobian]), np.zeros(3)), limits)


@pytest.mark.parametrize("kind", ["force", "velocity"])
@pytest.mark.parametrize("payload", [0.0, 6.0])
def test_extents_are_those_of_linear_programs(kind, payload):
    arm = load_arm("panda").with_payload(payload)
    q, u = arm.sample(6, random_state=1), half_sphere(5) * [[1.0, -1.0, 2.0]]
    extents = polytope_extent(arm, q, u, kind)
    expected = [[reference(arm, own, v / np.linalg.norm(v), kind) for v in u] for own in q]
    np.testing.assert_allclose(extents, expected, rtol=1e-6, atol=1e-6)


def test_ellipsoids_lie_in_polytopes_and_resemble_them():
    arm, u = load_arm("panda"), half_sphere()
    q = arm.sample(50, random_state=0)
    outer = polytope_extent(arm, q, u, "velocity")
    inner = ellipsoid_extent(arm.manipulability(q, joint_weights="joint-limits"), u)
    assert np.all(inner <= outer + 1e-9)
    assert resemblance(inner, outer) > 0.9
    assert resemblance(outer, 7.0 * outer) == pytest.approx(1.0)


def test_missing_limits_and_zero_directions_are_named():
    arm = load_arm("myoarm")
    with pytest.raises(InvalidInputError, match="no velocity limits"):
        polytope_extent(arm, arm.sample(1), np.eye(3), "velocity")
    with pytest.raises(InvalidInputError, match="nonzero"):
        polytope_extent(arm, arm.sample(1), np.zeros((1, 3)))


def test_a_motion_is_compared_with_positions_alone():
    robot, person = load_arm("panda"), load_arm("myoarm")
    home, phase = (
        np.array([0.0, -0.5, 0.0, -2.0, 0.0, 1.6, 0.8]),
        np.linspace(0.0, 2.0, 60)[:, None],
    )
    q = home + 0.2 * np.sin(phase + np.arange(7))
    alone = follow_positions(robot, q[0], robot.forward(q)[:, :3, 3])
    np.testing.assert_allclose(
        robot.forward(alone)[:, :3, 3], robot.forward(q)[:, :3, 3], atol=2e-4
    )
    angles = np.clip(0.4 + 0.1 * np.sin(phase + np.arange(7)), person.lower, person.upper)
    force, speed = compare_capabilities(person, angles, robot, q, phase[:, 0], np.eye(3))
    assert speed.person is None
    assert force.person.shape == force.robot.shape == (60,)
    u = half_sphere()
    best = u[polytope_extent(person, angles[:1], u).argmax()]
    expected = min(polytope_extent(robot, q[:1], [sign * best])[0, 0] for sign in (1.0, -1.0))
    assert force.robot[0] == pytest.approx(expected)
    assert force.robot[0] == pytest.approx(force.position_only[0])
