"""The hulls that an arm or a pair of arms moves or stands on, and which of them can move against one another."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from maniport.arms.arm import Arm
from maniport.arms.arm_group import ArmGroup
from maniport.arms.chain import LEFT, RIGHT
from maniport.arms.collisions.hulls import Hull, Part, hulls_of, parts_of
from maniport.arms.collisions.tree import LinkTree
from maniport.errors import FileFormatError
from maniport.util.validation import Array


@dataclass(frozen=True, eq=False, repr=False)
class Carried:
    """Hulls of the parts of an arm or a pair; of a pair the left arm's first, then those of the right arm alone."""

    hulls: tuple[Hull, ...]  # their joints are links of the tree; named by their arms too where robots share names
    links: tuple[str, ...]  # names of the links
    parts: tuple[Part, ...]  # the part that each hull encloses, or a piece of it
    joined: NDArray[np.bool_]  # (hulls, hulls): pairs joined by one joint, or that do not move against one another
    between: NDArray[np.intp]  # (hulls, hulls): number of coordinates that move one against the other
    own: NDArray[np.intp]  # (hulls,): -1 moved by the left arm alone, 1 by the right one, 0 by both or the only arm
    one: bool  # whether all is of one robot
    last: frozenset[int]  # the last links

    def across(self, pairs: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Which pairs of hulls are of two arms; table and obstacles are of none."""
        links = (pairs >= 0) & (pairs < len(self.hulls))
        own = np.where(links, np.append(self.own, 0)[np.where(links, pairs, -1)], 0)
        return np.asarray(own.prod(axis=1) < 0)


def carried_by(arm: Arm | ArmGroup, tree: LinkTree, fine: Collection[str] = ()) -> Carried | None:
    """Collect the hulls of an arm or a pair; None where the shapes of an arm are not known."""
    arms = arm.each if isinstance(arm, ArmGroup) else (arm,)
    sides = [list(parts_of(each)) for each in arms]
    if not all(any(part.own for part in parts) for parts in sides):
        return None
    one = not isinstance(arm, ArmGroup) or bool(_common(arm))
    if isinstance(arm, ArmGroup) and one:
        sides = _shared_once(sides, arm.trunk)
    hulls: list[Hull] = []
    parts: list[Part] = []
    own: list[int] = []
    for side, (each, listed) in enumerate(zip(arms, sides, strict=True)):
        for part in listed:
            link = tree.of_chain[side][part.joint]
            found = [replace(hull, joint=link) for hull in hulls_of(each, part, part.name in fine)]
            shared = not isinstance(arm, ArmGroup) or (one and part.joint <= arm.trunk)
            hulls += found
            parts += [part] * len(found)
            own += [0 if shared else 2 * side - 1] * len(found)
    links = tuple(hull.name for hull in hulls)
    if len(sides) > 1 and not {part.name for part in sides[0]}.isdisjoint(part.name for part in sides[1]):
        names = [f"{LEFT if side < 0 else RIGHT}_{name}" for name, side in zip(links, own, strict=True)]
        hulls = [replace(hull, name=name) for hull, name in zip(hulls, names, strict=True)]
    last = frozenset(
        tree.of_chain[side][max(part.joint for part in listed if part.own)] for side, listed in enumerate(sides)
    )
    owners = np.array(own, dtype=np.intp)
    joined, between = _relations(arms, tree, hulls, np.array([part.own for part in parts]))
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


def _relations(
    arms: Sequence[Arm], tree: LinkTree, hulls: Sequence[Hull], on_chain: NDArray[np.bool_]
) -> tuple[Any, Any]:
    """Which hulls one joint joins, or none moves against one another, and how many coordinates are between them."""
    bodies = {0}
    for arm, links in zip(arms, tree.of_chain, strict=True):
        bodies |= {links[frame.joint] for frame in arm.chain.frames.values()}
    above = [0]  # the link with a body that each link hangs on
    for parent in tree.parents.tolist():
        above.append(parent if parent in bodies else above[parent])
    joints = np.array([hull.joint for hull in hulls])
    paths, moved = tree.moves[joints], tree.coupling != 0
    between = np.array([((paths != one).astype(np.intp) @ moved > 0).sum(axis=1) for one in paths])
    joined = (np.array(above)[joints][:, None] == joints) & on_chain[:, None] & on_chain & (joints[:, None] > joints)
    return joined | joined.T | (between == 0), between


def _common(arms: ArmGroup) -> set[str]:
    """Names of the frames that both arms have in one place: none where they are of two robots."""
    ours, theirs = (arm.chain.frames for arm in arms.each)
    return {
        name for name, place in ours.items()
        if place.joint <= arms.trunk and name in theirs and theirs[name].joint == place.joint
        and np.array_equal(theirs[name].placement, place.placement)
    }  # fmt: skip


class Lowest(NamedTuple):
    """Lowest point of a link during a motion: its height in the base frame [m], and when [s]."""

    link: str
    height: float
    time: float


def lowest_points(arm: Arm, time: Array, q: Array) -> tuple[Lowest, ...]:
    """Compute the lowest point of each moving link's convex hull over a motion."""
    try:
        hulls = [hull for part in parts_of(arm) if part.joint for hull in hulls_of(arm, part)]
    except FileFormatError:
        return ()
    turns, origins = LinkTree(arm).poses(q)
    found: dict[str, Lowest] = {}
    for hull in hulls:
        heights = (turns[:, hull.joint, 2] @ hull.corners.T).min(axis=1) + origins[:, hull.joint, 2] - hull.skin
        i = int(np.argmin(heights))
        point = Lowest(hull.name, float(heights[i]), float(time[i]))
        found[hull.name] = min(found.get(hull.name, point), point, key=lambda one: one.height)
    return tuple(sorted(found.values(), key=lambda one: one.height))
