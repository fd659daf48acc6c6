"""Where in an arm's workspace a path lets the arm make the target ellipsoids best."""

from collections.abc import Sequence
from typing import Any, overload

import numpy as np
from numpy.typing import ArrayLike

from maniport.arms import VELOCITY, Arm, ArmGroup, EllipsoidSpec
from maniport.errors import InvalidInputError
from maniport.motion.effort import FULL, as_effort
from maniport.motion.objective import Damping, Objective
from maniport.motion.placement.arguments import as_workspace, given_place, problems_of, require_reach, table_height
from maniport.motion.placement.placed_path import Place, Placement
from maniport.motion.placement.placement_search import WEIGHT, best_placements
from maniport.motion.placement.problem import (
    HEADING,
    OFFSET,
    SCALE,
    TILT,
    YAW,
    PlacementGroup,
    PlacementProblem,
    base_rotations,
    wrapped,
)
from maniport.motion.plan.planner import interpolated
from maniport.motion.plan.reachability_map import ReachabilityMap
from maniport.motion.schedule import of_each
from maniport.motion.search.descent import PointwiseBest, pointwise_best
from maniport.motion.search.seed_bank import SeedBank
from maniport.util.defaults import DAMPING
from maniport.util.progress import Progress, Step, between, pieces
from maniport.util.subsample import evenly_spaced
from maniport.util.validation import Array, as_count, as_generator, as_metres


@overload
def place_path(path: ArrayLike, profile: ArrayLike, arm: Arm, **options: Any) -> Placement: ...


@overload
def place_path(
    path: Sequence[ArrayLike], profile: Sequence[ArrayLike], arm: ArmGroup | Sequence[Arm], **options: Any
) -> tuple[Placement, ...]: ...


