"""Groups of two arms: two limbs of one robot, or two robots in one world."""

import os
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from maniport.arms.arm import Arm
from maniport.arms.arm_group import ArmGroup
from maniport.arms.chain import LEFT, RIGHT, as_pose, check_names, pose
from maniport.arms.human import PERSONS
from maniport.arms.loaders import load_arm, robot_limbs
from maniport.arms.loaders.limbs import one_side
from maniport.arms.restriction import check_lock, standing
from maniport.arms.shared_joints import two_bases
from maniport.errors import InvalidInputError, UnknownNameError, argument, typed, unknown_name
from maniport.util.validation import MAX_POSITION, Array, as_finite, as_numbers

Robot = str | os.PathLike[str]
_ORDER = LEFT, RIGHT


def load_arms(
    robot: Robot | Sequence[Robot],
    frames: Sequence[str | None] | None = None,
    *,
    bases: Sequence[Any] | None = None,
    joints: Sequence[str] | None = None,
    lock: Mapping[str, float] | None = None,
    mesh_folders: Sequence[str | os.PathLike[str]] = (),
) -> ArmGroup:
    """Load two limbs of a robot, or two robots, as one group, left before right.

    Errors are those of `maniport.load_arm`, and `InvalidInputError` where there are no two arms.

    Parameters
    ----------
    robot : str or path, or two of them
        A robot with two arms, such as ``"talos"`` or ``"baxter"``, by name or from a file, see `maniport.load_arm`;
        joints of both chains, such as a torso's, are shared. Two names, or `bases`, mean two robots.
    frames : (str, str), optional
        Names of the end effectors, left and right; by default those of `maniport.load_arm`, and for one robot the ends
        of the limbs named left and right.
    bases : two of array_like, optional
        Bases of two robots in the world frame, in which all results are expressed: x, y, z [m] and optionally the yaw
        [rad], or a pose of shape (4, 4); x points forward, y to the left. By default both in the origin.
    joints : sequence of str, optional
        Names of the joints that move, of both arms; the others are locked as by `maniport.load_arm`.
    lock : mapping of str to float, optional
        Positions of locked joints [rad] or [m]. A name that both robots have locks both joints; the prefix ``left_``
        or ``right_`` selects one.
    mesh_folders
        As for `maniport.load_arm`.

    Returns
    -------
    ArmGroup

    Examples
    --------
    >>> arms = load_arms("panda", bases=[(0, 0.3, 0), (0, -0.3, 0)])
    >>> arms.dof, arms.forward(arms.sample(4)).shape
    (14, (4, 2, 4, 4))
    """
    robots, one = _robots(robot, bases)
    tips = (None, None) if frames is None else _two(frames, "frames", "names of the tips")
    places = None if one else _bases(bases)
    if one and None in tips:
        tips = _ends(robots[0], tips)
    arms = [load_arm(name, tip, mesh_folders=mesh_folders) for name, tip in zip(robots, tips, strict=True)]
    held = _joints_of_arms(arms, joints, lock, one)
    arms = [arm.restricted(joints=moving, lock=fixed) for arm, (moving, fixed) in zip(arms, held, strict=True)]
    if places is not None:
        arms = [Arm(standing(arm.chain, where)) for arm, where in zip(arms, places, strict=True)]
    return ArmGroup(*arms, names=_ORDER)


def _robots(robot: Any, bases: Any) -> tuple[tuple[Robot, Robot], bool]:
    """The left and the right robot, and whether both are the same robot."""
    alone = isinstance(robot, (str, os.PathLike))
    robots: Any = (robot, robot) if alone else _two(robot, "robot", "names or paths")
    for name in robots:
        if isinstance(name, str) and name in PERSONS:
            raise InvalidInputError(f"robot: {name!r} is a person; load_arms loads robots")
    return robots, alone and bases is None


