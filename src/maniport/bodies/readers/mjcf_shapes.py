"""What the bodies of an MJCF look like.

Pinocchio says what stands where. It does not see the mesh files themselves, which its native reader does not bear: it
reads a copy in which each mesh is one triangle.
"""

import copy
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from xml.etree import ElementTree

import coal
import numpy as np
import pinocchio as pin

from maniport.bodies.chain import Mesh, Shape
from maniport.bodies.looks.mesh_files import load_mesh
from maniport.bodies.looks.mesh_places import Places
from maniport.bodies.looks.meshes import box, capsule, cylinder, ellipsoid
from maniport.errors import FileFormatError

_STAND_IN = (
    bytes(80) + (1).to_bytes(4, "little") + np.array([0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0], "<f4").tobytes() + bytes(2)
)
"""An STL of one triangle."""

_FOLDERS = ("meshdir", "assetdir", "strippath")


def read_mjcf_shapes(root: ElementTree.Element, links: Collection[str], places: Places) -> Iterator[Shape]:
    """What some bodies look like; of a body's shapes those that touch nothing, if it has such, else all."""
    files = _mesh_files(root, places.path.parent)
    model, shown, solid = _geometries(root, places.path)
    touching = {thing.name for thing in solid.geometryObjects}
    dressed = {thing.parentFrame for thing in shown.geometryObjects if thing.name not in touching}
    for thing in shown.geometryObjects:
        frame = model.frames[thing.parentFrame]
        if frame.name in links and (thing.name not in touching or thing.parentFrame not in dressed):
            placement = (frame.placement.inverse() * thing.placement).homogeneous
            for points, triangles in _meshes(thing, places, files):
                yield Shape(frame.name, (points @ placement[:3, :3].T + placement[:3, 3], triangles))


def _mesh_files(root: ElementTree.Element, folder: Path) -> dict[str, Path]:
    """Files of the meshes, by what stands in for them."""
    options = {name: value for compiler in root.findall("compiler") for name, value in compiler.items()}
    folder = folder / options.get("meshdir", options.get("assetdir", ""))
    bare = options.get("strippath") == "true"
    names = [mesh.get("file", "") for mesh in root.iterfind("asset/mesh")]
    return {f"{i}.stl": folder / (Path(name).name if bare else name) for i, name in enumerate(names) if name}


def _geometries(root: ElementTree.Element, path: Path) -> tuple[pin.Model, pin.GeometryModel, pin.GeometryModel]:
    """The model, and what of it is to be seen and what touches, each mesh a triangle."""
    root = copy.deepcopy(root)
    for compiler in root.findall("compiler"):
        for option in _FOLDERS:
            compiler.attrib.pop(option, None)
    with TemporaryDirectory(prefix="maniport-") as folder:
        for i, mesh in enumerate(root.iterfind("asset/mesh")):
            if mesh.get("file"):
                mesh.set("name", mesh.get("name") or Path(mesh.get("file", "")).stem)
                mesh.set("file", f"{i}.stl")
                (Path(folder) / f"{i}.stl").write_bytes(_STAND_IN)
        file = Path(folder) / "robot.xml"
        ElementTree.ElementTree(root).write(file, encoding="utf-8")
        try:
            model = pin.buildModelFromMJCF(str(file))
            shown, solid = (pin.buildGeomFromMJCF(model, str(file), kind) for kind in (pin.VISUAL, pin.COLLISION))
        except (ValueError, RuntimeError, IndexError) as error:
            reason = " ".join(str(error).split("message:")[-1].split())
            raise FileFormatError(f"{path}: its shapes cannot be read: {reason}") from None
    return model, shown, solid


def _meshes(thing: pin.GeometryObject, places: Places, files: Mapping[str, Path]) -> Iterator[Mesh]:
    """The mesh of one of Coal's shapes; none for planes, which have no end."""
    shape = thing.geometry
    if isinstance(shape, coal.Box):
        yield box(2 * shape.halfSide)
    elif isinstance(shape, coal.Sphere):
        yield ellipsoid((shape.radius,) * 3)
    elif isinstance(shape, coal.Ellipsoid):
        yield ellipsoid(shape.radii)
    elif isinstance(shape, coal.Cylinder):
        yield cylinder(shape.radius, 2 * shape.halfLength)
    elif isinstance(shape, coal.Capsule):
        yield capsule(shape.radius, 2 * shape.halfLength)
    elif isinstance(shape, coal.BVHModelBase):
        yield load_mesh(_found(files, Path(thing.meshPath).name, places), np.asarray(thing.meshScale))
    elif isinstance(shape, coal.Convex):
        rows = [(t[0], t[1], t[2]) for t in map(shape.polygons, range(shape.num_polygons))]
        yield np.array(shape.points()), np.array(rows, dtype=np.int32).reshape(-1, 3)
    elif not isinstance(shape, (coal.Plane, coal.Halfspace)):
        raise FileFormatError(f"{places.path}: {thing.name!r} has a shape that cannot be drawn: {type(shape).__name__}")


def _found(files: Mapping[str, Path], name: str, places: Places) -> Path:
    """The file of a mesh; an error that counts those that are missing."""
    file = files[name]
    if not file.is_file():
        there = set(files.values())
        missing = sum(not other.is_file() for other in there)
        raise FileFormatError(
            f"{places.path}: the mesh {str(file)!r} is missing ({missing} of {len(there)} meshes are)"
        )
    places.require_allowed(file, str(file))
    return file
