"""Largest forces and speeds of an end effector along directions, within the limits of all joints.

Limits of single joints bound a polytope. With the linear Jacobian J, unit directions u, torque limits T, velocity
limits V and gravity torques g, its extent along u is

    force       max f with −T ≤ g + Jᵀ u f ≤ T, a minimum over the joints,
    velocity    max v with J q̇ = v u, |q̇| ≤ V

(Chiu, IJRR 7, 1988; Skuric, Padois and Daney, ICRA 2021). The second is the extent of a zonotope with the columns c_i
of J V as generators: by duality the minimum of Σ_i |wᵀ c_i| / |wᵀ u| over the normals w = c_i × c_j of its faces.

Along a line, the smaller extent of both senses counts. It is 1 / max_m |G_mᵀ u| with one column of G(q) for each facet:

    force       G_j = J_j / T_j with T_j = max(T − |g_j|, 0.05 T),
    velocity    G_f = w / (Σ_i |wᵀ c_i| + ε |w|₁ + ε³), w = c_i × c_j

ε is the half width of a cube of velocities that is added to the zonotope, which is flat at singular configurations; ε³
lets facets without area vanish. With a sum of p-th powers in place of the maximum, the extent has derivatives
everywhere, and is at most m^(1/p) times smaller, m the number of facets; for forces and p = 2 it is that of the force
ellipsoid.
"""

from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from maniport.arms.arm import Arm
from maniport.arms.manipulability import JOINT_LIMITS, EllipsoidSpec
from maniport.errors import InvalidInputError
from maniport.util.validation import Array, as_choice, as_finite, as_points

EXTENT_KINDS = ("force", "velocity")
POWER = 8  # p; for three robots log extents are by 0.00 (force) and 0.13 (velocity) too small, in the median
FLAT = 1e-3  # ε [m/s]


def is_limited(arm: Arm, kind: str) -> bool:
    """Whether an arm has the limits of all joints that extents of a kind need."""
    if kind == "velocity":
        limits = arm.velocity_limits
    else:
        limits = arm.effort_limits
    return limits is not None and bool(np.all(np.isfinite(limits) & (limits > 0.0)))


def polytope_extent(arm: Arm, q: ArrayLike, directions: ArrayLike, kind: str = "force") -> Array:
    """Compute the largest force [N], with gravity, or speed [m/s] along directions.

    Parameters
    ----------
    arm : Arm
        With effort limits for forces, velocity limits for speeds; gravity counts where it has masses.
    q : array_like, shape (n, dof)
    directions : array_like, shape (m, 3) or (n, m, 3)
        In the base frame, of any length above 0; the same for all configurations, or m for each.
    kind : {"force", "velocity"}

    Returns
    -------
    ndarray, shape (n, m)
        Force on the environment: zero where the arm cannot hold itself, infinite where no joint bears it.

    Raises
    ------
    InvalidInputError
        When limits of a joint are missing.
    """
    as_choice(kind, "kind", EXTENT_KINDS)
    arm.checked_spec(EllipsoidSpec(kind, joint_weights=JOINT_LIMITS))
    if kind == "velocity":
        limits = arm.velocity_limits
    else:
        limits = arm.effort_limits
    assert limits is not None
    configurations = np.atleast_2d(arm.configurations(q))
    u = _unit_vectors(directions, len(configurations))
    jacobian = arm.jacobian(configurations)[:, :3]
    if kind == "velocity":
        return _zonotope_extent(jacobian * limits, u)
    gravity = np.zeros_like(configurations)
    if arm.chain.inertia is not None:
        gravity = arm.gravity_torques(configurations)
    gravity = gravity[:, None]
    torques = u @ jacobian  # of 1 N, (n, m, dof)
    with np.errstate(divide="ignore", invalid="ignore"):
        extents = (limits - np.sign(torques) * gravity) / np.abs(torques)
    extents = np.where(torques == 0.0, np.inf, extents).min(axis=-1)
    return np.asarray(np.where(np.any(np.abs(gravity) > limits, axis=-1), 0.0, extents))


def line_extent(arm: Arm, q: ArrayLike, directions: ArrayLike, kind: str = "force") -> Array:
    """Compute the smaller of the two extents along ±directions.

    Parameters
    ----------
    arm, q, directions, kind
        As in `polytope_extent`.

    Returns
    -------
    ndarray, shape (n, m)
    """
    extents = polytope_extent(arm, q, directions, kind)
    if kind == "velocity":
        return extents
    opposite = polytope_extent(arm, q, -np.asarray(directions), kind)
    return np.minimum(extents, opposite)


