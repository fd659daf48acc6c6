"""Joints with which the chains of several arms begin in common."""

from collections.abc import Sequence
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from maniport.arms.chain import Chain
from maniport.errors import InvalidInputError, typed


def shared_joints(
    chains: Sequence[Chain], names: Sequence[str]
) -> tuple[NDArray[np.intp], list[tuple[int, int, tuple[str, ...]]]]:
    """Return numbers of common joints (n_arms, n_arms), and the coordinates that move them for each pair of arms.

    Raises
    ------
    InvalidInputError
        When base frames differ, one chain is a part of another, or common joints differ in limits or locked positions.
    """
    common = np.diag([len(chain.joints) for chain in chains]).astype(np.intp)
    shared = []
    for i, j in combinations(range(len(chains)), 2):
        both = chains[i], chains[j]
        common[i, j] = common[j, i] = count = _common_joints(both)
        shared.append((i, j, _require_agreement(both, (names[i], names[j]), count)))
    return common, shared


def _common_joints(chains: tuple[Chain, Chain]) -> int:
    """Number of joints with which two chains begin in common; raise where one chain is a part of the other."""
    first, second = chains
    if first.base != second.base:
        ends = " and ".join(repr(chain.base or "the robot's base") for chain in chains)
        raise InvalidInputError(f"all arms must have the same base frame; found {ends}")
    count = 0
    for a, b in zip(first.joints, second.joints, strict=False):
        same = (a.name, a.kind) == (b.name, b.kind)
        if not same or np.any(a.axis != b.axis) or np.any(a.placement != b.placement):
            break
        count += 1
    if count in (len(first.joints), len(second.joints)):
        where = f", which stand in one place; place them with {two_bases()}" if first.stand is not None else ""
        raise InvalidInputError(
            f"frames: {first.frame!r} and {second.frame!r} must end two limbs; found both on one chain of "
            f"{first.name!r}{where}"
        )
    return count


def _require_agreement(chains: tuple[Chain, Chain], names: tuple[str, str], count: int) -> tuple[str, ...]:
    """Names of the coordinates that move the common joints; raise unless both chains have the same limits for them."""
    moving: list[dict[str, Any]] = [
        {name: (low, high, column[:count].tolist())
         for name, low, high, column in zip(chain.coordinates, chain.lower, chain.upper, chain.coupling.T, strict=True)
         if np.any(column[:count])}
        for chain in chains
    ]  # fmt: skip
    for name in moving[0] | moving[1]:
        if moving[0].get(name) != moving[1].get(name):
            ranges = [
                "{:g} to {:g}".format(*own[name][:2]) if name in own else f"locked at {chain.locked.get(name, 0.0):g}"
                for own, chain in zip(moving, chains, strict=True)
            ]
            raise InvalidInputError(
                f"the joint {name!r} carries two arms and must be locked for both, or have the same limits; found "
                f"{ranges[0]} for {names[0]}, {ranges[1]} for {names[1]}"
            )
    first, second = chains
    for i in np.flatnonzero(first.offset[:count] != second.offset[:count]).tolist():
        raise InvalidInputError(
            f"the joint {first.joints[i].name!r} carries two arms and must be locked at one position; found "
            f"{first.offset[i]:g} for {names[0]}, {second.offset[i]:g} for {names[1]}"
        )
    return tuple(moving[0])


def two_bases() -> str:
    """Describe the options that place two robots, for messages."""
    given = "--pose of each, such as 0,0.3,0,0 and 0,-0.3,0,0"
    return given if typed() else "bases=, such as ((0, 0.3, 0), (0, -0.3, 0))"
