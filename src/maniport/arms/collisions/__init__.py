"""Collision checks of an arm or a group with itself, a table and obstacles: clearance and its gradient."""

import os
from collections.abc import Iterator, Mapping, Sequence
from copy import deepcopy
from functools import cached_property
from typing import NamedTuple, TypedDict

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maniport.arms.arm import Arm
from maniport.arms.arm_group import ArmGroup, as_group
from maniport.arms.collisions.hulls import Lowest
from maniport.arms.collisions.obstacles import Box, as_boxes, disabled_pairs, read_boxes
from maniport.arms.collisions.pairs import NO_PAIRS, SelectedPairs, select_pairs
from maniport.arms.collisions.solids import Pairs, Solids
from maniport.errors import FileFormatError, InvalidInputError
from maniport.util.notebook import NotebookDisplay
from maniport.util.validation import Array, RandomState, as_generator, as_number

__all__ = [
    "NO_SHAPES",
    "Box",
    "CheckedShapes",
    "Collisions",
    "Lowest",
    "Nearest",
    "as_collisions",
    "free_configurations",
    "read_boxes",
]


class Nearest(NamedTuple):
    """Smallest distance at each configuration, and names of the two bodies; shapes (...)."""

    distance: Array
    first: NDArray[np.str_]
    second: NDArray[np.str_]


class CheckedShapes(NamedTuple):
    """Links by the kind of the shapes with which they are checked for collisions.

    Attributes
    ----------
    collision, visual : tuple of str
        Links with collision shapes of the description, and links with visual shapes, since it declares no collision
        shapes of them or these cannot be read.
    undrawn : tuple of str
        Links of `collision` whose visual meshes are missing.
    missing, replaced : mapping of str to str
        Links of which a shape is not checked, and links of `visual` with collision shapes that cannot be read, with
        the reasons.
    excluded, overlapping : tuple of (str, str)
        Pairs of links that are not checked: their contacts are excluded by the description, or their shapes overlap
        by design, see `Collisions`.
    """

    collision: tuple[str, ...] = ()
    visual: tuple[str, ...] = ()
    undrawn: tuple[str, ...] = ()
    missing: Mapping[str, str] = {}
    replaced: Mapping[str, str] = {}
    excluded: tuple[tuple[str, str], ...] = ()
    overlapping: tuple[tuple[str, str], ...] = ()

    def __str__(self) -> str:
        if not self.collision:
            return "visual shapes; the description declares no collision shapes"
        if not self.visual:
            return "collision shapes of the description"
        return f"collision shapes of the description; visual shapes of {', '.join(self.visual)}"


NO_SHAPES = CheckedShapes()


Obstacles = str | os.PathLike[str] | Sequence[Box] | None
"""Boxes in the base frame of the arm, or a file of them."""


class Surroundings(TypedDict, total=False):
    """Arguments of `Collisions.of` besides the arm."""

    table: float | None
    obstacles: Obstacles
    srdf: str | os.PathLike[str] | None


