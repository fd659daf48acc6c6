"""MJCF: bodies, joints, joint equalities, masses and shapes."""

from collections.abc import Collection, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np
from scipy.spatial import QhullError

from maniport.arms.chain import (
    IGNORED_GRAVITY,
    PRISMATIC,
    REVOLUTE,
    Contact,
    ContactRules,
    Joint,
    Mesh,
    Shape,
    moved_inertia,
)
from maniport.arms.loaders.document import (
    LARGEST,
    Declared,
    MeshPaths,
    body_inertia,
    is_absolute,
    numbers,
    require,
)
from maniport.arms.loaders.mjcf_document import WORLD, Document, rotation_to
from maniport.arms.loaders.model import Follower, RobotBody, RobotModel
from maniport.arms.meshes import hull_triangles, moved, moved_points, solid, solid_core
from maniport.arms.meshes.fitting import MESH_INERTIAS, fitted
from maniport.arms.meshes.mesh_files import scaled
from maniport.errors import FileFormatError
from maniport.util.validation import Array

KINDS = ("hinge", "slide", "ball", "free")
"""Types of joints."""
SIZES = {
    "sphere": (1.0,),
    "ellipsoid": (1.0, 1.0, 1.0),
    "box": (2.0, 2.0, 2.0),
    "cylinder": (1.0, 2.0),
    "capsule": (1.0, 2.0),
}
"""Sizes of solids as multiples of the numbers in the file."""
PLANE_SIZES = [40.0, 40.0, 10.0]  # of a box below an infinite plane, larger than any arm [m]
PLANE_PLACEMENT = np.eye(4)
PLANE_PLACEMENT[2, 3] = -0.5 * PLANE_SIZES[2]
LAST_DRAWN_GROUP = 2  # MuJoCo's viewer shows geoms of the groups 0 to 2 by default
MOST_BITS = 2.0**32  # bound of contype and conaffinity


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
            model.bodies[body.name] = body
            name = body.name
        for site in element.findall("site[@name]"):
            model.sites.setdefault(site.get("name", ""), (name, document.pose(site)))
        waiting += [(name, child) for child in reversed(element.findall("body"))]
    for joint in document.root.findall("equality/joint"):
        if document.attribute(joint, "active") != "false":
            follower = joint.get("joint1", "")
            leader = joint.get("joint2")
            c = [*document.numbers(joint, "polycoef", None, "0 1 0 0 0").tolist(), 0.0]
            offset = (
                c[0] + document.rest(follower) - c[1] * document.rest(leader)
            )  # positions count from rest
            model.followers[follower] = Follower(leader, c[1], offset, not any(c[2:]))
    _scale_masses(model, document)
    _set_gravity(model, document)
    return model


def _scale_masses(model: RobotModel, document: Document) -> None:
    """Scale all masses to the `settotalmass` of a document; they are unknown where one of them is."""
    total = float(document.option("settotalmass", 1, "-1")[0])
    if total <= 0.0:
        return
    mass = 0.0
    all_known = True
    for body in model.bodies.values():
        if body.inertia is None:
            all_known = False
        else:
            mass += float(body.inertia[0, 0])
    for name, body in model.bodies.items():
        inertia = None
        if name == WORLD:
            inertia = body.inertia
        elif all_known and body.inertia is not None and mass > 0.0:
            inertia = body.inertia * (total / mass)
        model.bodies[name] = replace(body, inertia=inertia)


def _set_gravity(model: RobotModel, document: Document) -> None:
    """Take the gravity of a document; a model for simulation without gravity is of a robot that has weight."""
    option = document.root.find("option")
    if option is None:
        return
    where = f"{document.path}: <option> needs gravity"
    standard = " ".join(map(str, model.gravity))
    gravity = numbers(option.get("gravity", standard), 3, where)
    flags = option.findall("flag")
    if not np.any(gravity) or any(flag.get("gravity") == "disable" for flag in flags):
        model.remark(IGNORED_GRAVITY, model.name)
        return
    model.gravity = tuple(gravity.tolist())


