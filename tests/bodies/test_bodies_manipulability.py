"""Laws of velocity and force ellipsoids."""

import numpy as np
import pytest

from maniport import spd
from maniport.bodies import EllipsoidSpec, load_arm
from maniport.bodies.manipulability import manipulability, principal_axes
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


def test_ellipsoids_are_spd_matrices_of_the_space(jacobians):
    """Regular ellipsoids of both kinds pass the checks of the SPD space and are inverse there."""
    velocity, force = manipulability(jacobians), manipulability(jacobians, EllipsoidSpec("force"))
    np.testing.assert_allclose(spd.power(velocity, -1), force, rtol=1e-8)


@pytest.mark.parametrize("kind", ["velocity", "force"])
@pytest.mark.parametrize("part", PARTS)
def test_principal_axes_agree_with_eigenvalues(jacobians, kind, part):
    """Where the matrix is well conditioned, the axes are its eigenvectors and root eigenvalues, ascending."""
    spec = EllipsoidSpec(kind, part)
    lengths, directions = principal_axes(jacobians, spec)
    M = manipulability(jacobians, spec)
    values = np.linalg.eigvalsh(M)
    np.testing.assert_allclose(lengths**2, values, atol=1e-10 * values.max(), rtol=1e-6)
    rebuilt = np.einsum("nij,nj,nkj->nik", directions, lengths**2, directions)
    np.testing.assert_allclose(rebuilt, M, atol=1e-12 * np.abs(M).max())
    assert np.all(np.diff(lengths, axis=-1) >= 0)


def test_principal_axes_keep_relative_accuracy():
    """With lengths from 1 to 1e-7 the singular values are right to 1e-7 where eigenvalues of J Jᵀ are not."""
    rng = np.random.default_rng(0)
    truth = np.array([1e-7, 1e-3, 1.0])
    left, right = (np.linalg.qr(rng.standard_normal((n, n)))[0] for n in (3, 7))
    jacobian = np.zeros((6, 7))
    jacobian[:3] = left @ np.diag(truth) @ right[:3]
    lengths, directions = principal_axes(jacobian)
    from_matrix = np.linalg.eigvalsh(manipulability(jacobian))
    assert np.max(np.abs(lengths / truth - 1)) < 1e-7
    assert np.max(np.abs(from_matrix / truth**2 - 1)) > 1e-5
    np.testing.assert_allclose(np.abs(np.sum(directions * left, axis=0)), 1, atol=1e-9)


def test_joint_weights_scale_the_columns(jacobians):
    """Weighted ellipsoids are J diag(w²) Jᵀ; doubling all weights doubles every length."""
    weights = np.linspace(0.5, 2, 7)
    expected = jacobians[:, :3] @ np.diag(weights**2) @ jacobians[:, :3].swapaxes(-1, -2)
    once, twice = (EllipsoidSpec(joint_weights=factor * weights) for factor in (1, 2))
    np.testing.assert_allclose(manipulability(jacobians, once), expected, atol=1e-13)
    np.testing.assert_allclose(principal_axes(jacobians, twice)[0], 2 * principal_axes(jacobians, once)[0])


def test_velocity_limits_are_the_weights_they_name():
    """The words 'velocity-limits' stand for the numbers the arm knows."""
    panda = load_arm("panda")
    q = panda.sample(4, random_state=0)
    by_word = panda.manipulability(q, joint_weights="velocity-limits")
    np.testing.assert_array_equal(by_word, panda.manipulability(q, joint_weights=panda.velocity_limits))
    assert not np.allclose(by_word, panda.manipulability(q))


def test_arm_passes_its_options_on(jacobians):
    """The methods of an arm give what the functions give for its Jacobians."""
    panda = load_arm("panda")
    q, options = (
        panda.sample(32, random_state=0),
        {"kind": "force", "part": "rotation", "joint_weights": np.arange(1, 8)},
    )
    spec = EllipsoidSpec(**options)
    np.testing.assert_array_equal(panda.manipulability(q, **options), manipulability(jacobians, spec))
    np.testing.assert_array_equal(panda.ellipsoids(q, spec), manipulability(jacobians, spec))
    for ours, theirs in zip(panda.principal_axes(q, spec), principal_axes(jacobians, spec), strict=True):
        np.testing.assert_array_equal(ours, theirs)


def test_singular_velocity_ellipsoid_passes_unchanged(planar):
    """A stretched planar arm has a flat ellipsoid of rank one; nothing is added to it."""
    M = planar.manipulability([0.0, 0.0])
    np.testing.assert_allclose(M, np.diag([0.0, 5.0, 0.0]), atol=1e-15)
    lengths, directions = planar.principal_axes([0.0, 0.0])
    np.testing.assert_allclose(lengths, [0, 0, np.sqrt(5)], atol=1e-15)
    np.testing.assert_allclose(directions @ directions.T, np.eye(3), atol=1e-15)


def test_fewer_joints_than_dimensions_give_zero_lengths(planar):
    """Two joints cannot span the six dimensions of the full ellipsoid: four lengths are zero."""
    q = planar.sample(8, random_state=0)
    lengths, directions = planar.principal_axes(q, EllipsoidSpec(part="full"))
    assert lengths.shape == (8, 6)
    assert directions.shape == (8, 6, 6)
    np.testing.assert_array_equal(lengths[:, :4], 0)
    assert np.all(lengths[:, 4:] > 0)


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


def test_jacobian_of_a_wrong_shape_is_refused():
    """A Jacobian has six rows."""
    with pytest.raises(InvalidInputError, match=r"jacobian must have shape \(\.\.\., 6, dof\).*found \(3, 7\)"):
        manipulability(np.zeros((3, 7)))