class Collisions(NotebookDisplay):
    """Collisions of an arm or a group of arms with itself, a table and obstacles; made by `Collisions.of`.

    Every pair of bodies that is not connected by a joint is checked: links of the arm, its gripper, and the rest of the
    robot, such as a head, legs or the other arm, at zero. A link has the collision shapes of the description, or its
    visual shapes where it has none, see `shapes`. Solids are exact; a mesh is its convex hull, or several hulls, but of
    an MJCF always one, as in MuJoCo. A finger is the hull of its positions from open to closed. The hull of visual
    shapes of the link that carries the end effector contains it.

    Geoms of an MJCF touch as MuJoCo decides: by contype and conaffinity, ``<exclude>``, ``<pair>`` and joints.

    Links that a joint connects, tools that are not in the description, and `unchecked` are not checked. Each arm of a
    group is checked with itself and with the others; shared bodies, such as a torso, count once.

    Attributes
    ----------
    checked, reason : bool, str
        Whether shapes of the arm are known, so that pairs are checked; the reason if not.
    pairs, always, never : tuple of (str, str)
        Names of checked and omitted pairs, with the names of the arms as prefixes if two robots have links of the same
        names. Meshes of `always` intersect in more than 90 % of 10 000 samples of the joint space and at rest. Pairs in
        `never` keep a distance above 10 cm in all samples (2 cm from table or obstacles, 5 mm with at most two
        coordinates between them), or have at most two coordinates between them and disjoint meshes.
    """

    def __init__(
        self,
        arm: Arm | ArmGroup,
        solids: Solids,
        selected: SelectedPairs,
        reason: str = "",
        surroundings: Surroundings | None = None,
    ):
        self.arm = arm
        self.reason = reason
        self.checked = not reason
        self._solids = solids
        self._pairs = selected.pairs
        self._selected = selected
        self._surroundings: Surroundings = surroundings or {}
        self.pairs = self._unique_names(selected.pairs)
        self.always = self._unique_names(selected.always)
        self._full = self._unique_names(selected.unresolved)
        never = self._unique_names(selected.never)
        self.never = tuple(pair for pair in never if pair not in self.pairs)
        self.excluded = tuple(pair for pair in selected.excluded if pair not in self.pairs)

    @classmethod
    def of(
        cls,
        arm: Arm | ArmGroup,
        *,
        table: float | None = None,
        obstacles: Obstacles = None,
        srdf: str | os.PathLike[str] | None = None,
    ) -> "Collisions":
        """Choose the pairs of bodies of an arm or a group of arms to check, with table and obstacles.

        Parameters
        ----------
        arm : Arm or ArmGroup
        table : float, optional
            Height of a floor or table in the base frame [m], the lower limit of all bodies that joints move.
        obstacles : path or sequence of Box, optional
            Boxes in the base frame, or a file of them, see `read_boxes`.
        srdf : path, optional
            File whose ``<disable_collisions>`` list pairs of links that are not checked.

        Raises
        ------
        InvalidInputError
            When the table or a box intersects the base, two bases intersect, or the SRDF belongs to another robot.
        FileFormatError
            When obstacles or SRDF cannot be read.
        """
        group = as_group(arm)
        height = -np.inf if table is None else as_number(table, "table")
        boxes = [box.hull() for box in as_boxes(obstacles)]
        disabled = set() if srdf is None else disabled_pairs(srdf, arm)
        surroundings: Surroundings = {"table": table, "obstacles": obstacles, "srdf": srdf}
        reason = (
            f"{arm.name!r} is known by its joints alone: its description names no shapes of links"
        )
        try:
            chosen = select_pairs(group, boxes, height, disabled)
            if chosen is not None:
                return cls(arm, *chosen, surroundings=surroundings)
            faults = list[str]()
            for member in group.arms:
                faults += member.geometry.checked.missing.values()
            if faults:
                reason = f"the surface of {arm.name!r} cannot be read: {faults[0]}"
        except FileFormatError as error:
            reason = f"the surface of {arm.name!r} cannot be read: {error}"
        return cls(arm, Solids(group.kinematics, [], -np.inf), NO_PAIRS, reason, surroundings)

    def __repr__(self) -> str:
        if self.checked:
            text = f"{len(self.pairs)} pairs"
        else:
            text = f"not checked: {self.reason}"
        return f"Collisions({self.arm.name!r}, {text})"

    @cached_property
    def between(self) -> "Collisions":
        """Collisions between different arms of a group only."""
        every = self._selected
        across = self._selected.across
        selected = every._replace(
            pairs=every.pairs[across], share=every.share[across], across=across[across]
        )
        return Collisions(self.arm, self._solids, selected, self.reason)

    @cached_property
    def of_arms(self) -> tuple["Collisions", ...]:
        """Collisions of each arm of a group with itself and its surroundings, as `of` chooses them."""
        if not isinstance(self.arm, ArmGroup):
            return (self,)
        return tuple(Collisions.of(arm, **self._surroundings) for arm in self.arm.arms)

    @property
    def unchecked(self) -> tuple[str, ...]:
        """Names of bodies and pairs that are not checked.

        Bodies have a shape that cannot be read, or the description excludes their contacts with all others. A pair is
        not checked if convex hulls nearly always intersect although the meshes do not.
        """
        names = dict[str, None]()
        for arm in as_group(self.arm).arms:
            if self.checked:
                names |= dict.fromkeys(arm.geometry.checked.missing)
                continue
            for name, frame in arm.chain.frames.items():
                if frame.joint:
                    names[name] = None
        names |= dict.fromkeys(self._selected.isolated)
        return *names, *(f"{first} against {second}" for first, second in self._full)

    @property
    def stand_ins(self) -> tuple[str, ...]:
        """Links that are drawn by the collision shapes of the description, since visual meshes are missing."""
        return self.shapes.undrawn

    @cached_property
    def shapes(self) -> "CheckedShapes":
        """Links by the kind of shapes that are checked, and those whose shapes cannot be read."""
        links: dict[bool, dict[str, None]] = {True: {}, False: {}}
        undrawn: dict[str, None] = {}
        missing: dict[str, str] = {}
        replaced: dict[str, str] = {}
        for arm in as_group(self.arm).arms if self.checked else ():
            read = arm.geometry.checked
            for shape in read.shapes:
                links[shape.collision][shape.link] = None
            undrawn |= dict.fromkeys(read.undrawn)
            missing |= read.missing
            replaced |= read.replaced
        return CheckedShapes(
            tuple(links[True]),
            tuple(links[False]),
            tuple(undrawn),
            missing,
            replaced,
            self.excluded,
            self.always,
        )

    @property
    def table(self) -> float | None:
        """Height of the table in the base frame [m]; None without one."""
        if np.isinf(self._solids.table):
            return None
        return float(self._solids.table)

    def collides(self, q: ArrayLike) -> NDArray[np.bool_]:
        """Return whether configurations (..., dof) collide, shape (...); False if nothing is checked."""
        flat, shape = self._flat(q)
        hit = np.zeros(len(flat), dtype=np.bool_)
        for block in _blocks(len(flat)):
            contacts = self._solids.contacts(flat[block], self._pairs, 0.0, depths=False)
            if len(contacts.rows):
                hit[block.start + contacts.rows[contacts.distances <= 0.0]] = True
        return hit.reshape(shape)

    def clearance(self, q: ArrayLike) -> Array:
        """Compute the smallest distance of the pairs at configurations (..., dof), shape (...) [m].

        It is negative for intersections and infinite if nothing is checked.
        """
        return self.nearest(q).distance

    def nearest(self, q: ArrayLike) -> Nearest:
        """Compute the clearance and the names of the closest pair; empty if nothing is checked."""
        flat, shape = self._flat(q)
        least = np.full(len(flat), np.inf)
        which = np.full(len(flat), len(self._pairs))
        for block in _blocks(len(flat)) if len(self._pairs) else ():
            left = np.arange(block.start, block.stop)
            reach = 0.02  # pairs nearer than this are measured first [m]
            while len(left):
                rows, columns, distances, *_ = self._solids.contacts(flat[left], self._pairs, reach)
                order = np.lexsort((columns, distances, rows))
                nearest, at = np.unique(rows[order], return_index=True)
                least[left[nearest]] = distances[order][at]
                which[left[nearest]] = columns[order][at]
                left = left[least[left] > reach]
                reach = 2.0 * reach
        names = np.array([*self._names(self._pairs), ("", "")])[which]
        return Nearest(least.reshape(shape), names[:, 0].reshape(shape), names[:, 1].reshape(shape))

    def gradient(
        self, q: ArrayLike, threshold: float, scaled: bool = False
    ) -> tuple[NDArray[np.intp], Array, Array]:
        """Compute distances below a threshold [m] and their derivatives at configurations (n, dof).

        Returns for each of k pairs: index of the configuration, ascending; signed distance [m]; derivative (k, dof).
        With `scaled`, distances of links with at most two coordinates between them, which need a quarter of the
        clearance, are multiplied by four.
        """
        flat = self._flat(q)[0]
        pairs = self._pairs
        solids = self._solids
        if scaled:
            share = self._selected.share
        else:
            share = np.ones(len(pairs))
        contacts = solids.contacts(flat, pairs, as_number(threshold, "threshold") * share)
        share = share[contacts.columns]
        distance = contacts.distances / share
        slope = solids.slopes(flat, pairs, contacts) / share[:, None]
        kept = distance < threshold
        return contacts.rows[kept], distance[kept], slope[kept]

    def _unique_names(self, pairs: Pairs) -> tuple[tuple[str, str], ...]:
        return tuple(dict.fromkeys(self._names(pairs)))

    def _names(self, pairs: Pairs) -> list[tuple[str, str]]:
        names = [*(hull.name for hull in self._solids.hulls), "table"]  # TABLE counts from the end
        return [(names[b], names[a]) for a, b in pairs.tolist()]

    def _flat(self, q: ArrayLike) -> tuple[Array, tuple[int, ...]]:
        array = self.arm.configurations(q)
        return array.reshape(-1, self.arm.dof), array.shape[:-1]


