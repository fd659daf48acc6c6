"""Several arms with one motion: optimized together where they share joints or costs, or come near one another."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from maniport.motion.effort import Effort
from maniport.motion.plan.optimizer import (
    CLEARANCE,
    CLEARANCE_WEIGHT,
    POSITION_WEIGHTS,
    TrajectoryCost,
    optimize,
    optimize_to_tolerance,
)
from maniport.motion.plan.planner import (
    PLANNING_TIME_SCALE,
    Planner,
    coarse_terms,
    interpolated,
    smoothness,
    stages_of,
    time_parameterized,
)
from maniport.motion.plan.roadmap import JOINT_MOTION_WEIGHT, shortest_path
from maniport.motion.plan.time_parameterization import Timed, retime
from maniport.motion.problem import MotionProblem
from maniport.util.validation import Array


def coupled_motion(
    planner: Planner,
    problem: MotionProblem,
    parts: Sequence[Array],
    speed_scale: float,
    tolerance: float,
    rate: float,
    effort: Effort,
    random: np.random.Generator,
) -> tuple[Timed, bool]:
    """Join the motions of all arms, shapes (n, dof of the arm); return one motion, and whether it was optimized.

    Where the result collides, motions of prioritized planning are further starts, then the tolerance is relaxed.
    """
    starts, collisions = initial_motions(planner, parts), problem.collisions
    near = collisions is not None and collisions.between.known
    near = near and bool(np.any(collisions.between.clearance(starts[0]) < CLEARANCE))  # type: ignore[union-attr]
    if not (planner.group.shared or problem.costs or near):
        return retime(problem.limits, 1.0 / speed_scale * (problem.time - problem.time[0]), starts[0], rate=rate), False
    time = max(1.0 / speed_scale, PLANNING_TIME_SCALE) * (problem.time - problem.time[0])
    terms = coarse_terms(problem, time, effort)
    optimized: list[Array] = []

    def attempts() -> Iterator[tuple[float, list[Array]]]:
        """Factors of the position tolerance, and further starts."""
        yield 1.0, starts
        has_paths = all(own.positions is not None for own in problem.targets)
        if has_paths and not planner.group.shared and collisions is not None:
            yield 1.0, prioritized(planner, problem, time, parts, random)
        yield 3.0, []
        yield np.inf, []

    for relaxation, more in attempts():
        optimized += [optimize(problem, time, q, terms, POSITION_WEIGHTS[0]) for q in more]
        best = min(optimized, key=lambda q: TrajectoryCost(problem.arm, problem, time, terms).evaluate(q)[0])
        q, _ = optimize_to_tolerance(problem, time, best, terms, relaxation * tolerance)
        _, timed = time_parameterized(problem, speed_scale, q, relaxation * tolerance, rate, effort)
        if collisions is None or not collisions.collides(timed.positions).any():
            break
    return timed, True


def initial_motions(planner: Planner, parts: Sequence[Array]) -> list[Array]:
    """Configurations (n, dof) of all arms from those of each; shared joints are their mean, or those of one arm."""
    group = planner.group
    values = np.full((len(parts), len(parts[0]), group.dof), np.nan)
    for part, columns, own in zip(parts, group.columns, values, strict=True):
        own[:, columns] = part
    mean = np.nanmean(values, axis=0)
    if not group.shared:
        return [mean]
    return [mean, *(np.where(np.isnan(own), mean, own) for own in values)]


def prioritized(
    planner: Planner, problem: MotionProblem, time: Array, parts: Sequence[Array], random: np.random.Generator
) -> list[Array]:
    """Motions (n, dof) by prioritized planning, in which each arm in turn is the first to avoid the others."""
    motions = []
    for first in reversed(range(len(parts))):
        own = list(parts)
        for i in (first, *(k for k in range(len(parts)) if k != first)):
            own[i] = _avoiding(planner, problem, i, time, own, random)
        motions.append(planner.group.joined(*own))
    return motions


def _avoiding(
    planner: Planner,
    problem: MotionProblem,
    i: int,
    time: Array,
    parts: Sequence[Array],
    random: np.random.Generator,
) -> Array:
    """Motion of one arm through a roadmap whose nodes cost more near the other arms, which keep their motions."""
    own, columns, collisions = planner.arms[i], planner.group.columns, problem.collisions
    assert collisions is not None
    rows = stages_of(time, 0.55)
    nodes = own.reachability_map.nodes(problem.targets[i][rows], 150, random)
    q = np.empty((len(nodes.q), planner.group.dof))
    for part, at in zip(parts, columns, strict=True):
        q[:, at] = np.repeat(part[rows], np.diff(nodes.first), axis=0)
    q[:, columns[i]] = nodes.q
    cost = nodes.cost.copy()
    near, distance, _ = collisions.between.gradient(q, CLEARANCE)
    np.add.at(cost, near, (CLEARANCE_WEIGHT * (CLEARANCE - distance)) ** 2)
    if own.collisions is not None:
        cost += 1e4 * own.collisions.collides(nodes.q)
    weight, largest = smoothness(time) * JOINT_MOTION_WEIGHT, own.largest_changes(time[rows])
    chosen = shortest_path(replace(nodes, cost=cost), time[rows], largest, weight)
    return interpolated(time[rows], nodes.q[chosen], time)
