"""Paths of mesh files by their names in robot files, restricted to allowed folders.

Robot files are not trusted. Meshes must be in the folder of the file, its parent (``urdf/`` next to ``meshes/``), its
package, a named package near it, a package of ROS, or a folder that the user allows.
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


@dataclass(frozen=True)
class MeshPaths:
    """Allowed paths of the meshes of one robot."""

    path: Path  # the robot's file
    more: Sequence[Path] = ()  # folders that the user allows, also searched for packages
    read: dict[Path, Mesh] = field(default_factory=dict)  # cache

    def mesh(self, file: Path) -> Mesh:
        """Read a mesh file once."""
        if file not in self.read:
            self.read[file] = load_mesh(file)
        return self.read[file]

    def find(self, name: str) -> Path | None:
        """Return the file of a mesh name in a URDF; None if it is missing."""
        package = _package(name)
        if package is None:
            places: Sequence[Path] = [self._relative(name)]
        else:  # the folder of a package may have been renamed
            places = [place / package[1] for place in (*self._packages(package[0]), *self._own())]
        file = next((place for place in places if is_file(place)), None)
        if file is not None:
            self.require_allowed(file, name)
        return file

    def require_allowed(self, file: Path, name: str) -> None:
        """Raise `FileFormatError` for a file outside the allowed folders, with symbolic links resolved."""
        package, real = _package(name), file.resolve()
        named = () if package is None or package[0] in ("..", ".") else self._packages(package[0])
        folders = (*self._own(), *_ros_folders(), *self.more, *named)
        if not any(real.is_relative_to(place.resolve()) for folder in folders for place in (folder, *_origins(folder))):
            raise FileFormatError(
                f"{self.path}: names {name!r}, which lies outside its folder and its packages, at {str(real)!r}; if it "
                f"is to be read, allow it with mesh_folders=[{str(real.parent)!r}] (--mesh-folders)"
            )

    def rule(self, name: str) -> str:
        """Describe where `find` searches for a mesh."""
        package = _package(name)
        if package is None:
            return f"at {str(self._relative(name))!r}"
        return (
            f"for the package {package[0]!r} in {str(self.path.parent)!r} and every folder above, and in "
            "ROS_PACKAGE_PATH and AMENT_PREFIX_PATH"
        )

    def _relative(self, name: str) -> Path:
        return self.path.parent / (unquote(name[7:]) if name.startswith("file://") else name)

    def _packages(self, title: str) -> Iterator[Path]:
        """Folders of a package; more than three levels up they must be marked as packages."""
        for i, place in enumerate(self.path.parents):
            for package in (place, place / title) if place.name == title else (place / title,):
                if (i < 3 and not _holds_home(place)) or _origins(package):
                    yield package
        for place in (*_ros_folders(), *self.more):
            yield from (place, place / title) if place.name == title else (place / title,)

    def _own(self) -> Iterator[Path]:
        """Folder of the robot file, its parent and its package, also those of the target of a symbolic link."""
        for path in dict.fromkeys((self.path, self.path.resolve())):
            yield path.parent
            if not _holds_home(path.parent.parent):
                yield path.parent.parent
            yield from (place for place in path.parent.parents if _origins(place))


def is_file(path: Path) -> bool:
    """Return whether a file exists; False for names that are too long or not accessible."""
    try:
        return path.is_file()
    except OSError:
        return False


def _package(name: str) -> tuple[str, str] | None:
    """Package and path of a name such as ``package://robot/meshes/link.stl``; None for other names."""
    match = re.fullmatch(r"(?:package|model):/{2,}([^/]+)/+(.+)", name, re.DOTALL)
    return None if match is None else (match[1], match[2])


def _origins(folder: Path) -> list[Path]:
    """Folders of the marker files of a package, with symbolic links resolved; empty without a package."""
    marks = ("package.xml", "manifest.xml")
    return [(folder / mark).resolve().parent for mark in marks if is_file(folder / mark)]


def _holds_home(folder: Path) -> bool:
    """Whether a folder is the home folder of the user or above it."""
    return Path(os.path.expanduser("~")).is_relative_to(folder) or folder == Path(folder.anchor)


def _ros_folders() -> list[Path]:
    """Folders of ROS packages, which the user trusts."""
    folders = {key: os.environ.get(key, "").split(os.pathsep) for key in ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH")}
    ros, ament = ([Path(entry) for entry in entries if entry] for entries in folders.values())
    return [*ros, *(place / "share" for place in ament)]
