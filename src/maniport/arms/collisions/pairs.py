"""Bodies of a group of arms, and the pairs of their convex hulls that are checked for collisions."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import combinations
from typing import NamedTuple

import coal
import numpy as np
from numpy.typing import NDArray

from maniport.arms.arm_group import ArmGroup
from maniport.arms.chain import Contact
from maniport.arms.collisions.hulls import Hull, Part, hulls_of, parts_of
from maniport.arms.collisions.solids import TABLE, Pairs, Solids
from maniport.errors import InvalidInputError
from maniport.util.validation import Array

FIRST = 1024  # samples that estimate how often hulls meet; the others are used before a pair is left out
# shares of these samples above which meshes decide, and overlap by design
OFTEN = 0.05
NEARLY_ALL = 0.9


@dataclass(frozen=True, eq=False, repr=False)
class Body:
    """A part of a robot in a group of arms."""

    part: Part
    name: str  # of the part, with the name of the arm as prefix where robots share names
    arm: int  # arm that it was read with
    robot: int
    link: int  # link of the tree that moves it
    arms: NDArray[np.bool_]  # (n_arms,): arms that have it; a base is of all arms of its robot


class SelectedPairs(NamedTuple):
    """Pairs to check, and those left out: they always or never meet, or their hulls do not decide whether they do."""

    pairs: Pairs
    always: Pairs
    never: Pairs
    unresolved: Pairs
    share: Array  # (pairs,): fraction of a clearance that applies
    across: NDArray[np.bool_]  # (pairs,): pairs of links of two arms
    excluded: tuple[tuple[str, str], ...] = ()  # names of bodies whose contacts are excluded
    isolated: tuple[str, ...] = ()  # names of bodies whose contacts with all others are excluded


NO_PAIRS = SelectedPairs(
    *(np.empty((0, 2), dtype=np.int64),) * 4, np.empty(0), np.empty(0, dtype=np.bool_)
)


def select_pairs(
    group: ArmGroup, boxes: Sequence[Hull], table: float, disabled: Collection[frozenset[str]]
) -> tuple[Solids, SelectedPairs] | None:
    """Choose hulls, and the pairs of them to check; None where the shapes of an arm are not known.

    Pairs that meet in nearly all samples of the joint space, or come near in none, are left out. Bodies whose hulls
    meet much more often than their meshes get finer hulls.
    """
    bodies = _bodies(group)
    if not bodies:
        return None
    selection = _Selection(group, bodies, boxes, table, disabled, fine=())
    selection.require_free_base()
    selected, coarse = selection.classified()
    if coarse:
        selection = _Selection(group, bodies, boxes, table, disabled, coarse)
        selected, _ = selection.classified()
    return selection.solids, selected


def _bodies(group: ArmGroup) -> list[Body]:
    """All bodies of the first arm, then those of each further arm alone; empty without the shapes of an arm."""
    parts_of_arms = [parts_of(arm.geometry) for arm in group.arms]
    if not all(_has_solids(parts) for parts in parts_of_arms):
        return []
    robots = _robots(group)
    bodies: list[Body] = []
    for i, parts in enumerate(parts_of_arms):
        known = _KnownParts.of(i, parts_of_arms, bodies, group, robots)
        for part in parts:
            if known.has(part):
                continue
            arms = (robots == robots[i]) & (group.common[i] >= part.joint)
            link = group.kinematics.links[i][part.joint]
            bodies.append(Body(part, part.name, i, int(robots[i]), link, arms))
    return _named_apart(bodies, group)


def _has_solids(parts: Sequence[Part]) -> bool:
    """Whether a body on the chain of an arm has a shape other than a plane."""
    return any(part.own and not part.is_plane for part in parts)


class _KnownParts(NamedTuple):
    """What earlier arms of a robot already have of an arm, or its other arms will have."""

    shared: int  # number of joints with which the chain of another arm begins, -1 without one
    earlier: set[str]  # names of bodies that were read with earlier arms
    moved: set[str]  # names of parts that only another arm moves

    @classmethod
    def of(
        cls,
        arm: int,
        parts_of_arms: Sequence[Sequence[Part]],
        bodies: Sequence[Body],
        group: ArmGroup,
        robots: NDArray[np.intp],
    ) -> "_KnownParts":
        """Compare an arm with the others of its robot (arms,)."""
        shared = -1
        moved = set[str]()
        for other in np.flatnonzero(robots == robots[arm]).tolist():
            if other == arm:
                continue
            common = int(group.common[arm, other])
            shared = max(shared, common)
            moved |= {part.name for part in parts_of_arms[other] if part.joint > common}
        earlier = {body.part.name for body in bodies if body.robot == robots[arm]}
        return cls(shared, earlier, moved)

    def has(self, part: Part) -> bool:
        """Whether a part of the arm is not taken with it."""
        if part.joint > self.shared:
            return False
        if part.name in self.earlier:
            return True
        return not part.own and part.name in self.moved


def _named_apart(bodies: list[Body], group: ArmGroup) -> list[Body]:
    """Return bodies with the names of arms as prefixes, where two arms have bodies of one name."""
    names = {body.name for body in bodies}
    names_in_arms = {(body.arm, body.name) for body in bodies}
    if len(names) == len(names_in_arms):
        return bodies
    renamed = []
    for body in bodies:
        renamed.append(replace(body, name=f"{group.names[body.arm]}_{body.name}"))
    return renamed


def _robots(group: ArmGroup) -> NDArray[np.intp]:
    """Index of the robot of each arm: arms of one robot have a frame in the same place in common."""
    robots = np.arange(len(group))
    places = []
    for arm in group.arms:
        of_arm = set[tuple[str, int, bytes]]()
        for name, frame in arm.chain.frames.items():
            of_arm.add((name, frame.joint, frame.placement.tobytes()))
        places.append(of_arm)
    for i, k in combinations(range(len(group)), 2):
        if any(joint <= group.common[i, k] for _, joint, _ in places[i] & places[k]):
            robots[robots == robots[k]] = robots[i]
    return robots


class _Classes(NamedTuple):
    """Which pairs (pairs,) are left out, see `SelectedPairs`; filled one after the other."""

    never: NDArray[np.bool_]
    always: NDArray[np.bool_]
    unresolved: NDArray[np.bool_]


class _Selection:
    """Candidates of pairs of hulls, classified by samples of the joint space."""

    def __init__(
        self,
        group: ArmGroup,
        bodies: Sequence[Body],
        boxes: Sequence[Hull],
        table: float,
        disabled: Collection[frozenset[str]],
        fine: Collection[Part],  # parts that need finer hulls
    ):
        hulls = []
        owners = []
        for i, body in enumerate(bodies):
            for hull in hulls_of(body.part, body.part in fine):
                hulls.append(replace(hull, name=body.name, joint=body.link))
                owners.append(i)
        self.group = group
        self.excluded: dict[tuple[str, str], None] = {}  # pairs that the description excludes
        self.bodies = bodies
        self.solids = Solids(group.kinematics, [*hulls, *boxes], table)
        self.owners = np.array(owners, dtype=np.intp)  # body of each hull
        rest = np.clip(0.0, group.lower, group.upper)
        self.q = np.concatenate([rest[None], group.sample(9999, random_state=0)])
        self.between, candidates, off = _candidates(group, bodies, disabled)
        allowed = candidates[self.owners[:, None], self.owners]
        movable = ~off & (self.between > 0)
        self._apply_contacts(hulls, allowed, movable[self.owners[:, None], self.owners])

        smaller, larger = np.nonzero(np.triu(allowed, 1))
        self.isolated = self._isolated(np.concatenate([smaller, larger]))
        pairs = list(zip(larger.tolist(), smaller.tolist(), strict=True))
        surroundings = list(range(len(hulls), len(hulls) + len(boxes)))
        if np.isfinite(table):
            surroundings.append(TABLE)
        for i, hull in enumerate(hulls):
            if hull.joint:
                pairs += [(i, other) for other in surroundings]
        self.pairs = np.array(pairs, dtype=np.int64).reshape(-1, 2)
        is_link = (self.pairs >= 0) & (self.pairs < len(hulls))
        self.links = np.array(is_link.all(axis=1), dtype=np.bool_)  # pairs of links
        self.ends = self.owners[np.where(self.links[:, None], self.pairs, 0)]  # their bodies

    def _isolated(self, checked: NDArray[np.intp]) -> tuple[str, ...]:
        """Return names of bodies in excluded pairs without a hull that is checked with another."""
        names = {self.bodies[owner].name for owner in self.owners[checked].tolist()}
        isolated = dict[str, None]()
        for pair in self.excluded:
            for name in pair:
                if name not in names:
                    isolated[name] = None
        return tuple(isolated)

    def _apply_contacts(
        self,
        hulls: Sequence[Hull],
        allowed: NDArray[np.bool_],
        movable: NDArray[np.bool_],
    ) -> None:
        """Replace the choice of pairs of hulls (hulls, hulls) by MuJoCo's for geoms of one robot of an MJCF."""
        robots = np.array([self.bodies[owner].robot for owner in self.owners.tolist()])
        arms = {body.robot: body.arm for body in self.bodies}
        for robot, arm in arms.items():
            rules = self.group.arms[arm].geometry.checked.rules
            if rules is None:
                continue
            geoms: list[int] = []
            contacts: list[Contact] = []
            for i, hull in enumerate(hulls):
                if hull.contact is not None and robots[i] == robot:
                    geoms.append(i)
                    contacts.append(hull.contact)
            touching, excluded = rules.decide(contacts)
            block = np.ix_(geoms, geoms)
            other_body = self.owners[geoms][:, None] != self.owners[geoms]
            movable_here = movable[block] & other_body
            allowed[block] = touching & movable_here
            for i, k in np.argwhere(np.triu(excluded & movable_here, 1)).tolist():
                first = self.bodies[self.owners[geoms[i]]].name
                second = self.bodies[self.owners[geoms[k]]].name
                self.excluded[first, second] = None

    def classified(self) -> tuple[SelectedPairs, set[Part]]:
        """Return the pairs by class, see `Collisions`, and the parts whose hulls are too coarse."""
        pairs = self.pairs
        links = self.links
        near = links & (self.between[tuple(self.ends.T)] <= 2)
        # samples miss the nearest configuration; those of two coordinates are 2° to 4° apart
        reach = np.where(near, 0.005, np.where(links, 0.1, 0.02))
        bounds = self.solids.distance_bounds(self.q[:FIRST], pairs, reach)
        hits = np.array(bounds <= 0.0, dtype=np.bool_)
        classes = _Classes(
            never=self._far(bounds, reach),
            always=self._touching_surroundings(hits),
            unresolved=np.zeros(len(pairs), dtype=np.bool_),
        )
        coarse = set[Part]()
        met = links & ~classes.never & hits.any(axis=0)
        for a, b in np.unique(self.ends[met], axis=0).tolist():
            of_bodies = (self.ends == (a, b)).all(axis=1)
            columns = np.flatnonzero(links & ~classes.never & of_bodies)
            meeting = np.asarray(hits[:, columns].any(axis=1))
            if meeting.mean() > OFTEN and self._classify(a, b, columns, meeting, classes):
                for i in (a, b):
                    if not self.bodies[i].part.is_convex:
                        coarse.add(self.bodies[i].part)

        kept = ~(classes.always | classes.never | classes.unresolved)
        arms = np.array([body.arms for body in self.bodies])
        across = links & ~np.any(arms[self.ends].all(axis=1), axis=1)
        share = np.where(near, 0.25, 1.0)
        selected = SelectedPairs(
            pairs=pairs[kept],
            always=pairs[classes.always],
            never=pairs[classes.never],
            unresolved=pairs[classes.unresolved],
            share=share[kept],
            across=across[kept],
            excluded=tuple(self.excluded),
            isolated=self.isolated,
        )
        return selected, coarse

    def _far(self, bounds: Array, reach: Array) -> NDArray[np.bool_]:
        """Return pairs that keep a distance (pairs,) in all samples; `bounds` are those of the first."""
        far = np.array((bounds > reach).all(axis=0), dtype=np.bool_)
        for first in range(FIRST, len(self.q), FIRST):  # in blocks, to bound the memory
            block = self.q[first : first + FIRST]
            further = self.solids.distance_bounds(block, self.pairs[far], reach[far])
            far[far] = (further > reach[far]).all(axis=0)
        return far

    def _classify(
        self,
        a: int,
        b: int,
        columns: NDArray[np.intp],
        meeting: NDArray[np.bool_],
        classes: "_Classes",
    ) -> bool:
        """Classify the pairs of two bodies whose hulls meet in some samples (`FIRST`,), by their shapes.

        Return whether the hulls meet much more often than the shapes.
        """
        pairs = self.pairs[columns]
        touching = self._touch(a, b, pairs, self.q[np.flatnonzero(meeting)[:128]])
        share = float(meeting.mean() * touching.mean())
        if share > NEARLY_ALL and meeting[0] and touching[0]:  # also at rest
            classes.always[columns] = True
            return False
        if not touching.any() and self.between[a, b] <= 2 and not self._ever_touch(a, b, pairs):
            classes.never[columns] = True
            return False
        if self._are_convex(a, b):  # their hulls are exact
            return False
        classes.unresolved[columns] = meeting.mean() > NEARLY_ALL
        return bool(meeting.mean() - share > OFTEN)

    def _ever_touch(self, a: int, b: int, pairs: Pairs) -> bool:
        """Whether two bodies touch in 2048 samples, which are 8° apart with two coordinates."""
        q = self.q[:2048]
        meeting = np.asarray((self.solids.distance_bounds(q, pairs, 0.0) <= 0.0).any(axis=1))
        return bool(self._touch(a, b, pairs, q[meeting]).any())

    def _touching_surroundings(self, hits: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Pairs with table or boxes that touch in all samples; an error where they must not."""
        solids = self.solids
        always = np.asarray(hits.all(axis=0) & ~self.links)
        for k in np.flatnonzero(always):
            always[k] = np.all(solids.contacts(self.q[:FIRST], self.pairs[[k]]).distances <= 0.0)
        last_of_arms = dict[int, int]()
        for body in self.bodies:
            if body.part.own:
                last_of_arms[body.arm] = max(body.link, last_of_arms.get(body.arm, 0))
        last = set(last_of_arms.values())
        for a, b in self.pairs[always].tolist():
            if b != TABLE or solids.hulls[a].joint in last:
                what = f"table: the plane at z = {solids.table:g} m"
                if b != TABLE:
                    what = f"obstacles: {solids.hulls[b].name!r}"
                raise InvalidInputError(
                    f"{what} touches {solids.hulls[a].name!r} in all of {FIRST} samples of the joint space"
                )
        return always

    def _touch(self, a: int, b: int, pairs: Pairs, q: Array) -> NDArray[np.bool_]:
        """Whether two bodies touch at configurations (n, dof), shape (n,), by their shapes, not by hulls of meshes."""
        if not self._are_convex(a, b):
            return self._meshes_touch(a, b, q)
        contacts = self.solids.contacts(q, pairs, 0.0, depths=False)
        touching = np.zeros(len(q), dtype=np.bool_)
        touching[contacts.rows[contacts.distances <= 0.0]] = True
        return touching

    def _are_convex(self, a: int, b: int) -> bool:
        return self.bodies[a].part.is_convex and self.bodies[b].part.is_convex

    def _meshes_touch(self, a: int, b: int, q: Array) -> NDArray[np.bool_]:
        """Whether the meshes of two bodies touch at configurations (n, dof), shape (n,)."""
        request = coal.CollisionRequest()
        result = coal.CollisionResult()
        touching = np.zeros(len(q), dtype=np.bool_)
        first = self.bodies[a]
        second = self.bodies[b]
        first_solid = _mesh_solid(first.part)
        second_solid = _mesh_solid(second.part)
        turns, origins = self.solids.tree.link_poses(q)
        for row in range(len(q)):
            first_pose = coal.Transform3s(turns[row, first.link], origins[row, first.link])
            second_pose = coal.Transform3s(turns[row, second.link], origins[row, second.link])
            result.clear()
            contacts = coal.collide(
                first_solid, first_pose, second_solid, second_pose, request, result
            )
            touching[row] = contacts > 0
        return touching

    def require_free_base(self, sunk: float = 0.01) -> None:
        """Raise InvalidInputError when what a base carries overlaps a box or another base, or the table.

        Feet and rounded meshes may reach `sunk` [m] into a table or box.
        """
        solids = self.solids
        hulls = self.solids.hulls
        count = len(self.owners)
        fixed = []
        for i in range(count):
            if hulls[i].joint == 0 and not self.bodies[self.owners[i]].part.is_plane:
                fixed.append(i)
        zero = np.zeros((1, solids.tree.coupling.shape[1]))
        for i in fixed:
            body = self.bodies[self.owners[i]]
            hull = hulls[i]
            if not body.part.own:
                continue  # a leg or another arm may reach below a table in front of the robot
            low = round(float(hull.corners[:, 2].min() - hull.radius), 3) + 0.0  # no negative zero
            high = float(hull.corners[:, 2].max() + hull.radius)
            if solids.table > low + sunk:
                raise InvalidInputError(
                    f"table: the plane at z = {solids.table:g} m goes through the robot's base or lies above it: "
                    f"{hull.name!r} reaches from z = {low:.3f} to {high:.3f} m in the base frame; "
                    f"allowed is at most {low + sunk:.3f} m"
                )
            others = [k for k in fixed if self.bodies[self.owners[k]].robot != body.robot]
            for k in (*others, *range(count, len(hulls))):
                depth = -float(solids.contacts(zero, np.array([[i, k]])).distances[0])
                if depth > sunk:
                    name = hull.name
                    other = hulls[k].name
                    what = f"bases: {name!r} is {depth:.3f} m deep in {other!r}"
                    if k >= count:
                        what = f"obstacles: {other!r} intersects the robot's base: {name!r} is {depth:.3f} m deep in it"
                    raise InvalidInputError(
                        f"{what}; allowed is at most {sunk:g} m. Place them farther apart"
                    )


def _candidates(
    group: ArmGroup, bodies: Sequence[Body], disabled: Collection[frozenset[str]]
) -> tuple[NDArray[np.intp], NDArray[np.bool_], NDArray[np.bool_]]:
    """Numbers of coordinates that move one body against another, which pairs are checked, and which are disabled.

    All have the shape (bodies, bodies). Contacts of an MJCF are not considered.
    """
    tree = group.kinematics
    links = np.array([body.link for body in bodies])
    paths = tree.moves[links]
    between = ((paths[:, None] != paths).astype(np.intp) @ (tree.coupling != 0) > 0).sum(axis=-1)
    occupied = {0}  # links with a frame
    for arm, path in zip(group.arms, tree.links, strict=True):
        for frame in arm.chain.frames.values():
            occupied.add(path[frame.joint])
    above = [0]  # nearest occupied link above each link
    for parent in tree.parents.tolist():
        above.append(parent if parent in occupied else above[parent])
    on_chain = np.array([body.part.own for body in bodies])
    adjacent = (np.array(above)[links][:, None] == links) & (links[:, None] > links)
    adjacent &= on_chain[:, None] & on_chain
    robots = np.array([body.robot for body in bodies])
    off = np.zeros((len(bodies), len(bodies)), dtype=np.bool_)
    for i, first in enumerate(bodies):
        for k, second in enumerate(bodies):
            off[i, k] = frozenset((first.part.name, second.part.name)) in disabled
    same_robot = robots[:, None] == robots
    candidates = ~(same_robot & (adjacent | adjacent.T | (between == 0) | off))
    return between, candidates, off & same_robot


@lru_cache(maxsize=256)
def _mesh_solid(part: Part) -> coal.BVHModelOBBRSS:
    points, triangles = part.mesh
    solid = coal.BVHModelOBBRSS()
    solid.beginModel(len(triangles), len(points))
    solid.addVertices(points)
    solid.addTriangles(triangles.astype(np.int64))
    solid.endModel()
    return solid
