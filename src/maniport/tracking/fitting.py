"""What is prepared for an arm and its ellipsoids serves no others; what differs is named."""

import numpy as np

from maniport.bodies import Arm, EllipsoidSpec
from maniport.errors import InvalidInputError


def require_alike(what: str, arms: tuple[Arm, Arm], specs: tuple[EllipsoidSpec, EllipsoidSpec], limits: bool) -> None:
    """Raise InvalidInputError unless what was made for the first arm and ellipsoids serves the second."""
    mine, other = arms
    differing = [
        f"{name}: {theirs!r} there, {ours!r} here"
        for name, theirs, ours in (
            ("joints", mine.joint_names, other.joint_names),
            ("tip", mine.frame, other.frame),
            ("base", mine.base, other.base),
            ("held joints", dict(mine.locked), dict(other.locked)),
            ("ellipsoids", *specs),
        )
        if theirs != ours
    ]
    if limits and mine.joint_names == other.joint_names:
        differing += _limits(mine, other)
    if differing:
        raise InvalidInputError(f"{what} {mine.name!r}; it does not fit {other.name!r}: {'; '.join(differing)}")


def _limits(mine: Arm, other: Arm) -> list[str]:
    """One sentence on the first joint with other limits, if there is one."""
    joints = np.flatnonzero((mine.lower != other.lower) | (mine.upper != other.upper))
    if not len(joints):
        return []
    i = joints[0]
    there, here = (f"{arm.lower[i]:.6g} to {arm.upper[i]:.6g}" for arm in (mine, other))
    return [
        f"limits of {mine.joint_names[i]}: {there} there, {here} here, and so on for {len(joints)} of {mine.dof} "
        "joints. A planner keeps a margin of the limits: what it holds goes with its arm, planner.limits.arm"
    ]
