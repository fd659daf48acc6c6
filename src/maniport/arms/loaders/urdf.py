"""URDF: checks, mimic joints, and shapes from <visual> or, as a substitute, <collision>."""

from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np
import pinocchio as pin

from maniport.arms.chain import Mesh, Shape, pose
from maniport.arms.loaders.model import Follower, RobotXML
from maniport.arms.meshes import box, capsule, cylinder, ellipsoid
from maniport.arms.meshes.mesh_files import scaled
from maniport.arms.meshes.mesh_paths import MeshPaths
from maniport.errors import FileFormatError
from maniport.util.input_limits import NESTING

_Find = Callable[[str], Path | None]


class Urdf(RobotXML):
    """A robot in the Unified Robot Description Format."""

    name, tag, bounded = "URDF", "robot", ("link", "joint")

    def build(self) -> pin.Model:
        """Read the kinematics with Pinocchio."""
        return pin.buildModelFromXML(self.text)

    def followers(self) -> Iterator[tuple[str, Follower]]:
        """Yield the joints with <mimic>."""
        for joint in self.root.findall("joint"):
            mimic = joint.find("mimic")
            if mimic is not None:
                factor, offset = float(mimic.get("multiplier", "1")), float(mimic.get("offset", "0"))
                yield joint.get("name", ""), Follower(mimic.get("joint", ""), factor, offset)

    def fault(self) -> str:
        """Describe the first inconsistency; empty without one."""
        if any("xacro" in element.tag for element in self.root.iter()):
            return "this is a xacro file; let its name end in .xacro"
        if self.root.get("name") is None:
            return "the <robot> has no name"
        if self.root.find("link") is None:
            return "has no link"
        links = Counter(link.get("name", "") for link in self.root.findall("link"))
        joints = Counter(joint.get("name", "") for joint in self.root.findall("joint"))
        for what, names in (("link", links), ("joint", joints)):
            for name, count in names.items():
                if not name or count > 1:
                    return f"{what} {name!r} appears {count} times" if name else f"a {what} has no name"
        below: dict[str | None, list[str | None]] = {}
        children = set()
        for joint in self.root.findall("joint"):
            name, kind, above = joint.get("name", ""), joint.get("type"), None
            kinds = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")
            if kind not in kinds:
                return f"joint {name!r} has type {kind!r}; allowed are {', '.join(kinds)}"
            for end in ("parent", "child"):
                element = joint.find(end)
                link = None if element is None else element.get("link")
                if link not in links:
                    return f"joint {name!r} names {link!r} as {end} link, which does not exist"
                if end == "child" and link in children:
                    return f"link {link!r} is the child of two joints"
                if end == "child":
                    children.add(link)
                    below.setdefault(above, []).append(link)
                above = link
            if kind in ("revolute", "prismatic") and joint.find("limit") is None:
                return (
                    f"joint {name!r} is {kind} and has no <limit>; use the type 'continuous' for joints without limits"
                )
        roots = [link for link in links if link not in children]
        if len(roots) != 1:
            return f"must have one root link; found {len(roots)}{': ' if roots else ''}{', '.join(map(repr, roots))}"
        return _fault_of_tree(roots[0], below, len(links))

    def shapes(self, links: Collection[str], paths: MeshPaths) -> Iterator[Shape]:
        """Yield shapes from <visual>, or from <collision> of links without <visual> or with a missing mesh."""
        drawn = [link for link in self.root.findall("link") if link.get("name") in links]
        find = cache(paths.find)
        kinds = {link: "visual" if all(map(find, _mesh_names(link, "visual"))) else "collision" for link in drawn}
        for link, kind in kinds.items():
            if kind == "collision" and not (link.findall(kind) and all(map(find, _mesh_names(link, kind)))):
                raise _missing(paths, find, link, drawn)
        for link, kind in kinds.items():
            for part in link.findall(kind) or link.findall("collision"):
                points, triangles = _urdf_mesh(paths, find, link, part)
                origin = part.find("origin")
                if origin is not None:
                    xyz, rpy = (_numbers(self.path, _name(link), origin, n, 3, "0 0 0") for n in ("xyz", "rpy"))
                    placement = pose(xyz, rpy)
                    points = points @ placement[:3, :3].T + placement[:3, 3]
                yield Shape(_name(link), (points, triangles), stand_in=kind == "collision")


def _fault_of_tree(root: str, below: Mapping[str | None, Sequence[str | None]], count: int) -> str:
    """Describe links in a cycle, or deeper chains than the recursive native readers can process."""
    level: list[str | None] = [root]
    depth = count_reached = 0
    while level:
        depth, count_reached = depth + 1, count_reached + len(level)
        level = [child for link in level for child in below.get(link, ())]
    if count_reached < count:
        return "has links in a cycle"
    return f"has {depth} links in a row; at most {NESTING} are read" if depth > NESTING else ""


def _name(link: Element) -> str:
    return link.get("name", "")


def _mesh_names(link: Element, part: str) -> list[str]:
    """Names of the meshes under <visual> or <collision> of a link."""
    return [name for mesh in link.iterfind(f"{part}/geometry/mesh") if (name := mesh.get("filename", ""))]


def _missing(paths: MeshPaths, find: _Find, link: Element, drawn: Sequence[Element]) -> FileFormatError:
    """The error that names the first missing mesh of a link, and counts those of all links that are drawn."""
    names = dict.fromkeys(name for owner in drawn for name in _mesh_names(owner, "visual"))
    first = next(name for name in _mesh_names(link, "visual") if find(name) is None)
    return FileFormatError(
        f"{paths.path}: the mesh {first!r} is missing ({[*map(find, names)].count(None)} of {len(names)} meshes are); "
        f"looked {paths.rule(first)}"
    )


def _urdf_mesh(paths: MeshPaths, find: _Find, owner: Element, part: Element) -> Mesh:
    """The mesh of one <visual> or <collision> of a link in its own frame; its file is there."""
    path, link = paths.path, _name(owner)
    geometry = part.find("geometry")
    kind = geometry[0] if geometry is not None and len(geometry) else None
    if kind is None:
        raise FileFormatError(f"{path}: a <{part.tag}> of link {link!r} has no <geometry>")
    if kind.tag == "mesh":
        name = kind.get("filename", "")
        file = find(name) if name else None
        if file is None:
            raise FileFormatError(f"{path}: a <mesh> of link {link!r} names no file")
        return scaled(paths.mesh(file), np.array(_numbers(path, link, kind, "scale", 3, "1 1 1")))
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
    return capsule(radius, length) if kind.tag == "capsule" or _rounded(owner, part) else cylinder(radius, length)


def _rounded(link: Element, part: Element) -> bool:
    """Whether <collision_checking> declares a cylinder as a capsule, as Pinocchio reads it."""
    names = [capsule.get("name") for capsule in link.iterfind("collision_checking/capsule")]
    return part.tag == "collision" and part.get("name") in names


def _numbers(path: Path, link: str, element: Element, name: str, count: int, default: str | None = None) -> list[float]:
    """Finite numbers of an attribute; sizes, which have no default, must not be negative."""
    text = element.get(name, default)
    try:
        numbers = [float(word) for word in (text or "").split()]
    except ValueError:
        numbers = []
    if len(numbers) != count or not np.all(np.isfinite(numbers)) or (default is None and min(numbers) < 0):
        rule = f"{count} finite {'' if default else 'non-negative '}number{'s' if count > 1 else ''}"
        raise FileFormatError(f"{path}: <{element.tag}> of link {link!r} needs {name} with {rule}; found {text!r}")
    return numbers
