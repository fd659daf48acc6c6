"""When a robot passes each posture of a path: as near to the person's time as its limits allow, never before."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.ndimage import maximum_filter1d, uniform_filter1d

from maniport.defaults import RATE
from maniport.errors import InvalidInputError
from maniport.tracking.motion_limits import DERIVATIVES, MotionLimits
from maniport.tracking.plan.joint_path import JointPath
from maniport.tracking.schedule import require_few, require_rows
from maniport.validation import Array, as_number, as_times

REST = 3
"""Samples of rest at either end, so that differences up to the third see the robot start and stop."""
PASSES = 2
SHY = 0.999
"""Share of the velocity limits that the search uses, since samples lie between the grid's points."""
LONGEST_JERK = 0.1
"""Where full jerk takes longer to reach an acceleration limit, less acceleration is used [s], so that T stays short."""
HARDEST = 100.0
"""Bound of the path acceleration, in units that make the usual speed about 1, for a search that fails without [s⁻²]."""
EASED = 0.998
"""Share of an acceleration limit that is aimed at where it was exceeded."""


@dataclass(frozen=True, eq=False)
class Timed:
    """A motion at a constant rate, from rest to rest.

    Attributes
    ----------
    time : ndarray, shape (m,)
        From 0, at a constant rate [s].
    positions, velocities, accelerations : ndarray, shape (m, dof)
        [rad] or [m], and those for each second and second²: central differences of the positions.
    at : ndarray, shape (n,)
        When each of the given points is passed [s], increasing.
    begin, end : float
        When the motion along the given points begins and ends [s]; what is before and after is approach and return.
    deviation : ndarray, shape (dof,)
        Largest distance from the given points at these times [rad] or [m]: what limited jerk and the smooth path cost.

    See Also
    --------
    retime : makes it.
    with_approach : leads there from home, and back.
    """

    time: Array
    positions: Array
    velocities: Array
    accelerations: Array
    at: Array
    begin: float
    end: float
    deviation: Array

    @classmethod
    def of_positions(
        cls, positions: Array, rate: float, at: Array, begin: float, end: float, deviation: Array
    ) -> "Timed":
        """Complete a motion that is at rest at either end."""
        ends = np.concatenate([positions[:1], positions, positions[-1:]])
        return cls(
            time=np.arange(len(positions)) / rate,
            positions=positions,
            velocities=0.5 * rate * (ends[2:] - ends[:-2]),
            accelerations=rate**2 * np.diff(ends, 2, axis=0),
            at=at,
            begin=begin,
            end=end,
            deviation=deviation,
        )


def retime(limits: MotionLimits, time: ArrayLike, q: ArrayLike, *, rate: float = RATE, fineness: float = 1.0) -> Timed:
    """Pass postures one after the other as soon as the person did or the limits allow, whichever is later.

    A cubic spline through the postures, with the person's time for its parameter, is passed time-optimally within the
    limits of velocity and acceleration [1]_; the person's time counts as one more joint with the largest speed 1.
    A moving average over the samples then limits the jerk: of length T it keeps velocities and accelerations, makes
    jerks at most 2 a / T and leaves the path by about a T² / 24, where a is the acceleration. T is as short as
    possible, about 0.2 s at most, since the search uses no more acceleration than full jerk reaches in 0.1 s. Where
    samples exceed an acceleration, since the search knows its grid's points only, it is repeated with less of it there;
    what is left is cured by slowing down as a whole.

    Parameters
    ----------
    limits : MotionLimits
    time : array_like, shape (n,)
        When the person passes the postures [s], increasing; n ≥ 2.
    q : array_like, shape (n, dof)
        Postures within the position limits [rad] or [m].
    rate : float
        Samples a second, at least 10.
    fineness : float
        In how many pieces the search parts the path, as a share of the usual number: few make the motion a little
        longer.

    Returns
    -------
    Timed
        First, second and third differences of its samples are within the limits, and so are the positions.

    Raises
    ------
    InvalidInputError
        When shapes do not fit, times do not increase, a posture is beyond the limits, the motion takes more than
        3 million samples, or a jerk limit is smaller than what rounded positions have at that rate.

    See Also
    --------
    MotionLimits : of the joints.

    References
    ----------
    .. [1] Pham and Pham, "A new approach to time-optimal path parameterization based on reachability analysis",
       IEEE Transactions on Robotics, 2018.
    """
    frequency, times = as_number(rate, "rate", minimum=10.0), as_times(time, fewest=2)
    points = limits.arm.require_within_limits(q, "q")
    require_rows(len(times), q=(points, (limits.arm.dof,)))
    path = JointPath.through(times, points, limits.lower, limits.upper, fineness)
    require_few(path.grid[-1] * frequency)
    _require_above_rounding(limits, frequency)
    scale = np.ones(len(path.grid))
    for _ in range(PASSES):
        speed = _fastest(limits, path, scale)
        samples, rest, worst = _sampled(limits, path, speed, frequency)
        if worst.max() <= 1.0:
            break
        scale *= _easing(limits, path, speed, samples, rest, frequency)
    while worst.max() > 1.0:
        speed = speed / (1.0005 * max(worst[0], worst[1] ** (1 / 2), worst[2] ** (1 / 3)))
        samples, rest, worst = _sampled(limits, path, speed, frequency)
    at = path.passed(speed)[path.knots] + rest / frequency
    clock = np.arange(len(samples)) / frequency
    there = np.stack([np.interp(at, clock, column) for column in samples.T], axis=1)
    return Timed.of_positions(samples, frequency, at, 0.0, float(clock[-1]), np.abs(there - points).max(axis=0))


