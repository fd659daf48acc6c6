"""Which pairs of an arm's links and of what stands around it are to be checked."""

from typing import NamedTuple

import coal
import numpy as np
from numpy.typing import NDArray

from maniport.arms.arm import Arm
from maniport.arms.arm_group import ArmGroup
from maniport.arms.collisions.carried import Carried
from maniport.arms.collisions.hulls import Part
from maniport.arms.collisions.solids import TABLE, LinkTree, Pairs, Solids
from maniport.errors import InvalidInputError
from maniport.util.validation import Array

FIRST = 1024
"""Number of samples that estimates how often hulls meet; the others are looked at where a pair may be left out."""

OFTEN = 0.05  # Pairs whose hulls meet in a larger share of the samples are decided by their meshes

NEARLY_ALL = 0.9
"""Pairs whose meshes meet in a larger share of the samples, and at rest, are left out: their meshes overlap."""

_Body = tuple[Part, int]  # A part, and the link of the tree that it is on


class Chosen(NamedTuple):
    """Pairs to check, and those left out: they always or never meet, or their hulls cannot tell whether they do."""

    pairs: Pairs
    always: Pairs
    never: Pairs
    unresolved: Pairs
    share: Array

    @classmethod
    def nothing(cls) -> "Chosen":
        """Return no pairs."""
        none = np.empty((0, 2), dtype=np.int64)
        return cls(none, none, none, none, np.empty(0))


class Meshes:
    """Exact meshes of parts in 10 000 samples of the joint space, of which the first is at rest."""

    def __init__(self, arm: Arm | ArmGroup, tree: LinkTree):
        rest = np.clip(0.0, arm.lower, arm.upper)[None]
        self.samples = np.concatenate([rest, arm.sample(9999, random_state=0)])
        self._tree = tree
        self._solids: dict[Part, coal.BVHModelOBBRSS] = {}
        self._results: dict[tuple[_Body, _Body], dict[int, bool]] = {}

    def touch(self, rows: NDArray[np.intp], first: _Body, second: _Body) -> NDArray[np.bool_]:
        """Whether the meshes of two parts touch in some of the samples, shape (n,)."""
        known = self._results.setdefault((first, second), {})
        missing = [row for row in rows.tolist() if row not in known]
        request, result = coal.CollisionRequest(), coal.CollisionResult()
        one, other = self._solid(first[0]), self._solid(second[0])
        for row, turns, origins in zip(missing, *self._tree.poses(self.samples[missing]), strict=True):
            a, b = (coal.Transform3s(turns[link], origins[link]) for _, link in (first, second))
            result.clear()
            known[row] = coal.collide(one, a, other, b, request, result) > 0
        return np.array([known[row] for row in rows.tolist()], dtype=np.bool_)

    def _solid(self, part: Part) -> coal.BVHModelOBBRSS:
        if part not in self._solids:
            points, triangles = part.mesh
            solid = self._solids[part] = coal.BVHModelOBBRSS()
            solid.beginModel(len(triangles), len(points))
            solid.addVertices(points)
            solid.addTriangles(triangles.astype(np.int64))
            solid.endModel()
        return self._solids[part]


def require_free_base(solids: Solids, carried: Carried, table: float | None) -> None:
    """Raise InvalidInputError when what a base carries stands in a box or in another, or a table goes through it."""
    hulls, links = solids.hulls, len(carried.hulls)
    sunk = 0.01  # feet and rounded meshes may reach so far into a table or box [m]
    for i, hull in enumerate(hulls[:links]):
        if not carried.parts[i].own:
            continue  # a leg or another arm may reach below a table in front of the robot
        for k in np.flatnonzero(carried.robots != carried.robots[i]).tolist() if hull.joint == 0 else ():
            depth = -solids.at_rest(i, k) if hulls[k].joint == 0 else 0.0
            if depth > sunk:
                raise InvalidInputError(
                    f"bases: {hull.name!r} is {depth:.3f} m deep in {hulls[k].name!r}; allowed is at most {sunk:g} m. "
                    "Place the robots farther apart"
                )
        low, high = float(hull.corners[:, 2].min()), float(hull.corners[:, 2].max())
        if hull.joint == 0 and table is not None and table > low + sunk:
            raise InvalidInputError(
                f"table: the plane at z = {table:g} m goes through the robot's base or lies above it: {hull.name!r} "
                f"reaches from z = {low:.3f} to {high:.3f} m in the base frame; allowed is at most {low + sunk:.3f} m"
            )
        for k in range(links, len(hulls)) if hull.joint == 0 else ():
            depth = -solids.at_rest(i, k)
            if depth > sunk:
                raise InvalidInputError(
                    f"obstacles: {hulls[k].name!r} holds or cuts the robot's base: {hull.name!r} is {depth:.3f} m deep in "
                    f"it; allowed is at most {sunk:g} m"
                )


