"""Ellipsoids of velocity and force from Jacobians; arrays in, arrays out.

With the end-effector Jacobian J, joint velocities q̇, velocity limits V and torques T that remain for force, the
ellipsoids

    velocity        M = J V² Jᵀ             ẋ = J q̇ with |V⁻¹ q̇| ≤ 1
    force           M = (J T⁻² Jᵀ)⁻¹        f with |T⁻¹ Jᵀ f| ≤ 1

hold velocities and forces of the end effector (Yoshikawa 1985); V = I and T = I by default.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from maniport.arms.kinematics import GravityTerms, Kinematics
from maniport.errors import NotSPDError
from maniport.util.validation import SPD_TOLERANCE, Array, as_choice, as_numbers

ROWS = {"translation": slice(0, 3), "rotation": slice(3, 6), "full": slice(0, 6)}
"""Rows of a Jacobian, linear ones first, by the part of the motion that counts."""

KINDS = ("velocity", "force")
LOAD = "load"  # J T⁻² Jᵀ, the inverse of the force ellipsoid, which is finite at singular configurations
UNITS = {
    "velocity": ("m/s", "rad/s", " per rad/s"),
    "force": ("N", "N m", " per N m"),
    LOAD: ("1/N", "1/(N m)", ""),
}
"""Units of semi-axes by kind: of translation, of rotation, and what follows without joint weights."""

JOINT_LIMITS = "joint-limits"  # joint weights: the limits of the arm

LEAST_TORQUE = (
    0.05  # smallest share of an effort limit that gravity leaves, so that ellipsoids stay defined
)

LEAST_EIGENVALUE = 1e-7
"""Smallest eigenvalue of the inverse of a force ellipsoid, relative to its trace: far below the usual damping (0.3 %),
and large enough that inverses of the force ellipsoid are symmetric to 1e-8."""


@dataclass(frozen=True)
class EllipsoidSpec:
    """Kind, part and joint weights of an arm's ellipsoids.

    Attributes
    ----------
    kind : {"velocity", "force"}
        M = J V² Jᵀ or (J T⁻² Jᵀ)⁻¹.
    part : {"translation", "rotation", "full"}
        Which rows of the Jacobian count: d = 3, 3 or 6. ``"full"`` mixes meters and radians.
    joint_weights : None, "joint-limits" or sequence of float
        Diagonal of V or T, from 1e-12 to 1e12, one for each joint: the velocity [rad/s, m/s] or torque [N m, N] that
        counts as one. Default: all one. ``"joint-limits"``: velocity limits, or effort limits less the gravity torques
        ``|g(q)|`` where the arm has masses, but at least 5 % of the limit so that ellipsoids stay defined where the arm
        cannot hold itself. Each arm has its own. Numbers are kept as a tuple.

    References
    ----------
    Yoshikawa, Manipulability of robotic mechanisms, IJRR 4, 1985.
    """

    kind: str = "velocity"
    part: str = "translation"
    joint_weights: ArrayLike | None = None

    def __post_init__(self) -> None:
        if self.kind != LOAD:
            as_choice(self.kind, "kind", KINDS)
        as_choice(self.part, "part", tuple(ROWS))
        weights = self.joint_weights
        if isinstance(weights, str):
            as_choice(weights, "joint_weights", (JOINT_LIMITS,))
        elif weights is not None:
            numbers = as_numbers(weights, "joint_weights", above=0.0)
            as_numbers(
                numbers, "joint_weights", minimum=1e-12, maximum=1e12
            )  # squares of their products stay finite
            object.__setattr__(self, "joint_weights", tuple(numbers.tolist()))

    @property
    def size(self) -> int:
        """Number d of rows of an ellipsoid."""
        if self.part == "full":
            return 6
        return 3

    @property
    def unit(self) -> str:
        """Unit of semi-axes for arms with revolute joints; empty where rows mix units."""
        linear, angular, per_joint = UNITS[self.kind]
        unit = {"translation": linear, "rotation": angular}.get(self.part, "")
        if unit and self.joint_weights is None:
            return f"{unit}{per_joint}"
        return unit

    @property
    def rows(self) -> slice:
        """Rows of a Jacobian that count, linear ones first."""
        return ROWS[self.part]

    @property
    def bounded(self) -> "EllipsoidSpec":
        """The ellipsoids for plans, bounded at singular configurations: the inverse of force ellipsoids, or these."""
        if self.kind != "force":
            return self
        return EllipsoidSpec(
            "velocity" if self.joint_weights is None else LOAD, self.part, self.joint_weights
        )

    def of_bounded(self, ellipsoids: Array) -> Array:
        """Return ellipsoids (n, d, d) of this kind from those that `bounded` describes.

        Force ellipsoids are the inverses. They grow without bound toward singular configurations, so that eigenvalues
        of an inverse count as at least `LEAST_EIGENVALUE` of its trace.
        """
        if self.kind != "force":
            return ellipsoids
        values, vectors = np.linalg.eigh(ellipsoids)
        least = LEAST_EIGENVALUE * values.sum(axis=-1, keepdims=True)
        inverse = 1.0 / np.maximum(values, least)
        return _squared(vectors * np.sqrt(inverse)[..., None, :])

    def rotation(self, turn: Array) -> Array:
        """Return rotations of these ellipsoids, shape (..., d, d), from those of their frame, shape (..., 3, 3)."""
        return np.asarray(np.kron(np.eye(self.size // 3), turn), dtype=np.float64)

    def __str__(self) -> str:
        return f"{self.kind} ellipsoids ({self.part})"


VELOCITY = EllipsoidSpec()  # The default: velocity ellipsoids of the translation


class RemainingTorques(NamedTuple):
    """Torques that gravity leaves for force at n configurations."""

    torques: Array  # T, (n, dof) [N m] or [N]
    changes: Array  # ∂T_j/∂q_k, (n, dof, dof); zero without derivatives of gravity


def remaining_torques(limits: Array, gravity: GravityTerms) -> RemainingTorques:
    """Return limits (dof,) less gravity torques, at least `LEAST_TORQUE` of the limits."""
    held = limits - np.abs(gravity.torques)
    torques = np.maximum(held, LEAST_TORQUE * limits)
    if not len(gravity.changes):
        return RemainingTorques(torques, np.zeros((*torques.shape, len(limits))))
    changes = -np.sign(gravity.torques)[..., None] * gravity.changes
    changes[torques > held] = 0.0
    return RemainingTorques(torques, changes)


def weighting(
    spec: EllipsoidSpec,
    kinematics: Kinematics,
    limits: Array | None,
    q: Array,
    changes: bool = False,
) -> tuple[Array | None, Array | None]:
    """Weights W of ellipsoids M = J W² Jᵀ (of force: M⁻¹) at configurations (n, dof), and ∂W²/∂q_k.

    W, diagonals (n or 1, 1, dof), is None for the identity. Derivatives, diagonals (n, k, 1, dof), are None without
    `changes` and where W is constant. `limits` (dof,) are those of the joints where these are the weights.
    """
    if spec.joint_weights is None:
        return None, None
    weights = spec.joint_weights if limits is None else limits
    scale = np.asarray(weights, dtype=np.float64)
    if spec.kind == "velocity":
        return scale[None, None], None
    if limits is None or not kinematics.has_weight:
        return 1.0 / scale[None, None], None
    remaining = remaining_torques(limits, kinematics.gravity(q, changes))
    weight = 1.0 / remaining.torques[:, None]
    if not changes:
        return weight, None
    slopes = -2.0 * remaining.changes / remaining.torques[..., None] ** 3
    return weight, np.swapaxes(slopes, 1, 2)[:, :, None]


def manipulability(rows: Array, kind: str = "velocity") -> Array:
    """Compute the manipulability matrices (..., d, d) of weighted rows J W of Jacobians, shape (..., d, dof).

    An error for the force ellipsoid of a singular Jacobian, which is unbounded.
    """
    if kind != "force":
        return _squared(rows)
    d, dof = rows.shape[-2:]
    directions, singular, _ = np.linalg.svd(rows, full_matrices=dof < d)
    lengths = np.zeros((*singular.shape[:-1], d))
    lengths[..., : singular.shape[-1]] = singular
    bad = lengths[..., -1] ** 2 <= SPD_TOLERANCE * np.sum(
        lengths**2, axis=-1
    )  # the rule of `as_spd`
    if np.any(bad):
        index = tuple(np.argwhere(bad)[0].tolist())
        if index:
            place = f"[{', '.join(map(str, index))}]"
        else:
            place = ""
        if bad.size > 1:
            count = f" ({int(np.sum(bad))} of {bad.size})"
        else:
            count = ""
        raise NotSPDError(
            f"jacobian{place} is singular: its singular values range from {lengths[index][-1]:.3g} to "
            f"{lengths[index][0]:.3g}{count}, so that the force ellipsoid is unbounded. "
            "Leave such configurations out, choose another part, or use kind='velocity'"
        )
    return _squared(directions * (1.0 / lengths)[..., None, :])


def _squared(rows: Array) -> Array:
    """Compute X Xᵀ of X (..., d, n), exactly symmetric."""
    product = rows @ rows.swapaxes(-1, -2)
    # BLAS may round A[i, j] and A[j, i] differently; their average is the same number twice.
    return np.asarray(0.5 * (product + product.swapaxes(-1, -2)))


def with_derivatives(
    jacobian: Array,
    of_joints: Array,
    coupling: Array,
    spec: EllipsoidSpec,
    weight: Array | None,
    change: Array | None,
) -> tuple[Array, Array]:
    """Return manipulability matrices (n, d, d) and their derivatives (n, dof, d, d) in the degrees of freedom.

    Jacobians (n, 6, dof) are those in the joints, (n, 6, joints), times the coupling; weights are those of `weighting`.
    """
    from maniport.arms.kernels import fill_derivatives  # here: Numba takes its time

    plain = jacobian[..., spec.rows, :]
    rows = weighted = plain
    if weight is not None:
        rows = plain * weight
        weighted = rows * weight
    n, d, dof = rows.shape
    ellipsoids = np.empty((n, d, d))
    results = np.empty((n, dof, d, d))
    # Numba compiles once more for arrays that are not contiguous
    arrays = (np.ascontiguousarray(array) for array in (of_joints, rows, coupling, weighted))
    fill_derivatives(*arrays, spec.part != "rotation", ellipsoids, results)
    if change is not None:
        moved = (plain[:, None] * change).reshape(n, -1, dof) @ np.swapaxes(plain, -1, -2)
        results += moved.reshape(results.shape)
    if spec.kind != "force":
        return ellipsoids, results
    force = manipulability(rows, spec.kind)
    inverse = -force[:, None] @ results @ force[:, None]
    return force, np.asarray(0.5 * (inverse + np.swapaxes(inverse, -1, -2)))
