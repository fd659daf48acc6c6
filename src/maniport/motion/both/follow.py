"""Two arms follow target ellipsoids and paths step by step, as one robot: one quadratic programme for both."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maniport.arms import VELOCITY, ArmGroup, EllipsoidSpec
from maniport.arms.collisions import Collisions, as_collisions
from maniport.motion.arm_model import require_trackable
from maniport.motion.both.planner import as_arms, two
from maniport.motion.follow.follower import Control, Follower
from maniport.motion.follow.joint_motion import JointMotion
from maniport.motion.follow.track_result import TrackResult, in_words
from maniport.motion.follow.tracker import evaluated
from maniport.motion.limits import RememberingLimit
from maniport.motion.objective import Damping, Objective
from maniport.motion.schedule import Schedule
from maniport.util.defaults import DAMPING
from maniport.util.progress import Progress, Step


@dataclass(frozen=True, repr=False)
class TrackedArms(JointMotion):
    """A motion of both arms as one joint trajectory, and how well each follows; made by `track_arms`.

    Attributes
    ----------
    left, right : TrackResult
        The same motion of each arm.
    held : ndarray, shape (m,)
        At which control steps the quadratic program failed and the arms were brought to rest, bool.
    """

    left: TrackResult
    right: TrackResult
    held: NDArray[np.bool_]

    @property
    def each(self) -> tuple[TrackResult, TrackResult]:
        """Left and right."""
        return self.left, self.right

    def __repr__(self) -> str:
        return f"TrackedArms(left={self.left!r}, right={self.right!r})"


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
) -> TrackedArms:
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
        Joint positions of both to stay near [rad or m], such as those of `plan_arms`.
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
    settings, pair = Control(**control), as_arms(arms)
    apart = as_collisions(collisions, pair)
    if apart is not None and apart.known:
        settings = replace(settings, limits=(*settings.limits, RememberingLimit(apart)))
    postures = pair.require_within_limits(reference, "reference")
    objectives, schedules = [], []
    given = [two(value, name) for name, value in (("profiles", profiles), ("paths", paths), ("rotations", rotations))]
    for arm, columns, meant, (profile, path, turned) in zip(
        pair.each, pair.columns, pair.specs(spec), zip(*given, strict=True), strict=True
    ):
        require_trackable(arm, meant)
        objective = Objective.of(arm, meant, damping, settings.position_cost, positive=True)
        objectives.append(objective.keeping(settings.orientation_axes, settings.orientation_weight))
        schedules.append(Schedule.checked(objectives[-1], profile, time, path, None, turned, postures[..., columns]))
    follower = Follower(objectives, settings, pair)
    step = Step(progress, "Track trajectory of both arms")
    whole = replace(schedules[0], postures=postures), replace(schedules[1], postures=None)
    sampled = tuple(
        one.sampled(objective, settings.rate, settings.interpolation)
        for one, objective in zip(whole, objectives, strict=True)
    )
    joints, held = follower.follow(np.clip(postures[0], pair.lower, pair.upper), sampled, step)
    left, right = (
        evaluated(objective, one, sampled[0].time, joints[:, columns], held, follower.velocity_limits[columns])
        for objective, one, columns in zip(objectives, schedules, pair.columns, strict=True)
    )
    together = {}
    for name in ("joint_positions", "control_positions", "control_velocities", "control_accelerations"):
        together[name] = pair.joined(getattr(left, name), getattr(right, name))
    result = TrackedArms(
        joint_names=pair.joint_names, joint_units=pair.joint_units, time=left.time, control_time=left.control_time,
        left=left, right=right, held=held, **together,
    )  # fmt: skip
    step.end("; ".join(f"{side}: {in_words(one)}" for side, one in zip(("left", "right"), result.each, strict=True)))
    return result
