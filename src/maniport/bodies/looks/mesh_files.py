"""Mesh files: where they are, by the names that robot files give them, and what is in them."""

import os
import re
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from urllib.parse import unquote

import coal
import numpy as np

from maniport.bodies.chain import Mesh, Triangles
from maniport.errors import FileFormatError
from maniport.validation import Array

_PACKAGE = re.compile(r"(?:package|model):/{2,}([^/]+)/+(.+)", re.DOTALL)


def find_mesh(name: str, folder: Path) -> Path | None:
    """The file that a URDF in `folder` means by a mesh's name; None when it is not there."""
    return next((place for place in _places(name, folder) if place.is_file()), None)


def search_rule(name: str, folder: Path) -> str:
    """Where `find_mesh` looks for a mesh, in words."""
    package = _PACKAGE.fullmatch(name)
    if package is None:
        return f"at {str(next(_places(name, folder)))!r}"
    variables = [v for v in ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH") if os.environ.get(v)]
    also = " and in " + " and ".join(variables) if variables else " (ROS_PACKAGE_PATH and AMENT_PREFIX_PATH are empty)"
    return f"for the package {package[1]!r} in {str(folder)!r} and every folder above{also}"


def _places(name: str, folder: Path) -> Iterator[Path]:
    """Where a mesh may be, in the order of the search."""
    package = _PACKAGE.fullmatch(name)
    if package is None:
        yield folder / unquote(name.removeprefix("file://")) if name.startswith("file://") else folder / name
        return
    title, rest = package.groups()
    ros = [Path(entry) for entry in os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep) if entry]
    ament = [Path(entry) / "share" for entry in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if entry]
    above = [folder, *folder.parents]
    for place in [*above, *ros, *ament]:
        if place.name == title:
            yield place / rest
        yield place / title / rest
    for place in above:  # a package's folder may have been given another name
        yield place / rest


def load_mesh(path: Path, scale: Array) -> Mesh:
    """Points and triangles of a mesh file (STL, DAE, OBJ and what else assimp reads).

    A negative scale mirrors the mesh; its triangles are turned over so that their outside stays outside.

    Raises
    ------
    FileFormatError
        When the file cannot be read as a mesh, or holds points that are not finite.
    """
    if path.suffix.lower() == ".dae":
        _require_indices(path)
    try:
        # Its bounding boxes, which nobody asks for here, are of the cheapest kind.
        model = coal.MeshLoader(coal.BV_AABB).load(str(path), np.asarray(scale, dtype=np.float64))
    except (ValueError, RuntimeError) as error:
        raise FileFormatError(f"{path}: cannot be read as a mesh: {reason(error)[1]}") from None
    return mesh_of(model, scale, path)


def _require_indices(path: Path) -> None:
    """Raise when a list of indices in a COLLADA file holds something else, at which assimp would read on for ever."""
    try:
        content = path.read_bytes()
    except OSError as error:
        raise FileFormatError(f"{path}: cannot be read: {error.strerror}") from None
    for found in re.finditer(rb"<(p|v|h|vcount)\b[^>]*>([^<]*)", content):
        strange = re.search(rb"[^\s\d-]+", found[2])
        if strange is not None:
            word = strange[0].decode("ascii", "replace")
            raise FileFormatError(f"{path}: cannot be read as a mesh: <{found[1].decode()}> holds {word!r}")


def mesh_of(model: coal.BVHModelBase, scale: Array, path: Path) -> Mesh:
    """Points and triangles of a mesh that Coal holds."""
    points, triangles = np.array(model.vertices(), dtype=np.float64), rows_of(model.tri_indices, model.num_tris)
    if not len(triangles):
        raise FileFormatError(f"{path}: holds no triangle")
    if not np.all(np.isfinite(points)):
        raise FileFormatError(f"{path}: holds points that are not finite")
    return points, np.ascontiguousarray(triangles[:, ::-1]) if np.prod(scale) < 0 else triangles


def rows_of(triangle: Callable[[int], Sequence[int]], count: int) -> Triangles:
    """Coal's triangles, which are not iterable, as an array."""
    return np.array([(t[0], t[1], t[2]) for t in map(triangle, range(count))], dtype=np.int32).reshape(-1, 3)


def reason(error: Exception) -> tuple[str | None, str]:
    """File and reason out of a message of Coal or Pinocchio, which also name lines of their own source."""
    text = str(error).split("message:")[-1]
    found = re.search(r"Could not load resource (.*?)\n(.*?)\n?(?:Hint:|$)", text, re.DOTALL)
    if found is None:
        return None, " ".join(text.split())
    return found[1], " ".join(found[2].split())
