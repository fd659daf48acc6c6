"""Force and speed of a robot's motion along the directions in which the person has most."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from maniport.arms import Arm
from maniport.arms.directional import half_sphere, is_limited, line_extent, polytope_extent
from maniport.util.sampling import evenly_spaced
from maniport.util.validation import Array


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
        if is_limited(robot, kind) and is_limited(arm, kind)
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
