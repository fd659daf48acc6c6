"""XML trees of MJCF: included files, names of unnamed bodies and joints, one tree of bodies."""

import copy
import os
from pathlib import Path
from xml.etree import ElementTree

from maniport.arms.loaders.document import parsed
from maniport.errors import FileFormatError
from maniport.util.input_limits import INCLUDES, NESTING, ROBOT_BYTES, TAGS, existing_file, require_at_most

WORLD = "world"  # name of the root body


def with_includes(path: Path, root: ElementTree.Element) -> ElementTree.Element:
    """Insert included files as MuJoCo does, and name unnamed bodies and joints."""
    tree = copy.deepcopy(root)
    if root.find(".//include") is not None:
        _fill(tree, path, {path.resolve(): sum(1 for _ in root.iter())})
        first: dict[str, ElementTree.Element] = {}
        for section in list(tree):  # join sections of one name; later attributes override earlier ones
            if section.tag in first:
                first[section.tag].attrib.update(section.attrib)
                first[section.tag].extend(section)
                tree.remove(section)
            else:
                first[section.tag] = section
    taken = {element.get("name") for element in tree.iterfind("worldbody//*")}
    for parent in [body for world in tree.findall("worldbody") for body in (world, *world.iter("body"))]:
        joints = [joint for joint in parent.findall("joint") if joint.get("type") != "free"]
        for what, parts in (("joint", joints), ("body", parent.findall("body"))):
            for k, part in enumerate(parts, start=1):
                if part.get("name") is None:  # names by Pinocchio would lose the ranges
                    name = f"{parent.get('name', WORLD)}_{what}{k}"
                    while name in taken:
                        name += "_2"
                    part.set("name", name)
                    taken.add(name)
    return tree


def _fill(element: ElementTree.Element, path: Path, seen: dict[Path, int], level: int = 1) -> None:
    """Replace <include> by the content of files; `seen` counts the elements of each file."""
    require_at_most(level, NESTING, "levels of elements within elements, with the files that it includes", path)
    children: list[ElementTree.Element] = []
    for child in element:
        if child.tag != "include":
            _fill(child, path, seen, level + 1)
            children.append(child)
            continue
        name = child.get("file", "")
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
        children += root
    element[:] = children


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