def _body(model: RobotModel, document: Document, parent: str, element: Element) -> RobotBody:
    """Return a body with the joints that move it."""
    placement = document.pose(element)
    joints = list[Joint]()
    inertia = _inertia(document, element)
    kinds = {}
    for joint in element.findall("joint"):
        kinds[joint] = document.attribute(joint, "type") or "hinge"
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
            name = joint.get("name", "")
            axis = document.numbers(joint, "axis", 3, "0 0 1")
            at = np.eye(4)
            at[:3, 3] = document.numbers(joint, "pos", 3, "0 0 0")
            low, high = document.range(joint, "range", "limited") * document.unit(joint)
            moving = model.joint(
                name,
                PRISMATIC if kind == "slide" else REVOLUTE,
                axis,
                placement @ at,
                (float(low), float(high)),
                effort=document.effort_limit(joint),
                armature=float(document.numbers(joint, "armature", 1, "0", least=0.0)[0]),
            )
            rest = moving.motion(-document.rest(name))
            joints.append(replace(moving, placement=moving.placement @ rest))
            placement = np.asarray(np.linalg.inv(at), dtype=np.float64)
    return RobotBody(element.get("name", ""), parent, placement, tuple(joints), inertia=inertia)


def _inertia(document: Document, body: Element) -> Array | None:
    """Spatial inertia (6, 6) of a body; None if its shapes determine it."""
    inertial = body.find("inertial")
    if document.options.get("inertiafromgeom") == "true":
        inertial = None
    if inertial is None:
        has_mass = False
        for geom in body.findall("geom"):
            mass = document.numbers(geom, "mass", 1, "1")[0]
            if mass > 0 and document.numbers(geom, "density", 1, "1")[0] > 0:
                has_mass = True
        if has_mass:
            return None
        return _bounded(document, np.zeros((6, 6)), np.eye(4))
    if inertial.get("fullinertia") is not None:
        moments = document.numbers(inertial, "fullinertia", 6, "0 0 0")
    else:
        moments = document.numbers(inertial, "diaginertia", 3, "0 0 0")
    where = f"{document.path}: link {body.get('name')!r}"
    mass = float(numbers(inertial.get("mass"), 1, f"{where} needs a mass", least=0.0)[0])
    inertia = body_inertia(where, mass, [*moments, 0.0, 0.0, 0.0][:6], document.pose(inertial))
    return _bounded(document, inertia, document.pose(inertial))


def _bounded(document: Document, inertia: Array, pose: Array) -> Array:
    """Raise mass and moments of a spatial inertia (6, 6) to the smallest ones of a document.

    The moments are principal ones about the center of mass, the origin of the pose (4, 4).
    """
    least_mass = float(document.option("boundmass", 1, "0")[0])
    least_moment = float(document.option("boundinertia", 1, "0")[0])
    if least_mass <= 0.0 and least_moment <= 0.0:
        return inertia
    central = moved_inertia(inertia, np.asarray(np.linalg.inv(pose), dtype=np.float64))
    moments, axes = np.linalg.eigh(central[3:, 3:])
    moments = np.maximum(moments, least_moment)
    mass = max(float(central[0, 0]), least_mass)
    bounded = np.diag([mass, mass, mass, 0.0, 0.0, 0.0])
    bounded[3:, 3:] = axes @ np.diag(moments) @ axes.T
    return moved_inertia(bounded, pose)


def shapes(
    path: Path, root: Element, links: Collection[str], paths: MeshPaths
) -> tuple[list[Declared], ContactRules]:
    """List the geoms of bodies: those with contacts are collision shapes, the others visual; and their contacts."""
    document = Document(path, root, paths.more)
    assets = _Assets(document, paths)
    geoms = _geoms(document)
    explicit = _explicit_pairs(document, geoms)
    paired = set[int]().union(*explicit)

    declared = []
    for number, (name, geom) in enumerate(geoms):
        if name not in links:
            continue
        contype = int(document.numbers(geom, "contype", 1, "1", MOST_BITS)[0])
        conaffinity = int(document.numbers(geom, "conaffinity", 1, "1", MOST_BITS)[0])
        collision = bool(contype or conaffinity or number in paired)
        is_plane = document.attribute(geom, "type") == "plane"
        if is_plane and not collision:
            continue
        contact = None
        if collision:
            contact = Contact(name, number, contype, conaffinity, is_plane)
        shape = Declared(
            name,
            collision,
            partial(_shape, document, assets, name, geom, contact),
            partial(assets.available, geom),
            hidden=bool(document.numbers(geom, "group", 1, "0")[0] > LAST_DRAWN_GROUP),
            infinite=is_plane,
        )
        declared.append(shape)
    return declared, _contact_rules(document, explicit)


