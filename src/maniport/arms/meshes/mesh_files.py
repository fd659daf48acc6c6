"""Triangles of mesh files, read without native code.

COLLADA, glTF and STL are read here, without materials, cameras and animations; trimesh, imported on first use, reads
OBJ, PLY and OFF. Announced sizes are first compared with the size of the file. The time is linear in the size of a
file, however many groups, solids, nodes or lists it has.
"""

import base64
import io
import json
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any
from urllib.parse import unquote
from xml.etree.ElementTree import Element, fromstring

import numpy as np
from numpy.typing import ArrayLike, NDArray
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
    if np.prod(scale) < 0:
        triangles = np.ascontiguousarray(triangles[:, ::-1])
    return points * scale, triangles


def require_no_pointer(path: Path, content: bytes) -> None:
    """Raise `FileFormatError` for a pointer of Git LFS, which a clone without LFS has in place of a file."""
    if content.startswith(b"version https://git-lfs"):
        raise FileFormatError(
            f"{path}: is a pointer of Git LFS, not the file itself; fetch it with git lfs pull"
        )


def load_mesh(path: Path) -> Mesh:
    """Read the points and triangles of a mesh file."""
    content = read_whole(
        path, (".stl", ".dae", ".obj", ".ply", ".off", ".glb", ".gltf"), MESH_BYTES
    )
    require_no_pointer(path, content)
    readers = {".dae": _read_collada, ".stl": _read_stl, ".gltf": _read_gltf, ".glb": _read_gltf}
    read = readers.get(path.suffix.lower(), _read_by_trimesh)
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


