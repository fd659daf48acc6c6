"""Distances of the convex hulls of an arm or a group and a table."""

from collections.abc import Sequence
from typing import NamedTuple

import coal
import numpy as np
from numpy.typing import NDArray

from maniport.arms.collisions.hulls import Hull
from maniport.arms.collisions.kernels import fill_distance_bounds
from maniport.arms.kinematics import Kinematics
from maniport.util.validation import Array

TABLE = -1  # index of the table in pairs
NEXT = np.array([1, 2, 0])  # coordinates after x, y and z, and those after them, in cross products
AFTER = np.array([2, 0, 1])

Pairs = NDArray[np.int64]


class Contacts(NamedTuple):
    """Pairs of hulls at configurations, in the order of configurations."""

    rows: NDArray[np.intp]  # of the configuration
    columns: NDArray[np.intp]  # of the pair
    distances: Array  # signed [m]
    normals: Array  # (k, 3) from the second hull to the first
    points: Array  # (k, 3) of the first hull [m]


class Solids:
    """Hulls of an arm or a group and a table at a height [m], as arrays for compiled code."""

    def __init__(self, tree: Kinematics, hulls: Sequence[Hull], table: float):
        self.hulls = tuple(hulls)
        self.table = table
        self.tree = tree
        joints = np.array([hull.joint for hull in hulls], dtype=np.int64)
        self._links = np.append(joints, 0)  # the last is the table, fixed to the base
        self._shapes = []
        skins = []
        corners = [np.empty((0, 3))]
        starts = [0]
        lowest = []
        highest = []
        for hull in hulls:
            self._shapes.append(hull.solid)
            skins.append(hull.skin)
            corners.append(hull.corners)
            starts.append(starts[-1] + len(hull.corners))
            lowest.append(hull.corners.min(axis=0))
            highest.append(hull.corners.max(axis=0))
        self._shapes.append(coal.Halfspace(np.array([0.0, 0.0, 1.0]), max(table, -1e9)))
        self._skins = np.array([*skins, 0.0])

        low = np.reshape(lowest, (-1, 3))
        high = np.reshape(highest, (-1, 3))
        self._arrays = (
            np.concatenate(corners),
            np.array(starts),
            joints,
            self._skins,
            0.5 * (low + high),
            0.5 * np.linalg.norm(high - low, axis=1),
        )

    def distance_bounds(self, q: Array, pairs: Pairs, sufficient: float | Array) -> Array:
        """Lower bounds of the distances of pairs [m], (n, pairs), for q (n, dof); not refined above `sufficient`."""
        bounds = np.empty((len(q), len(pairs)))
        margins = np.zeros(len(pairs)) + sufficient
        fill_distance_bounds(
            *self.tree.link_poses(q), *self._arrays, pairs, margins, self.table, bounds
        )
        return bounds

    def contacts(
        self, q: Array, pairs: Pairs, margin: float | Array = np.inf, depths: bool = True
    ) -> Contacts:
        """Measure the pairs that may be within a margin [m], common or per pair, at configurations (n, dof)."""
        rows, columns = np.nonzero(self.distance_bounds(q, pairs, margin) <= margin)
        distances = np.empty(len(rows))
        normals = np.empty((len(rows), 3))
        points = np.empty((len(rows), 3))
        if not len(rows):  # most control steps
            return Contacts(rows, columns, distances, normals, points)
        request = coal.DistanceRequest()
        result = coal.DistanceResult()
        request.enable_signed_distance = depths
        if len(q) > 1:
            used, which = np.unique(rows, return_inverse=True)
        else:
            used = np.zeros(1, dtype=np.intp)
            which = rows
        turns, origins = self.tree.link_poses(q[used])
        links = self._links[pairs[columns]].tolist()
        hulls = pairs[columns].tolist()
        poses: dict[tuple[int, int], coal.Transform3s] = {}  # by row and link
        for k, row in enumerate(which.tolist()):
            for link in links[k]:
                if (row, link) not in poses:
                    poses[row, link] = coal.Transform3s(turns[row, link], origins[row, link])
            first, second = hulls[k]
            first_link, second_link = links[k]
            result.clear()
            distances[k] = coal.distance(
                self._shapes[first],
                poses[row, first_link],
                self._shapes[second],
                poses[row, second_link],
                request,
                result,
            )
            normals[k] = -result.normal
            points[k] = result.getNearestPoint1()
        distances = distances - self._skins[pairs[columns]].sum(axis=1)
        return Contacts(rows, columns, distances, normals, points)

    def slopes(self, q: Array, pairs: Pairs, contacts: Contacts) -> Array:
        """Return derivatives of the distances in the configuration, shape (k, dof)."""
        rows, columns, _, normals, points = contacts
        axes, slides = self.tree.arrays[2:]
        if not len(rows):
            return self.tree.coupled(np.zeros((0, len(axes))))

        turns, origins = self.tree.link_poses(q)
        turns = turns[rows, 1:]
        offsets = points[:, None] - origins[rows, 1:]
        normals = normals[:, None]
        # rotation about each axis of a link: offset × normal
        turned = offsets[..., NEXT] * normals[..., AFTER] - offsets[..., AFTER] * normals[..., NEXT]
        levers = np.where(slides[:, None], normals, turned)

        links = self._links[pairs[columns]]
        moves = self.tree.moves.astype(np.float64)
        signs = moves[links[:, 0]] - moves[links[:, 1]]
        terms = (signs[..., None] * levers)[..., None] * turns * axes[:, None]
        # sums in order, for the same bits on any processor; + 0.0 makes -0.0 a 0.0
        changes = np.cumsum(terms.reshape(*signs.shape, 9), axis=-1)[..., -1] + 0.0
        return self.tree.coupled(changes)
