"""Convex hulls of an arm's links."""

from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from typing import Any, NamedTuple

import coal
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from maniport.arms.arm import Arm
from maniport.arms.chain import Chain, Mesh
from maniport.arms.meshes import Geometry, joined, reduced
from maniport.errors import FileFormatError
from maniport.util.validation import Array


@dataclass(frozen=True, eq=False, repr=False)
class Hull:
    """A convex solid that moves with one joint of an arm."""

    name: str  # of the link, or of the box
    joint: int  # number of joints of the chain that move it; 0: fixed to the base
    corners: Array  # (k, 3), in that joint's frame [m]
    skin: float  # largest distance of the enclosed points from the hull of the corners [m]
    solid: coal.Convex  # the corners' hull

    @classmethod
    def around(cls, name: str, joint: int, points: Array, most: int = 96) -> "Hull":
        """Enclose points [m] in a hull of at most `most` corners; the least prominent are omitted."""
        outline = _outline(points)
        corners = _outstanding(outline, most)
        hull = ConvexHull(corners)
        number = np.empty(len(corners), dtype=int)
        number[hull.vertices] = np.arange(len(hull.vertices))
        corners = np.ascontiguousarray(corners[hull.vertices])
        solid = _solid(corners, number[hull.simplices])
        outside = outline[(outline @ hull.equations[:, :3].T + hull.equations[:, 3] > 0.0).any(axis=1)]
        skin = 0.0 if len(outline) == len(corners) else _farthest(solid, outside)
        return cls(name, joint, corners, skin, solid)

    def __repr__(self) -> str:
        return f"Hull({self.name!r}, {len(self.corners)} corners)"


@dataclass(frozen=True, eq=False, repr=False)
class Part:
    """Shape of a body, or of a finger from open to closed, and the joint of the chain that moves it."""

    name: str  # of the link
    joint: int  # number of joints of the chain that move it
    mesh: Mesh  # in the frame of the last of them [m]; of a finger the hull of all poses
    own: bool  # whether it is on the chain; False for attached bodies


def parts_of(arm: Arm) -> tuple[Part, ...]:
    """Collect the shapes of an arm and of all bodies attached to it, in the order of the chain."""
    return _parts(arm.geometry)


@lru_cache(maxsize=16)
def _parts(geometry: Geometry) -> tuple[Part, ...]:
    meshes: dict[str, list[Mesh]] = {}
    for link, mesh in geometry.shapes:
        meshes.setdefault(link, []).append(mesh)
    frames, attached = geometry.chain.frames, geometry.chain.attached
    links = sorted(meshes, key=lambda name: (frames[name].joint, len(_fixed_to(geometry.chain, name))))
    own = [Part(link, frames[link].joint, joined(meshes[link]), True) for link in links]
    posed: dict[tuple[str, int], list[Mesh]] = {}
    for name, (points, triangles) in geometry.attached[0].items() if own else ():
        body = attached[name]
        swept = len(body.placements) > 1
        points = _outline(points) if swept else points
        moved = [points @ place[:3, :3].T + place[:3, 3] for place in body.placements]
        mesh = _hull_mesh(np.concatenate(moved)) if swept else (moved[0], triangles)
        posed.setdefault((body.group, body.joint), []).append(mesh)
    others = [Part(name, joint, joined(parts), False) for (name, joint), parts in posed.items()]
    return tuple(sorted([*own, *others], key=lambda part: part.joint))


def _hull_mesh(points: Array) -> Mesh:
    """The convex hull of points as a mesh."""
    hull = ConvexHull(_outline(points))
    return hull.points, hull.simplices.astype(np.int32)


def hulls_of(arm: Arm, part: Part, fine: bool = False) -> tuple["Hull", ...]:
    """Enclose a part of an arm in one hull, or two where it is bent; with `fine` in up to eight."""
    frames = arm.chain.frames
    links = {link for link, _ in arm.geometry.shapes}
    carrier = next((name for name in _fixed_to(arm.chain, arm.frame) if name in links), None)
    tip = (*frames[arm.frame].placement[:3, 3].tolist(),) if part.own and part.name == carrier else None
    return _hulls(part, fine, tip)


