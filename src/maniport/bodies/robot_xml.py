"""What the XML of a robot says that Pinocchio does not pass on, and what is wrong with it in plain words.

Pinocchio reads the kinematics. Here are the checks before that (its own messages do not name the fault), the joints
that follow other joints (mimic in URDF, joint equalities in MJCF), the names of several joints on one MJCF body and
the ranges of MJCF joints (Pinocchio 4 converts those of slides from degrees and shifts those of joints with a `ref`).
"""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from maniport.errors import FileFormatError, InvalidInputError, nearest_first

SUFFIXES = (".urdf", ".xml", ".mjcf")
_URDF_JOINTS = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")
# Pinocchio's reader leaves these out without a word, and all bodies within them.
_MJCF_UNREAD = ("include", "frame", "replicate", "attach", "composite", "flexcomp")


@dataclass(frozen=True)
class Follower:
    """A joint whose position is ``factor · leader + offset``; without a leader it is constant."""

    leader: str | None
    factor: float
    offset: float
    linear: bool = True


@dataclass(frozen=True)
class RobotXML:
    """A robot file that was read as XML."""

    path: Path
    text: str
    root: ElementTree.Element

    @property
    def is_urdf(self) -> bool:
        """Whether the file is a URDF; else it is an MJCF."""
        return self.root.tag == "robot"

    def followers(self) -> dict[str, Follower]:
        """Joints that follow others, by name."""
        try:
            return dict(self._mimics() if self.is_urdf else self._equalities())
        except ValueError as error:
            raise FileFormatError(f"{self.path}: a mimic or equality holds no number: {error}") from None

    def _mimics(self) -> Iterator[tuple[str, Follower]]:
        for joint in self.root.findall("joint"):
            mimic = joint.find("mimic")
            if mimic is not None:
                factor, offset = float(mimic.get("multiplier", "1")), float(mimic.get("offset", "0"))
                yield joint.get("name", ""), Follower(mimic.get("joint", ""), factor, offset)

    def _equalities(self) -> Iterator[tuple[str, Follower]]:
        elements = {name: element for joints in self.body_joints().values() for name, element in joints.items()}
        for joint in self.root.findall("equality/joint"):
            if joint.get("active", "true") == "true":
                follower, leader = joint.get("joint1", ""), joint.get("joint2")
                c = [float(x) for x in joint.get("polycoef", "0 1 0 0 0").split()] + [0.0] * 5
                # MuJoCo counts both positions from their rest values.
                offset = c[0] + self._rest(elements.get(follower)) - c[1] * self._rest(elements.get(leader or ""))
                yield follower, Follower(leader, c[1], offset, not any(c[2:]))

    def body_joints(self) -> dict[str, dict[str, ElementTree.Element]]:
        """Hinges, slides and balls of each MJCF body: body name, then joint name (made up where there is none)."""
        bodies = {}
        for body in self.root.findall("worldbody//body"):
            name = body.get("name", "")
            joints = [joint for joint in body.findall("joint") if joint.get("type") != "free"]
            bodies[name] = {joint.get("name") or f"{name}_joint{k + 1}": joint for k, joint in enumerate(joints)}
        return bodies

    def joint_range(self, name: str) -> tuple[float, float]:
        """Range of an MJCF joint [rad] or [m], its own or its default class's; infinite when it has none."""
        joint = next((joints[name] for joints in self.body_joints().values() if name in joints), None)
        text = None if joint is None else self._attribute(joint, "range")
        if joint is None or text is None or self._attribute(joint, "limited") == "false":
            return -np.inf, np.inf
        try:
            low, high = (float(x) * self._unit(joint) for x in text.split())
        except ValueError:
            raise FileFormatError(f"{self.path}: joint {name!r} has range {text!r}; two numbers are needed") from None
        return low, high

    def _rest(self, joint: ElementTree.Element | None) -> float:
        """Position of an MJCF joint in the pose that the file draws [rad] or [m]."""
        return 0.0 if joint is None else float(self._attribute(joint, "ref") or 0.0) * self._unit(joint)

    def _unit(self, joint: ElementTree.Element) -> float:
        angle = [compiler.get("angle") for compiler in self.root.findall("compiler") if compiler.get("angle")]
        hinge = self._attribute(joint, "type") in (None, "hinge")
        return np.pi / 180 if hinge and (not angle or angle[-1] == "degree") else 1.0

    def _attribute(self, joint: ElementTree.Element, attribute: str) -> str | None:
        """An attribute of an MJCF joint, its own or the one its default class gives it."""
        if joint.get(attribute) is not None:
            return joint.get(attribute)
        parents = {child: parent for parent in self.root.iter() for child in parent}
        name, node = joint.get("class"), parents.get(joint)
        while name is None and node is not None:
            name, node = node.get("childclass"), parents.get(node)
        top = self.root.find("default")
        entry = next((d for d in self.root.iter("default") if name is not None and d.get("class") == name), top)
        while entry is not None and entry.tag == "default":
            found = entry.find("joint")
            if found is not None and found.get(attribute) is not None:
                return found.get(attribute)
            entry = parents.get(entry)
        return None


