"""Placement of hand paths relative to robot arms that minimizes the distance to target ellipsoids."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from maniport.arms import VELOCITY, Arm, ArmGroup, EllipsoidSpec
from maniport.errors import InvalidInputError
from maniport.motion.arm_model import require_compatible
from maniport.motion.demands import Demand
from maniport.motion.placement.placement import (
    HEADING,
    OFFSET,
    SCALE,
    SIZE,
    TILT,
    YAW,
    ArmPath,
    Place,
    Placement,
    PlacementProblem,
    base_rotations,
)
from maniport.motion.placement.search import WEIGHT, best_placements
from maniport.motion.plan.plan_settings import PlanSettings
from maniport.motion.plan.reachability_map import ReachabilityMap
from maniport.motion.problem import CostWeights
from maniport.motion.search import bank_for, pointwise_best
from maniport.motion.targets import (
    Damping,
    TargetTrajectory,
    checked_ellipsoids,
    damping_of,
    of_each,
)
from maniport.motion.trajectory import interpolated
from maniport.spd.regularization import Regularization
from maniport.util.defaults import DAMPING
from maniport.util.progress import Progress, Step, between, pieces
from maniport.util.sampling import evenly_spaced
from maniport.util.validation import (
    Array,
    as_choice,
    as_count,
    as_finite,
    as_generator,
    as_metres,
    as_number,
    as_rotation,
    as_times,
    require_shape,
)


def place_path(
    path: Any,
    profile: Any,
    arm: Any,
    *,
    time: ArrayLike | None = None,
    demands: Any = None,
    map_rotation: ArrayLike | None = None,
    scale: float | tuple[float, float] | None = None,
    yaw: float | None = None,
    tilt: float | str | None = None,
    offset: Sequence[float | None] | ArrayLike | None = None,
    workspace: Sequence[Sequence[float | None]] | Array | None = None,
    spec: EllipsoidSpec = VELOCITY,
    damping: Damping = DAMPING,
    collisions: Any = None,
    reachability_map: Any = None,
    bank: Any = None,
    rank: int = 1,
    random_state: Any = 0,
    progress: Progress | None = None,
) -> Any:
    """Find the scale, yaw, offset and optional tilt that minimize the distance to target ellipsoids.

    Thousands of placements are compared by samples of the arm; for the best ones trajectories are planned through some
    waypoints, and placement and trajectory are improved together. The ellipsoids rotate with the path.

    The paths of several arms keep their relation: they are scaled, rotated and moved together, about the mean of all
    their waypoints. The costs of the arms are summed; collisions between them are not checked.

    Parameters
    ----------
    path : array_like, shape (n, 3)
        Hand positions of the demonstrator in its base frame [m].
    profile : array_like, shape (n, d, d)
        Target ellipsoids of the arm, one for each waypoint, as an adapter returns them.
    arm : Arm, ArmGroup or sequence of Arm
        With several arms `path`, `profile`, `demands`, `collisions`, `reachability_map` and `bank` are
        sequences with one value for each arm.
    time : array_like, shape (n,), optional
        Times of the waypoints [s], which weigh them. Default: equal weights.
    demands : sequence of (EllipsoidSpec, ndarray of shape (n, 3)), optional
        Vectors that are rotated and scaled with the path, which the arm's ellipsoids should contain, such as those of
        `maniport.motion.demands.demands_of`.
    map_rotation : array_like, shape (3, 3), optional
        Rotation of the ellipsoids by the adapter, to be applied to the path. Default: the identity.
    scale : float or (float, float), optional
        Factor of the path's size, or the range to search. Default: from 0.5 to 2.
    yaw : float, optional
        Rotation about the vertical [rad]. Default: free.
    tilt : float or "free", optional
        Tilt of the base toward the best heading [rad]; "free" searches it. Default: upright.
    offset : sequence of three floats, optional
        Position of the path's center in the arm's base frame [m]; None leaves a coordinate free. Default: free.
    workspace : three pairs of floats, optional
        Bounds of the path ``((x0, x1), (y0, y1), (z0, z1))`` in the base frame [m]; None or ±inf: open.
    spec, damping, bank, progress
        As in `maniport.motion.nearest_feasible`; the bank serves the pointwise optimum.
    collisions : Collisions or bool, optional
        Collision model of planned trajectories; True: self-collisions. The path stays above a table.
    reachability_map : optional
        Of this arm and these ellipsoids, such as ``planner.arms[0].reachability_map``. Default: a new one (0.4 s).
    rank, random_state : int
        Rank of the returned placement among the `candidates`, from 1; random seed.

    Returns
    -------
    Placement or tuple of Placement
        With several arms one for each, with the same scale, rotation and offset.

    Raises
    ------
    InvalidInputError, NotSPDError
        When a value is wrong, an ellipsoid is asymmetric or, with the damping, not positive-definite, the arm reaches
        nothing in the workspace, the path does not fit, or `rank` is too high.
    """
    generator, budget, chosen = (
        as_generator(random_state),
        PlanSettings.budget,
        as_count(rank, "rank") - 1,
    )
    several = isinstance(arm, ArmGroup | Sequence)
    arms: Sequence[Arm] = tuple(getattr(arm, "arms", arm)) if several else (arm,)
    arguments = {
        "path": path, "profile": profile, "collisions": collisions, "reachability_map": reachability_map, "bank": bank,
        "demands": demands,
    }  # fmt: skip
    paths, profiles, models, maps, banks, demanded = (
        of_each(value, name, arm) for name, value in arguments.items()
    )
    fixed, lower, upper = fixed_place(scale, yaw, tilt, offset)
    bounds = as_workspace(workspace)
    step = Step(progress, "Place path")
    banks = [bank_for(arms[i], spec, own, generator) for i, own in enumerate(banks)]
    maps = [
        ReachabilityMap(own, spec, random_state=generator, collisions=model)
        if samples is None
        else samples
        for own, model, samples in zip(arms, models, maps, strict=True)
    ]
    for own, samples in zip(arms, maps, strict=True):
        require_compatible(
            "the reachability_map was built for", (samples.arm, own), (samples.spec, spec)
        )
    _require_reach(maps, bounds, upright=bool(fixed[TILT] == 0.0))
    rotation = np.eye(3) if map_rotation is None else as_rotation(map_rotation, "map_rotation", 3)
    dampings = [damping_of(own, spec, damping) for own in arms]
    positions, ellipsoids = _checked(spec, dampings, paths, profiles)
    center = np.concatenate(positions).mean(axis=0)
    times = _times(time, positions)
    members = []
    for i, own in enumerate(arms):
        target = TargetTrajectory(
            time=times,
            ellipsoids=ellipsoids[i],
            spec=spec,
            damping=dampings[i],
            positions=(positions[i] - center) @ rotation.T,
        )
        needed = _turned(demanded[i], rotation, len(times))
        members.append(ArmPath(own, target, CostWeights(WEIGHT), maps[i], needed))
    outline = np.concatenate([member.path for member in members])
    problem = PlacementProblem(tuple(members), outline, times, fixed, lower, upper, bounds)
    results = best_placements(problem, generator, budget, between(step, 0.1, 0.85))
    if chosen >= len(results):
        raise InvalidInputError(
            f"rank must be at most {len(results)}, the number of placements; found {rank}"
        )
    best, placed, parts = results[chosen], [], pieces(between(step, 0.85, 1.0), *[1.0] * len(arms))
    for i, (member, samples, part) in enumerate(zip(members, banks, parts, strict=True)):
        q = interpolated(
            evenly_spaced(len(times), len(best.q[i])), best.q[i], np.arange(len(times))
        )
        there = member.problem(best.place)
        q = pointwise_best(
            there, samples.starts_for(there.target, budget.pointwise_starts), q, part
        )
        placed.append(
            Placement(
                **vars(Place.of(best.place, best.distance[i])),
                path=there.path,
                profile=there.target.ellipsoids,
                spec=spec,
                center=center,
                map_rotation=rotation,
                base_orientation=base_rotations(best.place[None])[0],
                position_error=np.asarray(there.position_error(q)),
                pointwise_best=there.distance(q),
                joint_positions=q,
                candidates=tuple(Place.of(other.place, other.distance[i]) for other in results),
            )
        )
    medians = ", ".join(f"{np.median(own.pointwise_best):.2f}" for own in placed)
    step.end(f"scale {placed[0].scale:.2f}, distance {medians} (pointwise optimum)")
    return tuple(placed) if several else placed[0]


def _checked(
    spec: EllipsoidSpec,
    dampings: Sequence[Regularization],
    paths: Sequence[Any],
    profiles: Sequence[Any],
) -> tuple[list[Array], list[Array]]:
    """Return the path (n, 3) and the target ellipsoids (n, d, d) of each arm."""
    positions: list[Array] = []
    ellipsoids: list[Array] = []
    for i, damping in enumerate(dampings):
        index = "" if len(dampings) == 1 else f"s[{i}]"
        name = f"profile{index}"
        ellipsoids.append(checked_ellipsoids(profiles[i], name, spec, damping))
        require_shape(ellipsoids[i], name, ellipsoids[0].shape, ", as many as of the first arm")
        positions.append(as_metres(paths[i], f"path{index}"))
        shape = (len(ellipsoids[0]), 3)
        require_shape(
            positions[i], f"path{index}", shape, ", one point for each ellipsoid of the profile"
        )
    return positions, ellipsoids


def as_workspace(workspace: Any) -> Array:
    """Convert to lower and upper bounds of a path, shape (2, 3), infinite where it is open."""
    bounds = np.array([[-np.inf] * 3, [np.inf] * 3])
    if workspace is None:
        return bounds
    pairs = list(workspace) if isinstance(workspace, Sequence | np.ndarray) else []
    if len(pairs) != 3 or not all(
        isinstance(pair, Sequence | np.ndarray) and len(pair) == 2 for pair in pairs
    ):
        raise InvalidInputError(
            f"workspace must be ((x0, x1), (y0, y1), (z0, z1)), None where open; found {workspace!r}"
        )
    for i, (low, high) in enumerate(pairs):
        if low not in (None, -np.inf):
            bounds[0, i] = as_number(low, f"workspace[{i}][0]")
        if high not in (None, np.inf):
            bounds[1, i] = as_number(high, f"workspace[{i}][1]", above=bounds[0, i])
    return bounds


def fixed_place(scale: Any, yaw: Any, tilt: Any, offset: Any) -> tuple[Array, Array, Array]:
    """Return fixed numbers of a placement (7,), nan where free, and lower and upper bounds of placements."""
    fixed, scales = np.full(SIZE, np.nan), (0.5, 2.0)
    if isinstance(scale, tuple | list):
        if len(scale) != 2:
            raise InvalidInputError(
                f"scale must be one number or a range (low, high); found {scale!r}"
            )
        low = as_number(scale[0], "scale[0]", above=0.0)
        scales = (low, as_number(scale[1], "scale[1]", above=low))
    elif scale is not None:
        number = as_number(scale, "scale", above=0.0)
        fixed[SCALE], scales = np.log(number), (number, number)
    if yaw is not None:
        fixed[YAW] = as_number(yaw, "yaw")
    if tilt is None:
        fixed[[TILT, HEADING]] = 0.0
    elif isinstance(tilt, str):
        as_choice(tilt, "tilt", ["free"])
    else:
        fixed[TILT] = as_number(tilt, "tilt", minimum=0.0, maximum=np.pi)
    if offset is not None:
        values = list(offset) if np.ndim(offset) == 1 else []
        if len(values) != 3:
            raise InvalidInputError(
                f"offset must be three numbers, None where free; found {offset!r}"
            )
        fixed[OFFSET] = [
            np.nan if value is None else as_number(value, f"offset[{i}]")
            for i, value in enumerate(values)
        ]
    lower = np.array([np.log(scales[0]), -np.pi, 0.0, -np.pi, *[-np.inf] * 3])
    return fixed, lower, np.array([np.log(scales[1]), np.pi, np.pi, np.pi, *[np.inf] * 3])


def _require_reach(
    maps: Sequence[ReachabilityMap], bounds: Array, upright: bool, tolerance: float = 0.02
) -> None:
    """Raise the workspace (2, 3) above tables; a sample of each arm must come into it, within a tolerance [m]."""
    for samples in maps:
        if samples.collisions is not None and samples.collisions.table is not None:
            if not upright:
                raise InvalidInputError(
                    "collisions: a table is level in the frame of the base, which tilt lets lean; leave one of the two "
                    "out, or give workspace"
                )
            bounds[0, 2] = max(bounds[0, 2], samples.collisions.table)
    for samples in maps:
        end_positions = samples.reach
        if (
            np.linalg.norm(end_positions - np.clip(end_positions, *bounds), axis=1).min()
            > tolerance
        ):
            wanted, reached = (
                ", ".join(
                    f"{axis} {low:.2f} to {high:.2f}"
                    for axis, low, high in zip("xyz", *ends, strict=True)
                )
                for ends in (bounds, (end_positions.min(axis=0), end_positions.max(axis=0)))
            )
            raise InvalidInputError(
                f"workspace: {samples.arm.name!r} reaches nothing in {wanted} m: its end effector "
                f"{samples.arm.frame!r} reaches {reached} m at most, and not everywhere between"
            )


def _times(time: ArrayLike | None, paths: Sequence[Array], speed: float = 0.1) -> Array:
    """Return times of waypoints at a mean speed [m/s], which is the same for all placements."""
    times = (
        np.arange(len(paths[0]), dtype=float)
        if time is None
        else as_times(time, count=len(paths[0]))
    )
    if len(times) < 2:
        return times
    length = max(np.linalg.norm(np.diff(path, axis=0), axis=1).sum() for path in paths)
    return np.asarray((times - times[0]) * max(length / speed, 1.0) / (times[-1] - times[0]))


def _turned(demands: Any, rotation: Array, count: int) -> tuple[Demand, ...]:
    """Turn demands with a vector for each of `count` waypoints; none where there are none."""
    turned = []
    for spec, vectors in demands or ():
        values = as_finite(vectors, "demands")
        require_shape(values, "demands", (count, 3), ", a vector for each waypoint")
        turned.append((spec, values @ rotation.T))
    return tuple(turned)
