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
    arms: NDArray[
        np.bool_
    ]  # (n_arms,): arms that it is a part of; a base is one of all arms of its robot


class SelectedPairs(NamedTuple):
    """Pairs to check, and those left out: they always or never meet, or their hulls do not decide whether they do."""

    pairs: Pairs
    always: Pairs
    never: Pairs
    unresolved: Pairs
    share: Array  # (pairs,): fraction of a clearance that applies
    across: NDArray[np.bool_]  # (pairs,): pairs of links of two arms
    excluded: tuple[
        tuple[str, str], ...
    ] = ()  # names of bodies whose contacts the description excludes
    isolated: tuple[str, ...] = ()  # names of bodies whose contacts with all others it excludes


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
    listed = [parts_of(arm.geometry) for arm in group.arms]
    robots = _robots(group)
    common = group.common
    if not all(any(part.own and not part.is_plane for part in parts) for parts in listed):
        return []
    bodies: list[Body] = []
    for i, parts in enumerate(listed):
        others = [k for k in np.flatnonzero(robots == robots[i]).tolist() if k != i]
        earlier = {body.part.name for body in bodies if body.robot == robots[i]}
        moved = {part.name for k in others for part in listed[k] if part.joint > common[i, k]}
        shared = max((int(common[i, k]) for k in others), default=-1)
        for part in parts:
            if part.joint > shared or (
                part.name not in earlier and (part.own or part.name not in moved)
            ):
                arms = (robots == robots[i]) & (common[i] >= part.joint)
                link = group.kinematics.links[i][part.joint]
                bodies.append(Body(part, part.name, i, int(robots[i]), link, arms))
    if len({body.name for body in bodies}) < len({(body.arm, body.name) for body in bodies}):
        bodies = [replace(body, name=f"{group.names[body.arm]}_{body.name}") for body in bodies]
    return bodies


