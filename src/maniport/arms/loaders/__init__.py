"""Where arms come from: names, and files by their suffix; a further source is one file and one line of a table."""

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from math import inf
from pathlib import Path

from maniport.arms.arm import Arm
from maniport.arms.arm_group import ArmGroup
from maniport.arms.chain import RIGHT, Chain, read_embedded
from maniport.arms.human import PERSONS, human_arm
from maniport.arms.loaders.document import XACRO, parsed
from maniport.arms.loaders.limbs import Limb, one_side
from maniport.arms.loaders.mjcf import Mjcf
from maniport.arms.loaders.model import RobotXML, read_chain, read_limbs
from maniport.arms.loaders.packages import Named, find_named, known_names
from maniport.arms.loaders.urdf import Urdf
from maniport.arms.restriction import restrict
from maniport.errors import FileFormatError, InvalidInputError, argument, unknown_name
from maniport.util.input_limits import ROBOT_BYTES, existing_file

Reader = Callable[[Path, str | None, Sequence[str] | None], Chain]


def _source(path: Path) -> RobotXML:
    """Read a URDF or an MJCF, which the root tells apart."""
    text, root = parsed(path)
    for kind in (Urdf, Mjcf):
        if root.tag == kind.tag:
            return kind.checked(path, text, root)
    raise FileFormatError(
        f"{path}: neither a URDF (root <robot>) nor an MJCF (root <mujoco>); its root is <{root.tag}>"
    )


def _read_xml(path: Path, frame: str | None, joints: Sequence[str] | None) -> Chain:
    return read_chain(_source(path), frame, joints)


READERS: dict[str, Reader] = {".urdf": _read_xml, ".xml": _read_xml, ".mjcf": _read_xml, XACRO: _read_xml}
"""For each suffix what reads a robot's file: called with its path and `load_arm`'s frame and joints, it returns the
chain to that frame or, without one, to the tip that suits the joints; `load_arm` holds the others. It raises
`FileFormatError` where the file is at fault. What is added here, `load_arm` takes."""

ROBOTS: dict[str, Callable[[], Chain]] = {"panda": lambda: read_embedded("panda")}
"""Robots that come with this package; human arms are in `maniport.arms.human.PERSONS`."""


def load_arm(
    name_or_path: str | os.PathLike[str],
    frame: str | None = None,
    joints: Sequence[str] | None = None,
    mesh_folders: Sequence[str | os.PathLike[str]] = (),
    *,
    base: str | None = None,
    lock: Mapping[str, float] | None = None,
    side: str | None = None,
    height: float | None = None,
) -> Arm:
    """Load an arm by name or from a file.

    Parameters
    ----------
    name_or_path : str or path
        - ``"panda"``: Franka Emika Panda with its hand, tip between the fingers, ``panda_hand_tcp``. With the frame
          ``panda_link8`` it ends at the flange, without the hand.
        - ``"myoarm"``, ``"rhuman"``: human arms, see `maniport.arms.myoarm` and `maniport.arms.rhuman`.
        - A path to a ``.urdf``, a ``.xacro`` (needs xacrodoc), or a ``.xml`` or ``.mjcf`` with an MJCF.
        - A robot of an installed package, such as ``"ur5"`` or ``"talos_right_arm"``: example-robot-data, airo-models
          or robosuite, the first that has it; ``"robosuite/ur5e"`` names one. Where a robot has two arms, the name
          says which, and the arm begins at the body that both hang on.
        - A name from an installed robot_descriptions, such as ``"ur5e_description"``, downloaded on first use.
    frame : str, optional
        Name of the tip frame, a body (link) or a site. By default the end of the longest limb: the body that carries
        its gripper or hand, else the outermost body.
    joints : sequence of str, optional
        Names of the joints that move; by default all on the chain. The others are held at zero, or at the limit next to
        zero.
    mesh_folders : sequence of str or path
        Folders from which a file may take meshes besides its own folder, the one above that, its package, packages
        near it and those of ROS (``ROS_PACKAGE_PATH``, ``AMENT_PREFIX_PATH``).
    base : str, optional
        Name of the frame on the way to the tip with which the chain begins, and in which everything is expressed.
    lock : mapping of str to float, optional
        Joints that are held, and where [rad] or [m].
    side : {"right", "left"}, optional
        Which arm of a person, the right one by default.
    height : float, optional
        A person's body height [m], which the segments are fractions of; see `maniport.arms.human`.

    Returns
    -------
    Arm
        Every coordinate is one angle or one slide. A joint without limits (or with limits beyond ten turns) gets
        −π to π; joints that mimic others follow them; a floating base stands at its zero.

    Raises
    ------
    UnknownNameError, MissingPackageError
        When there is no robot, frame or joint of that name, or its package is not installed.
    FileFormatError
        When the file is missing, unreadable or inconsistent.
    InvalidInputError
        When an argument is wrong, the robot has no movable joint, or several frames could be the end effector.

    Examples
    --------
    >>> load_arm("panda", base="panda_link1", lock={"panda_joint3": 0.5}).joint_names
    ('panda_joint2', 'panda_joint4', 'panda_joint5', 'panda_joint6', 'panda_joint7')
    """
    if isinstance(name_or_path, ArmGroup):
        raise InvalidInputError("name_or_path must name one arm; found a group of arms")
    if not isinstance(name_or_path, (str, os.PathLike)):
        raise InvalidInputError(f"name_or_path must be a name or a path; found {type(name_or_path).__name__}")
    folders = _as_folders(mesh_folders)
    chain = _named(name_or_path, side, height)
    if chain is None:
        chain = _read(name_or_path, frame, joints, base, folders)
    chain = restrict(chain, frame, joints, base, lock)
    if name_or_path in ROBOTS and not chain.holds("panda_hand"):
        chain = replace(chain, others=None)  # the hand is not mounted where the chain ends before it
    for name, low, high in zip(chain.coordinates, chain.lower, chain.upper, strict=True):
        if not low > -inf or not high < inf:
            raise FileFormatError(
                f"{os.fspath(name_or_path)}: the slide {name!r} has no limits; write them into the file, or leave the "
                f"joint out with {argument('joints')} or {argument('lock')}"
            )
    return Arm(replace(chain, source=os.fspath(name_or_path)))


