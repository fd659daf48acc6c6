"""Two arms follow target ellipsoids and paths step by step, as one robot: one quadratic programme for both."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from maniport.arms import VELOCITY, ArmGroup, EllipsoidSpec, as_group
from maniport.arms.collisions import Collisions, as_collisions
from maniport.motion.arm_model import require_trackable
from maniport.motion.follow.follower import Control, Follower
from maniport.motion.follow.tracker import evaluated
from maniport.motion.limits import RememberingLimit
from maniport.motion.objective import Damping, Objective
from maniport.motion.plan.plan_motion import of_each
from maniport.motion.robot_motion import RobotMotion
from maniport.motion.schedule import Schedule
from maniport.motion.trajectory import Clearance, Trajectory
from maniport.util.defaults import DAMPING
from maniport.util.progress import Progress, Step


def track_arms(
    arms: ArmGroup,
    profiles: Sequence[ArrayLike],
    *,
    time: ArrayLike,
    reference: ArrayLike,
    paths: Sequence[ArrayLike] | None = None,
    rotations: Sequence[ArrayLike] | None = None,
    spec: EllipsoidSpec = VELOCITY,
    damping: Damping = DAMPING,
    collisions: Collisions | bool | None = None,
    progress: Progress | None = None,
    **control: Any,
) -> RobotMotion:
    """Move two arms so that the velocity ellipsoids of each follow target ones, and its end effector a target path.

    As `maniport.motion.track` for one arm, from the first configuration of the reference on.

    Parameters
    ----------
    arms : ArmGroup
    profiles : two of array_like, shape (n, d, d)
        Target velocity ellipsoids of the left and of the right arm in their common frame, without damping, n ≥ 2.
    time : array_like, shape (n,)
        Increasing [s].
    reference : array_like, shape (n, dof)
        Joint positions of both to stay near [rad or m], such as those of `plan_motion`.
    paths : two of array_like, shape (n, 3), optional
        Target positions of the end effectors in that frame [m].
    rotations : two of array_like, shape (n, 3, 3), optional
        Target orientations.
    spec, damping, progress
        As in `maniport.motion.track`.
    collisions : Collisions or bool, optional
        Collision model for a `CollisionLimit`; True: of the arms with themselves and one another.
    **control
        As in `maniport.motion.track`, for the joints of both.

    Raises
    ------
    InvalidInputError
        When an argument has a wrong shape or value, or the reference begins beyond the limits.
    NotSPDError
        When an ellipsoid is asymmetric or indefinite.
    """
    settings, pair = Control(**control), as_group(arms)
    apart = as_collisions(collisions, pair)
    if apart is not None and apart.known:
        settings = replace(settings, limits=(*settings.limits, RememberingLimit(apart)))
    postures = pair.require_within_limits(reference, "reference")
    objectives, schedules = [], []
    given = [
        of_each(value, name, len(pair))
        for name, value in (("profiles", profiles), ("paths", paths), ("rotations", rotations))
    ]
    for arm, columns, meant, (profile, path, turned) in zip(
        pair.arms, pair.columns, pair.specs(spec), zip(*given, strict=True), strict=True
    ):
        require_trackable(arm, meant)
        objective = Objective.of(arm, meant, damping, settings.position_cost, positive=True)
        objectives.append(objective.keeping(settings.orientation_axes, settings.orientation_weight))
        schedules.append(Schedule.checked(objectives[-1], profile, time, path, None, turned, postures[..., columns]))
    follower = Follower(objectives, settings, pair)
    step = Step(progress, "Track trajectory of all arms")
    whole = replace(schedules[0], postures=postures), *(replace(own, postures=None) for own in schedules[1:])
    sampled = tuple(
        own.sampled(objective, settings.rate, settings.interpolation)
        for own, objective in zip(whole, objectives, strict=True)
    )
    joints, held = follower.follow(np.clip(postures[0], pair.lower, pair.upper), sampled, step)
    motions = tuple(
        evaluated(objective, own, sampled[0].time, joints[:, columns], held, follower.velocity_limits[columns])
        for objective, own, columns in zip(objectives, schedules, pair.columns, strict=True)
    )
    names = "joint_positions", "control_positions", "control_velocities", "control_accelerations"
    together = {name: pair.joined(*(getattr(motion, name) for motion in motions)) for name in names}
    trajectory = Trajectory(
        joint_names=pair.joint_names, joint_units=pair.joint_units, time=motions[0].time,
        control_time=motions[0].control_time, **together,
    )  # fmt: skip
    result = RobotMotion(pair, trajectory, motions, clearance=Clearance.of(apart, trajectory))
    step.end()
    return result
