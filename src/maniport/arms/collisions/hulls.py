"""Convex hulls of an arm's links."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import product, takewhile
from typing import NamedTuple

import coal
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from maniport.arms.arm import Arm
from maniport.arms.chain import Chain, Contact, Mesh, Shape
from maniport.arms.meshes import (
    Geometry,
    is_convex,
    joined,
    moved,
    moved_points,
    reduced,
    welded,
)
from maniport.errors import FileFormatError
from maniport.util.validation import Array

# of a hull, and of one of several of a mesh
MOST_CORNERS = 96
FINE_CORNERS = 256
CIRCLES = 96  # corners of a cylinder, whose hull needs all of them
MOST_SOLIDS = 400  # of an arm: 400 solids of 1 cm³ take 0.4 ms for each configuration
CORE_THICKNESS = 2e-5  # half the size of cubes in place of the points of a core with a radius [m]
CUBE = np.array([*product((-1.0, 1.0), repeat=3)])


@dataclass(frozen=True, eq=False, repr=False)
class Hull:
    """A convex solid that moves with one joint of an arm."""

    name: str  # of the link, or of the box
    joint: int  # number of joints of the chain that move it; 0: fixed to the base
    corners: Array  # (k, 3), in that joint's frame [m]
    skin: float  # largest distance of the enclosed points from the hull of the corners [m]
    solid: coal.Convex  # the corners' hull
    radius: float = 0.0  # of a rounded solid, a part of the skin [m]
    contact: Contact | None = None  # of a geom of an MJCF

    @classmethod
    def of(cls, name: str, joint: int, solid: "Solid") -> "Hull":
        """Return the hull of a convex solid; one with a radius is the hull of its core with a skin."""
        points = solid.core
        if solid.radius > 0.0:  # perhaps a point or a line
            thickness = min(CORE_THICKNESS, 0.1 * solid.radius)
            points = np.concatenate([points + thickness * corner for corner in CUBE])
        elif len(points) <= CIRCLES:
            points = _outline(points)
        hull = cls.around(name, joint, points, max(CIRCLES, MOST_CORNERS))
        return replace(
            hull, skin=hull.skin + solid.radius, radius=solid.radius, contact=solid.contact
        )

    @classmethod
    def around(cls, name: str, joint: int, points: Array, most: int = 96) -> "Hull":
        """Enclose points [m] in a hull of at most `most` corners; the least prominent are omitted."""
        outline = _outline(points)
        corners = outline
        if len(outline) > most:
            corners = outline[_prominent(outline, most)]
        vertices = coal.StdVec_Vec3s()
        skin = 0.0
        vertices.extend(list(corners))
        solid = coal.Convex.convexHull(vertices, True, "Qt")
        corners = np.ascontiguousarray(solid.points())
        if len(outline) > len(corners):
            here = coal.Transform3s()
            there = coal.Transform3s()
            sphere = coal.Sphere(0.0)
            request = coal.DistanceRequest()
            result = coal.DistanceResult()
            faces = ConvexHull(corners).equations
            for point in outline[(outline @ faces[:, :3].T + faces[:, 3] > 0.0).any(axis=1)]:
                there.setTranslation(point)
                result.clear()
                skin = max(skin, coal.distance(solid, here, sphere, there, request, result))
        return cls(name, joint, corners, skin, solid)


@dataclass(frozen=True, eq=False)
class Solid:
    """A convex solid: all points within a radius of the hull of its core."""

    core: Array  # (k, 3) [m]
    radius: float = 0.0  # [m]
    contact: Contact | None = None  # of a geom of an MJCF


@dataclass(frozen=True, eq=False, repr=False)
class Part:
    """Shapes of a body, or of a finger from open to closed, and the joint of the chain that moves it."""

    name: str  # of the link
    joint: int  # number of joints of the chain that move it
    mesh: Mesh  # all shapes in the frame of the joint [m]; of a finger the hulls of all poses
    own: bool = False  # whether it is on the chain, not attached to it
    end_position: Array | None = (
        None  # (3,) of the end effector that hulls of visual shapes enclose
    )
    solids: tuple[Solid, ...] = ()  # convex shapes
    concave: tuple[Mesh, ...] = ()  # meshes that hulls may have to divide
    is_plane: bool = False  # whether it is an infinite plane around the robot, such as a floor

    @property
    def is_convex(self) -> bool:
        """Whether its hulls are its shapes, except for skins and the corners of circles."""
        return not self.concave


@lru_cache(maxsize=16)
def parts_of(geometry: Geometry) -> tuple[Part, ...]:
    """Collect the shapes of an arm and of all bodies attached to it, in the order of the chain."""
    chain = geometry.chain
    shapes: dict[str, list[Shape]] = {}
    for shape in geometry.checked.shapes:
        shapes.setdefault(shape.link, []).append(shape)

    links = [name for name in shapes if chain.holds(name)]
    links.sort(key=lambda name: (chain.frames[name].joint, len(_fixed_to(chain, name))))
    if not links:
        return ()
    carrier = next((name for name in _fixed_to(chain, chain.frame) if name in shapes), None)
    end_position = chain.frames[chain.frame].placement[:3, 3]
    parts: list[Part] = []
    for link in links:
        frame = chain.frames[link]
        end = None
        if link == carrier:
            end = end_position
        forms = [_form(shape, frame.placement[None]) for shape in shapes[link]]
        parts += _parts(link, frame.joint, forms, own=True, end_position=end)

    attached: dict[tuple[str, int], list[_Form]] = {}
    for name, body in chain.attached.items():
        forms = [_form(shape, body.placements) for shape in shapes.get(name, ())]
        attached.setdefault((body.group, body.joint), []).extend(forms)
    for (name, joint), forms in attached.items():
        parts += _parts(name, joint, forms)
    parts = _with_fewer_solids(parts)
    return tuple(sorted(parts, key=lambda part: part.joint))


def _with_fewer_solids(parts: Sequence[Part]) -> list[Part]:
    """Return parts with at most `MOST_SOLIDS` solids in total: those with most solids are checked by hulls of all."""
    counts = [len(part.solids) for part in parts]
    reduced_parts = list(parts)
    while sum(counts) > MOST_SOLIDS and max(counts) > 1:
        i = int(np.argmax(counts))
        reduced_parts[i] = replace(parts[i], solids=(), concave=(parts[i].mesh,))
        counts[i] = 0
    return reduced_parts


@dataclass(frozen=True, eq=False)
class _Form:
    """A shape in the frame of a joint: its mesh, and the solid if it is convex."""

    mesh: Mesh
    solid: Solid | None
    collision: bool


def _form(shape: Shape, placements: Array) -> _Form:
    """Place a shape; one with several placements (n, 4, 4) fills their convex hull."""
    mesh = welded(shape.mesh)
    core = shape.core
    if len(placements) == 1:
        mesh = moved(mesh, placements[0])
        if core is None and shape.collision and len(mesh[1]) and is_convex(mesh):
            core = mesh[0]
        elif core is not None:
            core = moved_points(core, placements[0])
        solid = None if core is None else Solid(core, shape.radius, shape.contact)
        return _Form(mesh, solid, shape.collision)

    outline = _outline(mesh[0])
    if core is None:
        core = outline
    cores = []
    outlines = []
    for placement in placements:
        cores.append(moved_points(core, placement))
        outlines.append(moved_points(outline, placement))
    hull = ConvexHull(_outline(np.concatenate(outlines)))
    swept = hull.points, hull.simplices.astype(np.int32)
    solid = Solid(np.concatenate(cores), shape.radius, shape.contact)
    return _Form(swept, solid, shape.collision)


def _parts(
    name: str,
    joint: int,
    forms: Sequence[_Form],
    own: bool = False,
    end_position: Array | None = None,
) -> list[Part]:
    """Return the part of a body, if it has a form, and one of its planes; visual meshes are joined."""
    planes = list[_Form]()
    others = list[_Form]()
    for form in forms:
        if not len(form.mesh[1]):
            continue
        if _is_plane(form.solid):
            planes.append(form)
        else:
            others.append(form)
    parts = []
    if planes:
        joined_planes = _Joined.of(planes)
        parts.append(
            Part(name, joint, joined_planes.mesh, own, solids=joined_planes.solids, is_plane=True)
        )
    if others:
        shapes = _Joined.of(others)
        if any(form.collision for form in others):
            part = Part(name, joint, shapes.mesh, own, None, shapes.solids, shapes.concave)
        else:
            part = Part(name, joint, shapes.mesh, own, end_position, concave=(shapes.mesh,))
        parts.append(part)
    return parts


class _Joined(NamedTuple):
    """Shapes of a body: all as one mesh, the convex ones as solids, and the meshes of the others."""

    mesh: Mesh
    solids: tuple[Solid, ...]
    concave: tuple[Mesh, ...]

    @classmethod
    def of(cls, forms: Sequence[_Form]) -> "_Joined":
        """Join the shapes of a body, at least one."""
        meshes = []
        solids = []
        concave = []
        for form in forms:
            meshes.append(form.mesh)
            if form.solid is None:
                concave.append(form.mesh)
            else:
                solids.append(form.solid)
        return cls(joined(meshes), tuple(solids), tuple(concave))


def _is_plane(solid: Solid | None) -> bool:
    return solid is not None and solid.contact is not None and solid.contact.is_plane


@lru_cache(maxsize=512)
def hulls_of(part: Part, fine: bool = False) -> tuple[Hull, ...]:
    """Return the convex solids of a part, and for each other mesh one hull, or two where it is bent.

    With `fine`, there are up to eight hulls of each mesh.
    """
    hulls = [Hull.of(part.name, part.joint, solid) for solid in part.solids]
    most = FINE_CORNERS if fine else MOST_CORNERS
    for mesh in part.concave:
        outlines = _outlines(mesh, fine)
        end = part.end_position
        if end is not None:
            distances = []
            for outline in outlines:
                distances.append(np.linalg.norm(outline - end, axis=1).min())
            nearest = int(np.argmin(distances))
            outlines[nearest] = np.concatenate([outlines[nearest], [end]])
        hulls += [Hull.around(part.name, part.joint, outline, most) for outline in outlines]
    return tuple(hulls)


def _outlines(mesh: Mesh, fine: bool) -> list[Array]:
    """Corners of the hulls that enclose a mesh."""
    points, triangles = reduced(mesh, 300)  # cuts are chosen on a coarse mesh
    pieces = [_Piece(points[triangles], ())]
    # largest volume after a cut, as a fraction
    if fine:
        worth = 0.97
        most = 8
    else:
        worth = 0.85
        most = 2
    whole: list[_Piece] = []
    while pieces and len(pieces) + len(whole) < most:
        piece = pieces.pop(int(np.argmax([piece.volume for piece in pieces])))
        halves = piece.halves(any_axis=fine)
        if _volume(halves) < worth * piece.volume:
            pieces += halves
        else:
            whole.append(piece)
    outlines = []
    for piece in pieces + whole:
        if piece.planes:
            corners = mesh[0][mesh[1]]
        else:
            corners = mesh[0]
        for axis, at, side in piece.planes:
            corners = _cut(corners, axis, at)[side]
        if len(corners):
            outlines.append(_outline(corners.reshape(-1, 3)))
    return outlines


@dataclass(frozen=True, eq=False)
class _Piece:
    """Triangles of a link on one side of some planes."""

    triangles: Array  # (n, 3, 3)
    planes: tuple[tuple[int, float, int], ...]  # axis, where the plane crosses it, side (1: above)

    @cached_property
    def volume(self) -> float:
        """Volume of the convex hull [m³]."""
        return float(ConvexHull(_outline(self.triangles.reshape(-1, 3))).volume)

    def halves(self, any_axis: bool) -> list["_Piece"]:
        """Cut at the fraction of the length, in sixths, where both hulls together are smallest."""
        low = self.triangles.min(axis=(0, 1))
        high = self.triangles.max(axis=(0, 1))
        axes = [0, 1, 2]
        if not any_axis:
            axes = [int(np.argmax(high - low))]
        cuts = []
        for axis in axes:
            for at in np.linspace(low[axis], high[axis], 7)[1:-1].tolist():
                below, above = _cut(self.triangles, axis, at)
                if len(below) and len(above):
                    pieces = [
                        _Piece(below, (*self.planes, (axis, at, 0))),
                        _Piece(above, (*self.planes, (axis, at, 1))),
                    ]
                    cuts.append(pieces)
        if not cuts:
            return [self]
        return min(cuts, key=_volume)


def _volume(pieces: Sequence[_Piece]) -> float:
    """Sum of the volumes of the hulls of pieces [m³]."""
    return sum(piece.volume for piece in pieces)


def _cut(triangles: Array, axis: int, at: float) -> tuple[Array, Array]:
    """Split triangles (n, 3, 3) by a plane normal to an axis; return those below and above."""
    above = triangles[..., axis] > at
    count = above.sum(axis=1)
    crossing = (count > 0) & (count < 3)
    split = triangles[crossing]
    upper = above[crossing]
    # corner a is alone on its side
    lone = np.argmax(upper == (upper.sum(axis=1) == 1)[:, None], axis=1)
    rows = np.arange(len(split))
    a = split[rows, lone]
    b = split[rows, (lone + 1) % 3]
    c = split[rows, (lone + 2) % 3]

    # edges from a cross the plane there
    share_b = (at - a[:, axis]) / (b[:, axis] - a[:, axis])
    share_c = (at - a[:, axis]) / (c[:, axis] - a[:, axis])
    ab = a + share_b[:, None] * (b - a)
    ac = a + share_c[:, None] * (c - a)

    corners = np.stack([a, ab, ac], axis=1)
    first_stump = np.stack([ab, b, c], axis=1)
    second_stump = np.stack([ab, c, ac], axis=1)
    corner_above = upper[rows, lone]
    below_plane = [
        triangles[count == 0],
        corners[~corner_above],
        first_stump[corner_above],
        second_stump[corner_above],
    ]
    above_plane = [
        triangles[count == 3],
        corners[corner_above],
        first_stump[~corner_above],
        second_stump[~corner_above],
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
        thick = []
        for corner in product((-1, 1), repeat=3):
            thick.append(points + 5e-4 * np.array(corner))
        points = np.concatenate(thick)
        return np.asarray(points[ConvexHull(points).vertices])


def _prominent(points: Array, most: int) -> NDArray[np.intp]:
    """Return indices of at most `most` points, the most prominent corners of the hull of all (n, 3)."""
    chosen = _extreme(points)
    while len(chosen) < most:  # add the most prominent from the hull of the others
        faces = ConvexHull(points[chosen]).equations
        beyond = points @ faces[:, :3].T + faces[:, 3]
        farthest = np.argmax(beyond, axis=0)
        distances = beyond[farthest, np.arange(len(faces))]
        distances = np.where(np.isin(farthest, chosen), 0.0, distances)
        order = np.argsort(-distances, kind="stable")
        best = order[distances[order] > 1e-4]
        if not len(best):
            break
        # a new corner may make its neighbors redundant
        count = min(most - len(chosen), 1 + len(best) // 4)
        chosen = np.unique(np.concatenate([chosen, farthest[best[:count]]]))
    return chosen


def _extreme(points: Array) -> NDArray[np.intp]:
    """Return indices of the points that are farthest along 26 directions."""
    directions = np.array([axes for axes in product((-1, 0, 1), repeat=3) if any(axes)])
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
        hulls = list[Hull]()
        for part in parts_of(arm.geometry):
            if part.joint:
                hulls += hulls_of(part)
    except FileFormatError:
        return None
    poses = arm.link_poses(q)
    lowest = list[Lowest]()
    for hull in hulls:
        vertical = poses[:, hull.joint, 2]
        heights = (vertical[:, :3] @ hull.corners.T).min(axis=1) + vertical[:, 3] - hull.skin
        i = int(np.argmin(heights))
        lowest.append(Lowest(hull.name, float(heights[i]), float(time[i])))
    return min(lowest, key=lambda point: point.height, default=None)
