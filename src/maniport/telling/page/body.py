"""An arm that moves, as a report draws it: a skeleton, the surfaces of its links, and ellipsoids at its hand."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from maniport.errors import InvalidInputError
from maniport.validation import Array, as_choice, as_finite, as_positive_semidefinite

ROLES = ("teacher", "wanted", "student")
"""Whose something is; each has its colour. What is wanted is drawn as a translucent shell."""

RIGID = 1e-6
"""How far a pose may be from a rotation and a last row of 0 0 0 1."""


@dataclass(frozen=True, eq=False)
class Part:
    """The surface of a link.

    Attributes
    ----------
    points : ndarray, shape (m, 3)
        In its own frame [m].
    triangles : ndarray of int, shape (k, 3)
        Rows of `points`; which side is the outer one does not matter.
    poses : ndarray, shape (n, 4, 4)
        Of its frame in the base frame of the body [m], one for each time.
    """

    points: Array
    triangles: NDArray[np.integer]
    poses: Array

    def __post_init__(self) -> None:
        points = as_finite(self.points, "points")
        if points.ndim != 2 or points.shape[-1] != 3:
            raise InvalidInputError(f"points must have shape (m, 3); found {points.shape}")
        corners = np.asarray(self.triangles)
        if corners.dtype.kind not in "iu" or corners.ndim != 2 or corners.shape[-1] != 3 or not len(corners):
            raise InvalidInputError(
                f"triangles must be whole numbers, shape (k, 3) with k ≥ 1; found {corners.dtype}, {corners.shape}"
            )
        if corners.min() < 0 or corners.max() >= len(points):
            raise InvalidInputError(
                f"triangles must name points from 0 to {len(points) - 1}; found {corners.min()} to {corners.max()}"
            )
        _require_rigid(as_finite(self.poses, "poses"))


@dataclass(frozen=True, eq=False)
class Body:
    """An arm that moves, with ellipsoids at its hand.

    Attributes
    ----------
    name : str
    skeleton : ndarray, shape (n, k, 3)
        Corners of its polyline from base to hand [m].
    ellipsoids : mapping of str to ndarray, shape (n, 3, 3)
        By role; semi-axes in the unit of the motion.
    path : ndarray, shape (n, 3), or None
        Wanted hand positions [m].
    parts : tuple of Part
        Surfaces that are drawn instead of the skeleton; readers can go back to it.
    """

    name: str
    skeleton: Array
    ellipsoids: Mapping[str, Array] = field(default_factory=dict)
    path: Array | None = None
    parts: tuple[Part, ...] = ()

    def __post_init__(self) -> None:
        corners = as_finite(self.skeleton, "skeleton")
        if corners.ndim != 3 or corners.shape[-1] != 3 or corners.shape[1] < 2 or not len(corners):
            raise InvalidInputError(f"skeleton must have shape (n, k, 3) with k ≥ 2; found {corners.shape}")
        for role, matrices in self.ellipsoids.items():
            as_choice(role, "role", ROLES)
            found = as_positive_semidefinite(matrices, f"ellipsoids[{role!r}]", 3)
            require_shape(found, f"ellipsoids[{role!r}]", (len(corners), 3, 3))
        if self.path is not None:
            require_shape(as_finite(self.path, "path"), "path", (len(corners), 3))
        for k, part in enumerate(self.parts):
            require_length(part.poses, f"poses of parts[{k}] of {self.name!r}", len(corners))


def require_shape(array: Array, name: str, shape: tuple[int, ...]) -> None:
    """Refuse an array of another shape."""
    if array.shape != shape:
        raise InvalidInputError(f"{name} must have shape {shape}; found {array.shape}")


def require_length(array: Array, name: str, count: int) -> None:
    """Refuse an array that has not one entry for each time."""
    if len(array) != count:
        raise InvalidInputError(f"{name} must have {count} entries, one for each time; found {len(array)}")


def _require_rigid(poses: Array) -> None:
    if poses.ndim != 3 or poses.shape[1:] != (4, 4) or not len(poses):
        raise InvalidInputError(f"poses must have shape (n, 4, 4); found {poses.shape}")
    turns = poses[:, :3, :3]
    gap = np.abs(turns @ np.swapaxes(turns, 1, 2) - np.eye(3)).max(axis=(1, 2))
    gap = np.maximum(gap, np.abs(poses[:, 3] - [0.0, 0.0, 0.0, 1.0]).max(axis=1))
    bad = np.flatnonzero((gap > RIGID) | (np.linalg.det(turns) < 0))
    if len(bad):
        raise InvalidInputError(
            f"poses must be rotations and positions, [[R, p], [0, 1]] with R Rᵀ = I to {RIGID:g} and det R = 1; "
            f"found one that is not at index {bad[0]} ({len(bad)} such entries)"
        )
