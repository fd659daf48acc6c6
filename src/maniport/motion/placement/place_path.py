"""Placement of hand paths relative to robot arms that minimizes the distance to target ellipsoids."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maniport.arms import Arm, ArmGroup, EllipsoidSpec, as_group
from maniport.errors import InvalidInputError
from maniport.motion.demands import Demand, demands_of
from maniport.motion.motion_limits import MotionLimits
from maniport.motion.placement.options import REAL_TIME_SCALES, SCALES, PlacementOptions
from maniport.motion.placement.placement import TILT, ArmPath, Placement, PlacementProblem
from maniport.motion.placement.search import PlacementSolution, best_placements
from maniport.motion.plan.group_planner import Planner
from maniport.motion.plan.plan_motion import group_spec
from maniport.motion.plan.plan_options import PlanOptions
from maniport.motion.plan.planner import SPEED_SHARE, ArmPlanner, planning_terms
from maniport.motion.targets import TargetTrajectory, targets_of_arms
from maniport.motion.trajectory import interpolated
from maniport.util.progress import Progress, Step, between
from maniport.util.sampling import evenly_spaced
from maniport.util.validation import Array, as_generator, as_rotation

MOST_WAYPOINTS = 80  # Waypoints that a path is placed by; more change little


@overload
def place_path(
    robot: Arm,
    targets: TargetTrajectory,
    options: PlacementOptions | None = None,
    *,
    map_rotation: ArrayLike | None = None,
    planner: Planner | None = None,
    plan: PlanOptions | None = None,
    random_state: int | np.random.Generator | None = 0,
    progress: Progress | None = None,
) -> list[Placement]: ...


@overload
def place_path(
    robot: ArmGroup,
    targets: Sequence[TargetTrajectory],
    options: PlacementOptions | None = None,
    *,
    map_rotation: ArrayLike | None = None,
    planner: Planner | None = None,
    plan: PlanOptions | None = None,
    random_state: int | np.random.Generator | None = 0,
    progress: Progress | None = None,
) -> list[tuple[Placement, ...]]: ...


def place_path(
    robot: Arm | ArmGroup,
    targets: TargetTrajectory | Sequence[TargetTrajectory],
    options: PlacementOptions | None = None,
    *,
    map_rotation: ArrayLike | None = None,
    planner: Planner | None = None,
    plan: PlanOptions | None = None,
    random_state: int | np.random.Generator | None = 0,
    progress: Progress | None = None,
) -> list[Placement] | list[tuple[Placement, ...]]:
    """Find scales, yaws, offsets and optional tilts that minimize the distance to target ellipsoids.

    Thousands of placements are compared by samples of the arm. The best ones that differ are improved together with
    trajectories there, in rounds, see `maniport.motion.placement.search`. The ellipsoids rotate with the path.

    The paths of several arms keep their relation: they are scaled, rotated and moved together, about the mean of all
    their waypoints. The costs of the arms are summed; collisions between them are not checked.

    Parameters
    ----------
    robot : Arm or ArmGroup
    targets : TargetTrajectory, or a sequence of them for a group
        Ellipsoids of the arm, as an adapter returns them, and positions of the hand in the demonstrator's base frame.
    options : PlacementOptions, optional
        What is fixed. Default: all but the tilt is searched.
    map_rotation : array_like, shape (3, 3), optional
        Rotation of the ellipsoids by the adapter, to be applied to the path. Default: the identity.
    planner : Planner, optional
        A planner of this robot and these ellipsoids, whose samples, limits and collisions are used. Default: a new one
        (0.5 s for an arm).
    plan : PlanOptions, optional
        Options of the plan that follows, for its time; in real time the joints should allow the person's velocities
        and accelerations.
    random_state : None, int or numpy.random.Generator
    progress : callable, optional
        Called with the name of a stage, the fraction done and, at its end, a message.

    Returns
    -------
    list of Placement
        From the best to the worst, each with a trajectory of the arm there. Of a group, each element is a tuple with
        one for each arm, with the same scale, rotation and offset.

    Raises
    ------
    InvalidInputError
        When a value is wrong, the arm reaches nothing in the workspace, or the path does not fit.
    """
    if options is None:
        options = PlacementOptions()
    if plan is None:
        plan = PlanOptions()
    generator = as_generator(random_state)
    demonstrated = targets_of_arms(robot, targets)
    rotation = np.eye(3)
    if map_rotation is not None:
        rotation = as_rotation(map_rotation, "map_rotation", 3)
    for target in demonstrated:
        if target.positions is None:
            raise InvalidInputError("targets must have positions: they are the path that is placed")
    step = Step(progress, "Place path")
    specs = [target.spec for target in demonstrated]
    if planner is None:
        planner = _planner_of(robot, specs, plan, generator)
    else:
        planner.require_fits(robot, specs)

    if plan.real_time:
        scales = REAL_TIME_SCALES
    else:
        scales = SCALES
    fixed, lower, upper = options.components(scales)
    bounds = options.bounds()
    _require_reach(planner.arms, bounds, upright=bool(fixed[TILT] == 0.0))
    paths = DemonstratedPaths.of(demonstrated, rotation)
    terms = planning_terms(paths.time[paths.rows], plan)
    members = _arm_paths(planner.arms, paths, plan.real_time)
    problem = PlacementProblem(
        arms=members,
        outline=np.concatenate([member.path for member in members]),
        time=terms.time,
        fixed=fixed,
        lower=lower,
        upper=upper,
        workspace=bounds,
    )
    solutions = best_placements(
        problem,
        terms.trajectory,
        terms.joint_motion_weight,
        plan.budget,
        generator,
        between(step, 0.1, 1.0),
    )

    placements = [_placements_of(problem, solution, paths) for solution in solutions]
    best = placements[0]
    medians = ", ".join(f"{np.median(placement.distance):.2f}" for placement in best)
    step.end(f"scale {best[0].scale:.2f}, distance {medians}")
    if isinstance(robot, Arm):
        return [placement for (placement,) in placements]
    return placements


class DemonstratedPaths(NamedTuple):
    """Paths of the hands with their ellipsoids before the placement, and the waypoints that they are placed by."""

    targets: tuple[TargetTrajectory, ...]  # of each arm
    rows: NDArray[np.intp]  # (k,), of these waypoints
    center: Array  # (3,), their mean over all arms [m]
    map_rotation: Array  # (3, 3), of the paths

    @classmethod
    def of(cls, targets: Sequence[TargetTrajectory], map_rotation: Array) -> "DemonstratedPaths":
        """Choose evenly spaced waypoints, at most about `MOST_WAYPOINTS`."""
        count = len(targets[0])
        rows = np.arange(0, count, 1 + (count - 1) // MOST_WAYPOINTS)
        center = np.concatenate([target.path[rows] for target in targets]).mean(axis=0)
        return cls(tuple(targets), rows, center, map_rotation)

    @property
    def time(self) -> Array:
        """Demonstrated times of all waypoints, shape (n,) [s]."""
        return self.targets[0].time


def _arm_paths(
    arms: Sequence[ArmPlanner], paths: DemonstratedPaths, real_time: bool
) -> tuple[ArmPath, ...]:
    """Return the path of each arm around the common center; in real time with its velocities and accelerations."""
    members = []
    for arm, target in zip(arms, paths.targets, strict=True):
        demanded: tuple[Demand, ...] = ()
        if real_time:
            demanded = _demands(arm, target, paths.rows, paths.map_rotation)
        member = ArmPath(
            arm=arm.limits.arm,
            target=target[paths.rows].centered(paths.center, paths.map_rotation),
            reachability_map=arm.reachability_map,
            velocity=SPEED_SHARE * arm.limits.velocity,
            demanded=demanded,
        )
        members.append(member)
    return tuple(members)


def _planner_of(
    robot: Arm | ArmGroup,
    specs: Sequence[EllipsoidSpec],
    plan: PlanOptions,
    generator: np.random.Generator,
) -> Planner:
    """Make a planner of a robot and the ellipsoids of its arms, with the limits and collisions of options."""
    resolved = plan.resolved(robot)
    assert isinstance(resolved.motion_limits, MotionLimits)
    spec = group_spec(as_group(robot), specs)
    return Planner.of(resolved.motion_limits, spec, resolved.collisions, generator)


def _demands(
    arm: ArmPlanner, target: TargetTrajectory, rows: NDArray[np.intp], rotation: Array
) -> tuple[Demand, ...]:
    """Return velocities and accelerations of the person around some rows of the path, turned as the ellipsoids."""
    turned = []
    for spec, vectors in demands_of(arm.limits, target.time, target.path, rows):
        turned.append((spec, vectors @ rotation.T))
    return tuple(turned)


def _placements_of(
    problem: PlacementProblem, solution: PlacementSolution, paths: DemonstratedPaths
) -> tuple[Placement, ...]:
    """Return the placement of each arm, with its trajectory interpolated to all waypoints."""
    chosen = evenly_spaced(len(paths.rows), len(solution.q[0]))
    solution_time = paths.time[paths.rows[chosen]]
    components = solution.place[None]
    placements = []
    for member, target, q, distance in zip(
        problem.arms, paths.targets, solution.q, solution.distance, strict=True
    ):
        centered = target.centered(paths.center, paths.map_rotation)
        placed = replace(member, target=centered, demanded=()).placed(components)
        error = member.problem(components)[chosen].position_error(q)
        placements.append(
            Placement.of(
                solution.place,
                path=placed.path,
                profile=placed.ellipsoids,
                spec=target.spec,
                center=paths.center,
                map_rotation=paths.map_rotation,
                joint_positions=interpolated(solution_time, q, paths.time),
                distance=distance,
                position_error=np.asarray(error),
            )
        )
    return tuple(placements)


def _require_reach(
    arms: Sequence[ArmPlanner], bounds: Array, upright: bool, tolerance: float = 0.02
) -> None:
    """Raise the workspace (2, 3) above tables; a sample of each arm must come into it, within a tolerance [m]."""
    for arm in arms:
        collisions = arm.reachability_map.collisions
        if collisions is None or collisions.table is None:
            continue
        if not upright:
            raise InvalidInputError(
                "collisions: a table is level in the frame of the base, which tilt lets lean; leave one of the two "
                "out, or give workspace"
            )
        bounds[0, 2] = max(bounds[0, 2], collisions.table)
    for arm in arms:
        robot = arm.limits.arm
        reached = arm.reachability_map.reach
        gaps = np.linalg.norm(reached - np.clip(reached, *bounds), axis=1)
        if gaps.min() > tolerance:
            raise InvalidInputError(
                f"workspace: {robot.name!r} reaches nothing in {_box(bounds[0], bounds[1])} m: its end effector "
                f"{robot.frame!r} reaches {_box(reached.min(axis=0), reached.max(axis=0))} m at most, and not "
                "everywhere between"
            )


def _box(lower: Array, upper: Array) -> str:
    """Describe a box by its corners (3,)."""
    sides = zip("xyz", lower, upper, strict=True)
    return ", ".join(f"{axis} {low:.2f} to {high:.2f}" for axis, low, high in sides)
