"""What the bodies of an MJCF look like.

Pinocchio says what stands where. It does not see the mesh files themselves, which its native reader does not bear: it
reads a copy in which each mesh is one triangle.
"""

from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from tempfile import gettempdir
from xml.etree import ElementTree

import coal
import numpy as np
import pinocchio as pin
from scipy.spatial import ConvexHull, QhullError

from maniport.atomic_io import temporary_beside
from maniport.bodies.chain import Mesh, Shape
from maniport.bodies.looks.mesh_files import scaled
from maniport.bodies.looks.mesh_places import Places, is_file
from maniport.bodies.looks.meshes import box, capsule, cylinder, ellipsoid
from maniport.bodies.readers.document import LARGEST
from maniport.bodies.readers.mjcf_tree import one_tree
from maniport.errors import FileFormatError

_STAND_IN = (
    bytes(80) + (1).to_bytes(4, "little") + np.array([0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0], "<f4").tobytes() + bytes(2)
)
"""An STL of one triangle."""

_OWN = ("vertex", "face", "normal", "texcoord", "builtin", "params")
_FOLDERS = ("meshdir", "assetdir", "strippath")


def read_mjcf_shapes(root: ElementTree.Element, links: Collection[str], places: Places) -> Iterator[Shape]:
    """What some bodies look like; of a body's shapes those that touch nothing, if it has such, else all."""
    meshes = _named_meshes(root, places.path.parent)
    model, shown, solid = _geometries(root, places.path)
    touching = {thing.name for thing in solid.geometryObjects}
    dressed = {thing.parentFrame for thing in shown.geometryObjects if thing.name not in touching}
    for thing in shown.geometryObjects:
        frame = model.frames[thing.parentFrame]
        if frame.name in links and (thing.name not in touching or thing.parentFrame not in dressed):
            placement = (frame.placement.inverse() * thing.placement).homogeneous
            for points, triangles in _meshes(thing, places, meshes):
                yield Shape(frame.name, (points @ placement[:3, :3].T + placement[:3, 3], triangles))


def _named_meshes(root: ElementTree.Element, folder: Path) -> dict[str, Path | ElementTree.Element]:
    """Meshes by what stands in for them: a file, or an element that holds points itself."""
    options = {name: value for compiler in root.findall("compiler") for name, value in compiler.items()}
    folder = folder / options.get("meshdir", options.get("assetdir", ""))
    bare = options.get("strippath") == "true"
    found: dict[str, Path | ElementTree.Element] = {}
    for i, mesh in enumerate(root.iterfind("asset/mesh")):
        name = mesh.get("file", "")
        found[f"{i}.stl"] = folder / (Path(name).name if bare else name) if name else mesh
    return found


def _own_mesh(path: Path, mesh: ElementTree.Element) -> Mesh:
    """Points and triangles that an MJCF holds itself; the hull of the points where it has no triangles."""
    try:
        points = np.array([float(word) for word in mesh.get("vertex", "").split()]).reshape(-1, 3)
        rows = np.array([int(word) for word in mesh.get("face", "").split()], dtype=np.int32).reshape(-1, 3)
        if not np.all(np.abs(points) < LARGEST) or not np.all((rows >= 0) & (rows < len(points))):
            raise ValueError("numbers beyond reason")
        return points, rows if len(rows) else ConvexHull(points).simplices.astype(np.int32)
    except (ValueError, OverflowError, QhullError) as error:
        reason = str(error).splitlines()[0]
        raise FileFormatError(f"{path}: the points of the mesh {mesh.get('name')!r} make no solid: {reason}") from None


def _geometries(root: ElementTree.Element, path: Path) -> tuple[pin.Model, pin.GeometryModel, pin.GeometryModel]:
    """The model, and what of it is to be seen and what touches, each mesh a triangle."""
    root = one_tree(root)
    for compiler in root.findall("compiler"):
        for option in _FOLDERS:
            compiler.attrib.pop(option, None)
    with temporary_beside(Path(gettempdir()) / "maniport", folder=True) as folder:
        for i, mesh in enumerate(root.iterfind("asset/mesh")):
            mesh.set("name", mesh.get("name") or Path(mesh.get("file", "")).stem)
            mesh.set("file", f"{i}.stl")
            for own in _OWN:
                mesh.attrib.pop(own, None)
            (folder / f"{i}.stl").write_bytes(_STAND_IN)
        file = folder / "robot.xml"
        ElementTree.ElementTree(root).write(file, encoding="utf-8")
        try:
            model = pin.buildModelFromMJCF(str(file))
            shown, solid = (pin.buildGeomFromMJCF(model, str(file), kind) for kind in (pin.VISUAL, pin.COLLISION))
        except (ValueError, RuntimeError, IndexError) as error:
            reason = " ".join(str(error).split("message:")[-1].split())
            raise FileFormatError(f"{path}: its shapes cannot be read: {reason}") from None
    return model, shown, solid


def _meshes(
    thing: pin.GeometryObject, places: Places, meshes: Mapping[str, Path | ElementTree.Element]
) -> Iterator[Mesh]:
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
        mesh, scale = meshes[Path(thing.meshPath).name], np.asarray(thing.meshScale)
        if isinstance(mesh, Path):
            yield scaled(places.mesh(_found(mesh, meshes, places)), scale)
        else:
            yield scaled(_own_mesh(places.path, mesh), scale)
    elif not isinstance(shape, (coal.Plane, coal.Halfspace)):
        raise FileFormatError(f"{places.path}: {thing.name!r} has a shape that cannot be drawn: {type(shape).__name__}")


def _found(file: Path, meshes: Mapping[str, Path | ElementTree.Element], places: Places) -> Path:
    """The file of a mesh; an error that counts those that are missing."""
    if not is_file(file):
        there = {other for other in meshes.values() if isinstance(other, Path)}
        missing = sum(not is_file(other) for other in there)
        raise FileFormatError(
            f"{places.path}: the mesh {str(file)!r} is missing ({missing} of {len(there)} meshes are)"
        )
    places.require_allowed(file, str(file))
    return file
