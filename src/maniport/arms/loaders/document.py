"""A robot's XML as a tree that is no larger than native readers bear."""

import math
import re
import subprocess
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from xml.etree import ElementTree
from xml.parsers import expat

from maniport.arms.loaders import xacro_child
from maniport.errors import FileFormatError
from maniport.util.input_limits import MEGABYTE, NESTING, ROBOT_BYTES, TAGS, read_whole, require_at_most
from maniport.util.optional import xacrodoc

XACRO = ".xacro"
LONGEST_XACRO = 30.0  # Macros that are expanded for longer than this never end [s]

_PREFIX = re.compile(r"[<\s/]([A-Za-z_][\w.-]*):[A-Za-z_]")
_DECLARED = re.compile(r"\sxmlns:([A-Za-z_][\w.-]*)\s*=")
_OPENING = re.compile(r"<[A-Za-z_][\w.-]*(?::[A-Za-z_][\w.-]*)?")


def parsed(path: Path) -> tuple[str, ElementTree.Element]:
    """Text and root of an XML file; `FileFormatError` when it cannot be read as one, or holds more than is read."""
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
    """Root of an XML document; prefixes that it does not declare, such as Drake's, are as if it did."""
    try:
        return ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        if error.code != expat.errors.codes[expat.errors.XML_ERROR_UNBOUND_PREFIX]:
            raise
    names = sorted(set(_PREFIX.findall(text)) - {"xml", "xmlns", *_DECLARED.findall(text)})
    declared = "".join(f' xmlns:{name}="{name}"' for name in names)
    return ElementTree.fromstring(_OPENING.sub(lambda root: root[0] + declared, text, count=1))


def _depth(root: ElementTree.Element) -> int:
    """How deep elements stand in one another."""
    level, depth = [root], 0
    while level:
        level, depth = [child for element in level for child in element], depth + 1
    return depth


LARGEST = 1e9  # No number of a robot is larger, whatever it measures


def require_numbers(path: Path, elements: Iterable[ElementTree.Element], counts: Mapping[str, int]) -> None:
    """Raise unless attributes hold so many finite numbers, and quaternions are not zero."""
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
    """The URDF that a xacro file stands for, with the defaults of its arguments."""
    xacrodoc()
    child = [sys.executable, "-P", xacro_child.__file__, str(path), str(ROBOT_BYTES), str(2048 * MEGABYTE)]
    try:
        done = subprocess.run(child, stdin=subprocess.DEVNULL, capture_output=True, timeout=LONGEST_XACRO, check=False)
    except subprocess.TimeoutExpired:
        raise FileFormatError(f"{path}: xacro cannot expand it: it takes more than {LONGEST_XACRO:g} s") from None
    text = done.stdout.decode(errors="replace")
    if done.returncode != 0:
        reason = " ".join(text.split()) or f"it ended with {done.returncode}"
        if (package := re.search(r"Package not found: (\S+)", reason)) is not None:
            reason = (
                f"there is no package {package[1]!r} above its folder or in ROS_PACKAGE_PATH; --mesh-folders on the "
                "command line adds a folder of packages"
            )
        raise FileFormatError(f"{path}: xacro cannot expand it: {reason}")
    if len(text) > ROBOT_BYTES:
        raise FileFormatError(f"{path}: is {len(text) / MEGABYTE:.4g} MB when expanded; too large")
    return text
