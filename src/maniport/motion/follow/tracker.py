"""An arm follows a profile of ellipsoids, and a path where there is one, step by step.

In each control step Pink's inverse kinematics weighs a `ManipulabilityEllipsoidTask`, a `PositionTask`, a weak pull to
the starting posture and the user's tasks, within limits of position, velocity and acceleration. The position has
priority by its cost.
"""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maniport.arms import VELOCITY, Arm, EllipsoidSpec
from maniport.errors import InvalidInputError
from maniport.motion.arm_model import require_trackable
from maniport.motion.arm_motion import ArmMotion
from maniport.motion.effort import QUICK
from maniport.motion.follow.follower import Control, Follower
from maniport.motion.motion_limits import MotionLimits
from maniport.motion.objective import Damping, Objective
from maniport.motion.plan.plan_motion import plan_motion
from maniport.motion.plan.planner import ArmPlanner, Planner
from maniport.motion.plan.reachability_map import ReachabilityMap
from maniport.motion.schedule import Schedule
from maniport.motion.search.seed_bank import SeedBank
from maniport.util.defaults import DAMPING
from maniport.util.progress import Progress, Step, between
from maniport.util.validation import Array, as_generator


def track(
    arm: Arm,
    profile: ArrayLike,
    *,
    time: ArrayLike,
    path: ArrayLike | None = None,
    start: ArrayLike | None = None,
    reference: ArrayLike | None = None,
    spec: EllipsoidSpec = VELOCITY,
    damping: Damping = DAMPING,
    weights: ArrayLike | None = None,
    rotations: ArrayLike | None = None,
    bank: SeedBank | None = None,
    random_state: Any = 0,
    progress: Progress | None = None,
    **control: Any,
) -> ArmMotion:
    """Move an arm so that its velocity ellipsoids follow target ones, and its end effector a target path.

    A profile or path that the arm cannot follow is no error: the result says where and by how much. Where the quadratic
    program of a step has no solution, the arm is brought to rest and tries again.

    Parameters
    ----------
    arm : Arm
        With at least three joints, and a joint for each degree of freedom.
    profile : array_like, shape (n, d, d)
        Target velocity ellipsoids in the arm's base frame, without damping, n ≥ 2.
    time : array_like, shape (n,)
        Increasing [s].
    path : array_like, shape (n, 3), optional
        Target positions of the end effector in the base frame [m].
    start : array_like, shape (dof,), optional
        First configuration. Default: the first of the reference, else that of a planned motion.
    reference : array_like, shape (n, dof), optional
        Joint positions to stay near, such as a plan's, where path and ellipsoids leave freedom [rad or m].
    spec : EllipsoidSpec
        Which ellipsoids, of velocity.
    damping : float or Regularization
        Added to the eigenvalues of all ellipsoids before they are compared; above zero, since arms pass singular
        configurations. A number is relative to the arm's mean eigenvalue: `maniport.motion.objective.as_damping`.
    weights : array_like, shape (n, m, m), optional
        Weights of the directions of the ellipsoids, see `ManipulabilityEllipsoidTask`; m = d (d + 1) / 2.
    rotations : array_like, shape (n, 3, 3), optional
        Target orientations of the end effector in the base frame; see `keep` and `orientation_weight`.
    bank : SeedBank, optional
        Seed configurations to find the start with. Default: 16 384 new samples (0.1 s).
    random_state, progress : optional
        Random seed; called with the name of a step and the fraction done.
    **control
        rate, interpolation, velocity_limits, acceleration_limits, gain, lm_damping, position_cost, keep,
        orientation_weight, tasks and limits; see `maniport.motion.Control`.

    Raises
    ------
    InvalidInputError
        When an argument has a wrong shape or value, the start lies outside the limits, the arm has fewer than three
        joints or coupled ones, or the bank was made for another arm.
    NotSPDError
        When an ellipsoid is asymmetric or indefinite.
    """
    settings = Control(**control)
    require_trackable(arm, spec)
    objective = Objective.of(arm, spec, damping, settings.position_cost, positive=True)
    objective = objective.keeping(settings.orientation_axes, settings.orientation_weight)
    asked = Schedule.checked(objective, profile, time, path, weights, rotations, reference)
    begin = _as_start(arm, asked.postures[0] if start is None and asked.postures is not None else start)
    follower = Follower((objective,), settings)
    step, planned = Step(progress, "Track trajectory"), 0.0 if begin is not None else 0.5  # the share of the work
    if begin is None:
        begin = _planned_start(asked, objective, settings, bank, random_state)
    schedule = asked.sampled(objective, settings.rate, settings.interpolation)
    joints, held = follower.follow(begin, (schedule,), between(step, planned, 1.0))
    result = evaluated(objective, asked, schedule.time, joints, held, follower.velocity_limits)
    step.end(result.error_text())
    return result


def _planned_start(
    asked: Schedule, objective: Objective, settings: Control, bank: SeedBank | None, random_state: Any
) -> Array:
    """First configuration of a motion that is planned through the same targets."""
    limits = MotionLimits.of(objective.arm, joint_limit_margin=0.0)
    random = as_generator(random_state)
    bank = SeedBank.given_or_built(bank, objective.arm, objective.spec, random)
    reachability_map = ReachabilityMap(objective.arm, objective.spec, random_state=random)
    planner = Planner(limits, objective.spec, (ArmPlanner(limits, reachability_map, bank),))
    plan = plan_motion(
        objective.arm, asked.ellipsoids, time=asked.time, paths=asked.positions, spec=objective.spec,
        damping=objective.damping, weights=asked.weights, rotations=asked.rotations, planner=planner, planning_effort=QUICK,
        position_tolerance=1e-3,
        orientation_axes=settings.orientation_axes, orientation_weight=settings.orientation_weight, random_state=random,
    )  # fmt: skip
    return np.asarray(plan.trajectory.joint_positions[0])


def evaluated(
    objective: Objective, asked: Schedule, time: Array, joints: Array, held: NDArray[np.bool_], velocity_limits: Array
) -> ArmMotion:
    """Compare joint positions (m, dof) at control times (m,) with their targets."""
    result = ArmMotion.of_motion(
        objective.arm, asked.time, asked.ellipsoids, time, joints, spec=objective.spec,
        damping=objective.damping, path=asked.positions, velocity_limits=velocity_limits, held=held,
    )  # fmt: skip
    return replace(result, orientation_error=asked.targets(objective).axis_angles(result.joint_positions))


def _as_start(arm: Arm, start: ArrayLike | None) -> Array | None:
    if start is None:
        return None
    q = arm.require_within_limits(start, "start")
    if q.ndim != 1:
        raise InvalidInputError(f"start must be one configuration, shape ({arm.dof},); found shape {q.shape}")
    return np.clip(q, arm.lower, arm.upper)
