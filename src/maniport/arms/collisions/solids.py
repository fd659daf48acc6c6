"""Distances of the convex hulls of an arm or a group and a table, and poses of their links."""

from collections.abc import Sequence

import coal
import numpy as np
from numpy.typing import NDArray

from maniport.arms.arm import Arm
from maniport.arms.arm_group import ArmGroup, as_group
from maniport.arms.chain import PRISMATIC, Joint
from maniport.arms.chain_kernels import fill_link_poses
from maniport.arms.collisions.hulls import Hull
from maniport.util.jit import kernel, part
from maniport.util.validation import Array

TABLE = -1  # index of the table in pairs

Pairs = NDArray[np.int64]


class LinkTree:
    """The base, which is link 0, and the link after each joint of an arm or a group."""

    def __init__(self, arm: Arm | ArmGroup):
        group = as_group(arm)
        self.of_chain: list[list[int]] = []
        joints: list[Joint] = []
        parents: list[int] = []
        coupling, offset, reach = [], [], []
        for i, own in enumerate(group.columns):
            chain, before = group.arms[i].chain, group.common[i, :i]
            shared = int(before.max(initial=0))
            links = self.of_chain[int(before.argmax())][: shared + 1] if i else [0]
            ends = np.abs([chain.lower, chain.upper]).max(axis=0)
            for k in range(shared, len(chain.joints)):
                joints.append(chain.joints[k])
                parents.append(links[-1])
                links.append(len(joints))
                coupling.append(np.zeros(arm.dof))
                coupling[-1][own] = chain.coupling[k]
                offset.append(chain.offset[k])
                reach.append(np.abs(chain.coupling[k]) @ ends + np.abs(chain.offset[k]))
            self.of_chain.append(links)
        count = len(joints)
        self.parents = np.array(parents, dtype=np.int64)
        self.coupling = np.array(coupling).reshape(count, arm.dof)
        self._offset = np.array(offset)
        self._placements = np.array([joint.placement for joint in joints], dtype=float).reshape(count, 4, 4)
        self._axes = np.array([joint.axis for joint in joints], dtype=float).reshape(count, 3)
        self._slides = np.array([joint.kind == PRISMATIC for joint in joints], dtype=np.bool_)
        shifts = np.linalg.norm(self._placements[:, :3, 3], axis=1) + np.where(self._slides, reach, 0.0)
        self.moves = np.zeros((count + 1, count), dtype=np.bool_)
        self._along = np.zeros(count + 1)  # largest distance of each link's frame from the base [m]
        for joint, parent in enumerate(parents):
            self.moves[joint + 1] = self.moves[parent]
            self.moves[joint + 1, joint] = True
            self._along[joint + 1] = self._along[parent] + shifts[joint]

    def poses(self, q: Array) -> tuple[Array, Array]:
        """Rotations (n, links, 3, 3) and origins (n, links, 3) at configurations (n, dof)."""
        links = len(self.parents) + 1
        turns, origins = np.empty((len(q), links, 3, 3)), np.empty((len(q), links, 3))
        positions = np.ascontiguousarray(q @ self.coupling.T + self._offset)
        fill_link_poses(positions, self.parents, self._placements, self._axes, self._slides, turns, origins)
        return turns, origins

    def slopes(self, q: Array, points: Array, normals: Array, links: NDArray[np.intp]) -> Array:
        """How quickly pairs of links (n, 2) part along normals (n, 3) at points (n, 3), shape (n, dof)."""
        turns, origins = self.poses(q)
        axes = np.einsum("njab,jb->nja", turns[:, 1:], self._axes)
        velocities = np.where(self._slides[:, None], axes, _cross(axes, points[:, None] - origins[:, 1:]))
        carries = self.moves[links[:, 0]].astype(float) - self.moves[links[:, 1]]
        return np.asarray((np.einsum("nja,na->nj", velocities, normals) * carries) @ self.coupling)

    def leverage(self, links: NDArray[np.intp], far: Array) -> Array:
        """Bound of how quickly the distance of pairs of links (k, 2) changes with the degrees of freedom, (dof, k).

        `far`, shape (k, 2), is how far each link reaches from its frame [m].
        """
        first, second = self.moves[links[:, 0]], self.moves[links[:, 1]]
        ends = self._along[links] + far
        arms = np.where(first, ends[:, :1], ends[:, 1:]) - self._along[1:]
        arms = np.where(self._slides, 1.0, arms)
        return np.asarray(np.abs(self.coupling).T @ np.where(first != second, arms, 0.0).T)


