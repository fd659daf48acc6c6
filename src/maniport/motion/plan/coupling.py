"""Several arms with one motion: optimized together where they share joints or costs, or come near one another."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from maniport.arms import ArmGroup
from maniport.motion.plan.arm_planner import ArmPlanner
from maniport.motion.plan.optimizer import (
    CLEARANCE,
    CLEARANCE_WEIGHT,
    POSITION_WEIGHTS,
    TrajectoryCost,
    optimize,
    optimize_to_tolerance,
)
from maniport.motion.plan.plan_control import PlanControl
from maniport.motion.plan.refinement import coarse_terms, joint_motion_weight, planning_time, time_parameterized
from maniport.motion.plan.roadmap import shortest_path, stages_of
from maniport.motion.plan.time_parameterization import Timed, retime
from maniport.motion.problem import MotionProblem
from maniport.motion.trajectory import interpolated
from maniport.util.validation import Array


def coupled_motion(
    arms: Sequence[ArmPlanner],
    problem: MotionProblem,
    parts: Sequence[Array],
    settings: PlanControl,
    random: np.random.Generator,
) -> tuple[Timed, bool]:
    """Join the motions of all arms, shapes (n, dof of the arm); return one motion, and whether it was optimized.

    Where the result collides, motions of prioritized planning are further starts, then the tolerance is relaxed.
    """
    group: ArmGroup = problem.limits.arm
    starts, collisions = _initial_motions(group, parts), problem.collisions
    near = collisions is not None and collisions.between.known
    near = near and bool(np.any(collisions.between.clearance(starts[0]) < CLEARANCE))  # type: ignore[union-attr]
    if not (group.shared or problem.costs or near):
        earliest = 1.0 / settings.speed_scale * (problem.time - problem.time[0])
        return retime(problem.limits, earliest, starts[0], rate=settings.rate), False
    time = planning_time(problem, settings)
    terms = coarse_terms(problem, time, settings)
    optimized: list[Array] = []

    def attempts() -> Iterator[tuple[float, list[Array]]]:
        """Factors of the position tolerance, and further starts."""
        yield 1.0, starts
        has_paths = all(own.positions is not None for own in problem.targets)
        if has_paths and not group.shared and collisions is not None:
            yield 1.0, _prioritized(arms, problem, time, parts, random)
        yield 3.0, []
        yield np.inf, []

    for relaxation, more in attempts():
        tolerance = relaxation * settings.position_tolerance
        optimized += [optimize(problem, time, q, terms, POSITION_WEIGHTS[0]) for q in more]
        best = min(optimized, key=lambda q: TrajectoryCost(problem.arm, problem, time, terms).evaluate(q)[0])
        q, _ = optimize_to_tolerance(problem, time, best, terms, tolerance)
        _, timed = time_parameterized(problem, q, settings, tolerance)
        if collisions is None or not collisions.collides(timed.positions).any():
            break
    return timed, True


def _initial_motions(group: ArmGroup, parts: Sequence[Array]) -> list[Array]:
    """Configurations (n, dof) of all arms from those of each; shared joints are their mean, or those of one arm."""
    values = np.full((len(parts), len(parts[0]), group.dof), np.nan)
    for part, columns, own in zip(parts, group.columns, values, strict=True):
        own[:, columns] = part
    mean = np.nanmean(values, axis=0)
    return [mean, *(np.where(np.isnan(own), mean, own) for own in values)] if group.shared else [mean]


def _prioritized(
    arms: Sequence[ArmPlanner],
    problem: MotionProblem,
    time: Array,
    parts: Sequence[Array],
    random: np.random.Generator,
) -> list[Array]:
    """Motions (n, dof) by prioritized planning, in which each arm in turn is the first to avoid the others."""
    group, motions = problem.limits.arm, []
    for first in reversed(range(len(parts))):
        own = list(parts)
        for i in (first, *(k for k in range(len(parts)) if k != first)):
            own[i] = _avoiding(arms[i], problem, i, time, own, random)
        motions.append(group.joined(*own))
    return motions


def _avoiding(
    arm: ArmPlanner, problem: MotionProblem, i: int, time: Array, parts: Sequence[Array], random: np.random.Generator
) -> Array:
    """Motion of arm i through a roadmap whose nodes cost more near the other arms, which keep their motions."""
    group, collisions, rows = problem.limits.arm, problem.collisions, stages_of(time, 0.55)
    assert collisions is not None
    nodes = arm.reachability_map.nodes(problem.targets[i][rows], 150, random)
    q = np.empty((len(nodes.q), group.dof))
    for part, columns in zip(parts, group.columns, strict=True):
        q[:, columns] = np.repeat(part[rows], np.diff(nodes.first), axis=0)
    q[:, group.columns[i]] = nodes.q
    cost = nodes.cost.copy()
    near, distance, _ = collisions.between.gradient(q, CLEARANCE)
    np.add.at(cost, near, (CLEARANCE_WEIGHT * (CLEARANCE - distance)) ** 2)
    if arm.collisions is not None:
        cost += 1e4 * arm.collisions.collides(nodes.q)
    weight, largest = joint_motion_weight(time), arm.largest_changes(time[rows])
    chosen = shortest_path(replace(nodes, cost=cost), time[rows], largest, weight)
    return interpolated(time[rows], nodes.q[chosen], time)
