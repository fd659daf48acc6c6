"""Where in an arm's workspace a path lets the arm make the target ellipsoids best."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from maniport.arms import VELOCITY, Arm, EllipsoidSpec
from maniport.arms.collisions import Collisions
from maniport.errors import InvalidInputError
from maniport.motion.effort import FULL, as_effort
from maniport.motion.objective import Damping, Objective
from maniport.motion.placement.arguments import as_workspace, given_place, problems_of, require_reach, table_height
from maniport.motion.placement.placed_path import Place, Placement
from maniport.motion.placement.placement_search import best_placements
from maniport.motion.placement.problem import (
    HEADING,
    OFFSET,
    SCALE,
    TILT,
    YAW,
    PlacementGroup,
    PlacementProblem,
    base_rotations,
    with_paths,
    wrapped,
)
from maniport.motion.plan.reachability_map import ReachabilityMap
from maniport.motion.search.pointwise import pointwise_best
from maniport.motion.search.seed_bank import SeedBank
from maniport.util.defaults import DAMPING
from maniport.util.progress import Part, Progress, Step, between, pieces
from maniport.util.validation import Array, as_count, as_generator, as_metres


def place_path(
    path: ArrayLike,
    profile: ArrayLike,
    arm: Arm,
    *,
    time: ArrayLike | None = None,
    turn: ArrayLike | None = None,
    scale: float | tuple[float, float] | None = None,
    yaw: float | None = None,
    tilt: float | str | None = None,
    offset: Sequence[float | None] | ArrayLike | None = None,
    workspace: Sequence[Sequence[float | None]] | None = None,
    whole: ArrayLike | None = None,
    spec: EllipsoidSpec = VELOCITY,
    damping: Damping = DAMPING,
    collisions: Collisions | bool | None = None,
    reachability_map: ReachabilityMap | None = None,
    bank: SeedBank | None = None,
    planning_effort: str = FULL,
    rank: int = 1,
    random_state: Any = 0,
    progress: Progress | None = None,
) -> Placement:
    """Find scale, yaw, offset and, on request, a tilt of the base with which an arm comes nearest to target ellipsoids.

    Most of the remaining distance depends on the placement. Thousands of placements are compared by samples of the arm;
    for the best ones trajectories are planned through some waypoints of the path, and placement and trajectory are
    improved together. The ellipsoids turn with the path, as if the whole task were done in another direction in front
    of the robot.

    Parameters
    ----------
    path : array_like, shape (n, 3)
        Hand positions of the demonstrator in its base frame [m].
    profile : array_like, shape (n, d, d)
        Target ellipsoids of the arm, one for each waypoint, as an adapter returns them.
    arm : Arm
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

    Raises
    ------
    NotSPDError
        When an ellipsoid is asymmetric or, with the damping, not positive-definite.
    InvalidInputError
        When a value is wrong, the arm reaches nothing in the workspace, the path does not fit, or `rank` is too high.
    """
    return place_paths(
        (path,), (profile,), (arm,), wholes=None if whole is None else (whole,), collisions=(collisions,),
        reachability_maps=(reachability_map,), banks=(bank,), time=time, turn=turn, scale=scale, yaw=yaw, tilt=tilt,
        offset=offset, workspace=workspace, spec=spec, damping=damping, planning_effort=planning_effort, rank=rank,
        random_state=random_state, progress=progress,
    )[0]  # fmt: skip


def place_paths(
    paths: Sequence[ArrayLike],
    profiles: Sequence[ArrayLike],
    arms: Sequence[Arm],
    *,
    time: ArrayLike | None = None,
    turn: ArrayLike | None = None,
    scale: float | tuple[float, float] | None = None,
    yaw: float | None = None,
    tilt: float | str | None = None,
    offset: Sequence[float | None] | ArrayLike | None = None,
    workspace: Sequence[Sequence[float | None]] | None = None,
    wholes: Sequence[ArrayLike] | None = None,
    spec: EllipsoidSpec = VELOCITY,
    damping: Damping = DAMPING,
    collisions: Sequence[Collisions | bool | None] | None = None,
    reachability_maps: Sequence[ReachabilityMap | None] | None = None,
    banks: Sequence[SeedBank | None] | None = None,
    planning_effort: str = FULL,
    rank: int = 1,
    random_state: Any = 0,
    progress: Progress | None = None,
) -> tuple[Placement, ...]:
    """Find one placement for the paths of several arms, such as those of both hands, which keep their relation.

    As `place_path` for one arm. All paths are scaled, turned and moved alike, about the mean of all their waypoints;
    the costs of the arms are summed. Collisions between the arms are not checked.

    Parameters
    ----------
    paths : sequence of array_like, shape (n, 3)
        Hand positions in one frame, one path for each arm [m].
    profiles : sequence of array_like, shape (n, d, d)
        Target ellipsoids along each.
    arms : sequence of Arm
        In one frame, such as those of `maniport.load_arms`.
    wholes, collisions, reachability_maps, banks : sequence, optional
        One for each arm, as `whole`, `collisions`, `reachability_map` and `bank` of `place_path`.
    time, turn, scale, yaw, tilt, offset, workspace, spec, damping, effort, rank, random_state, progress
        As in `place_path`; all for all arms.

    Returns
    -------
    tuple of Placement
        One for each arm, with the same scale, turn and offset; errors are those of `place_path`.
    """
    generator, budget, count = as_generator(random_state), as_effort(planning_effort), len(arms)
    chosen = as_count(rank, "rank") - 1
    _require_each(count, paths=paths, profiles=profiles, wholes=wholes, collisions=collisions)
    _require_each(count, reachability_maps=reachability_maps, banks=banks)
    objectives = [Objective.of(arm, spec, damping) for arm in arms]
    given = given_place(scale, yaw, tilt, offset)
    bounds = as_workspace(workspace)
    step = Step(progress, "Place path")
    seeds = [SeedBank.given_or_built(banks[i] if banks else None, arm, spec, generator) for i, arm in enumerate(arms)]
    maps = _maps(arms, spec, generator, reachability_maps, collisions)
    bounds[0, 2] = max(
        bounds[0, 2], *(table_height(reachability_map.collisions, given[0]) for reachability_map in maps)
    )
    for reachability_map in maps:
        require_reach(reachability_map, bounds)
    problems, center, rotation = problems_of(objectives, paths, profiles, time, turn, given, bounds)
    group = PlacementGroup(problems, tuple(maps))
    whole = None
    if wholes is not None:
        whole = with_paths(group, tuple((as_metres(one, "whole") - center) @ rotation.T for one in wholes))
    found = best_placements(group, whole, generator, budget, between(step, 0.1, 0.85))
    if chosen >= len(found):
        raise InvalidInputError(f"rank must be at most {len(found)}, as many as places were found; found {rank}")
    best, placed, parts = found[chosen], [], pieces(between(step, 0.85, 1.0), *[1.0] * count)
    for i, (problem, bank, part) in enumerate(zip(problems, seeds, parts, strict=True)):
        candidates = tuple(_named(one.place, one.distance[i]) for one in found)
        placement = best.place, center, rotation, candidates
        placed.append(_placed_path(problem, best.q[i], placement, bank, budget.pointwise_starts, part))
    medians = ", ".join(f"{np.median(one.distance):.2f}" for one in placed)
    step.end(f"scale {placed[0].scale:.2f}, pointwise optimum {medians}")
    return tuple(placed)


def _maps(
    arms: Sequence[Arm],
    spec: EllipsoidSpec,
    generator: np.random.Generator,
    reachability_maps: Sequence[ReachabilityMap | None] | None,
    collisions: Sequence[Collisions | bool | None] | None,
) -> list[ReachabilityMap]:
    """Reachability maps of the arms, as far as given, else new ones."""
    maps = []
    for i, arm in enumerate(arms):
        reachability_map, model = (
            reachability_maps[i] if reachability_maps else None,
            collisions[i] if collisions else None,
        )
        maps.append(
            ReachabilityMap(arm, spec, random_state=generator, collisions=model)
            if reachability_map is None
            else reachability_map
        )
        maps[i].require_fits(arm, spec)
    return maps


def _require_each(count: int, **sequences: Sequence[Any] | None) -> None:
    """Require one of each for each arm, where it is given at all."""
    for name, given in sequences.items():
        if given is not None and len(given) != count:
            raise InvalidInputError(f"{name} must be {count}, one for each arm; found {len(given)}")


def _placed_path(
    problem: PlacementProblem,
    q: Array,
    placement: tuple[Array, Array, Array, tuple[Place, ...]],
    bank: SeedBank,
    starts: int,
    progress: Part,
) -> Placement:
    """Search the pointwise optimum at a placement, also from a trajectory (m, dof) through some waypoints."""
    place, center, rotation, candidates = placement
    positions, profile = (values[0] for values in problem.placed(place[None]))
    rows = problem.rows(len(q))
    known = np.stack([np.interp(np.arange(len(positions)), rows, column) for column in q.T], axis=1)
    best = pointwise_best(problem.targets(place), bank, known, starts, progress)
    error = best.position_error
    assert error is not None
    named = _named(place, best.distance)
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
