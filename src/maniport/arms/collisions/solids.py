"""Distances of the convex hulls of an arm or a group and a table."""

from collections.abc import Sequence
from typing import NamedTuple

import coal
import numpy as np
from numpy.typing import NDArray

from maniport.arms.collisions.hulls import Hull
from maniport.arms.kinematics import Kinematics
from maniport.util.jit import kernel, part
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
        self._shapes = [
            *(hull.solid for hull in hulls),
            coal.Halfspace(np.array([0.0, 0.0, 1.0]), max(table, -1e9)),
        ]
        self._skins = np.array([*(hull.skin for hull in hulls), 0.0])
        ends = np.array(
            [(hull.corners.min(axis=0), hull.corners.max(axis=0)) for hull in hulls]
        ).reshape(-1, 2, 3)
        self._arrays = (
            np.concatenate([np.empty((0, 3)), *(hull.corners for hull in hulls)]),
            np.cumsum([0, *(len(hull.corners) for hull in hulls)]),
            joints,
            self._skins,
            0.5 * (ends[:, 0] + ends[:, 1]),
            0.5 * np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1),
        )

    def distance_bounds(self, q: Array, pairs: Pairs, sufficient: float | Array) -> Array:
        """Lower bounds of the distances of pairs [m], (n, pairs), for q (n, dof); not refined above `sufficient`."""
        bounds = np.empty((len(q), len(pairs)))
        margins = np.zeros(len(pairs)) + sufficient
        _fill_distance_bounds(
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
        ends = pairs[columns].tolist()
        moved = {
            (row, link) for row, own in zip(which.tolist(), links, strict=True) for link in own
        }
        places = {key: coal.Transform3s(turns[key], origins[key]) for key in moved}
        for k, row in enumerate(which.tolist()):
            (a, b), (link_a, link_b) = ends[k], links[k]
            result.clear()
            first = (self._shapes[a], places[row, link_a])
            second = (self._shapes[b], places[row, link_b])
            distances[k] = coal.distance(*first, *second, request, result)
            normals[k] = -result.normal
            points[k] = result.getNearestPoint1()
        return Contacts(
            rows, columns, distances - self._skins[pairs[columns]].sum(axis=1), normals, points
        )

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


@kernel
def _fill_distance_bounds(  # type: ignore[no-untyped-def]
    rotations, places,
    corners, starts, joints, skins, centers, radii, pairs, margins, table, bounds,
):  # fmt: skip
    """Fill lower bounds of the distances of pairs; bounds above `margins` (pairs,) are not refined."""
    middles = np.empty((len(joints), 3))
    for n in range(len(bounds)):
        turns = rotations[n]
        origins = places[n]
        for h in range(len(joints)):
            j = joints[h]
            for i in range(3):
                middles[h, i] = origins[j, i] + (
                    turns[j, i, 0] * centers[h, 0]
                    + turns[j, i, 1] * centers[h, 1]
                    + turns[j, i, 2] * centers[h, 2]
                )
        for p in range(len(pairs)):
            a, b = pairs[p]
            j = joints[a]
            skin = skins[a] + skins[b]
            sufficient = margins[p] + skin
            if b < 0:
                height = middles[a, 2] - radii[a] - table
                if height <= sufficient:
                    up = turns[j, 2]
                    height = (
                        origins[j, 2]
                        - table
                        + _least(corners, starts[a], starts[a + 1], up[0], up[1], up[2])[0]
                    )
                bounds[n, p] = height - skin
                continue
            x = middles[a, 0] - middles[b, 0]
            y = middles[a, 1] - middles[b, 1]
            z = middles[a, 2] - middles[b, 2]
            distance = np.sqrt(x * x + y * y + z * z) - radii[a] - radii[b]
            if distance <= sufficient:
                distance = _apart(
                    turns[j], origins[j], turns[joints[b]], origins[joints[b]], corners,
                    starts[a], starts[a + 1], starts[b], starts[b + 1], x, y, z, sufficient,
                )  # fmt: skip
            bounds[n, p] = distance - skin


@part
def _least(corners, first, last, x, y, z):  # type: ignore[no-untyped-def]
    """Smallest product of a direction with corners, and the index of the corner."""
    least = np.inf
    where = first
    for i in range(first, last):
        value = x * corners[i, 0] + y * corners[i, 1] + z * corners[i, 2]
        if value < least:
            least = value
            where = i
    return least, where


@part
def _apart(  # type: ignore[no-untyped-def]
    turn_a, at_a, turn_b, at_b, corners, a0, a1, b0, b1, x, y, z, sufficient
):
    """Distance of two hulls along separating directions: the first above `sufficient`, or the largest."""
    most = -1.0
    for _ in range(12):  # after 12 directions the exact test decides
        square = x * x + y * y + z * z
        length = np.sqrt(square)
        if length <= 1e-12:
            break
        ax = turn_a[0, 0] * x + turn_a[1, 0] * y + turn_a[2, 0] * z
        ay = turn_a[0, 1] * x + turn_a[1, 1] * y + turn_a[2, 1] * z
        az = turn_a[0, 2] * x + turn_a[1, 2] * y + turn_a[2, 2] * z
        bx = turn_b[0, 0] * x + turn_b[1, 0] * y + turn_b[2, 0] * z
        by = turn_b[0, 1] * x + turn_b[1, 1] * y + turn_b[2, 1] * z
        bz = turn_b[0, 2] * x + turn_b[1, 2] * y + turn_b[2, 2] * z
        least_a, i = _least(corners, a0, a1, ax, ay, az)
        least_b, j = _least(corners, b0, b1, -bx, -by, -bz)
        between = (
            x * (at_a[0] - at_b[0])
            + y * (at_a[1] - at_b[1])
            + z * (at_a[2] - at_b[2])
            + least_a
            + least_b
        )
        most = max(most, between / length - 1e-9)  # rounding
        if most > sufficient:
            break
        w0 = at_a[0] - at_b[0]
        w1 = at_a[1] - at_b[1]
        w2 = at_a[2] - at_b[2]
        for m in range(3):
            w0 += turn_a[0, m] * corners[i, m] - turn_b[0, m] * corners[j, m]
            w1 += turn_a[1, m] * corners[i, m] - turn_b[1, m] * corners[j, m]
            w2 += turn_a[2, m] * corners[i, m] - turn_b[2, m] * corners[j, m]
        u0 = x - w0
        u1 = y - w1
        u2 = z - w2
        change = u0 * u0 + u1 * u1 + u2 * u2
        if not change > 0.0:
            break
        step = min(1.0, max(0.0, (x * u0 + y * u1 + z * u2) / change))
        x = x - step * u0
        y = y - step * u1
        z = z - step * u2
    return most
