"""What the links of a robot look like, read from its URDF or MJCF and the meshes they name, or from data of ours."""

from collections.abc import Collection, Iterator
from pathlib import Path
from xml.etree import ElementTree

import coal
import numpy as np
import pinocchio as pin

from maniport.bodies.chain import pose
from maniport.bodies.mesh import Mesh
from maniport.bodies.mesh_files import find_mesh, load_mesh, mesh_of, reason, rows_of, search_rule
from maniport.bodies.robot_xml import RobotXML, read_robot_xml
from maniport.bodies.shape_data import SUFFIX, read_shape_data
from maniport.bodies.solids import box, capsule, cylinder, ellipsoid
from maniport.bodies.surface import Shape
from maniport.errors import FileFormatError

_FARTHEST = 1e4
"""No shape of an arm reaches that far [m]; most likely its unit is wrong."""


def read_shapes(path: Path, links: Collection[str]) -> list[Shape]:
    """Read what some links look like.

    Parameters
    ----------
    path : Path
        A URDF, an MJCF, or a file of `maniport.bodies.shape_data`.
    links : collection of str
        Names of the links (bodies) of interest; meshes of other links of a URDF may be missing.

    Raises
    ------
    FileFormatError
        When a file is missing, unreadable or inconsistent; the message names it.
    """
    if path.suffix == SUFFIX:
        return [shape for shape in read_shape_data(path) if shape.link in links]
    source = read_robot_xml(path)
    shapes = list(_urdf_shapes(source, links) if source.is_urdf else _mjcf_shapes(source, links))
    for shape in shapes:
        if not np.all(np.abs(shape.mesh[0]) < _FARTHEST):  # false for nan, too
            raise FileFormatError(f"{path}: a shape of link {shape.link!r} reaches farther than {_FARTHEST:g} m")
    return shapes


# ---- URDF ----------------------------------------------------------------------------------------------------------


def _urdf_shapes(source: RobotXML, links: Collection[str]) -> Iterator[Shape]:
    """What stands under <visual>; Pinocchio's reader knows no capsules and passes over faults."""
    visuals = [
        (link.get("name", ""), visual)
        for link in source.root.findall("link")
        if link.get("name") in links
        for visual in link.findall("visual")
    ]
    files = _mesh_paths(source.path, [visual for _, visual in visuals])
    for link, visual in visuals:
        points, triangles = _urdf_mesh(source.path, link, visual, files)
        origin = visual.find("origin")
        if origin is not None:
            xyz, rpy = (_numbers(source.path, link, origin, name, 3, "0 0 0") for name in ("xyz", "rpy"))
            placement = pose(xyz, rpy)
            points = points @ placement[:3, :3].T + placement[:3, 3]
        yield Shape(link, (points, triangles))


def _mesh_paths(path: Path, visuals: list[ElementTree.Element]) -> dict[str, Path]:
    """Files of the meshes that are named, all of them; an error that counts the missing ones."""
    elements = [visual.find("geometry/mesh") for visual in visuals]
    names = dict.fromkeys(element.get("filename", "") for element in elements if element is not None)
    files = {name: find_mesh(name, path.parent) for name in names if name}
    missing = [name for name, file in files.items() if file is None]
    if missing:
        raise FileFormatError(
            f"{path}: the mesh {missing[0]!r} is missing ({len(missing)} of {len(files)} meshes are); looked "
            f"{search_rule(missing[0], path.parent)}"
        )
    return {name: file for name, file in files.items() if file is not None}


