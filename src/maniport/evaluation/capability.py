"""Largest forces and speeds of an end effector along directions, within the limits of all joints.

Limits of single joints bound a polytope. With the linear Jacobian J, unit directions u, torque limits T, velocity
limits V and gravity torques g, its extent along u is

    force       max f with −T ≤ g + Jᵀ u f ≤ T, a minimum over the joints,
    velocity    max v with J q̇ = v u, |q̇| ≤ V

(Chiu, IJRR 7, 1988; Skuric, Padois and Daney, ICRA 2021). The second is the extent of a zonotope with the columns c_i
of J V as generators: by duality the minimum of Σ_i |wᵀ c_i| / |wᵀ u| over the normals w = c_i × c_j of its faces.
"""

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike

from maniport.arms import Arm, EllipsoidSpec
from maniport.arms.manipulability import JOINT_LIMITS
from maniport.errors import InvalidInputError
from maniport.util.sampling import evenly_spaced
from maniport.util.validation import Array, as_choice, as_finite, as_points


@dataclass(frozen=True, eq=False)
class Capability:
    """Force or speed of a robot's motion along the directions in which the person has most, at k waypoints.

    Attributes
    ----------
    kind : {"force", "velocity"}
    time : ndarray, shape (k,)
        Of the waypoints [s].
    robot, position_only : ndarray, shape (k,)
        Of the motion, and of one with the same start and path that follows the positions alone [N] or [m/s]; the
        smaller value of both senses of a direction.
    person : ndarray, shape (k,), or None
        Of the person [N]; None for speeds, since human arms have no velocity limits. Directions are then those of unit
        joint velocities.
    resemblance, position_only_resemblance : float
        Correlation of the logarithms with the person's over 64 directions, without the level of each waypoint.
    """

    kind: str
    time: Array
    robot: Array
    position_only: Array
    person: Array | None
    resemblance: float
    position_only_resemblance: float


