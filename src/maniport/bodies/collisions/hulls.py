"""Convex hulls of an arm's links."""

from dataclasses import dataclass
from itertools import pairwise, product

import coal
import numpy as np
from scipy.spatial import ConvexHull, QhullError

from maniport.bodies.arm import Arm
from maniport.bodies.chain import Mesh
from maniport.bodies.looks.meshes import joined
from maniport.validation import Array

MOST_CORNERS = 96
"""A support point is looked for among all of them; a hull with more loses those that stand out least."""

_FINE_ENOUGH = 1e-4
"""A hull gets no further corners once none stands out by more [m]."""

_THIN = 5e-4
"""What lies in a plane or on a line is made so much thicker on each side [m]."""

_SLICES = 8
_WORTH_CUTTING = 0.85
"""A link is cut in two, at one of the planes between slices of equal thickness, when that leaves less of its volume."""


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
    def around(cls, name: str, joint: int, points: Array) -> "Hull":
        """The hull of points [m], with at most `MOST_CORNERS` corners."""
        outline = _outline(points)
        corners = _outstanding(outline)
        hull = ConvexHull(corners)
        number = np.empty(len(corners), dtype=int)
        number[hull.vertices] = np.arange(len(hull.vertices))
        corners = np.ascontiguousarray(corners[hull.vertices])
        solid = _solid(corners, number[hull.simplices])
        skin = 0.0 if len(outline) == len(corners) else max(0.0, *(_distance(solid, point) for point in outline))
        return cls(name, joint, corners, skin, solid)

    def __repr__(self) -> str:
        return f"Hull({self.name!r}, {len(self.corners)} corners)"


def hulls_of(arm: Arm) -> list[Hull]:
    """One hull for each link of an arm that is drawn, or two, in the order of the chain; see `Collisions`.

    Raises
    ------
    FileFormatError
        When the arm's file or a mesh is missing or cannot be read.
    """
    meshes: dict[str, list[Mesh]] = {}
    for link, mesh in arm.look.shapes():
        meshes.setdefault(link, []).append(mesh)
    frames = arm.chain.frames
    tip = frames[arm.frame].placement[None, :3, 3]
    carrier = next((name for name in _fixed_to(arm, arm.frame) if name in meshes), None)
    hulls = []
    for link in sorted(meshes, key=lambda name: (frames[name].joint, len(_fixed_to(arm, name)))):
        pieces = _pieces(joined(meshes[link]))
        if link == carrier:
            nearest = int(np.argmin([np.linalg.norm(piece - tip, axis=1).min() for piece in pieces]))
            pieces[nearest] = np.concatenate([pieces[nearest], tip])
        hulls += [Hull.around(link, frames[link].joint, piece) for piece in pieces]
    return hulls


def _pieces(mesh: Mesh) -> list[Array]:
    """Points of a link, in two parts where cutting it across makes the hulls much smaller than that of the whole.

    A triangle on the cut belongs to both parts, so that their hulls hold all that a closed mesh encloses.
    """
    points, triangles = mesh
    axis = int(np.argmax(np.ptp(points, axis=0)))
    cuts = np.linspace(points[:, axis].min(), points[:, axis].max(), _SLICES + 1)
    along = points[triangles][..., axis]
    low, high = along.min(axis=1), along.max(axis=1)
    inside = [triangles[(low <= end) & (high >= start)] for start, end in pairwise(cuts)]
    slices = [_outline(points[np.unique(rows)]) for rows in inside if len(rows)]
    halves = [(np.concatenate(slices[:cut]), np.concatenate(slices[cut:])) for cut in range(1, len(slices))]
    whole = np.concatenate(slices)
    volumes = [sum(ConvexHull(half).volume for half in pair) for pair in halves]
    best = int(np.argmin(volumes)) if volumes else 0
    return [*halves[best]] if volumes and volumes[best] < _WORTH_CUTTING * ConvexHull(whole).volume else [whole]


def _outline(points: Array) -> Array:
    """Corners of the hull of points; those of something a little thicker where they lie in a plane or on a line."""
    try:
        return np.asarray(points[ConvexHull(points).vertices])
    except QhullError:
        points = np.concatenate([points + _THIN * np.array(corner) for corner in product((-1, 1), repeat=3)])
        return np.asarray(points[ConvexHull(points).vertices])


def _fixed_to(arm: Arm, frame: str) -> list[str]:
    """A frame and those on the same joint that it is attached to, one behind the other."""
    frames, names = arm.chain.frames, [frame]
    while (above := frames[names[-1]].parent) is not None:
        if above in names or above not in frames or frames[above].joint != frames[frame].joint:
            break
        names.append(above)
    return names


def _outstanding(outline: Array) -> Array:
    """Corners of a hull, or as many as are allowed: in rounds those that stand out most from the hull of the others."""
    if len(outline) <= MOST_CORNERS:
        return outline
    ways = np.array([way for way in product((-1, 0, 1), repeat=3) if any(way)])
    chosen = np.unique(np.argmax(outline @ ways.T, axis=0))
    while len(chosen) < MOST_CORNERS:
        faces = ConvexHull(outline[chosen]).equations
        beyond = outline @ faces[:, :3].T + faces[:, 3]
        farthest = np.argmax(beyond, axis=0)
        out = np.where(np.isin(farthest, chosen), 0.0, beyond[farthest, np.arange(len(faces))])
        best = [face for face in np.argsort(-out, kind="stable") if out[face] > _FINE_ENOUGH]
        if not best:
            break
        room = min(MOST_CORNERS - len(chosen), 1 + len(best) // 4)  # a corner taken may spare its neighbours
        chosen = np.unique(np.concatenate([chosen, farthest[best[:room]]]))
    return np.asarray(outline[chosen])


def _solid(corners: Array, triangles: np.ndarray) -> coal.Convex:
    points, faces = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
    for corner in corners:
        points.append(corner)
    for a, b, c in triangles.tolist():
        faces.append(coal.Triangle(a, b, c))
    return coal.Convex(points, faces)


def _distance(solid: coal.Convex, point: Array) -> float:
    here, there = coal.Transform3s(), coal.Transform3s(np.eye(3), point)
    request, result = coal.DistanceRequest(), coal.DistanceResult()
    return float(coal.distance(solid, here, coal.Sphere(0.0), there, request, result))
