"""A controller that follows a planned motion."""

from collections.abc import Sequence
from dataclasses import replace

from maniport.motion import Planner, RobotMotion, track
from maniport.motion.trajectory import Clearance
from maniport.pipeline.results import motion_of_arm
from maniport.pipeline.values import Settings
from maniport.util.validation import Array


def tracked(
    planned: RobotMotion, planner: Planner, rotations: Sequence[Array] | None, settings: Settings
) -> RobotMotion:
    """Follow the planned motion of one arm by a controller; its motion gets the targets and limits of the plan."""
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
        **settings.config.motion.control_options,
    ).arms
    kept = ("demonstrated_time", "limits", "pointwise_best")
    clearance = Clearance.of(planner.collisions, motion)
    motion = replace(motion, clearance=clearance, **{name: getattr(plan, name) for name in kept})
    return motion_of_arm(planned.group, motion)
