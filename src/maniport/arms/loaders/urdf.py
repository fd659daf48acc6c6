"""URDF: bodies, joints, mimic joints, and shapes from <visual> and <collision>."""

from collections.abc import Callable, Collection, Iterable, Sequence
from functools import cache, partial
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np
from scipy.spatial.transform import Rotation

from maniport.arms.chain import (
    IGNORED_INCLUDES,
    IGNORED_SOFT_LIMITS,
    PRISMATIC,
    REVOLUTE,
    SOFT_LIMITS,
    Shape,
    pose,
)
from maniport.arms.loaders.document import (
    LARGEST,
    XACRO,
    Declared,
    MeshPaths,
    body_inertia,
    numbers,
    require,
)
from maniport.arms.loaders.model import Follower, RobotBody, RobotModel
from maniport.arms.meshes import moved, moved_points, solid, solid_core
from maniport.arms.meshes.mesh_files import scaled
from maniport.errors import FileFormatError
from maniport.util.input_limits import LINKS, NESTING, require_at_most
from maniport.util.validation import Array

KINDS = {
    "revolute": REVOLUTE,
    "continuous": REVOLUTE,
    "prismatic": PRISMATIC,
    **dict.fromkeys(("fixed", "floating", "planar"), ""),
}
"""Joints with one axis by their types; a floating joint is at rest, and the planar one of a mobile base."""
XACRO_PREFIX = "xacro:"
BODY_TAGS = ("link", "joint")
INERT = ("property", "arg", "include", "if", "unless")
"""Elements of xacro that a URDF may contain: what they declare has no effect without macros and expressions."""


def read(path: Path, root: Element) -> RobotModel:
    """Read the bodies and joints of a robot in the Unified Robot Description Format."""
    model = RobotModel(path, root.get("name", ""), shapes)
    _require_expanded(model, root)
    require(root.get("name") is not None, path, "the <robot> has no name")
    links = _named(path, root, "link")
    require(bool(links), path, "has no link")
    children: dict[str, list[Element]] = {link: [] for link in links}  # joints below each link
    below = set[str]()
    for name, joint in sorted(_named(path, root, "joint").items()):
        kind = joint.get("type")
        parent = _end(joint, "parent")
        child = _end(joint, "child")
        require(
            kind in KINDS, path, f"joint {name!r} has type {kind!r}; allowed are {', '.join(KINDS)}"
        )
        for end, link in (("parent", parent), ("child", child)):
            require(
                link in links,
                path,
                f"joint {name!r} names {link!r} as {end} link, which does not exist",
            )
        require(child not in below, path, f"link {child!r} is the child of two joints")
        children[parent].append(joint)
        below.add(child)
    roots = [link for link in links if link not in below]
    listed = ", ".join(map(repr, roots))
    require(
        len(roots) == 1,
        path,
        f"must have one root link; found {len(roots)}{': ' * bool(roots)}{listed}",
    )
    model.bodies[roots[0]] = RobotBody(
        roots[0], None, np.eye(4), inertia=_inertia(path, links[roots[0]])
    )
    waiting = [(joint, 2) for joint in reversed(children[roots[0]])]
    while waiting:
        joint, depth = waiting.pop()
        require_at_most(depth, NESTING, "links in a row", path)
        body = _body(model, joint, links[_end(joint, "child")])
        model.bodies[body.name] = body
        waiting += [(other, depth + 1) for other in reversed(children[body.name])]
    require(len(model.bodies) == len(links), path, "has links in a cycle")
    _release_followers_of_welds(model)
    return model


def _release_followers_of_welds(model: RobotModel) -> None:
    """Hold joints that mimic a fixed joint at their offset."""
    welds = set[str]()
    for body in model.bodies.values():
        welds |= set(body.welds)
    for name, rule in model.followers.items():
        if rule.leader in welds:
            model.followers[name] = Follower(None, 0.0, rule.offset)


