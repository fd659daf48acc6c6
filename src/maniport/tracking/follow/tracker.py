"""An arm follows a profile of ellipsoids, and a path where there is one.

A loop over control steps: in each, Pink's inverse kinematics weighs a `ManipulabilityEllipsoidTask`, a `PositionTask`,
a weak pull to the starting posture and what tasks the user adds, within limits of position, velocity and acceleration.
The tip goes before the ellipsoid, as the costs have it.

On one core of a shared 2-core machine the loop ran at 6 kHz for the Panda with path and limits, BLAS restricted to one
thread while it runs (by threadpoolctl); the search for a start took about two seconds for six seconds of motion.
"""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maniport.bodies import VELOCITY, Arm, EllipsoidSpec
from maniport.errors import InvalidInputError
from maniport.steps import Part, Progress, Step, pieces
from maniport.tracking.arm_model import require_trackable
from maniport.tracking.follow.control import Control
from maniport.tracking.follow.follower import Follower
from maniport.tracking.follow.starts import follow_from_best_start, follow_more_briskly, search_steps
from maniport.tracking.follow.track_result import TrackResult
from maniport.tracking.objective import DAMPING, Damping, Objective
from maniport.tracking.schedule import Schedule
from maniport.tracking.search.start_bank import StartBank
from maniport.validation import Array


def track(
    arm: Arm,
    profile: ArrayLike,
    *,
    time: ArrayLike,
    path: ArrayLike | None = None,
    start: ArrayLike | None = None,
    spec: EllipsoidSpec = VELOCITY,
    damping: Damping = DAMPING,
    weights: ArrayLike | None = None,
    bank: StartBank | None = None,
    random_state: Any = 0,
    progress: Progress | None = None,
    **control: Any,
) -> TrackResult:
    """Move an arm so that its velocity ellipsoids follow target ones, and its tip a target path.

    A profile or path that the arm cannot follow is no error: the result says where and by how much. Where a step has
    no answer, the arm is brought to rest and tries again. How it works: `maniport.tracking.follow.tracker`.

    Parameters
    ----------
    arm : Arm
        With at least three joints, and a joint for each degree of freedom.
    profile : array_like, shape (n, d, d)
        Target velocity ellipsoids in the arm's base frame, without damping, n ≥ 2.
    time : array_like, shape (n,)
        Increasing [s].
    path : array_like, shape (n, 3), optional
        Target positions of the tip in the base frame [m].
    start : array_like, shape (dof,), optional
        First configuration. Default: the best of several, found as `maniport.tracking.follow.starts` says.
    spec : EllipsoidSpec
        Which ellipsoids, of velocity.
    damping : float or Regularization
        What is added to the eigenvalues of all ellipsoids before they are compared; more than nothing, since an arm
        passes singular configurations. A number is relative to the arm's mean eigenvalue over 4096 samples; see
        `maniport.tracking.objective.fitted_damping`.
    weights : array_like, shape (n, m, m), optional
        How much each direction of the ellipsoids counts, see `ManipulabilityEllipsoidTask`; m = d (d + 1) / 2.
    bank : StartBank, optional
        To find the start with, made for this arm and these ellipsoids. Default: one of 16 384 samples (0.1 s).
    random_state : None, int or numpy.random.Generator
        Seed of the bank.
    progress : callable, optional
        Called with the name of a step and the fraction done.
    **control
        How: rate, interpolation, velocity_limits, acceleration_limits, gain, lm_damping, position_cost, and tasks and
        limits of Pink's own; see `maniport.tracking.Control`.

    Returns
    -------
    TrackResult

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
    asked = Schedule.checked(objective, profile, time, path, weights)
    begin = None if start is None else _as_start(arm, start)
    follower = Follower(objective, settings)
    if begin is None:
        bank = StartBank.given_or_built(bank, arm, spec, random_state)
    step = Step(progress, "move the robot")
    schedule = asked.sampled(objective, settings.rate, settings.interpolation)
    joints, held = _followed(follower, schedule, begin, bank, step)
    result = TrackResult.of_motion(
        arm, asked.time, asked.ellipsoids, schedule.time, joints, spec=spec, damping=objective.damping,
        path=asked.positions, velocity_limits=follower.velocity_limits, held=held,
    )  # fmt: skip
    step.end(_in_words(result))
    return result


def _followed(
    follower: Follower, schedule: Schedule, begin: Array | None, bank: StartBank | None, step: Part
) -> tuple[Array, NDArray[np.bool_]]:
    """Joint positions and where the arm was held: from a start, or the best one; with less damping too, as it pays."""
    steps, chooses = len(schedule), follower.control.lm_damping is None
    first, again = pieces(step, steps + (begin is None) * search_steps(schedule), chooses * steps)
    if begin is not None:
        followed = follower.follow(begin, schedule, first)
    else:
        assert bank is not None
        followed = follow_from_best_start(follower, bank, schedule, first)
    return follow_more_briskly(follower, followed, schedule, again) if chooses else followed


def _as_start(arm: Arm, start: ArrayLike) -> Array:
    q = arm.require_within_limits(start, "start")
    if q.ndim != 1:
        raise InvalidInputError(f"start must be one configuration, shape ({arm.dof},); found shape {q.shape}")
    return np.clip(q, arm.lower, arm.upper)


def _in_words(result: TrackResult) -> str:
    """How near the arm came."""
    found = f"distance of the ellipsoids {np.median(result.distance):.2f} (median)"
    if result.position_error is not None:
        found += f", tip {1e3 * np.percentile(result.position_error, 95):.2f} mm beside its path (95 %)"
    return found