def _cross(a: Array, b: Array) -> Array:
    """Cross products (..., 3) as NumPy has them, which takes twice the time for a few."""
    product = np.empty(a.shape)
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        product[..., i] = a[..., j] * b[..., k] - a[..., k] * b[..., j]
    return product


class Solids:
    """Hulls of an arm or a group and a table at a height [m], as arrays for compiled code."""

    def __init__(self, tree: LinkTree, hulls: Sequence[Hull], table: float):
        self.hulls, self.table, self._tree = tuple(hulls), table, tree
        joints = np.array([hull.joint for hull in hulls], dtype=np.int64)
        self._links = np.append(joints, 0)  # the last is the table, fixed to the base
        self._skins = np.array([*(hull.skin for hull in hulls), 0.0])
        ends = np.array([(hull.corners.min(axis=0), hull.corners.max(axis=0)) for hull in hulls]).reshape(-1, 2, 3)
        self._arrays = (
            np.concatenate([np.empty((0, 3)), *(hull.corners for hull in hulls)]),
            np.cumsum([0, *(len(hull.corners) for hull in hulls)]),
            joints,
            0.5 * (ends[:, 0] + ends[:, 1]),
            0.5 * (ends[:, 1] - ends[:, 0]),
        )

    def maybe_near(self, q: Array, pairs: Pairs, margin: float | Array) -> NDArray[np.bool_]:
        """Return whether pairs may be within a margin [m], common or per pair, (n, pairs), for q (n, dof)."""
        return np.asarray(
            self.distance_bounds(q, pairs, margin, np.ones((len(q), len(pairs)), dtype=np.bool_)) <= margin
        )

    def distance_bounds(self, q: Array, pairs: Pairs, sufficient: float | Array, mask: NDArray[np.bool_]) -> Array:
        """Lower bound of the distances of pairs [m], shape (n, pairs); not refined where it exceeds `sufficient`."""
        bounds, skins = np.full((len(q), len(pairs)), -np.inf), self._skins[pairs].sum(axis=1)
        _fill_distance_bounds(*self._tree.poses(q), *self._arrays, pairs, sufficient + skins, self.table, mask, bounds)
        return np.asarray(bounds - skins)

    def leverage(self, pairs: Pairs) -> Array:
        """Return bounds of the derivatives of the distances, (dof, pairs) [m/rad or 1]."""
        far = np.array([*(np.linalg.norm(hull.corners, axis=1).max() for hull in self.hulls), 0.0])
        return self._tree.leverage(self._links[pairs], far[pairs])

    def distances(
        self, q: Array, pairs: Pairs, mask: NDArray[np.bool_], depths: bool = True
    ) -> tuple[Array, Array, Array]:
        """Signed distances, normals and points of the pairs in `mask`, in the order of ``np.argwhere(mask)``."""
        rows, columns = np.nonzero(mask)
        distances, normals, points = np.empty(len(rows)), np.empty((len(rows), 3)), np.empty((len(rows), 3))
        request, result = coal.DistanceRequest(), coal.DistanceResult()
        request.enable_signed_distance = depths
        used, which = np.unique(rows, return_inverse=True) if len(q) > 1 else (np.zeros(1, dtype=np.intp), rows)
        turns, origins = self._tree.poses(q[used])
        indices, places = pairs.tolist(), {(row, 0): coal.Transform3s() for row in range(len(used))}
        for k, (row, column) in enumerate(zip(which.tolist(), columns.tolist(), strict=True)):
            a, b = indices[column]
            if b == TABLE:
                distances[k], normals[k], points[k] = self._above_table(a, turns[row], origins[row])
                continue
            of_a, of_b = self.hulls[a], self.hulls[b]
            for joint in (of_a.joint, of_b.joint):
                if (row, joint) not in places:
                    places[row, joint] = coal.Transform3s(turns[row, joint], origins[row, joint])
            result.clear()
            place_a, place_b = places[row, of_a.joint], places[row, of_b.joint]
            distances[k] = coal.distance(of_a.solid, place_a, of_b.solid, place_b, request, result)
            normals[k], points[k] = -result.normal, result.getNearestPoint1()
        return distances - self._skins[pairs[columns]].sum(axis=1), normals, points

    def slopes(self, q: Array, pairs: Pairs, mask: NDArray[np.bool_], normals: Array, points: Array) -> Array:
        """Derivatives of these distances in the configuration, shape (k, dof), for what `distances` returned."""
        rows, columns = np.nonzero(mask)
        return self._tree.slopes(q[rows], points, normals, self._links[pairs[columns]])

    def at_rest(self, first: int, second: int) -> float:
        """Signed distance of two hulls that are fixed to the base [m]."""
        pair, zero = np.array([[first, second]]), np.zeros((1, self._tree.coupling.shape[1]))
        return float(self.distances(zero, pair, np.ones((1, 1), dtype=bool))[0][0])

    def _above_table(self, hull: int, turns: Array, origins: Array) -> tuple[float, tuple[float, float, float], Array]:
        joint = self.hulls[hull].joint
        corners = self.hulls[hull].corners @ turns[joint].T + origins[joint]
        lowest = corners[np.argmin(corners[:, 2])]
        return lowest[2] - self.table, (0.0, 0.0, 1.0), lowest


