"""MJCF: bodies, joints, joint equalities, masses and shapes."""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from maniport.arms.chain import PRISMATIC, REVOLUTE, Joint, Mesh, Shape
from maniport.arms.loaders.document import (
    LARGEST,
    MeshPaths,
    body_inertia,
    numbers,
    require,
)
from maniport.arms.loaders.mjcf_document import WORLD, Document, rotation_to
from maniport.arms.loaders.model import Follower, RobotBody, RobotModel
from maniport.arms.loaders.package_folders import is_file
from maniport.arms.meshes import solid
from maniport.arms.meshes.mesh_files import scaled
from maniport.errors import FileFormatError
from maniport.util.validation import Array

KINDS = ("hinge", "slide", "ball", "free")
"""Types of joints."""
SIZES = {
    "sphere": (1.0,), "ellipsoid": (1.0, 1.0, 1.0), "box": (2.0, 2.0, 2.0), "cylinder": (1.0, 2.0),
    "capsule": (1.0, 2.0),
}  # fmt: skip
"""Sizes of solids as multiples of the numbers in the file."""


def read(path: Path, root: Element, folders: Sequence[Path] = ()) -> RobotModel:
    """Read the bodies, sites and joints of a robot in MuJoCo's format; free joints are at rest.

    Files that it includes may be in its folder or in `folders`.
    """
    document = Document(path, root, folders)
    document.check()
    model = RobotModel(path, document.root.get("model") or path.stem, shapes)
    model.bodies[WORLD] = RobotBody(WORLD, None, np.eye(4), inertia=np.zeros((6, 6)))
    waiting = [(WORLD, world) for world in document.root.findall("worldbody")]
    while waiting:
        name, element = waiting.pop()
        if element.tag == "body":
            body = _body(model, document, name, element)
            model.bodies[body.name], name = body, body.name
        for site in element.findall("site[@name]"):
            model.sites.setdefault(site.get("name", ""), (name, document.pose(site)))
        waiting += [(name, child) for child in reversed(element.findall("body"))]
    for joint in document.root.findall("equality/joint"):
        if joint.get("active", "true") == "true":
            follower, leader = joint.get("joint1", ""), joint.get("joint2")
            c = [*document.numbers(joint, "polycoef", None, "0 1 0 0 0").tolist(), 0.0]
            offset = (
                c[0] + document.rest(follower) - c[1] * document.rest(leader)
            )  # positions count from rest
            model.followers[follower] = Follower(leader, c[1], offset, not any(c[2:]))
    return model


def _body(model: RobotModel, document: Document, parent: str, element: Element) -> RobotBody:
    """Return a body with the joints that move it."""
    placement, joints, inertia = document.pose(element), list[Joint](), _inertia(document, element)
    kinds = {
        joint: document.attribute(joint, "type") or "hinge" for joint in element.findall("joint")
    }
    for joint, kind in kinds.items():
        fault = (
            f"<joint> {joint.get('name', '')!r} has type {kind!r}; allowed are {', '.join(KINDS)}"
        )
        require(kind in KINDS, document.path, fault)
    if "ball" in kinds.values():
        return RobotBody(
            element.get("name", ""), parent, placement, blocked="ball", inertia=inertia
        )
    for joint, kind in kinds.items():
        if kind in ("hinge", "slide"):
            name, axis, at = (
                joint.get("name", ""),
                document.numbers(joint, "axis", 3, "0 0 1"),
                np.eye(4),
            )
            at[:3, 3] = document.numbers(joint, "pos", 3, "0 0 0")
            low, high = document.range(joint, "range", "limited") * document.unit(joint)
            moving = model.joint(
                name, PRISMATIC if kind == "slide" else REVOLUTE, axis, placement @ at, (float(low), float(high)),
                effort=document.effort_limit(joint),
                armature=float(document.numbers(joint, "armature", 1, "0", least=0.0)[0]),
            )  # fmt: skip
            rest = moving.motion(-document.rest(name))
            joints.append(replace(moving, placement=moving.placement @ rest))
            placement = np.asarray(np.linalg.inv(at), dtype=np.float64)
    return RobotBody(element.get("name", ""), parent, placement, tuple(joints), inertia=inertia)


def _inertia(document: Document, body: Element) -> Array | None:
    """Spatial inertia (6, 6) of a body; None if its shapes determine it."""
    inertial = None if document.options.get("inertiafromgeom") == "true" else body.find("inertial")
    if inertial is None:
        heavy = [
            all(document.numbers(geom, key, 1, "1")[0] > 0 for key in ("mass", "density"))
            for geom in body.findall("geom")
        ]
        return None if any(heavy) else np.zeros((6, 6))
    full = inertial.get("fullinertia") is not None
    moments = document.numbers(
        inertial, "fullinertia" if full else "diaginertia", 6 if full else 3, "0 0 0"
    )
    where = f"{document.path}: link {body.get('name')!r}"
    mass = float(numbers(inertial.get("mass"), 1, f"{where} needs a mass", least=0.0)[0])
    return body_inertia(where, mass, [*moments, 0.0, 0.0, 0.0][:6], document.pose(inertial))