def _require_expanded(model: RobotModel, root: Element) -> None:
    """Raise where a file has to be expanded by xacro; other elements of xacro change nothing.

    A file needs xacro if it defines or uses macros, or if xacro selects or computes links or joints.
    """
    waiting = [(root, False, False)]
    while waiting:
        element, in_xacro, in_body = waiting.pop()
        if element.tag == f"{XACRO_PREFIX}include":
            model.remark(IGNORED_INCLUDES, element.get("filename", ""))
        macro = _needed_macro(element, in_xacro, in_body)
        fault = f"this is a xacro file; let its name end in {XACRO} (it has {macro})"
        require(not macro, model.path, fault)
        in_xacro = in_xacro or element.tag.startswith(XACRO_PREFIX)
        in_body = in_body or element.tag in BODY_TAGS
        for child in element:
            waiting.append((child, in_xacro, in_body))


def _needed_macro(element: Element, in_xacro: bool, in_body: bool) -> str:
    """Return what xacro has to expand in an element, inside an element of xacro, or of a link or joint; or nothing."""
    if element.tag.startswith(XACRO_PREFIX):
        if element.tag.removeprefix(XACRO_PREFIX) not in INERT or in_body:
            return f"<{element.tag}>"
        return ""
    is_body = element.tag in BODY_TAGS
    if in_xacro and is_body:
        return f"a <{element.tag}> inside an element of xacro"
    if is_body or in_body:
        for text in element.attrib.values():
            if "${" in text:
                return repr(text)
    return ""


def _named(path: Path, root: Element, tag: str) -> dict[str, Element]:
    """Links or joints by their names."""
    elements = root.findall(tag)
    require_at_most(len(elements), LINKS, f"elements <{tag}>", path)
    named: dict[str, list[Element]] = {}
    for element in elements:
        named.setdefault(element.get("name", ""), []).append(element)
    for name, same in named.items():
        require(bool(name), path, f"a {tag} has no name")
        require(len(same) == 1, path, f"{tag} {name!r} appears {len(same)} times")
    return {name: same[0] for name, same in named.items()}


def _end(joint: Element, end: str) -> str:
    element = joint.find(end)
    if element is None:
        return ""
    return element.get("link", "")


def _body(model: RobotModel, joint: Element, link: Element) -> RobotBody:
    """Body of a link with the joint above it."""
    name = joint.get("name", "")
    kind = joint.get("type", "")
    where = f"{model.path}: joint {joint.get('name')!r} needs"
    mimic = joint.find("mimic")
    if mimic is not None:
        factor = _attribute(mimic, "multiplier", "1", f"{where} a mimic")
        offset = _attribute(mimic, "offset", "0", f"{where} a mimic")
        model.followers[name] = Follower(mimic.get("joint", ""), factor, offset)
    parent = _end(joint, "parent")
    child = link.get("name", "")
    placement = _origin(joint, where)
    inertia = _inertia(model.path, link)
    if not KINDS[kind]:
        blocked = ""
        if kind == "planar" and any(model.bodies[above].joints for above in model.line(parent)):
            blocked = "planar"
        return RobotBody(child, parent, placement, blocked=blocked, inertia=inertia, welds=(name,))

    limit = joint.find("limit")
    fault = f"joint {name!r} is {kind} and has no <limit>; use the type 'continuous' for joints without limits"
    require(limit is not None or kind == "continuous", model.path, fault)
    low = _attribute(limit, "lower", "0", f"{where} a limit", np.inf)
    high = _attribute(limit, "upper", "0", f"{where} a limit", np.inf)
    speed = _attribute(limit, "velocity", "0", f"{where} a limit", np.inf)
    effort = _attribute(limit, "effort", "0", f"{where} a limit", np.inf)
    bounds = (low, high)
    if kind == "continuous":
        bounds = (-np.inf, np.inf)
    if bounds[0] == bounds[1] != 0.0 and mimic is None:
        model.followers[name] = Follower(None, 0.0, bounds[0])
    bounds = _soft_bounds(model, joint, bounds)
    axis = joint.find("axis")
    text = "1 0 0"
    if axis is not None:
        text = axis.get("xyz", "1 0 0")
    direction = numbers(text, 3, f"{where} an axis")
    moving = model.joint(name, KINDS[kind], direction, placement, bounds, speed, effort)
    return RobotBody(child, parent, np.eye(4), (moving,), inertia=inertia)