class Watch:
    """Repeated queries of `Collisions.gradient` with a threshold [m]."""

    def __init__(self, solids: Solids, pairs: Pairs, threshold: float, share: Array, cached: bool = False):
        self._solids, self._pairs, self._threshold, self._share = solids, pairs, threshold * share, share
        self._sufficient = (
            self._threshold + 0.03 if cached else self._threshold
        )  # farther pairs are skipped for a while
        self._leverage = solids.leverage(pairs) if cached else None
        self._q, self._bounds = np.empty((0, 0)), np.empty((0, 0))

    def gradient(self, q: Array) -> tuple[NDArray[np.intp], Array, Array]:
        """Return rows, distances and derivatives for configurations (n, dof)."""
        near = self._near(q)
        distance, normals, points = self._solids.distances(q, self._pairs, near)
        slope = self._solids.slopes(q, self._pairs, near, normals, points)
        self._bounds[near] = np.maximum(self._bounds[near], distance - 1e-5)  # Coal's tolerance
        rows, columns = np.nonzero(near)
        kept = distance < self._threshold[columns]
        share = self._share[columns[kept]]
        return rows[kept], distance[kept] / share, slope[kept] / share[:, None]

    def free(self, q: Array, padding: float) -> bool:
        """Return whether all pairs are farther apart than `padding` [m] at configurations (n, dof)."""
        limit = padding * self._share
        if self._leverage is None or not len(self._q):
            left = np.ones((len(q), len(self._pairs)), dtype=np.bool_)
        else:
            left = self._bounds[0] - np.abs(q - self._q[0]) @ self._leverage <= limit
        if left.any():
            left &= self._solids.distance_bounds(q, self._pairs, limit, left) <= limit
        if not left.any():
            return True
        distances = self._solids.distances(q, self._pairs, left, depths=False)[0]
        return bool((distances > limit[np.nonzero(left)[1]]).all())

    def _near(self, q: Array) -> NDArray[np.bool_]:
        """Whether pairs may be within the threshold, shape (n, pairs)."""
        if self._leverage is None or self._q.shape != q.shape:
            bounds = np.full((len(q), len(self._pairs)), -np.inf)
        else:
            bounds = self._bounds - np.abs(q - self._q) @ self._leverage
        left = bounds <= self._threshold
        rows = np.flatnonzero(left.any(axis=1))
        seen = self._solids.distance_bounds(q[rows], self._pairs, self._sufficient, left[rows])
        bounds[rows] = np.where(left[rows], seen, bounds[rows])
        self._q, self._bounds = q.copy(), bounds
        return np.asarray(bounds <= self._threshold)


