"""Velocity and force ellipsoids from Jacobians; arrays in, arrays out.

The velocity ellipsoid ``M = J W² Jᵀ`` holds the end-effector velocities ``ẋ = J q̇`` of all joint velocities with
``|W⁻¹ q̇| ≤ 1``; the force ellipsoid is its inverse ``(J W² Jᵀ)⁻¹`` (Yoshikawa 1985). ``W`` is the diagonal matrix
of the joint weights, the identity by default. With W the joints' velocity limits, M says what the joints can
really do.
"""

import numpy as np
from numpy.typing import ArrayLike

from maniport.bodies.spec import VELOCITY, EllipsoidSpec
from maniport.errors import InvalidInputError, NotSPDError
from maniport.validation import SPD_TOLERANCE, Array, as_finite


def manipulability(jacobian: ArrayLike, spec: EllipsoidSpec = VELOCITY) -> Array:
    """Manipulability matrices of Jacobians."""
    if spec.kind == "velocity":
        return squared(weighted_rows(jacobian, spec))
    lengths, directions = principal_axes(jacobian, spec)
    return squared(directions * lengths[..., None, :])


def squared(rows: Array) -> Array:
    """X Xᵀ of X (..., d, n), unchecked and exactly symmetric: velocity ellipsoids of weighted rows of Jacobians."""
    product = rows @ rows.swapaxes(-1, -2)
    # BLAS may round A[i, j] and A[j, i] differently; their average is the same number twice.
    return np.asarray(0.5 * (product + product.swapaxes(-1, -2)))


def principal_axes(jacobian: ArrayLike, spec: EllipsoidSpec = VELOCITY) -> tuple[Array, Array]:
    """Semi-axes of the ellipsoids, from the singular values of the weighted Jacobian."""
    rows = weighted_rows(jacobian, spec)
    d, dof = rows.shape[-2:]
    left, singular, _ = np.linalg.svd(rows, full_matrices=dof < d)
    lengths = np.zeros((*singular.shape[:-1], d))
    lengths[..., : singular.shape[-1]] = singular
    if spec.kind == "force":
        _require_full_rank(lengths)
        return 1.0 / lengths, left
    return lengths[..., ::-1].copy(), left[..., ::-1].copy()


def weighted_rows(jacobian: ArrayLike, spec: EllipsoidSpec) -> Array:
    """Select the rows that count and scale the columns by the joint weights, shape (..., d, dof)."""
    array = as_finite(jacobian, "jacobian")
    if array.ndim < 2 or array.shape[-2] != 6 or array.shape[-1] < 1:
        raise InvalidInputError(f"jacobian must have shape (..., 6, dof), linear rows first; found {array.shape}")
    rows = array[..., spec.rows, :]
    return rows if spec.joint_weights is None else np.asarray(rows * spec.weights(array.shape[-1]))


def _require_full_rank(singular: Array) -> None:
    """Raise for singular values, descending, of a Jacobian whose force ellipsoid would be unbounded."""
    # The rule of `as_spd`, applied to the velocity ellipsoid.
    bad = singular[..., -1] ** 2 <= SPD_TOLERANCE * np.sum(singular**2, axis=-1)
    if np.any(bad):
        index = tuple(int(i) for i in np.argwhere(bad)[0])
        place = f"[{', '.join(map(str, index))}]" if index else ""
        count = f" ({int(np.sum(bad))} of {bad.size})" if bad.size > 1 else ""
        raise NotSPDError(
            f"jacobian{place} is singular: its singular values range from {singular[index][-1]:.3g} to "
            f"{singular[index][0]:.3g}{count}, so that the force ellipsoid is unbounded. "
            "Leave such configurations out, choose another part, or use kind='velocity'"
        )