def _fastest(limits: MotionLimits, path: JointPath, scale: Array) -> Array:
    """Speeds at the grid, shape (k,): at most 1, with `scale` (k,) of the acceleration limits."""
    from maniport.tracking.plan.stages import Stages, fastest  # toppra loads all of matplotlib

    allowed = np.minimum(limits.acceleration, LONGEST_JERK * limits.jerk) * scale[:, None]
    steps = np.diff(path.grid)
    middles = path.grid[:-1] + 0.5 * steps
    first, second = path.spline(middles, 1), path.spline(middles, 2)
    used, between = ((np.abs(slope) / limits.velocity).max(axis=1) for slope in (path.first, first))
    used = np.maximum(used, np.maximum(np.append(between, 0.0), np.append(0.0, between)))
    most = np.minimum(1.0, SHY / np.maximum(used, SHY))
    less = np.minimum(allowed[1:], allowed[:-1])
    a, b = (path.first / allowed, first / less), (path.second / allowed, second / less)
    # The search knows absolute tolerances: in these units of the parameter the usual speed is about 1.
    unit = 1.0 / np.median(np.minimum(most, 1.0 / np.sqrt(np.maximum(np.abs(b[0]).max(axis=1), 1.0))))
    asked = [x / unit for x in a], [x / unit**2 for x in b], unit * steps, (unit * most) ** 2
    speed, lost = fastest(Stages(*asked), unit * path.grid)
    if lost.any():  # the linear programs are inexact with an unbounded u: a bound costs little time, and they succeed
        speed, lost = fastest(Stages(*asked, HARDEST), unit * path.grid)
    if lost.any():
        raise InvalidInputError(
            f"q cannot be passed within the limits of acceleration near {path.grid[int(lost.argmax())]:.3f} s after "
            "its start: it is too abrupt there; give a smoother path"
        )
    return np.asarray(speed / unit)


def _sampled(limits: MotionLimits, path: JointPath, speed: Array, rate: float) -> tuple[Array, int, Array]:
    """Samples with limited jerk, how many of them are rest at either end, and the largest share of each limit."""
    passed = path.passed(speed)
    require_few(passed[-1] * rate)
    clock = np.minimum(np.arange(int(np.ceil(passed[-1] * rate)) + 1) / rate, passed[-1])
    cell = np.clip(np.searchsorted(passed, clock, side="right") - 1, 0, len(passed) - 2)
    since = clock - passed[cell]
    gain = 0.5 * np.diff(speed**2) / np.diff(path.grid)
    parameter = path.grid[cell] + since * (speed[cell] + 0.5 * gain[cell] * since)
    inside = np.clip(parameter, path.grid[cell], path.grid[cell + 1])
    raw = np.ascontiguousarray(path.spline(inside).T)  # a joint a row: differences along rows are faster
    abrupt = 2.0 * rate**2 * np.abs(np.diff(np.pad(raw, ((0, 0), (1, 1)), "edge"), 2)).max(axis=1)
    widest = max(0, int(np.ceil(0.5 * ((abrupt / limits.jerk).max() * rate - 1.0))))
    require_few(len(clock) + 2.0 * widest)
    held = np.pad(raw, ((0, 0), (widest + REST, widest + REST)), "edge")

    def smoothed(half: int) -> Array:
        samples = uniform_filter1d(held, 2 * half + 1, axis=1, mode="nearest")
        samples = samples[:, widest - half : held.shape[1] - widest + half]
        return np.asarray(np.clip(samples.T, limits.lower, limits.upper))

    abrupt_half, half = -1, widest  # the moving average needs more than the first; the second is enough
    samples = smoothed(half)
    while half - abrupt_half > 1:
        middle = (abrupt_half + half) // 2
        tried = smoothed(middle)
        if _shares(limits, tried, rate, "jerk").max() <= 1.0:
            half, samples = middle, tried
        else:
            abrupt_half = middle
    return samples, half + REST, np.array([_shares(limits, samples, rate, quantity).max() for quantity in DERIVATIVES])


def _shares(limits: MotionLimits, samples: Array, rate: float, quantity: str) -> Array:
    """Shares of the limits of velocity, acceleration or jerk, by differences of that order, shape (dof, m - order)."""
    order = DERIVATIVES.index(quantity) + 1
    return np.asarray(np.abs(np.diff(samples.T, order)) * (rate**order / getattr(limits, quantity))[:, None])


def _easing(limits: MotionLimits, path: JointPath, speed: Array, samples: Array, rest: int, rate: float) -> Array:
    """Factors for the acceleration limits at the grid, shape (k,): below 1 around samples that exceed them."""
    share = _shares(limits, samples, rate, "acceleration").max(axis=0)
    share = maximum_filter1d(share, 2 * (rest - REST) + 1)  # what the moving average has mixed
    clock = (np.arange(len(share)) + 1 - rest) / rate
    cell = np.clip(np.searchsorted(path.passed(speed), clock, side="right") - 1, 0, len(path.grid) - 2)
    worst = np.zeros(len(path.grid))
    np.maximum.at(worst, cell, share)
    worst = maximum_filter1d(worst, 4)
    return np.where(worst > EASED, EASED / np.maximum(worst, EASED), 1.0)


def _require_above_rounding(limits: MotionLimits, rate: float) -> None:
    """Raise InvalidInputError when third differences of rounded positions alone exceed a jerk limit."""
    rounding = np.finfo(float).eps * np.maximum(np.abs(limits.lower), np.abs(limits.upper))
    least = 8.0 * rounding * rate**3
    i = int(np.argmax(least / limits.jerk))
    if least[i] > limits.jerk[i]:
        raise InvalidInputError(
            f"limits: jerk of {limits.arm.joint_names[i]} must be at least {least[i]:.2g} at {rate:g} samples a "
            f"second, since positions are rounded numbers; found {limits.jerk[i]:g}"
        )