@kernel
def _fill_distance_bounds(  # type: ignore[no-untyped-def]
    all_turns, all_origins, corners, starts, joints, centres, sides, pairs, sufficient, table, mask, bounds
):
    """Fill lower bounds of the distances of pairs; bounds above `sufficient` are not refined."""
    middles, radii = np.empty((len(joints), 3)), np.empty(len(joints))
    for h in range(len(joints)):  # by entry: Numba compiles a sum along an axis 1.6 s longer
        radii[h] = np.sqrt(sides[h, 0] * sides[h, 0] + sides[h, 1] * sides[h, 1] + sides[h, 2] * sides[h, 2])
    for n in range(len(all_turns)):
        turns, origins = all_turns[n], all_origins[n]
        for h in range(len(joints)):
            j = joints[h]
            for i in range(3):
                middles[h, i] = origins[j, i] + (
                    turns[j, i, 0] * centres[h, 0] + turns[j, i, 1] * centres[h, 1] + turns[j, i, 2] * centres[h, 2]
                )
        for p in range(len(pairs)):
            if not mask[n, p]:
                continue
            a, b = pairs[p]
            j = joints[a]
            if b < 0:
                height = middles[a, 2] - radii[a] - table
                if height <= sufficient[p]:
                    up = turns[j, 2]
                    height = origins[j, 2] - table + _least(corners, starts[a], starts[a + 1], up[0], up[1], up[2])[0]
                bounds[n, p] = height
                continue
            x, y, z = middles[a, 0] - middles[b, 0], middles[a, 1] - middles[b, 1], middles[a, 2] - middles[b, 2]
            bounds[n, p] = np.sqrt(x * x + y * y + z * z) - radii[a] - radii[b]
            if bounds[n, p] <= sufficient[p]:
                bounds[n, p] = _apart(
                    turns[j], origins[j], turns[joints[b]], origins[joints[b]], corners, sides[a], sides[b],
                    starts[a], starts[a + 1], starts[b], starts[b + 1], x, y, z, sufficient[p],
                )  # fmt: skip


@part
def _least(corners, first, last, x, y, z):  # type: ignore[no-untyped-def]
    """Smallest product of a direction with corners, and the index of the corner."""
    least, where = np.inf, first
    for i in range(first, last):
        value = x * corners[i, 0] + y * corners[i, 1] + z * corners[i, 2]
        if value < least:
            least, where = value, i
    return least, where


@part
def _apart(  # type: ignore[no-untyped-def]
    turn_a, at_a, turn_b, at_b, corners, sides_a, sides_b, a0, a1, b0, b1, x, y, z, sufficient
):
    """Distance of two hulls along separating directions: the first above `sufficient`, or the largest."""
    from_middle, most = (x, y, z), -1.0
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
        spread = abs(ax) * sides_a[0] + abs(ay) * sides_a[1] + abs(az) * sides_a[2]
        spread += abs(bx) * sides_b[0] + abs(by) * sides_b[1] + abs(bz) * sides_b[2]
        of_boxes = x * from_middle[0] + y * from_middle[1] + z * from_middle[2] - spread
        most = max(most, of_boxes / length - 1e-9)  # rounding
        if most > sufficient:
            break
        least_a, i = _least(corners, a0, a1, ax, ay, az)
        least_b, j = _least(corners, b0, b1, -bx, -by, -bz)
        between = x * (at_a[0] - at_b[0]) + y * (at_a[1] - at_b[1]) + z * (at_a[2] - at_b[2]) + least_a + least_b
        most = max(most, between / length - 1e-9)
        if most > sufficient:
            break
        w0 = at_a[0] - at_b[0]
        w1 = at_a[1] - at_b[1]
        w2 = at_a[2] - at_b[2]
        for m in range(3):
            w0 += turn_a[0, m] * corners[i, m] - turn_b[0, m] * corners[j, m]
            w1 += turn_a[1, m] * corners[i, m] - turn_b[1, m] * corners[j, m]
            w2 += turn_a[2, m] * corners[i, m] - turn_b[2, m] * corners[j, m]
        u0, u1, u2 = x - w0, y - w1, z - w2
        change = u0 * u0 + u1 * u1 + u2 * u2
        if not change > 0.0:
            break
        step = min(1.0, max(0.0, (x * u0 + y * u1 + z * u2) / change))
        x, y, z = x - step * u0, y - step * u1, z - step * u2
    return most
