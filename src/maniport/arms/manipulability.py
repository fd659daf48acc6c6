"""Velocity and force ellipsoids from Jacobians; arrays in, arrays out.

The velocity ellipsoid ``M = J W² Jᵀ`` holds the end-effector velocities ``ẋ = J q̇`` of all joint velocities with
``|W⁻¹ q̇| ≤ 1``; the force ellipsoid is its inverse ``(J W² Jᵀ)⁻¹`` (Yoshikawa 1985). ``W`` is the diagonal matrix
of the joint weights, the identity by default. With W the joints' velocity limits, M describes what the joints can
really do.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from maniport.errors import InvalidInputError, NotSPDError
from maniport.util.validation import SPD_TOLERANCE, Array, as_choice, as_finite, as_numbers

KINDS = ("velocity", "force")
VELOCITY_LIMITS = "velocity-limits"
ROWS = {"translation": slice(0, 3), "rotation": slice(3, 6), "full": slice(0, 6)}
"""Rows of a Jacobian, linear ones first, by the part of the motion that counts."""

UNITS = {
    ("velocity", "translation"): "m/s per rad/s",
    ("velocity", "rotation"): "rad/s per rad/s",
    ("force", "translation"): "N per N m",
    ("force", "rotation"): "N m per N m",
}


@dataclass(frozen=True)
class EllipsoidSpec:
    """Which ellipsoids of an arm: of velocity or of force, of which part of the motion, with which weights.

    Attributes
    ----------
    kind : {"velocity", "force"}
        M = J W² Jᵀ, or its inverse.
    part : {"translation", "rotation", "full"}
        Which rows of the Jacobian count: d = 3, 3 or 6. ``"full"`` mixes metres and radians.
    joint_weights : None, "velocity-limits" or sequence of float
        Diagonal of W, from 1e-12 to 1e12, one for each joint: the joint velocity that counts as one. Default: all one.
        ``"velocity-limits"``: the arm's own. Numbers are kept as a tuple.

    References
    ----------
    Yoshikawa, Manipulability of robotic mechanisms, IJRR 4, 1985.
    """

    kind: str = "velocity"
    part: str = "translation"
    joint_weights: ArrayLike | None = None

    def __post_init__(self) -> None:
        as_choice(self.kind, "kind", KINDS)
        as_choice(self.part, "part", tuple(ROWS))
        weights = self.joint_weights
        if isinstance(weights, str):
            as_choice(weights, "joint_weights", (VELOCITY_LIMITS,))
        elif weights is not None:
            numbers = as_numbers(weights, "joint_weights", above=0.0)
            as_numbers(numbers, "joint_weights", minimum=1e-12, maximum=1e12)  # squares of their products stay finite
            object.__setattr__(self, "joint_weights", tuple(numbers.tolist()))

    @property
    def size(self) -> int:
        """Number d of rows of an ellipsoid."""
        return 6 if self.part == "full" else 3

    @property
    def unit(self) -> str:
        """Unit of semi-axes for arms with revolute joints; empty where rows mix units."""
        return UNITS.get((self.kind, self.part), "")

    @property
    def rows(self) -> slice:
        """Which rows of a Jacobian count, linear ones first."""
        return ROWS[self.part]

    @property
    def velocity(self) -> "EllipsoidSpec":
        """The same of velocity: the inverses where these are of force."""
        return EllipsoidSpec("velocity", self.part, self.joint_weights)

    def weights(self, dof: int) -> Array:
        """Diagonal of W, shape (dof,); ones where there are no joint weights."""
        if self.joint_weights is None:
            return np.ones(dof)
        return as_numbers(self.joint_weights, "joint_weights", dof, above=0.0)

    def rotation(self, turn: Array) -> Array:
        """Rotations of these ellipsoids, shape (..., d, d), from those of their frame, shape (..., 3, 3)."""
        return np.asarray(np.kron(np.eye(self.size // 3), turn), dtype=np.float64)

    def __str__(self) -> str:
        return f"{self.kind} ellipsoids ({self.part})"


VELOCITY = EllipsoidSpec()  # The default: velocity ellipsoids of the translation


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
