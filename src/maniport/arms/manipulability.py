"""Velocity and force ellipsoids from Jacobians; arrays in, arrays out.

The velocity ellipsoid ``M = J W² Jᵀ`` holds the end-effector velocities ``ẋ = J q̇`` of all joint velocities with
``|W⁻¹ q̇| ≤ 1``; the force ellipsoid is its inverse ``(J W² Jᵀ)⁻¹`` (Yoshikawa 1985). ``W`` is the diagonal matrix
of the joint weights, the identity by default. With W the joints' velocity limits, M describes what the joints can
really do.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce

import numpy as np
from numpy.typing import ArrayLike

from maniport.errors import InvalidInputError, NotSPDError
from maniport.util.validation import SPD_TOLERANCE, Array, as_choice, as_finite, as_numbers

ROWS = {"translation": slice(0, 3), "rotation": slice(3, 6), "full": slice(0, 6)}
"""Rows of a Jacobian, linear ones first, by the part of the motion that counts."""


@dataclass(frozen=True)
class EllipsoidSpec:
    """Which ellipsoids of an arm: of velocity or of force, of which part of the motion, with which weights.

    Attributes
    ----------
    kind : {"velocity", "force"}
        M = J W² Jᵀ, or its inverse.
    part : {"translation", "rotation", "full"}
        Which rows of the Jacobian count: d = 3, 3 or 6. ``"full"`` mixes meters and radians.
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
        as_choice(self.kind, "kind", ("velocity", "force"))
        as_choice(self.part, "part", tuple(ROWS))
        weights = self.joint_weights
        if isinstance(weights, str):
            as_choice(weights, "joint_weights", ("velocity-limits",))
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
        rows = {"velocity": ("m/s per rad/s", "rad/s per rad/s"), "force": ("N per N m", "N m per N m")}[self.kind]
        return {"translation": rows[0], "rotation": rows[1]}.get(self.part, "")

    @property
    def rows(self) -> slice:
        """Rows of a Jacobian that count, linear ones first."""
        return ROWS[self.part]

    @property
    def velocity(self) -> "EllipsoidSpec":
        """The specification with velocity ellipsoids, which are the inverses of those of force."""
        return EllipsoidSpec("velocity", self.part, self.joint_weights)

    def weights(self, dof: int) -> Array:
        """Return the diagonal of W, shape (dof,); ones without joint weights."""
        if self.joint_weights is None:
            return np.ones(dof)
        return as_numbers(self.joint_weights, "joint_weights", dof, above=0.0)

    def rotation(self, turn: Array) -> Array:
        """Return rotations of these ellipsoids, shape (..., d, d), from those of their frame, shape (..., 3, 3)."""
        return np.asarray(np.kron(np.eye(self.size // 3), turn), dtype=np.float64)

    def __str__(self) -> str:
        return f"{self.kind} ellipsoids ({self.part})"


VELOCITY = EllipsoidSpec()  # The default: velocity ellipsoids of the translation


def manipulability(jacobian: ArrayLike, spec: EllipsoidSpec = VELOCITY) -> Array:
    """Compute the manipulability matrices (..., d, d) of Jacobians (..., 6, dof)."""
    if spec.kind == "velocity":
        return squared(weighted_rows(jacobian, spec))
    lengths, directions = principal_axes(jacobian, spec)
    return squared(directions * lengths[..., None, :])


def squared(rows: Array) -> Array:
    """Compute X Xᵀ of X (..., d, n), exactly symmetric: velocity ellipsoids of weighted rows of Jacobians."""
    product = rows @ rows.swapaxes(-1, -2)
    # BLAS may round A[i, j] and A[j, i] differently; their average is the same number twice.
    return np.asarray(0.5 * (product + product.swapaxes(-1, -2)))


def principal_axes(jacobian: ArrayLike, spec: EllipsoidSpec = VELOCITY) -> tuple[Array, Array]:
    """Compute the semi-axes of the ellipsoids from the singular values of the weighted Jacobian.

    An error for the force ellipsoid of a singular Jacobian, which is unbounded.
    """
    rows = weighted_rows(jacobian, spec)
    d, dof = rows.shape[-2:]
    left, singular, _ = np.linalg.svd(rows, full_matrices=dof < d)
    lengths = np.zeros((*singular.shape[:-1], d))
    lengths[..., : singular.shape[-1]] = singular
    if spec.kind == "velocity":
        return lengths[..., ::-1].copy(), left[..., ::-1].copy()
    bad = lengths[..., -1] ** 2 <= SPD_TOLERANCE * np.sum(lengths**2, axis=-1)  # the rule of `as_spd`
    if np.any(bad):
        index = tuple(np.argwhere(bad)[0].tolist())
        place = f"[{', '.join(map(str, index))}]" if index else ""
        count = f" ({int(np.sum(bad))} of {bad.size})" if bad.size > 1 else ""
        raise NotSPDError(
            f"jacobian{place} is singular: its singular values range from {lengths[index][-1]:.3g} to "
            f"{lengths[index][0]:.3g}{count}, so that the force ellipsoid is unbounded. "
            "Leave such configurations out, choose another part, or use kind='velocity'"
        )
    return 1.0 / lengths, left


def weighted_rows(jacobian: ArrayLike, spec: EllipsoidSpec) -> Array:
    """Select the rows that count and scale the columns by the joint weights, shape (..., d, dof)."""
    array = as_finite(jacobian, "jacobian")
    if array.ndim < 2 or array.shape[-2] != 6 or array.shape[-1] < 1:
        raise InvalidInputError(f"jacobian must have shape (..., 6, dof), linear rows first; found {array.shape}")
    rows = array[..., spec.rows, :]
    return rows if spec.joint_weights is None else np.asarray(rows * spec.weights(array.shape[-1]))


def with_derivatives(
    jacobian: Array, chains: Sequence[tuple[float, Array, Array]], spec: EllipsoidSpec = VELOCITY
) -> tuple[Array, Array]:
    """Return manipulability matrices (n, d, d) and their derivatives (n, dof, d, d) in the degrees of freedom.

    The Jacobian, shape (n, 6, dof), is a sum over chains: their factors, Jacobians in their joints, and couplings.
    """
    from maniport.arms.kernels import fill_derivatives  # here: Numba takes its time

    dof = jacobian.shape[2]
    rows = np.ascontiguousarray(weighted_rows(jacobian, spec))
    weights = 1.0 if spec.joint_weights is None else spec.weights(dof)
    ellipsoids, changes = np.empty((len(rows), rows.shape[1], rows.shape[1])), []
    for factor, of_joints, coupling in chains:
        change = np.empty((len(rows), dof, rows.shape[1], rows.shape[1]))
        # Numba compiles once more for arrays that are not contiguous
        arrays = np.ascontiguousarray(of_joints), rows, np.ascontiguousarray(coupling), coupling * weights
        fill_derivatives(*arrays, spec.part != "rotation", ellipsoids, change)
        changes.append(change if factor == 1.0 else np.multiply(factor, change, out=change))
    results = reduce(np.add, changes)
    if spec.kind == "velocity":
        return ellipsoids, results
    force = manipulability(jacobian, spec)
    change = -force[:, None] @ results @ force[:, None]  # of an inverse
    return force, np.asarray(0.5 * (change + np.swapaxes(change, -1, -2)))
