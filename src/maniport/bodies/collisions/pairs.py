"""Which pairs of an arm's links and of what stands around it are to be checked."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from maniport.bodies.arm import Arm
from maniport.bodies.collisions.hulls import Hull
from maniport.bodies.collisions.solids import TABLE, Pairs, Solids
from maniport.errors import InvalidInputError

LINKS_APART = 3
"""Links nearer to one another on the chain are not checked without an SRDF: joints hold them apart."""

SAMPLES = 4096
SEED = 0
"""Postures that tell which pairs always meet, and which never come near."""

NEVER = 0.02
"""A pair that stays farther apart than this in all samples never meets [m]."""

SUNK = 0.01
"""How far the base may reach into a table or box, as feet and rounded meshes do [m]."""


class Chosen(NamedTuple):
    """Pairs to check, and those left out since they always or never meet."""

    pairs: Pairs
    always: Pairs
    never: Pairs


def require_free_base(solids: Solids, links: int, table: float | None) -> None:
    """Raise InvalidInputError when what the base carries stands in a box, or a table goes through it or lies above.

    Boxes come behind the hulls of links.
    """
    hulls = solids.hulls
    for i, hull in enumerate(hulls[:links]):
        low, high = float(hull.corners[:, 2].min()), float(hull.corners[:, 2].max())
        if hull.joint == 0 and table is not None and table > low + SUNK:
            raise InvalidInputError(
                f"table: the plane at z = {table:g} m goes through the robot's base or lies above it: {hull.name!r} "
                f"reaches from z = {low:.3f} to {high:.3f} m in the base frame; allowed is at most {low + SUNK:.3f} m"
            )
        for k in range(links, len(hulls)) if hull.joint == 0 else ():
            depth = -solids.at_rest(i, k)
            if depth > SUNK:
                raise InvalidInputError(
                    f"boxes: {hulls[k].name!r} holds or cuts the robot's base: {hull.name!r} is {depth:.3f} m deep in "
                    f"it; allowed is at most {SUNK:g} m"
                )


def candidates(hulls: Sequence[Hull], boxes: int, table: bool, disabled: set[frozenset[str]] | None) -> Pairs:
    """All pairs that could be checked, as `Solids` takes them; boxes come behind the hulls of links."""
    ranks = _ranks(hulls)
    pairs = []
    for b, low in enumerate(hulls):
        for a in range(b + 1, len(hulls)):
            if hulls[a].joint == low.joint:
                continue
            if disabled is None:
                asked = ranks[a] - ranks[b] >= LINKS_APART
            else:
                asked = frozenset((hulls[a].name, low.name)) not in disabled
            if asked:
                pairs.append((a, b))
    for a, hull in enumerate(hulls):
        if hull.joint:
            pairs += [(a, len(hulls) + box) for box in range(boxes)] + [(a, TABLE)] * table
    return np.array(pairs, dtype=np.int64).reshape(-1, 2)


def _ranks(hulls: Sequence[Hull]) -> list[int]:
    """Where links are on the chain: one further for each joint that carries a link, and for one fixed to another."""
    joints = sorted({hull.joint for hull in hulls})
    first = {hull.joint: hull.name for hull in reversed(hulls)}
    return [joints.index(hull.joint) + (hull.name != first[hull.joint]) for hull in hulls]


def chosen(arm: Arm, solids: Solids, asked: Pairs, padding: float) -> Chosen:
    """Leave out pairs that meet in all samples of the joint space, or come near in none.

    Raises
    ------
    InvalidInputError
        When a box holds part of a link in all samples, or the table that of the last one.
    """
    q = arm.sample(SAMPLES, SEED)
    never = ~solids.maybe_near(q, asked, padding + NEVER).any(axis=0)
    always = np.asarray(solids.maybe_near(q, asked, padding).all(axis=0))
    everywhere = np.ones((len(q), 1), dtype=bool)
    for pair in np.flatnonzero(always):
        always[pair] = np.all(solids.distances(q, asked[[pair]], everywhere)[0] <= padding)
    _require_way_out(solids, asked[always])
    return Chosen(asked[~(always | never)], asked[always], asked[never])


def _require_way_out(solids: Solids, always: Pairs) -> None:
    """Raise InvalidInputError when a link touches a box in all samples, or the last one on the chain the table."""
    last = max((hull.joint for hull in solids.hulls), default=0)
    for a, b in always.tolist():
        what = f"table: the plane at z = {solids.table:g} m" if b == TABLE else f"boxes: {solids.hulls[b].name!r}"
        if (b == TABLE and solids.hulls[a].joint == last) or (b != TABLE and b > a):
            raise InvalidInputError(
                f"{what} leaves {solids.hulls[a].name!r} no way out: it touches it in all of {SAMPLES} samples of the "
                "joint space"
            )
