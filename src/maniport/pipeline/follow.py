"""A robot follows a profile: the hand path is placed before it, a motion planned, and tracked where that is asked."""

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from maniport.arms import VELOCITY, Arm, EllipsoidSpec
from maniport.errors import InvalidInputError
from maniport.motion import (
    Control,
    Placement,
    PlanControl,
    Planner,
    feasibility_gap,
    place_path,
    plan_motion,
    track,
)
from maniport.motion.effort import as_effort
from maniport.motion.objective import Damping, Objective
from maniport.motion.search.pointwise import interpolated_distance
from maniport.motion.trajectory import Clearance
from maniport.pipeline.execution import Execution, placed_rows
from maniport.pipeline.turns import turned_freely, turned_tips
from maniport.util.defaults import DAMPING
from maniport.util.progress import Progress
from maniport.util.validation import Array, as_finite, as_generator, as_times


def follow(
    robot: Arm,
    profile: ArrayLike,
    time: ArrayLike | None,
    path: ArrayLike | None = None,
    *,
    place: bool = True,
    turn: ArrayLike | None = None,
    rotations: ArrayLike | None = None,
    direction: ArrayLike | None = None,
    spec: EllipsoidSpec = VELOCITY,
    damping: Damping = DAMPING,
    planner: Planner | None = None,
    random_state: Any = 0,
    progress: Progress | None = None,
    **control: Any,
) -> Execution:
    """Place a hand path before a robot and plan a motion that makes the target ellipsoids along it."""
    if time is None:
        raise InvalidInputError("the profile has no times; write it with an array 'time' (n,) in seconds")
    planning, tracking = controls(control)
    settings, generator = PlanControl(**planning), as_generator(random_state)
    planner = settings.planner(robot, spec, generator) if planner is None else planner
    if settings.workspace is not None and (path is None or not place):
        raise InvalidInputError("workspace says where a path may be placed, and none is")
    regularization = Objective.of(robot, spec, damping, positive=True).damping
    same: dict[str, Any] = {"spec": spec, "damping": regularization, "progress": progress}
    seed = random_state if isinstance(random_state, int) else None

    def placed(reaching: bool) -> tuple[Placement, Array]:
        """Place the path, judged by some of its points, and the pointwise optimum there, at all points (n,)."""
        assert path is not None
        points, ellipsoids = as_finite(path, "path"), as_finite(profile, "profile")
        rows, times = placed_rows(len(points)), as_times(time, count=len(points))
        placement = place_path(
            points[rows], ellipsoids[rows], planner.limits.arm, time=times[rows], whole=points if reaching else None,
            turn=turn, bank=planner.arms[0].bank, reachability_map=planner.arms[0].reachability_map, workspace=settings.workspace, planning_effort=settings.planning_effort,
            random_state=generator, **same,
        )  # fmt: skip
        return placement, interpolated_distance(rows, placement.distance, len(points))

    def moved(placement: Placement | None, floor: Array | None) -> Execution:
        """Plan a motion, at the place of the path where it has one, and track it where that is asked for."""
        arm, target, tips, turned, free = planner.limits.arm, profile, path, rotations, None
        if placement is not None:
            assert path is not None
            target, tips = placement.turned(as_finite(profile, "profile")), placement.apply(path)
        planned = planning | {
            "time": time,
            "paths": tips,
            "planner": planner,
            "pointwise_bests": floor,
            "random_state": generator,
        }
        if rotations is not None or direction is not None:
            free = plan_motion(arm, target, **planned, **same | {"progress": turned_freely(progress)}).arms[0]
            turned = turned_tips(rotations, direction, placement, len(free.time), settings.orientation_axes)
        whole = plan_motion(arm, target, rotations=turned, **planned, **same)
        motion, room = whole.arms[0], whole.clearance
        plan = motion
        if tracking:
            more = tracking | {"reference": plan.joint_positions, "rotations": turned}
            motion = track(arm, target, time=plan.time, path=tips, **more, **same).arms[0]
            room = Clearance.of(planner.collisions, motion)
        gap = feasibility_gap(
            arm, target, bank=planner.arms[0].bank, **as_effort(settings.planning_effort).of_gap, **same
        )
        return Execution(robot, placement, plan, motion, room, gap, planner.collisions, free, seed)

    if path is None or not place:
        return moved(None, None)
    placement, floor = placed(reaching=False)
    first = moved(placement, floor)
    if first.room.share > 0.0:  # perhaps where a point that did not count for the placement is out of reach
        other, floor = placed(reaching=True)
        if not np.array_equal(other.path, placement.path):
            return min(first, moved(other, floor), key=lambda one: one.room.share)
    return first


def controls(given: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Part options into those of `PlanControl` and those of `Control`, none where none is its alone."""
    planned, tracked = ({one.name for one in fields(kind)} for kind in (PlanControl, Control))
    if unknown := sorted(set(given) - planned - tracked):
        raise TypeError(f"unexpected option {unknown[0]!r}; there are {', '.join(sorted(planned | tracked))}")
    planning = {name: value for name, value in given.items() if name in planned}
    alone = bool(set(given) - planned)
    tracking = {name: value for name, value in given.items() if name in tracked} if alone else {}
    PlanControl(**planning), Control(**tracking)
    return planning, tracking
