"""Shapes of links as one small file: how those that ship with the package are stored."""

import zipfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from maniport.bodies.surface import Shape
from maniport.errors import FileFormatError

SUFFIX = ".npz"
_STEPS = 65_535
"""Coordinates are whole multiples of this fraction of the longest side of the box around a shape."""


def write_shapes(path: Path, shapes: Sequence[Shape]) -> None:
    """Write shapes with up to 65 536 points each; the same shapes give the same bytes.

    A point is stored to within 1/131 070 of its shape's longest side in each coordinate: 2 µm on 30 cm.
    """
    arrays: dict[str, np.ndarray] = {"links": np.array([shape.link for shape in shapes])}
    for i, shape in enumerate(shapes):
        points, triangles = shape.mesh
        corner, step = points.min(axis=0), float(np.ptp(points, axis=0).max()) / _STEPS
        arrays[f"grid_{i}"] = np.array([*corner, step])
        arrays[f"points_{i}"] = np.round((points - corner) / step).astype(np.uint16)
        arrays[f"triangles_{i}"] = triangles.astype(np.uint16)
    np.savez_compressed(path, **arrays)  # type: ignore[arg-type]


def read_shape_data(path: Path) -> list[Shape]:
    """Read what `write_shapes` wrote.

    Raises
    ------
    FileFormatError
        When the file is missing or not one of these.
    """
    try:
        with np.load(path, allow_pickle=False) as data:
            shapes = []
            for i, link in enumerate(data["links"]):
                *corner, step = data[f"grid_{i}"]
                points = np.array(corner) + step * data[f"points_{i}"]
                shapes.append(Shape(str(link), (points, data[f"triangles_{i}"].astype(np.int32))))
            return shapes
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile) as error:
        raise FileFormatError(f"{path}: holds no shapes of links: {error}") from None
