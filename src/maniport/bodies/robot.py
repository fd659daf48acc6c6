"""Arms by name or from a file."""

import importlib
import importlib.util
import os
from collections.abc import Callable, Sequence
from pathlib import Path

from maniport.bodies.arm import Arm
from maniport.bodies.chain import read_embedded
from maniport.bodies.human import myoarm, rhuman
from maniport.bodies.robot_file import read_chain
from maniport.bodies.robot_xml import SUFFIXES
from maniport.errors import InvalidInputError, UnknownNameError, unknown_name


def _panda() -> Arm:
    """The Franka Emika Panda to its flange."""
    return Arm(read_embedded("panda"))


_EMBEDDED: dict[str, Callable[[], Arm]] = {"panda": _panda, "myoarm": myoarm, "rhuman": rhuman}
_CATALOGUE = "robot_descriptions"


def load_arm(
    name_or_path: str | os.PathLike[str], frame: str | None = None, joints: Sequence[str] | None = None
) -> Arm:
    """Load an arm by name or from a file.

    Parameters
    ----------
    name_or_path : str or path
        - ``"panda"``: Franka Emika Panda, tip at the flange ``panda_link8`` (without the hand; ``panda_hand`` and
          ``panda_hand_tcp`` are there too). Joint limits [rad]: lower −2.8973 −1.7628 −2.8973 −3.0718 −2.8973 −0.0175
          −2.8973, upper 2.8973 1.7628 2.8973 −0.0698 2.8973 3.7525 2.8973; other sources carry others.
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
    if text in _EMBEDDED and isinstance(name_or_path, str):
        arm = _EMBEDDED[text]()
        return arm if frame is None and joints is None else arm.restricted(frame, joints)
    if isinstance(name_or_path, str) and text.endswith("_description"):
        return Arm(read_chain(_catalogue_file(text), frame, joints))
    if _looks_like_path(name_or_path):
        return Arm(read_chain(Path(text), frame, joints))
    raise unknown_name("robot", text, _EMBEDDED, f"(a file must end in {', '.join(SUFFIXES)})")


def _looks_like_path(value: str | os.PathLike[str]) -> bool:
    text = os.fspath(value)
    separators = [os.sep] + ([os.altsep] if os.altsep else [])
    return (
        not isinstance(value, str)
        or Path(text).suffix.lower() in SUFFIXES
        or any(separator in text for separator in separators)
        or Path(text).exists()
    )


def _catalogue_file(name: str) -> Path:
    """File of a robot in the package robot_descriptions, which fetches it on first use."""
    if importlib.util.find_spec(_CATALOGUE) is None:
        raise unknown_name("robot", name, _EMBEDDED, f"(names with '_description' need the package {_CATALOGUE})")
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
    return Path(file)