def _attribute(
    element: Element | None, key: str, default: str, where: str, most: float = LARGEST
) -> float:
    """Return the number of an attribute, the default where there is no such element or attribute."""
    text = default if element is None else element.get(key, default)
    return float(numbers(text, 1, f"{where} {key}", most)[0])


def _soft_bounds(
    model: RobotModel, joint: Element, bounds: tuple[float, float]
) -> tuple[float, float]:
    """Narrow the bounds of a joint to the soft limits of its safety controller [rad] or [m].

    As for limits, two zeros mean none; a soft limit that is not given leaves the limit of the joint. Continuous joints
    have none.
    """
    controller = joint.find("safety_controller")
    if controller is None:
        return bounds
    name = joint.get("name", "")
    where = f"{model.path}: joint {name!r} needs a safety_controller"
    soft = list(bounds)
    given = []
    for i, key in enumerate(("soft_lower_limit", "soft_upper_limit")):
        text = controller.get(key)
        if text is not None:
            soft[i] = float(numbers(text, 1, f"{where} {key}", np.inf)[0])
            given.append(soft[i])
    if not any(given):
        return bounds

    detail = f"{soft[0]:.4g} to {soft[1]:.4g}"
    if joint.get("type") == "continuous":
        model.remark(IGNORED_SOFT_LIMITS, name, f"{detail}, continuous")
        return bounds
    if not any(bounds):  # no limits of the joint
        inner = (soft[0], soft[1])
    else:
        inner = (max(soft[0], bounds[0]), min(soft[1], bounds[1]))
    if inner[0] >= inner[1]:
        model.remark(
            IGNORED_SOFT_LIMITS, name, f"{detail}, limits {bounds[0]:.4g} to {bounds[1]:.4g}"
        )
        return bounds
    if inner != bounds:
        model.remark(SOFT_LIMITS, name, f"{inner[0]:.4g} to {inner[1]:.4g}")
    return inner


def _origin(element: Element, where: str) -> Array:
    """Pose (4, 4) of the <origin> of an element."""
    origin = element.find("origin")
    if origin is None:
        return np.eye(4)
    xyz = numbers(origin.get("xyz", "0 0 0"), 3, f"{where} an origin xyz")
    quaternion = origin.get("quat_xyzw")  # since version 1.1 of the format
    if quaternion is None:
        rpy = numbers(origin.get("rpy", "0 0 0"), 3, f"{where} an origin rpy")
        return pose(xyz.tolist(), rpy.tolist())
    if origin.get("rpy") is not None:
        raise FileFormatError(f"{where} an origin with rpy or with quat_xyzw; found both")
    values = numbers(quaternion, 4, f"{where} an origin quat_xyzw")
    if not np.linalg.norm(values) > 1e-9:
        raise FileFormatError(
            f"{where} an origin quat_xyzw that is a rotation; found {quaternion!r}"
        )
    matrix = pose(xyz.tolist())
    matrix[:3, :3] = Rotation.from_quat(values).as_matrix()
    return matrix


def _inertia(path: Path, link: Element) -> Array:
    """Spatial inertia (6, 6) of a link."""
    inertial = link.find("inertial")
    where = f"{path}: link {link.get('name')!r}"
    if inertial is None:
        return np.zeros((6, 6))
    mass = _child(inertial, "mass")
    inertia = _child(inertial, "inertia")
    moments = []
    for axes in ("xx", "yy", "zz", "xy", "xz", "yz"):
        moments.append(
            float(numbers(inertia.get(f"i{axes}"), 1, f"{where} needs an inertia i{axes}")[0])
        )
    weight = float(numbers(mass.get("value"), 1, f"{where} needs a mass", least=0.0)[0])
    return body_inertia(where, weight, moments, _origin(inertial, f"{where} needs"))


def _child(element: Element, tag: str) -> Element:
    """Return the first child with a tag, or one without attributes."""
    child = element.find(tag)
    if child is None:
        return Element(tag)
    return child


