"""Placement search: placements are compared by samples, then by planned trajectories, and improved together with them.

Where several arms follow paths that keep together, the costs of the arms are summed. Costs are means over the
path, which hardly depend on a few waypoints out of reach. On request the placement is therefore moved until all
waypoints of the whole path are in reach without collision.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from operator import attrgetter

import numpy as np

from maniport.errors import InvalidInputError
from maniport.motion.effort import Effort
from maniport.motion.placement.joint_descent import descend_jointly
from maniport.motion.placement.problem import HEADING, SCALE, TILT, PlacementProblem
from maniport.motion.plan.optimizer import CLEARANCE, TrajectoryCost, TrajectoryTerms, optimize, time_weights
from maniport.motion.plan.reachability_map import ReachabilityMap
from maniport.motion.plan.roadmap import IN_PLACE, shortest_path
from maniport.util.progress import Part, nobody, pieces
from maniport.util.sobol import sobol
from maniport.util.validation import Array

SAMPLES = 16  # Samples next to a waypoint that placements are compared by
PLANS = 4  # Placements for which trajectories are planned
SEPARATION = 0.1
"""Smallest mean distance of the paths at these placements [m]; without it, two seeds of six end 30 % worse."""
IMPROVED = 2  # Placements that are improved with collisions, which take most of the time
ROUGH = 1e-3  # Smallest relative decrease of the cost for another step without collisions
NEAR = 7.0  # Multiple of the distance between samples within which an arm mostly reaches a position from a sample
FIRST_WEIGHT, WEIGHT = 30.0, 200.0
"""Weights of the position error, of a first trajectory and of the cost of a placement [1/m]."""


@dataclass(frozen=True)
class PlannedPlacement:
    """A placement with trajectories of the arms there."""

    place: Array  # (7,)
    q: tuple[Array, ...]  # (n, dof) of each arm
    cost: float
    distance: tuple[Array, ...]  # (n,) of each arm


def best_placements(
    problem: PlacementProblem, reach_all: bool, seed: np.random.Generator, effort: Effort, progress: Part = nobody
) -> list[PlannedPlacement]:
    """Search over the free numbers; the placements for which trajectories were planned, the best first.

    `reach_all`: the first one is moved until all waypoints are in reach, if possible.
    """
    searches = [(problem, effort)]
    if problem.free[TILT]:  # upright placements may fit into the workspace where leaning ones do not
        fixed = problem.fixed.copy()
        fixed[[TILT, HEADING]] = 0.0
        more = replace(effort, candidates=4 * effort.candidates)
        searches = [(replace(problem, fixed=fixed), effort), (problem, more)]
    parts = pieces(progress, *[1.0] * len(searches))
    results = [_search(*search, reach_all, seed, part) for search, part in zip(searches, parts, strict=True)]
    if not any(results):
        raise InvalidInputError(
            "workspace: the path does not fit into it, at its smallest scale of "
            f"{np.exp(problem.lower[SCALE]):.3g} and whatever else is free"
        )
    by_cost = attrgetter("cost")
    first = min((result[0] for result in results if result), key=by_cost)  # the first of a search reaches all waypoints
    others = (placement for result in results for placement in result if placement is not first)
    return [first, *sorted(others, key=by_cost)]


def _search(
    problem: PlacementProblem,
    effort: Effort,
    reach_all: bool,
    seed: np.random.Generator,
    progress: Part,
    waypoints: int = 64,
) -> list[PlannedPlacement]:
    """Plan trajectories through some waypoints for the best placements, and improve both."""
    coarse, free = problem.thinned(waypoints), bool(problem.free.any())
    places = _shortlist(problem, seed, effort) if free else _inside(problem, problem.fixed[None])
    terms = [_terms(coarse.time, arm.reachability_map, effort) for arm in coarse.arms]
    rough = [replace(own, collisions=None, rel_tol=ROUGH) for own in terms]
    progress(0.3)
    placements = []
    for place in places:
        planned = _planned(coarse, place, rough, effort, seed)
        if free:
            planned = _improved(coarse, planned, rough)
        placements.append(_evaluated(coarse, terms, planned.place, planned.q))
    progress(0.7)
    placements.sort(key=attrgetter("cost"))
    if not free or not placements:
        return placements
    placements[:IMPROVED] = [_improved(coarse, placement, terms) for placement in placements[:IMPROVED]]
    placements.sort(key=attrgetter("cost"))
    progress(1.0)
    if reach_all and out_of_reach(problem, placements[0].place):
        moved = (_moved_into_reach(coarse, placement, terms) for placement in placements)
        placements[0] = next((one for one in moved if not out_of_reach(problem, one.place)), placements[0])
    return placements


def _shortlist(problem: PlacementProblem, seed: np.random.Generator, effort: Effort) -> list[Array]:
    """The best of random placements by samples: of all at a few waypoints, then of some at more waypoints."""
    count, lower, upper = effort.candidates, problem.lower[:4], problem.upper[:4]
    unit = sobol(4, max(count - 1, 1).bit_length(), seed)[:count]
    reached = [arm.reachability_map.reach for arm in problem.arms]
    centers = np.mean([reach[seed.choice(len(reach), count, replace=len(reach) < count)] for reach in reached], axis=0)
    places = np.column_stack([lower + unit * (upper - lower), centers])
    places = _inside(problem, np.where(problem.free, places, problem.fixed))
    if not len(places):
        return []
    coarse = problem.thinned(8)
    places = places[np.argsort(coarse.costs(places, SAMPLES), kind="stable")[:64]]
    paths = np.concatenate([arm.placed(places)[0] for arm in coarse.arms], axis=1)
    chosen: list[int] = []
    for i in np.argsort(problem.thinned(50).costs(places, SAMPLES), kind="stable"):
        distances = np.linalg.norm(paths[chosen] - paths[i], axis=2).mean(axis=1)
        if len(chosen) < PLANS and np.all(distances >= SEPARATION):
            chosen.append(int(i))
    return list(places[chosen])


def _inside(problem: PlacementProblem, places: Array) -> Array:
    """Those of the placements that fit into the workspace, shifted and shrunk where free."""
    moved, inside = problem.within(places)
    return np.asarray(moved[inside])


def _terms(time: Array, reachability_map: ReachabilityMap, effort: Effort) -> TrajectoryTerms:
    """Cost of trajectories, as means over time."""
    duration = time[-1] - time[0] if len(time) > 1 else 1.0
    weights = time_weights(time) / duration if len(time) > 1 else np.ones(1)
    return TrajectoryTerms(
        0.06 / duration, 3e-4 / duration, weights, collisions=reachability_map.collisions, rel_tol=effort.rel_tol
    )


def _planned(
    problem: PlacementProblem,
    place: Array,
    terms: Sequence[TrajectoryTerms],
    effort: Effort,
    seed: np.random.Generator,
) -> PlannedPlacement:
    """Plan a trajectory of each arm at a placement: roadmap, graph search, optimizer."""
    trajectories = []
    for arm, own in zip(problem.arms, terms, strict=True):
        targets = arm.targets(place)
        nodes = arm.reachability_map.nodes(targets, effort.placement_nodes, seed)
        if arm.reachability_map.collisions is not None:
            nodes = nodes.without(arm.reachability_map.collisions.collides(nodes.q))
        largest = np.array([{"rad": 1.0, "m": 0.3}[unit] for unit in arm.objective.arm.joint_units])
        path = shortest_path(nodes, problem.time, np.tile(largest, (len(targets), 1)))
        trajectories.append(optimize(targets, problem.time, nodes.q[path], own, FIRST_WEIGHT))
    return _evaluated(problem, terms, place, tuple(trajectories))


def _evaluated(
    problem: PlacementProblem, terms: Sequence[TrajectoryTerms], place: Array, trajectories: tuple[Array, ...]
) -> PlannedPlacement:
    cost, distance = 0.0, []
    for arm, q, own in zip(problem.arms, trajectories, terms, strict=True):
        targets = arm.targets(place)
        cost += TrajectoryCost(targets.arm, targets, problem.time, own).evaluate(q)[0]
        distance.append(targets.distance(q))
    return PlannedPlacement(place, trajectories, cost, tuple(distance))


def _improved(problem: PlacementProblem, start: PlannedPlacement, terms: Sequence[TrajectoryTerms]) -> PlannedPlacement:
    """Improve a placement and its trajectories at once."""
    improved = _evaluated(problem, terms, *descend_jointly(problem, start.place, start.q, terms))
    return min(start, improved, key=attrgetter("cost"))


def _moved_into_reach(
    problem: PlacementProblem, start: PlannedPlacement, terms: Sequence[TrajectoryTerms]
) -> PlannedPlacement:
    """The nearest placement from which all waypoints are in reach."""
    place = within_reach(problem, start.place)
    trajectories = tuple(
        optimize(arm.targets(place), problem.time, q, own, WEIGHT)
        for arm, q, own in zip(problem.arms, start.q, terms, strict=True)
    )
    return _evaluated(problem, terms, place, trajectories)


def out_of_reach(problem: PlacementProblem, place: Array) -> bool:
    """Whether some arm has no collision-free configuration for some waypoint at a placement (7,)."""
    for arm in problem.whole:
        samples, targets = arm.reachability_map, arm.targets(place)
        assert targets.positions is not None
        far = targets[np.linalg.norm(samples.offsets(targets.positions), axis=1) > NEAR * samples.spacing]
        if not len(far):
            continue
        nodes = samples.nodes(far, 120, np.random.default_rng(0))
        owner = np.repeat(np.arange(len(far)), np.diff(nodes.first))
        good = np.linalg.norm(far[owner].tip_offset(nodes.q), axis=1) <= IN_PLACE
        if samples.collisions is not None:  # with less clearance, trajectories leave the path
            good[good] = samples.collisions.clearance(nodes.q[good]) >= 0.5 * CLEARANCE
        if len(np.unique(owner[good])) < len(far):
            return True
    return False


def within_reach(problem: PlacementProblem, place: Array) -> Array:
    """Move a placement (7,) as little as possible until all waypoints are next to samples, by damped Newton steps."""
    free, units = problem.free, np.array([0.2, 0.3, 0.3, 0.3, 0.1, 0.1, 0.1])[problem.free]
    for _ in range(8):
        place = problem.within(place[None])[0][0]
        beyond, slopes = _beyond(problem, place)
        if not len(beyond):
            break
        matrix = slopes[:, free] * units
        square = matrix.T @ matrix
        damped = square + 0.1 * np.trace(square) * np.eye(len(square))
        # 1.5 times as far, since the samples' neighbors are beyond them
        step = np.linalg.solve(damped, -1.5 * matrix.T @ beyond)
        place[free] = np.clip(place[free] + units * step, problem.lower[free], problem.upper[free])
    return np.asarray(problem.within(place[None])[0][0])


def _beyond(problem: PlacementProblem, place: Array) -> tuple[Array, Array]:
    """How much farther than `NEAR` waypoints are from samples (k,) [m], and derivatives in the placement (k, 7)."""
    beyond, slopes = [], []
    for arm in problem.whole:
        offset = arm.reachability_map.offsets(arm.placed(place[None])[0][0])
        gap, near = np.linalg.norm(offset, axis=1), NEAR * arm.reachability_map.spacing
        far = gap > near
        beyond.append(gap[far] - near)
        slopes.append(-np.einsum("ni,nij->nj", offset[far] / gap[far, None], arm.derivatives(place)[0][far]))
    return np.concatenate(beyond), np.concatenate(slopes)
