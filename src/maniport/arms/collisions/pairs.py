"""Convex hulls of all bodies of a group of arms, and the pairs of them that are checked for collisions."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple

import coal
import numpy as np
from numpy.typing import NDArray

from maniport.arms.arm_group import ArmGroup
from maniport.arms.collisions.hulls import Hull, Part, hulls_of, parts_of
from maniport.arms.collisions.solids import TABLE, Pairs, Solids
from maniport.arms.kinematics import Kinematics
from maniport.errors import InvalidInputError
from maniport.util.validation import Array

FIRST = 1024  # samples that estimate how often hulls meet; the others are used before a pair is left out


@dataclass(frozen=True, eq=False, repr=False)
class BodyHulls:
    """Hulls of the parts of a group of arms: all of the first arm, then those of each further arm alone."""

    hulls: tuple[Hull, ...]  # their joints are links of the tree; named by their arms too where robots share names
    parts: tuple[Part, ...]  # the part that each hull encloses, or a piece of it
    joined: NDArray[np.bool_]  # (hulls, hulls): pairs joined by one joint, or that do not move against one another
    between: NDArray[np.intp]  # (hulls, hulls): number of coordinates that move one against the other
    owners: NDArray[np.bool_]  # (hulls, arms): arms that each hull is a part of; a base is one of all its robot's arms
    robots: NDArray[np.intp]  # (hulls,): robot that each hull is a part of
    last: frozenset[int]  # the last links

    @classmethod
    def of(cls, group: ArmGroup, fine: Collection[str] = ()) -> "BodyHulls | None":
        """Collect the hulls of a group; None where the shapes of an arm are not known."""
        listed = [parts_of(member.geometry) for member in group.arms]
        if not all(any(part.own for part in parts) for parts in listed):
            return None
        tree, robots, common = group.kinematics, _robots(group), group.common
        kept: list[list[Part]] = []  # without parts of an earlier arm, and those that another arm of its robot moves
        hulls, parts, sides, owners = [], [], [], []
        for i, (member, own) in enumerate(zip(group.arms, listed, strict=True)):
            same = [k for k in np.flatnonzero(robots == robots[i]).tolist() if k != i]
            before = {part.name for k in same if k < i for part in kept[k]}
            moved = {part.name for k in same for part in listed[k] if part.joint > common[i, k]}
            deepest = max((int(common[i, k]) for k in same), default=-1)
            kept.append([
                part for part in own
                if part.joint > deepest or (part.name not in before and (part.own or part.name not in moved))
            ])  # fmt: skip
            for part in kept[i]:
                for hull in hulls_of(member, part, part.name in fine):
                    hulls.append(replace(hull, joint=tree.links[i][part.joint]))
                    parts.append(part)
                    sides.append(i)
                    owners.append((robots == robots[i]) & (common[i] >= part.joint))
        names = [name for own in kept for name in {part.name for part in own}]
        if len(set(names)) < len(names):
            hulls = [replace(h, name=f"{group.names[i]}_{h.name}") for h, i in zip(hulls, sides, strict=True)]
        last = [tree.links[i][max(part.joint for part in own if part.own)] for i, own in enumerate(kept)]
        links_with_bodies = {0}
        for arm, links in zip(group.arms, tree.links, strict=True):
            links_with_bodies |= {links[frame.joint] for frame in arm.chain.frames.values()}
        parent_body = [0]  # nearest link with a body above each link
        for parent in tree.parents.tolist():
            parent_body.append(parent if parent in links_with_bodies else parent_body[parent])
        joints, on_chain = np.array([hull.joint for hull in hulls]), np.array([part.own for part in parts])
        paths, moves = tree.moves[joints], tree.coupling != 0
        between = np.array([((paths != path).astype(np.intp) @ moves > 0).sum(axis=1) for path in paths])
        adjacent = (np.array(parent_body)[joints][:, None] == joints) & on_chain[:, None] & on_chain
        adjacent &= joints[:, None] > joints
        hull_robots = robots[sides]
        joined = (adjacent | adjacent.T | (between == 0)) & (hull_robots[:, None] == hull_robots)
        return cls(tuple(hulls), tuple(parts), joined, between, np.array(owners), hull_robots, frozenset(last))


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


class SelectedPairs(NamedTuple):
    """Pairs to check, and those left out: they always or never meet, or their hulls do not decide whether they do."""

    pairs: Pairs
    always: Pairs
    never: Pairs
    unresolved: Pairs
    share: Array  # (pairs,): fraction of a clearance that applies
    across: NDArray[np.bool_]  # (pairs,): pairs of links of two arms


NO_PAIRS = SelectedPairs(*(np.empty((0, 2), dtype=np.int64),) * 4, np.empty(0), np.empty(0, dtype=np.bool_))


def select_pairs(
    group: ArmGroup, boxes: Sequence[Hull], table: float, disabled: Collection[frozenset[str]]
) -> tuple[Solids, SelectedPairs] | None:
    """Choose hulls, and the pairs of them to check; None where the shapes of an arm are not known.

    Pairs that meet in nearly all samples of the joint space, or come near in none, are left out. A pair is never near
    if it stays farther apart in all samples than 5 mm with at most two coordinates between, whose samples are 2° to 4°
    apart, 2 cm from table or obstacles, and else 10 cm, as samples miss the nearest configuration.
    """
    q = np.concatenate([np.clip(0.0, group.lower, group.upper)[None], group.sample(9999, random_state=0)])
    coarse: frozenset[str] = frozenset()  # names of parts that need finer hulls
    for attempt in range(2):
        bodies = BodyHulls.of(group, coarse)
        if bodies is None:
            return None
        solids = Solids(group.kinematics, [*bodies.hulls, *boxes], table)
        if attempt == 0:
            _require_free_base(solids, bodies)
        pairs = _candidates(bodies, solids, disabled)
        links = np.array(((pairs >= 0) & (pairs < len(bodies.hulls))).all(axis=1), dtype=np.bool_)
        of_links = np.where(links[:, None], pairs, 0)
        near = links & (bodies.between[tuple(of_links.T)] <= 2)
        across = links & ~np.any(bodies.owners[of_links].all(axis=1), axis=1)
        share = np.where(near, 0.25, 1.0)
        reach = np.where(near, 0.005, np.where(links, 0.1, 0.02))
        bounds = solids.distance_bounds(q[:FIRST], pairs, reach)
        never = np.array((bounds > reach).all(axis=0), dtype=np.bool_)
        never[never] = ~solids.maybe_near(q[FIRST:], pairs[never], reach[never]).any(axis=0)
        hits = np.array(bounds <= 0.0, dtype=np.bool_)
        always = np.asarray(hits.all(axis=0) & ~links)
        every = np.ones((FIRST, 1), dtype=np.bool_)
        for pair in np.flatnonzero(always):
            always[pair] = np.all(solids.distances(q[:FIRST], pairs[[pair]], every)[0] <= 0.0)
        for a, b in pairs[always].tolist():
            if b > a or (b == TABLE and solids.hulls[a].joint in bodies.last):
                what = "obstacles: " + repr(solids.hulls[b].name)
                what = f"table: the plane at z = {solids.table:g} m" if b == TABLE else what
                raise InvalidInputError(
                    f"{what} touches {solids.hulls[a].name!r} in all of {FIRST} samples of the joint space"
                )
        overlapping, apart, coarse, full = _by_meshes(solids, bodies, q, pairs, hits & links & ~never)
        if not coarse:
            break
    always |= overlapping
    never |= apart
    kept = ~(always | never | full)
    return solids, SelectedPairs(
        pairs[kept], pairs[always], pairs[never], pairs[full], share[kept], across[kept]
    )  # fmt: skip


def _touching(tree: Kinematics, q: Array, *bodies: tuple[Part, int]) -> NDArray[np.bool_]:
    """Whether the meshes of two parts on links touch at configurations (n, dof), shape (n,)."""
    request, result = coal.CollisionRequest(), coal.CollisionResult()
    (mesh_a, mesh_b), touching = (_mesh_solid(part) for part, _ in bodies), np.zeros(len(q), dtype=np.bool_)
    for row, (turns, origins) in enumerate(zip(*tree.link_poses(q), strict=True)):
        a, b = (coal.Transform3s(turns[link], origins[link]) for _, link in bodies)
        result.clear()
        touching[row] = coal.collide(mesh_a, a, mesh_b, b, request, result) > 0
    return touching


@lru_cache(maxsize=256)
def _mesh_solid(part: Part) -> coal.BVHModelOBBRSS:
    points, triangles = part.mesh
    solid = coal.BVHModelOBBRSS()
    solid.beginModel(len(triangles), len(points))
    solid.addVertices(points)
    solid.addTriangles(triangles.astype(np.int64))
    solid.endModel()
    return solid


def _require_free_base(solids: Solids, bodies: BodyHulls, sunk: float = 0.01) -> None:
    """Raise InvalidInputError when what a base carries overlaps a box or another base, or a table goes through it.

    Feet and rounded meshes may reach `sunk` [m] into a table or box.
    """
    hulls, links = solids.hulls, len(bodies.hulls)
    fixed = [i for i in range(links) if hulls[i].joint == 0]
    pair, zero = np.ones((1, 1), dtype=np.bool_), np.zeros((1, solids.tree.coupling.shape[1]))
    # a leg or another arm may reach below a table in front of the robot
    for i, hull in ((i, hulls[i]) for i in fixed if bodies.parts[i].own):
        low, high = float(hull.corners[:, 2].min()), float(hull.corners[:, 2].max())
        if solids.table > low + sunk:
            raise InvalidInputError(
                f"table: the plane at z = {solids.table:g} m goes through the robot's base or lies above it: "
                f"{hull.name!r} reaches from z = {low:.3f} to {high:.3f} m in the base frame; "
                f"allowed is at most {low + sunk:.3f} m"
            )
        for k in (*(k for k in fixed if bodies.robots[k] != bodies.robots[i]), *range(links, len(hulls))):
            depth = -float(solids.distances(zero, np.array([[i, k]]), pair)[0][0])
            if depth > sunk and k < links:
                raise InvalidInputError(
                    f"bases: {hull.name!r} is {depth:.3f} m deep in {hulls[k].name!r}; allowed is at most {sunk:g} m. "
                    "Place the robots farther apart"
                )
            if depth > sunk:
                raise InvalidInputError(
                    f"obstacles: {hulls[k].name!r} intersects the robot's base: {hull.name!r} is {depth:.3f} m deep "
                    f"in it; allowed is at most {sunk:g} m"
                )


def _candidates(bodies: BodyHulls, solids: Solids, disabled: Collection[frozenset[str]]) -> Pairs:
    """All pairs that could be checked, as `Solids` takes them; obstacles follow the hulls of links."""
    count, robots = len(bodies.hulls), bodies.robots
    pairs = []
    for b in range(count):
        for a in range(b + 1, count):
            allowed = robots[a] == robots[b] and frozenset((bodies.parts[a].name, bodies.parts[b].name)) in disabled
            if not bodies.joined[a, b] and not allowed:
                pairs.append((a, b))
    surroundings = [*range(count, len(solids.hulls)), *([TABLE] if np.isfinite(solids.table) else [])]
    pairs += [(a, b) for a, hull in enumerate(bodies.hulls) if hull.joint for b in surroundings]
    return np.array(pairs, dtype=np.int64).reshape(-1, 2)


def _by_meshes(
    solids: Solids,
    bodies: BodyHulls,
    q: Array,
    pairs: Pairs,
    hits: NDArray[np.bool_],
    often: float = 0.05,
    nearly_all: float = 0.9,
) -> tuple[NDArray[np.bool_], NDArray[np.bool_], frozenset[str], NDArray[np.bool_]]:
    """Decide by meshes about pairs of links whose hulls meet in a larger share of the samples than `often`.

    Pairs whose meshes meet in a larger share than `nearly_all`, and at rest, overlap by design.
    """
    coarse = set[str]()
    always, apart, full = (np.zeros(len(pairs), dtype=np.bool_) for _ in range(3))
    of_parts: dict[tuple[str, ...], list[int]] = {}
    for pair in np.flatnonzero(hits.any(axis=0)).tolist():
        of_parts.setdefault(tuple(solids.hulls[i].name for i in pairs[pair]), []).append(pair)
    for columns in of_parts.values():
        meeting = np.asarray(hits[:, columns].any(axis=1))
        if meeting.mean() <= often:
            continue
        a, b = pairs[columns[0]].tolist()
        ends = [(bodies.parts[i], solids.hulls[i].joint) for i in (a, b)]
        touching = _touching(solids.tree, q[np.flatnonzero(meeting)[:128]], *ends)
        share = float(meeting.mean() * touching.mean())
        if share > nearly_all and meeting[0] and touching[0]:
            always[columns] = True
            continue
        if not touching.any() and bodies.between[a, b] <= 2:
            # 2048 samples with two coordinates are 8° apart
            near = np.asarray(solids.maybe_near(q[:2048], pairs[columns], 0.0).any(axis=1))
            if not _touching(solids.tree, q[:2048][near], *ends).any():
                apart[columns] = True
                continue
        full[columns] = meeting.mean() > nearly_all
        if meeting.mean() - share > often:
            coarse |= {bodies.parts[i].name for i in (a, b)}
    return always, apart, frozenset(coarse), full
