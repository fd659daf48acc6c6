"""Convex hulls of an arm's links."""

from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import product, takewhile
from typing import NamedTuple

import coal
import numpy as np
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
        corners = outline = _outline(points)
        if len(outline) > most:
            chosen = _extreme(outline)
            while len(chosen) < most:  # add the most prominent from the hull of the others
                faces = ConvexHull(outline[chosen]).equations
                beyond = outline @ faces[:, :3].T + faces[:, 3]
                farthest = np.argmax(beyond, axis=0)
                out = np.where(
                    np.isin(farthest, chosen), 0.0, beyond[farthest, np.arange(len(faces))]
                )
                best = [face for face in np.argsort(-out, kind="stable") if out[face] > 1e-4]
                if not best:
                    break
                count = min(
                    most - len(chosen), 1 + len(best) // 4
                )  # a new corner may make its neighbors redundant
                chosen = np.unique(np.concatenate([chosen, farthest[best[:count]]]))
            corners = outline[chosen]
        vertices, skin = coal.StdVec_Vec3s(), 0.0
        vertices.extend(list(corners))
        solid = coal.Convex.convexHull(vertices, True, "Qt")
        corners = np.ascontiguousarray(solid.points())
        if len(outline) > len(corners):
            here, there, sphere = coal.Transform3s(), coal.Transform3s(), coal.Sphere(0.0)
            request, result, faces = (
                coal.DistanceRequest(),
                coal.DistanceResult(),
                ConvexHull(corners).equations,
            )
            for point in outline[(outline @ faces[:, :3].T + faces[:, 3] > 0.0).any(axis=1)]:
                there.setTranslation(point)
                result.clear()
                skin = max(skin, coal.distance(solid, here, sphere, there, request, result))
        return cls(name, joint, corners, skin, solid)


@dataclass(frozen=True, eq=False, repr=False)
class Part:
    """Shape of a body, or of a finger from open to closed, and the joint of the chain that moves it."""

    name: str  # of the link
    joint: int  # number of joints of the chain that move it
    mesh: Mesh  # in the frame of the last of them [m]; of a finger the hull of all poses
    own: bool = False  # whether it is on the chain, not attached to it
    end_position: Array | None = (
        None  # (3,) of the end effector if it carries it, which hulls enclose [m]
    )


@lru_cache(maxsize=16)
def parts_of(geometry: Geometry) -> tuple[Part, ...]:
    """Collect the shapes of an arm and of all bodies attached to it, in the order of the chain."""
    chain, meshes, attached = geometry.chain, geometry.shapes, geometry.chain.attached
    carrier = next((name for name in _fixed_to(chain, chain.frame) if name in meshes), None)
    end_position = chain.frames[chain.frame].placement[:3, 3]
    links = sorted(meshes, key=lambda name: (chain.frames[name].joint, len(_fixed_to(chain, name))))
    own = [
        Part(link, chain.frames[link].joint, meshes[link], True, end_position if link == carrier else None)
        for link in links
    ]  # fmt: skip
    posed: dict[tuple[str, int], list[Mesh]] = {}
    for name, (points, triangles) in geometry.attached[0].items() if own else ():
        body = attached[name]
        swept = len(body.placements) > 1
        points = _outline(points) if swept else points
        points = np.concatenate(
            [points @ place[:3, :3].T + place[:3, 3] for place in body.placements]
        )
        if swept:
            hull = ConvexHull(_outline(points))
            points, triangles = hull.points, hull.simplices.astype(np.int32)
        posed.setdefault((body.group, body.joint), []).append((points, triangles))
    others = [Part(name, joint, joined(parts)) for (name, joint), parts in posed.items()]
    return tuple(sorted([*own, *others], key=lambda part: part.joint))


@lru_cache(maxsize=512)
def hulls_of(part: Part, fine: bool = False) -> tuple[Hull, ...]:
    """Enclose a part in one hull, or two where it is bent; with `fine` in up to eight."""
    mesh = part.mesh
    points, triangles = reduced(mesh, 300)  # cuts are chosen on a coarse mesh
    pieces = [_Piece(points[triangles], ())]
    worth, most = (0.97, 8) if fine else (0.85, 2)  # largest volume after a cut, as a fraction
    whole: list[_Piece] = []
    while pieces and len(pieces) + len(whole) < most:
        piece = pieces.pop(int(np.argmax([piece.volume for piece in pieces])))
        halves = piece.halves(any_axis=fine)
        smaller = sum(half.volume for half in halves) < worth * piece.volume
        pieces += halves if smaller else []
        whole += [] if smaller else [piece]
    outlines = []
    for piece in pieces + whole:
        corners = mesh[0][mesh[1]] if piece.planes else mesh[0]
        for axis, at, side in piece.planes:
            corners = _cut(corners, axis, at)[side]
        if len(corners):
            outlines.append(_outline(corners.reshape(-1, 3)))
    if (end := part.end_position) is not None:
        nearest = int(
            np.argmin([np.linalg.norm(outline - end, axis=1).min() for outline in outlines])
        )
        outlines[nearest] = np.concatenate([outlines[nearest], [end]])
    return tuple(
        Hull.around(part.name, part.joint, outline, 256 if fine else 96) for outline in outlines
    )


