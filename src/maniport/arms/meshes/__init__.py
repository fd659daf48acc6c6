"""Shapes and surfaces of an arm; operations on meshes and meshes of simple solids."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from maniport.arms.chain import Chain, Mesh, Shape, Triangles
from maniport.errors import FileFormatError
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
        whole = {joint: joined(parts) for joint, parts in sorted(meshes.items())}
        if total > 15_000:
            whole = {
                joint: reduced(mesh, 200 + 15_000 * len(mesh[1]) // total)
                for joint, mesh in whole.items()
            }
        return tuple(Surface(joint, *mesh) for joint, mesh in whole.items() if len(mesh[1]))

    @cached_property
    def shapes(self) -> dict[str, Mesh]:
        """Shapes of the links, see `Chain.holds`, in the frames of their joints."""
        meshes = _by_link(self._own).items()
        placements = {link: self.chain.frames[link].placement for link, _ in meshes}
        return {
            link: (at @ placements[link][:3, :3].T + placements[link][:3, 3], rows)
            for link, (at, rows) in meshes
        }

    @property
    def stand_ins(self) -> tuple[str, ...]:
        """Links with collision shapes, since visual meshes are missing."""
        return tuple(dict.fromkeys(shape.link for shape in self._own if shape.stand_in))

    @cached_property
    def _own(self) -> list[Shape]:
        links = [link for link in self.chain.frames if self.chain.holds(link)]
        return [] if self.chain.shapes is None else [*self.chain.shapes(links)]

    @cached_property
    def attached(self) -> tuple[dict[str, Mesh], tuple[str, ...]]:
        """Shapes of the bodies attached to the chain, in their own frames, and names of unreadable bodies."""
        names, shapes = [*self.chain.attached], self.chain.shapes
        if shapes is None or not names:
            return {}, ()
        try:
            return _by_link(shapes(names)), ()
        except FileFormatError:  # perhaps of a single body: read them one by one
            read, missing = list[Shape](), list[str]()
            for name in names:
                try:
                    read += shapes([name])
                except FileFormatError:
                    missing.append(name)
            return _by_link(read), tuple(missing)


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
    starts = np.cumsum([0, *(len(points) for points, _ in meshes)])[:-1]
    points = np.concatenate([points for points, _ in meshes])
    triangles = np.concatenate(
        [rows + start for (_, rows), start in zip(meshes, starts, strict=True)]
    )
    return points, triangles.astype(np.int32)


def welded(mesh: Mesh, cell: float = 0.0) -> Mesh:
    """Merge points in the same cell of a grid; drop degenerate and repeated triangles.

    Cells measure at least a millionth of the mesh. A mesh below a nanometer becomes empty.
    """
    points, triangles = mesh
    kept, rows = np.unique(triangles, return_inverse=True)
    size = float(np.ptp(points[kept], axis=0).max(initial=0.0)) if len(kept) else 0.0
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
    a, b, c = (mesh[0][column] for column in mesh[1].T)
    area = 0.5 * float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())
    edge = np.sqrt(area / max(most, 1))
    cell = 0.35 * edge if len(mesh[1]) > 3 * most else 0.035 * edge
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