def candidates(carried: Carried, obstacles: int, table: bool, disabled: set[frozenset[str]] | None) -> Pairs:
    """All pairs that could be checked, as `Solids` takes them; obstacles come behind the hulls of links."""
    hulls, links, robots = carried.hulls, carried.links, carried.robots
    pairs = []
    for b in range(len(hulls)):
        for a in range(b + 1, len(hulls)):
            strangers = robots[a] != robots[b]
            allowed = disabled is not None and frozenset((links[a], links[b])) in disabled and not strangers
            if not carried.joined[a, b] and not allowed:
                pairs.append((a, b))
    for a, hull in enumerate(hulls):
        if hull.joint:
            pairs += [(a, len(hulls) + box) for box in range(obstacles)] + [(a, TABLE)] * table
    return np.array(pairs, dtype=np.int64).reshape(-1, 2)


def chosen(
    meshes: Meshes, solids: Solids, carried: Carried, asked: Pairs, padding: float
) -> tuple[Chosen, frozenset[str]]:
    """Leave out pairs that meet in nearly all samples of the joint space, or come near in none.

    A pair is never near if it stays farther apart in all samples than 5 mm with at most two coordinates between, whose
    samples are 2° to 4° apart, 2 cm from table or obstacles, and else 10 cm, as samples miss the nearest configuration.
    """
    q = meshes.samples
    links = np.array(((asked >= 0) & (asked < len(carried.hulls))).all(axis=1), dtype=np.bool_)
    near = links & (carried.between[tuple(np.where(links[:, None], asked, 0).T)] <= 2)
    share = np.where(near, 0.25, 1.0)
    limit = padding * share
    reach = limit + np.where(near, 0.005, np.where(links, 0.1, 0.02))
    first = np.ones((FIRST, len(asked)), dtype=np.bool_)
    room = solids.room(q[:FIRST], asked, reach, first)
    never = np.array((room > reach).all(axis=0), dtype=np.bool_)
    never[never] = ~solids.maybe_near(q[FIRST:], asked[never], reach[never]).any(axis=0)
    hits = np.array(room <= np.where(links, 0.0, limit), dtype=np.bool_)
    always = np.asarray(hits.all(axis=0) & ~links)
    for pair in np.flatnonzero(always):
        always[pair] = np.all(solids.distances(q[:FIRST], asked[[pair]], first[:, :1])[0] <= limit[pair])
    _require_way_out(solids, carried, asked[always])
    blocked = always
    always, apart, coarse, full = _by_meshes(meshes, solids, carried, asked, hits & links & ~never)
    always |= blocked
    never |= apart
    kept = ~(always | never | full)
    return Chosen(asked[kept], asked[always], asked[never], asked[full], share[kept]), coarse


def _by_meshes(
    meshes: Meshes, solids: Solids, carried: Carried, asked: Pairs, hits: NDArray[np.bool_]
) -> tuple[NDArray[np.bool_], NDArray[np.bool_], frozenset[str], NDArray[np.bool_]]:
    """Decide about pairs of links whose hulls meet often, by their meshes."""
    coarse = set[str]()
    always, apart, full = (np.zeros(len(asked), dtype=np.bool_) for _ in range(3))
    of_parts: dict[tuple[str, ...], list[int]] = {}
    for pair in np.flatnonzero(hits.any(axis=0)).tolist():
        of_parts.setdefault(tuple(solids.hulls[i].name for i in asked[pair]), []).append(pair)
    for pairs in of_parts.values():
        struck = np.asarray(hits[:, pairs].any(axis=1))
        if struck.mean() <= OFTEN:
            continue
        a, b = asked[pairs[0]].tolist()
        rows = np.flatnonzero(struck)[:128]
        bodies = [(carried.parts[i], solids.hulls[i].joint) for i in (a, b)]
        touching = meshes.touch(rows, *bodies)
        share = float(struck.mean() * touching.mean())
        if share > NEARLY_ALL and struck[0] and touching[0]:
            always[pairs] = True
            continue
        if not touching.any() and carried.between[a, b] <= 2:
            # 2048 samples with two coordinates are 8° apart
            near = np.asarray(solids.maybe_near(meshes.samples[:2048], asked[pairs], 0.0).any(axis=1))
            if not meshes.touch(np.flatnonzero(near), *bodies).any():
                apart[pairs] = True
                continue
        full[pairs] = struck.mean() > NEARLY_ALL
        if struck.mean() - share > OFTEN:
            coarse |= {carried.parts[i].name for i in (a, b)}
    return always, apart, frozenset(coarse), full


def _require_way_out(solids: Solids, carried: Carried, always: Pairs) -> None:
    """Raise InvalidInputError when a link touches a box in all samples, or the last one on a chain the table."""
    for a, b in always.tolist():
        what = f"table: the plane at z = {solids.table:g} m" if b == TABLE else f"obstacles: {solids.hulls[b].name!r}"
        if (b == TABLE and solids.hulls[a].joint in carried.last) or b > a:
            raise InvalidInputError(
                f"{what} leaves {solids.hulls[a].name!r} no way out: it touches it in all of {FIRST} samples of the "
                "joint space"
            )
