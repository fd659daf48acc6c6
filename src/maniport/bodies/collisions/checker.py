"""The door: whether an arm or a pair collides, how much room it has, and how that changes with the joints."""

import os
from collections.abc import Iterator, Mapping
from functools import cached_property
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maniport.bodies.arm import Arm
from maniport.bodies.arms import Arms
from maniport.bodies.collisions.carried import Carried, carried_by
from maniport.bodies.collisions.meshes import Meshes
from maniport.bodies.collisions.obstacles import as_boxes
from maniport.bodies.collisions.pairs import Chosen, candidates, chosen, require_free_base
from maniport.bodies.collisions.solids import Pairs, Solids
from maniport.bodies.collisions.srdf import disabled_pairs
from maniport.bodies.collisions.watch import Watch
from maniport.errors import FileFormatError
from maniport.notebook import ShownInNotebooks
from maniport.validation import Array, as_number

_PART = 8192
"""So many configurations are worked on at a time."""

_FIRST_REACH = 0.02
"""Pairs nearer than this are measured first, then those nearer than twice as much, and so on [m]."""


class Nearest(NamedTuple):
    """The smallest distance at each configuration, shapes (...), and between what."""

    distance: Array
    first: NDArray[np.str_]
    second: NDArray[np.str_]


class Collisions(ShownInNotebooks):
    """What an arm or a pair collides with: itself, a table, boxes. Make one with `Collisions.of`.

    Every pair of bodies that no joint joins directly is checked: the links of the arm, its gripper, and the rest of the
    robot, such as a head, legs or the other arm, which stands at zero. Each finger is the hull of its positions from
    open to closed. Each link is a convex hull of its visual meshes, see `maniport.bodies.Arm.surfaces`, or several;
    smaller hollows are filled. The hull of the link that carries the end effector reaches to it.

    Not checked are links that one joint joins, tools of which the description knows nothing, and `unchecked`.

    Of a pair each arm is checked with itself and with the other; bodies of both, such as a torso, count once.

    Attributes
    ----------
    arm : Arm or Arms
    known : bool
        Whether anything is checked; False for an arm of which no surface is known.
    why : str
        Why not, in a sentence; empty when something is.
    boxes : bool
        Whether boxes were given.
    padding : float
        What comes nearer than this collides [m]; links with at most two coordinates between, which are always near one
        another, collide within a quarter of it.
    pairs : tuple of (str, str)
        Names of what is checked against one another. Where the links of two robots have the same names all are called
        ``left_…`` and ``right_…``.
    always, never : tuple of (str, str)
        Names of pairs that are not checked: their meshes meet in more than 90 % of 10 000 samples of the joint space
        and at rest, or the pair stays apart in all samples by more than 10 cm (5 mm with at most two coordinates
        between, 2 cm from table or boxes), or with at most two coordinates between its meshes never meet.

    See Also
    --------
    maniport.tracking.plan_motion : takes it, as planning, following and live motion do.
    """

    def __init__(
        self,
        arm: Arm | Arms,
        solids: Solids,
        found: Chosen,
        padding: float,
        why: str = "",
        across: NDArray[np.bool_] | None = None,
        around: Mapping[str, Any] | None = None,
    ):
        self.arm, self.padding, self.why, self.known = arm, padding, why, not why
        self._solids, self._pairs, self._found = solids, found.pairs, found
        self._across, self._around = across, dict(around or {})
        self.boxes = self._around.get("boxes") is not None
        self.pairs, self.always, never, self._full = (tuple(dict.fromkeys(self._names(pairs))) for pairs in found[:4])
        self.never = tuple(pair for pair in never if pair not in self.pairs)

    @classmethod
    def of(
        cls,
        arm: Arm | Arms,
        *,
        table: float | None = None,
        boxes: Any = None,
        srdf: str | os.PathLike[str] | None = None,
        padding: float = 0.0,
    ) -> "Collisions":
        """Choose the pairs of bodies of an arm or a pair of arms to check, with table and boxes.

        Parameters
        ----------
        arm : Arm or Arms
        table : float, optional
            Height of a floor or table in the base frame [m]: nothing may be below it. What the base carries is exempt.
        boxes : path, sequence of Box, or array_like of shape (n, 6) or (n, 7), optional
            Boxes in the base frame: a file, see `read_boxes`, or center, size [m] and perhaps yaw [rad] of each.
        srdf : path, optional
            Pairs of links that it names under ``<disable_collisions>`` are not checked.
        padding : float
            Distance that counts as a collision [m].

        Returns
        -------
        Collisions
            With ``known`` False where no surface of the arm is known, or one cannot be read.

        Raises
        ------
        InvalidInputError
            When an argument has a wrong value, the table or a box goes through the base, the bases of two robots stand
            in one another, or the SRDF is of another robot.
        FileFormatError
            When boxes or SRDF cannot be read.
        """
        height = None if table is None else as_number(table, "table")
        room = as_number(padding, "padding", minimum=0.0)
        around = [box.hull() for box in as_boxes(boxes)]
        disabled = None if srdf is None else disabled_pairs(srdf, arm)
        why = ""
        try:
            carried = carried_by(arm)
        except FileFormatError as error:
            carried, why = Carried.nothing(), f"the surface of {arm.name!r} cannot be read: {error}"
        if not carried.hulls:
            why = why or f"{arm.name!r} is known by its joints alone: its description names no shapes of links"
            around, height = [], None
        plane = -np.inf if height is None else height
        solids = Solids(arm, [*carried.hulls, *around], plane)
        require_free_base(solids, carried, height)
        asked = candidates(carried, len(around), height is not None, disabled)
        meshes = Meshes(arm)
        found, coarse = chosen(meshes, solids, carried, asked, room)
        if coarse:
            carried = carried_by(arm, coarse)
            solids = Solids(arm, [*carried.hulls, *around], plane)
            asked = candidates(carried, len(around), height is not None, disabled)
            found, _ = chosen(meshes, solids, carried, asked, room)
        around_it = {"table": table, "boxes": boxes, "srdf": srdf, "padding": padding}
        return cls(arm, solids, found, room, why, carried.across(found.pairs), around_it)

    def __repr__(self) -> str:
        told = f"{len(self.pairs)} pairs, padding {self.padding:g} m" if self.known else f"not known: {self.why}"
        return f"Collisions({self.arm.name!r}, {told})"

    @cached_property
    def between(self) -> "Collisions":
        """Of a pair: what one arm collides with of the other, and nothing else."""
        every, across = self._found, self._across
        found = every._replace(pairs=every.pairs[across], share=every.share[across])
        return Collisions(self.arm, self._solids, found, self.padding, self.why)

    @cached_property
    def each(self) -> tuple["Collisions", "Collisions"]:
        """Of a pair: what each arm collides with but the other one, as `of` finds it for that arm alone."""
        left, right = (Collisions.of(arm, **self._around) for arm in cast(Arms, self.arm).each)
        return left, right

    @property
    def unchecked(self) -> tuple[str, ...]:
        """Names of bodies that are not checked, because their shape is missing or unknown, and of such pairs.

        A pair is not checked where convex hulls meet nearly always although the meshes do not.
        """
        arms = self.arm.each if isinstance(self.arm, Arms) else (self.arm,)
        if self.known:
            missing = dict.fromkeys(name for arm in arms for name in arm.look.attached()[1])
            return *missing, *(f"{first} against {second}" for first, second in self._full)
        return tuple(dict.fromkeys(name for arm in arms for name, at in arm.chain.frames.items() if at.joint))

    @property
    def stand_ins(self) -> tuple[str, ...]:
        """Links of which the description's collision shapes are taken, since what is drawn of them is missing."""
        arms = self.arm.each if isinstance(self.arm, Arms) else (self.arm,)
        return tuple(dict.fromkeys(link for arm in arms if self.known for link in arm.look.stand_ins()))

    @property
    def table(self) -> float | None:
        """Height of the table in the base frame [m]; None without one."""
        return None if np.isinf(self._solids.table) else float(self._solids.table)

    def collides(self, q: ArrayLike) -> NDArray[np.bool_]:
        """Whether configurations (..., dof) collide, shape (...); False where nothing is known.

        A compiled test frees what a plane certainly separates; Coal's distance decides of the others.
        """
        flat, shape = self._flat(q)
        limit = self.padding * self._found.share
        hit = np.zeros(len(flat), dtype=np.bool_)
        for part in _parts(len(flat)):
            near = self._solids.maybe_near(flat[part], self._pairs, limit)
            left = np.flatnonzero(near.any(axis=1))
            while len(left):  # one pair of each at a time, since one is enough
                first = near[left].argmax(axis=1)
                asked = np.arange(len(self._pairs)) == first[:, None]
                distances = self._solids.distances(flat[part][left], self._pairs, asked, depths=False)[0]
                hit[part.start + left[distances <= limit[first]]] = True
                near[left] &= ~asked
                left = left[near[left].any(axis=1) & ~hit[part.start + left]]
        return hit.reshape(shape)

    def clearance(self, q: ArrayLike) -> Array:
        """Smallest distance between two of the pairs at configurations (..., dof), shape (...) [m].

        Negative where they are in one another; infinite where nothing is checked.
        """
        return self.nearest(q).distance

    def nearest(self, q: ArrayLike) -> Nearest:
        """`clearance`, and the names of what is nearest to one another; empty where nothing is checked."""
        flat, shape = self._flat(q)
        least, which = np.full(len(flat), np.inf), np.full(len(flat), len(self._pairs))
        for part in _parts(len(flat)) if len(self._pairs) else ():
            left, reach = np.arange(part.start, part.stop), _FIRST_REACH
            while len(left):
                near = self._solids.maybe_near(flat[left], self._pairs, reach)
                rows, columns = np.nonzero(near)
                distances = self._solids.distances(flat[left], self._pairs, near)[0]
                order = np.lexsort((columns, distances, rows))
                found, at = np.unique(rows[order], return_index=True)
                least[left[found]], which[left[found]] = distances[order][at], columns[order][at]
                left, reach = left[least[left] > reach], 2.0 * reach
        names = np.array([*self._names(self._pairs), ("", "")])[which]
        return Nearest(least.reshape(shape), names[:, 0].reshape(shape), names[:, 1].reshape(shape))

    def gradient(self, q: ArrayLike, threshold: float) -> tuple[NDArray[np.intp], Array, Array]:
        """Pairs nearer than a threshold, and how their distances change with the joints.

        Where a pair is in one another the distance is minus the depth, along the shortest way out.

        Parameters
        ----------
        q : array_like, shape (n, dof)
        threshold : float
            [m].

        Returns
        -------
        rows : ndarray of int, shape (k,)
            Of which configurations the pairs are, ascending.
        distance : ndarray, shape (k,)
            [m].
        slope : ndarray, shape (k, dof)
            Derivative of the distance in the configuration [m/rad] or [m/m].
        """
        whole = np.ones(len(self._pairs))
        return Watch(self._solids, self._pairs, as_number(threshold, "threshold"), whole).gradient(self._flat(q)[0])

    def watch(self, threshold: float) -> Watch:
        """Return an object with such a `gradient`, quicker for configurations (n, dof) that change little.

        Links with at most two coordinates between are always near one another and need a quarter of the clearance:
        four times their distance is returned.
        """
        return Watch(self._solids, self._pairs, as_number(threshold, "threshold"), self._found.share, ahead=True)

    def _names(self, pairs: Pairs) -> list[tuple[str, str]]:
        names = [*(hull.name for hull in self._solids.hulls), "table"]  # TABLE counts from the end
        return [(names[b], names[a]) for a, b in pairs.tolist()]

    def _flat(self, q: ArrayLike) -> tuple[Array, tuple[int, ...]]:
        array = self.arm.configurations(q)
        return array.reshape(-1, self.arm.dof), array.shape[:-1]


def _parts(count: int) -> Iterator[slice]:
    return (slice(first, min(first + _PART, count)) for first in range(0, count, _PART))
