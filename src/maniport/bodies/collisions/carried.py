"""What an arm or a pair of arms carries: hulls of its links, and which of them joints hold apart."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from maniport.bodies.arm import Arm
from maniport.bodies.arms import Arms
from maniport.bodies.chain import LEFT, RIGHT
from maniport.bodies.collisions.hulls import Hull, hulls_of

LINKS_APART = 3
"""Links nearer to one another on the chain are not checked without an SRDF: joints hold them apart."""


@dataclass(frozen=True, eq=False, repr=False)
class Carried:
    """Hulls of links, in the order of the chain; of a pair the left arm's first, then what the right one alone carries.

    Attributes
    ----------
    hulls : tuple of Hull
        Joints are those that `maniport.bodies.collisions.links.links_of` the arm or pair places.
    links : tuple of str
        Names of the links; hulls of two robots are called by their arms, too, where links have the same names.
    held : ndarray of bool, shape (hulls, hulls)
        Which are so near to one another on a chain that they are not checked.
    own : ndarray of int, shape (hulls,)
        -1 for what the left arm alone moves or stands on, 1 for the right one, 0 where there is one arm, or for both.
    one : bool
        Whether all is of one robot.
    last : frozenset of int
        Joints of the last links.
    """

    hulls: tuple[Hull, ...]
    links: tuple[str, ...]
    held: NDArray[np.bool_]
    own: NDArray[np.intp]
    one: bool
    last: frozenset[int]

    @classmethod
    def nothing(cls) -> "Carried":
        """What an arm carries of which no surface is known."""
        return cls((), (), np.empty((0, 0), dtype=np.bool_), np.empty(0, dtype=np.intp), True, frozenset())

    def across(self, pairs: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Which pairs of hulls, rows of two indices, are of two arms; indices beyond, and negative ones, of none."""
        links = (pairs >= 0) & (pairs < len(self.hulls))
        own = np.where(links, np.append(self.own, 0)[np.where(links, pairs, -1)], 0)
        return np.asarray(own.prod(axis=1) < 0)


def carried_by(arm: Arm | Arms) -> Carried:
    """What an arm carries, or a pair; nothing where that is not known of all.

    Raises
    ------
    FileFormatError
        When a file of an arm or a mesh is missing or cannot be read.
    """
    if isinstance(arm, Arms):
        left, right = hulls_of(arm.left), hulls_of(arm.right)
        return _of_both(arm, left, right) if left and right else Carried.nothing()
    hulls = hulls_of(arm)
    ranks = np.array(_ranks(hulls), dtype=np.intp)
    held = np.abs(ranks[:, None] - ranks) < LINKS_APART
    last = frozenset(hull.joint for hull in hulls[-1:])
    links = tuple(hull.name for hull in hulls)
    return Carried(tuple(hulls), links, held, np.zeros(len(hulls), dtype=np.intp), True, last)


def _of_both(arms: Arms, left: Sequence[Hull], right: Sequence[Hull]) -> Carried:
    """Put the hulls of both arms together, those that both carry once."""
    both = _common(arms)
    kept = [hull.name not in both for hull in right]
    ranks = np.append(_ranks(left), np.array(_ranks(right))[kept])
    own = np.array([0 if hull.name in both else -1 for hull in left] + [1] * sum(kept))
    apart = np.abs(ranks[:, None] - ranks)
    if both:  # one robot: the way from one arm to the other leads over the last link that carries both
        trunk = len({hull.joint for hull in left if hull.joint <= arms.trunk}) - 1
        apart = np.where(own[:, None] * own < 0, ranks[:, None] + ranks - 2 * trunk, apart)
    else:
        apart = np.where(own[:, None] * own < 0, LINKS_APART, apart)
    theirs = [replace(hull, joint=_place(arms, hull.joint)) for hull, keep in zip(right, kept, strict=True) if keep]
    hulls = [*left, *theirs]
    links = tuple(hull.name for hull in hulls)
    if not {hull.name for hull in left}.isdisjoint(hull.name for hull in theirs):
        hulls = [
            replace(hull, name=f"{LEFT if side < 0 else RIGHT}_{hull.name}")
            for hull, side in zip(hulls, own, strict=True)
        ]
    last = frozenset((left[-1].joint, hulls[-1].joint))
    return Carried(tuple(hulls), links, apart < LINKS_APART, own, bool(both), last)


def _common(arms: Arms) -> set[str]:
    """Names of the frames that both arms have in one place: none where they are of two robots."""
    ours, theirs = (arm.chain.frames for arm in arms.each)
    return {
        name for name, place in ours.items()
        if place.joint <= arms.trunk and name in theirs and theirs[name].joint == place.joint
        and np.array_equal(theirs[name].placement, place.placement)
    }  # fmt: skip


def _place(arms: Arms, joint: int) -> int:
    """Where a joint of the right chain is among those of the pair."""
    return joint if joint <= arms.trunk else len(arms.left.chain.joints) + joint - arms.trunk


def _ranks(hulls: Sequence[Hull]) -> list[int]:
    """Where links are on the chain: one further for each joint that carries a link, and for one fixed to another."""
    joints = sorted({hull.joint for hull in hulls})
    first = {hull.joint: hull.name for hull in reversed(hulls)}
    return [joints.index(hull.joint) + (hull.name != first[hull.joint]) for hull in hulls]
