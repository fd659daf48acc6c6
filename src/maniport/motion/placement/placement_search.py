"""Placement search: placements are compared by samples, then by planned trajectories, and improved together with them.

Where several arms follow paths that keep together, the costs of the arms are summed. A trajectory is rated by means
over the path, to which a few waypoints out of reach, or only in reach where the arm collides, are next to nothing: on
request the placement is then moved until all waypoints of the whole path are in reach.
"""

from dataclasses import dataclass, replace
from operator import attrgetter

import numpy as np

from maniport.errors import InvalidInputError
from maniport.motion.effort import Effort
from maniport.motion.placement.joint_descent import descend_jointly
from maniport.motion.placement.problem import HEADING, TILT, PlacementGroup
from maniport.motion.plan.optimizer import CLEARANCE, TrajectoryCost, TrajectoryTerms, optimize, time_weights
from maniport.motion.plan.reachability_map import ReachabilityMap
from maniport.motion.plan.roadmap import IN_PLACE, shortest_path
from maniport.util.progress import Part, nobody, pieces
from maniport.util.sobol import sobol
from maniport.util.validation import Array

STAGES = 64  # Waypoints of the trajectories that placements are rated by
SAMPLES = 32  # Samples next to a waypoint that placements are compared by
PLANS = 4  # Placements for which trajectories are planned
SEPARATION = 0.1
"""Smallest mean distance of the paths at these placements [m]; without it, two seeds of six end 30 % worse."""
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
    group: PlacementGroup,
    whole: PlacementGroup | None,
    seed: np.random.Generator,
    planning_effort: Effort,
    progress: Part = nobody,
) -> list[PlannedPlacement]:
    """Search over the free numbers; the placements for which trajectories were planned, the best first."""
    searches = [(group, whole, planning_effort)]
    if group.common.free[TILT]:  # upright placements may fit into the workspace where leaning ones do not
        given = group.common.given.copy()
        given[[TILT, HEADING]] = 0.0
        upright, upright_whole = (
            None if one is None else one.changed(lambda problem: replace(problem, given=given))
            for one in (group, whole)
        )
        assert upright is not None
        more = replace(planning_effort, candidates=4 * planning_effort.candidates)
        searches = [(upright, upright_whole, planning_effort), (group, whole, more)]
    parts = pieces(progress, *[1.0] * len(searches))
    results = [_search(*search, seed, part) for search, part in zip(searches, parts, strict=True)]
    found = [one for some in results for one in some]
    if not found:
        raise InvalidInputError(
            "workspace: the path does not fit into it, at its smallest scale of "
            f"{np.exp(group.common.least[0]):.3g} and whatever else is free"
        )
    first = min(
        (some[0] for some in results if some), key=attrgetter("cost")
    )  # the first of a search has all points in reach
    return [first, *sorted((one for one in found if one is not first), key=attrgetter("cost"))]


def _search(
    group: PlacementGroup,
    reached: PlacementGroup | None,
    planning_effort: Effort,
    seed: np.random.Generator,
    progress: Part,
) -> list[PlannedPlacement]:
    whole = group if reached is None else reached
    coarse = group.thinned(STAGES)
    free = bool(group.common.free.any())
    places = _shortlist(group, seed, planning_effort) if free else _inside(group, group.common.given[None])
    terms = [_terms(coarse.common.time, own, planning_effort) for own in coarse.reachability_maps]
    without_collisions = [replace(one, collisions=None) for one in terms]  # collision checks take most of the time
    progress(0.3)
    found = []
    for place in places:
        planned = _planned(coarse, place, without_collisions, planning_effort, seed)
        if free:
            planned = _improved(coarse, whole, planned, without_collisions)
        found.append(_evaluated(coarse, terms, planned.place, planned.q))
    progress(0.7)
    found.sort(key=attrgetter("cost"))
    if not free or not found:
        return found
    found = [_improved(coarse, whole, placement, terms) for placement in found]
    found.sort(key=attrgetter("cost"))
    progress(1.0)
    if reached is not None and out_of_reach(whole, found[0].place):
        moved = (_moved_into_reach(coarse, whole, one, terms) for one in found)
        found[0] = next((one for one in moved if not out_of_reach(whole, one.place)), found[0])
    return found


def _shortlist(group: PlacementGroup, seed: np.random.Generator, planning_effort: Effort) -> list[Array]:
    """The best of random placements by samples: of all at a few waypoints, then of some at more waypoints."""
    least, most = group.common.least[:4], group.common.most[:4]
    exponent = max(planning_effort.candidates - 1, 1).bit_length()
    unit = sobol(4, exponent, seed)[: planning_effort.candidates]
    places = np.column_stack([least + unit * (most - least), group.centers(planning_effort.candidates, seed)])
    places = _inside(group, np.where(group.common.free, places, group.common.given))
    if not len(places):
        return []
    coarse = group.thinned(8)
    places = places[np.argsort(coarse.costs(places, SAMPLES), kind="stable")[:64]]
    paths = np.concatenate([problem.placed(places)[0] for problem in coarse.problems], axis=1)
    chosen: list[int] = []
    for i in np.argsort(group.thinned(50).costs(places, SAMPLES), kind="stable"):
        distances = np.linalg.norm(paths[chosen] - paths[i], axis=2).mean(axis=1)
        if len(chosen) < PLANS and np.all(distances >= SEPARATION):
            chosen.append(int(i))
    return list(places[chosen])


def _inside(group: PlacementGroup, places: Array) -> Array:
    """Those of the placements that fit into the workspace, shifted and shrunk where free."""
    moved, inside = group.within(places)
    return np.asarray(moved[inside])