def _two(value: Any, name: str, what: str) -> tuple[Any, Any]:
    """Require two values, left and right."""
    values = () if isinstance(value, (str, os.PathLike, Mapping)) or not hasattr(value, "__len__") else tuple(value)
    if len(values) != 2:
        raise InvalidInputError(f"{name} must be two, left and right: {what}; found {value!r}")
    return values[0], values[1]


def _ends(robot: Robot, tips: tuple[str | None, str | None]) -> tuple[str | None, str | None]:
    """End effectors of the left and right limb of a robot, where `tips` has None."""
    limbs = robot_limbs(robot)[0]
    longest = [limb for limb in limbs if len(limb.joints) == len(limbs[0].joints)]
    if len(longest) < 2:
        only = f"whose longest limb, to {longest[0].tip!r}, has no other like it" if longest else "which has one arm"
        raise InvalidInputError(
            f"the robot {os.fspath(robot)!r}, {only}, is no pair: name two tips with {argument('frames')}, or "
            f"place two robots with {two_bases()}"
        )
    try:
        left, right = (
            tip or one_side(limbs, side, os.fspath(robot)).tip for tip, side in zip(tips, _ORDER, strict=True)
        )
    except UnknownNameError:
        ends = ", ".join(repr(limb.tip) for limb in longest)
        raise InvalidInputError(
            f"the robot {os.fspath(robot)!r} has limbs that are not called left and right: name the tips with "
            f"{argument('frames')}; they end at {ends}"
        ) from None
    return left, right


def _bases(bases: Any) -> tuple[Array, Array]:
    """Poses of both bases in the world."""
    if bases is None:
        return np.eye(4), np.eye(4)
    left, right = _two(bases, "bases", "x, y, z [m] and optionally the yaw [rad], or a pose of shape (4, 4)")
    return _base(left, LEFT), _base(right, RIGHT)


def _base(value: Any, side: str) -> Array:
    name = f"--pose ({side})" if typed() else f"bases: {side}"
    array = as_finite(value, name)
    if array.shape == (4, 4):
        return as_pose(array, name)
    if array.shape not in ((3,), (4,)):
        raise InvalidInputError(
            f"{name} must be x, y, z [m] and optionally the yaw [rad], or a pose of shape (4, 4); found {array.shape}"
        )
    as_numbers(array[:3], name, 3, minimum=-MAX_POSITION, maximum=MAX_POSITION)
    x, y, z, yaw = (*array.tolist(), 0.0)[:4]
    return pose((x, y, z), (0.0, 0.0, yaw))


def _joints_of_arms(
    arms: Sequence[Arm], joints: Any, lock: Any, one: bool
) -> list[tuple[list[str] | None, dict[str, float]]]:
    """Moving joints and positions of locked joints of each arm."""
    wanted = None if joints is None else check_names(joints, "joints")
    held = check_lock(lock, None)
    titles = [  # names by which the joints of each arm may be selected
        {title: name for name in arm.joint_names for title in ((name,) if one else (name, f"{side}_{name}"))}
        for side, arm in zip(_ORDER, arms, strict=True)
    ]
    for name in (*(wanted or ()), *held):
        if name not in titles[0] | titles[1]:
            raise unknown_name("joint", name, titles[0] | titles[1], f"on the arms of {arms[0].name!r}")
    result = []
    for side, own in zip(_ORDER, titles, strict=True):
        fixed: dict[str, float] = {}
        for title in (title for title in own if title in held):
            if fixed.setdefault(own[title], held[title]) != held[title]:
                raise InvalidInputError(
                    f"lock: {own[title]!r} on the {side} is named twice, at {held[title]!r} and {fixed[own[title]]!r}"
                )
        if wanted is not None and own.keys().isdisjoint(wanted):
            raise InvalidInputError(
                f"joints: none of {', '.join(wanted)} moves the {side} arm, which has {', '.join(own)}"
            )
        moving = None if wanted is None else list(dict.fromkeys(own[name] for name in wanted if name in own))
        result.append((moving, fixed))
    return result
