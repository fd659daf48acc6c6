"""Arms by name and from files, by suffix; a new format is one file and one entry of `READERS`."""

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from math import inf
from pathlib import Path
from typing import Any

import numpy as np

from maniport.arms.arm import Arm
from maniport.arms.arm_group import ArmGroup, placing_options
from maniport.arms.chain import LEFT, RIGHT, Chain, as_pose, check_names, pose, read_embedded
from maniport.arms.human import PERSONS, human_arm
from maniport.arms.loaders.document import XACRO, parsed
from maniport.arms.loaders.limbs import Limb, one_side
from maniport.arms.loaders.mjcf import Mjcf
from maniport.arms.loaders.model import RobotXML, read_chain, read_limbs
from maniport.arms.loaders.packages import RobotFile, find_robot, known_names
from maniport.arms.loaders.urdf import Urdf
from maniport.arms.restriction import check_lock, restrict, standing
from maniport.errors import FileFormatError, InvalidInputError, UnknownNameError, argument, typed, unknown_name
from maniport.util.input_limits import ROBOT_BYTES, existing_file
from maniport.util.validation import MAX_POSITION, Array, as_finite, as_numbers

Robot = str | os.PathLike[str]
Reader = Callable[[Path, str | None, Sequence[str] | None], Chain]


def _source(path: Path) -> RobotXML:
    """Read a URDF or an MJCF, depending on the root element."""
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
"""Readers of robot files by suffix, called with the path and the frame and joints of `load_arm`.

A reader returns the chain to the frame, or to the default end effector of the joints; `load_arm` locks the other
joints. It raises `FileFormatError` for a faulty file."""

ROBOTS: dict[str, Callable[[], Chain]] = {"panda": lambda: read_embedded("panda")}
"""Robots of this package; human arms are in `maniport.arms.human.PERSONS`."""