def polytope_extent(arm: Arm, q: ArrayLike, directions: ArrayLike, kind: str = "force") -> Array:
    """Compute the largest force [N], with gravity, or speed [m/s] along directions.

    Parameters
    ----------
    arm : Arm
        With effort limits for forces, velocity limits for speeds; gravity counts where it has masses.
    q : array_like, shape (n, dof)
    directions : array_like, shape (m, 3)
        In the base frame, of any length above 0.
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
    as_choice(kind, "kind", ("force", "velocity"))
    arm.checked_spec(EllipsoidSpec(kind, joint_weights=JOINT_LIMITS))
    limits = arm.velocity_limits if kind == "velocity" else arm.effort_limits
    assert limits is not None
    configurations, u = np.atleast_2d(arm.configurations(q)), _unit_vectors(directions)
    jacobian = arm.jacobian(configurations)[:, :3]
    if kind == "velocity":
        return _zonotope_extent(jacobian * limits, u)
    held = (
        np.zeros_like(configurations)
        if arm.chain.inertia is None
        else arm.gravity_torques(configurations)
    )
    torques, held = u @ jacobian, held[:, None]  # torques (n, m, dof) of 1 N
    with np.errstate(divide="ignore", invalid="ignore"):
        extents = (limits - np.sign(torques) * held) / np.abs(torques)
    extents = np.where(torques == 0.0, np.inf, extents).min(axis=-1)
    return np.asarray(np.where(np.any(np.abs(held) > limits, axis=-1), 0.0, extents))


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
    extents, u = polytope_extent(arm, q, directions, kind), np.asarray(directions)
    return extents if kind == "velocity" else np.minimum(extents, polytope_extent(arm, q, -u, kind))


def ellipsoid_extent(ellipsoids: ArrayLike, directions: ArrayLike) -> Array:
    """Compute 1 / sqrt(uᵀ M⁻¹ u) of ellipsoids M (n, 3, 3) along directions u (m, 3).

    Returns
    -------
    ndarray, shape (n, m)
    """
    u, inverse = (
        _unit_vectors(directions),
        np.linalg.inv(as_points(ellipsoids, "ellipsoids", 3, minimum=1)),
    )
    return np.asarray(1.0 / np.sqrt(np.einsum("mi,nij,mj->nm", u, inverse, u, optimize=True)))


def half_sphere(count: int = 64) -> Array:
    """Return evenly spread unit directions with z > 0.

    Returns
    -------
    ndarray, shape (count, 3)
        Points of a Fibonacci spiral.
    """
    z, angle = (np.arange(count) + 0.5) / count, np.arange(count) * np.pi * (3.0 - np.sqrt(5.0))
    radius = np.sqrt(1.0 - z**2)
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle), z])


def resemblance(first: ArrayLike, other: ArrayLike) -> float:
    """Correlate the logarithms of extents (n, m) without the mean of each row.

    Returns
    -------
    float
        Over the rows that are finite and above 0; nan without any.
    """
    values = np.stack([np.asarray(first, dtype=np.float64), np.asarray(other, dtype=np.float64)])
    usable = np.all((values > 0.0) & np.isfinite(values), axis=(0, 2))
    logarithms = np.log(values[:, usable])
    logarithms -= logarithms.mean(axis=2, keepdims=True)
    a, b = logarithms.reshape(2, -1)
    return float(a @ b / np.sqrt((a @ a) * (b @ b))) if len(a) else np.nan


def compare_capabilities(
    person: Arm,
    joint_angles: Array,
    robot: Arm,
    q: Array,
    time: Array,
    rotation: Array,
    most: int = 200,
) -> tuple[Capability, ...]:
    """Compare a robot's motion with the person's and with a motion along the same positions.

    Parameters
    ----------
    person, robot : Arm
    joint_angles, q : ndarray, shapes (n, dof of the person) and (n, dof)
        Configurations at the same waypoints.
    time : ndarray, shape (n,)
        Of the waypoints [s].
    rotation : ndarray, shape (3, 3)
        From the person's base frame to the robot's.
    most : int
        Number of waypoints that are compared, evenly spaced.

    Returns
    -------
    tuple of Capability
        Force and speed, without those for which limits of a joint are missing.
    """
    rows, u, results = evenly_spaced(len(q), most), half_sphere(), []
    models = {"force": person, "velocity": person.with_limits(velocity=1.0)}
    models = {
        kind: arm
        for kind, arm in models.items()
        if _is_limited(robot, kind) and _is_limited(arm, kind)
    }
    along = robot.forward(q[rows])[:, :3, 3]
    motions = (q[rows], follow_positions(robot, q[0], along)) if models else ()
    for kind, model in models.items():
        own = polytope_extent(model, joint_angles[rows], u, kind)
        moved, free = (line_extent(robot, motion, u @ rotation.T, kind) for motion in motions)
        best = np.arange(len(rows)), own.argmax(axis=1)
        forces = None if kind == "velocity" else own[best]
        likeness = resemblance(moved, own), resemblance(free, own)
        results.append(Capability(kind, time[rows], moved[best], free[best], forces, *likeness))
    return tuple(results)


def follow_positions(
    arm: Arm, start: Array, positions: Array, tolerance: float = 1e-4, most_steps: int = 20
) -> Array:
    """Follow positions (n, 3) from a start (dof,) by the pseudoinverse, within limits; shape (n, dof)."""
    result, now = np.empty((len(positions), arm.dof)), start
    for i, position in enumerate(positions):
        for _ in range(most_steps):
            pose, jacobian = arm.motion(now)
            error = position - pose[:3, 3]
            if error @ error < tolerance**2:
                break
            step = np.linalg.lstsq(jacobian[:3], error, rcond=1e-3)[0]
            ends = (now + step < arm.lower) | (now + step > arm.upper)
            if ends.any():  # the other joints do it
                step = np.where(
                    ends, 0.0, np.linalg.lstsq(jacobian[:3] * ~ends, error, rcond=1e-3)[0]
                )
            now = np.clip(now + step, arm.lower, arm.upper)
        result[i] = now
    return result


def _is_limited(arm: Arm, kind: str) -> bool:
    limits = arm.velocity_limits if kind == "velocity" else arm.effort_limits
    return limits is not None and bool(np.all(np.isfinite(limits) & (limits > 0.0)))


def _unit_vectors(directions: ArrayLike) -> Array:
    u = as_finite(directions, "directions")
    if u.ndim != 2 or u.shape[1] != 3 or not np.all(np.any(u, axis=1)):
        raise InvalidInputError(
            f"directions must be nonzero vectors, shape (m, 3); found shape {u.shape}"
        )
    return np.asarray(u / np.linalg.norm(u, axis=1, keepdims=True))


def _zonotope_extent(generators: Array, u: Array, thickness: float = 1e-9) -> Array:
    """Extents (n, m) along u (m, 3) of zonotopes with generators (n, 3, k), thickened where they are flat."""
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
