"""URDF: checks, joints that mimic others, and what stands under <visual>."""

from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin

from maniport.bodies.chain import Mesh, Shape, pose
from maniport.bodies.looks.mesh_files import scaled
from maniport.bodies.looks.mesh_places import Places
from maniport.bodies.looks.meshes import box, capsule, cylinder, ellipsoid
from maniport.bodies.readers.model import Follower, RobotXML
from maniport.bounds import NESTING
from maniport.errors import FileFormatError

_JOINTS = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")


class Urdf(RobotXML):
    """A robot in the Unified Robot Description Format."""

    name, tag, bounded = "URDF", "robot", ("link", "joint")

    def build(self) -> pin.Model:
        """Let Pinocchio read the kinematics."""
        return pin.buildModelFromXML(self.text)

    def followers(self) -> Iterator[tuple[str, Follower]]:
        """Joints with <mimic>."""
        for joint in self.root.findall("joint"):
            mimic = joint.find("mimic")
            if mimic is not None:
                factor, offset = float(mimic.get("multiplier", "1")), float(mimic.get("offset", "0"))
                yield joint.get("name", ""), Follower(mimic.get("joint", ""), factor, offset)

    def fault(self) -> str:
        """The first inconsistency in words, or nothing."""
        if any("xacro" in element.tag for element in self.root.iter()):
            return "this is a xacro file; let its name end in .xacro"
        if self.root.get("name") is None:
            return "the <robot> has no name"
        if self.root.find("link") is None:
            return "holds no link"
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
            if kind not in _JOINTS:
                return f"joint {name!r} has type {kind!r}; allowed are {', '.join(_JOINTS)}"
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
                return f"joint {name!r} is {kind} and has no <limit>; a joint without limits has type 'continuous'"
        roots = [link for link in links if link not in children]
        if len(roots) != 1:
            return f"must have one root link; found {len(roots)}{': ' if roots else ''}{', '.join(map(repr, roots))}"
        return _fault_of_tree(roots[0], below, len(links))

    def shapes(self, links: Collection[str], places: Places) -> Iterator[Shape]:
        """What stands under <visual>; Pinocchio's reader knows no capsules and passes over faults."""
        visuals = [
            (link.get("name", ""), visual)
            for link in self.root.findall("link")
            if link.get("name") in links
            for visual in link.findall("visual")
        ]
        files = _mesh_paths(places, [visual for _, visual in visuals])
        for link, visual in visuals:
            points, triangles = _urdf_mesh(places, link, visual, files)
            origin = visual.find("origin")
            if origin is not None:
                xyz, rpy = (_numbers(self.path, link, origin, name, 3, "0 0 0") for name in ("xyz", "rpy"))
                placement = pose(xyz, rpy)
                points = points @ placement[:3, :3].T + placement[:3, 3]
            yield Shape(link, (points, triangles))


def _fault_of_tree(root: str, below: Mapping[str | None, Sequence[str | None]], count: int) -> str:
    """Links in a circle, or more in a row than native readers bear, which go down the tree with their stack."""
    level: list[str | None] = [root]
    depth = found = 0
    while level:
        depth, found = depth + 1, found + len(level)
        level = [child for link in level for child in below.get(link, ())]
    if found < count:
        return "has links that joints hang on one another in a circle"
    return f"has {depth} links in a row; at most {NESTING} are read" if depth > NESTING else ""


def _mesh_paths(places: Places, visuals: list[ElementTree.Element]) -> dict[str, Path]:
    """Files of the meshes that are named, all of them; an error that counts the missing ones."""
    elements = [visual.find("geometry/mesh") for visual in visuals]
    names = dict.fromkeys(element.get("filename", "") for element in elements if element is not None)
    files = {name: places.find(name) for name in names if name}
    missing = [name for name, file in files.items() if file is None]
    if missing:
        raise FileFormatError(
            f"{places.path}: the mesh {missing[0]!r} is missing ({len(missing)} of {len(files)} meshes are); looked "
            f"{places.rule(missing[0])}"
        )
    return {name: file for name, file in files.items() if file is not None}


def _urdf_mesh(places: Places, link: str, visual: ElementTree.Element, files: dict[str, Path]) -> Mesh:
    """The mesh of one <visual> in its own frame."""
    path = places.path
    geometry = visual.find("geometry")
    kind = geometry[0] if geometry is not None and len(geometry) else None
    if kind is None:
        raise FileFormatError(f"{path}: a <visual> of link {link!r} holds no <geometry>")
    if kind.tag == "mesh":
        name = kind.get("filename", "")
        if not name:
            raise FileFormatError(f"{path}: a <mesh> of link {link!r} names no file")
        return scaled(places.mesh(files[name]), np.array(_numbers(path, link, kind, "scale", 3, "1 1 1")))
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