def _blocks(count: int, most: int = 8192) -> Iterator[slice]:
    """Slices of at most so many configurations, to bound the memory."""
    return (slice(first, min(first + most, count)) for first in range(0, count, most))


def as_collisions(value: object, arm: Arm | ArmGroup) -> Collisions | None:
    """Convert the argument `collisions`: None and False to None, True to `Collisions.of(arm)`."""
    if value is None or value is False:
        return None
    if value is True:
        return Collisions.of(arm)
    if not isinstance(value, Collisions):
        raise InvalidInputError(
            f"collisions must be a Collisions object, True, False or None; found {type(value).__name__}"
        )
    if value.arm.joint_names != arm.joint_names:
        raise InvalidInputError(
            f"collisions belong to {value.arm.name!r} with joints {', '.join(value.arm.joint_names)}, not to "
            f"{arm.name!r} with {', '.join(arm.joint_names)}; make them with Collisions.of(arm)"
        )
    return value


def free_configurations(
    arm: Arm | ArmGroup,
    n: int,
    random_state: RandomState,
    sequence: str = "sobol",
    collisions: Collisions | bool | None = None,
) -> Array:
    """Sample configurations as `maniport.arms.Arm.sample` does; those that collide are replaced.

    The sequence is continued until n are free, shape (n, dof): the same seed gives the same configurations. Fewer than
    one free sample in 64 is an `InvalidInputError`.
    """
    checked = as_collisions(collisions, arm)
    if checked is None or not checked.checked:
        return arm.sample(n, random_state, sequence)
    generator = as_generator(random_state)
    start = deepcopy(generator)
    q = arm.sample(n, generator, sequence)
    free = ~checked.collides(q)
    while free.sum() < n:
        if len(q) >= 64 * n:
            raise InvalidInputError(
                f"collisions: only {int(free.sum())} of {len(q)} sampled configurations of {arm.name!r} are free; "
                f"{n} are required"
            )
        more = arm.sample(2 * len(q), deepcopy(start), sequence)  # begins with q
        free = np.concatenate([free, ~checked.collides(more[len(q) :])])
        q = more
    return np.ascontiguousarray(q[free][:n])
