"""Robots by name from packages of robot files; these packages are not imported."""

import importlib
import importlib.util
import json
import os
import sys
from collections.abc import Mapping, Sequence
from contextlib import redirect_stderr
from dataclasses import dataclass, field
from io import StringIO
from pathlib import Path

from maniport.arms.chain import SIDES
from maniport.errors import MissingPackageError, UnknownNameError, unknown_name
from maniport.util.optional import xacrodoc

CATALOG = "robot_descriptions"
MOST_ROBOTS = 5  # similar names that the error of an unknown robot lists


@dataclass(frozen=True)
class Package:
    """A package of robots."""

    install: str  # command
    folder: str  # of its robots, below a Python module, or below the data folders of wheels, conda and ROS
    pattern: str  # of robot files below this folder
    arms: Sequence[str]  # names of arms
    pairs: Sequence[str] = ()  # names of robots with two arms
    files: Mapping[str, str] = field(
        default_factory=dict
    )  # stems of files whose name differs from that of the robot
    module: str | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all arms of the package."""
        names = list(self.arms)
        for robot in self.pairs:
            names += _sided(robot)
        return tuple(names)

    def installed(self) -> dict[str, Path]:
        """Return the installed files by robot name."""
        files: dict[str, Path] = {}
        for place in self._places():
            for path in sorted((place / self.folder).glob(self.pattern)):
                files.setdefault(path.parent.name if path.stem == "robot" else path.stem, path)
        named = {name: files[stem] for name, stem in self.files.items() if stem in files}
        return files | named

    def _places(self) -> list[Path]:
        """Folders that may contain the folder of the package."""
        if self.module is not None:
            spec = importlib.util.find_spec(self.module)
            if spec is None:
                return []
            return list(map(Path, spec.submodule_search_locations or ()))
        places = []
        for entry in sys.path:
            places.append(Path(entry) / "cmeel.prefix")
        places.append(Path(sys.prefix))
        for entry in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep):
            if entry:
                places.append(Path(entry))
        return places


def _sided(robot: str) -> tuple[str, ...]:
    """Names of the arms of a robot of two arms."""
    return tuple(f"{robot}_{side}_arm" for side in sorted(SIDES))


_TABLE = json.loads(
    (Path(__file__).parents[1] / "data" / "packages.json").read_text(encoding="utf-8")
)
PACKAGES = {name: Package(**entry) for name, entry in _TABLE.items()}
"""Packages by name, in order of priority; ``package/name`` selects one."""


@dataclass(frozen=True)
class RobotFile:
    """A robot file, its name in a package, the side of a selected arm, and whether the robot has two arms."""

    path: Path
    folders: tuple[Path, ...] = ()
    name: str = ""
    side: str | None = None
    pair: bool = False


def find_robot(name: str) -> RobotFile | None:
    """Return the file of a robot in an installed package; None for names of no package."""
    title, _, robot = name.rpartition("/")
    if robot.isidentifier() and robot.endswith("_description") and title in ("", CATALOG):
        installed = bool(
            importlib.util.find_spec(CATALOG) and importlib.util.find_spec(f"{CATALOG}.{robot}")
        )
        hidden = not installed and os.path.isdir(name)  # also a suffix of ROS packages
        if hidden:
            return None
        return _from_catalog(robot, installed)
    packages = PACKAGES
    if title:
        if title not in PACKAGES:
            return None
        packages = {title: PACKAGES[title]}
    for package in packages.values():
        files = package.installed()
        file = _file_of(robot, package, files)
        if file is not None:
            return file
        if title and files:
            names = {*package.names, *files}
            raise unknown_name("robot", robot, names, f"in the package {title}", MOST_ROBOTS)
    for key, package in packages.items():
        if title or robot in (*package.names, *package.pairs):  # perhaps its version is too old
            raise MissingPackageError(
                f"the robot {robot!r} comes with the package {key}, which is not installed: {package.install}"
            )
    return None


def _file_of(robot: str, package: Package, files: Mapping[str, Path]) -> RobotFile | None:
    """Return the file of a robot, or of the robot of an arm with a side, among those of a package."""
    for side in SIDES:
        if robot.endswith(f"_{side}_arm"):
            stem = robot.removesuffix(f"_{side}_arm")
            if stem in files and stem not in package.arms:
                return RobotFile(files[stem], name=robot, side=side)
            break
    if robot in files:
        return RobotFile(files[robot], name=robot, pair=robot in package.pairs)
    return None


def known_names() -> tuple[set[str], str]:
    """Return the names of all arms of packages, and how to install missing packages."""
    missing = [package.install for package in PACKAGES.values() if not package.installed()]
    how = ""
    if missing:
        how = f"; for some of the robots: {', '.join(missing)}"
    names = set[str]()
    for package in PACKAGES.values():
        names.update(package.names)
    return names, how


def arm_names(name: str) -> tuple[str, ...]:
    """Return the names of the two arms of a robot in a package; none for other robots."""
    robots = set()
    for package in PACKAGES.values():
        for robot in package.pairs:
            robots.add(robot)
    if name.rpartition("/")[2] in robots:
        return _sided(name)
    return ()


def _from_catalog(name: str, installed: bool) -> RobotFile:
    """Return a robot of robot_descriptions, downloaded on first use; xacro files are expanded with its arguments."""
    if importlib.util.find_spec(CATALOG) is None:
        raise MissingPackageError(
            f"robot {name!r}: names with '_description' need the package {CATALOG}: pip install {CATALOG}"
        )
    if not installed:
        catalog = importlib.import_module(f"{CATALOG}._descriptions")
        names = getattr(catalog, "DESCRIPTIONS", ())
        raise unknown_name("robot", name, names, f"in the package {CATALOG}", MOST_ROBOTS)
    try:
        module = importlib.import_module(f"{CATALOG}.{name}")
        file = getattr(module, "URDF_PATH", None) or getattr(module, "MJCF_PATH", None)
        if file is None and hasattr(module, "XACRO_PATH"):
            xacrodoc()
            with redirect_stderr(StringIO()):  # deprecation warnings of xacro
                file = str(importlib.import_module(f"{CATALOG}._xacro").get_urdf_path(module))
    except MissingPackageError:
        raise
    except Exception as error:  # noqa: BLE001 - downloads raise many types, and xacro files evaluate Python
        raise UnknownNameError(
            f"robot {name!r} could not be fetched by {CATALOG} (robot_descriptions pull {name} tries again): {error}"
        ) from None
    if file is None:
        raise UnknownNameError(
            f"robot {name!r} of {CATALOG} has neither a URDF nor a xacro file nor an MJCF"
        )
    folders = [
        getattr(module, "REPOSITORY_PATH", None),
        *getattr(module, "XACRO_PACKAGE_PATHS", {}).values(),
    ]
    return RobotFile(Path(file), tuple(Path(folder) for folder in folders if folder is not None))
