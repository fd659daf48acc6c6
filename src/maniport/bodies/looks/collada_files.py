"""COLLADA (.dae): geometries in XML, and a tree of nodes that places them.

What a file says of materials, textures, cameras and motion is passed over, broken or not.
"""

from collections.abc import Iterator
from pathlib import Path
from xml.etree.ElementTree import Element, fromstring

import numpy as np

from maniport.bodies.chain import Mesh
from maniport.errors import FileFormatError
from maniport.input_limits import NODES, TAGS, TRIANGLES, require_at_most
from maniport.validation import Array

_SHOWN = ("triangles", "polylist", "polygons", "tristrips", "trifans")


def read_collada(path: Path, content: bytes) -> Iterator[Mesh]:
    """Parts of a file in metres; the axis that it says to be upward is not heeded, as ROS does not."""
    require_at_most(content.count(b"<"), TAGS, "tags", path)
    root = fromstring(content)
    things: dict[str, Element] = {}
    for element in root.iter():
        element.tag = element.tag.rpartition("}")[2]
        things.setdefault(f"#{element.get('id')}", element)
    shown = root.find("scene/instance_visual_scene")
    scene = root.find("library_visual_scenes/visual_scene") if shown is None else things.get(shown.get("url", ""))
    if scene is None:
        raise FileFormatError(f"{path}: cannot be read as a mesh: it shows no scene")
    unit = root.find("asset/unit")
    start = np.diag([*(1.0 if unit is None else float(unit.get("meter", "1")),) * 3, 1.0])
    parts: dict[int, list[Mesh]] = {}
    triangles = 0
    for geometry, pose in _placed(path, scene, start, things):
        if id(geometry) not in parts:
            parts[id(geometry)] = list(_parts(geometry, things))
        for points, rows in parts[id(geometry)]:
            triangles += len(rows)
            require_at_most(triangles, TRIANGLES, "triangles", path)
            yield points @ pose[:3, :3].T + pose[:3, 3], rows


def _placed(path: Path, scene: Element, pose: Array, things: dict[str, Element]) -> Iterator[tuple[Element, Array]]:
    """Each geometry where a node shows it; nodes may show other nodes, which makes few many."""
    waiting = [(scene, pose)]
    count = 0
    while waiting:
        node, pose = waiting.pop()
        count += 1
        require_at_most(count, NODES, "nodes, each counted as often as it is shown", path)
        below = []
        for child in node:
            if child.tag == "node":
                below.append((child, pose))
            elif child.tag.startswith("instance_") and child.get("url", "") in things:
                below.append((things[child.get("url", "")], pose))
            elif child.tag == "skin":
                shape = pose @ _matrix(child.find("bind_shape_matrix"))
                below.append((things.get(child.get("source", ""), child), shape))
            elif node.tag == "node":
                pose = pose @ _step(child)
        waiting += reversed(below)
        if node.tag == "geometry":
            yield node, pose


def _step(element: Element) -> Array:
    """What one of the transformations of a node does; those of cameras and what is none do nothing."""
    step = np.eye(4)
    if element.tag == "matrix":
        return _matrix(element)
    if element.tag == "translate":
        step[:3, 3] = _floats(element)
    elif element.tag == "scale":
        step[[0, 1, 2], [0, 1, 2]] = _floats(element)
    elif element.tag == "rotate":
        *axis, degrees = _floats(element)
        step[:3, :3] = _about(np.array(axis), np.radians(degrees))
    elif element.tag == "skew":
        raise ValueError("a node is skewed, which is not read")
    return step


def _matrix(element: Element | None) -> Array:
    return np.eye(4) if element is None else _floats(element).reshape(4, 4)


def _about(axis: Array, angle: float) -> Array:
    """Rotation about an axis (Rodrigues)."""
    x, y, z = axis / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.asarray(np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross)


def _parts(geometry: Element, things: dict[str, Element]) -> Iterator[Mesh]:
    """Points and triangles of each list of polygons, of the points those that it uses."""
    for shape in geometry.iterfind("mesh/*"):
        offsets = [int(entry.get("offset", "0")) for entry in shape.findall("input")]
        vertex = next((entry for entry in shape.findall("input") if entry.get("semantic") == "VERTEX"), None)
        if shape.tag not in _SHOWN or vertex is None:
            continue
        width, column = max(offsets) + 1, int(vertex.get("offset", "0"))
        lists = [_integers(p).reshape(-1, width)[:, column] for p in shape.findall("p")]
        counts = _integers(shape.find("vcount")) if shape.tag == "polylist" else np.array([len(each) for each in lists])
        corners = np.concatenate([np.empty(0, dtype=np.int64), *lists])
        if shape.tag == "triangles":
            rows = corners.reshape(-1, 3)
        elif shape.tag == "tristrips":
            rows = _strips(corners, counts)
        else:
            rows = _fans(corners, counts)
        if len(rows):
            yield _used(_positions(things[vertex.get("source", "")], things), rows)


def _positions(vertices: Element, things: dict[str, Element]) -> Array:
    """Points of a mesh, shape (n, 3)."""
    position = next(entry for entry in vertices.findall("input") if entry.get("semantic") == "POSITION")
    accessor = things[position.get("source", "")].find("technique_common/accessor")
    if accessor is None:
        raise ValueError("its points have no accessor")
    numbers = _floats(things[accessor.get("source", "")])
    count, stride, offset = (int(accessor.get(name, "0")) for name in ("count", "stride", "offset"))
    if count < 0 or stride < 3 or offset < 0 or offset + count * stride > len(numbers):
        raise ValueError(f"{count} points of {stride} numbers are announced; there are {len(numbers)} numbers")
    return numbers[offset : offset + count * stride].reshape(count, stride)[:, :3]


def _used(points: Array, rows: np.ndarray) -> Mesh:
    """A mesh without the points that none of its triangles has; several lists may share very many."""
    if rows.min() < 0 or rows.max() >= len(points):
        raise ValueError(f"a triangle names the point {rows.max() if rows.max() >= len(points) else rows.min()}")
    kept, rows = np.unique(rows, return_inverse=True)
    return points[kept], rows.reshape(-1, 3).astype(np.int32)


def _fans(corners: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """Triangles of polygons, one behind the other in `corners`, of so many corners each; shape (n, 3)."""
    if counts.sum(dtype=np.float64) != len(corners) or counts.min(initial=0) < 0:
        raise ValueError(f"its polygons announce {counts.sum(dtype=np.float64):.0f} corners; there are {len(corners)}")
    most = np.maximum(counts - 2, 0)
    first = np.repeat(np.cumsum(counts) - counts, most)
    second = first + 1 + np.arange(most.sum()) - np.repeat(np.cumsum(most) - most, most)
    return np.asarray(corners[np.stack([first, second, second + 1], axis=1)])


def _strips(corners: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """Triangles of strips, every second one turned over."""
    pieces = []
    for end, count in zip(np.cumsum(counts), counts, strict=True):
        strip = corners[end - count : end]
        rows = np.stack([strip[:-2], strip[1:-1], strip[2:]], axis=1)
        rows[1::2] = rows[1::2, ::-1]
        pieces.append(rows)
    return np.concatenate([np.empty((0, 3), dtype=np.int64), *pieces])


def _floats(element: Element) -> Array:
    return np.fromstring(element.text or "", dtype=np.float64, sep=" ")


def _integers(element: Element | None) -> np.ndarray:
    return np.fromstring("" if element is None else element.text or "", dtype=np.int64, sep=" ")
