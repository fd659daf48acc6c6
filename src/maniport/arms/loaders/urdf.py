"""URDF: checks, mimic joints, and shapes from <visual> or, as a substitute, <collision>."""

from collections import Counter
from collections.abc import Collection, Iterator
from functools import cache
from xml.etree.ElementTree import Element

import numpy as np
import pinocchio as pin

from maniport.arms.chain import Shape, pose
from maniport.arms.loaders.document import Follower, RobotXML, inertia_fault
from maniport.arms.meshes import SOLIDS
from maniport.arms.meshes.mesh_files import scaled
from maniport.arms.meshes.mesh_paths import MeshPaths
from maniport.errors import FileFormatError
from maniport.util.input_limits import NESTING


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
        links, joints = (Counter(e.get("name", "") for e in self.root.findall(tag)) for tag in ("link", "joint"))
        for what, names in (("link", links), ("joint", joints)):
            for name, count in names.items():
                if not name or count > 1:
                    return f"{what} {name!r} appears {count} times" if name else f"a {what} has no name"
        children: dict[str, list[str]] = {link: [] for link in links}
        below = set[str]()
        for joint in self.root.findall("joint"):
            name, kind = joint.get("name", ""), joint.get("type")
            kinds = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")
            if kind not in kinds:
                return f"joint {name!r} has type {kind!r}; allowed are {', '.join(kinds)}"
            ends = {end: joint.find(end) for end in ("parent", "child")}
            parent, child = (None if element is None else element.get("link", "") for element in ends.values())
            for end, link in (("parent", parent), ("child", child)):
                if link not in links:
                    return f"joint {name!r} names {link!r} as {end} link, which does not exist"
            if child in below:
                return f"link {child!r} is the child of two joints"
            children[str(parent)].append(str(child))
            below.add(str(child))
            if kind in ("revolute", "prismatic") and joint.find("limit") is None:
                return (
                    f"joint {name!r} is {kind} and has no <limit>; use the type 'continuous' for joints without limits"
                )
        level = [link for link in links if link not in below]
        if len(level) != 1:
            return f"must have one root link; found {len(level)}{': ' if level else ''}{', '.join(map(repr, level))}"
        depth = reached = 0
        while level:
            depth, reached = depth + 1, reached + len(level)
            level = [child for link in level for child in children[link]]
        if reached < len(links):
            return "has links in a cycle"
        for body in self.root.findall("link"):
            for inertial in body.findall("inertial"):
                if fault := self._inertia_fault(body, inertial):
                    return fault
        # recursive native readers cannot process deeper chains
        return f"has {depth} links in a row; at most {NESTING} are read" if depth > NESTING else ""

    def _inertia_fault(self, link: Element, inertial: Element) -> str:
        """Describe the fault of masses that Pinocchio would omit or not check."""
        mass, inertia, origin = (
            Element(tag) if (part := inertial.find(tag)) is None else part for tag in ("mass", "inertia", "origin")
        )
        for name in ("xyz", "rpy"):
            self._numbers(link, origin, name, 3, "0 0 0")
        moments = [self._numbers(link, inertia, f"i{axes}", 1, "")[0] for axes in ("xx", "yy", "zz", "xy", "xz", "yz")]
        return inertia_fault(link.get("name", ""), self._numbers(link, mass, "value", 1)[0], moments)

    def shapes(self, links: Collection[str], paths: MeshPaths) -> Iterator[Shape]:
        """Yield shapes from <visual>, or from <collision> of links without <visual> or with a missing mesh."""
        find = cache(paths.find)

        def meshes(link: Element, part: str) -> list[str]:
            return [name for mesh in link.iterfind(f"{part}/geometry/mesh") if (name := mesh.get("filename", ""))]

        owners = [link for link in self.root.findall("link") if link.get("name") in links]
        kinds = ["visual" if all(map(find, meshes(link, "visual"))) else "collision" for link in owners]
        for link, kind in zip(owners, kinds, strict=True):
            if kind == "collision" and not (link.findall(kind) and all(map(find, meshes(link, kind)))):
                names = dict.fromkeys(name for owner in owners for name in meshes(owner, "visual"))
                first = next(name for name in meshes(link, "visual") if find(name) is None)
                raise FileFormatError(
                    f"{self.path}: the mesh {first!r} is missing ({[*map(find, names)].count(None)} of {len(names)} "
                    f"meshes are); looked {paths.rule(first)}"
                )
        for link, kind in zip(owners, kinds, strict=True):
            for part in link.findall(kind) or link.findall("collision"):
                points, triangles = self._mesh(paths, link, part)
                origin = part.find("origin")
                if origin is not None:
                    placement = pose(*(self._numbers(link, origin, name, 3, "0 0 0") for name in ("xyz", "rpy")))
                    points = points @ placement[:3, :3].T + placement[:3, 3]
                yield Shape(link.get("name", ""), (points, triangles), stand_in=kind == "collision")

    def _mesh(self, paths: MeshPaths, link: Element, part: Element) -> tuple[np.ndarray, np.ndarray]:
        """Return the mesh of one <visual> or <collision> of a link in its own frame."""
        path, name, geometry = self.path, link.get("name", ""), part.find("geometry")
        if geometry is None or not len(geometry):
            raise FileFormatError(f"{path}: a <{part.tag}> of link {name!r} has no <geometry>")
        shape = geometry[0]
        if shape.tag == "mesh":
            file = paths.find(title) if (title := shape.get("filename", "")) else None
            if file is None:
                raise FileFormatError(f"{path}: a <mesh> of link {name!r} names no file")
            return scaled(paths.mesh(file), np.array(self._numbers(link, shape, "scale", 3, "1 1 1")))
        sizes = {"box": {"size": 3}, "sphere": {"radius": 1}}
        sizes["cylinder"] = sizes["capsule"] = {"radius": 1, "length": 1}
        if shape.tag not in sizes:
            raise FileFormatError(
                f"{path}: link {name!r} has the shape <{shape.tag}>; allowed are mesh, box, sphere, cylinder, capsule"
            )
        numbers = [x for key, n in sizes[shape.tag].items() for x in self._numbers(link, shape, key, n)]
        capsules = [capsule.get("name") for capsule in link.iterfind("collision_checking/capsule")]
        rounded = shape.tag == "cylinder" and part.tag == "collision" and part.get("name") in capsules
        return SOLIDS["capsule" if rounded else shape.tag](*numbers)

    def _numbers(
        self, link: Element, element: Element, name: str, count: int, default: str | None = None
    ) -> list[float]:
        """Finite numbers of an attribute; sizes, which have no default, must not be negative."""
        text = element.get(name, default)
        try:
            numbers = [float(word) for word in (text or "").split()]
        except ValueError:
            numbers = []
        if len(numbers) != count or not np.all(np.isfinite(numbers)) or (default is None and min(numbers) < 0):
            rule = f"{count} finite {'' if default else 'non-negative '}number{'s' if count > 1 else ''}"
            raise FileFormatError(
                f"{self.path}: <{element.tag}> of link {link.get('name', '')!r} needs {name} with {rule}; "
                f"found {text!r}"
            )
        return numbers
