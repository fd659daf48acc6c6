"""An MJCF as one tree in one file: included files in their places, sections of one name joined.

Pinocchio's reader passes over `<include>`, over all trees of bodies but the first, and over where the first body stands
when it cannot move.
"""

import copy
import os
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

from maniport.arms.loaders.document import parsed
from maniport.errors import FileFormatError
from maniport.util.input_limits import INCLUDES, NESTING, ROBOT_BYTES, TAGS, existing_file, require_at_most

_SUFFIXES = (".xml", ".mjcf")
WORLD = "world"


def whole(path: Path, root: ElementTree.Element) -> ElementTree.Element:
    """The tree of an MJCF file with all that it includes, as MuJoCo does it, and names for what has none."""
    found = copy.deepcopy(root)
    if root.find(".//include") is not None:
        _fill(found, path, {path.resolve(): sum(1 for _ in root.iter())})
        _join(found)
    _name(found)
    return found


def _fill(element: ElementTree.Element, path: Path, seen: dict[Path, int], level: int = 1) -> None:
    """Put what files hold in the places where they are included; `seen` counts the elements of each."""
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
    """What stands in an included file."""
    name = include.get("file", "")
    if not name:
        raise FileFormatError(f"{path}: an <include> names no file")
    file = Path(os.path.realpath(path.parent / name))  # as far as there is one: links may go in a circle
    if not file.is_relative_to(path.parent.resolve()):
        raise FileFormatError(f"{path}: includes {name!r}, which lies outside of its folder; put it below that")
    if file in seen:
        raise FileFormatError(f"{path}: includes {name!r} more than once, or in a circle")
    require_at_most(len(seen), INCLUDES, "included files", path)
    root = parsed(existing_file(file, _SUFFIXES, ROBOT_BYTES, f"; {path} includes it"))[1]
    seen[file] = sum(1 for _ in root.iter())
    require_at_most(sum(seen.values()), TAGS, "elements with those of the files that it includes", path)
    _fill(root, path, seen, level)
    yield from root


def _join(root: ElementTree.Element) -> None:
    """Join sections of one name, as later ones add to and overrule earlier ones."""
    first: dict[str, ElementTree.Element] = {}
    for section in list(root):
        if section.tag in first:
            first[section.tag].attrib.update(section.attrib)
            first[section.tag].extend(section)
            root.remove(section)
        else:
            first[section.tag] = section


def _name(root: ElementTree.Element) -> None:
    """Name bodies and joints without a name after where they stand; Pinocchio's names would lose their ranges."""
    taken = {element.get("name") for element in root.iterfind("worldbody//*")}
    for parent in [one for world in root.findall("worldbody") for one in (world, *world.iter("body"))]:
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
    """A copy in which all bodies hang on one that stands where the world is, and none floats."""
    found = copy.deepcopy(root)
    for body in found.iter("body"):
        for joint in [*body.findall("freejoint"), *body.findall("joint[@type='free']")]:
            body.remove(joint)
    for world in found.iter("worldbody"):
        hull = ElementTree.Element("body", {"name": WORLD, **world.attrib})
        hull.extend(world)
        world[:] = [hull]
    return found


def kinematics(root: ElementTree.Element) -> ElementTree.Element:
    """The same without what neither moves nor is moved: shapes, motors, sensors, pictures."""
    found = one_tree(root)
    for section in [section for section in found if section.tag not in ("compiler", "default", "worldbody")]:
        found.remove(section)
    for parent in list(found.iter()):
        for part in [child for child in parent if child.tag in ("geom", "camera", "light")]:
            parent.remove(part)
    return found
