"""Robot files as XML, within the limits of native readers, and xacro files expanded to URDF."""

import re
import subprocess
import sys
from abc import abstractmethod
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar
from xml.etree import ElementTree
from xml.parsers import expat

import numpy as np
import pinocchio as pin

from maniport.arms.chain import Shape
from maniport.arms.loaders import xacro_child
from maniport.arms.meshes.mesh_paths import MeshPaths
from maniport.errors import FileFormatError
from maniport.util.input_limits import (
    LINKS,
    MEGABYTE,
    NESTING,
    ROBOT_BYTES,
    SHAPES,
    TAGS,
    TRIANGLES,
    read_whole,
    require_at_most,
)
from maniport.util.optional import xacrodoc
from maniport.util.validation import MAX_POSITION

XACRO = ".xacro"
LONGEST_XACRO = 30.0  # time limit for endless macros [s]
LARGEST = 1e9  # upper bound of all numbers of a robot


@dataclass(frozen=True)
class Follower:
    """A joint whose position is ``factor · leader + offset``; without a leader it is constant."""

    leader: str | None
    factor: float
    offset: float
    linear: bool = True

    def __post_init__(self) -> None:
        if not max(abs(self.factor), abs(self.offset)) <= LARGEST:  # false for nan, too
            raise ValueError(f"a factor of {self.factor:g} and an offset of {self.offset:g}")


@dataclass(frozen=True)
class RobotXML:
    """A robot file as XML, for the content that Pinocchio does not pass on."""

    path: Path
    text: str
    root: ElementTree.Element

    name: ClassVar[str]
    tag: ClassVar[str]  # the root element of such a file
    bounded: ClassVar[tuple[str, str]]  # tags of links and joints

    @classmethod
    def checked(cls, path: Path, text: str, root: ElementTree.Element) -> "RobotXML":
        """Check the text and the root of a file."""
        source = cls(path, text, root)
        for tag in cls.bounded:
            require_at_most(sum(1 for _ in root.iter(tag)), LINKS, f"elements <{tag}>", path)
        fault = source.fault() if root.tag == cls.tag else f"must have the root <{cls.tag}>; found <{root.tag}>"
        if fault:
            raise FileFormatError(f"{path}: {fault}")
        return source

    @abstractmethod
    def fault(self) -> str:
        """Describe the first inconsistency; empty without one."""

    @abstractmethod
    def build(self) -> pin.Model:
        """Read the kinematics with Pinocchio."""

    @abstractmethod
    def followers(self) -> Iterable[tuple[str, Follower]]:
        """Return the joints that follow others."""

    @abstractmethod
    def shapes(self, links: Collection[str], paths: MeshPaths) -> Iterable[Shape]:
        """Return the visual shapes of some links; `paths` finds their meshes."""

    def body_joints(self) -> dict[str, dict[str, ElementTree.Element]]:
        """Return the joints of each body, if bodies may have several: body name, then joint name."""
        return {}

    def joint_range(self, name: str) -> tuple[float, float] | None:
        """Return the range of a joint [rad] or [m] if Pinocchio's is wrong, else None."""
        return None

    def rest_position(self, name: str) -> float:
        """Return the position of a joint in the pose that Pinocchio reads as zero [rad] or [m]."""
        return 0.0

    def effort_limit(self, name: str) -> float | None:
        """Return the largest torque [N m] or force [N] of a joint if Pinocchio's is wrong, else None."""
        return None

    def unweighed(self) -> set[str]:
        """Return the bodies with masses by their shapes, which are not computed."""
        return set()


def inertia_fault(link: str, mass: float, moments: Sequence[float]) -> str:
    """Describe an impossible mass [kg] or impossible moments of inertia xx, yy, zz, xy, xz, yz [kg m²] of a link."""
    if not 0 <= mass < LARGEST or not np.all(np.abs(moments) < LARGEST):
        return (
            f"link {link!r} must have a mass of 0 to {LARGEST:g} kg and moments of inertia below {LARGEST:g} kg m²; "
            f"found {mass:g} and {', '.join(f'{moment:g}' for moment in moments)}"
        )
    least = float(np.linalg.eigvalsh(np.array(moments)[[[0, 3, 4], [3, 1, 5], [4, 5, 2]]])[0])
    # small negative moments are common rounding errors of small links
    return (
        f"link {link!r} has the moment of inertia {least:.3g} kg m² about an axis; it must not be negative"
        if least < -1e-6
        else ""
    )