def shapes(path: Path, root: Element, links: Collection[str], paths: MeshPaths) -> Iterator[Shape]:
    """Yield the shapes of bodies: those without contacts if a body has such, else all."""
    document = Document(path, root, paths.more)
    folder = path.parent / document.options.get("meshdir", document.options.get("assetdir", ""))
    meshes: dict[str, tuple[Element, Path | None]] = {}
    for mesh in document.root.iterfind("asset/mesh"):
        file = mesh.get("file", "")
        name = mesh.get("name") or Path(file).stem
        file = Path(file).name if document.options.get("strippath") == "true" else file
        meshes.setdefault(name, (mesh, folder / file if file else None))
    owners = [(WORLD, world) for world in document.root.findall("worldbody")]
    owners += [(body.get("name", ""), body) for body in document.root.findall("worldbody//body")]
    for name, owner in owners:
        geoms = owner.findall("geom") if name in links else []
        contacts = [
            [document.numbers(geom, key, 1, "1")[0] for key in ("contype", "conaffinity")]
            for geom in geoms
        ]
        visual = [geom for geom, bits in zip(geoms, contacts, strict=True) if not any(bits)]
        for geom in visual or [
            geom for geom in geoms if document.numbers(geom, "group", 1, "0")[0] <= 2
        ]:
            kind, title = (
                document.attribute(geom, "type") or "sphere",
                document.attribute(geom, "mesh"),
            )
            if kind == "plane":  # infinite
                continue
            if title is None and kind in SIZES:
                placement, made = _solid(document, geom, kind)
            elif title in meshes:
                placement, made = document.pose(geom), _asset(paths, document, *meshes[title])
            else:
                raise FileFormatError(
                    f"{path}: a <geom> of body {name!r} has an unknown shape: {title or kind!r}"
                )
            points, triangles = made
            yield Shape(name, (points @ placement[:3, :3].T + placement[:3, 3], triangles))


def _solid(document: Document, geom: Element, kind: str) -> tuple[Array, Mesh]:
    """Pose (4, 4) and mesh of a simple solid; `fromto` are the ends of its z axis."""
    factors, size = np.array(SIZES[kind]), document.numbers(geom, "size", None)
    placement = document.pose(geom)
    if document.attribute(geom, "fromto") is not None:
        ends = document.numbers(geom, "fromto", 6).reshape(2, 3)
        placement[:3, :3], placement[:3, 3] = rotation_to(ends[0] - ends[1]), ends.mean(axis=0)
        size = np.append(
            np.full(len(factors) - 1, size[0]), 0.5 * np.linalg.norm(ends[0] - ends[1])
        )
    enough = len(size) >= len(factors) and bool(np.all(size >= 0))
    require(
        enough,
        document.path,
        f"a <geom> {kind} needs {len(factors)} sizes, not negative; found {size}",
    )
    return placement, solid(kind, *(factors * size[: len(factors)]))


def _asset(paths: MeshPaths, document: Document, mesh: Element, file: Path | None) -> Mesh:
    """Return the mesh of an asset, of its file or of the points in the document."""
    scale = document.numbers(mesh, "scale", 3, "1 1 1")
    if file is None:
        return scaled(_own_mesh(paths.path, mesh), scale)
    require(is_file(file), paths.path, f"the mesh {str(file)!r} is missing")
    paths.require_allowed(file, str(file))
    return scaled(paths.mesh(file), scale)


def _own_mesh(path: Path, mesh: Element) -> Mesh:
    """Points and triangles of a mesh in an MJCF; without triangles the hull of the points."""
    try:
        points = np.array([float(word) for word in mesh.get("vertex", "").split()]).reshape(-1, 3)
        rows = np.array(
            [int(word) for word in mesh.get("face", "").split()], dtype=np.int32
        ).reshape(-1, 3)
        if not np.all(np.abs(points) < LARGEST) or not np.all((rows >= 0) & (rows < len(points))):
            raise ValueError("invalid numbers")
        return points, rows if len(rows) else ConvexHull(points).simplices.astype(np.int32)
    except (ValueError, OverflowError, QhullError) as error:
        reason = str(error).splitlines()[0]
        raise FileFormatError(
            f"{path}: the points of the mesh {mesh.get('name')!r} are no solid: {reason}"
        ) from None
