"""Force and speed of a robot's motion along lines, beside motions that do not try for them."""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maniport.arms import Arm
from maniport.arms.directional import half_sphere, line_extent, polytope_extent
from maniport.util.sampling import evenly_spaced
from maniport.util.validation import Array

MOST_ROWS = 200  # Waypoints by which motions are compared over all directions


@dataclass(frozen=True, eq=False)
class Capability:
    """Force or speed of a robot's motion along a line at each of n waypoints, and of motions to compare it with.

    All are the smaller value of both senses of the line, within the limits of all joints.

    Attributes
    ----------
    kind : {"force", "velocity"}
    time : ndarray, shape (n,)
        Of the waypoints [s].
    lines : ndarray, shape (n, 3)
        Unit vectors in the robot's base frame: of the person's largest value, or given.
    robot : ndarray, shape (n,)
        Of the motion [N] or [m/s].
    position_only : ndarray, shape (n,), or None
        Of a motion planned through the positions alone, on a path of the same size that was placed for it.
    same_path : ndarray, shape (n,), or None
        Of a motion planned through the positions alone, on the path of the motion.
    person : ndarray, shape (n,), or None
        Of the person [N]; None for speeds, since human arms have no velocity limits: the lines are then those of the
        largest speed with joint velocities of at most 1 rad/s.
    resemblance, position_only_resemblance : float
        Correlation of the logarithms with the person's over 64 directions, without the level of each waypoint; nan
        where there is nothing to compare.
    along : {"person", "path", "direction"}
        Which lines: of the person's largest values, tangents of the path, or a given direction.
    is_target : bool
        Whether the motion was planned for it.
    """

    kind: str
    time: Array
    lines: Array
    robot: Array
    position_only: Array | None = None
    same_path: Array | None = None
    person: Array | None = None
    resemblance: float = np.nan
    position_only_resemblance: float = np.nan
    along: str = "person"
    is_target: bool = True

    @property
    def gain(self) -> float:
        """Ratio of the median to that of positions only; nan without them."""
        if self.position_only is None:
            return np.nan
        return float(np.median(self.robot) / np.median(self.position_only))


class DirectedMotion(NamedTuple):
    """A motion of a robot, and the lines along which its extents count."""

    joint_positions: Array  # (n, dof)
    lines: Array  # (n, 3), in the robot's base frame
    rotation: Array  # (3, 3), from the person's trunk frame to the base frame

    def extents(self, robot: Arm, kind: str) -> Array:
        """Return extents along the lines, shape (n,)."""
        return line_extent(robot, self.joint_positions, self.lines[:, None], kind)[:, 0]

    def resemblance(self, robot: Arm, kind: str, person: Array, rows: NDArray[np.intp]) -> float:
        """Correlate with the person's extents (m, 64) at some rows (m,)."""
        lines = half_sphere() @ self.rotation.T
        return resemblance(line_extent(robot, self.joint_positions[rows], lines, kind), person)


class PersonMotion(NamedTuple):
    """A person's arm with the limits of a kind, and its motion."""

    arm: Arm
    joint_angles: Array  # (n, dof)


def compare_capability(
    kind: str,
    robot: Arm,
    time: Array,
    motion: DirectedMotion,
    position_only: DirectedMotion | None = None,
    same_path: DirectedMotion | None = None,
    person: PersonMotion | None = None,
) -> Capability:
    """Compare force or speed of a robot's motion along lines with that of other motions, and of a person.

    Parameters
    ----------
    kind : {"force", "velocity"}
    robot : Arm
        With the limits of the kind.
    time : ndarray, shape (n,)
        Of the waypoints [s].
    motion, position_only, same_path : DirectedMotion
        At the same waypoints; the others are those of `Capability`.
    person : PersonMotion, optional
    """
    result = Capability(kind, time, motion.lines, motion.extents(robot, kind))
    if position_only is not None:
        result = replace(result, position_only=position_only.extents(robot, kind))
    if same_path is not None:
        result = replace(result, same_path=same_path.extents(robot, kind))
    if person is None:
        return result

    rows = evenly_spaced(len(time), MOST_ROWS)
    of_person = polytope_extent(person.arm, person.joint_angles[rows], half_sphere(), kind)
    result = replace(result, resemblance=motion.resemblance(robot, kind, of_person, rows))
    if position_only is not None:
        likeness = position_only.resemblance(robot, kind, of_person, rows)
        result = replace(result, position_only_resemblance=likeness)
    if kind == "force":
        lines = motion.lines @ motion.rotation  # in the trunk frame
        forces = line_extent(person.arm, person.joint_angles, lines[:, None], kind)
        result = replace(result, person=forces[:, 0])
    return result


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
    if len(a):
        return float(a @ b / np.sqrt((a @ a) * (b @ b)))
    return np.nan