def read_shapes(
    kind: type[RobotXML], path: Path, links: Collection[str], mesh_folders: Sequence[Path] = ()
) -> list[Shape]:
    """Read the visual shapes of some links; meshes of others may be missing."""
    shapes: list[Shape] = []
    triangles = 0
    for shape in kind.checked(path, *parsed(path)).shapes(links, MeshPaths(path, mesh_folders)):
        shapes.append(shape)
        triangles += len(shape.mesh[1])
        require_at_most(triangles, TRIANGLES, "triangles in its shapes", path)
        require_at_most(len(shapes), SHAPES, "shapes", path)
        if not np.all(np.abs(shape.mesh[0]) < MAX_POSITION):  # false for nan, too
            raise FileFormatError(f"{path}: a shape of link {shape.link!r} reaches farther than {MAX_POSITION:g} m")
    return shapes


def parsed(path: Path) -> tuple[str, ElementTree.Element]:
    """Read the text and the root of an XML file within the input limits; a xacro file is expanded."""
    try:
        content = read_whole(path, (), ROBOT_BYTES).decode("utf-8").lstrip("\ufeff")
        text = _expanded(path) if path.suffix.lower() == XACRO else content
        require_at_most(text.count("<"), TAGS, "tags", path)
        root = _root(text)
    except UnicodeDecodeError as error:
        raise FileFormatError(f"{path}: not a text file: {error.reason} at byte {error.start}") from None
    except (ElementTree.ParseError, ValueError) as error:
        if isinstance(error, FileFormatError):
            raise
        raise FileFormatError(f"{path}: not readable as XML, perhaps cut off: {error}") from None
    level, depth = [root], 0
    while level:
        level, depth = [child for element in level for child in element], depth + 1
    require_at_most(depth, NESTING, "levels of elements within elements", path)
    return text, root


def _root(text: str) -> ElementTree.Element:
    """Root of an XML document; undeclared prefixes, such as Drake's, are declared."""
    try:
        return ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        if error.code != expat.errors.codes[expat.errors.XML_ERROR_UNBOUND_PREFIX]:
            raise
    used, declared = (
        set(re.findall(pattern, text))
        for pattern in (r"[<\s/]([A-Za-z_][\w.-]*):[A-Za-z_]", r"\sxmlns:([A-Za-z_][\w.-]*)\s*=")
    )
    names = "".join(f' xmlns:{name}="{name}"' for name in sorted(used - declared - {"xml", "xmlns"}))
    opening = r"<[A-Za-z_][\w.-]*(?::[A-Za-z_][\w.-]*)?"
    return ElementTree.fromstring(re.sub(opening, lambda root: root[0] + names, text, count=1))


def _expanded(path: Path) -> str:
    """Expand a xacro file to a URDF, with the defaults of its arguments, in a process with limits."""
    xacrodoc()
    child = [sys.executable, "-P", xacro_child.__file__, str(path), str(ROBOT_BYTES), str(2048 * MEGABYTE)]
    try:
        done = subprocess.run(child, stdin=subprocess.DEVNULL, capture_output=True, timeout=LONGEST_XACRO, check=False)
    except subprocess.TimeoutExpired:
        raise FileFormatError(f"{path}: xacro cannot expand it: it takes more than {LONGEST_XACRO:g} s") from None
    text = done.stdout.decode(errors="replace")
    if done.returncode != 0:
        reason = " ".join(text.split()) or f"exit code {done.returncode}"
        if (package := re.search(r"Package not found: (\S+)", reason)) is not None:
            reason = (
                f"there is no package {package[1]!r} above its folder or in ROS_PACKAGE_PATH; --mesh-folders on the "
                "command line adds a folder of packages"
            )
        raise FileFormatError(f"{path}: xacro cannot expand it: {reason}")
    if len(text) > ROBOT_BYTES:
        raise FileFormatError(f"{path}: is {len(text) / MEGABYTE:.4g} MB when expanded; too large")
    return text
