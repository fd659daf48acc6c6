"""Motions from a home configuration to the start of a motion, and back."""

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from maniport.errors import InvalidInputError
from maniport.motion.motion_limits import MotionLimits
from maniport.motion.plan.time_parameterization import REST, Timed, retime
from maniport.util.validation import Array


def with_approach(
    timed: Timed, limits: MotionLimits, home: ArrayLike, back: bool = True, *, share: float = 0.3
) -> Timed:
    """Begin at a home configuration, and end there.

    The motions are straight lines in joint space from rest to rest.

    Parameters
    ----------
    timed : Timed
        A motion that begins and ends at rest.
    limits : MotionLimits
    home : array_like, shape (dof,)
        Within the position limits [rad] or [m].
    back : bool
        Return after the motion.
    share : float
        Share of the limits of velocity, acceleration and jerk that is used.

    Returns
    -------
    Timed
        Longer; `begin` and `end` are those of the motion itself, and `at` is shifted.

    Raises
    ------
    InvalidInputError
        When the home configuration has another shape or is beyond the limits, or a motion takes more than 3 million
        samples.
    """
    start = limits.arm.require_within_limits(home, "home")
    if start.ndim != 1:
        raise InvalidInputError(f"home must be one configuration, shape ({limits.arm.dof},); found shape {start.shape}")
    rate = (len(timed.time) - 1) / timed.time[-1]
    slow = replace(
        limits,
        velocity=share * limits.velocity,
        acceleration=share * limits.acceleration,
        jerk=share * limits.jerk,
    )
    before = _straight(slow, start, timed.positions[0], rate)
    after = _straight(slow, timed.positions[-1], start, rate) if back else timed.positions[:0]
    shift = len(before) / rate
    positions = np.concatenate([before, timed.positions, after])
    at, begin, end = timed.at + shift, timed.begin + shift, timed.end + shift
    return Timed.of_positions(positions, rate, at, begin, end, timed.deviation)


def _straight(limits: MotionLimits, first: Array, last: Array, rate: float) -> Array:
    """Samples of a straight motion from rest to rest, shape (m, dof)."""
    duration = float((np.abs(last - first) / limits.velocity).max())  # with velocity limits alone
    if duration < 1e-6:
        return np.repeat(first[None], REST + 1, axis=0)
    return retime(limits, [0.0, duration], np.stack([first, last]), rate=rate).positions
