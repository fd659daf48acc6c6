"""XML documents of MJCF: included files, default classes, units, orientations and limits."""

import copy
import os
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np
from scipy.spatial.transform import Rotation

from maniport.arms.chain import rotation_about
from maniport.arms.loaders.document import LARGEST, numbers, parsed, require
from maniport.arms.loaders.package_folders import is_file
from maniport.errors import argument
from maniport.util.input_limits import (
    INCLUDES,
    INSERTIONS,
    LINKS,
    NESTING,
    ROBOT_BYTES,
    TAGS,
    existing_file,
    require_at_most,
)
from maniport.util.validation import Array

WORLD = "world"  # name of the root body
ACTUATORS = (
    "general",
    "motor",
    "position",
    "velocity",
    "intvelocity",
    "damper",
    "cylinder",
    "muscle",
    "adhesion",
)

PLAIN_MOTOR = {
    "gaintype": ("fixed",),
    "biastype": ("none",),
    "dyntype": ("none", "filter", "filterexact"),
}
"""Types of an actuator whose force is its control times a gain."""


class Document:
    """Attributes of the elements of an MJCF with its included files, their own or those of default classes."""

    def __init__(self, path: Path, root: Element, folders: Sequence[Path] = ()):
        self.path = path
        self.root = with_includes(path, root, folders)
        self.parents = dict[Element, Element]()
        for parent in self.root.iter():
            for child in parent:
                self.parents[child] = parent
        self.options = dict[str, str]()
        for compiler in self.root.findall("compiler"):
            self.options |= dict(compiler.items())
        self.joints = dict[str, Element]()
        for joint in self.root.iterfind("worldbody//joint"):
            self.joints[joint.get("name", "")] = joint

    def check(self) -> None:
        """Raise `FileFormatError` for inconsistent or unsupported elements."""
        tags = {element.tag for element in self.root.iter()}
        ignored = {"frame", "replicate", "attach", "composite", "flexcomp"} & tags
        require(
            not ignored,
            self.path,
            f"uses <{'>, <'.join(sorted(ignored))}>, which are not supported; save the model "
            "as one plain file first, for example with mujoco.MjModel.from_xml_path and mujoco.mj_saveLastXML",
        )
        order = self.options.get("eulerseq", "xyz")
        rule = re.fullmatch("[xyzXYZ]{3}", order) is not None
        require(rule, self.path, f"eulerseq must have three letters of xyzXYZ; found {order!r}")
        require(
            self.root.find("worldbody//body") is not None, self.path, "has no body in <worldbody>"
        )
        for tag in ("body", "joint"):
            elements = self.root.findall(f"worldbody//{tag}")
            names = Counter(element.get("name") for element in elements)
            require_at_most(names.total(), LINKS, f"elements <{tag}>", self.path)
            names[WORLD] += tag == "body"  # implicit
            for name, times in names.items():
                require(
                    name is None or times < 2, self.path, f"{tag} {name!r} appears {times} times"
                )
        classes = {None, *(default.get("class", "main") for default in self.root.iter("default"))}
        for element in self.root.findall("worldbody//*"):
            for name in (element.get("class"), element.get("childclass")):
                fault = f"<{element.tag}> is of the class {name!r}, which no <default> defines"
                require(name in classes, self.path, fault)

    def attribute(self, element: Element, attribute: str) -> str | None:
        """Return an attribute of an element, its own or that of its default class; actuators share their defaults."""
        if element.get(attribute) is not None or element.tag in ("body", "inertial"):
            return element.get(attribute)
        tags: tuple[str, ...] = (element.tag,)
        parent = self.parents.get(element)
        if element.tag in ACTUATORS:
            tags = ACTUATORS
        elif parent is not None and parent.tag in ("equality", "tendon"):
            tags = (parent.tag,)
        defaults = self._defaults_of(element)
        while defaults is not None and defaults.tag == "default":
            for default in reversed(defaults):
                if default.tag in tags and default.get(attribute) is not None:
                    return default.get(attribute)
            defaults = self.parents.get(defaults)
        return None

    def _defaults_of(self, element: Element) -> Element | None:
        """Return the <default> of the class of an element, its own or that of the bodies that contain it."""
        name = element.get("class")
        body = self.parents.get(element)
        while name is None and body is not None:
            name = body.get("childclass")
            body = self.parents.get(body)
        if name is not None:
            for defaults in self.root.iter("default"):
                if defaults.get("class") == name:
                    return defaults
        return self.root.find("default")

    def numbers(
        self,
        element: Element,
        name: str,
        count: int | None,
        default: str | None = None,
        most: float = LARGEST,
        least: float = -np.inf,
    ) -> Array:
        """Numbers of an attribute, its own or that of a class."""
        text = self.attribute(element, name)
        title = element.get("name", element.get("joint"))
        where = f"{self.path}: <{element.tag}>{'' if title is None else f' {title!r}'} needs {name}"
        return numbers(default if text is None else text, count, where, most, least)

    def option(self, name: str, count: int, default: str) -> Array:
        """Numbers of an attribute of <compiler>."""
        where = f"{self.path}: <compiler> needs {name}"
        return numbers(self.options.get(name, default), count, where)

    def pose(self, element: Element) -> Array:
        """Pose (4, 4) of an element in the frame of its body."""
        result = np.eye(4)
        result[:3, :3] = self._rotation(element)
        result[:3, 3] = self.numbers(element, "pos", 3, "0 0 0")
        return result

    def reference(self, mesh: Element) -> tuple[Array, Array]:
        """Rotation (3, 3) and origin (3,) of the frame in which MuJoCo expresses the points of a mesh."""
        origin = self.numbers(mesh, "refpos", 3, "0 0 0")
        values = self.numbers(mesh, "refquat", 4, "1 0 0 0")
        fault = f"<mesh> has refquat {values.tolist()}, which is no rotation"
        require(bool(np.linalg.norm(values) > 1e-9), self.path, fault)
        return np.asarray(Rotation.from_quat(values, scalar_first=True).as_matrix()), origin

    def _rotation(self, element: Element) -> Array:
        """Rotation (3, 3) of an element."""
        counts = {"quat": 4, "axisangle": 4, "euler": 3, "xyaxes": 6, "zaxis": 3}
        name = next((name for name in counts if self.attribute(element, name) is not None), None)
        if name is None:
            return np.eye(3)
        values = self.numbers(element, name, counts[name])
        length = np.linalg.norm(values[:4] if name == "quat" else values[:3])
        fault = f"<{element.tag}> has {name} {values.tolist()}, which is no rotation"
        require(name == "euler" or bool(length > 1e-9), self.path, fault)
        if name == "quat":
            return np.asarray(Rotation.from_quat(values, scalar_first=True).as_matrix())
        if name == "axisangle":
            axis = values[:3] / np.linalg.norm(values[:3])
            return np.asarray(Rotation.from_rotvec(values[3] * self._angle * axis).as_matrix())
        if name == "euler":
            turn = np.eye(3)
            letters = self.options.get("eulerseq", "xyz")
            for letter, angle in zip(letters, values * self._angle, strict=True):
                step = rotation_about("xyz".index(letter.lower()), float(angle))
                if letter.islower():
                    turn = turn @ step
                else:
                    turn = step @ turn
            return turn
        return rotation_to(values)

    @property
    def _angle(self) -> float:
        if self.options.get("angle") == "radian":
            return 1.0
        return np.pi / 180

    def rest(self, name: str | None) -> float:
        """Return the `ref` of a joint [rad] or [m]."""
        joint = self.joints.get(name or "")
        if joint is None:
            return 0.0
        return float(self.numbers(joint, "ref", 1, "0")[0]) * self.unit(joint)

    def unit(self, joint: Element) -> float:
        """Return the unit of a joint's range and rest position [rad] or [m]."""
        if self.attribute(joint, "type") in (None, "hinge"):
            return self._angle
        return 1.0

    def effort_limit(self, joint: Element) -> float:
        """Largest torque [N m] or force [N] of a joint and of all its actuators, in the weaker direction."""
        limit = self._weaker(joint, "actuatorfrc")
        drives = list(self._drives(joint))
        if not drives:
            return limit
        both_directions = np.zeros(2)
        for actuator, ratio in drives:
            low, high = self._actuator_range(actuator)
            ends = (ratio * low, ratio * high)
            both_directions += (max(0.0, -min(ends)), max(0.0, *ends))
        return min(limit, float(both_directions.min()))

    def _drives(self, joint: Element) -> Iterator[tuple[Element, float]]:
        """Actuators of a joint, also through fixed tendons, with the factors from their forces to its own."""
        name = joint.get("name")
        ratios: dict[str | None, float] = {}  # of tendons
        for tendon in self.root.findall("tendon/fixed"):
            for pulled in tendon.findall("joint"):
                if pulled.get("joint") == name:
                    coefficient = float(self.numbers(pulled, "coef", 1)[0])
                    ratios[tendon.get("name")] = coefficient + ratios.get(tendon.get("name"), 0.0)
        for actuator in self.root.findall("actuator/*"):
            gear = float(self.numbers(actuator, "gear", None, "1")[0])
            ratio = ratios.get(actuator.get("tendon"), 0.0)
            if name in (actuator.get("joint"), actuator.get("jointinparent")):
                ratio = 1.0
            if gear * ratio != 0.0:
                yield actuator, gear * ratio

    def _actuator_range(self, actuator: Element) -> Array:
        """Smallest and largest force of an actuator (2,): by its force range, or by the controls of a plain motor."""
        forces = self.range(actuator, "forcerange", "forcelimited")
        if actuator.tag not in ("motor", "general"):
            return forces
        for kind, plain in PLAIN_MOTOR.items():
            if self.attribute(actuator, kind) not in (None, *plain):
                return forces
        gain = float(self.numbers(actuator, "gainprm", None, "1")[0])
        if gain == 0.0:
            return np.zeros(2)
        controls = np.sort(gain * self.range(actuator, "ctrlrange", "ctrllimited"))
        return np.clip(controls, *forces)

    def _weaker(self, element: Element, what: str) -> float:
        """Smaller absolute value of the bounds ``<what>range``; infinite without them."""
        return float(np.abs(self.range(element, f"{what}range", f"{what}limited")).min())

    def range(self, element: Element, name: str, limited: str) -> Array:
        """Bounds of an element, its own or those of its class; infinite without them."""
        if self.attribute(element, limited) == "false":
            return np.array([-np.inf, np.inf])
        return self.numbers(element, name, 2, "-inf inf", np.inf)


