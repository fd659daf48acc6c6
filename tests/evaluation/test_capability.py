"""Largest forces and speeds against linear programs, and comparisons of motions."""

import numpy as np
import pytest
from scipy.optimize import linprog

from maniport import load_arm
from maniport.arms.directional import ellipsoid_extent, half_sphere, polytope_extent
from maniport.errors import InvalidInputError
from maniport.evaluation.capability import (
    DirectedMotion,
    PersonMotion,
    compare_capability,
    resemblance,
)


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
    jacobian = arm.jacobian(q)[:3]
    gravity = arm.gravity_torques(q)
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
    q = arm.sample(6, random_state=1)
    u = half_sphere(5) * [[1.0, -1.0, 2.0]]
    extents = polytope_extent(arm, q, u, kind)
    expected = [[reference(arm, own, v / np.linalg.norm(v), kind) for v in u] for own in q]
    np.testing.assert_allclose(extents, expected, rtol=1e-6, atol=1e-6)


def test_ellipsoids_lie_in_polytopes_and_resemble_them():
    arm = load_arm("panda")
    u = half_sphere()
    q = arm.sample(50, random_state=0)
    outer = polytope_extent(arm, q, u, "velocity")
    inner = ellipsoid_extent(arm.manipulability(q, joint_weights="joint-limits"), u)
    assert np.all(inner <= outer + 1e-9)
    assert resemblance(inner, outer) > 0.9
    assert resemblance(outer, 7.0 * outer) == pytest.approx(1.0)


def test_missing_limits_and_zero_directions_are_named():
    arm = load_arm("myoarm")
    with pytest.raises(InvalidInputError, match="velocity limits"):
        polytope_extent(arm, arm.sample(1), np.eye(3), "velocity")
    with pytest.raises(InvalidInputError, match="nonzero"):
        polytope_extent(arm, arm.sample(1), np.zeros((1, 3)))


def test_a_motion_is_compared_with_others_along_its_lines():
    robot = load_arm("panda")
    person = load_arm("myoarm")
    phase = np.linspace(0.0, 2.0, 60)
    waves = np.sin(phase[:, None] + np.arange(7))
    q = np.array([0.0, -0.5, 0.0, -2.0, 0.0, 1.6, 0.8]) + 0.2 * waves
    other = q - 0.1
    angles = np.clip(0.4 + 0.1 * waves, person.lower, person.upper)
    u = half_sphere()
    best = u[polytope_extent(person, angles, u).argmax(axis=1)]
    motion = DirectedMotion(q, best, np.eye(3))
    force = compare_capability(
        "force",
        robot,
        phase,
        motion,
        position_only=DirectedMotion(other, best, np.eye(3)),
        person=PersonMotion(person, angles),
    )
    for joints, extents in ((q, force.robot), (other, force.position_only)):
        both = [polytope_extent(robot, joints[:1], [sign * best[0]])[0, 0] for sign in (1.0, -1.0)]
        assert extents[0] == pytest.approx(min(both))
    assert force.person[0] == pytest.approx(polytope_extent(person, angles[:1], best[:1])[0, 0])
    assert force.gain == pytest.approx(np.median(force.robot) / np.median(force.position_only))
    assert force.same_path is None
    assert force.resemblance == pytest.approx(
        resemblance(
            np.minimum(polytope_extent(robot, q, u), polytope_extent(robot, q, -u)),
            polytope_extent(person, angles, u),
        )
    )
    speed = compare_capability("velocity", robot, phase, motion)
    assert (speed.person, speed.position_only) == (None, None)
    assert np.isnan(speed.gain)