@dataclass(frozen=True, eq=False)
class _Piece:
    """Triangles of a link on one side of some planes."""

    triangles: Array  # (n, 3, 3)
    planes: tuple[
        tuple[int, float, int], ...
    ]  # axis, where the plane crosses it, and the side: 0 below, 1 above

    @cached_property
    def volume(self) -> float:
        """Volume of the convex hull [m³]."""
        return float(ConvexHull(_outline(self.triangles.reshape(-1, 3))).volume)

    def halves(self, any_axis: bool) -> list["_Piece"]:
        """Cut at the fraction of the length, in sixths, where both hulls together are smallest."""
        low, high = self.triangles.min(axis=(0, 1)), self.triangles.max(axis=(0, 1))
        cuts = [[self]]
        for axis in range(3) if any_axis else [int(np.argmax(high - low))]:
            for at in np.linspace(low[axis], high[axis], 7)[1:-1].tolist():
                sides = _cut(self.triangles, axis, at)
                if all(map(len, sides)):
                    cuts.append(
                        [
                            _Piece(side, (*self.planes, (axis, at, i)))
                            for i, side in enumerate(sides)
                        ]
                    )
        return min(cuts[1:] or cuts, key=lambda pieces: sum(piece.volume for piece in pieces))


def _cut(triangles: Array, axis: int, at: float) -> tuple[Array, Array]:
    """Split triangles (n, 3, 3) by a plane normal to an axis; return those below and above."""
    above = triangles[..., axis] > at
    count = above.sum(axis=1)
    crossing = (count > 0) & (count < 3)
    split, upper = triangles[crossing], above[crossing]
    lone = np.argmax(
        upper == (upper.sum(axis=1) == 1)[:, None], axis=1
    )  # the corner alone on its side
    rows = np.arange(len(split))
    a, b, c = (split[rows, (lone + k) % 3] for k in range(3))
    share = [(at - a[:, axis]) / (end[:, axis] - a[:, axis]) for end in (b, c)]
    ab, ac = (a + part[:, None] * (end - a) for part, end in zip(share, (b, c), strict=True))
    corners, stumps = (
        np.stack([a, ab, ac], axis=1),
        [np.stack([ab, b, c], axis=1), np.stack([ab, c, ac], axis=1)],
    )
    corner_above = upper[rows, lone]
    below_plane = [
        triangles[count == 0],
        corners[~corner_above],
        *(stump[corner_above] for stump in stumps),
    ]
    above_plane = [
        triangles[count == 3],
        corners[corner_above],
        *(stump[~corner_above] for stump in stumps),
    ]
    return np.concatenate(below_plane), np.concatenate(above_plane)


def _outline(points: Array) -> Array:
    """Corners of the hull of points, thickened if the points are in a plane or on a line."""
    try:
        if len(points) > 500:  # Qhull is slow for interior points
            faces = ConvexHull(points[_extreme(points)]).equations
            points = points[(points @ faces[:, :3].T + faces[:, 3] > -1e-9).any(axis=1)]
        return np.asarray(points[ConvexHull(points).vertices])
    except QhullError:
        points = np.concatenate(
            [points + 5e-4 * np.array(corner) for corner in product((-1, 1), repeat=3)]
        )
        return np.asarray(points[ConvexHull(points).vertices])


def _extreme(points: Array) -> np.ndarray:
    """Return indices of the points that are farthest along 26 directions."""
    directions = np.array(
        [direction for direction in product((-1, 0, 1), repeat=3) if any(direction)]
    )
    return np.unique(np.argmax(points @ directions.T, axis=0))


def _fixed_to(chain: Chain, frame: str) -> list[str]:
    """Return a frame and its ancestors on the same joint."""
    joint = chain.frames[frame].joint
    return list(takewhile(lambda name: chain.frames[name].joint == joint, chain.ancestors(frame)))


class Lowest(NamedTuple):
    """Lowest point of a link during a motion: its height in the base frame [m], and when [s]."""

    link: str
    height: float
    time: float


def lowest_point(arm: Arm, time: Array, q: Array) -> Lowest | None:
    """Compute the lowest point of the convex hulls of all moving links over a motion; None without shapes."""
    try:
        hulls = [hull for part in parts_of(arm.geometry) if part.joint for hull in hulls_of(part)]
    except FileFormatError:
        return None
    poses, lowest = arm.link_poses(q), list[Lowest]()
    for hull in hulls:
        vertical = poses[:, hull.joint, 2]
        heights = (vertical[:, :3] @ hull.corners.T).min(axis=1) + vertical[:, 3] - hull.skin
        i = int(np.argmin(heights))
        lowest.append(Lowest(hull.name, float(heights[i]), float(time[i])))
    return min(lowest, key=lambda point: point.height, default=None)
