"""Columns of datasets matched to the joints of a robot by their names."""

import re
from collections.abc import Sequence
from math import pi

import numpy as np

from maniport.arms import Arm, ArmGroup
from maniport.datasets.joint_motion import DEGREES, METERS, RADIANS, UNKNOWN, JointMotion
from maniport.errors import InvalidInputError, argument, some_of
from maniport.util.validation import Array

SKIPPED = "-"  # a column that is no joint of the robot, in the names that a caller gives
FILLERS = frozenset(
    {
        *(
            "joint",
            "joints",
            "pos",
            "position",
            "positions",
            "state",
            "dof",
            "motor",
            "motors",
            "q",
        ),
        *("k", "observation", "angle", "angles"),
    }
)
"""Words in the names of columns and joints that do not tell joints apart."""
GRIPPERS = frozenset({"gripper", "grippers", "finger", "fingers", "thumb", "jaw", "claw"})
"""Words in the names of columns of grippers."""
WORD = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|[0-9]+")


def matched_columns(
    columns: Sequence[str], count: int, joints: Sequence[str], given: Sequence[str] = ()
) -> tuple[int, ...]:
    """Return the column of each joint of a robot.

    Parameters
    ----------
    columns : sequence of str
        Names in the dataset; empty where it has none.
    count : int
        Number of columns.
    joints : sequence of str
        Joints of the robot.
    given : sequence of str
        Joint of each column as the caller names it, ``"-"`` for a column that is none; names of grippers are none.

    Raises
    ------
    InvalidInputError
        When columns have no names and none are given, a joint has no column or several could be
        meant, or names are given for another number of columns.
    """
    if given:
        return _given(given, count, joints)
    if not columns:
        raise InvalidInputError(
            f"the {count} columns of the dataset have no names: give {argument('columns')} with the "
            f"joint of each column in its order, - for a column that is no joint of {some_of(joints)}"
        )
    exact = {name: place for place, name in enumerate(columns)}
    if all(joint in exact for joint in joints):
        return tuple(exact[joint] for joint in joints)

    words = [words_of(name) for name in columns]
    found = []
    for joint in joints:
        own = words_of(joint)
        equal = [place for place, other in enumerate(words) if other == own]
        ends = equal or [place for place, other in enumerate(words) if _are_end(other, own)]
        if len(ends) != 1:
            raise _unmatched(joint, [columns[place] for place in ends], columns, joints)
        found.append(ends[0])
    if len(set(found)) < len(found):
        raise _unmatched(joints[0], [], columns, joints)
    _require_no_further_number(words, found, columns, joints)
    return tuple(found)


def _given(given: Sequence[str], count: int, joints: Sequence[str]) -> tuple[int, ...]:
    """Return the columns of the joints that a caller names."""
    flag = argument("columns")
    if len(given) != count:
        raise InvalidInputError(
            f"{flag} must name {count} columns, - for those that are no joints; found {len(given)}"
        )
    for name in given:
        if name != SKIPPED and name not in joints and not is_gripper(name):
            raise InvalidInputError(
                f"{flag}: {name!r} is no joint of the robot, which has {', '.join(joints)}"
            )
    missing = [joint for joint in joints if list(given).count(joint) != 1]
    if missing:
        raise InvalidInputError(
            f"{flag} must name each joint once; found {list(given).count(missing[0])} times: "
            f"{missing[0]!r}. Lock joints that the dataset does not have with {argument('lock')}"
        )
    return tuple(list(given).index(joint) for joint in joints)


def words_of(name: str) -> tuple[str, ...]:
    """Return the words and numbers of a name in lower case, without those that tell no joints apart."""
    words = [word.lower() for word in WORD.findall(name)]
    return tuple(word for word in words if word not in FILLERS)


def is_gripper(name: str) -> bool:
    """Whether a column of this name is that of a gripper."""
    return not GRIPPERS.isdisjoint(words_of(name))


