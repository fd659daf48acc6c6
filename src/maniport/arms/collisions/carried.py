"""The convex hulls of an arm or a group of arms, and which of them can move relative to one another."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from maniport.arms.arm import Arm
from maniport.arms.arm_group import ArmGroup, as_group
from maniport.arms.collisions.hulls import Hull, Part, hulls_of, parts_of
from maniport.arms.collisions.solids import LinkTree
from maniport.errors import FileFormatError
from maniport.util.validation import Array


@dataclass(frozen=True, eq=False, repr=False)
class Carried:
    """Hulls of the parts of a group of arms: all of the first arm, then those of each further arm alone."""

    hulls: tuple[Hull, ...]  # their joints are links of the tree; named by their arms too where robots share names
    links: tuple[str, ...]  # names of the links
    parts: tuple[Part, ...]  # the part that each hull encloses, or a piece of it
    joined: NDArray[np.bool_]  # (hulls, hulls): pairs joined by one joint, or that do not move against one another
    between: NDArray[np.intp]  # (hulls, hulls): number of coordinates that move one against the other
    owners: NDArray[np.bool_]  # (hulls, arms): arms that each hull is a part of; a base is one of all its robot's arms
    robots: NDArray[np.intp]  # (hulls,): robot that each hull is a part of
    last: frozenset[int]  # the last links

    def across(self, pairs: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Which pairs of hulls are of two arms; table and obstacles are of none."""
        links = (pairs >= 0) & (pairs < len(self.hulls))
        owners = self.owners[np.where(links, pairs, 0)]
        together = np.any(owners.all(axis=1), axis=1)
        return np.asarray(links.all(axis=1) & ~together)


def carried_by(arm: Arm | ArmGroup, tree: LinkTree, fine: Collection[str] = ()) -> Carried | None:
    """Collect the hulls of an arm or a group; None where the shapes of an arm are not known."""
    group = as_group(arm)
    listed = [list(parts_of(member)) for member in group.arms]
    if not all(any(part.own for part in parts) for parts in listed):
        return None
    robots = _robots(group)
    listed = _without_duplicates(listed, group.common, robots)
    hulls: list[Hull] = []
    parts: list[Part] = []
    owners: list[NDArray[np.bool_]] = []
    sides: list[int] = []
    for side, member in enumerate(group.arms):
        for part in listed[side]:
            link = tree.of_chain[side][part.joint]
            found = [replace(hull, joint=link) for hull in hulls_of(member, part, part.name in fine)]
            hulls += found
            parts += [part] * len(found)
            owners += [(robots == robots[side]) & (group.common[side] >= part.joint)] * len(found)
            sides += [side] * len(found)
    links = tuple(hull.name for hull in hulls)
    names = [name for each in listed for name in {part.name for part in each}]
    if len(set(names)) < len(names):
        hulls = [
            replace(hull, name=f"{group.names[side]}_{hull.name}") for hull, side in zip(hulls, sides, strict=True)
        ]
    last = frozenset(
        tree.of_chain[side][max(part.joint for part in each if part.own)] for side, each in enumerate(listed)
    )
    joined, between = _relations(group.arms, tree, hulls, np.array([part.own for part in parts]))
    of_hulls = robots[sides]
    joined &= of_hulls[:, None] == of_hulls
    return Carried(tuple(hulls), links, tuple(parts), joined, between, np.array(owners), of_hulls, last)


def _without_duplicates(
    listed: list[list[Part]], common: NDArray[np.intp], robots: NDArray[np.intp]
) -> list[list[Part]]:
    """Parts of each arm without those of an earlier arm, and without those that another arm of its robot moves."""
    kept: list[list[Part]] = []
    for i, parts in enumerate(listed):
        same = [k for k in np.flatnonzero(robots == robots[i]).tolist() if k != i]
        before = {part.name for k in same if k < i for part in kept[k]}
        moved = {part.name for k in same for part in listed[k] if part.joint > common[i, k]}
        deepest = max((int(common[i, k]) for k in same), default=-1)
        kept.append([
            part for part in parts
            if part.joint > deepest or (part.name not in before and (part.own or part.name not in moved))
        ])  # fmt: skip
    return kept


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


def _robots(group: ArmGroup) -> NDArray[np.intp]:
    """Index of the robot of each arm: arms of one robot have a frame in the same place in common."""
    robots = np.arange(len(group))
    for k in range(len(group)):
        for i in range(k):
            ours, theirs = group.arms[i].chain.frames, group.arms[k].chain.frames
            if any(
                place.joint <= group.common[i, k] and name in theirs and theirs[name].joint == place.joint
                and np.array_equal(theirs[name].placement, place.placement)
                for name, place in ours.items()
            ):  # fmt: skip
                robots[robots == robots[k]] = robots[i]
    return robots


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
