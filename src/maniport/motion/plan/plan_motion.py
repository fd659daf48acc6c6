"""Plan a motion that a robot can run, time it within the robot's limits, and evaluate it."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from maniport.arms import VELOCITY, Arm, ArmGroup, EllipsoidSpec, as_group
from maniport.errors import InvalidInputError
from maniport.motion.motion_limits import MotionLimits
from maniport.motion.objective import EXACT_WEIGHT, Damping, Objective
from maniport.motion.plan.group_plan import ArmTask, GroupPlan
from maniport.motion.plan.plan_control import PlanControl
from maniport.motion.plan.planner import Planner
from maniport.motion.problem import Cost, as_costs
from maniport.motion.robot_motion import RobotMotion
from maniport.motion.schedule import Schedule, of_each, require_few, require_rows
from maniport.util.defaults import DAMPING
from maniport.util.progress import Progress, Step, between
from maniport.util.validation import as_choice, as_finite, as_generator

PLACED, RELATIVE = "placed", "relative"


def plan_motion(
    arms: Arm | ArmGroup,
    profiles: ArrayLike | Sequence[ArrayLike],
    *,
    time: ArrayLike,
    paths: ArrayLike | Sequence[ArrayLike] | None = None,
    spec: EllipsoidSpec = VELOCITY,
    damping: Damping = DAMPING,
    weights: ArrayLike | Sequence[ArrayLike] | None = None,
    rotations: ArrayLike | Sequence[ArrayLike] | None = None,
    costs: Sequence[Cost] = (),
    tips: str = PLACED,
    planner: Planner | None = None,
    pointwise_bests: ArrayLike | Sequence[ArrayLike] | None = None,
    random_state: Any = 0,
    progress: Progress | None = None,
    **control: Any,
) -> RobotMotion:
    """Plan a motion whose velocity ellipsoids come as near to target ones as possible, with end effectors on paths.

    Each arm is planned by itself, see `maniport.motion.plan.planner`. Arms that share joints or costs, or come within
    15 mm of one another, are then optimized together. All have one time: as fast as the limits allow, never faster than
    the demonstration, from rest to rest. A path that an arm cannot follow is no error: the result has the errors.

    Parameters
    ----------
    arms : Arm or ArmGroup
        With a group, `profiles`, `paths`, `weights`, `rotations` and `pointwise_bests` are sequences with one array for
        each arm; with an arm they are the array itself.
    profiles : array_like, shape (n, d, d), or a sequence of them
        Target velocity ellipsoids in the base frame, without damping, n ≥ 2.
    time : array_like, shape (n,)
        Demonstrated times, increasing [s].
    paths : array_like, shape (n, 3), or a sequence of them, optional
        Target positions of the end effectors in the base frame [m].
    spec, damping, weights, progress
        As in `maniport.motion.track`.
    rotations : array_like, shape (n, 3, 3), or a sequence of them, optional
        Target orientations of the end effectors in the base frame; `orientation_axes` and `orientation_weight` set
        which axes count and how much. The pointwise optimum ignores them.
    costs : sequence of Cost, optional
        Further costs, over all joints; see `maniport.motion.problem.Cost`. The pointwise optimum ignores them.
    tips : {"placed", "relative"}
        Whether the end effectors follow their paths, or only keep the vectors from the first end effector to the
        others; the arms of the result then have no paths.
    planner : Planner, optional
        A planner of these arms, ellipsoids and limits. Default: a new one (0.5 s for an arm).
    pointwise_bests : array_like, shape (n,), or a sequence of them, optional
        The pointwise optimum, as from `place_path`. Default: searched (0.6 s for an arm).
    random_state : None, int or numpy.random.Generator
    **control
        Options of `maniport.motion.PlanControl`; limits, collisions and the home configuration are for all joints.

    Raises
    ------
    InvalidInputError, NotSPDError
        When an argument has a wrong shape or value, or an ellipsoid is asymmetric or indefinite.
    """
    settings = PlanControl(**control)
    if not isinstance(arms, Arm | ArmGroup):
        raise InvalidInputError(f"arms must be an Arm or an ArmGroup; found {type(arms).__name__}")
    if planner is not None:
        planner.require_fits(arms, spec)
    settings = settings.resolved(arms, planner)
    arrays = profiles, paths, weights, rotations, pointwise_bests
    tasks = _tasks(arms, settings, time, spec, damping, arrays)
    relative = as_choice(tips, "tips", (PLACED, RELATIVE)) == RELATIVE
    if relative and (paths is None or len(tasks) < 2):
        raise InvalidInputError("tips='relative' keeps vectors between end effectors; give several arms with paths")
    extra, generator = as_costs(costs, arms, tasks[0].schedule.time), as_generator(random_state)
    step = Step(progress, "Plan trajectory")
    if planner is None:
        assert isinstance(settings.motion_limits, MotionLimits)
        planner = Planner.of(settings.motion_limits, spec, settings.collisions, generator)
    motion = GroupPlan(settings, tasks, planner, extra, relative).motion(generator, between(step, 0.2, 0.9))
    step.end(f"{motion.timed.time[-1]:.1f} s (human {np.ptp(tasks[0].schedule.time):.1f} s)")
    step = Step(progress, "Evaluate trajectory")
    result = motion.evaluated()
    step.end()
    return result


def _tasks(
    arms: Arm | ArmGroup,
    settings: PlanControl,
    time: ArrayLike,
    spec: EllipsoidSpec,
    damping: Damping,
    arrays: Sequence[Any],
) -> list[ArmTask]:
    """Check the targets of each arm."""
    group = as_group(arms)
    names = "profiles", "paths", "weights", "rotations", "pointwise_bests"
    columns = [
        (value,) if isinstance(arms, Arm) else of_each(value, name, len(group))
        for name, value in zip(names, arrays, strict=True)
    ]
    tasks = []
    for arm, own, (profile, path, weights, rotations, pointwise) in zip(
        group.arms, group.specs(spec), zip(*columns, strict=True), strict=True
    ):
        objective = Objective.of(arm, own, damping, EXACT_WEIGHT, positive=True)
        objective = objective.keeping(settings.orientation_axes, settings.orientation_weight)
        schedule = Schedule.checked(objective, profile, time, path, weights, rotations)
        best = None if pointwise is None else as_finite(pointwise, "pointwise_bests").copy()
        require_rows(len(schedule), pointwise_bests=(best, ()))
        tasks.append(ArmTask(objective, schedule, best))
    if len({task.schedule.positions is None for task in tasks}) > 1:
        raise InvalidInputError("paths must be of all arms or of none")
    require_few(np.ptp(tasks[0].schedule.time) / settings.speed_scale * settings.rate)
    return tasks
