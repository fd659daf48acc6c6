"""XML trees of robot files, within the limits of native readers, and MJCF as one tree with its included files.

Pinocchio ignores `<include>`, all trees of bodies but the first, and the pose of a first body that cannot move.
"""

import copy
import math
import os
import re
import subprocess
import sys
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from xml.etree import ElementTree
from xml.parsers import expat

from maniport.arms.loaders import xacro_child
from maniport.errors import FileFormatError
from maniport.util.input_limits import (
    INCLUDES,
    MEGABYTE,
    NESTING,
    ROBOT_BYTES,
    TAGS,
    existing_file,
    read_whole,
    require_at_most,
)
from maniport.util.optional import xacrodoc

XACRO = ".xacro"
WORLD = "world"  # name of the root body of an MJCF
LONGEST_XACRO = 30.0  # time limit for endless macros [s]

_PREFIX = re.compile(r"[<\s/]([A-Za-z_][\w.-]*):[A-Za-z_]")
_DECLARED = re.compile(r"\sxmlns:([A-Za-z_][\w.-]*)\s*=")
_OPENING = re.compile(r"<[A-Za-z_][\w.-]*(?::[A-Za-z_][\w.-]*)?")


def parsed(path: Path) -> tuple[str, ElementTree.Element]:
    """Read the text and the root of an XML file within the input limits."""
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
    require_at_most(_depth(root), NESTING, "levels of elements within elements", path)
    return text, root


def _root(text: str) -> ElementTree.Element:
    """Root of an XML document; undeclared prefixes, such as Drake's, are declared."""
    try:
        return ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        if error.code != expat.errors.codes[expat.errors.XML_ERROR_UNBOUND_PREFIX]:
            raise
    names = sorted(set(_PREFIX.findall(text)) - {"xml", "xmlns", *_DECLARED.findall(text)})
    declared = "".join(f' xmlns:{name}="{name}"' for name in names)
    return ElementTree.fromstring(_OPENING.sub(lambda root: root[0] + declared, text, count=1))


def _depth(root: ElementTree.Element) -> int:
    """Number of levels of elements."""
    level, depth = [root], 0
    while level:
        level, depth = [child for element in level for child in element], depth + 1
    return depth


LARGEST = 1e9  # upper bound of all numbers of a robot


def require_numbers(path: Path, elements: Iterable[ElementTree.Element], counts: Mapping[str, int]) -> None:
    """Require so many finite numbers in attributes, and nonzero quaternions."""
    for element in elements:
        for name in counts.keys() & element.keys():
            text = element.get(name, "")
            try:
                numbers = [float(word) for word in text.split()]
            except ValueError:
                numbers = []
            if len(numbers) != counts[name] or not all(abs(number) < LARGEST for number in numbers):
                raise FileFormatError(
                    f"{path}: <{element.tag}> needs {name} with {counts[name]} numbers, each below {LARGEST:g}; found "
                    f"{text[:80]!r}"
                )
            if name == "quat" and math.hypot(*numbers) < 1e-9:
                raise FileFormatError(f"{path}: <{element.tag}> has quat {text[:80]!r}, which is no rotation")


def _expanded(path: Path) -> str:
    """Expand a xacro file to a URDF, with the defaults of its arguments."""
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


def with_includes(path: Path, root: ElementTree.Element) -> ElementTree.Element:
    """Insert included files as MuJoCo does, and name unnamed bodies and joints."""
    tree = copy.deepcopy(root)
    if root.find(".//include") is not None:
        _fill(tree, path, {path.resolve(): sum(1 for _ in root.iter())})
        _join(tree)
    _name(tree)
    return tree


def _fill(element: ElementTree.Element, path: Path, seen: dict[Path, int], level: int = 1) -> None:
    """Replace <include> by the content of files; `seen` counts the elements of each file."""
    require_at_most(level, NESTING, "levels of elements within elements, with the files that it includes", path)
    children: list[ElementTree.Element] = []
    for child in element:
        if child.tag == "include":
            children += _included(child, path, seen, level)
        else:
            _fill(child, path, seen, level + 1)
            children.append(child)
    element[:] = children


def _included(
    include: ElementTree.Element, path: Path, seen: dict[Path, int], level: int
) -> Iterator[ElementTree.Element]:
    """Elements of an included file."""
    name = include.get("file", "")
    if not name:
        raise FileFormatError(f"{path}: an <include> names no file")
    file = Path(os.path.realpath(path.parent / name))  # not strict: symbolic links may be cyclic
    if not file.is_relative_to(path.parent.resolve()):
        raise FileFormatError(f"{path}: includes {name!r}, which lies outside of its folder; put it below that")
    if file in seen:
        raise FileFormatError(f"{path}: includes {name!r} more than once, or in a cycle")
    require_at_most(len(seen), INCLUDES, "included files", path)
    root = parsed(existing_file(file, (".xml", ".mjcf"), ROBOT_BYTES, f"; {path} includes it"))[1]
    seen[file] = sum(1 for _ in root.iter())
    require_at_most(sum(seen.values()), TAGS, "elements with those of the files that it includes", path)
    _fill(root, path, seen, level)
    yield from root


def _join(root: ElementTree.Element) -> None:
    """Join sections of one name; later attributes override earlier ones."""
    first: dict[str, ElementTree.Element] = {}
    for section in list(root):
        if section.tag in first:
            first[section.tag].attrib.update(section.attrib)
            first[section.tag].extend(section)
            root.remove(section)
        else:
            first[section.tag] = section


def _name(root: ElementTree.Element) -> None:
    """Name unnamed bodies and joints after their parent; names by Pinocchio would lose the ranges."""
    taken = {element.get("name") for element in root.iterfind("worldbody//*")}
    for parent in [body for world in root.findall("worldbody") for body in (world, *world.iter("body"))]:
        above = parent.get("name", WORLD)
        joints = [joint for joint in parent.findall("joint") if joint.get("type") != "free"]
        for what, parts in (("joint", joints), ("body", parent.findall("body"))):
            for k, part in enumerate(parts, start=1):
                if part.get("name") is None:
                    name = f"{above}_{what}{k}"
                    while name in taken:
                        name += "_2"
                    part.set("name", name)
                    taken.add(name)


def one_tree(root: ElementTree.Element) -> ElementTree.Element:
    """Copy a tree with all bodies below one at the origin of the world, without free joints."""
    tree = copy.deepcopy(root)
    for body in tree.iter("body"):
        for joint in [*body.findall("freejoint"), *body.findall("joint[@type='free']")]:
            body.remove(joint)
    for world in tree.iter("worldbody"):
        hull = ElementTree.Element("body", {"name": WORLD, **world.attrib})
        hull.extend(world)
        world[:] = [hull]
    return tree


def kinematics(root: ElementTree.Element) -> ElementTree.Element:
    """Copy a tree without shapes, actuators, sensors, cameras and lights."""
    tree = one_tree(root)
    for section in [section for section in tree if section.tag not in ("compiler", "default", "worldbody")]:
        tree.remove(section)
    for parent in list(tree.iter()):
        for part in [child for child in parent if child.tag in ("geom", "camera", "light")]:
            parent.remove(part)
    return tree
