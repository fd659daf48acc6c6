"""Meshes, that is points and triangles between them: joined, cleaned and made smaller."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from maniport.validation import Array

Triangles = NDArray[np.int32]
Mesh = tuple[Array, Triangles]
"""Points [m], shape (n, 3), and triangles as rows of three indices of points, shape (m, 3)."""

_SAME = 1e-6
"""Points nearer than that fraction of a mesh's size are one."""

_SMALLEST = 1e-9
"""What is not larger than a nanometre in any direction is no mesh [m]."""


def joined(meshes: Sequence[Mesh]) -> Mesh:
    """One mesh of several."""
    starts = np.cumsum([0, *(len(points) for points, _ in meshes)])[:-1]
    points = np.concatenate([points for points, _ in meshes])
    triangles = np.concatenate([rows + start for (_, rows), start in zip(meshes, starts, strict=True)])
    return points, triangles.astype(np.int32)


def welded(mesh: Mesh, cell: float = 0.0) -> Mesh:
    """Make points one that fall into the same cell of a grid; drop degenerate and repeated triangles.

    The edge of the cells is `cell` [m], but at least a millionth of the longest side of the box around the mesh. One
    of its points stands for a cell.
    """
    points, triangles = mesh
    kept, rows = np.unique(triangles, return_inverse=True)
    size = float(np.ptp(points[kept], axis=0).max(initial=0.0)) if len(kept) else 0.0
    if size < _SMALLEST:
        return np.empty((0, 3)), np.empty((0, 3), dtype=np.int32)
    cells = np.round((points[kept] - points[kept].min(axis=0)) / max(cell, _SAME * size)).astype(np.int64)
    _, first, cell_of = np.unique(cells @ (1, 2**20, 2**40), return_index=True, return_inverse=True)
    rows = cell_of[rows.reshape(-1, 3)]
    rows = rows[(rows[:, 0] != rows[:, 1]) & (rows[:, 1] != rows[:, 2]) & (rows[:, 2] != rows[:, 0])]
    rows = rows[_first_of_each(np.sort(rows, axis=1))]
    left, numbers = np.unique(rows, return_inverse=True)
    return points[kept[first[left]]], numbers.reshape(-1, 3).astype(np.int32)


def reduced(mesh: Mesh, most: int) -> Mesh:
    """Reduce a mesh to at most `most` triangles, by quadric error (Garland and Heckbert, SIGGRAPH 1997).

    Points much nearer than the triangles will be large are welded first: among the slivers that machines draw, the
    reduction stops early or lets points fly off. Where little is to go, it is let go more gently.
    """
    import fast_simplification  # here, since only this needs it

    edge = np.sqrt(_area(mesh) / max(most, 1))
    cell = 0.35 * edge if len(mesh[1]) > 3 * most else 0.035 * edge
    while len(mesh[1]) > most:
        mesh = welded(mesh, cell)
        if len(mesh[1]) > most:
            corner, size = mesh[0].min(axis=0), float(np.ptp(mesh[0], axis=0).max())
            unit = ((mesh[0] - corner) / size).astype(np.float32)  # the algorithm counts in single precision
            points, triangles = fast_simplification.simplify(unit, mesh[1], target_count=max(most, 1))
            points = np.clip(points.astype(np.float64), unit.min(axis=0), unit.max(axis=0))
            smaller = welded((corner + size * points, triangles.astype(np.int32)))
            mesh = smaller if len(smaller[1]) <= most else mesh
        cell *= 2
    return mesh


def _first_of_each(rows: np.ndarray) -> np.ndarray:
    """Indices of the first of each group of equal rows, ascending."""
    order = np.lexsort(rows.T)
    new = np.concatenate([[True], np.any(np.diff(rows[order], axis=0), axis=1)])[: len(rows)]
    return np.sort(order[new])  # lexsort is stable: the first of a group is its earliest


def _area(mesh: Mesh) -> float:
    points, triangles = mesh
    a, b, c = (points[column] for column in triangles.T)
    return 0.5 * float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())