def load_arm(
    name_or_path: Robot,
    frame: str | None = None,
    joints: Sequence[str] | None = None,
    mesh_folders: Sequence[Robot] = (),
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
        - ``"panda"``: Franka Emika Panda with its hand; the end effector ``panda_hand_tcp`` is between the fingers.
          With the frame ``panda_link8`` it ends at the flange, without the hand.
        - ``"myoarm"``, ``"rhuman"``: human arms, see `maniport.arms.myoarm` and `maniport.arms.rhuman`.
        - A path to a ``.urdf``, a ``.xacro`` (needs xacrodoc), or a ``.xml`` or ``.mjcf`` with an MJCF.
        - A robot of an installed package, such as ``"ur5"`` or ``"talos_right_arm"``: example-robot-data, airo-models
          or robosuite, in this order; ``"robosuite/ur5e"`` selects the package. An arm of a robot with two arms
          begins at the body that both have in common.
        - A name from an installed robot_descriptions, such as ``"ur5e_description"``, downloaded on first use.
    frame : str, optional
        Name of the end effector, a body (link) or a site. By default the end of the longest limb: the body that
        carries its gripper or hand, else the outermost body.
    joints : sequence of str, optional
        Names of the joints that move; by default all on the chain. The others are locked at zero, or at the limit
        nearest to zero.
    mesh_folders : sequence of str or path
        Folders with meshes in addition to the folder of the file, its parent, its package, packages near it and those
        of ROS (``ROS_PACKAGE_PATH``, ``AMENT_PREFIX_PATH``).
    base : str, optional
        Name of the frame on the chain in which the chain begins and all results are expressed.
    lock : mapping of str to float, optional
        Positions of locked joints [rad] or [m].
    side : {"right", "left"}, optional
        Arm of a person, the right one by default.
    height : float, optional
        Body height of a person [m], which scales the segments; see `maniport.arms.human`.

    Returns
    -------
    Arm
        Every coordinate is one angle or one displacement. Revolute joints without limits (or with limits beyond ten
        turns) get −π to π; joints that mimic others follow them; a floating base is fixed at zero.

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
    if not isinstance(name_or_path, (str, os.PathLike)):
        raise InvalidInputError(f"name_or_path must be a name or a path; found {type(name_or_path).__name__}")
    chain = read_arm(name_or_path, frame, joints, base, _as_folders(mesh_folders), side, height)
    chain = restrict(chain, frame, joints, base, lock)
    if name_or_path in ROBOTS and not chain.holds("panda_hand"):
        chain = replace(chain, others=None)  # the hand is not mounted where the chain ends before it
    for name, low, high in zip(chain.coordinates, chain.lower, chain.upper, strict=True):
        if not low > -inf or not high < inf:
            raise FileFormatError(
                f"{os.fspath(name_or_path)}: the prismatic joint {name!r} has no limits; add them to the file, or "
                f"exclude the joint with {argument('joints')} or {argument('lock')}"
            )
    return Arm(replace(chain, source=os.fspath(name_or_path)))


def read_arm(
    name_or_path: Robot,
    frame: str | None = None,
    joints: Sequence[str] | None = None,
    base: str | None = None,
    mesh_folders: tuple[Path, ...] = (),
    side: str | None = None,
    height: float | None = None,
) -> Chain:
    """Read the whole chain of an arm, before joints are locked or a base is chosen; see `load_arm`.

    It begins at the base that the name implies unless `base` is given.
    """
    if isinstance(name_or_path, str) and name_or_path in PERSONS:
        return human_arm(name_or_path, RIGHT if side is None else side, height).chain
    for name, value in (("side", side), ("height", height)):
        if value is not None:
            robot = repr(os.fspath(name_or_path))
            raise InvalidInputError(f"{argument(name)} is for persons ({', '.join(PERSONS)}); {robot} is a robot")
    if isinstance(name_or_path, str) and name_or_path in ROBOTS:
        return ROBOTS[name_or_path]()
    file, text = _robot_file(name_or_path), os.fspath(name_or_path)
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


def robot_limbs(name_or_path: Robot) -> tuple[list[Limb], Limb | None]:
    """Read the limbs of a robot, the longest first, and the limb that `load_arm` chooses by default."""
    if isinstance(name_or_path, str) and name_or_path in (*ROBOTS, *PERSONS):
        return [], None
    file = _robot_file(name_or_path)
    if READERS[file.path.suffix.lower()] is not _read_xml:
        return [], None
    limbs = read_limbs(_source(file.path))
    if file.side is not None:
        return limbs, one_side(limbs, file.side, os.fspath(name_or_path))
    alone = len([limb for limb in limbs if len(limb.joints) == len(limbs[0].joints)]) == 1
    return limbs, limbs[0] if alone and not file.pair else None


def _robot_file(name_or_path: Robot) -> RobotFile:
    """The file of a name or a path."""
    text = os.fspath(name_or_path)
    path = Path(text)
    is_name = isinstance(name_or_path, str) and not os.path.isfile(path)
    robot = find_robot(text) if is_name else None
    if robot is None and is_name and path.suffix.lower() not in READERS and path.name == text and not path.exists():
        names, how = known_names()
        where = f"(a file must end in {', '.join(READERS)}{how})"
        raise unknown_name("robot", text, {*ROBOTS, *PERSONS, *names}, where)
    robot = RobotFile(path) if robot is None else robot
    return replace(robot, path=existing_file(robot.path, READERS, ROBOT_BYTES))


def load_arms(
    robot: Robot | Sequence[Robot],
    frames: Sequence[str | None] | None = None,
    *,
    bases: Sequence[Any] | None = None,
    joints: Sequence[str] | None = None,
    lock: Mapping[str, float] | None = None,
    mesh_folders: Sequence[Robot] = (),
) -> ArmGroup:
    """Load limbs of one robot, or several robots in one world, as one group.

    Errors are those of `maniport.load_arm`, and `InvalidInputError` where numbers of arms differ. Two arms are named
    left and right, in this order, others ``arm1``, ``arm2``, ….

    Parameters
    ----------
    robot : str or path, or several of them
        A robot with several arms, such as ``"talos"`` or ``"baxter"``, by name or from a file, see
        `maniport.load_arm`; joints of several chains, such as a torso's, are shared. Several names, or `bases`, mean
        several robots.
    frames : sequence of str, optional
        Names of the end effectors; by default those of `maniport.load_arm`, and for one robot the ends of the limbs
        named left and right.
    bases : sequence of array_like, optional
        Bases of the robots in the world frame, in which all results are expressed: x, y, z [m] and optionally the yaw
        [rad], or a pose of shape (4, 4); x points forward, y to the left. By default all in the origin.
    joints : sequence of str, optional
        Names of the joints that move, of all arms; the others are locked as by `maniport.load_arm`.
    lock : mapping of str to float, optional
        Positions of locked joints [rad] or [m]. A name that several robots have locks all these joints; the name of an
        arm as a prefix, such as ``left_``, selects one.
    mesh_folders
        As for `maniport.load_arm`.

    Examples
    --------
    >>> arms = load_arms("panda", bases=[(0, 0.3, 0), (0, -0.3, 0)])
    >>> arms.dof, arms.forward(arms.sample(4)).shape
    (14, (4, 2, 4, 4))
    """
    single = isinstance(robot, (str, os.PathLike))
    one = single and bases is None
    counted = ("robot", robot) if not single else ("frames", frames or (LEFT, RIGHT)) if one else ("bases", bases)
    count = len(_several(*counted))
    robots: Any = [robot] * count if single else robot
    for name in robots:
        if isinstance(name, str) and name in PERSONS:
            raise InvalidInputError(f"robot: {name!r} is a person; load_arms loads robots")
    names = (LEFT, RIGHT) if count == 2 else tuple(f"arm{i + 1}" for i in range(count))
    tips = [None] * count if frames is None else _several("frames", frames, count)
    places = [np.eye(4)] * count if bases is None else _several("bases", bases, count)
    places = [_base(place, name) for place, name in zip(places, names, strict=True)]
    if one and None in tips:
        tips = _ends(robots[0], tips)
    arms = [load_arm(name, tip, mesh_folders=mesh_folders) for name, tip in zip(robots, tips, strict=True)]
    arms = _restricted(arms, names, joints, lock, one)
    if not one:
        arms = [Arm(standing(arm.chain, where)) for arm, where in zip(arms, places, strict=True)]
    return ArmGroup(*arms, names=names)


def _several(name: str, value: Any, count: int | None = None) -> list[Any]:
    """Require a sequence of values, one for each arm."""
    values = [] if isinstance(value, (str, os.PathLike, Mapping)) or not hasattr(value, "__len__") else list(value)
    if not values or len(values) != (count or len(values)):
        raise InvalidInputError(f"{name} must be a sequence of {count or 'several'}, one for each arm; found {value!r}")
    return values


def _ends(robot: Robot, tips: Sequence[str | None]) -> list[str | None]:
    """End effectors of the left and right limb of a robot, where `tips` has None."""
    limbs = robot_limbs(robot)[0]
    longest = [limb for limb in limbs if len(limb.joints) == len(limbs[0].joints)]
    if len(longest) < 2:
        only = f"whose longest limb, to {longest[0].tip!r}, has no other like it" if longest else "which has one arm"
        raise InvalidInputError(
            f"the robot {os.fspath(robot)!r}, {only}, is no pair: name the tips with {argument('frames')}, or "
            f"place two robots with {placing_options()}"
        )
    sides = (LEFT, RIGHT)[: len(tips)] if len(tips) <= 2 else ()
    try:
        return [tip or one_side(limbs, side, os.fspath(robot)).tip for tip, side in zip(tips, sides, strict=True)]
    except (UnknownNameError, ValueError):
        ends = ", ".join(repr(limb.tip) for limb in longest)
        raise InvalidInputError(
            f"the robot {os.fspath(robot)!r} has limbs that are not called left and right: name the tips with "
            f"{argument('frames')}; they end at {ends}"
        ) from None


def _base(value: Any, side: str) -> Array:
    """The pose of a base in the world."""
    name = f"--pose ({side})" if typed() else f"bases: {side}"
    array = as_finite(value, name)
    if array.shape == (4, 4):
        return as_pose(array, name)
    if array.shape not in ((3,), (4,)):
        raise InvalidInputError(
            f"{name} must be x, y, z [m] and optionally the yaw [rad], or a pose of shape (4, 4); found {array.shape}"
        )
    as_numbers(array[:3], name, 3, minimum=-MAX_POSITION, maximum=MAX_POSITION)
    return pose(array[:3].tolist(), (0.0, 0.0, float(sum(array[3:]))))


def _restricted(arms: Sequence[Arm], names: Sequence[str], joints: Any, lock: Any, one: bool) -> list[Arm]:
    """The arms with some joints only, or with locked joints; names of several robots may have those of their arms."""
    wanted, held = None if joints is None else check_names(joints, "joints"), check_lock(lock, None)
    titles = [
        {title: name for name in arm.joint_names for title in ((name,) if one else (name, f"{side}_{name}"))}
        for side, arm in zip(names, arms, strict=True)
    ]
    for name in (*(wanted or ()), *held):
        if not any(name in own for own in titles):
            raise unknown_name("joint", name, set[str]().union(*titles), f"on the arms of {arms[0].name!r}")
    results = []
    for arm, side, own in zip(arms, names, titles, strict=True):
        fixed: dict[str, float] = {}
        for title in own.keys() & held.keys():
            if fixed.setdefault(own[title], held[title]) != held[title]:
                raise InvalidInputError(
                    f"lock: {own[title]!r} of {side} is named twice, at {held[title]!r} and {fixed[own[title]]!r}"
                )
        moving = None if wanted is None else list(dict.fromkeys(own[name] for name in wanted if name in own))
        if moving == []:
            listed = ", ".join(wanted or ())
            raise InvalidInputError(f"joints: none of {listed} moves the {side} arm, which has {', '.join(own)}")
        results.append(arm.restricted(joints=moving, lock=fixed))
    return results


def _as_folders(value: Sequence[Robot]) -> tuple[Path, ...]:
    if isinstance(value, (str, os.PathLike)) or not isinstance(value, Iterable):
        raise InvalidInputError(f"mesh_folders must be a sequence of folders; found {value!r}")
    folders = tuple(Path(folder).absolute() for folder in value)
    for folder in folders:
        if not folder.is_dir():
            raise InvalidInputError(f"mesh_folders: no folder {str(folder)!r}")
    return folders