def _terms(time: Array, reachability_map: ReachabilityMap, planning_effort: Effort) -> TrajectoryTerms:
    """Cost of trajectories, as means over time."""
    duration = time[-1] - time[0] if len(time) > 1 else 1.0
    weights = time_weights(time) / duration if len(time) > 1 else np.ones(1)
    smoothness = 0.06 / duration, 3e-4 / duration
    return TrajectoryTerms(
        *smoothness, weights, collisions=reachability_map.collisions, rel_tol=planning_effort.rel_tol
    )


def _planned(
    group: PlacementGroup,
    place: Array,
    terms: list[TrajectoryTerms],
    planning_effort: Effort,
    seed: np.random.Generator,
) -> PlannedPlacement:
    """Plan a trajectory of each arm at a placement: roadmap, graph search, optimizer."""
    trajectories = []
    for problem, reachability_map, one in zip(group.problems, group.reachability_maps, terms, strict=True):
        targets = problem.targets(place)
        nodes = reachability_map.nodes(targets, planning_effort.placement_nodes, seed)
        if reachability_map.collisions is not None:
            nodes = nodes.without(reachability_map.collisions.collides(nodes.q))
        largest = np.array([{"rad": 1.0, "m": 0.3}[unit] for unit in problem.objective.arm.joint_units])
        path = shortest_path(nodes, problem.time, np.tile(largest, (len(targets), 1)))
        trajectories.append(optimize(targets, problem.time, nodes.q[path], one, FIRST_WEIGHT))
    return _evaluated(group, terms, place, tuple(trajectories))


def _evaluated(
    group: PlacementGroup, terms: list[TrajectoryTerms], place: Array, q: tuple[Array, ...]
) -> PlannedPlacement:
    cost, distance = 0.0, []
    for problem, one, own in zip(group.problems, q, terms, strict=True):
        targets = problem.targets(place)
        cost += TrajectoryCost(targets.arm, targets, problem.time, own).evaluate(one)[0]
        distance.append(targets.distance(one))
    return PlannedPlacement(place, q, cost, tuple(distance))


def _improved(
    group: PlacementGroup, whole: PlacementGroup, start: PlannedPlacement, terms: list[TrajectoryTerms]
) -> PlannedPlacement:
    """Improve a placement and its trajectories at once."""
    improved = _evaluated(group, terms, *descend_jointly(group, whole, start.place, start.q, terms))
    return min(start, improved, key=attrgetter("cost"))


def _moved_into_reach(
    group: PlacementGroup, whole: PlacementGroup, one: PlannedPlacement, terms: list[TrajectoryTerms]
) -> PlannedPlacement:
    """The nearest placement from which all waypoints of the whole paths are in reach."""
    place = within_reach(whole, one.place)
    trajectories = tuple(
        optimize(problem.targets(place), problem.time, q, own, WEIGHT)
        for problem, q, own in zip(group.problems, one.q, terms, strict=True)
    )
    return _evaluated(group, terms, place, trajectories)


def out_of_reach(group: PlacementGroup, place: Array) -> bool:
    """Whether some arm has no collision-free configuration for some waypoint at a placement (7,)."""
    for problem, reachability_map in zip(group.problems, group.reachability_maps, strict=True):
        targets, near = problem.targets(place), NEAR * reachability_map.spacing
        assert targets.positions is not None
        far = targets[np.linalg.norm(reachability_map.offsets(targets.positions), axis=1) > near]
        if not len(far):
            continue
        nodes = reachability_map.nodes(far, 120, np.random.default_rng(0))
        owner = np.repeat(np.arange(len(far)), np.diff(nodes.first))
        good = np.linalg.norm(far[owner].tip_offset(nodes.q), axis=1) <= IN_PLACE
        if reachability_map.collisions is not None:  # with less clearance, trajectories leave the path
            good[good] = reachability_map.collisions.clearance(nodes.q[good]) >= 0.5 * CLEARANCE
        if len(np.unique(owner[good])) < len(far):
            return True
    return False


def within_reach(group: PlacementGroup, place: Array) -> Array:
    """Move a placement (7,) as little as possible until all waypoints are next to samples, by damped Newton steps."""
    common = group.common
    free, units = common.free, np.array([0.2, 0.3, 0.3, 0.3, 0.1, 0.1, 0.1])[common.free]
    for _ in range(8):
        place = group.within(place[None])[0][0]
        beyond, slopes = _beyond(group, place)
        if not len(beyond):
            break
        matrix = slopes[:, free] * units
        square = matrix.T @ matrix
        damped = square + 0.1 * np.trace(square) * np.eye(len(square))
        # 1.5 times as far, since the samples' neighbors are beyond them
        step = np.linalg.solve(damped, -1.5 * matrix.T @ beyond)
        place[free] = np.clip(place[free] + units * step, common.least[free], common.most[free])
    return np.asarray(group.within(place[None])[0][0])


def _beyond(group: PlacementGroup, place: Array) -> tuple[Array, Array]:
    """How much farther than `NEAR` waypoints are from samples (k,) [m], and derivatives in the placement (k, 7)."""
    beyond, slopes = [], []
    for problem, reachability_map in zip(group.problems, group.reachability_maps, strict=True):
        offset = reachability_map.offsets(problem.placed(place[None])[0][0])
        gap = np.linalg.norm(offset, axis=1)
        near = NEAR * reachability_map.spacing
        far = gap > near
        beyond.append(gap[far] - near)
        slopes.append(-np.einsum("ni,nij->nj", offset[far] / gap[far, None], problem.derivatives(place)[0][far]))
    return np.concatenate(beyond), np.concatenate(slopes)
