"""Convex hulls of an arm's links."""

from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from typing import Any

import coal
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from maniport.bodies.arm import Arm
from maniport.bodies.chain import Chain, Mesh
from maniport.bodies.looks import Look
from maniport.bodies.looks.meshes import joined, reduced
from maniport.validation import Array

MOST_CORNERS = 96
"""A support point is looked for among all of them; a hull with more loses those that stand out least."""

_FINE_ENOUGH = 1e-4
"""A hull gets no further corners once none stands out by more [m]."""

_THIN = 5e-4
"""What lies in a plane or on a line is made so much thicker on each side [m]."""

_MANY = 500
"""Of more points those within the hull of extreme ones are dropped before the hull of all is computed."""

_SLICES = 6
_WORTH_CUTTING = 0.85
"""A link is cut in two, at one of the planes between slices of equal thickness, when that leaves less of its volume."""

_SKETCH = 300
"""Number of triangles of the mesh on which cuts are chosen."""

FINE_CORNERS = 256
MOST_PIECES = 8
_WORTH_A_PIECE = 0.97
"""The same for links whose hulls meet others more often than their meshes do."""


@dataclass(frozen=True, eq=False, repr=False)
class Hull:
    """A convex solid that moves with one joint of an arm.

    Attributes
    ----------
    name : str
        Of the link, or of the box.
    joint : int
        It is fixed after so many joints of the chain; 0: to the base.
    corners : ndarray, shape (k, 3)
        In that joint's frame [m].
    skin : float
        Within this distance of the corners' hull lies all that the solid stands for [m].
    solid : coal.Convex
        The corners' hull.
    """

    name: str
    joint: int
    corners: Array
    skin: float
    solid: coal.Convex

    @classmethod
    def around(cls, name: str, joint: int, points: Array, most: int = MOST_CORNERS) -> "Hull":
        """The hull of points [m], with a limited number of corners."""
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
    """The shape of one body, or of a finger from open to closed, on the joint of a chain that moves it.

    Attributes
    ----------
    name : str
        Of the link.
    joint : int
        After how many joints of the chain.
    mesh : Mesh
        In that joint's frame [m]; of a finger the hull of all of its poses.
    own : bool
        Whether it is on the chain; False for bodies that are attached to it.
    """

    name: str
    joint: int
    mesh: Mesh
    own: bool


def parts_of(arm: Arm) -> tuple[Part, ...]:
    """Collect the shapes of an arm and of all bodies attached to it, in the order of the chain."""
    return _parts(arm.look)


@lru_cache(maxsize=16)
def _parts(look: Look) -> tuple[Part, ...]:
    meshes: dict[str, list[Mesh]] = {}
    for link, mesh in look.shapes():
        meshes.setdefault(link, []).append(mesh)
    frames, attached = look.chain.frames, look.chain.attached
    links = sorted(meshes, key=lambda name: (frames[name].joint, len(_fixed_to(look.chain, name))))
    own = [Part(link, frames[link].joint, joined(meshes[link]), True) for link in links]
    posed: dict[tuple[str, int], list[Mesh]] = {}
    for name, (points, triangles) in look.attached()[0].items() if own else ():
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
    carrier = next((name for name in _fixed_to(arm.chain, arm.frame) if name in _shown(arm.look)), None)
    tip = (*frames[arm.frame].placement[:3, 3].tolist(),) if part.own and part.name == carrier else None
    return _hulls(part, fine, tip)


@lru_cache(maxsize=512)
def _hulls(part: Part, fine: bool, tip: tuple[float, ...] | None) -> tuple["Hull", ...]:
    pieces = _pieces(part.mesh, fine)
    if tip is not None:
        end = np.array([tip])
        nearest = int(np.argmin([np.linalg.norm(piece - end, axis=1).min() for piece in pieces]))
        pieces[nearest] = np.concatenate([pieces[nearest], end])
    return tuple(Hull.around(part.name, part.joint, piece, FINE_CORNERS if fine else MOST_CORNERS) for piece in pieces)


def _shown(look: Look) -> set[str]:
    return {link for link, _ in look.shapes()}


def _pieces(mesh: Mesh, fine: bool) -> list[Array]:
    """Points of a link, cut across where that makes the hulls smaller than that of the whole."""
    points, triangles = reduced(mesh, _SKETCH) if len(mesh[1]) > _SKETCH else mesh
    pieces = [_Piece.of(points[triangles], ())]
    worth, most = (_WORTH_A_PIECE, MOST_PIECES) if fine else (_WORTH_CUTTING, 2)
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
    """Triangles (n, 3, 3) of a link on one side of some planes, the corners of their hull and its volume.

    A plane is an axis, where it crosses it, and the side: 0 below, 1 above.
    """

    triangles: Array
    planes: tuple[tuple[int, float, int], ...]
    outline: Array
    volume: float

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
            places = np.linspace(low[axis], high[axis], _SLICES + 1)[1:-1]
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
        """The same piece of other triangles (n, 3, 3)."""
        for axis, at, side in self.planes:
            triangles = _cut(triangles, axis, at)[side]
        return triangles


def _cut(triangles: Array, axis: int, at: float) -> tuple[Array, Array]:
    """The parts of triangles (n, 3, 3) below and above a plane across an axis, as triangles."""
    above = triangles[..., axis] > at
    count = above.sum(axis=1)
    crossing = (count > 0) & (count < 3)
    split, upper = triangles[crossing], above[crossing]
    lone = np.argmax(upper == (upper.sum(axis=1) == 1)[:, None], axis=1)  # the corner with a side for itself
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
    """Corners of the hull of points; those of something a little thicker where they lie in a plane or on a line."""
    try:
        if len(points) > _MANY:  # Qhull needs most of its time for points inside
            faces = ConvexHull(points[_extreme(points)]).equations
            points = points[(points @ faces[:, :3].T + faces[:, 3] > -1e-9).any(axis=1)]
        return np.asarray(points[ConvexHull(points).vertices])
    except QhullError:
        points = np.concatenate([points + _THIN * np.array(corner) for corner in product((-1, 1), repeat=3)])
        return np.asarray(points[ConvexHull(points).vertices])


def _fixed_to(chain: Chain, frame: str) -> list[str]:
    """A frame and those on the same joint that it is attached to, one behind the other."""
    frames, names = chain.frames, [frame]
    while (above := frames[names[-1]].parent) is not None:
        if above in names or above not in frames or frames[above].joint != frames[frame].joint:
            break
        names.append(above)
    return names


def _extreme(points: Array) -> NDArray[np.intp]:
    """Indices of the points that are farthest along 26 directions."""
    ways = np.array([way for way in product((-1, 0, 1), repeat=3) if any(way)])
    return np.unique(np.argmax(points @ ways.T, axis=0))


def _outstanding(outline: Array, most: int) -> Array:
    """Corners of a hull, or as many as are allowed: in rounds those that stand out most from the hull of the others."""
    if len(outline) <= most:
        return outline
    chosen = _extreme(outline)
    while len(chosen) < most:
        faces = ConvexHull(outline[chosen]).equations
        beyond = outline @ faces[:, :3].T + faces[:, 3]
        farthest = np.argmax(beyond, axis=0)
        out = np.where(np.isin(farthest, chosen), 0.0, beyond[farthest, np.arange(len(faces))])
        best = [face for face in np.argsort(-out, kind="stable") if out[face] > _FINE_ENOUGH]
        if not best:
            break
        room = min(most - len(chosen), 1 + len(best) // 4)  # a corner taken may spare its neighbours
        chosen = np.unique(np.concatenate([chosen, farthest[best[:room]]]))
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
