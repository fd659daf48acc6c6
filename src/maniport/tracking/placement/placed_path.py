"""A hand path where an arm can make the wanted ellipsoids along it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maniport.bodies.chain import rotation_about
from maniport.errors import InvalidInputError
from maniport.notebook import ShownInNotebooks
from maniport.validation import Array, as_finite


@dataclass(frozen=True, eq=False)
class PlacedPath(ShownInNotebooks):
    """A hand path in a robot's workspace, with the ellipsoids that turn with it, and how well it can be done there.

    p_robot = scale · Rz(yaw) · turn · (p − centre) + offset.

    Attributes
    ----------
    path : ndarray, shape (n, 3)
        Hand positions in the robot's base frame [m].
    profile : ndarray, shape (n, d, d)
        Wanted ellipsoids there: the given ones, turned by the yaw.
    scale, yaw : float
        Factor of the path's size, and turn about the vertical [rad], within ±π.
    offset : ndarray, shape (3,)
        Where the path's centre is in the robot's base frame [m].
    centre : ndarray, shape (3,)
        Mean of the given path's points [m].
    turn : ndarray, shape (3, 3)
        As given.
    distance : ndarray, shape (n,)
        The floor at each point: the smallest affine-invariant distance to the wanted ellipsoid that was found with
        the hand there, each point by itself. Smooth motions stay above it.
    position_error : ndarray, shape (n,)
        How far the hand stays beside the point [m].
    reachable : ndarray of bool, shape (n,)
        Whether that is at most 1 mm. Where it is not, `distance` belongs to the nearest place that was found.
    joint_positions : ndarray, shape (n, dof)
        Joint positions that do so, each point by itself [rad or m]: not a motion, they may jump.
    """

    path: Array
    profile: Array
    scale: float
    yaw: float
    offset: Array
    centre: Array
    turn: Array
    distance: Array
    position_error: Array
    reachable: NDArray[np.bool_]
    joint_positions: Array

    def apply(self, points: ArrayLike) -> Array:
        """Place other points of the same motion, shape (..., 3) [m], such as those of a denser path."""
        given = as_finite(points, "points")
        if given.ndim < 1 or given.shape[-1] != 3:
            raise InvalidInputError(f"points must have shape (..., 3); found {given.shape}")
        rotation = rotation_about(2, self.yaw) @ self.turn
        return np.asarray(self.scale * (given - self.centre) @ rotation.T + self.offset)

    def turned(self, profile: ArrayLike) -> Array:
        """Turn other ellipsoids of the same motion by the yaw, shape (n, d, d), such as those of a denser path."""
        given = as_finite(profile, "profile")
        if given.ndim != 3 or given.shape[1:] != self.profile.shape[1:]:
            raise InvalidInputError(f"profile must have shape (n, {self.profile.shape[1:]}); found {given.shape}")
        turn = rotation_about(2, self.yaw)
        rotation = np.asarray(np.kron(np.eye(2), turn) if given.shape[-1] == 6 else turn)
        moved = rotation @ given @ rotation.T
        return np.asarray(0.5 * (moved + np.swapaxes(moved, 1, 2)))

    @property
    def summary(self) -> str:
        """Where the path lies and what can be reached, in two or three lines."""
        place = ", ".join(f"{value:.3f}" for value in self.offset)
        lines = [
            f"scale {self.scale:.3f}, yaw {np.degrees(self.yaw):.1f}°, centre at ({place}) m",
            f"best distance there: median {np.median(self.distance):.2f}, 95 % {np.percentile(self.distance, 95):.2f}",
        ]
        if not self.reachable.all():
            worst, out = int(np.argmax(self.position_error)), np.flatnonzero(~self.reachable)
            lines.append(
                f"out of reach at {len(out)} of {len(self.path)} points, from {out[0]} to {out[-1]}; farthest at point "
                f"{worst}, by {self.position_error[worst]:.3f} m"
            )
        return "\n".join(lines)

    def __repr__(self) -> str:
        return f"PlacedPath({len(self.path)} points: {'; '.join(self.summary.splitlines())})"

    def _facts(self) -> dict[str, object]:
        place, floor, *outside = self.summary.splitlines()
        return {
            "points": len(self.path),
            "placed": place,
            "ellipsoids": floor,
            "reach": outside[0] if outside else "every point",
        }