@lru_cache(maxsize=512)
def _hulls(part: Part, fine: bool, tip: tuple[float, ...] | None) -> tuple["Hull", ...]:
    pieces = _pieces(part.mesh, fine)
    if tip is not None:
        end = np.array([tip])
        nearest = int(np.argmin([np.linalg.norm(piece - end, axis=1).min() for piece in pieces]))
        pieces[nearest] = np.concatenate([pieces[nearest], end])
    return tuple(Hull.around(part.name, part.joint, piece, 256 if fine else 96) for piece in pieces)


def _pieces(mesh: Mesh, fine: bool) -> list[Array]:
    """Points of a link, in several pieces if their hulls are smaller than that of the whole."""
    points, triangles = reduced(mesh, 300) if len(mesh[1]) > 300 else mesh  # cuts are chosen on a coarse mesh
    pieces = [_Piece.of(points[triangles], ())]
    worth, most = (0.97, 8) if fine else (0.85, 2)  # largest volume after a cut, as a fraction
    whole: list[_Piece] = []
    while pieces and len(pieces) + len(whole) < most:
        piece = pieces.pop(int(np.argmax([piece.volume for piece in pieces])))
        halves = piece.halves(any_axis=fine)
        smaller = sum(half.volume for half in halves) < worth * piece.volume
        pieces += halves if smaller else []
        whole += [] if smaller else [piece]
    corners = mesh[0][mesh[1]] if len(pieces + whole) > 1 else mesh[0]
    cut = [piece.taken_from(corners) for piece in pieces + whole]
    return [_outline(part.reshape(-1, 3)) for part in cut if len(part)]


@dataclass(frozen=True, eq=False)
class _Piece:
    """Triangles of a link on one side of some planes."""

    triangles: Array  # (n, 3, 3)
    planes: tuple[tuple[int, float, int], ...]  # axis, where the plane crosses it, and the side: 0 below, 1 above
    outline: Array  # corners of their hull
    volume: float  # of the hull

    @classmethod
    def of(cls, triangles: Array, planes: tuple[tuple[int, float, int], ...]) -> "_Piece":
        outline = _outline(triangles.reshape(-1, 3))
        return cls(triangles, planes, outline, ConvexHull(outline).volume)

    def halves(self, any_axis: bool) -> list["_Piece"]:
        """Cut between slices of equal thickness, where both hulls together are smallest."""
        low, high = self.outline.min(axis=0), self.outline.max(axis=0)
        best: tuple[Any, ...] = ()
        least = np.inf
        for axis in range(3) if any_axis else [int(np.argmax(high - low))]:
            places = np.linspace(low[axis], high[axis], 7)[1:-1]
            slices, rest = [], self.triangles
            for at in places:
                below, rest = _cut(rest, axis, at)
                slices.append(below)
            slices.append(rest)
            outlines = [_outline(part.reshape(-1, 3)) if len(part) else part.reshape(-1, 3) for part in slices]
            for k, at in enumerate(places, start=1):
                halves = [np.concatenate(outlines[:k]), np.concatenate(outlines[k:])]
                volume = sum(ConvexHull(half).volume if len(half) else np.inf for half in halves)
                if volume < least:
                    least, best = volume, (np.concatenate(slices[:k]), np.concatenate(slices[k:]), axis, float(at))
        if not best:
            return [self]
        *sides, axis, at = best
        return [_Piece.of(side, (*self.planes, (axis, at, i))) for i, side in enumerate(sides)]

    def taken_from(self, triangles: Array) -> Array:
        """Return the same piece of other triangles (n, 3, 3)."""
        for axis, at, side in self.planes:
            triangles = _cut(triangles, axis, at)[side]
        return triangles


def _cut(triangles: Array, axis: int, at: float) -> tuple[Array, Array]:
    """The parts of triangles (n, 3, 3) below and above a plane across an axis, as triangles."""
    above = triangles[..., axis] > at
    count = above.sum(axis=1)
    crossing = (count > 0) & (count < 3)
    split, upper = triangles[crossing], above[crossing]
    lone = np.argmax(upper == (upper.sum(axis=1) == 1)[:, None], axis=1)  # the corner alone on its side
    rows = np.arange(len(split))
    a, b, c = (split[rows, (lone + k) % 3] for k in range(3))
    share = [(at - a[:, axis]) / (end[:, axis] - a[:, axis]) for end in (b, c)]
    ab, ac = (a + part[:, None] * (end - a) for part, end in zip(share, (b, c), strict=True))
    tips, stumps = np.stack([a, ab, ac], axis=1), [np.stack([ab, b, c], axis=1), np.stack([ab, c, ac], axis=1)]
    tip_above = upper[rows, lone]
    below_plane = [triangles[count == 0], tips[~tip_above], *(stump[tip_above] for stump in stumps)]
    above_plane = [triangles[count == 3], tips[tip_above], *(stump[~tip_above] for stump in stumps)]
    return np.concatenate(below_plane), np.concatenate(above_plane)