def _geoms(document: Document) -> list[tuple[str, Element]]:
    """Return the geoms of a document with the names of their bodies; those of the world are first."""
    geoms = []
    for world in document.root.findall("worldbody"):
        for geom in world.findall("geom"):
            geoms.append((WORLD, geom))
    for body in document.root.findall("worldbody//body"):
        for geom in body.findall("geom"):
            geoms.append((body.get("name", ""), geom))
    return geoms


def _explicit_pairs(
    document: Document, geoms: Sequence[tuple[str, Element]]
) -> frozenset[frozenset[int]]:
    """Numbers of the geoms in each <pair>."""
    numbers_of = {}
    for number, (_, geom) in enumerate(geoms):
        numbers_of[geom.get("name")] = number
    pairs = set()
    for pair in document.root.findall("contact/pair"):
        first = numbers_of.get(document.attribute(pair, "geom1"))
        second = numbers_of.get(document.attribute(pair, "geom2"))
        if first is not None and second is not None and first != second:
            pairs.add(frozenset((first, second)))
    return frozenset(pairs)


def _contact_rules(document: Document, explicit: frozenset[frozenset[int]]) -> ContactRules:
    """Contacts that a document excludes: within welded bodies, of neighbors, and of <exclude>."""
    carriers = {WORLD: WORLD}
    parents = {WORLD: WORLD}
    waiting = [(WORLD, world) for world in document.root.findall("worldbody")]
    while waiting:
        name, element = waiting.pop()
        for body in element.findall("body"):
            child = body.get("name", "")
            welded = body.find("joint") is None and body.find("freejoint") is None
            if welded:
                carriers[child] = carriers[name]
            else:
                carriers[child] = child
            parents.setdefault(carriers[child], carriers[name])
            waiting.append((child, body))
    excluded = set()
    for pair in document.root.findall("contact/exclude"):
        excluded.add(frozenset((pair.get("body1", ""), pair.get("body2", ""))))
    disabled = set[str]()
    for flag in document.root.findall("option/flag"):
        for kind, state in flag.items():
            if state == "disable":
                disabled.add(kind)
    return ContactRules(
        carriers,
        parents,
        WORLD,
        frozenset(excluded),
        explicit,
        filter_parents="filterparent" not in disabled,
        enabled=disabled.isdisjoint(("contact", "constraint")),
    )


def _shape(
    document: Document, assets: "_Assets", name: str, geom: Element, contact: Contact | None
) -> Shape:
    """Make the shape of a geom in the frame of its body; a mesh with contacts is its convex hull, as in MuJoCo."""
    kind = document.attribute(geom, "type") or "sphere"
    title = document.attribute(geom, "mesh")
    collision = contact is not None
    if kind == "plane":
        placement = document.pose(geom)
        placement = placement @ PLANE_PLACEMENT
        kind = "box"
        sizes = PLANE_SIZES
    elif title is None and kind in SIZES:
        placement, sizes = _solid(document, geom, kind)
    elif title in assets.files and kind in SIZES:
        placement, sizes = _fitted(document, assets, geom, kind, title)
    elif title in assets.files and kind == "mesh":
        mesh = moved(assets.mesh(title), document.pose(geom))
        if not collision:
            return Shape(name, mesh)
        points = mesh[0][np.unique(mesh[1])]
        return Shape(name, mesh, collision, points, 0.0, contact)
    else:
        raise FileFormatError(
            f"{document.path}: a <geom> of body {name!r} has an unknown shape: {title or kind!r}"
        )
    mesh = moved(solid(kind, *sizes), placement)
    core, radius = solid_core(kind, *sizes)
    return Shape(name, mesh, collision, moved_points(core, placement), radius, contact)