def shapes(
    path: Path, root: Element, links: Collection[str], paths: MeshPaths
) -> tuple[list[Declared], None]:
    """List the shapes of links from <visual> and <collision>."""
    owners = [link for link in root.findall("link") if link.get("name") in links]
    count = cache(partial(_count_missing, paths, owners))
    declared = []
    for link in owners:
        for element in (*link.iterfind("visual"), *link.iterfind("collision")):
            names = _mesh_names([element])
            shape = Declared(
                link.get("name", ""),
                element.tag == "collision",
                partial(_shape, paths, link, element, count),
                partial(_all_available, paths, names),
            )
            declared.append(shape)
    return declared, None


def _mesh_names(elements: Iterable[Element]) -> list[str]:
    """Names of the mesh files of <visual> or <collision> elements."""
    names = []
    for element in elements:
        for mesh in element.iterfind("geometry/mesh"):
            names.append(mesh.get("filename", ""))
    return [name for name in names if name]


def _all_available(paths: MeshPaths, names: Sequence[str]) -> bool:
    return all(map(paths.available, names))


def _count_missing(paths: MeshPaths, owners: Sequence[Element], tag: str) -> str:
    """Count the missing meshes of all <visual> or <collision> elements."""
    elements = list[Element]()
    for owner in owners:
        elements += owner.iterfind(tag)
    names = dict.fromkeys(_mesh_names(elements))
    count = sum(not paths.available(name) for name in names)
    return f"{count} of {len(names)} meshes are"


def _shape(
    paths: MeshPaths, link: Element, part: Element, count_missing: Callable[[str], str]
) -> Shape:
    """Make a shape of one <visual> or <collision> of a link, in the frame of the link."""
    path = paths.path
    name = link.get("name", "")
    geometry = part.find("geometry")
    form = None if geometry is None else next(iter(geometry), None)
    if form is None:
        raise FileFormatError(f"{path}: a <{part.tag}> of link {name!r} has no <geometry>")
    where = f"{path}: <{form.tag}> of link {name!r} needs"
    collision = part.tag == "collision"
    placement = _origin(part, f"{path}: <{part.tag}> of link {name!r} needs")
    if form.tag == "mesh":
        title = form.get("filename", "")
        if not title:
            raise FileFormatError(f"{path}: a <mesh> of link {name!r} names no file")
        file = paths.find(title)
        if file is None:
            raise FileFormatError(
                f"{path}: the mesh {title!r} is missing ({count_missing(part.tag)}); looked {paths.rule(title)}"
            )
        scale = numbers(form.get("scale", "1 1 1"), 3, f"{where} scale")
        mesh = moved(scaled(paths.mesh(file), scale), placement)
        return Shape(name, mesh, collision)
    kind, sizes = _sizes(path, link, part, form, where)
    core, radius = solid_core(kind, *sizes)
    mesh = moved(solid(kind, *sizes), placement)
    return Shape(name, mesh, collision, moved_points(core, placement), radius)


def _sizes(
    path: Path, link: Element, part: Element, form: Element, where: str
) -> tuple[str, list[float]]:
    """Return the kind and the sizes of a simple solid, see `maniport.arms.meshes.solid`."""
    name = link.get("name", "")
    sizes = {"box": {"size": 3}, "sphere": {"radius": 1}}
    sizes["cylinder"] = sizes["capsule"] = {"radius": 1, "length": 1}
    allowed = "mesh, box, sphere, cylinder, capsule"
    require(
        form.tag in sizes,
        path,
        f"link {name!r} has the shape <{form.tag}>; allowed are {allowed}",
    )
    values: list[float] = []
    for key, count in sizes[form.tag].items():
        values += numbers(form.get(key), count, f"{where} {key}", least=0.0).tolist()
    capsules = [capsule.get("name") for capsule in link.iterfind("collision_checking/capsule")]
    rounded = form.tag == "cylinder" and part.tag == "collision" and part.get("name") in capsules
    return ("capsule" if rounded else form.tag), values
