"""Where arms come from: names, and files by their suffix; a further source is one file and one line of a table."""

import importlib
import importlib.util
import os
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

from maniport.bodies.arm import Arm
from maniport.bodies.chain import Chain
from maniport.bodies.embedded import read_embedded
from maniport.bodies.human import PERSONS
from maniport.bodies.readers.document import parsed
from maniport.bodies.readers.mjcf import Mjcf
from maniport.bodies.readers.model import read_chain
from maniport.bodies.readers.urdf import Urdf
from maniport.bounds import ROBOT_BYTES, existing_file
from maniport.errors import FileFormatError, InvalidInputError, UnknownNameError, unknown_name

Reader = Callable[[Path, str | None, Sequence[str] | None], Chain]


def _read_xml(path: Path, frame: str | None, joints: Sequence[str] | None) -> Chain:
    """Read a URDF or MJCF, which the root tells apart; see `load_arm`."""
    root = parsed(path)[1].tag
    for kind in (Urdf, Mjcf):
        if root == kind.tag:
            return read_chain(kind, path, frame, joints)
    raise FileFormatError(f"{path}: neither a URDF (root <robot>) nor an MJCF (root <mujoco>); its root is <{root}>")


READERS: dict[str, Reader] = {".urdf": _read_xml, ".xml": _read_xml, ".mjcf": _read_xml}
"""For each suffix what reads a robot's file: called with its path and `load_arm`'s frame and joints, it returns the
chain, raising `FileFormatError` where the file is at fault. What is added here, `load_arm` takes."""

ROBOTS: dict[str, Callable[[], Chain]] = {"panda": lambda: read_embedded("panda")}
"""Robots by name; human arms are in `maniport.bodies.human.PERSONS`."""

_CATALOGUE = "robot_descriptions"


def load_arm(
    name_or_path: str | os.PathLike[str],
    frame: str | None = None,
    joints: Sequence[str] | None = None,
    mesh_folders: Sequence[str | os.PathLike[str]] = (),
) -> Arm:
    """Load an arm by name or from a file.

    Parameters
    ----------
    name_or_path : str or path
        - ``"panda"``: Franka Emika Panda with its hand, tip between the fingers, ``panda_hand_tcp``. With the
          frame ``panda_link8`` it ends at the flange, without the hand. Joint limits [rad]: lower −2.8973 −1.7628
          −2.8973 −3.0718 −2.8973 −0.0175 −2.8973, upper 2.8973 1.7628 2.8973 −0.0698 2.8973 3.7525 2.8973; other
          sources carry others.
        - ``"myoarm"``, ``"rhuman"``: human arms, see `maniport.bodies.myoarm` and `maniport.bodies.rhuman`, which
          scale them to a person.
        - A path to a ``.urdf``, or to a ``.xml`` or ``.mjcf`` with an MJCF. Meshes are needed for
          `Arm.surfaces` only.
        - A name from the package robot_descriptions, such as ``"ur5_description"``, when that is installed; it
          downloads the robot on first use.
    frame : str, optional
        Name of the tip frame, a body (link) or a site. By default the end of the longest chain of movable joints;
        where that chain ends in the fingers of a gripper, the body that carries them.
    joints : sequence of str, optional
        Names of the joints that move; the others on the chain are locked at zero, or at the limit next to zero where
        their limits exclude zero. By default all joints on the chain move.
    mesh_folders : sequence of str or path
        Folders from which a file may take meshes besides its own folder, the one above that, its package, packages
        near it and those of ROS (``ROS_PACKAGE_PATH``, ``AMENT_PREFIX_PATH``).

    Returns
    -------
    Arm
        Every coordinate is one angle or one slide. A joint without limits (or with limits beyond ten turns) gets
        −π to π; joints that mimic others follow them; a floating base stands at its zero.

    Raises
    ------
    UnknownNameError
        When there is no robot, frame or joint of that name; the message lists those there are, nearest first.
    FileFormatError
        When the file is missing, unreadable or inconsistent.
    InvalidInputError
        When the robot has no movable joint, or several frames could be the tip; the message lists them.

    Examples
    --------
    >>> load_arm("panda", frame="panda_hand", joints=["panda_joint2", "panda_joint4"]).dof
    2
    """
    if not isinstance(name_or_path, (str, os.PathLike)):
        raise InvalidInputError(f"name_or_path must be a name or a path; found {type(name_or_path).__name__}")
    text = os.fspath(name_or_path)
    if isinstance(name_or_path, str) and text in (*ROBOTS, *PERSONS):
        arm = PERSONS[text]() if text in PERSONS else Arm(ROBOTS[text]())
        return arm if frame is None and joints is None else arm.restricted(frame, joints)
    if isinstance(name_or_path, str) and text.endswith("_description"):
        path, repository = _catalogue_file(text)
        mesh_folders = (*_as_folders(mesh_folders), *repository)
    elif _looks_like_path(name_or_path):
        path = Path(text)
    else:
        raise unknown_name("robot", text, (*ROBOTS, *PERSONS), f"(a file must end in {', '.join(READERS)})")
    hint = "; expand it with the xacro tool first" if path.suffix == ".xacro" else ""
    chain = READERS[existing_file(path, READERS, ROBOT_BYTES, hint).suffix.lower()](path, frame, joints)
    folders = _as_folders(mesh_folders)
    if folders and chain.shapes is not None:
        chain = replace(chain, shapes=partial(chain.shapes, mesh_folders=folders))
    return Arm(chain)


def _as_folders(value: Sequence[str | os.PathLike[str]]) -> tuple[Path, ...]:
    if isinstance(value, (str, os.PathLike)) or not isinstance(value, Iterable):
        raise InvalidInputError(f"mesh_folders must be a sequence of folders; found {value!r}")
    folders = tuple(Path(folder).absolute() for folder in value)
    for folder in folders:
        if not folder.is_dir():
            raise InvalidInputError(f"mesh_folders: there is no folder {str(folder)!r}")
    return folders


def _looks_like_path(value: str | os.PathLike[str]) -> bool:
    path = Path(value)
    return not isinstance(value, str) or path.suffix.lower() in READERS or path.name != value or path.exists()


def _catalogue_file(name: str) -> tuple[Path, tuple[Path, ...]]:
    """File of a robot in the package robot_descriptions, which fetches it on first use, and the folder it fetches."""
    if importlib.util.find_spec(_CATALOGUE) is None:
        raise unknown_name(
            "robot", name, (*ROBOTS, *PERSONS), f"(names with '_description' need the package {_CATALOGUE})"
        )
    if importlib.util.find_spec(f"{_CATALOGUE}.{name}") is None:
        catalogue = importlib.import_module(f"{_CATALOGUE}._descriptions")
        raise unknown_name("robot", name, getattr(catalogue, "DESCRIPTIONS", ()), f"in the package {_CATALOGUE}")
    try:
        module = importlib.import_module(f"{_CATALOGUE}.{name}")
    except Exception as error:  # noqa: BLE001 - a download fails in many ways, all of them not ours
        raise UnknownNameError(f"robot {name!r} could not be fetched by {_CATALOGUE}: {error}") from None
    file = getattr(module, "URDF_PATH", None) or getattr(module, "MJCF_PATH", None)
    if file is None:
        raise UnknownNameError(f"robot {name!r} of {_CATALOGUE} has neither a URDF nor an MJCF")
    folder = getattr(module, "REPOSITORY_PATH", None)
    return Path(file), () if folder is None else (Path(folder),)
