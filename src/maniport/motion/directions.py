"""Lines along which an end effector shall be strong or fast, at each waypoint."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from maniport.arms import Arm
from maniport.arms.directional import EXTENT_KINDS, half_sphere, smooth_extents
from maniport.errors import InvalidInputError
from maniport.util.validation import Array, Rows, as_choice, as_finite, as_number, require_shape

REFERENCE_SAMPLES = 1024
REFERENCE_LINES = 32
REFERENCE_PERCENTILE = 99.0
REFERENCE_FACTOR = 1.5  # with 1 a Panda's force is 8 to 24 % less on three clips
SLOW = 0.05  # Share of the largest speed of a path below which it rests


@dataclass(frozen=True, eq=False)
class DirectionTarget:
    """Lines along which the extent of force or speed shall be large.

    Attributes
    ----------
    kind : {"force", "velocity"}
    lines : ndarray, shape (n, k, 3)
        Unit vectors in the base frame; a line has no sign.
    weights : ndarray, shape (n, k)
        Of the squared residuals, relative to the squared distance to the ellipsoids.
    reference : float
        Extent above which nothing more is asked for [N or m/s].
    follows_path : bool
        Whether the lines turn with the path when it is placed; else they stay in the base frame.
    """

    kind: str
    lines: Array
    weights: Array
    reference: float
    follows_path: bool = True

    def __len__(self) -> int:
        return len(self.lines)

    def __getitem__(self, rows: Rows) -> "DirectionTarget":
        return replace(self, lines=self.lines[rows], weights=self.weights[rows])

    def nearest(self, time: Array, at: Array) -> "DirectionTarget":
        """Return those at other times, of the nearest waypoint: lines without a sign have no mean."""
        middles = 0.5 * (time[1:] + time[:-1])
        return self[np.searchsorted(middles, at)]

    def turned(self, rotation: Array) -> "DirectionTarget":
        """Return lines turned by a rotation (3, 3) of the path; of several (b, 3, 3) those of one after the other."""
        if rotation.ndim == 3:
            return self._turned_each(rotation)
        if not self.follows_path:
            return self
        return replace(self, lines=self.lines @ rotation.T)

    def _turned_each(self, rotations: Array) -> "DirectionTarget":
        lines = np.broadcast_to(self.lines, (len(rotations), *self.lines.shape))
        if self.follows_path:
            lines = lines @ np.swapaxes(rotations, 1, 2)[:, None]
        return replace(
            self,
            lines=lines.reshape(-1, *self.lines.shape[1:]),
            weights=np.tile(self.weights, (len(rotations), 1)),
        )

    def checked(self, count: int) -> "DirectionTarget":
        """Require one row of lines for each of `count` waypoints, and return unit vectors."""
        as_choice(self.kind, "kind", EXTENT_KINDS)
        lines = as_finite(self.lines, "lines")
        weights = as_finite(self.weights, "weights")
        require_shape(lines, "lines", (count, "k", 3), ", one row for each time")
        require_shape(weights, "weights", (count, lines.shape[1]), ", one for each line")
        lengths = np.linalg.norm(lines, axis=2, keepdims=True)
        if np.any(lengths == 0.0):
            raise InvalidInputError("lines must be vectors of a length above 0; found zeros")
        if np.any(weights < 0.0):
            raise InvalidInputError(f"weights must not be negative; found {weights.min():g}")
        as_number(self.reference, "reference", above=0.0)
        return replace(self, lines=lines / lengths, weights=weights.copy())


def extent_reference(arm: Arm, kind: str) -> float:
    """Return 1.5 times the extent that an arm exceeds along one of a hundred lines at random configurations."""
    q = arm.sample(REFERENCE_SAMPLES, 0)
    lines = np.broadcast_to(half_sphere(REFERENCE_LINES), (len(q), REFERENCE_LINES, 3))
    logs = smooth_extents(arm, q, lines, kind, derivatives=False).logs
    return REFERENCE_FACTOR * float(np.exp(np.percentile(logs, REFERENCE_PERCENTILE)))


def strongest_lines(extents: Array, lines: Array, count: int, power: int) -> tuple[Array, Array]:
    """Choose lines with the largest extents, and weights that sum to one.

    Parameters
    ----------
    extents : ndarray, shape (n, m)
        Along each line.
    lines : ndarray, shape (m, 3)
    count : int
        Number of lines that are chosen.
    power : int
        Of the extents, to which weights are proportional.

    Returns
    -------
    chosen : ndarray, shape (n, count, 3)
    weights : ndarray, shape (n, count)
    """
    order = np.argsort(-extents, axis=1, kind="stable")[:, :count]
    largest = np.take_along_axis(extents, order, axis=1)
    weights = (largest / largest[:, :1]) ** power
    weights /= weights.sum(axis=1, keepdims=True)
    return lines[order], weights


def path_tangents(time: Array, positions: Array) -> Array:
    """Return unit tangents of a path (n, 3); where it rests, those of the nearest waypoint that moves.

    A path that never moves has the vertical.
    """
    velocities = np.gradient(positions, time, axis=0)
    speeds = np.linalg.norm(velocities, axis=1)
    rows = np.flatnonzero(speeds > SLOW * speeds.max())
    if not len(rows):
        return np.tile([0.0, 0.0, 1.0], (len(positions), 1))
    tangents = velocities[rows] / speeds[rows, None]
    middles = 0.5 * (time[rows][1:] + time[rows][:-1])
    return np.asarray(tangents[np.searchsorted(middles, time)])


def strongest_line(target: DirectionTarget) -> Array:
    """Return the line of each waypoint with the largest weight, shape (n, 3)."""
    best: NDArray[np.intp] = target.weights.argmax(axis=1)
    return target.lines[np.arange(len(target)), best]
