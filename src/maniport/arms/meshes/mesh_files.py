"""Triangles of mesh files, read without native code.

COLLADA is read here, without materials, cameras and animations; trimesh, imported on first use, reads the others.
Announced sizes are first compared with the size of the file.
"""

import io
import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import unquote
from xml.etree.ElementTree import Element, fromstring

import numpy as np
from scipy.spatial.transform import Rotation

from maniport.arms.chain import Mesh
from maniport.arms.meshes import joined
from maniport.errors import FileFormatError
from maniport.util.input_limits import (
    MESH_BYTES,
    NODES,
    TAGS,
    TRIANGLES,
    read_whole,
    require_at_most,
)
from maniport.util.validation import Array


def scaled(mesh: Mesh, scale: Array) -> Mesh:
    """Scale a mesh; a negative scale mirrors it, and reversed triangles keep their outside."""
    points, triangles = mesh
    return points * scale, np.ascontiguousarray(triangles[:, ::-1]) if np.prod(
        scale
    ) < 0 else triangles


def load_mesh(path: Path) -> Mesh:
    """Read the points and triangles of a mesh file."""
    content = read_whole(
        path, (".stl", ".dae", ".obj", ".ply", ".off", ".glb", ".gltf"), MESH_BYTES
    )
    read = _read_collada if path.suffix.lower() == ".dae" else _read_by_trimesh
    try:
        with np.errstate(all="ignore"):  # `_checked` refuses nonfinite points
            parts = [_checked(path, *part) for part in read(path, content)]
    except FileFormatError:
        raise
    except Exception as error:  # noqa: BLE001 - libraries raise anything for damaged files
        reason = " ".join(str(error).split())[:200] or type(error).__name__
        raise FileFormatError(f"{path}: cannot be read as a mesh: {reason}") from None
    if not any(len(triangles) for _, triangles in parts):
        raise FileFormatError(f"{path}: has no triangle")
    points, triangles = joined(parts)
    require_at_most(len(triangles), TRIANGLES, "triangles", path)
    return points, triangles


