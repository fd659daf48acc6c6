"""Triangles of mesh files, read without native code.

COLLADA is read by `maniport.bodies.looks.collada_files`, the other kinds by trimesh, which is imported on first use.
What a file announces is compared with what it can hold before that.
"""

import io
import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np

from maniport.bodies.chain import Mesh
from maniport.bodies.looks.collada_files import read_collada
from maniport.bodies.looks.meshes import joined
from maniport.bounds import MESH_BYTES, NODES, TRIANGLES, read_whole, require_at_most
from maniport.errors import FileFormatError
from maniport.validation import Array

KINDS = (".stl", ".dae", ".obj", ".ply", ".off", ".glb", ".gltf")


def scaled(mesh: Mesh, scale: Array) -> Mesh:
    """A mesh in another scale; a negative one mirrors it, and triangles are turned so that their outside stays so."""
    points, triangles = mesh
    return points * scale, np.ascontiguousarray(triangles[:, ::-1]) if np.prod(scale) < 0 else triangles


def load_mesh(path: Path) -> Mesh:
    """Points and triangles of a mesh file."""
    content = read_whole(path, KINDS, MESH_BYTES)
    read = read_collada if path.suffix.lower() == ".dae" else _read_by_trimesh
    try:
        with np.errstate(all="ignore"):  # what is not finite is refused
            parts = [_checked(path, *part) for part in read(path, content)]
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


def _read_by_trimesh(path: Path, content: bytes) -> Iterator[Mesh]:
    """Parts of a file in its own axes; larger polygons are cut into triangles."""
    from trimesh.exchange.load import mesh_loaders
    from trimesh.geometry import triangulate_quads

    kind = path.suffix.lower()[1:]
    if kind == "stl":
        announced = 84 + 50 * int.from_bytes(content[80:84], "little")
        content = content[:announced] if announced >= 84 else content  # some programs append to it
    elif kind == "ply":
        header = content[: content.find(b"end_header")]
        for count in re.findall(rb"^\s*element\s+\S+\s+(\d+)", header, re.MULTILINE):
            require_at_most(int(count[:20]), len(content), "elements announced, more than bytes", path)
    elif kind in ("gltf", "glb"):
        binary = kind == "glb"
        text = content[20 : 20 + int.from_bytes(content[12:16], "little")] if binary else content
        _require_sane(path, json.loads(text.decode("utf-8")))
    loaded = mesh_loaders[kind](io.BytesIO(content), file_type=kind, resolver=_Beside(path), skip_materials=True)
    poses = _placed(loaded["graph"]) if kind in ("gltf", "glb") else [(name, np.eye(4)) for name in _geometry(loaded)]
    triangles = 0
    for name, pose in poses:
        part = _geometry(loaded)[name]
        if part.get("faces") is not None and len(part["faces"]):
            triangles += len(part["faces"])
            require_at_most(triangles, TRIANGLES, "triangles", path)
            points = np.asarray(part["vertices"], dtype=np.float64)
            yield points @ pose[:3, :3].T + pose[:3, 3], triangulate_quads(part["faces"])


def _geometry(loaded: dict[str, Any]) -> dict[str, Any]:
    return loaded.get("geometry", {"": loaded})


def _placed(graph: list[dict[str, Any]]) -> Iterator[tuple[str, Array]]:
    """Names of the meshes of a glTF and their poses, once for each node that shows them."""
    above = {entry["frame_to"]: (entry["frame_from"], entry["matrix"]) for entry in graph}
    for entry in graph:
        if "geometry" in entry:
            frame, pose, steps = entry["frame_to"], np.eye(4), 0
            while frame in above:
                frame, matrix = above[frame]
                pose, steps = matrix @ pose, steps + 1
                if steps > len(above):
                    raise ValueError("its nodes stand within one another in a circle")
            yield entry["geometry"], pose


def _require_sane(path: Path, header: Any) -> None:
    """Raise unless a glTF's arrays are no larger than what they are taken from and its nodes are a tree."""
    require_at_most(len(header.get("nodes", ())), NODES, "nodes", path)
    views = header.get("bufferViews", ())
    for accessor in header.get("accessors", ()):
        count, view = accessor.get("count", 0), accessor.get("bufferView")
        if not isinstance(count, int) or count < 0 or view is None or "sparse" in accessor:
            raise FileFormatError(f"{path}: has an accessor with count {count!r} of view {view!r}; that is not read")
        most = int(views[view]["byteLength"])
        require_at_most(count, most, "entries announced by an accessor, more than bytes", path)
    children = [child for node in header.get("nodes", ()) for child in node.get("children", ())]
    if len(children) != len(set(children)):
        raise FileFormatError(f"{path}: has a node within two others")


class _Beside(dict[str, bytes]):
    """Buffers in the folder of a glTF, by their names."""

    def __init__(self, path: Path):
        super().__init__()
        self.path, self.left = path, MESH_BYTES

    def __missing__(self, name: str) -> bytes:
        file = self.path.parent / unquote(name)
        if not file.resolve().is_relative_to(self.path.parent.resolve()):
            raise FileFormatError(f"{self.path}: names the buffer {name!r}, which lies outside its folder")
        self[name] = read_whole(file, (), self.left)
        self.left -= len(self[name])
        return self[name]