def _urdf_mesh(path: Path, link: str, visual: ElementTree.Element, files: dict[str, Path]) -> Mesh:
    """The mesh of one <visual> in its own frame."""
    geometry = visual.find("geometry")
    kind = geometry[0] if geometry is not None and len(geometry) else None
    if kind is None:
        raise FileFormatError(f"{path}: a <visual> of link {link!r} holds no <geometry>")
    if kind.tag == "mesh":
        name = kind.get("filename", "")
        if not name:
            raise FileFormatError(f"{path}: a <mesh> of link {link!r} names no file")
        return load_mesh(files[name], np.array(_numbers(path, link, kind, "scale", 3, "1 1 1")))
    if kind.tag == "box":
        return box(_numbers(path, link, kind, "size", 3))
    if kind.tag not in ("sphere", "cylinder", "capsule"):
        raise FileFormatError(
            f"{path}: link {link!r} has the shape <{kind.tag}>; allowed are mesh, box, sphere, cylinder and capsule"
        )
    (radius,) = _numbers(path, link, kind, "radius", 1)
    if kind.tag == "sphere":
        return ellipsoid((radius,) * 3)
    (length,) = _numbers(path, link, kind, "length", 1)
    return cylinder(radius, length) if kind.tag == "cylinder" else capsule(radius, length)


def _numbers(
    path: Path, link: str, element: ElementTree.Element, name: str, count: int, default: str | None = None
) -> list[float]:
    """Finite numbers of an attribute, not negative where there is no default, that is, for sizes."""
    text = element.get(name, default)
    try:
        numbers = [float(word) for word in (text or "").split()]
    except ValueError:
        numbers = []
    if len(numbers) != count or not np.all(np.isfinite(numbers)) or (default is None and min(numbers) < 0):
        rule = f"{count} finite {'' if default else 'non-negative '}number{'s' if count > 1 else ''}"
        raise FileFormatError(f"{path}: <{element.tag}> of link {link!r} needs {name} with {rule}; found {text!r}")
    return numbers


# ---- MJCF ----------------------------------------------------------------------------------------------------------


def _mjcf_shapes(source: RobotXML, links: Collection[str]) -> Iterator[Shape]:
    """What Pinocchio finds to show; of a body's shapes those that touch nothing, if it has such, else all."""
    try:
        model = pin.buildModelFromMJCF(str(source.path))
        shown, solid = (pin.buildGeomFromMJCF(model, str(source.path), kind) for kind in (pin.VISUAL, pin.COLLISION))
    except (ValueError, RuntimeError, IndexError) as error:
        file, why = reason(error)
        if file is None:
            raise FileFormatError(f"{source.path}: its shapes cannot be read: {why}") from None
        if Path(file).is_file():
            raise FileFormatError(f"{file}: cannot be read as a mesh: {why}") from None
        raise FileFormatError(f"{source.path}: the mesh {file!r} is missing ({_count_missing(source)})") from None
    touching = {thing.name for thing in solid.geometryObjects}
    dressed = {thing.parentFrame for thing in shown.geometryObjects if thing.name not in touching}
    for thing in shown.geometryObjects:
        frame = model.frames[thing.parentFrame]
        if frame.name in links and (thing.name not in touching or thing.parentFrame not in dressed):
            placement = (frame.placement.inverse() * thing.placement).homogeneous
            for points, triangles in _coal_meshes(thing, source.path):
                yield Shape(frame.name, (points @ placement[:3, :3].T + placement[:3, 3], triangles))


def _count_missing(source: RobotXML) -> str:
    """How many of the mesh files that an MJCF names are not there, in words."""
    compilers = source.root.findall("compiler")
    options = {name: value for compiler in compilers for name, value in compiler.items()}
    folder = source.path.parent / options.get("meshdir", options.get("assetdir", ""))
    names = {mesh.get("file", "") for mesh in source.root.iterfind("asset/mesh")} - {""}
    if options.get("strippath") == "true":
        names = {Path(name).name for name in names}
    missing = sum(not (folder / name).is_file() for name in names)
    return f"{missing} of {len(names)} meshes are"


def _coal_meshes(thing: pin.GeometryObject, path: Path) -> Iterator[Mesh]:
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
        yield mesh_of(shape, thing.meshScale, Path(thing.meshPath))
    elif isinstance(shape, coal.Convex):
        yield np.array(shape.points()), rows_of(shape.polygons, shape.num_polygons)
    elif not isinstance(shape, (coal.Plane, coal.Halfspace)):
        raise FileFormatError(f"{path}: {thing.name!r} has a shape that cannot be drawn: {type(shape).__name__}")
