"""Which pairs of an arm's links and of what stands around it are to be checked."""

from typing import NamedTuple

import numpy as np

from maniport.bodies.arm import Arm
from maniport.bodies.arms import Arms
from maniport.bodies.collisions.carried import Carried
from maniport.bodies.collisions.solids import TABLE, Pairs, Solids
from maniport.errors import InvalidInputError

SAMPLES = 4096
SEED = 0
"""Postures that tell which pairs always meet, and which never come near."""

NEVER = 0.02
"""A pair that stays farther apart than this in all samples never meets [m]."""

NEVER_ACROSS = 0.1
"""The same of links of two arms, which samples of all their joints bring together more seldom [m]."""

SUNK = 0.01
"""How far the base may reach into a table or box, as feet and rounded meshes do [m]."""


class Chosen(NamedTuple):
    """Pairs to check, and those left out since they always or never meet."""

    pairs: Pairs
    always: Pairs
    never: Pairs


def require_free_base(solids: Solids, carried: Carried, table: float | None) -> None:
    """Raise InvalidInputError when what a base carries stands in a box or in another, or a table goes through it.

    Or lies above it. Boxes come behind the hulls of links.
    """
    hulls, links = solids.hulls, len(carried.hulls)
    for i, hull in enumerate(hulls[:links]):
        for k in np.flatnonzero(carried.own * carried.own[i] < 0).tolist() if hull.joint == 0 else ():
            depth = -solids.at_rest(i, k) if hulls[k].joint == 0 else 0.0
            if depth > SUNK:
                raise InvalidInputError(
                    f"bases: {hull.name!r} is {depth:.3f} m deep in {hulls[k].name!r}; allowed is at most {SUNK:g} m. "
                    "Place the robots farther apart"
                )
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


def candidates(carried: Carried, boxes: int, table: bool, disabled: set[frozenset[str]] | None) -> Pairs:
    """All pairs that could be checked, as `Solids` takes them; boxes come behind the hulls of links."""
    hulls, links = carried.hulls, carried.links
    pairs = []
    for b, low in enumerate(hulls):
        for a in range(b + 1, len(hulls)):
            if hulls[a].joint == low.joint:
                continue
            if disabled is None:
                asked = not carried.held[a, b]
            else:
                strangers = not carried.one and carried.own[a] != carried.own[b]
                asked = strangers or frozenset((links[a], links[b])) not in disabled
            if asked:
                pairs.append((a, b))
    for a, hull in enumerate(hulls):
        if hull.joint:
            pairs += [(a, len(hulls) + box) for box in range(boxes)] + [(a, TABLE)] * table
    return np.array(pairs, dtype=np.int64).reshape(-1, 2)


def chosen(arm: Arm | Arms, solids: Solids, carried: Carried, asked: Pairs, padding: float) -> Chosen:
    """Leave out pairs that meet in all samples of the joint space, or come near in none.

    Raises
    ------
    InvalidInputError
        When a box holds part of a link in all samples, or the table that of the last one.
    """
    q = arm.sample(SAMPLES, SEED)
    far = np.where(carried.across(asked), NEVER_ACROSS, NEVER)
    never = ~solids.maybe_near(q, asked, padding + far).any(axis=0)
    always = np.asarray(solids.maybe_near(q, asked, padding).all(axis=0))
    everywhere = np.ones((len(q), 1), dtype=bool)
    for pair in np.flatnonzero(always):
        always[pair] = np.all(solids.distances(q, asked[[pair]], everywhere)[0] <= padding)
    _require_way_out(solids, carried, asked[always])
    return Chosen(asked[~(always | never)], asked[always], asked[never])


def _require_way_out(solids: Solids, carried: Carried, always: Pairs) -> None:
    """Raise InvalidInputError when a link touches a box in all samples, or the last one on a chain the table."""
    for a, b in always.tolist():
        what = f"table: the plane at z = {solids.table:g} m" if b == TABLE else f"boxes: {solids.hulls[b].name!r}"
        if (b == TABLE and solids.hulls[a].joint in carried.last) or b > a:
            raise InvalidInputError(
                f"{what} leaves {solids.hulls[a].name!r} no way out: it touches it in all of {SAMPLES} samples of the "
                "joint space"
            )