def _named(name_or_path: str | os.PathLike[str], side: str | None, height: float | None) -> Chain | None:
    """The chain of a person or of a robot that comes with this package; None where the name is not theirs."""
    if isinstance(name_or_path, str) and name_or_path in PERSONS:
        return human_arm(name_or_path, RIGHT if side is None else side, height).chain
    for name, value in (("side", side), ("height", height)):
        if value is not None:
            robot = repr(os.fspath(name_or_path))
            raise InvalidInputError(f"{argument(name)} is for persons ({', '.join(PERSONS)}); {robot} is a robot")
    return ROBOTS[name_or_path]() if isinstance(name_or_path, str) and name_or_path in ROBOTS else None


def read_arm(
    name_or_path: str | os.PathLike[str],
    frame: str | None = None,
    joints: Sequence[str] | None = None,
    base: str | None = None,
) -> Chain:
    """Read the whole chain to the tip of an arm, before joints are held or a base is taken; see `load_arm`."""
    chain = _named(name_or_path, None, None)
    return _read(name_or_path, frame, joints, base, ()) if chain is None else chain


def _read(
    name_or_path: str | os.PathLike[str],
    frame: str | None,
    joints: Sequence[str] | None,
    base: str | None,
    mesh_folders: tuple[Path, ...],
) -> Chain:
    """The chain of a file to the tip, from the base that its name implies if no other is given; see `load_arm`."""
    file, text = _find(name_or_path), os.fspath(name_or_path)
    folders = (*mesh_folders, *file.folders)
    limb = None
    if file.side is not None:
        limb = one_side(read_limbs(_source(file.path)), file.side, text)
        frame = limb.tip if frame is None else frame
    elif file.pair and frame is None and joints is None:
        raise InvalidInputError(
            f"the robot {text!r} has two arms: name '{text}_left_arm' or '{text}_right_arm', or the tip with "
            f"{argument('frame')}"
        )
    chain = READERS[file.path.suffix.lower()](file.path, frame, joints)
    chain = replace(chain, name=file.name or chain.name)
    if folders and chain.shapes is not None:
        chain = replace(chain, shapes=partial(chain.shapes, mesh_folders=folders))
    if limb is None:
        return chain
    if any(ours != theirs for ours, theirs in zip((joint.name for joint in chain.joints), limb.joints, strict=False)):
        raise InvalidInputError(f"the frame {frame!r} is not on {text!r}, whose tip is {limb.tip!r}")
    return chain if limb.fork is None or base is not None else restrict(chain, base=limb.fork)


def robot_limbs(name_or_path: str | os.PathLike[str]) -> tuple[list[Limb], Limb | None]:
    """What limbs a robot's file has, the longest first, and which one `load_arm` takes where nothing else is said."""
    if isinstance(name_or_path, str) and name_or_path in (*ROBOTS, *PERSONS):
        return [], None
    file = _find(name_or_path)
    if READERS[file.path.suffix.lower()] is not _read_xml:
        return [], None
    limbs = read_limbs(_source(file.path))
    if file.side is not None:
        return limbs, one_side(limbs, file.side, os.fspath(name_or_path))
    alone = len([limb for limb in limbs if len(limb.joints) == len(limbs[0].joints)]) == 1
    return limbs, limbs[0] if alone and not file.pair else None


def _find(name_or_path: str | os.PathLike[str]) -> Named:
    """The file that a name or a path stands for."""
    text = os.fspath(name_or_path)
    path = Path(text)
    named = find_named(text) if isinstance(name_or_path, str) and not os.path.isfile(path) else None
    if named is None and not _looks_like_path(name_or_path):
        names, how = known_names()
        where = f"(a file must end in {', '.join(READERS)}{how})"
        raise unknown_name("robot", text, {*ROBOTS, *PERSONS, *names}, where)
    named = Named(path) if named is None else named
    return replace(named, path=existing_file(named.path, READERS, ROBOT_BYTES))


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
    return not isinstance(value, str) or path.suffix.lower() in READERS or path.name != value or os.path.exists(path)
