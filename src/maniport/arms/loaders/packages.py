"""Robots by name, out of packages that hold their files; none of these packages is imported."""

import importlib
import importlib.util
import os
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import redirect_stderr
from dataclasses import dataclass, field
from functools import partial
from io import StringIO
from pathlib import Path
from types import ModuleType

from maniport.arms.chain import SIDES
from maniport.errors import FileFormatError, MissingPackageError, UnknownNameError, unknown_name
from maniport.util.optional import xacrodoc

CATALOG = "robot_descriptions"


@dataclass(frozen=True)
class Package:
    """A package of robots."""

    install: str  # what installs it
    folders: Callable[[], Iterator[Path]]  # gives the folders in which its robots may lie
    pattern: str  # of the robots' files, below one of these
    arms: tuple[str, ...]  # names of its arms
    pairs: tuple[str, ...] = ()  # names of its robots with two of them
    files: Mapping[str, str] = field(default_factory=dict)  # stems of files that are not called as the robot

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all arms that it is known to have."""
        return (*self.arms, *(f"{robot}_{side}_arm" for robot in self.pairs for side in sorted(SIDES)))

    def found(self) -> dict[str, Path]:
        """Files of the robots that are installed, by their names."""
        every: dict[str, Path] = {}
        for folder in self.folders():
            for path in sorted(folder.glob(self.pattern)):
                every.setdefault(path.parent.name if path.stem == "robot" else path.stem, path)
        return every | {name: every[stem] for name, stem in self.files.items() if stem in every}


def _of_module(name: str, below: str) -> Iterator[Path]:
    """Folders of a module that may be installed."""
    spec = importlib.util.find_spec(name)
    for place in (spec.submodule_search_locations or ()) if spec is not None else ():
        yield Path(place, below)


def _shared() -> Iterator[Path]:
    """Where wheels, conda and ROS put what is neither a module nor a program."""
    ros = [Path(entry) for entry in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if entry]
    for prefix in (*(Path(entry) / "cmeel.prefix" for entry in sys.path), Path(sys.prefix), *ros):
        yield prefix / "share" / "example-robot-data" / "robots"


PACKAGES = {
    "example-robot-data": Package(
        "pip install example-robot-data",
        _shared,
        "*/*/*.urdf",
        ("ur3", "ur5", "ur10", "xarm7", "kinova", "z1", "so100", "so101", "tiago", "tiago_no_hand"),
        (
            "talos", "g1", "g1_with_hands", "alex", "baxter", "human", "icub", "pr2", "romeo", "simple_humanoid",
            "tiago_dual", "tiago_pro",
        ),
        {
            "ur3": "ur3_robot", "ur5": "ur5_robot", "ur10": "ur10_robot", "talos": "talos_reduced",
            "g1": "g1_29dof_rev_1_0", "g1_with_hands": "g1_29dof_with_hand_rev_1_0", "alex": "alex_nub_hands",
        },
    ),
    "airo-models": Package(
        "pip install airo-models", partial(_of_module, "airo_models", "arms"), "*/*.urdf", ("ur3e", "ur5e")
    ),
    "robosuite": Package(
        "pip install --no-deps robosuite",
        partial(_of_module, "robosuite", "models/assets/robots"),
        "*/robot.xml",
        ("iiwa", "jaco", "kinova3", "panda", "sawyer", "spot_arm", "ur5e", "xarm7"),
        ("baxter", "gr1", "tiago"),
    ),
}  # fmt: skip
"""Packages by name. Where several have a robot of one name the first one gives it; ``package/name`` names any."""


@dataclass(frozen=True)
class RobotFile:
    """A robot's file, its name in a package, which of its arms is meant, if not all of it, and whether it has two."""

    path: Path
    folders: tuple[Path, ...] = ()
    name: str = ""
    side: str | None = None
    pair: bool = False


