"""glTF and GLB: a tree of nodes in JSON that shows arrays, by trimesh."""

import io
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np

from maniport.bodies.chain import Mesh
from maniport.errors import FileFormatError
from maniport.input_limits import MESH_BYTES, NODES, TRIANGLES, read_whole, require_at_most


def read_gltf(path: Path, content: bytes) -> Iterator[Mesh]:
    """Parts of a file in metres, in its own axes; of other files it may name buffers in its folder."""
    from trimesh.exchange.gltf import load_glb, load_gltf

    binary = path.suffix.lower() == ".glb"
    text = content[20 : 20 + int.from_bytes(content[12:16], "little")] if binary else content
    header = json.loads(text.decode("utf-8"))
    require_at_most(len(header.get("nodes", ())), NODES, "nodes", path)
    _require_sane(path, header)
    load = load_glb if binary else load_gltf
    loaded = load(io.BytesIO(content), resolver=_Beside(path), skip_materials=True)
    above = {entry["frame_to"]: (entry["frame_from"], entry["matrix"]) for entry in loaded["graph"]}
    triangles = 0
    for entry in loaded["graph"]:
        mesh = loaded["geometry"].get(entry.get("geometry"), {})
        if "faces" not in mesh:
            continue
        triangles += len(mesh["faces"])
        require_at_most(triangles, TRIANGLES, "triangles", path)
        pose = _pose(path, entry["frame_to"], above)
        yield np.asarray(mesh["vertices"], dtype=np.float64) @ pose[:3, :3].T + pose[:3, 3], mesh["faces"]


def _pose(path: Path, frame: str, above: dict[str, tuple[str, np.ndarray]]) -> np.ndarray:
    """Where a node stands."""
    pose, steps = np.eye(4), 0
    while frame in above:
        frame, matrix = above[frame]
        pose, steps = matrix @ pose, steps + 1
        if steps > len(above):
            raise FileFormatError(f"{path}: its nodes stand within one another in a circle")
    return pose


def _require_sane(path: Path, header: Any) -> None:
    """Raise unless arrays are no larger than what they are taken from and nodes are a tree."""
    views = header.get("bufferViews", ())
    for accessor in header.get("accessors", ()):
        count, view = accessor.get("count", 0), accessor.get("bufferView")
        if not isinstance(count, int) or count < 0 or view is None or "sparse" in accessor:
            raise FileFormatError(f"{path}: has an accessor with count {count!r} of view {view!r}; that is not read")
        require_at_most(
            count, int(views[view]["byteLength"]), "entries announced by an accessor, more than bytes", path
        )
    children = [child for node in header.get("nodes", ()) for child in node.get("children", ())]
    if len(children) != len(set(children)):
        raise FileFormatError(f"{path}: has a node within two others")


class _Beside(dict[str, bytes]):
    """Buffers beside a file, by their names."""

    def __init__(self, path: Path):
        super().__init__()
        self.path, self.left = path, MESH_BYTES

    def __missing__(self, name: str) -> bytes:
        file = self.path.parent / unquote(name)
        if not file.resolve().is_relative_to(self.path.parent.resolve()):
            raise FileFormatError(f"{self.path}: names the buffer {name!r}, which lies outside its folder")
        content = read_whole(file, (), self.left)
        self.left -= len(content)
        self[name] = content
        return content
