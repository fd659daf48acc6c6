"""Search of placements: many are compared by samples, then improved together with trajectories, in rounds.

A round starts from the best results of the one before, with more waypoints. Placements that are nearly the same, and
trajectories that are, count once, so that the rounds keep several basins of the cost. The cost is that of the planner's
first optimization, with its time and its smoothness: what the placement gains, the plan keeps.

The improvement is a banded Gauss-Newton descent over trajectory q and placement p. Rotating the path equals rotating
the arm the other way, so the components of p act like joints. With several arms, each has its own q, and the costs
are summed. The normal equations

    [A  B] [q]     [g]
    [Bᵀ C] [p] = − [h],

are solved for the placement first, (C − Bᵀ A⁻¹ B) p = Bᵀ A⁻¹ g − h, where A is banded.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from maniport.errors import InvalidInputError
from maniport.motion.placement.cost import PlacedMotions, PlacementCost
from maniport.motion.placement.placement import SCALE, TILT, PlacementProblem
from maniport.motion.plan.optimizer import TrajectoryTerms
from maniport.motion.plan.plan_options import PlacementRound, SearchBudget
from maniport.motion.plan.roadmap import LARGEST_CHANGE, Roadmap, shortest_path
from maniport.util.progress import ReportFraction, ignore_fraction
from maniport.util.sobol import sobol
from maniport.util.validation import Array

SAMPLES = 64  # Samples next to a waypoint that placements are compared by; with 16, force ellipsoids are 10 % farther
NODES = 32  # Of these samples, those from which a first trajectory is made
SHORT = 16.0
"""Largest duration for which the waypoints of the rounds suffice, on the planning time scale [s]."""
SEPARATION = 0.05  # Smallest mean distance of the paths of two placements that are improved [m]
BRANCH = 0.7  # Change of a joint that makes another branch of configurations [rad or m]
SAME_MOTION = (
    0.2  # Largest change of a joint between trajectories that count as the same [rad or m]
)


@dataclass(frozen=True)
class PlacementSolution:
    """A placement with trajectories of the arms through some waypoints there."""

    place: Array  # (7,)
    q: tuple[Array, ...]  # (m, dof) of each arm
    cost: float
    distance: tuple[Array, ...]  # (m,) of each arm


def best_placements(
    problem: PlacementProblem,
    terms: TrajectoryTerms,
    joint_motion_weight: float,
    budget: SearchBudget,
    seed: np.random.Generator,
    progress: ReportFraction = ignore_fraction,
) -> list[PlacementSolution]:
    """Search the free components; return placements with trajectories, best first."""
    rounds = rounds_of(budget, problem.duration)
    if problem.free.any():
        places = candidates(problem, budget.candidates, rounds[0], seed)
    else:
        places = problem.inside(problem.fixed[None])
    if not len(places):
        raise InvalidInputError(
            "workspace: the path does not fit into it, at its smallest scale of "
            f"{np.exp(problem.lower[SCALE]):.3g} and whatever else is free"
        )
    progress(0.3)
    motions = first_motions(problem.thinned(rounds[0].waypoints), places, joint_motion_weight)
    for i, placement_round in enumerate(rounds):
        progress(0.4 + 0.6 * i / len(rounds))
        motions = motions.only(distinct(problem, motions, placement_round.kept))
        avoiding = i == len(rounds) - 1
        cost = PlacementCost(
            problem.thinned(placement_round.waypoints),
            terms,
            placement_round.position_weight,
            avoiding=avoiding,
        )
        motions = cost.improved(motions.at_waypoints(cost.problem.time), placement_round.steps)
    progress(1.0)
    distances = cost.distances(motions)
    placed = []
    for i in np.argsort(motions.cost, kind="stable"):
        trajectories = tuple(q[i] for q in motions.q)
        of_arms = tuple(distance[i] for distance in distances)
        cost_of_motion = float(motions.cost[i])
        placed.append(PlacementSolution(motions.places[i], trajectories, cost_of_motion, of_arms))
    return placed


def rounds_of(budget: SearchBudget, duration: float) -> list[PlacementRound]:
    """Return the rounds, with more waypoints for a long duration [s] on the planning time scale."""
    factor = float(np.clip(np.sqrt(duration / SHORT), 1.0, 3.0))
    rounds = []
    for each in budget.rounds:
        rounds.append(each._replace(waypoints=round(factor * each.waypoints)))
    return rounds


def candidates(
    problem: PlacementProblem, count: int, first: PlacementRound, seed: np.random.Generator
) -> Array:
    """Return the best placements (k, 7) by samples of the arms, whose paths differ."""
    tilted = bool(problem.free[TILT])
    if tilted:
        count *= 5
    lower = problem.lower[:4]
    upper = problem.upper[:4]
    unit = sobol(4, max(count - 1, 1).bit_length(), seed)[:count]
    centers = np.zeros((count, 3))
    for arm in problem.arms:
        reached = arm.reachability_map.reach
        rows = seed.choice(len(reached), count, replace=len(reached) < count)
        centers += reached[rows] / len(problem.arms)
    places = np.column_stack([lower + unit * (upper - lower), centers])
    if tilted:  # upright placements may fit into the workspace where tilted ones do not
        places[::5, TILT] = 0.0
    places = problem.inside(np.where(problem.free, places, problem.fixed))
    if not len(places):
        return places

    coarse = problem.thinned(first.waypoints)
    places = places[np.argsort(coarse.costs(places, SAMPLES), kind="stable")]
    return places[separate(coarse.outlines(places), first.kept // 2, SEPARATION)]


def separate(points: Array, most: int, distance: float) -> list[int]:
    """Return the first of the point sequences (k, n, 3) that are this far from one another in the mean [m]."""
    chosen: list[int] = []
    for i, sequence in enumerate(points):
        gaps = np.linalg.norm(points[chosen] - sequence, axis=2).mean(axis=1)
        if np.all(gaps >= distance):
            chosen.append(i)
        if len(chosen) == most:
            break
    return chosen


def first_motions(
    problem: PlacementProblem, places: Array, joint_motion_weight: float
) -> PlacedMotions:
    """Join samples of the arms to two trajectories at each placement (k, 7), in different branches."""
    trajectories = []
    for arm in problem.arms:
        count = len(places)
        waypoints = len(problem.time)
        q, cost = arm.reachability_map.starts(arm.problem(places), SAMPLES, NODES)
        q = q.reshape(count, waypoints, *q.shape[1:])
        cost = cost.reshape(count, waypoints, -1)
        largest = np.array([LARGEST_CHANGE[unit] for unit in arm.arm.joint_units])
        largest = np.tile(largest, (waypoints, 1))
        joined = []
        for i in range(count):
            first = joined_nodes(q[i], cost[i], problem.time, largest, joint_motion_weight)
            near = np.abs(q[i] - first[:, None]).max(axis=2) < BRANCH
            elsewhere = np.where(near, np.inf, cost[i])
            second = joined_nodes(q[i], elsewhere, problem.time, largest, joint_motion_weight)
            joined += [first, second]
        trajectories.append(np.stack(joined))
    repeated = np.repeat(places, 2, axis=0)
    unknown = np.full(len(repeated), np.nan)
    return PlacedMotions(problem.time, repeated, tuple(trajectories), unknown)


def joined_nodes(
    q: Array, cost: Array, time: Array, largest: Array, joint_motion_weight: float
) -> Array:
    """Return the best sequence (n, dof) of one of the nodes (n, k, dof) of each waypoint."""
    allowed = np.isfinite(cost)
    allowed[~allowed.any(axis=1)] = True
    cost = np.where(np.isfinite(cost), cost, 0.0)
    first = np.concatenate([[0], np.cumsum(allowed.sum(axis=1))])
    nodes = Roadmap(q[allowed], cost[allowed], first)
    return nodes.q[shortest_path(nodes, time, largest, joint_motion_weight)]


def distinct(problem: PlacementProblem, motions: PlacedMotions, most: int) -> NDArray[np.intp]:
    """Return the best motions, at most so many; of those that are the same but for the first joint, the best one."""
    shapes = []
    for arm, q in zip(problem.arms, motions.q, strict=True):
        turned = q.copy()
        if arm.reachability_map.axis is not None and len(problem.arms) == 1:
            turned[:, :, 0] -= turned[:, :, :1].mean(axis=1)
        shapes.append(turned)
    joined = np.concatenate(shapes, axis=2)
    chosen: list[int] = []
    for i in np.argsort(motions.cost, kind="stable"):
        changes = np.abs(joined[chosen] - joined[i]).max(axis=(1, 2))
        if np.all(changes > SAME_MOTION):
            chosen.append(int(i))
        if len(chosen) == most:
            break
    return np.array(chosen, dtype=np.intp)