def _robots(group: ArmGroup) -> NDArray[np.intp]:
    """Index of the robot of each arm: arms of one robot have a frame in the same place in common."""
    robots = np.arange(len(group))
    places = []
    for arm in group.arms:
        places.append(
            {
                (name, frame.joint, frame.placement.tobytes())
                for name, frame in arm.chain.frames.items()
            }
        )
    for i, k in combinations(range(len(group)), 2):
        if any(joint <= group.common[i, k] for _, joint, _ in places[i] & places[k]):
            robots[robots == robots[k]] = robots[i]
    return robots


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
        enclosed = [hulls_of(body.part, body.part in fine) for body in bodies]
        hulls = []
        for body, own in zip(bodies, enclosed, strict=True):
            for hull in own:
                hulls.append(replace(hull, name=body.name, joint=body.link))
        self.group = group
        self.excluded: dict[tuple[str, str], None] = {}  # pairs that the description excludes
        self.bodies = bodies
        self.solids = Solids(group.kinematics, [*hulls, *boxes], table)
        self.owners = np.repeat(
            np.arange(len(bodies)), [len(own) for own in enclosed]
        )  # body of each hull
        self.q = np.concatenate(
            [np.clip(0.0, group.lower, group.upper)[None], group.sample(9999, random_state=0)]
        )
        self.between, candidates, off = _candidates(group, bodies, disabled)
        allowed = candidates[self.owners[:, None], self.owners]
        movable = ~off & (self.between > 0)
        self._apply_contacts(hulls, allowed, movable[self.owners[:, None], self.owners])
        a, b = np.nonzero(np.triu(allowed, 1))
        checked = {bodies[owner].name for owner in self.owners[np.concatenate([a, b])].tolist()}
        alone = []
        for pair in self.excluded:
            for name in pair:
                if name not in checked:
                    alone.append(name)
        self.isolated = tuple(dict.fromkeys(alone))
        count = len(hulls)
        moving = [i for i, hull in enumerate(hulls) if hull.joint]
        around = [*range(count, count + len(boxes)), *([TABLE] if np.isfinite(table) else [])]
        self.pairs = np.array(
            [*zip(b, a, strict=True), *((i, k) for i in moving for k in around)], dtype=np.int64
        )
        self.pairs = self.pairs.reshape(-1, 2)
        self.links = np.array(
            ((self.pairs >= 0) & (self.pairs < count)).all(axis=1), dtype=np.bool_
        )
        self.ends = self.owners[
            np.where(self.links[:, None], self.pairs, 0)
        ]  # bodies of pairs of links

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
                first, second = (self.bodies[self.owners[geoms[end]]].name for end in (i, k))
                self.excluded[first, second] = None

    def classified(self) -> tuple[SelectedPairs, set[Part]]:
        """Return the pairs by class, see `Collisions`, and the parts whose hulls are too coarse."""
        solids = self.solids
        pairs = self.pairs
        links = self.links
        q = self.q
        near = links & (self.between[tuple(self.ends.T)] <= 2)
        # samples miss the nearest configuration; those of two coordinates are 2° to 4° apart
        reach = np.where(near, 0.005, np.where(links, 0.1, 0.02))
        bounds = solids.distance_bounds(q[:FIRST], pairs, reach)
        never = np.array((bounds > reach).all(axis=0), dtype=np.bool_)
        for first in range(FIRST, len(q), FIRST):  # in blocks, to bound the memory
            block = q[first : first + FIRST]
            further = solids.distance_bounds(block, pairs[never], reach[never])
            never[never] = (further > reach[never]).all(axis=0)
        hits = np.array(bounds <= 0.0, dtype=np.bool_)
        always = self._touching_surroundings(hits)
        unresolved = np.zeros_like(always)
        coarse = set[Part]()
        for a, b in np.unique(self.ends[links & ~never & hits.any(axis=0)], axis=0).tolist():
            columns = np.flatnonzero(links & ~never & (self.ends == (a, b)).all(axis=1))
            meeting = np.asarray(hits[:, columns].any(axis=1))
            if meeting.mean() <= OFTEN:
                continue
            touching = self._touch(a, b, pairs[columns], q[np.flatnonzero(meeting)[:128]])
            share = float(meeting.mean() * touching.mean())
            if share > NEARLY_ALL and meeting[0] and touching[0]:  # also at rest
                always[columns] = True
                continue
            if not touching.any() and self.between[a, b] <= 2:
                # 2048 samples with two coordinates are 8° apart
                close = np.asarray(
                    (solids.distance_bounds(q[:2048], pairs[columns], 0.0) <= 0.0).any(axis=1)
                )
                if not self._touch(a, b, pairs[columns], q[:2048][close]).any():
                    never[columns] = True
                    continue
            if self._are_convex(a, b):  # their hulls are exact
                continue
            unresolved[columns] = meeting.mean() > NEARLY_ALL
            if meeting.mean() - share > OFTEN:
                parts = (self.bodies[i].part for i in (a, b))
                coarse |= {part for part in parts if not part.is_convex}
        kept = ~(always | never | unresolved)
        arms = np.array([body.arms for body in self.bodies])
        across = links & ~np.any(arms[self.ends].all(axis=1), axis=1)
        share_of = np.where(near, 0.25, 1.0)
        return SelectedPairs(
            pairs[kept], pairs[always], pairs[never], pairs[unresolved], share_of[kept], across[kept],
            tuple(self.excluded), self.isolated,
        ), coarse  # fmt: skip

    def _touching_surroundings(self, hits: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Pairs with table or boxes that touch in all samples; an error where they must not."""
        solids = self.solids
        always = np.asarray(hits.all(axis=0) & ~self.links)
        for k in np.flatnonzero(always):
            always[k] = np.all(solids.contacts(self.q[:FIRST], self.pairs[[k]]).distances <= 0.0)
        last = set()
        for arm in {b.arm for b in self.bodies}:
            last.add(max(b.link for b in self.bodies if b.part.own and b.arm == arm))
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
        (first, second) = (self.bodies[i] for i in (a, b))
        solids = _mesh_solid(first.part), _mesh_solid(second.part)
        for row, (turns, origins) in enumerate(zip(*self.solids.tree.link_poses(q), strict=True)):
            at, other = (
                coal.Transform3s(turns[body.link], origins[body.link]) for body in (first, second)
            )
            result.clear()
            touching[row] = coal.collide(solids[0], at, solids[1], other, request, result) > 0
        return touching

    def require_free_base(self, sunk: float = 0.01) -> None:
        """Raise InvalidInputError when what a base carries overlaps a box or another base, or the table.

        Feet and rounded meshes may reach `sunk` [m] into a table or box.
        """
        solids = self.solids
        hulls = self.solids.hulls
        count = len(self.owners)
        fixed = [
            i
            for i in range(count)
            if hulls[i].joint == 0 and not self.bodies[self.owners[i]].part.is_plane
        ]
        zero = np.zeros((1, solids.tree.coupling.shape[1]))
        for i in fixed:
            body = self.bodies[self.owners[i]]
            hull = hulls[i]
            if (
                not body.part.own
            ):  # a leg or another arm may reach below a table in front of the robot
                continue
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
                    own = hull.name
                    other = hulls[k].name
                    what = f"bases: {own!r} is {depth:.3f} m deep in {other!r}"
                    if k >= count:
                        what = f"obstacles: {other!r} intersects the robot's base: {own!r} is {depth:.3f} m deep in it"
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
        occupied |= {path[frame.joint] for frame in arm.chain.frames.values()}
    above = [0]  # nearest occupied link above each link
    for parent in tree.parents.tolist():
        above.append(parent if parent in occupied else above[parent])
    own = np.array([body.part.own for body in bodies])
    adjacent = (
        (np.array(above)[links][:, None] == links) & (links[:, None] > links) & own[:, None] & own
    )
    robots = np.array([body.robot for body in bodies])
    names = [body.part.name for body in bodies]
    off = np.array([[frozenset((a, b)) in disabled for b in names] for a in names], dtype=np.bool_)
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
