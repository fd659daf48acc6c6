"""The search for the place at which an arm can make the target ellipsoids best along a path, judged by plans.

Many places are compared by what the samples of an atlas tell of a few points, some of them by more points. From
different ones among the best motions are planned; the best motions and their places are then improved together.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize
from scipy.stats import qmc

from maniport.bodies.joint_space import _SEED
from maniport.errors import InvalidInputError
from maniport.steps import Part, nobody, pieces
from maniport.tracking.effort import Effort
from maniport.tracking.objective import Targets
from maniport.tracking.placement.journey import HEADING, SCALE, TILT, YAW, Journey, wrapped
from maniport.tracking.plan.atlas import Atlas
from maniport.tracking.plan.refinement import Asked, Smoothness, durations_of, motion_cost, refine
from maniport.tracking.plan.shortest_path import shortest_path
from maniport.validation import Array

UNITS = np.array([0.2, 0.3, 0.3, 0.3, 0.1, 0.1, 0.1])
"""First step of the descent in log scale, angles [rad] and offset [m]."""
COARSE_POINTS, MEDIUM_POINTS = 8, 50
"""By how many points places are compared first and then."""
LEANING = 4
"""So many times more of them where the tilt is free."""
APART = 0.05
"""How far the paths at places from which motions are planned lie apart, in the mean [m]."""
SMOOTHNESS = Smoothness(0.02, 1e-4)
WEIGHTS = (30.0, 200.0)
LARGEST_CHANGE = {"rad": 1.0, "m": 0.3}
"""Between stages, of joints that turn and that slide."""
EQUALLY_GOOD = 1.05
"""Ratio of costs up to which the place with the smaller yaw is taken."""
TURNED_ALIKE = np.radians(15.0)
"""Yaws are told apart in steps of so much."""


@dataclass(frozen=True)
class Planned:
    """A place (7,), a motion through points of the path there, and what both cost."""

    place: Array
    q: Array
    cost: float
    distance: Array


def best_places(
    journey: Journey, atlas: Atlas, seed: np.random.Generator, effort: Effort, tell: Part = nobody
) -> list[Planned]:
    """Search over what is free; the places for which motions were planned, the one to take first.

    Where the tilt is free, upright places are searched by themselves, as they would be without it, and then leaning
    ones among more candidates; the first of these is taken where its motion costs less.

    Raises
    ------
    InvalidInputError
        When nothing that was tried lies in the workspace.
    """
    searches = [(journey, effort)]
    if journey.free[TILT]:
        given = journey.given.copy()
        given[[TILT, HEADING]] = 0.0
        more = replace(effort, candidates=LEANING * effort.candidates)
        searches = [(replace(journey, given=given), effort), (journey, more)]
    tells = pieces(tell, *[1.0] * len(searches))
    each = [
        _searched(one, atlas, seed, much, part) for (one, much), part in zip(searches, tells, strict=True)
    ]  # one may fit into the workspace where the other does not
    found = [one for some in each for one in some]
    if not found:
        raise InvalidInputError(
            "workspace: the path does not fit into it, at its smallest scale of "
            f"{np.exp(journey.least[SCALE]):.3g} and whatever else is free"
        )
    first = min((some[0] for some in each if some), key=_cost)
    return [first, *sorted((one for one in found if one is not first), key=_cost)]


def _searched(journey: Journey, atlas: Atlas, seed: np.random.Generator, effort: Effort, tell: Part) -> list[Planned]:
    """Search over what is free; those for which motions were planned, the one to take first.

    None where nothing that was tried lies in the workspace.
    """
    judge, free = journey.thinned(effort.place_stages).weighing(WEIGHTS[-1]), journey.free.any()
    places = _sieved(journey, atlas, seed, effort) if free else _inside(journey, journey.given[None])
    apart, found, tells = _asked(judge.time, atlas, effort.enough), [], pieces(tell, 3.0, *[1.0] * len(places), 4.0)
    tells[0](1.0)
    for place, one in zip(places, tells[1:-1], strict=True):
        rough = replace(apart, collisions=None)  # what is kept apart takes most of the time
        planned = _planned(judge, atlas, place, rough, effort.place_nodes, seed)
        planned = _improved(judge, journey, planned, rough, effort.tried) if free else planned
        found.append(_judged(judge.targets(planned.place), apart, judge.time, planned.place, planned.q))
        one(1.0)
    found.sort(key=_cost)
    for i in range(min(effort.improved, len(found)) if free else 0):
        # another way may serve the place better now
        again = _planned(judge, atlas, found[i].place, apart, effort.place_nodes, seed)
        found[i] = _improved(judge, journey, min(found[i], again, key=_cost), apart, effort.evaluations)
    found.sort(key=_cost)
    tells[-1](1.0)
    if not found:
        return []
    equal = [one for one in found if one.cost <= EQUALLY_GOOD * found[0].cost]  # the best of them first
    first = min(equal, key=lambda one: abs(wrapped(one.place[YAW])) // TURNED_ALIKE)
    return [first, *(one for one in found if one is not first)]


def _cost(one: Planned) -> float:
    return one.cost


def _sieved(journey: Journey, atlas: Atlas, seed: np.random.Generator, effort: Effort) -> list[Array]:
    """Different places among the best of many by what samples tell, the path turned as little as may be."""
    coarse, medium = journey.thinned(COARSE_POINTS), journey.thinned(MEDIUM_POINTS)
    places = _inside(journey, _candidates(journey, atlas, seed, effort.candidates))
    if not len(places):
        return []
    places = places[np.argsort(coarse.costs(atlas, places, effort.samples), kind="stable")[: effort.sieve]]
    costs = medium.costs(atlas, places, effort.samples)
    order = np.argsort(costs, kind="stable")
    paths = atlas.coordinates(coarse.placed(places)[0])[0]
    chosen: list[int] = []
    for i in order:
        apart = [np.linalg.norm(paths[i] - paths[j], axis=1).mean() for j in chosen]
        if min(apart, default=np.inf) >= APART and len(chosen) < effort.planned:
            chosen.append(int(i))
    # most arms can do as well after a turn about their first axis
    unturned, inside = journey.within(journey.unturned(places[chosen]))
    as_good = inside & (medium.costs(atlas, unturned, effort.samples) <= EQUALLY_GOOD * costs[chosen])
    return list(np.where(as_good[:, None], unturned, places[chosen]))


def _inside(journey: Journey, places: Array) -> Array:
    """Those of the places that are in the workspace, moved and shrunk where they may be."""
    moved, inside = journey.within(places)
    return np.asarray(moved[inside])


def _candidates(journey: Journey, atlas: Atlas, seed: np.random.Generator, count: int) -> Array:
    """Places (count, 7): scales and angles that fill their ranges, centres where the arm's tip may be."""
    unit = qmc.Sobol(4, scramble=True, **{_SEED: seed}).random_base2(max(count - 1, 1).bit_length())[:count]
    least, most = journey.least[:4], journey.most[:4]
    reach = atlas.reach
    offsets = reach[seed.choice(len(reach), count, replace=len(reach) < count)]
    table = np.column_stack([least + unit * (most - least), offsets])
    return np.where(journey.free, table, journey.given)


