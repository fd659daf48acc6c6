"""Stages of the robot's motion: placement of the paths, plan, and measurement."""

from collections.abc import Sequence
from dataclasses import fields, replace
from typing import Any

import numpy as np

from maniport.arms import EllipsoidSpec, as_group
from maniport.motion import (
    MotionLimits,
    Placement,
    Planner,
    RobotMotion,
    feasibility_gap,
    place_path,
    plan_motion,
    track,
)
from maniport.motion.effort import as_effort
from maniport.motion.plan.plan_motion import PLACED
from maniport.motion.trajectory import Clearance
from maniport.pipeline.results import ArmResult, motion_of_arm, placement_rows
from maniport.pipeline.targets import MotionTargets
from maniport.pipeline.values import MotionSettings, Moved
from maniport.util.progress import Progress
from maniport.util.validation import Array


def planner_of(settings: MotionSettings, spec: EllipsoidSpec, generator: Any) -> Planner:
    """Sample the robot within its limits."""
    limits = settings.plan.motion_limits
    assert isinstance(limits, MotionLimits)
    return Planner.of(limits, spec, settings.plan.collisions, generator)


def place(
    targets: MotionTargets,
    planner: Planner,
    settings: MotionSettings,
    generator: np.random.Generator,
    whole: bool = False,
) -> tuple[Placement, ...]:
    """Place the paths relative to the robot, by some of their waypoints; `whole`: all of them are to be reached."""
    assert targets.paths is not None
    rows, each = placement_rows(len(targets.time)), planner.arms
    return place_path(
        [path[rows] for path in targets.paths],
        [profile[rows] for profile in targets.profiles],
        [own.limits.arm for own in each],
        time=targets.time[rows],
        whole=targets.paths if whole else None,
        turn=targets.turn,
        workspace=settings.plan.workspace,
        reachability_map=[own.reachability_map for own in each],
        bank=[own.bank for own in each],
        planning_effort=settings.plan.planning_effort,
        spec=targets.spec,
        damping=targets.damping,
        random_state=generator,
        progress=settings.progress,
    )


def plan(
    targets: MotionTargets,
    placements: tuple[Placement, ...] | None,
    planner: Planner,
    settings: MotionSettings,
    generator: np.random.Generator,
) -> Moved:
    """Plan a motion of all arms along the placed targets; where the settings have a controller, it follows the plan."""
    placed = targets if placements is None else targets.placed(placements)
    options: dict[str, Any] = {option.name: getattr(settings.plan, option.name) for option in fields(settings.plan)}
    options |= {
        "time": targets.time,
        "paths": placed.paths,
        "spec": targets.spec,
        "damping": targets.damping,
        "planner": planner,
        "costs": settings.costs,
        "pointwise_bests": placed.pointwise_bests,
        "random_state": generator,
    }

    def planned(rotations: Sequence[Array] | None, progress: Progress) -> RobotMotion:
        several: dict[str, Any] = {"rotations": rotations, "tips": settings.tips, "progress": progress}
        return plan_motion(planner.group, placed.profiles, **options, **several)

    rotations, free = placed.base_rotations(settings.plan.orientation_axes), None
    if rotations is not None:
        free = planned(None, lambda step, *more: settings.progress(f"{step}, free orientation", *more))
    motion = planned(rotations, settings.progress)
    if settings.tracking is not None:
        motion = _tracked(motion, planner, rotations, settings)
    return Moved(motion, free, placements if settings.tips == PLACED else None)


def _tracked(
    planned: RobotMotion, planner: Planner, rotations: Sequence[Array] | None, settings: MotionSettings
) -> RobotMotion:
    """Follow the planned motion of one arm by a controller; its motion gets the targets and limits of the plan."""
    assert settings.tracking is not None
    (plan,) = planned.arms
    (motion,) = track(
        planner.arms[0].limits.arm,
        plan.target,
        time=plan.time,
        path=plan.path,
        reference=plan.joint_positions,
        rotations=None if rotations is None else rotations[0],
        spec=plan.spec,
        damping=plan.damping,
        progress=settings.progress,
        **settings.tracking,
    ).arms
    kept = ("demonstrated_time", "limits", "pointwise_best")
    clearance = Clearance.of(planner.collisions, motion)
    motion = replace(motion, clearance=clearance, **{name: getattr(plan, name) for name in kept})
    return motion_of_arm(planned.group, motion)


def place_and_plan(
    targets: MotionTargets, planner: Planner, settings: MotionSettings, generator: np.random.Generator
) -> Moved:
    """Place the paths and plan a motion; where that collides, again with a placement that reaches all waypoints."""
    placements = place(targets, planner, settings, generator)
    moved = plan(targets, placements, planner, settings, generator)
    if moved.motion.clearance.share == 0.0:
        return moved
    others = place(targets, planner, settings, generator, whole=True)
    if all(np.array_equal(own.path, other.path) for own, other in zip(placements, others, strict=True)):
        return moved
    again = plan(targets, others, planner, settings, generator)
    return min(moved, again, key=lambda result: result.motion.clearance.share)


def measure(moved: Moved, names: Sequence[str], planner: Planner, settings: MotionSettings) -> tuple[ArmResult, ...]:
    """Measure the feasibility gap of the targets of each arm; return what belongs to each arm."""
    effort, results = as_effort(settings.plan.planning_effort).of_gap, []
    for i, (name, arm, own) in enumerate(zip(names, as_group(settings.robot).arms, planner.arms, strict=True)):
        motion, free = moved.motion.arms[i], None if moved.free is None else moved.free.arms[i]
        same: dict[str, Any] = {"spec": motion.spec, "damping": motion.damping, "progress": settings.progress}
        gap = feasibility_gap(own.limits.arm, motion.target, bank=own.bank, **effort, **same)
        placement = None if moved.placements is None else moved.placements[i]
        results.append(
            ArmResult(name=name, robot=arm, placement=placement, motion=motion, free=free, gap=gap,
                      collisions=own.collisions)
        )  # fmt: skip
    return tuple(results)