def rotation_to(values: Array) -> Array:
    """Rotation (3, 3) with the x and y axis (6,), the second only in its plane, or with the z axis (3,)."""
    if len(values) == 6:
        x = values[:3] / np.linalg.norm(values[:3])
        y = values[3:] - (values[3:] @ x) * x
        y = y / np.linalg.norm(y)
        return np.stack([x, y, np.cross(x, y)], axis=1)
    normal = np.cross((0.0, 0.0, 1.0), values)
    length = float(np.linalg.norm(normal))
    axis = np.array([1.0, 0.0, 0.0])
    if length > 1e-10:
        axis = normal / length
    return np.asarray(Rotation.from_rotvec(np.arctan2(length, values[2]) * axis).as_matrix())


def with_includes(path: Path, root: Element, folders: Sequence[Path] = ()) -> Element:
    """Insert included files as MuJoCo does, and name unnamed bodies and joints."""
    tree = copy.deepcopy(root)
    if root.find(".//include") is not None:
        Inclusion(path, folders, tree)
    _join_sections(tree)
    taken = {element.get("name") for element in tree.iterfind("worldbody//*")}
    for tag in ("body", "joint"):
        number = 0
        for element in tree.iterfind(f"worldbody//{tag}"):
            if element.get("name") is not None:
                continue
            number += 1
            while f"{tag}{number}" in taken:
                number += 1
            element.set("name", f"{tag}{number}")
    return tree


