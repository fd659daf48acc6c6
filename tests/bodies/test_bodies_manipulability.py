"""Laws of velocity and force ellipsoids."""

import numpy as np
import pytest

from maniport.bodies import EllipsoidSpec, load_arm
from maniport.bodies.manipulability import manipulability
from maniport.errors import InvalidInputError, NotSPDError

PARTS = {"translation": slice(0, 3), "rotation": slice(3, 6), "full": slice(0, 6)}


@pytest.fixture
def jacobians() -> np.ndarray:
    """Jacobians of the Panda, shape (32, 6, 7)."""
    panda = load_arm("panda")
    return panda.jacobian(panda.sample(32, random_state=0))


@pytest.mark.parametrize("part", PARTS)
def test_velocity_ellipsoid_is_the_product_of_its_rows(jacobians, part):
    """The matrix is J Jᵀ of the rows of its part, and symmetric to the last bit."""
    rows = jacobians[:, PARTS[part]]
    M = manipulability(jacobians, EllipsoidSpec(part=part))
    np.testing.assert_allclose(M, np.einsum("nij,nkj->nik", rows, rows), atol=1e-14)
    np.testing.assert_array_equal(M, M.swapaxes(-1, -2))


@pytest.mark.parametrize("part", PARTS)
def test_force_ellipsoid_is_the_inverse_of_the_velocity_ellipsoid(jacobians, part):
    """Force times velocity is the identity, and the force matrix is symmetric to the last bit."""
    weights = np.linspace(0.5, 2, 7)
    velocity = manipulability(jacobians, EllipsoidSpec("velocity", part, weights))
    force = manipulability(jacobians, EllipsoidSpec("force", part, weights))
    scale = np.linalg.cond(velocity)[:, None, None]
    np.testing.assert_allclose((force @ velocity - np.eye(velocity.shape[-1])) / scale, 0, atol=1e-13)
    np.testing.assert_array_equal(force, force.swapaxes(-1, -2))


def test_singular_force_ellipsoid_is_refused(planar):
    """An unbounded force ellipsoid is an error that names the configuration and the way out."""
    with pytest.raises(NotSPDError, match=r"jacobian\[0\] is singular.*\(2 of 2\).*kind='velocity'"):
        planar.manipulability([[0.3, 0.5], [0.0, 0.0]], kind="force")
    with pytest.raises(NotSPDError, match=r"jacobian\[1\] is singular"):
        manipulability(np.stack([np.eye(6), np.diag([1.0, 0, 1, 1, 1, 1])]), EllipsoidSpec("force"))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"kind": "speed"}, "unknown kind 'speed'"),
        ({"part": "linear"}, "unknown part 'linear'"),
        ({"joint_weights": [1.0, 2.0]}, r"joint_weights must be 7 numbers above 0; found shape \(2,\)"),
        ({"joint_weights": [1, 1, 0, 1, 1, 1, 1]}, "joint_weights must be .* numbers above 0; found 0 at index 2"),
        ({"joint_weights": [[1.0]]}, r"joint_weights must be a sequence of numbers above 0; found shape \(1, 1\)"),
        ({"joint_weights": "limits"}, "unknown joint_weights 'limits'"),
    ],
)
def test_wrong_options_are_named(arguments, message):
    """A wrong option gets an error that says what was found and what is allowed."""
    panda = load_arm("panda")
    with pytest.raises(InvalidInputError, match=message):
        panda.manipulability(panda.sample(2, random_state=0), **arguments)


def test_unknown_velocity_limits_are_named(urdf):
    """Weights by velocity limits need them all: the joints without one are listed."""
    with pytest.raises(InvalidInputError, match=r"'myoarm' has no velocity limits for elv_angle, .*flexion; give"):
        load_arm("myoarm").manipulability(np.zeros(7), joint_weights="velocity-limits")
    with pytest.raises(InvalidInputError, match="'crane' has no velocity limits for turn, spin; give"):
        load_arm(urdf).manipulability(np.zeros(4), joint_weights="velocity-limits")