def place_path(  # type: ignore[misc]
    path: Any,
    profile: Any,
    arm: Any,
    *,
    time: ArrayLike | None = None,
    turn: ArrayLike | None = None,
    scale: float | tuple[float, float] | None = None,
    yaw: float | None = None,
    tilt: float | str | None = None,
    offset: Sequence[float | None] | ArrayLike | None = None,
    workspace: Sequence[Sequence[float | None]] | None = None,
    whole: Any = None,
    spec: EllipsoidSpec = VELOCITY,
    damping: Damping = DAMPING,
    collisions: Any = None,
    reachability_map: Any = None,
    bank: Any = None,
    planning_effort: str = FULL,
    rank: int = 1,
    random_state: Any = 0,
    progress: Progress | None = None,
) -> Placement | tuple[Placement, ...]:
    """Find scale, yaw, offset and, on request, a tilt of the base with which an arm comes nearest to target ellipsoids.

    Most of the remaining distance depends on the placement. Thousands of placements are compared by samples of the arm;
    for the best ones trajectories are planned through some waypoints of the path, and placement and trajectory are
    improved together. The ellipsoids turn with the path, as if the whole task were done in another direction in front
    of the robot.

    The paths of several arms, such as those of both hands, keep their relation: they are scaled, rotated and moved
    together, about the mean of all their waypoints. The costs of the arms are summed; collisions between them are not
    checked.

    Parameters
    ----------
    path : array_like, shape (n, 3)
        Hand positions of the demonstrator in its base frame [m].
    profile : array_like, shape (n, d, d)
        Target ellipsoids of the arm, one for each waypoint, as an adapter returns them.
    arm : Arm, ArmGroup or sequence of Arm
        With several arms `path`, `profile`, `whole`, `collisions`, `reachability_map` and `bank` are sequences with one
        value for each arm.
    time : array_like, shape (n,), optional
        Times of the waypoints [s], which weigh them. Default: all count alike.
    turn : array_like, shape (3, 3), optional
        Rotation that the adapter turned the ellipsoids by, and the path is yet to be turned by. Default: the identity.
    scale : float or (float, float), optional
        Factor of the path's size, or the range to search. Default: from 0.5 to 2.
    yaw : float, optional
        Rotation about the vertical [rad]. Default: free.
    tilt : float or "free", optional
        Lean of the base, to the best side [rad]; "free" is upright where leaning gains nothing. Default: upright.
    offset : sequence of three floats, optional
        Position of the path's center in the arm's base frame [m]; None leaves a coordinate free. Default: free.
    workspace : three pairs of floats, optional
        Bounds of the path ``((x0, x1), (y0, y1), (z0, z1))`` in the base frame [m]; None or ±inf: open.
    whole : array_like, shape (m, 3), optional
        All waypoints of a path that has only some: the arm then reaches each of them without collision, if possible.
    spec, damping, bank, progress
        As in `maniport.motion.nearest_feasible`; the bank serves the pointwise optimum.
    collisions : Collisions or bool, optional
        Collision model of planned trajectories; True: self-collisions. The path stays above a table.
    reachability_map : maniport.motion.ReachabilityMap, optional
        Reachability map of this arm and these ellipsoids. Default: a new one (0.4 s).
    effort : str
        Planning effort, as in `maniport.motion.PlanControl`.
    rank : int
        Which of the `candidates` to take, from 1; only the first is made to reach all of `whole`.
    random_state : optional
        Random seed.

    Returns
    -------
    Placement or tuple of Placement
        With several arms one for each, with the same scale, rotation and offset.

    Raises
    ------
    NotSPDError
        When an ellipsoid is asymmetric or, with the damping, not positive-definite.
    InvalidInputError
        When a value is wrong, the arm reaches nothing in the workspace, the path does not fit, or `rank` is too high.
    """
    generator, budget, chosen = as_generator(random_state), as_effort(planning_effort), as_count(rank, "rank") - 1
    several = isinstance(arm, ArmGroup | Sequence)
    arms: Sequence[Arm] = tuple(getattr(arm, "arms", arm)) if several else (arm,)
    arguments = {
        "path": path, "profile": profile, "whole": whole, "collisions": collisions,
        "reachability_map": reachability_map, "bank": bank,
    }  # fmt: skip
    paths, profiles, wholes, models, maps, banks = (
        of_each(value, name, len(arms)) if several else (value,) for name, value in arguments.items()
    )
    objectives = [Objective.of(own, spec, damping, WEIGHT) for own in arms]
    given = given_place(scale, yaw, tilt, offset)
    bounds = as_workspace(workspace)
    step = Step(progress, "Place path")
    banks = [SeedBank.given_or_built(own, arms[i], spec, generator) for i, own in enumerate(banks)]
    maps = [
        ReachabilityMap(own, spec, random_state=generator, collisions=model) if samples is None else samples
        for own, model, samples in zip(arms, models, maps, strict=True)
    ]
    for own, samples in zip(arms, maps, strict=True):
        samples.require_fits(own, spec)
    bounds[0, 2] = max(bounds[0, 2], *(table_height(samples.collisions, given[0]) for samples in maps))
    for samples in maps:
        require_reach(samples, bounds)
    problems, center, rotation = problems_of(objectives, paths, profiles, time, turn, given, bounds)
    group = PlacementGroup(problems, tuple(maps))
    reached = None
    if whole is not None:
        reached = group.with_paths([(as_metres(points, "whole") - center) @ rotation.T for points in wholes])
    found = best_placements(group, reached, generator, budget, between(step, 0.1, 0.85))
    if chosen >= len(found):
        raise InvalidInputError(f"rank must be at most {len(found)}, as many as places were found; found {rank}")
    best, placed, parts = found[chosen], [], pieces(between(step, 0.85, 1.0), *[1.0] * len(arms))
    for i, (problem, own, part) in enumerate(zip(problems, banks, parts, strict=True)):
        candidates = tuple(_named(other.place, other.distance[i]) for other in found)
        known = interpolated(evenly_spaced(len(problem.path), len(best.q[i])), best.q[i], np.arange(len(problem.path)))
        targets = problem.targets(best.place)
        optimum = pointwise_best(targets, own.starts_for(targets, budget.pointwise_starts), known, part)
        placed.append(_placed_path(problem, best.place, optimum, center, rotation, candidates))
    medians = ", ".join(f"{np.median(own.distance):.2f}" for own in placed)
    step.end(f"scale {placed[0].scale:.2f}, pointwise optimum {medians}")
    return tuple(placed) if several else placed[0]


def _placed_path(
    problem: PlacementProblem,
    place: Array,
    best: PointwiseBest,
    center: Array,
    rotation: Array,
    candidates: tuple[Place, ...],
) -> Placement:
    positions, profile = (values[0] for values in problem.placed(place[None]))
    named, error = _named(place, best.distance), best.position_error
    assert error is not None
    return Placement(
        path=positions,
        profile=profile,
        spec=problem.objective.spec,
        scale=named.scale,
        yaw=named.yaw,
        tilt=named.tilt,
        heading=named.heading,
        mount=base_rotations(place[None])[0],
        offset=named.offset,
        centre=center,
        turn=rotation,
        distance=best.distance,
        position_error=error,
        reachable=error <= 1e-3,
        joint_positions=best.joint_positions,
        candidates=candidates,
    )


def _named(place: Array, distance: Array) -> Place:
    """A placement (7,) by its numbers, with the distances of a trajectory there."""
    scale, yaw, heading = float(np.exp(place[SCALE])), float(wrapped(place[YAW])), float(wrapped(place[HEADING]))
    tilt = float(place[TILT])
    return Place(scale, yaw, tilt, heading if tilt else 0.0, place[OFFSET], distance)