def _planned(
    journey: Journey, atlas: Atlas, place: Array, asked: Asked, count: int, seed: np.random.Generator
) -> Planned:
    """Plan a motion through all points of a path at one place."""
    targets, arm = journey.targets(place), journey.objective.arm
    nodes = atlas.nodes(targets, count, seed)
    if atlas.collisions is not None:
        nodes = nodes.without(atlas.collisions.collides(nodes.q))
    largest = np.array([LARGEST_CHANGE[unit] for unit in arm.joint_units])
    way = shortest_path(nodes, journey.time, np.tile(largest, (len(targets), 1)))
    return _judged(targets, asked, journey.time, place, refine(targets, journey.time, nodes.q[way], asked, WEIGHTS))


def _asked(time: Array, atlas: Atlas, enough: float) -> Asked:
    """What is asked of motions; their costs are means over time."""
    if len(time) == 1:
        return Asked(SMOOTHNESS, np.ones(1), collisions=atlas.collisions, enough=enough)
    whole = time[-1] - time[0]
    return Asked(SMOOTHNESS.times(1.0 / whole), durations_of(time) / whole, collisions=atlas.collisions, enough=enough)


def _judged(targets: Targets, asked: Asked, time: Array, place: Array, q: Array) -> Planned:
    return Planned(place, q, motion_cost(targets, time, q, asked), targets.distance(q))


def _improved(journey: Journey, whole: Journey, start: Planned, asked: Asked, most: int) -> Planned:
    """Descend in the place and the motion there together, all points of the whole path in its workspace."""
    free, units = journey.free, UNITS[journey.free]
    known = {"best": start}

    def cost(steps: Array) -> tuple[float, Array]:
        place = start.place.copy()
        place[free] += units * steps
        place = whole.within(place[None])[0][0]
        targets = journey.targets(place)
        q = refine(targets, journey.time, known["best"].q, asked, WEIGHTS[-1:])
        one = _judged(targets, asked, journey.time, place, q)
        if one.cost < known["best"].cost:
            known["best"] = one
        return one.cost, units * np.average(journey.slopes(place, q), axis=0, weights=asked.shares)[free]

    bounds = np.stack([journey.least - start.place, journey.most - start.place], axis=1)[free] / units[:, None]
    minimize(
        cost, np.zeros(free.sum()), jac=True, method="L-BFGS-B", bounds=bounds,
        options={"maxfun": most, "ftol": 1e-4, "maxls": 8},
    )  # fmt: skip
    return known["best"]
