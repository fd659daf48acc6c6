"""The search for the place at which an arm can make the target ellipsoids best along a path, judged by plans.

Many places are compared by what the samples of an atlas tell of a few points, some of them by more points. From
different ones among the best motions are planned; the best motions and their places are then improved together. Where
several arms follow paths that keep together, what a place costs them is summed.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize
from scipy.stats import qmc

from maniport.bodies.joint_space import _SEED
from maniport.errors import InvalidInputError
from maniport.steps import Part, nobody, pieces
from maniport.tracking.effort import Effort
from maniport.tracking.placement.journey import HEADING, SCALE, TILT, YAW, wrapped
from maniport.tracking.placement.reach import out_of_reach, price, within_reach
from maniport.tracking.placement.sides import Sides
from maniport.tracking.placement.together import improved_together
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
    """A place (7,), motions of the arms through points of their paths there, their distances, and what all cost."""

    place: Array
    q: tuple[Array, ...]
    cost: float
    distance: tuple[Array, ...]


def best_places(
    sides: Sides, whole: Sides | None, seed: np.random.Generator, effort: Effort, tell: Part = nobody
) -> list[Planned]:
    """Search over what is free; the places for which motions were planned, the one to take first."""
    searches = [(sides, whole, effort)]
    if sides.common.free[TILT]:
        given = sides.common.given.copy()
        given[[TILT, HEADING]] = 0.0
        more = replace(effort, candidates=LEANING * effort.candidates)
        upright = sides.changed(lambda one: replace(one, given=given))
        all_upright = None if whole is None else whole.changed(lambda one: replace(one, given=given))
        searches = [(upright, all_upright, effort), (sides, whole, more)]
    tells = pieces(tell, *[1.0] * len(searches))
    each = [
        _searched(some, every, seed, much, part) for (some, every, much), part in zip(searches, tells, strict=True)
    ]  # one may fit into the workspace where the other does not
    found = [one for some in each for one in some]
    if not found:
        raise InvalidInputError(
            "workspace: the path does not fit into it, at its smallest scale of "
            f"{np.exp(sides.common.least[SCALE]):.3g} and whatever else is free"
        )
    first = min((some[0] for some in each if some), key=_cost)
    return [first, *sorted((one for one in found if one is not first), key=_cost)]


def _searched(
    sides: Sides, reached: Sides | None, seed: np.random.Generator, effort: Effort, tell: Part
) -> list[Planned]:
    """Search over what is free; those for which motions were planned, the one to take first."""
    whole = sides if reached is None else reached
    judge = sides.thinned(effort.place_stages).changed(lambda one: one.weighing(WEIGHTS[-1]))
    free = sides.common.free.any()
    places = _sieved(sides, seed, effort) if free else _inside(sides, sides.common.given[None])
    apart = [_asked(judge.common.time, atlas, effort.enough) for atlas in judge.atlases]
    rough = [replace(asked, collisions=None) for asked in apart]  # what is kept apart takes most of the time
    found, tells = [], pieces(tell, 3.0, *[1.0] * len(places), 4.0)
    tells[0](1.0)
    for place, one in zip(places, tells[1:-1], strict=True):
        planned = _planned(judge, place, rough, effort, seed)
        if free and effort.together:
            planned = _together(judge, whole, planned, rough)
        elif free:
            planned = _improved(judge, whole, planned, rough, effort.tried)
        found.append(_judged(judge, apart, planned.place, planned.q))
        one(1.0)
    found.sort(key=_cost)
    for i in range(min(effort.improved, len(found)) if free else 0):
        # another way may serve the place better now
        again = _planned(judge, found[i].place, apart, effort, seed)
        found[i] = _improved(judge, whole, min(found[i], again, key=_cost), apart, effort.evaluations)
    found.sort(key=_cost)
    tells[-1](1.0)
    if not found:
        return []
    equal = [one for one in found if one.cost <= EQUALLY_GOOD * found[0].cost]  # the best of them first
    first = min(equal, key=lambda one: abs(wrapped(one.place[YAW])) // TURNED_ALIKE)
    every = [first, *(one for one in found if one is not first)]
    if free and reached is not None and out_of_reach(whole, first.place):
        return [_in_reach(judge, whole, every, apart, effort.evaluations), *every[1:]]
    return every


def _in_reach(sides: Sides, whole: Sides, found: list[Planned], asked: list[Asked], most: int) -> Planned:
    """The best from which no point of the whole paths is out of reach, all moved for that; if none is, the first."""
    moved = [one if not out_of_reach(whole, one.place) else _moved(sides, whole, one, asked) for one in found]
    least = min(moved, key=_cost)
    again = _improved(sides, whole, least, asked, most, True)
    return next((one for one in (again, least) if not out_of_reach(whole, one.place)), found[0])


def _cost(one: Planned) -> float:
    return one.cost


def _sieved(sides: Sides, seed: np.random.Generator, effort: Effort) -> list[Array]:
    """Different places among the best of many by what samples tell, the paths turned as little as may be."""
    coarse, medium = sides.thinned(COARSE_POINTS), sides.thinned(MEDIUM_POINTS)
    places = _inside(sides, _candidates(sides, seed, effort.candidates))
    if not len(places):
        return []
    places = places[np.argsort(coarse.costs(places, effort.samples), kind="stable")[: effort.sieve]]
    costs = medium.costs(places, effort.samples)
    order = np.argsort(costs, kind="stable")
    paths = coarse.coordinates(places)
    chosen: list[int] = []
    for i in order:
        apart = [np.mean([np.linalg.norm(path[i] - path[j], axis=1).mean() for path in paths]) for j in chosen]
        if min(apart, default=np.inf) >= APART and len(chosen) < effort.planned:
            chosen.append(int(i))
    # most arms can do as well after a turn about their first axis
    unturned, inside = sides.within(sides.common.unturned(places[chosen]))
    as_good = inside & (medium.costs(unturned, effort.samples) <= EQUALLY_GOOD * costs[chosen])
    return list(np.where(as_good[:, None], unturned, places[chosen]))


def _inside(sides: Sides, places: Array) -> Array:
    """Those of the places that are in the workspace, moved and shrunk where they may be."""
    moved, inside = sides.within(places)
    return np.asarray(moved[inside])


def _candidates(sides: Sides, seed: np.random.Generator, count: int) -> Array:
    """Places (count, 7): scales and angles that fill their ranges, centres where the arms' tips may be."""
    unit = qmc.Sobol(4, scramble=True, **{_SEED: seed}).random_base2(max(count - 1, 1).bit_length())[:count]
    least, most = sides.common.least[:4], sides.common.most[:4]
    table = np.column_stack([least + unit * (most - least), sides.centres(count, seed)])
    return np.where(sides.common.free, table, sides.common.given)


