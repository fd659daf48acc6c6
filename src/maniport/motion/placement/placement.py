"""Placement of a path relative to a robot."""

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maniport.arms import EllipsoidSpec
from maniport.arms.chain import rotation_about
from maniport.errors import InvalidInputError
from maniport.spd.kernels import congruence
from maniport.util.atomic_io import folder_written_whole
from maniport.util.files import save_ellipsoids, save_path
from maniport.util.notebook import NotebookDisplay
from maniport.util.validation import Array, as_finite, require_shape

DATA_FILES = ("placed_profile.npz", "path.npz")  # What `Placement.save` writes


@dataclass(frozen=True, eq=False, kw_only=True)
class Place:
    """A possible placement of a path.

    Attributes
    ----------
    scale, yaw : float
        Factor of the path's size, and rotation about the vertical [rad], within ±π.
    tilt, heading : float
        Lean of the base from upright, and its direction: 0 is that of its own x axis, π/2 of y [rad].
    offset : ndarray, shape (3,)
        Position of the path's center in the robot's base frame [m].
    planned_distance : ndarray, shape (m,)
        Affine-invariant distances of a trajectory that was planned through some waypoints of the path.
    """

    scale: float
    yaw: float
    tilt: float
    heading: float
    offset: Array
    planned_distance: Array

    @property
    def rms(self) -> float:
        """Root mean square of the distances."""
        return float(np.sqrt(np.mean(self.planned_distance**2)))


@dataclass(frozen=True, eq=False, kw_only=True)
class Placement(Place, NotebookDisplay):
    """A placed path in a robot's workspace, with its ellipsoids; made by `place_path`.

    p_robot = scale · rotation · map_rotation · (p − center) + offset, with rotation = base_orientationᵀ · Rz(yaw).

    Attributes
    ----------
    scale, yaw, tilt, heading, offset, planned_distance
        As in `Place`.
    pointwise_best : ndarray, shape (n,)
        Distances of the pointwise optimum: the smallest that was found for each waypoint by itself, with the end
        effector there.
    path : ndarray, shape (n, 3)
        Target positions of the end effector in the robot's base frame [m].
    profile : ndarray, shape (n, d, d)
        Target ellipsoids, rotated by `rotation`.
    spec : EllipsoidSpec
        Kind, part and joint weights of the ellipsoids.
    base_orientation : ndarray, shape (3, 3)
        Rotation of the base in a world whose z axis is up; the identity without tilt.
    center : ndarray, shape (3,)
        Mean of the waypoints of the path before the placement [m].
    map_rotation : ndarray, shape (3, 3)
        Rotation of the ellipsoids by the adapter, which also rotates the path.
    position_error : ndarray, shape (n,)
        Distance of the end effector from the waypoint there [m].
    reachable : ndarray of bool, shape (n,)
        Whether that is at most 1 mm.
    joint_positions : ndarray, shape (n, dof)
        Joint positions of the pointwise optimum [rad or m]: not a motion, they may jump.
    candidates : tuple of Place
        The best placements, this one included.
    """

    path: Array
    profile: Array
    spec: EllipsoidSpec
    base_orientation: Array
    center: Array
    map_rotation: Array
    position_error: Array
    reachable: NDArray[np.bool_]
    pointwise_best: Array
    joint_positions: Array
    candidates: tuple[Place, ...] = ()

    @property
    def rotation(self) -> Array:
        """Rotation of path and ellipsoids in the base frame, shape (3, 3)."""
        return np.asarray(self.base_orientation.T @ rotation_about(2, self.yaw))

    def apply(self, points: ArrayLike) -> Array:
        """Place other points of the same motion, shape (..., 3) [m], such as those of a denser path."""
        positions = as_finite(points, "points")
        if positions.ndim < 1 or positions.shape[-1] != 3:
            raise InvalidInputError(f"points must have shape (..., 3); found {positions.shape}")
        rotation = self.rotation @ self.map_rotation
        return np.asarray(self.scale * (positions - self.center) @ rotation.T + self.offset)

    def turned(self, profile: ArrayLike) -> Array:
        """Rotate other ellipsoids of the same motion, shape (n, d, d), such as those of a denser path."""
        ellipsoids, size = as_finite(profile, "profile"), self.spec.size
        require_shape(ellipsoids, "profile", ("n", size, size))
        return congruence(self.spec.rotation(self.rotation), ellipsoids)

    def save(self, folder: str | os.PathLike[str], time: ArrayLike | None = None, *, overwrite: bool = False) -> None:
        """Write `DATA_FILES` to a folder, whole or not at all: ellipsoids and path, with their times (n,) [s] if known.

        Raises
        ------
        OutputError
            When the folder holds earlier ones that may not be overwritten, or other things, or cannot be written.
        """
        with folder_written_whole(folder, DATA_FILES, overwrite) as staging:
            self.write_data(staging, time)

    def write_data(self, folder: Path, time: ArrayLike | None = None) -> None:
        """Write `DATA_FILES` into an existing folder."""
        save_ellipsoids(folder / DATA_FILES[0], self.profile, time)
        save_path(folder / DATA_FILES[1], self.path, time)

    def __repr__(self) -> str:
        lean = f", base tilted by {np.degrees(self.tilt):.1f}°" if self.tilt else ""
        place = f"scale {self.scale:.3f}, yaw {np.degrees(self.yaw):.1f}°{lean}"
        optimum = f"pointwise optimum {np.median(self.pointwise_best):.2f} (median)"
        return f"Placement({len(self.path)} points, {place}, {optimum}, {np.sum(~self.reachable)} out of reach)"
