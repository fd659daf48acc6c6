"""Several arms as one group: limbs of one robot, or several robots in one world."""

import os
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from maniport.arms.arm import Arm
from maniport.arms.arm_group import ArmGroup, placing_options
from maniport.arms.chain import LEFT, RIGHT, as_pose, check_names, pose
from maniport.arms.human import PERSONS
from maniport.arms.loaders import Robot, load_arm, robot_limbs
from maniport.arms.loaders.limbs import one_side
from maniport.arms.restriction import check_lock, standing
from maniport.errors import InvalidInputError, UnknownNameError, argument, spoken, typed, unknown_name
from maniport.util.validation import MAX_POSITION, Array, as_finite, as_numbers


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
        Names of the joints that move, of all arms, as of the whole group: with the name of an arm as a prefix, such as
        ``left_``, where several robots have joints of the same names. The others are locked as by `maniport.load_arm`.
    lock : mapping of str to float, optional
        Positions of locked joints [rad] or [m], by such names.
    mesh_folders
        As for `maniport.load_arm`.

    Examples
    --------
    >>> arms = load_arms("panda", bases=[(0, 0.3, 0), (0, -0.3, 0)])
    >>> arms.dof, arms.forward(arms.sample(4)).shape
    (14, (4, 2, 4, 4))
    """
    single = isinstance(robot, (str, os.PathLike))
    one_robot = single and bases is None
    counted = ("bases", bases) if single else ("robot", robot)
    count = len(_several(*(("frames", frames or (LEFT, RIGHT)) if one_robot else counted)))
    robots: Any = [robot] * count if single else robot
    for name in robots:
        if isinstance(name, str) and name in PERSONS:
            raise InvalidInputError(f"robot: {name!r} is a person; load_arms loads robots")
    names = (LEFT, RIGHT) if count == 2 else tuple(f"arm{i + 1}" for i in range(count))
    end_frames = [None] * count if frames is None else _several("frames", frames, count)
    places = [np.eye(4)] * count if bases is None else _several("bases", bases, count)
    places = [_base(place, name) for place, name in zip(places, names, strict=True)]
    if one_robot and None in end_frames:
        end_frames = _ends(robots[0], end_frames)
    arms = [
        load_arm(name, end_frame, mesh_folders=mesh_folders) for name, end_frame in zip(robots, end_frames, strict=True)
    ]
    if not one_robot:
        arms = [Arm(standing(arm.chain, place)) for arm, place in zip(arms, places, strict=True)]
    group = ArmGroup(*arms, names=names)
    wanted, held = None if joints is None else check_names(joints, "joints"), check_lock(lock, None)
    for name in (*(wanted or ()), *held):
        if name not in group.joint_names:
            raise unknown_name("joint", name, group.joint_names, f"on the arms of {group.name!r}")
    for i, columns in enumerate(group.columns):
        own = {group.joint_names[column]: name for column, name in zip(columns, arms[i].joint_names, strict=True)}
        moving = None if wanted is None else [own[name] for name in wanted if name in own]
        if moving == []:
            listed = ", ".join(wanted or ())
            raise InvalidInputError(f"joints: none of {listed} moves the {names[i]} arm, which has {', '.join(own)}")
        arms[i] = arms[i].restricted(joints=moving, lock={own[name]: at for name, at in held.items() if name in own})
    return ArmGroup(*arms, names=names) if wanted or held else group


def _several(name: str, value: Any, count: int | None = None) -> list[Any]:
    """Require a sequence of values, one for each arm."""
    values = [] if isinstance(value, (str, os.PathLike, Mapping)) or not hasattr(value, "__len__") else list(value)
    if not values or len(values) != (count or len(values)):
        raise InvalidInputError(
            f"{spoken(name)} must be a sequence of {count or 'several'}, one for each arm; found {value!r}"
        )
    return values


def _ends(robot: Robot, end_frames: Sequence[str | None]) -> list[str | None]:
    """Return the end effectors of the left and right limb of a robot, where `end_frames` has None."""
    limbs = robot_limbs(robot)[0]
    longest = [limb for limb in limbs if len(limb.joints) == len(limbs[0].joints)]
    if len(longest) < 2:
        only = f"one longest limb, to {longest[0].frame!r}" if longest else "one arm"
        raise InvalidInputError(
            f"robot {os.fspath(robot)!r} must have two arms; found {only}: name both end effectors with "
            f"{argument('frames')}, or place two robots with {placing_options()}"
        )
    sides = (LEFT, RIGHT)[: len(end_frames)] if len(end_frames) <= 2 else ()
    try:
        return [
            end_frame or one_side(limbs, side, os.fspath(robot)).frame
            for end_frame, side in zip(end_frames, sides, strict=True)
        ]
    except (UnknownNameError, ValueError):
        ends = ", ".join(repr(limb.frame) for limb in longest)
        raise InvalidInputError(
            f"the robot {os.fspath(robot)!r} has limbs without left and right in their names: name both end "
            f"effectors with {argument('frames')}; they end at {ends}"
        ) from None


def _base(value: Any, side: str) -> Array:
    """Return the pose of a base in the world."""
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
