"""Folders of ROS packages: near a robot file, in the folders of ROS, and in folders that the user names.

This file uses the standard library alone: the process that expands xacro files runs it without maniport.
"""

import os
import re
from collections.abc import Iterator, Sequence
from pathlib import Path

MARKS = ("package.xml", "manifest.xml")
"""Files that mark a folder as a package of ROS 2 or ROS 1."""
NEAR = 3  # folders above a robot file in which packages need no marker
DEPTH = 4  # levels below a folder of ROS, or of the user, on which packages are searched
MOST_FOLDERS = 20_000  # that are searched below such a folder
MOST_CHILDREN = 2_000  # of one folder that are searched


def find_package(title: str, file: Path, more: Sequence[Path] = ()) -> Path | None:
    """Return the folder of a package; folders with a marker come first."""
    unmarked = None
    for path in dict.fromkeys((file.absolute(), file.resolve())):
        for folder in package_folders(title, path, more):
            if not folder.is_dir():
                continue
            if origins(folder):
                return folder
            unmarked = unmarked or folder
    return unmarked


def package_folders(title: str, file: Path, more: Sequence[Path] = ()) -> Iterator[Path]:
    """Yield folders that the package of a name may have, the likely ones first; some do not exist.

    Parameters
    ----------
    title : str
        Name of the package: that of its folder, or the one in its ``package.xml``.
    file : Path
        Robot file. Packages are searched in all folders above it, more than `NEAR` levels up only those with a marker.
    more : sequence of Path
        Folders that the user names, searched after ``ROS_PACKAGE_PATH`` and ``AMENT_PREFIX_PATH``.
    """
    found = False
    for i, place in enumerate(file.absolute().parents):
        near = i < NEAR and not holds_home(place)
        for package in _candidates(title, place, near):
            marked = bool(origins(package))
            found = found or marked
            if near or marked:
                yield package

    trusted = [*ros_folders(), *more]
    for place in trusted:
        for package in _direct(title, place):
            found = found or package.is_dir()
            yield package
    if not found:  # the search below may take a second
        for place in trusted:
            yield from _below(title, place)


def _candidates(title: str, place: Path, near: bool) -> list[Path]:
    """Folders of a title that may be a package: a place, those in it, and where it is near renamed ones in it."""
    candidates = dict.fromkeys(_direct(title, place))
    folders = [place]
    if near:
        folders += _subfolders(place)
    for folder in folders:
        if _name(folder) == title:
            candidates[folder] = None
    return list(candidates)


def origins(folder: Path) -> list[Path]:
    """Folders of the marker files of a package, with symbolic links resolved; empty without a package."""
    return [(folder / mark).resolve().parent for mark in MARKS if is_file(folder / mark)]


def holds_home(folder: Path) -> bool:
    """Whether a folder is the home folder of the user or above it."""
    return Path(os.path.expanduser("~")).is_relative_to(folder) or folder == Path(folder.anchor)


def ros_folders() -> list[Path]:
    """Folders of ROS packages, which the user trusts."""
    ros = os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep)
    prefixes = os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
    shares = [Path(entry) / "share" for entry in prefixes if entry]
    return [*(Path(entry) for entry in ros if entry), *shares]


def is_file(path: Path) -> bool:
    """Return whether a file exists; False for names that are too long or not accessible."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def _direct(title: str, place: Path) -> tuple[Path, ...]:
    """Folders of that name: the place itself, and one in it."""
    if place.name == title:
        return (place, place / title)
    return (place / title,)


def _below(title: str, place: Path) -> Iterator[Path]:
    """Yield the packages of that name on the levels below a place."""
    level = [place]
    count = 0
    for _ in range(DEPTH):
        deeper = []
        for folder in level:
            for child in _subfolders(folder):
                count += 1
                if count > MOST_FOLDERS:
                    return
                deeper.append(child)
                if title in (child.name, _name(child)) and origins(child):
                    yield child
        level = deeper


def _subfolders(folder: Path) -> list[Path]:
    """Folders in a folder, sorted, without hidden ones and without symbolic links to folders, which may be cyclic."""
    try:
        with os.scandir(folder) as entries:
            names = []
            for entry in entries:
                if not entry.name.startswith(".") and entry.is_dir(follow_symlinks=False):
                    names.append(entry.name)
    except OSError:
        return []
    return [folder / name for name in sorted(names)[:MOST_CHILDREN]]


def _name(folder: Path) -> str | None:
    """Name of a package in its ``package.xml``; None without such a file."""
    mark = folder / MARKS[0]
    if not is_file(mark):
        return None
    try:
        with mark.open(encoding="utf-8", errors="replace") as stream:
            text = stream.read(100_000)
    except OSError:
        return None
    match = re.search(r"<name>\s*([^<]*?)\s*</name>", text)
    if match is None:
        return None
    return match[1]