def _planned(sides: Sides, place: Array, asked: list[Asked], effort: Effort, seed: np.random.Generator) -> Planned:
    """Plan a motion of each arm through all points of its path at one place."""
    found = []
    for journey, atlas, one in zip(sides.journeys, sides.atlases, asked, strict=True):
        targets, arm = journey.targets(place), journey.objective.arm
        nodes = atlas.nodes(targets, effort.place_nodes, seed)
        if atlas.collisions is not None:
            nodes = nodes.without(atlas.collisions.collides(nodes.q))
        largest = np.array([LARGEST_CHANGE[unit] for unit in arm.joint_units])
        way = shortest_path(nodes, journey.time, np.tile(largest, (len(targets), 1)))
        found.append(refine(targets, journey.time, nodes.q[way], one, WEIGHTS[: effort.weights]))
    return _judged(sides, asked, place, tuple(found))


def _asked(time: Array, atlas: Atlas, enough: float) -> Asked:
    """What is asked of motions; their costs are means over time."""
    if len(time) == 1:
        return Asked(SMOOTHNESS, np.ones(1), collisions=atlas.collisions, enough=enough)
    whole = time[-1] - time[0]
    return Asked(SMOOTHNESS.times(1.0 / whole), durations_of(time) / whole, collisions=atlas.collisions, enough=enough)


def _judged(sides: Sides, asked: list[Asked], place: Array, q: tuple[Array, ...]) -> Planned:
    targets, time = [one.targets(place) for one in sides.journeys], sides.common.time
    costs = [motion_cost(one, time, each, much) for one, each, much in zip(targets, q, asked, strict=True)]
    distance = tuple(one.distance(each) for one, each in zip(targets, q, strict=True))
    return Planned(place, q, sum(costs), distance)


def _together(sides: Sides, whole: Sides, start: Planned, asked: list[Asked]) -> Planned:
    """Descend in the place and the motions there at once."""
    return min(start, _judged(sides, asked, *improved_together(sides, whole, start.place, start.q, asked)), key=_cost)


def _moved(sides: Sides, whole: Sides, one: Planned, asked: list[Asked]) -> Planned:
    """The same at the place next to its own from which all points are in reach."""
    place = within_reach(whole, one.place, UNITS)
    return _judged(sides, asked, place, _refined(sides, place, one.q, asked))


def _refined(sides: Sides, place: Array, q: tuple[Array, ...], asked: list[Asked]) -> tuple[Array, ...]:
    """Motions at another place than that which q (n, dof) were found for."""
    return tuple(
        refine(one.targets(place), sides.common.time, before, much, WEIGHTS[-1:])
        for one, before, much in zip(sides.journeys, q, asked, strict=True)
    )


def _improved(
    sides: Sides, whole: Sides, start: Planned, asked: list[Asked], most: int, reaching: bool = False
) -> Planned:
    """Descend in the place, the motions there anew at each step, all points of the whole paths in their workspace."""
    common = sides.common
    free, units = common.free, UNITS[common.free]
    known, least = {"best": start}, {"cost": start.cost + (price(whole, start.place)[0] if reaching else 0.0)}

    def cost(steps: Array) -> tuple[float, Array]:
        place = start.place.copy()
        place[free] += units * steps
        place = whole.within(place[None])[0][0]
        found = _judged(sides, asked, place, _refined(sides, place, known["best"].q, asked))
        beyond, slope = price(whole, place) if reaching else (0.0, 0.0)
        if found.cost + beyond < least["cost"]:
            known["best"], least["cost"] = found, found.cost + beyond
        slopes = [
            np.average(one.slopes(place, each), axis=0, weights=much.shares)
            for one, each, much in zip(sides.journeys, found.q, asked, strict=True)
        ]
        return found.cost + beyond, units * (np.sum(slopes, axis=0) + slope)[free]

    bounds = np.stack([common.least - start.place, common.most - start.place], axis=1)[free] / units[:, None]
    minimize(
        cost, np.zeros(free.sum()), jac=True, method="L-BFGS-B", bounds=bounds,
        options={"maxfun": most, "ftol": 1e-4, "maxls": 8},
    )  # fmt: skip
    return known["best"]