def given_names(given: Sequence[str], joints: Sequence[str]) -> tuple[str, ...]:
    """Return different names for the columns of a file without names, from those of a caller.

    Joints and grippers have the names that the caller gives, other columns their number.
    """
    names = []
    for place, name in enumerate(given):
        if name not in joints and not is_gripper(name):
            name = f"column {place}"
        names.append(name)
    return tuple(names)


def _are_end(short: Sequence[str], long: Sequence[str]) -> bool:
    """Whether words of a column are the last words of a joint, or the other way round."""
    if not short or not long:
        return False
    size = min(len(short), len(long))
    return tuple(short[-size:]) == tuple(long[-size:])


def _require_no_further_number(
    words: Sequence[tuple[str, ...]],
    found: Sequence[int],
    columns: Sequence[str],
    joints: Sequence[str],
) -> None:
    """Require that no other column differs from a matched one by its number alone.

    Columns ``joint_0`` to ``joint_7`` of a robot with the joints 1 to 7 may be counted from 0.
    """
    bases = {tuple(word for word in words[place] if not word.isdigit()) for place in found}
    numbered = any(word.isdigit() for place in found for word in words[place])
    for place, own in enumerate(words):
        base = tuple(word for word in own if not word.isdigit())
        if numbered and place not in found and base in bases and len(own) > len(base):
            raise InvalidInputError(
                f"column {columns[place]!r} has the name of a joint and no number of {some_of(joints)}: "
                f"give {argument('columns')} with the joint of each column in its order"
            )


def _unmatched(
    joint: str, several: Sequence[str], columns: Sequence[str], joints: Sequence[str]
) -> InvalidInputError:
    found = f"several fit: {some_of(several)}" if several else f"found {some_of(columns, 40)}"
    return InvalidInputError(
        f"no column is clearly that of the joint {joint!r} of {some_of(joints, 40)}; {found}. Give "
        f"{argument('columns')} with the joint of each column in its order, or lock the joint with "
        f"{argument('lock')}"
    )


def unit_factors(
    motion: JointMotion,
    robot: Arm | ArmGroup,
    columns: Sequence[int],
    unit: str | None,
    option: str = "unit",
) -> Array:
    """Return factors (dof,) from the units of a motion's columns to rad and m.

    Parameters
    ----------
    motion : JointMotion
    robot : Arm or ArmGroup
    columns : sequence of int, length dof
        Column of each joint.
    unit : str or None
        Unit of revolute joints that the caller states, ``"rad"`` or ``"deg"``.
    option : str
        Name of the option that states it, for messages.

    Raises
    ------
    InvalidInputError
        When neither the file nor the caller states a unit, or both do and differ.
    """
    factors = np.ones(robot.dof)
    for joint, (place, joint_unit) in enumerate(zip(columns, robot.joint_units, strict=True)):
        found = motion.units[place]
        if found == UNKNOWN:
            if unit is None:
                raise _unknown_unit(motion, columns, option)
            found = METERS if joint_unit == METERS else unit
        if (joint_unit == METERS) != (found == METERS):
            raise InvalidInputError(
                f"{motion.name}: the joint {robot.joint_names[joint]!r} moves in {joint_unit}; the "
                f"dataset has {found} for it"
            )
        if joint_unit == RADIANS and unit is not None and found != unit:
            raise InvalidInputError(
                f"{argument(option, unit)}: {motion.name} states {found}; leave the option out"
            )
        if found == DEGREES:
            factors[joint] = pi / 180.0
    return factors


def _unknown_unit(motion: JointMotion, columns: Sequence[int], option: str) -> InvalidInputError:
    values = motion.positions[:, columns]
    return InvalidInputError(
        f"{motion.name}: the dataset states no unit of its joints, with values from "
        f"{values.min():.4g} to {values.max():.4g}: give {argument(option, RADIANS)} or "
        f"{argument(option, DEGREES)}. Values of −100 to 100 of uncalibrated robots cannot be checked"
    )
