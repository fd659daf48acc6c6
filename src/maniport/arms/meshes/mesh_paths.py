"""Where mesh files are, by the names that robot files give them, and where a robot's file may send its reader.

A robot's file may have been written by anybody. What it names must lie in its own folder, in the one above it (where
``urdf/`` stands beside ``meshes/``), in its package, in a package that it names and that lies near it, or where ROS
keeps packages; whoever wants more names the folders.
"""

import os
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from urllib.parse import unquote

from maniport.arms.chain import Mesh
from maniport.arms.meshes.mesh_files import load_mesh
from maniport.errors import FileFormatError

_PACKAGE = re.compile(r"(?:package|model):/{2,}([^/]+)/+(.+)", re.DOTALL)


@dataclass(frozen=True)
class MeshPaths:
    """Where the meshes of one robot may be."""

    path: Path  # the robot's file
    more: Sequence[Path] = ()  # folders that are allowed besides; packages are looked for in them, too
    read: dict[Path, Mesh] = field(default_factory=dict)  # so that a mesh that is shown often is read once

    def mesh(self, file: Path) -> Mesh:
        """The content of a mesh file."""
        if file not in self.read:
            self.read[file] = load_mesh(file)
        return self.read[file]

    def find(self, name: str) -> Path | None:
        """The file that a URDF means by a mesh's name; None when it is not there."""
        file = next((place for place in self._candidates(name) if is_file(place)), None)
        if file is not None:
            self.require_allowed(file, name)
        return file

    def require_allowed(self, file: Path, name: str) -> None:
        """Raise `FileFormatError` unless a file that is named lies where it may, symbolic links followed."""
        package, real = _PACKAGE.fullmatch(name), file.resolve()
        named = () if package is None or package[1] in ("..", ".") else self._packages(package[1])
        folders = (*self._own(), *_ros_folders(), *self.more, *named)
        if not any(real.is_relative_to(place.resolve()) for folder in folders for place in (folder, *_origins(folder))):
            raise FileFormatError(
                f"{self.path}: names {name!r}, which lies outside its folder and its packages, at {str(real)!r}; if it "
                f"is to be read, allow it with mesh_folders=[{str(real.parent)!r}] (--mesh-folders)"
            )

    def rule(self, name: str) -> str:
        """Where `find` looks for a mesh, in words."""
        package = _PACKAGE.fullmatch(name)
        if package is None:
            return f"at {str(next(self._candidates(name)))!r}"
        return (
            f"for the package {package[1]!r} in {str(self.path.parent)!r} and every folder above, and in "
            "ROS_PACKAGE_PATH and AMENT_PREFIX_PATH"
        )

    def _candidates(self, name: str) -> Iterator[Path]:
        """Where a mesh may be, in the order of the search."""
        package = _PACKAGE.fullmatch(name)
        if package is None:
            yield self.path.parent / (unquote(name[7:]) if name.startswith("file://") else name)
        else:  # a package's folder may have been given another name
            yield from (place / package[2] for place in (*self._packages(package[1]), *self._own()))

    def _packages(self, title: str) -> Iterator[Path]:
        """Folders of a package that may be read; more than three folders up only what is marked as a package."""
        folder = self.path.parent
        for i, place in enumerate([folder, *folder.parents]):
            for package in (place, place / title) if place.name == title else (place / title,):
                if (i < 3 and not _holds_home(place)) or _origins(package):
                    yield package
        for place in (*_ros_folders(), *self.more):
            if place.name == title:
                yield place
            yield place / title

    def _own(self) -> Iterator[Path]:
        """The folder of the robot's file, the one above it, and its package, also where a link to the file leads."""
        for path in dict.fromkeys((self.path, self.path.resolve())):
            folder = path.parent
            yield folder
            if not _holds_home(folder.parent):
                yield folder.parent
            yield from (place for place in folder.parents if _origins(place))


def is_file(path: Path) -> bool:
    """Whether there is such a file; no file has a name that is too long or that may not be looked at."""
    try:
        return path.is_file()
    except OSError:
        return False


def _origins(folder: Path) -> list[Path]:
    """Where the marks of a package come from, symbolic links followed; nothing where a folder is no package."""
    marks = ("package.xml", "manifest.xml")
    return [(folder / mark).resolve().parent for mark in marks if is_file(folder / mark)]


def _holds_home(folder: Path) -> bool:
    """Whether a folder is the user's home or above it, and so holds much else."""
    return Path(os.path.expanduser("~")).is_relative_to(folder) or folder == Path(folder.anchor)


def _ros_folders() -> list[Path]:
    """Folders in which ROS keeps packages: whoever set them trusts them."""
    ros = [Path(entry) for entry in os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep) if entry]
    ament = [Path(entry) / "share" for entry in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if entry]
    return [*ros, *ament]