def _checked(path: Path, points: Any, triangles: Any) -> Mesh:
    """Require valid indices and finite points."""
    points, triangles = (
        np.asarray(points, dtype=np.float64).reshape(-1, 3),
        np.asarray(triangles).reshape(-1, 3),
    )
    require_at_most(max(points.size, triangles.size) // 3, TRIANGLES, "points or triangles", path)
    if triangles.size and not (triangles.min() >= 0 and triangles.max() < len(points)):
        invalid = triangles[(triangles < 0) | (triangles >= len(points))][0]
        raise FileFormatError(
            f"{path}: has a triangle with point number {invalid}; there are {len(points)}"
        )
    if not np.all(np.isfinite(points)):
        raise FileFormatError(f"{path}: has points that are not finite")
    return points, triangles.astype(np.int32)


def _read_by_trimesh(path: Path, content: bytes) -> Iterator[Mesh]:
    """Parts of a file in its own axes; polygons are triangulated."""
    from trimesh import load_scene

    kind = path.suffix.lower()[1:]
    if kind == "stl":
        announced = 84 + 50 * int.from_bytes(content[80:84], "little")
        content = content[:announced] if announced >= 84 else content  # some programs append to it
    elif kind == "ply":
        header = content[: content.find(b"end_header")]
        for count in re.findall(rb"^\s*element\s+\S+\s+(\d+)", header, re.MULTILINE):
            require_at_most(
                int(count[:20]), len(content), "elements announced, more than bytes", path
            )
    elif kind in ("gltf", "glb"):
        text = (
            content[20 : 20 + int.from_bytes(content[12:16], "little")]
            if kind == "glb"
            else content
        )
        _require_sane(path, json.loads(text.decode("utf-8")))
    scene = load_scene(
        io.BytesIO(content),
        file_type=kind,
        resolver=_Buffers(path),
        skip_materials=True,
        process=False,
    )
    triangles = 0
    for name in scene.graph.nodes_geometry:
        pose, geometry = scene.graph[name]
        part = scene.geometry[geometry]
        triangles += len(getattr(part, "faces", ()))
        require_at_most(triangles, TRIANGLES, "triangles", path)
        if hasattr(part, "faces"):
            yield np.asarray(part.vertices) @ pose[:3, :3].T + pose[:3, 3], part.faces


def _require_sane(path: Path, header: Any) -> None:
    """Require arrays of a glTF within their buffers, and nodes that form a tree."""
    require_at_most(len(header.get("nodes", ())), NODES, "nodes", path)
    views = header.get("bufferViews", ())
    for accessor in header.get("accessors", ()):
        count, view = accessor.get("count", 0), accessor.get("bufferView")
        if not isinstance(count, int) or count < 0 or view is None or "sparse" in accessor:
            raise FileFormatError(
                f"{path}: has an accessor with count {count!r} of view {view!r}; that is not supported"
            )
        most = int(views[view]["byteLength"])
        require_at_most(count, most, "entries announced by an accessor, more than bytes", path)


class _Buffers(dict[str, bytes]):
    """Buffers in the folder of a glTF, by their names."""

    def __init__(self, path: Path):
        super().__init__()
        self.path, self.left = path, MESH_BYTES

    def __missing__(self, name: str) -> bytes:
        file = self.path.parent / unquote(name)
        if not file.resolve().is_relative_to(self.path.parent.resolve()):
            raise FileFormatError(
                f"{self.path}: names the buffer {name!r}, which lies outside its folder"
            )
        self[name] = read_whole(file, (), self.left)
        self.left -= len(self[name])
        return self[name]


def _read_collada(path: Path, content: bytes) -> Iterator[Mesh]:
    """Parts of a file in meters; as in ROS, the up axis is ignored."""
    require_at_most(content.count(b"<"), TAGS, "tags", path)
    root = fromstring(content)
    things: dict[str, Element] = {}
    for element in root.iter():
        element.tag = element.tag.rpartition("}")[2]
        things.setdefault(f"#{element.get('id')}", element)
    scene = root.find("scene/instance_visual_scene")
    scene = (
        root.find("library_visual_scenes/visual_scene")
        if scene is None
        else things.get(scene.get("url", ""))
    )
    if scene is None:
        raise FileFormatError(f"{path}: cannot be read as a mesh: it has no scene")
    unit = root.find("asset/unit")
    waiting = [
        (scene, np.diag([*(1.0 if unit is None else float(unit.get("meter", "1")),) * 3, 1.0]))
    ]
    parts: dict[int, list[Mesh]] = {}  # of each geometry
    nodes = triangles = 0
    while waiting:  # nodes may instantiate nodes, exponentially many
        node, pose = waiting.pop()
        nodes += 1
        require_at_most(nodes, NODES, "nodes, counted for each instance", path)
        below = []
        for child in node:
            if child.tag == "node":
                below.append((child, pose))
            elif child.tag.startswith("instance_") and child.get("url", "") in things:
                below.append((things[child.get("url", "")], pose))
            elif child.tag == "skin":
                bind = child.find("bind_shape_matrix")
                shape = pose if bind is None else pose @ _numbers(bind).reshape(4, 4)
                below.append((things.get(child.get("source", ""), child), shape))
            elif node.tag == "node":
                pose = pose @ _step(child)
        waiting += reversed(below)
        if node.tag == "geometry":
            if id(node) not in parts:
                parts[id(node)] = list(_polygons(node, things))
            for points, rows in parts[id(node)]:
                triangles += len(rows)
                require_at_most(triangles, TRIANGLES, "triangles", path)
                yield points @ pose[:3, :3].T + pose[:3, 3], rows


def _step(element: Element) -> Array:
    """Return transformation of an element of a node; identity for other elements."""
    step = np.eye(4)
    if element.tag == "matrix":
        return _numbers(element).reshape(4, 4)
    if element.tag == "translate":
        step[:3, 3] = _numbers(element)
    elif element.tag == "scale":
        step[:3, :3] = np.diag(_numbers(element))
    elif element.tag == "rotate":
        *axis, degrees = _numbers(element)
        step[:3, :3] = Rotation.from_rotvec(
            np.radians(degrees) * np.array(axis) / np.linalg.norm(axis)
        ).as_matrix()
    elif element.tag == "skew":
        raise ValueError("<skew> is not supported")
    return step


def _polygons(geometry: Element, things: dict[str, Element]) -> Iterator[Mesh]:
    """Points and triangles of each list of polygons; unused points are dropped, since lists may share many points."""
    for shape in geometry.iterfind("mesh/*"):
        inputs = {entry.get("semantic"): entry for entry in shape.findall("input")}
        if shape.tag in ("tristrips", "trifans"):
            raise ValueError(f"it holds <{shape.tag}>, which are not supported; write triangles")
        if shape.tag not in ("triangles", "polylist", "polygons") or "VERTEX" not in inputs:
            continue
        width = max(int(entry.get("offset", "0")) for entry in shape.findall("input")) + 1
        column = int(inputs["VERTEX"].get("offset", "0"))
        lists = [_numbers(p, np.int64).reshape(-1, width)[:, column] for p in shape.findall("p")]
        corners = np.concatenate([np.empty(0, dtype=np.int64), *lists])
        rows = corners.reshape(-1, 3) if shape.tag == "triangles" else corners
        if shape.tag != "triangles":  # triangulate each polygon as a fan
            counts = np.array([len(polygon) for polygon in lists])
            counts = _numbers(shape.find("vcount"), np.int64) if shape.tag == "polylist" else counts
            total = counts.sum(dtype=np.float64)
            if total != len(corners) or counts.min(initial=0) < 0:
                raise ValueError(
                    f"its polygons announce {total:.0f} corners; there are {len(corners)}"
                )
            sizes = np.maximum(counts - 2, 0)
            first = np.repeat(np.cumsum(counts) - counts, sizes)
            second = first + 1 + np.arange(sizes.sum()) - np.repeat(np.cumsum(sizes) - sizes, sizes)
            rows = corners[np.stack([first, second, second + 1], axis=1)]
        if len(rows):
            kept, rows = np.unique(rows, return_inverse=True)
            if kept[0] < 0:
                raise ValueError(f"a triangle names the point {kept[0]}")
            points = _positions(things[inputs["VERTEX"].get("source", "")], things)
            yield points[kept], rows.reshape(-1, 3).astype(np.int32)


def _positions(vertices: Element, things: dict[str, Element]) -> Array:
    """Points of a mesh, shape (n, 3)."""
    position = next(
        entry for entry in vertices.findall("input") if entry.get("semantic") == "POSITION"
    )
    accessor = things[position.get("source", "")].find("technique_common/accessor")
    if accessor is None:
        raise ValueError("its points have no accessor")
    numbers = _numbers(things[accessor.get("source", "")])
    count, stride, offset = (int(accessor.get(name, "0")) for name in ("count", "stride", "offset"))
    if count < 0 or stride < 3 or offset < 0:
        raise ValueError(f"{count} points of {stride} numbers are announced, from {offset}")
    return np.asarray(numbers[offset : offset + count * stride].reshape(count, stride)[:, :3])


def _numbers(element: Element | None, kind: type = np.float64) -> np.ndarray:
    return np.fromstring("" if element is None else element.text or "", dtype=kind, sep=" ")