def _checked(path: Path, points: ArrayLike, triangles: ArrayLike) -> Mesh:
    """Require valid indices and finite points."""
    positions = np.asarray(points, dtype=np.float64).reshape(-1, 3)
    corners = np.asarray(triangles).reshape(-1, 3)
    require_at_most(max(positions.size, corners.size) // 3, TRIANGLES, "points or triangles", path)
    if corners.size and not (corners.min() >= 0 and corners.max() < len(positions)):
        invalid = corners[(corners < 0) | (corners >= len(positions))][0]
        raise FileFormatError(
            f"{path}: has a triangle with point number {invalid}; there are {len(positions)}"
        )
    if not np.all(np.isfinite(positions)):
        raise FileFormatError(f"{path}: has points that are not finite")
    return positions, corners.astype(np.int32)


def _read_by_trimesh(path: Path, content: bytes) -> Iterator[Mesh]:
    """Read a file in its own axes; polygons are triangulated."""
    from trimesh import load_scene

    kind = path.suffix.lower()[1:]
    if kind == "obj":
        content = _obj_faces(content)
    elif kind == "ply":
        header = content[: content.find(b"end_header")]
        for count in re.findall(rb"^\s*element\s+\S+\s+(\d+)", header, re.MULTILINE):
            require_at_most(
                int(count[:20]), len(content), "elements announced, more than bytes", path
            )
    scene = load_scene(io.BytesIO(content), file_type=kind, skip_materials=True, process=False)
    for part in scene.geometry.values():
        if hasattr(part, "faces"):
            yield np.asarray(part.vertices), part.faces


def _obj_faces(content: bytes) -> bytes:
    """Keep points and faces of an OBJ, without groups, materials, normals and textures.

    trimesh takes time quadratic in the number of groups.
    """
    lines = re.findall(rb"^[ \t]*([vf][ \t].*)", content.replace(b"\\\n", b" "), re.MULTILINE)
    for i, line in enumerate(lines):
        if line.startswith(b"f"):
            lines[i] = re.sub(rb"/\S*", b"", line)
    return b"\n".join(lines) + b"\n"


def _read_stl(path: Path, content: bytes) -> Iterator[Mesh]:
    """Read a binary or a text file, which may hold several solids."""
    count = int.from_bytes(content[80:84], "little")
    if len(content) >= 84 + 50 * count and len(content) >= 84:  # some programs append to it
        facets = np.frombuffer(content, dtype=STL_FACET, count=count, offset=84)
        corners = facets["corners"].astype(np.float64)
    else:
        words = re.findall(rb"\bvertex\s+(\S+\s+\S+\s+\S+)", content, re.IGNORECASE)
        if not words:
            require_at_most(
                84 + 50 * count, len(content), "bytes announced, more than the file has", path
            )
        corners = np.array(b" ".join(words).split(), dtype=np.float64)
        if len(words) % 3:
            raise ValueError(f"its triangles have {len(words)} corners")
    points = corners.reshape(-1, 3)
    yield points, np.arange(len(points), dtype=np.int32).reshape(-1, 3)


STL_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
"""Types of the numbers in a glTF."""
WIDTHS = {"SCALAR": 1, "VEC3": 3}
TRIANGLE_LIST = 4
TRIANGLE_STRIP = 5
TRIANGLE_FAN = 6


def _read_gltf(path: Path, content: bytes) -> Iterator[Mesh]:
    """Parts of a glTF, one for each node with a mesh, in its own axes."""
    binary = b""
    if path.suffix.lower() == ".glb":
        length = int.from_bytes(content[12:16], "little")
        binary = content[28 + length :]
        content = content[20 : 20 + length]
    header = json.loads(content.decode("utf-8"))
    _require_sane(path, header)
    file = _Gltf(path, header, binary)
    nodes = header.get("nodes", [])
    scenes = header.get("scenes", [])
    if scenes:
        roots = scenes[header.get("scene", 0)].get("nodes", [])
    else:
        children = set[int]()
        for node in nodes:
            children.update(node.get("children", ()))
        roots = [i for i in range(len(nodes)) if i not in children]

    waiting = [(root, np.eye(4)) for root in reversed(roots)]
    seen = set[int]()
    triangles = 0
    while waiting:
        index, above = waiting.pop()
        if index in seen:
            raise ValueError("its nodes are no tree: one has two parents, or is in a circle")
        seen.add(index)
        node = nodes[index]
        pose = above @ _node_pose(node)
        waiting += [(child, pose) for child in reversed(node.get("children", []))]
        if "mesh" in node:
            points, rows = file.mesh(node["mesh"])
            triangles += len(rows)
            require_at_most(triangles, TRIANGLES, "triangles", path)
            yield points @ pose[:3, :3].T + pose[:3, 3], rows


def _node_pose(node: dict[str, Any]) -> Array:
    """Return the transformation (4, 4) of a node, with its scale."""
    if "matrix" in node:
        return np.array(node["matrix"], dtype=np.float64).reshape(4, 4).T
    pose = np.eye(4)
    turn = Rotation.from_quat(node.get("rotation", (0.0, 0.0, 0.0, 1.0))).as_matrix()
    pose[:3, :3] = turn * np.array(node.get("scale", (1.0, 1.0, 1.0)), dtype=np.float64)
    pose[:3, 3] = node.get("translation", (0.0, 0.0, 0.0))
    return pose


class _Gltf:
    """Meshes of a glTF; arrays and meshes are read once."""

    def __init__(self, path: Path, header: dict[str, Any], binary: bytes):
        self.header = header
        self.binary = binary
        self.files = _Buffers(path)
        self.mesh = cache(self._mesh)
        self._array = cache(self._read_array)
        self._buffer = cache(self._read_buffer)

    def _mesh(self, index: int) -> Mesh:
        """Points and triangles of all primitives of a mesh."""
        parts: list[Mesh] = [(np.empty((0, 3)), np.empty((0, 3), dtype=np.int64))]
        for primitive in self.header["meshes"][index]["primitives"]:
            mode = primitive.get("mode", TRIANGLE_LIST)
            if mode not in (TRIANGLE_LIST, TRIANGLE_STRIP, TRIANGLE_FAN):
                continue
            points = self._array(primitive["attributes"]["POSITION"]).astype(np.float64)
            corners = np.arange(len(points))
            if "indices" in primitive:
                corners = self._array(primitive["indices"])[:, 0].astype(np.int64)
            if len(corners) and not corners.max() < len(points):
                raise ValueError(f"a triangle has point number {corners.max()} of {len(points)}")
            parts.append((points, _triangles(corners, mode)))
        return joined(parts)

    def _read_array(self, index: int) -> np.ndarray:
        """Numbers of an accessor, shape (n, width)."""
        accessor = self.header["accessors"][index]
        view = self.header["bufferViews"][accessor["bufferView"]]
        kind = np.dtype(COMPONENTS[accessor["componentType"]])
        width = WIDTHS[accessor["type"]]
        start = int(view.get("byteOffset", 0)) + int(accessor.get("byteOffset", 0))
        stride = int(view.get("byteStride", 0)) or width * kind.itemsize
        if start < 0 or stride < 0:
            raise ValueError(f"an array begins at byte {start} with steps of {stride} bytes")
        array = np.ndarray(
            (accessor["count"], width),
            kind,
            self._buffer(view["buffer"]),
            start,
            (stride, kind.itemsize),
        )
        if accessor.get("normalized") and kind.kind != "f":
            return np.maximum(array / np.iinfo(kind).max, -1.0)
        return array

    def _read_buffer(self, index: int) -> bytes:
        uri = self.header["buffers"][index].get("uri")
        if uri is None:
            return self.binary
        if uri.startswith("data:"):
            return base64.b64decode(uri.partition(",")[2])
        return self.files[uri]


def _triangles(corners: np.ndarray, mode: int) -> np.ndarray:
    """Triangles (n, 3) of a list, a strip or a fan of corners."""
    if mode == TRIANGLE_LIST:
        return corners.reshape(-1, 3)
    first = np.arange(max(len(corners) - 2, 0))
    if mode == TRIANGLE_FAN:
        return np.stack([np.full(len(first), corners[:1]), corners[1:-1], corners[2:]], axis=1)
    rows = np.stack([first, first + 1 + first % 2, first + 2 - first % 2], axis=1)
    return corners[rows]


def _require_sane(path: Path, header: Any) -> None:
    """Require arrays of a glTF within their buffers."""
    require_at_most(len(header.get("nodes", ())), NODES, "nodes", path)
    views = header.get("bufferViews", ())
    for accessor in header.get("accessors", ()):
        count = accessor.get("count", 0)
        view = accessor.get("bufferView")
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
        self.path = path
        self.left = MESH_BYTES

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
    if scene is None:
        scene = root.find("library_visual_scenes/visual_scene")
    else:
        scene = things.get(scene.get("url", ""))
    if scene is None:
        raise FileFormatError(f"{path}: cannot be read as a mesh: it has no scene")
    unit = root.find("asset/unit")
    waiting = [
        (scene, np.diag([*(1.0 if unit is None else float(unit.get("meter", "1")),) * 3, 1.0]))
    ]
    parts: dict[int, Mesh | None] = {}  # of each geometry
    positions: dict[str, Array] = {}  # of each list of points
    nodes = 0
    triangles = 0
    while waiting:  # nodes may instantiate nodes, exponentially many
        node, pose = waiting.pop()
        nodes += 1
        require_at_most(nodes, NODES, "nodes, counted for each instance", path)
        below, pose = _children(node, pose, things)
        waiting += reversed(below)
        if node.tag != "geometry":
            continue
        if id(node) not in parts:
            lists = list(_polygons(path, node, things, positions))
            parts[id(node)] = joined(lists) if lists else None
        mesh = parts[id(node)]
        if mesh is not None:
            points, rows = mesh
            triangles += len(rows)
            require_at_most(triangles, TRIANGLES, "triangles", path)
            yield points @ pose[:3, :3].T + pose[:3, 3], rows


def _children(
    node: Element, pose: Array, things: dict[str, Element]
) -> tuple[list[tuple[Element, Array]], Array]:
    """Return the nodes, skins and instances in a node with their poses, and the pose after all of its steps."""
    children = []
    for child in node:
        if child.tag == "node":
            children.append((child, pose))
        elif child.tag.startswith("instance_") and child.get("url", "") in things:
            children.append((things[child.get("url", "")], pose))
        elif child.tag == "skin":
            bind = child.find("bind_shape_matrix")
            shape = pose if bind is None else pose @ _numbers(bind).reshape(4, 4)
            children.append((things.get(child.get("source", ""), child), shape))
        elif node.tag == "node":
            pose = pose @ _step(child)
    return children, pose


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


def _polygons(
    path: Path, geometry: Element, things: dict[str, Element], positions: dict[str, Array]
) -> Iterator[Mesh]:
    """Points and triangles of each list of polygons; unused points are dropped, since lists may share many points."""
    lists = geometry.findall("mesh/*")
    require_at_most(len(lists), NODES, "lists of polygons in a geometry", path)
    for shape in lists:
        inputs = {entry.get("semantic"): entry for entry in shape.findall("input")}
        if shape.tag in ("tristrips", "trifans"):
            raise ValueError(f"it holds <{shape.tag}>, which are not supported; write triangles")
        if shape.tag not in ("triangles", "polylist", "polygons") or "VERTEX" not in inputs:
            continue
        rows = _corners(shape, int(inputs["VERTEX"].get("offset", "0")))
        if len(rows):
            kept, rows = np.unique(rows, return_inverse=True)
            if kept[0] < 0:
                raise ValueError(f"a triangle names the point {kept[0]}")
            source = inputs["VERTEX"].get("source", "")
            if source not in positions:
                positions[source] = _positions(things[source], things)
            points = positions[source]
            yield points[kept], rows.reshape(-1, 3).astype(np.int32)


def _corners(shape: Element, column: int) -> NDArray[np.int64]:
    """Return numbers of the corners (n, 3) of the triangles in a list of polygons; `column` is that of the points."""
    width = max(int(entry.get("offset", "0")) for entry in shape.findall("input")) + 1
    polygons = [np.empty(0, dtype=np.int64)]
    for p in shape.findall("p"):
        polygons.append(_numbers(p, np.int64).reshape(-1, width)[:, column])
    corners = np.concatenate(polygons)
    if shape.tag == "triangles":
        return corners.reshape(-1, 3)

    # triangulate each polygon as a fan
    counts = np.array([len(polygon) for polygon in polygons[1:]])
    if shape.tag == "polylist":
        counts = _numbers(shape.find("vcount"), np.int64)
    total = counts.sum(dtype=np.float64)
    if total != len(corners) or counts.min(initial=0) < 0:
        raise ValueError(f"its polygons announce {total:.0f} corners; there are {len(corners)}")
    sizes = np.maximum(counts - 2, 0)
    first = np.repeat(np.cumsum(counts) - counts, sizes)
    before = np.repeat(np.cumsum(sizes) - sizes, sizes)
    second = first + 1 + np.arange(sizes.sum()) - before
    triangles = np.stack([first, second, second + 1], axis=1)
    return np.asarray(corners[triangles])


def _positions(vertices: Element, things: dict[str, Element]) -> Array:
    """Points of a mesh, shape (n, 3)."""
    position = next(
        entry for entry in vertices.findall("input") if entry.get("semantic") == "POSITION"
    )
    accessor = things[position.get("source", "")].find("technique_common/accessor")
    if accessor is None:
        raise ValueError("its points have no accessor")
    numbers = _numbers(things[accessor.get("source", "")])
    count = int(accessor.get("count", "0"))
    stride = int(accessor.get("stride", "0"))
    offset = int(accessor.get("offset", "0"))
    if count < 0 or stride < 3 or offset < 0:
        raise ValueError(f"{count} points of {stride} numbers are announced, from {offset}")
    return np.asarray(numbers[offset : offset + count * stride].reshape(count, stride)[:, :3])


def _numbers(element: Element | None, kind: type = np.float64) -> np.ndarray:
    return np.fromstring("" if element is None else element.text or "", dtype=kind, sep=" ")
