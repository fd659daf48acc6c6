"""A robot follows a profile: the hand path is placed before it, a motion planned, and tracked where that is asked."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike

from maniport.bodies import VELOCITY, Arm, EllipsoidSpec
from maniport.defaults import DAMPING
from maniport.errors import InvalidInputError
from maniport.pipeline.execution import Execution, placed_rows
from maniport.pipeline.turns import turned_freely, turned_tips
from maniport.steps import Progress
from maniport.tracking import (
    Control,
    PlacedPath,
    PlanControl,
    Planner,
    TrackResult,
    feasibility_gap,
    place_path,
    plan_motion,
    track,
)
from maniport.tracking.effort import as_effort
from maniport.tracking.objective import Damping, Objective
from maniport.tracking.plan.planned_motion import Room
from maniport.tracking.search.pointwise import interpolated_distance
from maniport.validation import Array, as_finite, as_generator, as_times


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
    asked = _Asked(
        robot, planner, settings, profile, time, path, turn, rotations, direction, planning, tracking, generator, same
    )
    seed = _seed_of(random_state)
    if path is None or not place:
        return asked.moved(None, None, seed)
    return asked.placed_and_moved(seed)


@dataclass(frozen=True)
class _Asked:
    """What `follow` is given, checked."""

    robot: Arm
    planner: Planner
    settings: PlanControl
    profile: ArrayLike
    time: ArrayLike
    path: ArrayLike | None
    turn: ArrayLike | None
    rotations: ArrayLike | None
    direction: ArrayLike | None
    planning: dict[str, Any]
    tracking: dict[str, Any]
    generator: np.random.Generator
    same: dict[str, Any]

    def placed_and_moved(self, seed: int | None) -> Execution:
        """Place the path and plan a motion there; where it collides, place the path anew with all points in reach."""
        placement, floor = self.placed(reaching=False)
        first = self.moved(placement, floor, seed)
        if first.room.share > 0.0:  # perhaps where a point that did not count for the placement is out of reach
            other, floor = self.placed(reaching=True)
            if not np.array_equal(other.path, placement.path):
                return min(first, self.moved(other, floor, seed), key=lambda one: one.room.share)
        return first

    def placed(self, *, reaching: bool) -> tuple[PlacedPath, Array]:
        """Place the path, judged by some of its points, and the node floor there, at all points (n,)."""
        assert self.path is not None
        points, ellipsoids = as_finite(self.path, "path"), as_finite(self.profile, "profile")
        effort, times = self.settings.effort, as_times(self.time, count=len(points))
        each = placed_rows(len(points))
        placement = place_path(
            points[each], ellipsoids[each], self.planner.limits.arm, time=times[each],
            whole=points if reaching else None, turn=self.turn, bank=self.planner.bank, atlas=self.planner.atlas,
            workspace=self.settings.workspace, effort=effort, random_state=self.generator, **self.same,
        )  # fmt: skip
        return placement, interpolated_distance(each, placement.distance, len(points))

    def moved(self, placement: PlacedPath | None, floor: Array | None, seed: int | None) -> Execution:
        """Plan a motion, at the place of the path where it has one, and track it where that is asked for."""
        arm, target, tips, rotations = self.planner.limits.arm, self.profile, self.path, self.rotations
        if placement is not None:
            assert tips is not None
            target, tips = placement.turned(as_finite(target, "profile")), placement.apply(tips)
        planned = self.planning | {
            "time": self.time,
            "path": tips,
            "planner": self.planner,
            "node_floor": floor,
            "random_state": self.generator,
        }
        free = None
        if rotations is not None or self.direction is not None:
            told = {**self.same, "progress": turned_freely(self.same["progress"])}
            free = plan_motion(arm, target, **planned, **told)
            rotations = turned_tips(rotations, self.direction, placement, len(free.time), self.settings.keep)
        plan = plan_motion(arm, target, rotations=rotations, **planned, **self.same)
        motion, room = cast(TrackResult, plan), plan.room
        if self.tracking:
            more = self.tracking | {"reference": plan.joint_positions, "rotations": rotations}
            motion = track(arm, target, time=plan.time, path=tips, **more, **self.same)
            room = Room.of(self.planner.collisions, motion)
        effort = as_effort(self.settings.effort).of_gap
        gap = feasibility_gap(arm, target, bank=self.planner.bank, **effort, **self.same)
        return Execution(self.robot, placement, plan, motion, room, gap, self.planner.collisions, free, seed)


def _seed_of(random_state: Any) -> int | None:
    """Return the seed where a random state is one."""
    return random_state if isinstance(random_state, int) else None


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