def ellipsoid_extent(ellipsoids: ArrayLike, directions: ArrayLike) -> Array:
    """Compute 1 / sqrt(uᵀ M⁻¹ u) of ellipsoids M (n, 3, 3) along directions u (m, 3).

    Returns
    -------
    ndarray, shape (n, m)
    """
    u = _unit_vectors(directions)
    inverse = np.linalg.inv(as_points(ellipsoids, "ellipsoids", 3, minimum=1))
    return np.asarray(1.0 / np.sqrt(np.einsum("mi,nij,mj->nm", u, inverse, u, optimize=True)))


def half_sphere(count: int = 64) -> Array:
    """Return evenly spread unit directions with z > 0.

    Returns
    -------
    ndarray, shape (count, 3)
        Points of a Fibonacci spiral.
    """
    z = (np.arange(count) + 0.5) / count
    angle = np.arange(count) * np.pi * (3.0 - np.sqrt(5.0))
    radius = np.sqrt(1.0 - z**2)
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle), z])


class SmoothExtents(NamedTuple):
    """Logarithms of smooth extents along lines, and their derivatives."""

    logs: Array  # (n, k), of N or m/s
    joint_changes: Array  # (n, k, dof), along each joint; empty without derivatives
    line_changes: Array  # (n, k, 3), along the components of the unit vector


def smooth_extents(
    arm: Arm,
    q: Array,
    lines: Array,
    kind: str,
    *,
    jacobians: Array | None = None,
    power: int = POWER,
    derivatives: bool = True,
) -> SmoothExtents:
    """Compute logarithms of smooth extents along lines, each configuration with its own.

    Parameters
    ----------
    arm : Arm
        With the limits of the kind.
    q : ndarray, shape (n, dof)
    lines : ndarray, shape (n, k, 3)
        Unit vectors in the base frame.
    kind : {"force", "velocity"}
    jacobians : ndarray, shape (n, 6, dof), optional
        Those of the arm at q, where they are known.
    power : int
        p, even.
    derivatives : bool
        Whether they are computed; coupled joints have none.
    """
    from maniport.arms.extent_kernels import fill_force_extents, fill_velocity_extents

    if jacobians is None:
        jacobians = arm.jacobian(q)
    count, k = lines.shape[:2]
    if derivatives:
        filled = count
    else:
        filled = 0
    result = SmoothExtents(
        logs=np.empty((count, k)),
        joint_changes=np.empty((filled, k, arm.dof)),
        line_changes=np.empty((filled, k, 3)),
    )
    # Numba compiles once more for arrays that are not contiguous, or read-only
    jacobians = np.require(jacobians, requirements=["C", "W"])
    lines = np.require(lines, requirements=["C", "W"])
    if kind == "velocity":
        limits = np.require(arm.velocity_limits, requirements=["C", "W"])
        fill_velocity_extents(jacobians, limits, lines, FLAT, power, *result)
    else:
        torques, changes = arm.remaining_torques(q, derivatives=derivatives)
        fill_force_extents(jacobians, torques, changes, lines, power, *result)
    return result


def _unit_vectors(directions: ArrayLike, count: int | None = None) -> Array:
    """Require directions (m, 3), or (count, m, 3), and normalize them."""
    u = as_finite(directions, "directions")
    each = u.ndim == 3 and count is not None and len(u) == count
    if not (u.ndim == 2 or each) or u.shape[-1] != 3 or not np.all(np.any(u, axis=-1)):
        raise InvalidInputError(
            f"directions must be nonzero vectors, shape (m, 3); found shape {u.shape}"
        )
    return np.asarray(u / np.linalg.norm(u, axis=-1, keepdims=True))


def _zonotope_extent(generators: Array, u: Array, thickness: float = 1e-9) -> Array:
    """Extents (n, m) along u (m, 3) or (n, m, 3) of zonotopes with generators (n, 3, k), thickened where flat."""
    size = thickness * np.abs(generators).max(axis=(1, 2)) + 1e-300
    columns = np.concatenate([generators, size[:, None, None] * np.eye(3)], axis=2)
    first, second = np.array([*combinations(range(columns.shape[2]), 2)]).T
    normals = np.cross(columns[..., first], columns[..., second], axis=1)
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.divide(normals, lengths, out=np.zeros_like(normals), where=lengths > 0.0)
    across = np.abs(np.swapaxes(normals, 1, 2) @ columns).sum(axis=2)[:, None]  # (n, 1, faces)
    along = np.abs(u @ normals)
    return np.asarray(
        np.divide(across, along, out=np.full_like(along, np.inf), where=along > 0.0).min(axis=2)
    )
