"""The way from a home posture to where a motion begins, and back."""

import numpy as np
from numpy.typing import ArrayLike
from ruckig import InputParameter, Result, Ruckig, Synchronization, Trajectory

from maniport.errors import InvalidInputError
from maniport.tracking.motion_limits import MotionLimits
from maniport.tracking.plan.retiming import REST, Timed
from maniport.tracking.schedule import require_few
from maniport.validation import Array

CALM = 0.3
"""Share of velocity, acceleration and jerk limits on the way: nobody expects a robot to dash to where it starts."""


def with_approach(timed: Timed, limits: MotionLimits, home: ArrayLike, back: bool = True) -> Timed:
    """Begin at a home posture, and end there.

    The ways are straight lines in joint space from rest to rest, as fast as three tenths of the limits of velocity,
    acceleration and jerk allow.

    Parameters
    ----------
    timed : Timed
        A motion that begins and ends at rest.
    limits : MotionLimits
    home : array_like, shape (dof,)
        Within the position limits [rad] or [m].
    back : bool
        Return after the motion.

    Returns
    -------
    Timed
        Longer; `begin` and `end` say when the motion itself does, and `at` is shifted.

    Raises
    ------
    InvalidInputError
        When the home posture has another shape or is beyond the limits, or a way takes more than 3 million samples.

    See Also
    --------
    retime : makes the motion in between.
    """
    start = limits.arm.require_within_limits(home, "home")
    if start.ndim != 1:
        raise InvalidInputError(f"home must be one posture, shape ({limits.arm.dof},); found shape {start.shape}")
    rate = (len(timed.time) - 1) / timed.time[-1]
    ahead = _way(limits, start, timed.positions[0], rate)
    after = _way(limits, timed.positions[-1], start, rate) if back else timed.positions[:0]
    shift = len(ahead) / rate
    return Timed.of_positions(
        np.concatenate([ahead, timed.positions, after]),
        rate,
        timed.at + shift,
        timed.begin + shift,
        timed.end + shift,
        timed.deviation,
    )


def _way(limits: MotionLimits, first: Array, last: Array, rate: float) -> Array:
    """From rest to rest, shape (m, dof), with samples of rest at both ends."""
    request = InputParameter(limits.arm.dof)
    request.current_position, request.target_position = first.tolist(), last.tolist()
    request.max_velocity = (CALM * limits.velocity).tolist()
    request.max_acceleration = (CALM * limits.acceleration).tolist()
    request.max_jerk = (CALM * limits.jerk).tolist()
    request.synchronization = Synchronization.Phase
    way = Trajectory(limits.arm.dof)
    try:
        result = Ruckig(limits.arm.dof).calculate(request, way)
    except ValueError:  # its way to tell that one takes more than 7600 s
        result = "it takes hours"
    if result not in (Result.Working, Result.Finished):
        raise InvalidInputError(f"home: no way leads to it from {last.round(4).tolist()} within the limits: {result}")
    require_few(way.duration * rate)
    steps = int(np.ceil(way.duration * rate))
    between = [way.at_time(min(k / rate, way.duration))[0] for k in range(1, steps)]
    samples = [*[first] * (REST + 1), *between, *[last] * (REST + 1)]
    return np.asarray(np.clip(np.array(samples), limits.lower, limits.upper))
