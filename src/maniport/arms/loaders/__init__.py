"""Arms and groups of arms by name and from files; a new format is one file and one entry of `READERS`."""

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from math import inf
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike

from maniport.arms.arm import Arm
from maniport.arms.arm_group import ArmGroup, placing_options
from maniport.arms.chain import LEFT, RIGHT, Chain, as_pose, check_names, pose, read_embedded
from maniport.arms.human import PERSONS, human_arm
from maniport.arms.loaders import mjcf, urdf
from maniport.arms.loaders.document import XACRO, parsed
from maniport.arms.loaders.model import Limb, Limbs, RobotModel, longest_limbs, one_side
from maniport.arms.loaders.packages import MOST_ROBOTS, RobotFile, find_robot, known_names
from maniport.arms.loaders.serial import chain_to
from maniport.arms.restriction import check_lock, restrict, standing
from maniport.errors import (
    FileFormatError,
    InvalidInputError,
    UnknownNameError,
    argument,
    spoken,
    typed,
    unknown_name,
)
from maniport.util.input_limits import ROBOT_BYTES, existing_file
from maniport.util.validation import Array, as_finite

Robot = str | os.PathLike[str]
Reader = Callable[[Path, str | None, Sequence[str] | None], Chain]


def read_model(
    path: Path, folders: Sequence[Path] = (), xacro_args: Mapping[str, str] | None = None
) -> RobotModel:
    """Read a URDF or an MJCF, depending on the root element."""
    root = parsed(path, folders, xacro_args)
    if root.tag == "robot":
        return urdf.read(path, root)
    if root.tag == "mujoco":
        return mjcf.read(path, root, folders)
    raise FileFormatError(
        f"{path}: neither a URDF (root <robot>) nor an MJCF (root <mujoco>); its root is <{root.tag}>"
    )


def _read_xml(path: Path, frame: str | None, joints: Sequence[str] | None) -> Chain:
    return chain_to(read_model(path), frame, joints)


READERS: dict[str, Reader] = {
    ".urdf": _read_xml,
    ".xml": _read_xml,
    ".mjcf": _read_xml,
    XACRO: _read_xml,
}
"""Readers of robot files by suffix, called with the path and the frame and joints of `load_arm`.

A reader returns the chain to the frame, or to the default end effector of the joints; `load_arm` locks the other
joints. It raises `FileFormatError` for a faulty file."""


def _panda(frame: str | None) -> Chain:
    """Read the Panda, without its hand where the chain ends before it."""
    chain = read_embedded("panda")
    bare = frame in chain.frames and "panda_hand" not in chain.ancestors(str(frame))
    if bare:
        return read_embedded("panda", without=("panda_hand",))
    return chain


ROBOTS: dict[str, Callable[[str | None], Chain]] = {"panda": _panda}
"""Robots of this package, called with the frame of `load_arm`; human arms are in `maniport.arms.human.PERSONS`."""


