"""Shapes and surfaces of an arm; operations on meshes and meshes of simple solids."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from maniport.arms.chain import Chain, CollisionShapes, Mesh, Shape, Triangles
from maniport.util.validation import Array


@dataclass(frozen=True, eq=False, repr=False)
class Surface:
    """Triangles that move with one joint of an arm; arrays are read-only.

    Attributes
    ----------
    joint : int
        Number of joints of the chain that move them (0: fixed to the base), an index into the poses of
        `maniport.arms.Arm.link_poses`.
    points : ndarray, shape (n, 3)
        Corners [m] in the frame of the last of these joints.
    triangles : ndarray of int32, shape (m, 3)
        Indices of the points of each triangle, counter-clockwise from outside as in the file.
    """

    joint: int
    points: Array
    triangles: Triangles

    def __post_init__(self) -> None:
        for array in (self.points, self.triangles):  # cached
            array.setflags(write=False)

    def __repr__(self) -> str:
        return f"Surface(joint {self.joint}, {len(self.points)} points, {len(self.triangles)} triangles)"


class Geometry:
    """Shapes of the links of a chain. Files are read once."""

    def __init__(self, chain: Chain):
        self.chain = chain

    @cached_property
    def surfaces(self) -> tuple[Surface, ...]:
        """The surface of each joint: of 15 000 triangles a share in proportion, and 200 more."""
        meshes: dict[int, list[Mesh]] = {}
        for link, mesh in self.shapes.items():
            meshes.setdefault(self.chain.frames[link].joint, []).append(mesh)
        total = sum(len(triangles) for _, triangles in self.shapes.values())
        surfaces = []
        for joint, of_links in sorted(meshes.items()):
            mesh = joined(of_links)
            if total > 15_000:
                mesh = reduced(mesh, 200 + 15_000 * len(mesh[1]) // total)
            if len(mesh[1]):
                surfaces.append(Surface(joint, *mesh))
        return tuple(surfaces)

    @cached_property
    def shapes(self) -> dict[str, Mesh]:
        """Drawn shapes of the links, see `Chain.holds`, in the frames of their joints."""
        meshes: dict[str, Mesh] = {}
        for link, (points, triangles) in _by_link(self._drawn).items():
            placement = self.chain.frames[link].placement
            meshes[link] = (points @ placement[:3, :3].T + placement[:3, 3], triangles)
        return meshes

    @property
    def stand_ins(self) -> tuple[str, ...]:
        """Links drawn by collision shapes, since visual meshes are missing."""
        return tuple(dict.fromkeys(shape.link for shape in self._drawn if shape.stand_in))

    @cached_property
    def _drawn(self) -> list[Shape]:
        links = [link for link in self.chain.frames if self.chain.holds(link)]
        if self.chain.shapes is None:
            return []
        return [*self.chain.shapes(links)]

    @cached_property
    def checked(self) -> CollisionShapes:
        """Shapes of the links and of all bodies attached to the chain that are checked for collisions."""
        links = [link for link in self.chain.frames if self.chain.holds(link)]
        links += self.chain.attached
        if self.chain.collision_shapes is not None:
            return self.chain.collision_shapes(links)
        return CollisionShapes([] if self.chain.shapes is None else [*self.chain.shapes(links)])


def _by_link(shapes: Iterable[Shape]) -> dict[str, Mesh]:
    """Meshes of links in their frames."""
    meshes: dict[str, list[Mesh]] = {}
    for shape in shapes:
        mesh = welded(shape.mesh)
        if len(mesh[1]):
            meshes.setdefault(shape.link, []).append(mesh)
    return {link: joined(parts) for link, parts in meshes.items()}


def joined(meshes: Sequence[Mesh]) -> Mesh:
    """Concatenate meshes."""
    points = []
    triangles = []
    start = 0
    for mesh_points, mesh_triangles in meshes:
        points.append(mesh_points)
        triangles.append(mesh_triangles + start)
        start += len(mesh_points)
    return np.concatenate(points), np.concatenate(triangles).astype(np.int32)


def moved_points(points: Array, pose: Array) -> Array:
    """Transform points (n, 3) by a pose (4, 4)."""
    return np.asarray(points @ pose[:3, :3].T + pose[:3, 3])


def moved(mesh: Mesh, pose: Array) -> Mesh:
    """Transform a mesh by a pose (4, 4)."""
    points, triangles = mesh
    return moved_points(points, pose), triangles


def welded(mesh: Mesh, cell: float = 0.0) -> Mesh:
    """Merge points in the same cell of a grid; drop degenerate and repeated triangles.

    Cells measure at least a millionth of the mesh. A mesh below a nanometer becomes empty.
    """
    points, triangles = mesh
    kept, rows = np.unique(triangles, return_inverse=True)
    if len(kept):
        size = float(np.ptp(points[kept], axis=0).max(initial=0.0))
    else:
        size = 0.0
    if size < 1e-9:
        return np.empty((0, 3)), np.empty((0, 3), dtype=np.int32)
    cells = np.round((points[kept] - points[kept].min(axis=0)) / max(cell, 1e-6 * size)).astype(
        np.int64
    )
    _, first, cell_of = np.unique(cells @ (1, 2**20, 2**40), return_index=True, return_inverse=True)
    rows = cell_of[rows.reshape(-1, 3)]
    rows = rows[
        (rows[:, 0] != rows[:, 1]) & (rows[:, 1] != rows[:, 2]) & (rows[:, 2] != rows[:, 0])
    ]
    _, new = np.unique(np.sort(rows, axis=1), axis=0, return_index=True)
    left, numbers = np.unique(rows[np.sort(new)], return_inverse=True)
    return points[kept[first[left]]], numbers.reshape(-1, 3).astype(np.int32)


def reduced(mesh: Mesh, most: int) -> Mesh:
    """Reduce a mesh to at most `most` triangles by merging close points."""
    a, b, c = mesh[0][mesh[1].T]
    area = 0.5 * float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())
    edge = np.sqrt(area / max(most, 1))
    if len(mesh[1]) > 3 * most:
        cell = 0.35 * edge
    else:
        cell = 0.035 * edge
    while len(mesh[1]) > most:
        mesh = welded(mesh, cell)
        cell *= 1.2
    return mesh


def solid(kind: str, *size: float) -> Mesh:
    """Return a simple solid around the origin [m].

    Sizes are the edges of a box, radius and length of a cylinder or capsule along z (without its hemispheres), the
    radius of a sphere or the semi-axes of an ellipsoid. Polygons for a circle are within 0.5 % of the radius.
    """
    from trimesh import creation  # here: slow import

    if kind == "box":
        made = creation.box(size)
    elif kind == "cylinder":
        made = creation.cylinder(*size, sections=32)
    elif kind == "capsule":
        made = creation.capsule(size[1], size[0], count=(16, 32))
    else:
        made = creation.icosphere(subdivisions=3)
        made.vertices *= size
    return np.array(made.vertices), made.faces.astype(np.int32)


SECTIONS = 48
"""Sides of the polygon that encloses a circle: its corners are 0.2 % of the radius outside."""


def solid_core(kind: str, *size: float) -> tuple[Array, float]:
    """Return points (k, 3) and a radius [m]: the hull of the points, enlarged by the radius, is or encloses a solid.

    Kinds and sizes are those of `solid`. Boxes, spheres and capsules are exact; cylinders and ellipsoids are enclosed
    within 0.2 % and 0.7 % of their radii.
    """
    if kind == "sphere":
        return np.zeros((1, 3)), size[0]
    if kind == "capsule":
        return np.array([[0.0, 0.0, -0.5 * size[1]], [0.0, 0.0, 0.5 * size[1]]]), size[0]
    if kind == "box":
        signs = np.array([*product((-0.5, 0.5), repeat=3)])
        return signs * size, 0.0
    if kind == "cylinder":
        angles = 2 * np.pi * np.arange(SECTIONS) / SECTIONS
        outer = size[0] / np.cos(np.pi / SECTIONS)
        circle = outer * np.stack([np.cos(angles), np.sin(angles)], axis=1)
        ends = []
        for z in (-0.5 * size[1], 0.5 * size[1]):
            ends.append(np.column_stack([circle, np.full(SECTIONS, z)]))
        return np.concatenate(ends), 0.0
    points, triangles = solid("ellipsoid", 1.0, 1.0, 1.0)
    corners = points[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    depth = np.einsum(
        "ij,ij->i", normals, corners[:, 0]
    ).min()  # of the nearest face of a unit sphere
    return points / depth * size, 0.0


def hull_triangles(points: Array) -> Triangles:
    """Triangles of the convex hull of points (n, 3), counter-clockwise from outside; `QhullError` for flat ones."""
    hull = ConvexHull(points)
    triangles: Triangles = hull.simplices.astype(np.int32)
    corners = points[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inward = np.einsum("ij,ij->i", normals, hull.equations[:, :3]) < 0
    triangles[inward] = triangles[inward][:, ::-1]
    return triangles


def is_convex(mesh: Mesh) -> bool:
    """Return whether a mesh is closed and fills at least 99 % of its convex hull."""
    points, triangles = mesh
    try:
        hull = ConvexHull(points[np.unique(triangles)])
    except QhullError:  # flat
        return False
    corners = points[triangles] - points.mean(axis=0)
    volumes = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6
    share = abs(volumes.sum()) / hull.volume
    return bool(0.99 < share < 1.01)
