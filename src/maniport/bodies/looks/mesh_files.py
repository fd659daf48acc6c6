"""What is in mesh files, read without native code.

COLLADA and glTF, which are trees that place geometries, have a file each; the others are read by trimesh, which is
imported on first use. What a file announces is compared with what it can hold before that.
"""

import io
import re
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np

from maniport.bodies.chain import Mesh
from maniport.bodies.looks.collada_files import read_collada
from maniport.bodies.looks.gltf_files import read_gltf
from maniport.bodies.looks.meshes import joined
from maniport.errors import FileFormatError
from maniport.input_limits import MESH_BYTES, TRIANGLES, read_whole, require_at_most
from maniport.validation import Array


def scaled(mesh: Mesh, scale: Array) -> Mesh:
    """A mesh in another scale; a negative one mirrors it, and triangles are turned so that their outside stays so."""
    points, triangles = mesh
    return points * scale, np.ascontiguousarray(triangles[:, ::-1]) if np.prod(scale) < 0 else triangles


def load_mesh(path: Path) -> Mesh:
    """Points and triangles of a mesh file."""
    content = read_whole(path, KINDS, MESH_BYTES)
    try:
        with np.errstate(all="ignore"):  # what is not finite is refused
            parts = [_checked(path, *part) for part in KINDS[path.suffix.lower()](path, content)]
    except FileFormatError:
        raise
    except Exception as error:  # noqa: BLE001 - libraries trip over damaged files in all ways that Python has
        reason = " ".join(str(error).split())[:200] or type(error).__name__
        raise FileFormatError(f"{path}: cannot be read as a mesh: {reason}") from None
    if not any(len(triangles) for _, triangles in parts):
        raise FileFormatError(f"{path}: holds no triangle")
    points, triangles = joined(parts)
    require_at_most(len(triangles), TRIANGLES, "triangles", path)
    return points, triangles


def _checked(path: Path, points: Any, triangles: Any) -> Mesh:
    """A part whose triangles name points that there are, at places that there are."""
    points, triangles = np.asarray(points, dtype=np.float64).reshape(-1, 3), np.asarray(triangles).reshape(-1, 3)
    require_at_most(max(points.size, triangles.size) // 3, TRIANGLES, "points or triangles", path)
    if triangles.size and not (triangles.min() >= 0 and triangles.max() < len(points)):
        wild = triangles[(triangles < 0) | (triangles >= len(points))][0]
        raise FileFormatError(f"{path}: holds a triangle with point number {wild}; there are {len(points)}")
    if not np.all(np.isfinite(points)):
        raise FileFormatError(f"{path}: holds points that are not finite")
    return points, triangles.astype(np.int32)


def _read_stl(path: Path, content: bytes) -> Iterable[Mesh]:
    from trimesh.exchange.stl import load_stl

    announced = 84 + 50 * int.from_bytes(content[80:84], "little")
    if 84 <= announced < len(content):  # some programs append to it
        content = content[:announced]
    return _parts(load_stl(io.BytesIO(content)))


def _read_obj(path: Path, content: bytes) -> Iterable[Mesh]:
    from trimesh.exchange.obj import load_obj

    return _parts(load_obj(io.BytesIO(content), skip_materials=True))


def _read_off(path: Path, content: bytes) -> Iterable[Mesh]:
    from trimesh.exchange.off import load_off

    return _parts(load_off(io.BytesIO(content)))


def _read_ply(path: Path, content: bytes) -> Iterable[Mesh]:
    from trimesh.exchange.ply import load_ply

    header = content[: content.find(b"end_header")]
    for count in re.findall(rb"^\s*element\s+\S+\s+(\d+)", header, re.MULTILINE):
        require_at_most(int(count[:20]), len(content), "elements announced, more than bytes", path)
    return _parts(load_ply(io.BytesIO(content)))


def _parts(loaded: Any) -> Iterable[Mesh]:
    """Points and triangles of what trimesh read; larger polygons are cut into triangles."""
    from trimesh.geometry import triangulate_quads

    for part in loaded["geometry"].values() if "geometry" in loaded else [loaded]:
        if part.get("faces") is not None and len(part["faces"]):
            yield part["vertices"], triangulate_quads(part["faces"])


KINDS: dict[str, Callable[[Path, bytes], Iterable[Mesh]]] = {
    ".stl": _read_stl, ".dae": read_collada, ".obj": _read_obj, ".ply": _read_ply, ".off": _read_off,
    ".glb": read_gltf, ".gltf": read_gltf,
}  # fmt: skip
"""For each suffix what reads such a file, from its path and content to its parts."""