def load_arm(
    name_or_path: Robot,
    frame: str | None = None,
    joints: Sequence[str] | None = None,
    mesh_folders: Sequence[Robot] = (),
    *,
    base: str | None = None,
    lock: Mapping[str, float] | None = None,
    side: str | None = None,
    xacro_args: Mapping[str, str] | None = None,
) -> Arm:
    """Load an arm by name or from a file.

    Parameters
    ----------
    name_or_path : str or path
        A ``.urdf``, a ``.xacro`` (needs xacrodoc), or a ``.xml`` or ``.mjcf`` with an MJCF; ``"panda"``, with the hand
        unless it ends at ``panda_link8``; a person, ``"myoarm"`` or ``"rhuman"``; or a robot of an installed package,
        such as ``"ur5"``, ``"robosuite/ur5e"``, ``"talos_right_arm"`` (from the body that both arms have in common) or
        ``"ur5e_description"``.
    frame : str, optional
        Name of the end effector, a body (link) or a site. By default the end of the longest limb that is no leg: a
        fixed tool frame such as ``hand_tcp``, else the body that carries its gripper or hand, else the outermost body.
    joints : sequence of str, optional
        Names of the joints that move; by default all on the chain. The others are locked at zero, or at the limit
        nearest to zero.
    mesh_folders : sequence of str or path
        Folders with meshes, or with packages that a xacro file includes, in addition to the folder of the file, its
        parent, its package, packages near it and those of ROS (``ROS_PACKAGE_PATH``, ``AMENT_PREFIX_PATH``).
    base : str, optional
        Name of the frame on the chain in which the chain begins and all results are expressed.
    lock : mapping of str to float, optional
        Positions of locked joints [rad] or [m].
    side : {"right", "left"}, optional
        Arm of a person, the right one by default.
    xacro_args : mapping of str to str, optional
        Values of the arguments of a xacro file, by name. Default: those of the file.

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
    chain = read_arm(name_or_path, frame, joints, base, mesh_folders, side, xacro_args)
    chain = restrict(chain, frame, joints, base, lock)
    source = os.fspath(name_or_path)
    _require_limits(chain, source)
    return Arm(replace(chain, source=source))


def _require_limits(chain: Chain, source: str) -> None:
    """Require finite limits of all coordinates."""
    for name, low, high in zip(chain.coordinates, chain.lower, chain.upper, strict=True):
        if not low > -inf or not high < inf:
            raise FileFormatError(
                f"{source}: the prismatic joint {name!r} has no limits; add them to the file, or "
                f"exclude the joint with {_exclusion(chain, name)}"
            )


def _exclusion(chain: Chain, name: str) -> str:
    """List the arguments that exclude a coordinate; a base beyond it only where joints follow."""
    ways = f"{argument('joints')} or {argument('lock')}"
    columns = np.flatnonzero(chain.coupling[:, chain.coordinates.index(name)])
    last = int(columns[-1]) + 1  # number of joints to the last one that it moves
    beyond = [frame for frame, place in chain.frames.items() if place.joint == last]
    if not beyond or not np.any(chain.coupling[last:]):
        return ways
    return f"{argument('base', beyond[0])}, {ways}"


def read_arm(
    name_or_path: Robot,
    frame: str | None = None,
    joints: Sequence[str] | None = None,
    base: str | None = None,
    mesh_folders: Sequence[Robot] = (),
    side: str | None = None,
    xacro_args: Mapping[str, str] | None = None,
) -> Chain:
    """Read the whole chain of an arm, before joints are locked or a base is chosen; see `load_arm`.

    It begins at the base that the name implies unless `base` is given.
    """
    if not isinstance(name_or_path, (str, os.PathLike)):
        raise InvalidInputError(
            f"name_or_path must be a name or a path; found {type(name_or_path).__name__}"
        )
    name = os.fspath(name_or_path)
    folders = _as_folders(mesh_folders)
    arguments = _as_xacro_args(xacro_args)
    if arguments and Path(name).suffix.lower() != XACRO:
        raise InvalidInputError(f"{argument('xacro_args')} is for {XACRO} files; found {name!r}")
    if name_or_path in PERSONS:
        return human_arm(name, RIGHT if side is None else side).chain
    if side is not None:
        raise InvalidInputError(
            f"{argument('side')} is for persons ({', '.join(PERSONS)}); {name!r} is a robot"
        )
    if name_or_path in ROBOTS:
        return ROBOTS[name](frame)

    file = _robot_file(name_or_path)
    file = replace(file, folders=(*folders, *file.folders))
    if file.side is not None:
        return _read_side(name, file, frame, joints, base)
    if file.pair and frame is None and joints is None:
        raise InvalidInputError(
            f"the robot {name!r} has two arms: name '{name}_left_arm' or '{name}_right_arm', or the end effector with "
            f"{argument('frame')}"
        )
    return _read_file(file, frame, joints, arguments)


def _read_file(
    file: RobotFile,
    frame: str | None,
    joints: Sequence[str] | None,
    arguments: Mapping[str, str],
) -> Chain:
    """Read the chain of a robot file; its shapes are read with the same folders and arguments."""
    reader = READERS[file.path.suffix.lower()]
    if reader is _read_xml:
        chain = chain_to(read_model(file.path, file.folders, arguments), frame, joints)
    else:
        chain = reader(file.path, frame, joints)
    chain = replace(chain, name=file.name or chain.name, xacro_args=arguments)

    options: dict[str, object] = {}
    if file.folders:
        options["mesh_folders"] = file.folders
    if arguments:
        options["xacro_args"] = arguments
    if options and chain.shapes is not None:
        chain = replace(chain, shapes=partial(chain.shapes, **options))
    if options and chain.collision_shapes is not None:
        readers = partial(chain.collision_shapes, **options)
        chain = replace(chain, collision_shapes=readers)
    return chain


def _read_side(
    name: str,
    file: RobotFile,
    frame: str | None,
    joints: Sequence[str] | None,
    base: str | None,
) -> Chain:
    """Read one arm of a robot with two, from the body that both have in common unless `base` is given."""
    limbs = Limbs(read_model(file.path, file.folders)).all()
    limb = one_side(limbs, str(file.side), name)
    if frame is None:
        frame = limb.frame
    chain = _read_file(file, frame, joints, {})
    for joint, name_on_limb in zip(chain.joints, limb.joints, strict=False):
        if joint.name != name_on_limb:
            raise InvalidInputError(
                f"the frame {frame!r} is not on {name!r}; its end effector is {limb.frame!r}"
            )
    if limb.fork is None or base is not None:
        return chain
    return restrict(chain, base=limb.fork)


def _as_folders(folders: Sequence[Robot]) -> tuple[Path, ...]:
    """Require a sequence of folders that exist."""
    if isinstance(folders, (str, os.PathLike)) or not isinstance(folders, Iterable):
        raise InvalidInputError(f"mesh_folders must be a sequence of folders; found {folders!r}")
    paths = tuple(Path(folder).absolute() for folder in folders)
    for path in paths:
        if not path.is_dir():
            raise InvalidInputError(f"mesh_folders: no folder {str(path)!r}")
    return paths


def _as_xacro_args(arguments: Mapping[str, str] | None) -> dict[str, str]:
    """Require a mapping of names to texts, numbers or flags, and return the texts that xacro reads."""
    if arguments is None:
        return {}
    where = spoken("xacro_args")
    if not isinstance(arguments, Mapping):
        raise InvalidInputError(
            f"{where} must map names of arguments to values, such as {{'arm_name': 'left'}}; "
            f"found {arguments!r}"
        )
    texts = {}
    for name, value in arguments.items():
        if not isinstance(name, str) or not isinstance(value, (str, bool, int, float)):
            raise InvalidInputError(
                f"{where}: the value of {name!r} must be text, a number or a flag; found {value!r}"
            )
        if isinstance(value, bool):
            texts[name] = str(value).lower()
        else:
            texts[name] = str(value)
    return texts


def robot_limbs(
    name_or_path: Robot,
    mesh_folders: Sequence[Robot] = (),
    xacro_args: Mapping[str, str] | None = None,
) -> tuple[list[Limb], Limb | None]:
    """Read the limbs of a robot, the longest first, and the limb that `load_arm` chooses by default."""
    if name_or_path in (*ROBOTS, *PERSONS):
        file = None
    else:
        file = _robot_file(name_or_path)
    if file is None or READERS[file.path.suffix.lower()] is not _read_xml:
        return [], None
    folders = (*_as_folders(mesh_folders), *file.folders)
    limbs = Limbs(read_model(file.path, folders, _as_xacro_args(xacro_args))).all()
    if not limbs:
        raise InvalidInputError(f"{file.path}: has no movable joint")
    if file.side is not None:
        return limbs, one_side(limbs, file.side, os.fspath(name_or_path))
    if file.pair or len(longest_limbs(limbs)) > 1:
        return limbs, None
    return limbs, limbs[0]


def _robot_file(name_or_path: Robot) -> RobotFile:
    """Return the file of a name or path."""
    name = os.fspath(name_or_path)
    path = Path(name_or_path)
    is_name = isinstance(name_or_path, str) and not os.path.isfile(path)
    if is_name:
        robot = find_robot(name)
    else:
        robot = None
    if robot is None:
        if is_name:
            _require_path(name)
        robot = RobotFile(path)
    return replace(robot, path=existing_file(robot.path, READERS, ROBOT_BYTES))


def _require_path(name: str) -> None:
    """Raise `UnknownNameError` for a name that is none of a file, with similar names of robots."""
    path = Path(name)
    if path.suffix.lower() in READERS or path.name != name or path.exists():
        return
    names, how = known_names()
    where = f"(a file must end in {', '.join(READERS)}{how})"
    raise unknown_name("robot", name, {*ROBOTS, *PERSONS, *names}, where, MOST_ROBOTS)


def load_arms(
    robot: Robot | Sequence[Robot],
    frames: Sequence[str | None] | None = None,
    *,
    bases: Sequence[ArrayLike] | None = None,
    joints: Sequence[str] | None = None,
    lock: Mapping[str, float] | None = None,
    mesh_folders: Sequence[Robot] = (),
    xacro_args: Mapping[str, str] | None = None,
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
        Names of the joints that move, of all arms, as of the whole group: with the name of an arm as a prefix, such as
        ``left_``, where several robots have joints of the same names. The others are locked as by `maniport.load_arm`.
    lock : mapping of str to float, optional
        Positions of locked joints [rad] or [m], by such names.
    mesh_folders, xacro_args
        As for `maniport.load_arm`.

    Examples
    --------
    >>> arms = load_arms("panda", bases=[(0, 0.3, 0), (0, -0.3, 0)])
    >>> arms.dof, arms.forward(arms.sample(4)).shape
    (14, (4, 2, 4, 4))
    """
    one_robot = isinstance(robot, (str, os.PathLike)) and bases is None
    robots = _robots(robot, frames, bases)
    count = len(robots)
    for name in robots:
        if name in PERSONS:
            raise InvalidInputError(f"robot: {name!r} is a person; load_arms loads robots")
    if count == 2:
        names: tuple[str, ...] = (LEFT, RIGHT)
    else:
        names = tuple(f"arm{i + 1}" for i in range(count))
    end_frames = [None] * count if frames is None else _several("frames", frames, count)
    places = [np.eye(4)] * count if bases is None else _several("bases", bases, count)
    if one_robot and None in end_frames:
        limbs, _ = robot_limbs(robots[0], mesh_folders, xacro_args)
        end_frames = _ends(robots[0], limbs, end_frames)

    arms = []
    for name, end_frame, place, side in zip(robots, end_frames, places, names, strict=True):
        arm = load_arm(name, end_frame, mesh_folders=mesh_folders, xacro_args=xacro_args)
        if not one_robot:
            arm = Arm(standing(arm.chain, _base(place, side)))
        arms.append(arm)
    return _restricted_group(ArmGroup(*arms, names=names), joints, lock)