def _outline(points: Array) -> Array:
    """Corners of the hull of points, thickened if the points are in a plane or on a line."""
    try:
        if len(points) > 500:  # Qhull is slow for interior points
            faces = ConvexHull(points[_extreme(points)]).equations
            points = points[(points @ faces[:, :3].T + faces[:, 3] > -1e-9).any(axis=1)]
        return np.asarray(points[ConvexHull(points).vertices])
    except QhullError:
        points = np.concatenate([points + 5e-4 * np.array(corner) for corner in product((-1, 1), repeat=3)])
        return np.asarray(points[ConvexHull(points).vertices])


def _fixed_to(chain: Chain, frame: str) -> list[str]:
    """A frame and its ancestors on the same joint."""
    frames, names = chain.frames, [frame]
    while (above := frames[names[-1]].parent) is not None:
        if above in names or above not in frames or frames[above].joint != frames[frame].joint:
            break
        names.append(above)
    return names


def _extreme(points: Array) -> NDArray[np.intp]:
    """Indices of the points that are farthest along 26 directions."""
    directions = np.array([direction for direction in product((-1, 0, 1), repeat=3) if any(direction)])
    return np.unique(np.argmax(points @ directions.T, axis=0))


def _outstanding(outline: Array, most: int) -> Array:
    """At most `most` corners of a hull, iteratively the most prominent from the hull of the others."""
    if len(outline) <= most:
        return outline
    chosen = _extreme(outline)
    while len(chosen) < most:
        faces = ConvexHull(outline[chosen]).equations
        beyond = outline @ faces[:, :3].T + faces[:, 3]
        farthest = np.argmax(beyond, axis=0)
        out = np.where(np.isin(farthest, chosen), 0.0, beyond[farthest, np.arange(len(faces))])
        best = [face for face in np.argsort(-out, kind="stable") if out[face] > 1e-4]
        if not best:
            break
        count = min(most - len(chosen), 1 + len(best) // 4)  # a new corner may make its neighbors redundant
        chosen = np.unique(np.concatenate([chosen, farthest[best[:count]]]))
    return np.asarray(outline[chosen])


def _solid(corners: Array, triangles: np.ndarray) -> coal.Convex:
    points, faces = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
    for corner in corners:
        points.append(corner)
    for a, b, c in triangles.tolist():
        faces.append(coal.Triangle(a, b, c))
    return coal.Convex(points, faces)


def _farthest(solid: coal.Convex, points: Array) -> float:
    """The largest distance of points from a solid."""
    here, there, sphere = coal.Transform3s(), coal.Transform3s(), coal.Sphere(0.0)
    request, result, farthest = coal.DistanceRequest(), coal.DistanceResult(), 0.0
    for point in points:
        there.setTranslation(point)
        result.clear()
        farthest = max(farthest, coal.distance(solid, here, sphere, there, request, result))
    return farthest


class Lowest(NamedTuple):
    """Lowest point of a link during a motion: its height in the base frame [m], and when [s]."""

    link: str
    height: float
    time: float


def lowest_points(arm: Arm, time: Array, q: Array) -> tuple[Lowest, ...]:
    """Compute the lowest point of each moving link's convex hull over a motion."""
    try:
        hulls = [hull for part in parts_of(arm) if part.joint for hull in hulls_of(arm, part)]
    except FileFormatError:
        return ()
    poses = arm.link_poses(q)
    lowest: dict[str, Lowest] = {}
    for hull in hulls:
        vertical = poses[:, hull.joint, 2]
        heights = (vertical[:, :3] @ hull.corners.T).min(axis=1) + vertical[:, 3] - hull.skin
        i = int(np.argmin(heights))
        point = Lowest(hull.name, float(heights[i]), float(time[i]))
        lowest[hull.name] = min(lowest.get(hull.name, point), point, key=lambda point: point.height)
    return tuple(sorted(lowest.values(), key=lambda point: point.height))