def _fitted(
    document: Document, assets: "_Assets", geom: Element, kind: str, title: str | None
) -> tuple[Array, list[float]]:
    """Pose (4, 4) and sizes of a simple solid that is fitted to a mesh, as MuJoCo fits it."""
    element, _ = assets.files[title]
    inertia = document.attribute(element, "inertia") or "legacy"
    allowed = ", ".join(MESH_INERTIAS)
    require(
        inertia in MESH_INERTIAS,
        document.path,
        f"<mesh> {title!r} has the inertia {inertia!r}; allowed are {allowed}",
    )
    try:
        result = fitted(
            kind, assets.mesh(title), inertia, document.options.get("fitaabb") == "true"
        )
    except ValueError as error:
        raise FileFormatError(
            f"{document.path}: no {kind} can be fitted to the mesh {title!r}: {error}"
        ) from None
    scale = float(document.numbers(geom, "fitscale", 1, "1", least=0.0)[0])
    sizes = np.array(SIZES[kind]) * result.sizes * scale
    return document.pose(geom) @ result.pose, sizes.tolist()


def _solid(document: Document, geom: Element, kind: str) -> tuple[Array, list[float]]:
    """Pose (4, 4) and sizes of a simple solid; `fromto` are the ends of its z axis."""
    factors = np.array(SIZES[kind])
    size = document.numbers(geom, "size", None)
    placement = document.pose(geom)
    if document.attribute(geom, "fromto") is not None:
        ends = document.numbers(geom, "fromto", 6).reshape(2, 3)
        placement[:3, :3] = rotation_to(ends[0] - ends[1])
        placement[:3, 3] = ends.mean(axis=0)
        size = np.append(
            np.full(len(factors) - 1, size[0]), 0.5 * np.linalg.norm(ends[0] - ends[1])
        )
    enough = len(size) >= len(factors) and bool(np.all(size >= 0))
    require(
        enough,
        document.path,
        f"a <geom> {kind} needs {len(factors)} sizes, not negative; found {size}",
    )
    return placement, (factors * size[: len(factors)]).tolist()


class _Assets:
    """Meshes of a document by their names."""

    def __init__(self, document: Document, paths: MeshPaths):
        self.document = document
        self.paths = paths
        self.files: dict[str | None, tuple[Element, str]] = {}
        folder = document.options.get("meshdir", document.options.get("assetdir", ""))
        for mesh in document.root.iterfind("asset/mesh"):
            file = mesh.get("file", "").replace("\\", "/")
            name = mesh.get("name") or Path(file).stem
            if file and document.options.get("strippath") == "true":
                file = Path(file).name
            if file and folder and not is_absolute(file):
                file = f"{folder}/{file}"
            self.files.setdefault(name, (mesh, file))

    def available(self, geom: Element) -> bool:
        """Return whether the mesh file of a geom exists, if it has one."""
        _, file = self.files.get(self.document.attribute(geom, "mesh"), (None, ""))
        return not file or self.paths.available(file)

    def mesh(self, title: str | None) -> Mesh:
        """Read the mesh of an asset, of its file or of the points in the document."""
        document = self.document
        paths = self.paths
        element, name = self.files[title]
        if name:
            file = paths.find(name)
            if file is None:
                fault = f"the mesh {name!r} is missing; looked {paths.rule(name)}"
                raise FileFormatError(f"{paths.path}: {fault}")
            points, triangles = paths.mesh(file)
        else:
            points, triangles = _own_mesh(paths.path, element)
        turn, origin = document.reference(element)
        return scaled(
            ((points - origin) @ turn, triangles), document.numbers(element, "scale", 3, "1 1 1")
        )


def _own_mesh(path: Path, mesh: Element) -> Mesh:
    """Points and triangles of a mesh in an MJCF; without triangles the hull of the points."""
    try:
        points = np.array([float(word) for word in mesh.get("vertex", "").split()]).reshape(-1, 3)
        rows = np.array(
            [int(word) for word in mesh.get("face", "").split()], dtype=np.int32
        ).reshape(-1, 3)
        if not np.all(np.abs(points) < LARGEST) or not np.all((rows >= 0) & (rows < len(points))):
            raise ValueError("invalid numbers")
        return points, rows if len(rows) else hull_triangles(points)
    except (ValueError, OverflowError, QhullError) as error:
        reason = str(error).splitlines()[0]
        raise FileFormatError(
            f"{path}: the points of the mesh {mesh.get('name')!r} are no solid: {reason}"
        ) from None