def _restricted_group(
    group: ArmGroup, joints: Sequence[str] | None, lock: Mapping[str, float] | None
) -> ArmGroup:
    """Return a group in which other joints are locked; names are those of the group."""
    wanted = None if joints is None else check_names(joints, "joints")
    positions = check_lock(lock, None)
    for name in (*(wanted or ()), *positions):
        if name not in group.joint_names:
            raise unknown_name("joint", name, group.joint_names, f"on the arms of {group.name!r}")
    if not wanted and not positions:
        return group

    arms = []
    for arm, title, columns in zip(group.arms, group.names, group.columns, strict=True):
        names = {}  # of joints of the arm, by those of the group
        for column, name in zip(columns, arm.joint_names, strict=True):
            names[group.joint_names[column]] = name
        moving = None
        if wanted is not None:
            moving = [names[name] for name in wanted if name in names]
        if moving == []:
            raise InvalidInputError(
                f"joints: none of {', '.join(wanted or ())} moves the {title} arm, which has {', '.join(names)}"
            )
        locked = {}
        for name, position in positions.items():
            if name in names:
                locked[names[name]] = position
        arms.append(arm.restricted(joints=moving, lock=locked))
    return ArmGroup(*arms, names=group.names)


def _robots(
    robot: Robot | Sequence[Robot],
    frames: Sequence[str | None] | None,
    bases: Sequence[ArrayLike] | None,
) -> list[Robot]:
    """List the robot of each arm: one robot has as many as frames, or bases."""
    if not isinstance(robot, (str, os.PathLike)):
        return _several("robot", robot)
    if bases is not None:
        return [robot] * len(_several("bases", bases))
    return [robot] * len(_several("frames", frames or (LEFT, RIGHT)))