def read_robot_xml(path: Path) -> RobotXML:
    """Read a URDF or MJCF and check what Pinocchio would stumble over.

    Raises
    ------
    FileFormatError
        When the file does not exist, is no XML, neither URDF nor MJCF, or is inconsistent; the message says where.
    """
    text = _read_text(path)
    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise FileFormatError(f"{path}: not readable as XML, perhaps cut off: {error}") from None
    source = RobotXML(path, text, root)
    if root.tag not in ("robot", "mujoco"):
        raise FileFormatError(
            f"{path}: neither a URDF (root <robot>) nor an MJCF (root <mujoco>); its root is <{root.tag}>"
        )
    fault = _urdf_fault(root) if source.is_urdf else _mjcf_fault(root)
    if fault:
        raise FileFormatError(f"{path}: {fault}")
    return source


def _read_text(path: Path) -> str:
    if not path.exists():
        raise FileFormatError(f"{path}: there is no such file{_similar(path)}")
    if path.is_dir():
        raise FileFormatError(f"{path}: this is a folder; give a file with suffix {', '.join(SUFFIXES)}")
    if path.suffix.lower() not in SUFFIXES:
        hint = "; expand it with the xacro tool first" if path.suffix == ".xacro" else ""
        raise FileFormatError(f"{path}: suffix {path.suffix!r} is not known; allowed are {', '.join(SUFFIXES)}{hint}")
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise FileFormatError(f"{path}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError as error:
        raise FileFormatError(f"{path}: not a text file: {error.reason} at byte {error.start}") from None
    if not text.strip():
        raise FileFormatError(f"{path}: the file is empty")
    return text.lstrip("\ufeff")


def _similar(path: Path) -> str:
    if not path.parent.is_dir():
        return f", nor a folder {str(path.parent)!r}"
    others = [other.name for other in path.parent.iterdir() if other.suffix.lower() in SUFFIXES]
    return f"; there are {', '.join(map(repr, nearest_first(path.name, others)[:5]))}" if others else ""


def _urdf_fault(root: ElementTree.Element) -> str:
    """The first inconsistency of a URDF in words, or nothing."""
    if any("xacro" in element.tag for element in root.iter()):
        return "this is a xacro file; expand it with the xacro tool first"
    if root.find("link") is None:
        return "holds no link"
    links = Counter(link.get("name", "") for link in root.findall("link"))
    joints = Counter(joint.get("name", "") for joint in root.findall("joint"))
    for what, names in (("link", links), ("joint", joints)):
        for name, count in names.items():
            if not name or count > 1:
                return f"{what} {name!r} appears {count} times" if name else f"a {what} has no name"
    children = set()
    for joint in root.findall("joint"):
        name, kind = joint.get("name", ""), joint.get("type")
        if kind not in _URDF_JOINTS:
            return f"joint {name!r} has type {kind!r}; allowed are {', '.join(_URDF_JOINTS)}"
        for end in ("parent", "child"):
            element = joint.find(end)
            link = None if element is None else element.get("link")
            if link not in links:
                return f"joint {name!r} names {link!r} as {end} link, which does not exist"
            if end == "child" and link in children:
                return f"link {link!r} is the child of two joints"
            if end == "child":
                children.add(link)
        if kind in ("revolute", "prismatic") and joint.find("limit") is None:
            return f"joint {name!r} is {kind} and has no <limit>; a joint without limits has type 'continuous'"
    roots = [link for link in links if link not in children]
    if len(roots) != 1:
        return f"must have one root link; found {len(roots)}{': ' if roots else ''}{', '.join(map(repr, roots))}"
    return ""


def _mjcf_fault(root: ElementTree.Element) -> str:
    """What keeps an MJCF from being read completely, in words, or nothing."""
    unread = sorted({tag for tag in _MJCF_UNREAD for _ in root.iter(tag)})
    if unread:
        return (
            f"uses <{'>, <'.join(unread)}>, which cannot be read here; write it as one plain file first, for instance "
            "with mujoco.MjModel.from_xml_path and mujoco.mj_saveLastXML"
        )
    if root.find("worldbody//body") is None:
        return "holds no body in <worldbody>"
    return ""


def require_not_follower(joints: tuple[str, ...], followers: dict[str, Follower], path: Path) -> None:
    """Raise when a joint that shall move follows another one."""
    for name in joints:
        if name in followers:
            leader = followers[name].leader
            raise InvalidInputError(f"joints: {name!r} in '{path}' cannot move by itself, it follows {leader!r}")