def find_robot(name: str) -> RobotFile | None:
    """The file of a robot in a package that is installed; None where no package is known to have one of that name."""
    title, _, robot = name.rpartition("/")
    if robot.isidentifier() and robot.endswith("_description") and title in ("", CATALOG):
        hidden = not _in_catalog(robot) and os.path.isdir(name)  # packages of ROS are called so, too
        return None if hidden else _from_catalog(robot)
    if title and title not in PACKAGES:
        return None
    packages = {title: PACKAGES[title]} if title else PACKAGES
    for package in packages.values():
        files = package.found()
        stem, side = _side(robot)
        if side is not None and stem in files and stem not in package.arms:
            return RobotFile(files[stem], name=robot, side=side)
        if robot in files:
            return RobotFile(files[robot], name=robot, pair=robot in package.pairs)
        if title and files:
            raise unknown_name("robot", robot, {*package.names, *files}, f"in the package {title}")
    missing = [one for one, package in packages.items() if title or robot in (*package.names, *package.pairs)]
    if missing:  # or installed without that robot, which an earlier version may be
        raise MissingPackageError(
            f"the robot {robot!r} comes with the package {missing[0]}, which is not installed: "
            f"{PACKAGES[missing[0]].install}"
        )
    return None


def known_names() -> tuple[set[str], str]:
    """Names of all arms that packages are known to have, and how to install those packages that are not there."""
    missing = [package.install for package in PACKAGES.values() if not package.found()]
    how = f"; for some of the robots: {', '.join(missing)}" if missing else ""
    return {name for package in PACKAGES.values() for name in package.names}, how


def packages_with(name: str) -> tuple[str, ...]:
    """All robots of one name that are installed, each with its package, the one that is taken first."""
    title, _, robot = name.rpartition("/")
    stem, side = _side(robot)
    found = {one: (package, package.found()) for one, package in PACKAGES.items()}
    places = [
        f"{one}/{robot}" for one, (package, files) in found.items()
        if robot in files or (side and stem in files and stem not in package.arms)
    ]  # fmt: skip
    return tuple(sorted(places, key=lambda place: place != f"{title}/{robot}"))


def arm_names(name: str) -> tuple[str, ...]:
    """Names of the two arms of a robot in a package; none for other robots."""
    robots = {robot for package in PACKAGES.values() for robot in package.pairs}
    return tuple(f"{name}_{side}_arm" for side in sorted(SIDES)) if name.rpartition("/")[2] in robots else ()


def _side(name: str) -> tuple[str, str | None]:
    """Take a name such as ``talos_left_arm`` apart."""
    for side in SIDES:
        if name.endswith(f"_{side}_arm"):
            return name.removesuffix(f"_{side}_arm"), side
    return name, None


def _in_catalog(name: str) -> bool:
    """Whether robot_descriptions is installed and has a robot of that name."""
    return bool(importlib.util.find_spec(CATALOG) and importlib.util.find_spec(f"{CATALOG}.{name}"))


def _from_catalog(name: str) -> RobotFile:
    """A robot of the package robot_descriptions, which fetches it on first use."""
    if importlib.util.find_spec(CATALOG) is None:
        raise MissingPackageError(
            f"robot {name!r}: names with '_description' need the package {CATALOG}: pip install {CATALOG}"
        )
    if not _in_catalog(name):
        catalogue = importlib.import_module(f"{CATALOG}._descriptions")
        raise unknown_name("robot", name, getattr(catalogue, "DESCRIPTIONS", ()), f"in the package {CATALOG}")
    try:
        module = importlib.import_module(f"{CATALOG}.{name}")
    except Exception as error:  # noqa: BLE001 - a download fails in many ways, all of them not ours
        raise UnknownNameError(
            f"robot {name!r} could not be fetched by {CATALOG} (robot_descriptions pull {name} tries again): {error}"
        ) from None
    file = getattr(module, "URDF_PATH", None) or getattr(module, "MJCF_PATH", None)
    if file is None and hasattr(module, "XACRO_PATH"):
        file = _expanded(name, module)
    if file is None:
        raise UnknownNameError(f"robot {name!r} of {CATALOG} has neither a URDF nor a xacro file nor an MJCF")
    folders = [getattr(module, "REPOSITORY_PATH", None), *getattr(module, "XACRO_PACKAGE_PATHS", {}).values()]
    return RobotFile(Path(file), tuple(Path(folder) for folder in folders if folder is not None))


def _expanded(name: str, module: ModuleType) -> str:
    """The URDF of a xacro file, which robot_descriptions expands with the arguments that it keeps for it."""
    xacrodoc()
    try:
        with redirect_stderr(StringIO()):  # where xacro says what it finds old-fashioned
            return str(importlib.import_module(f"{CATALOG}._xacro").get_urdf_path(module))
    except Exception as error:  # noqa: BLE001 - a file evaluates what it likes, which fails in many ways
        reason = " ".join(str(error).split())
        raise FileFormatError(f"robot {name!r}: {CATALOG} cannot expand its xacro file: {reason}") from None