def _join_sections(tree: Element) -> None:
    """Join the sections of one name; later attributes override earlier ones."""
    first: dict[str, Element] = {}
    for section in list(tree):
        if section.tag in first:
            first[section.tag].attrib.update(section.attrib)
            first[section.tag].extend(section)
            tree.remove(section)
        else:
            first[section.tag] = section


class Inclusion:
    """Replacement of each <include> of a model by the content of its file, as MuJoCo 3.17 does.

    MuJoCo accepts a file once in the model's own file. Included files may include the same file several times, and a
    file that another included file includes, but none that the model's own file has included before, nor themselves.
    """

    def __init__(self, path: Path, folders: Sequence[Path], root: Element):
        self.path = path
        self.allowed = [path.parent.resolve(), *(folder.resolve() for folder in folders)]
        self.read: dict[Path, Element] = {}  # cache
        self.insertions = 0
        self.elements = len(list(root.iter()))
        self._fill(root, path, {path.resolve()}, 1)

    def _fill(self, element: Element, path: Path, included: set[Path], level: int) -> None:
        """Fill an element of the file `path`; `included` are files that it must not include."""
        what = "levels of elements within elements, with the files that it includes"
        require_at_most(level, NESTING, what, path)
        children: list[Element] = []
        for child in element:
            if child.tag != "include":
                self._fill(child, path, included, level + 1)
                children.append(child)
                continue
            name = child.get("file", "")
            file = self._file(name, path)
            fault = f"includes {name!r} more than once, or in a cycle, which MuJoCo refuses, too"
            require(file not in included, path, f"{fault}; write the content in its place")
            if path == self.path:
                included.add(file)
            content = self._content(file, path)
            self._fill(content, file, included | {file}, level)
            children += content
        element[:] = children

    def _file(self, name: str, path: Path) -> Path:
        """Return an included file: relative to the model's file, else to the including file."""
        require(bool(name), path, "an <include> names no file")
        found = self.path.parent / name
        if not is_file(found):
            found = path.parent / name
        file = Path(os.path.realpath(found))  # not strict: symbolic links may be cyclic
        inside = any(file.is_relative_to(folder) for folder in self.allowed)
        require(
            inside,
            path,
            f"includes {name!r}, which lies outside of its folder; put it below that, or allow its folder with "
            f"{argument('mesh_folders')}",
        )
        return file

    def _content(self, file: Path, path: Path) -> Element:
        """Read an included file; each insertion is a copy."""
        if file not in self.read:
            require_at_most(len(self.read) + 1, INCLUDES, "included files", self.path)
            hint = f"; {path} includes it"
            self.read[file] = parsed(existing_file(file, (".xml", ".mjcf"), ROBOT_BYTES, hint))
        root = self.read[file]
        self.insertions += 1
        require_at_most(self.insertions, INSERTIONS, "inclusions of files", self.path)
        self.elements += len(list(root.iter()))
        what = "elements with those of the files that it includes"
        require_at_most(self.elements, TAGS, what, self.path)
        return copy.deepcopy(root)