T = TypeVar("T")


def _several(name: str, value: Sequence[T], count: int | None = None) -> list[T]:
    """Require a sequence of values, one for each arm."""
    is_sequence = hasattr(value, "__len__") and not isinstance(value, (str, os.PathLike, Mapping))
    if is_sequence:
        values = list(value)
    else:
        values = []
    if not values or len(values) != (count or len(values)):
        raise InvalidInputError(
            f"{spoken(name)} must be a sequence of {count or 'several'}, one for each arm; found {value!r}"
        )
    return values


def _ends(
    robot: Robot, limbs: Sequence[Limb], end_frames: Sequence[str | None]
) -> list[str | None]:
    """Return the end effectors of the left and right limb of a robot, where `end_frames` has None."""
    name = os.fspath(robot)
    longest = longest_limbs(limbs) if limbs else []
    if len(longest) < 2:
        only = "one arm"
        if longest:
            only = f"one longest limb, to {longest[0].frame!r}"
        raise InvalidInputError(
            f"robot {name!r} must have two arms; found {only}: name both end effectors with "
            f"{argument('frames')}, or place two robots with {placing_options()}"
        )
    sided = _sided_ends(limbs, name)
    if len(sided) != len(end_frames):  # no sides, or more than two arms
        ends = ", ".join(repr(limb.frame) for limb in longest)
        raise InvalidInputError(
            f"the robot {name!r} has limbs without left and right in their names: name both end "
            f"effectors with {argument('frames')}; they end at {ends}"
        )
    frames = list[str | None]()
    for chosen, default in zip(end_frames, sided, strict=True):
        frames.append(chosen or default)
    return frames


def _sided_ends(limbs: Sequence[Limb], robot: str) -> list[str]:
    """Return the end effectors of the limbs named left and right; empty where names have no sides."""
    try:
        return [one_side(limbs, side, robot).frame for side in (LEFT, RIGHT)]
    except UnknownNameError:
        return []


def _base(value: ArrayLike, side: str) -> Array:
    """Return the pose of a base in the world."""
    if typed():
        name = f"--pose ({side})"
    else:
        name = f"bases: {side}"
    array = as_finite(value, name)
    if array.shape in ((3,), (4,)):
        array = pose(array[:3].tolist(), (0.0, 0.0, float(sum(array[3:]))))
    if array.shape != (4, 4):
        raise InvalidInputError(
            f"{name} must be x, y, z [m] and optionally the yaw [rad], or a pose of shape (4, 4); found {array.shape}"
        )
    return as_pose(array, name)
