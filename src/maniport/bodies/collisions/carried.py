"""The hulls that an arm or a pair of arms moves or stands on, and which of them can move against one another."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from maniport.bodies.arm import Arm
from maniport.bodies.arms import Arms
from maniport.bodies.chain import LEFT, RIGHT
from maniport.bodies.collisions.hulls import Hull, Part, hulls_of, parts_of


@dataclass(frozen=True, eq=False, repr=False)
class Carried:
    """Hulls of the parts of an arm or a pair; of a pair the left arm's first, then those of the right arm alone.

    Attributes
    ----------
    hulls : tuple of Hull
        Joints are those that `maniport.bodies.collisions.links.links_of` the arm or pair places.
    links : tuple of str
        Names of the links; hulls of two robots are called by their arms, too, where links have the same names.
    parts : tuple of Part
        The part that each hull encloses, or a piece of it.
    joined : ndarray of bool, shape (hulls, hulls)
        Pairs that are not checked: one joint joins them directly, or they do not move against one another.
    between : ndarray of int, shape (hulls, hulls)
        The number of coordinates that move one against the other.
    own : ndarray of int, shape (hulls,)
        -1 for what the left arm alone moves or stands on, 1 for the right one, 0 where there is one arm, or for both.
    one : bool
        Whether all is of one robot.
    last : frozenset of int
        Joints of the last links.
    """

    hulls: tuple[Hull, ...]
    links: tuple[str, ...]
    parts: tuple[Part, ...]
    joined: NDArray[np.bool_]
    between: NDArray[np.intp]
    own: NDArray[np.intp]
    one: bool
    last: frozenset[int]

    @classmethod
    def nothing(cls) -> "Carried":
        """Return what is carried by an arm without shapes."""
        none = np.empty((0, 0), dtype=np.intp)
        return cls((), (), (), none.astype(np.bool_), none, none[0:0].reshape(0), True, frozenset())

    def across(self, pairs: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Which pairs of hulls, rows of two indices, are of two arms; indices beyond, and negative ones, of none."""
        links = (pairs >= 0) & (pairs < len(self.hulls))
        own = np.where(links, np.append(self.own, 0)[np.where(links, pairs, -1)], 0)
        return np.asarray(own.prod(axis=1) < 0)


def carried_by(arm: Arm | Arms, fine: Collection[str] = ()) -> Carried:
    """Collect the hulls of an arm or a pair; none where the shapes of an arm are not known."""
    arms = arm.each if isinstance(arm, Arms) else (arm,)
    sides = [list(parts_of(each)) for each in arms]
    if not all(any(part.own for part in parts) for parts in sides):
        return Carried.nothing()
    one = not isinstance(arm, Arms) or bool(_common(arm))
    if isinstance(arm, Arms) and one:
        sides = _shared_once(sides, arm.trunk)
    hulls: list[Hull] = []
    parts: list[Part] = []
    own: list[int] = []
    for side, (each, listed) in enumerate(zip(arms, sides, strict=True)):
        for part in listed:
            joint = _place(arm, part.joint) if side else part.joint
            found = [replace(hull, joint=joint) for hull in hulls_of(each, part, part.name in fine)]
            shared = not isinstance(arm, Arms) or (one and part.joint <= arm.trunk)
            hulls += found
            parts += [part] * len(found)
            own += [0 if shared else 2 * side - 1] * len(found)
    links = tuple(hull.name for hull in hulls)
    if len(sides) > 1 and not {part.name for part in sides[0]}.isdisjoint(part.name for part in sides[1]):
        names = [f"{LEFT if side < 0 else RIGHT}_{name}" for name, side in zip(links, own, strict=True)]
        hulls = [replace(hull, name=name) for hull, name in zip(hulls, names, strict=True)]
    ends = [max(part.joint for part in listed if part.own) for listed in sides]
    last = frozenset(_place(arm, end) if side else end for side, end in enumerate(ends))
    owners = np.array(own, dtype=np.intp)
    joined, between = _relations(arm, hulls, np.array([part.own for part in parts]))
    joined &= (owners[:, None] * owners >= 0) | one
    return Carried(tuple(hulls), links, tuple(parts), joined, between, owners, one, last)


def _shared_once(sides: list[list[Part]], trunk: int) -> list[list[Part]]:
    """Parts of two arms of one robot, each once: what an arm moves is no obstacle at rest to the other."""
    left, right = sides
    moving = [{part.name for part in parts if part.joint > trunk} for parts in sides]
    left = [part for part in left if part.own or part.name not in moving[1]]
    names = {part.name for part in left}
    right = [part for part in right if part.joint > trunk or part.name not in names | moving[0]]
    return [left, right]


def _relations(arm: Arm | Arms, hulls: Sequence[Hull], on_chain: NDArray[np.bool_]) -> tuple[Any, Any]:
    """Which hulls one joint joins, or none moves against one another, and how many coordinates are between them."""
    chains = [each.chain for each in (arm.each if isinstance(arm, Arms) else (arm,))]
    count = 1 + len(chains[0].joints) + (len(chains[1].joints) - cast(Arms, arm).trunk if len(chains) > 1 else 0)
    moved, path = np.zeros((count, arm.dof), dtype=np.intp), np.zeros((count, count), dtype=np.intp)
    above = np.zeros(count, dtype=np.intp)
    for side, chain in enumerate(chains):
        places = [_place(arm, joint) if side else joint for joint in range(len(chain.joints) + 1)]
        columns = arm.columns[side] if isinstance(arm, Arms) else np.arange(arm.dof)
        bodies = {frame.joint for frame in chain.frames.values()} | {0}
        for joint in range(1, len(places)):
            moved[places[joint], columns] = chain.coupling[joint - 1] != 0
            path[places[joint], [places[k] for k in range(1, joint + 1)]] = 1
            above[places[joint]] = places[max(body for body in bodies if body < joint)]
    joints = np.array([hull.joint for hull in hulls])
    paths = path[joints]
    between = np.array([((paths != one) @ moved > 0).sum(axis=1) for one in paths])
    joined = (above[joints][:, None] == joints) & on_chain[:, None] & on_chain & (joints[:, None] > joints)
    return joined | joined.T | (between == 0), between


def _common(arms: Arms) -> set[str]:
    """Names of the frames that both arms have in one place: none where they are of two robots."""
    ours, theirs = (arm.chain.frames for arm in arms.each)
    return {
        name for name, place in ours.items()
        if place.joint <= arms.trunk and name in theirs and theirs[name].joint == place.joint
        and np.array_equal(theirs[name].placement, place.placement)
    }  # fmt: skip


def _place(arm: Arm | Arms, joint: int) -> int:
    """Where a joint of the right chain is among those of the pair."""
    arms = cast(Arms, arm)
    return joint if joint <= arms.trunk else len(arms.left.chain.joints) + joint - arms.trunk
