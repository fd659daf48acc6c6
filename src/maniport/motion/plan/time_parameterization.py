"""Time parameterization: when a robot passes each waypoint, time-optimally within its limits."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import BSpline, CubicHermiteSpline, PchipInterpolator, make_interp_spline
from scipy.ndimage import maximum_filter1d, uniform_filter1d

from maniport.errors import InvalidInputError
from maniport.motion.motion_limits import DERIVATIVES, MotionLimits
from maniport.motion.plan.path_speed import fill_speeds
from maniport.motion.schedule import require_few, require_rows
from maniport.util.defaults import RATE
from maniport.util.validation import Array, as_number, as_times

REST = 3  # Samples of rest at either end, so that differences up to the third see the robot start and stop
PATH_TOLERANCE = 1e-4
"""Largest distance of a path from a waypoint, or beyond a limit, that needs no other spline [rad or m]."""


@dataclass(frozen=True, eq=False)
class Timed:
    """A motion at a constant rate, from rest to rest; `retime` makes it.

    Attributes
    ----------
    time : ndarray, shape (m,)
        From 0, at a constant rate [s].
    positions, velocities, accelerations : ndarray, shape (m, dof)
        [rad] or [m], and per second and second²: central differences of the positions.
    at : ndarray, shape (n,)
        When each of the given waypoints is passed [s], increasing.
    begin, end : float
        When the motion along the waypoints begins and ends [s]; `with_approach` adds motions before and after.
    deviation : ndarray, shape (dof,)
        Largest distance from the waypoints at these times [rad] or [m], due to limited jerk and the smooth path.
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
        """Add times, velocities and accelerations to positions (m, dof) that are at rest at either end."""
        ends = np.concatenate([positions[:1], positions, positions[-1:]])
        velocities, accelerations = 0.5 * rate * (ends[2:] - ends[:-2]), rate**2 * np.diff(ends, 2, axis=0)
        time = np.arange(len(positions)) / rate
        return cls(time, positions, velocities, accelerations, at, begin, end, deviation)

    def waypoints(self) -> Array:
        """Joint positions at the times `at`, shape (n, dof)."""
        return np.stack([np.interp(self.at, self.time, column) for column in self.positions.T], axis=1)


def retime(limits: MotionLimits, time: ArrayLike, q: ArrayLike, *, rate: float = RATE) -> Timed:
    """Pass waypoints at the demonstrated times, or as soon as the limits allow where that is later.

    A cubic spline through the waypoints, with the demonstrated time as its parameter, is passed time-optimally within
    the limits of velocity and acceleration [1]_ and with a parameter speed of at most 1. A moving average over the
    samples then limits the jerk: of length T it keeps velocities and accelerations, makes jerks at most 2 a / T and
    leaves the path by about a T² / 24, where a is the acceleration. T is as short as possible, about 0.2 s at most,
    since the search uses no more acceleration than full jerk reaches in 0.1 s. Where samples exceed an acceleration
    between the points of the search grid, the search is repeated with less of it there; a remaining excess slows down
    the whole motion.

    Parameters
    ----------
    limits : MotionLimits
    time : array_like, shape (n,)
        Demonstrated times of the waypoints [s], increasing; n ≥ 2.
    q : array_like, shape (n, dof)
        Waypoints within the position limits [rad] or [m].
    rate : float
        Samples per second, at least 10.

    Returns
    -------
    Timed
        First, second and third differences of its samples are within the limits, and so are the positions.

    Raises
    ------
    InvalidInputError
        When shapes do not fit, times do not increase, a waypoint is beyond the limits, the motion takes more than
        3 million samples, or a jerk limit is smaller than the rounding of positions at that rate.

    References
    ----------
    .. [1] Pham and Pham, "A new approach to time-optimal path parameterization based on reachability analysis",
       IEEE Transactions on Robotics, 2018.
    """
    frequency, times = as_number(rate, "rate", minimum=10.0), as_times(time, fewest=2)
    points = limits.arm.require_within_limits(q, "q")
    require_rows(len(times), q=(points, (limits.arm.dof,)))
    path = JointPath.through(times, points, limits.lower, limits.upper)
    require_few(path.grid[-1] * frequency)
    _require_above_rounding(limits, frequency)
    scale = np.ones(len(path.grid))
    for _ in range(2):
        speed = _fastest(limits, path, scale)
        samples, rest, worst = _sampled(limits, path, speed, frequency)
        if worst.max() <= 1.0:
            break
        scale *= _easing(limits, path, speed, samples, rest, frequency)
    while worst.max() > 1.0:
        speed = speed / (1.0005 * max(worst[0], worst[1] ** (1 / 2), worst[2] ** (1 / 3)))
        samples, rest, worst = _sampled(limits, path, speed, frequency)
    at = path.passed(speed)[path.knots] + rest / frequency
    timed = Timed.of_positions(samples, frequency, at, 0.0, (len(samples) - 1) / frequency, np.zeros(limits.arm.dof))
    return replace(timed, deviation=np.abs(timed.waypoints() - points).max(axis=0))


def with_approach(
    timed: Timed, limits: MotionLimits, home: ArrayLike, back: bool = True, *, share: float = 0.3
) -> Timed:
    """Begin at a home configuration, and end there, with straight motions in joint space from rest to rest.

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
    slow = replace(limits, **{quantity: share * getattr(limits, quantity) for quantity in DERIVATIVES})
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


def _fastest(limits: MotionLimits, path: "JointPath", scale: Array) -> Array:
    """Parameter speeds at the grid, shape (k,): at most 1, with `scale` (k,) of the acceleration limits."""
    # where full jerk takes longer than 0.1 s to an acceleration limit, less is used, so that the average stays short
    allowed = np.minimum(limits.acceleration, 0.1 * limits.jerk) * scale[:, None]
    steps = np.diff(path.grid)
    middles = path.grid[:-1] + 0.5 * steps
    first, second = path.spline(middles, 1), path.spline(middles, 2)
    used, between = ((np.abs(slope) / limits.velocity).max(axis=1) for slope in (path.first, first))
    used = np.maximum(used, np.maximum(np.append(between, 0.0), np.append(0.0, between)))
    most = np.minimum(1.0, 0.999 / np.maximum(used, 0.999))  # a little less, since samples lie between grid points
    less = np.minimum(allowed[1:], allowed[:-1])
    a, b = (path.first / allowed, first / less), (path.second / allowed, second / less)
    # each constraint holds at the start, middle and end of a piece
    ahead = steps[:, None]
    columns = np.hstack([a[0][:-1], a[1] + ahead * b[1], a[0][1:] + 2.0 * ahead * b[0][1:]])
    speed = np.empty(len(path.grid))
    fill_speeds(columns, np.hstack([b[0][:-1], b[1], b[0][1:]]), steps, most**2, speed)
    lost = speed[1:] + speed[:-1] <= 0.0
    if lost.any():
        raise InvalidInputError(
            f"q cannot be passed within the limits of acceleration near {path.grid[int(lost.argmax())]:.3f} s after "
            "its start: it is too abrupt there; give a smoother path"
        )
    return speed


def _sampled(limits: MotionLimits, path: "JointPath", speed: Array, rate: float) -> tuple[Array, int, Array]:
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


def _easing(limits: MotionLimits, path: "JointPath", speed: Array, samples: Array, rest: int, rate: float) -> Array:
    """Factors for the acceleration limits at the grid, shape (k,): below 1 around samples that exceed them."""
    share = _shares(limits, samples, rate, "acceleration").max(axis=0)
    share = maximum_filter1d(share, 2 * (rest - REST) + 1)  # what the moving average has mixed
    clock = (np.arange(len(share)) + 1 - rest) / rate
    cell = np.clip(np.searchsorted(path.passed(speed), clock, side="right") - 1, 0, len(path.grid) - 2)
    worst = np.zeros(len(path.grid))
    np.maximum.at(worst, cell, share)
    worst = maximum_filter1d(worst, 4)
    aimed = 0.998
    return np.where(worst > aimed, aimed / np.maximum(worst, aimed), 1.0)


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


@dataclass(frozen=True, eq=False)
class JointPath:
    """A path with continuous second derivatives; its parameter is the time since the first waypoint [s]."""

    spline: BSpline  # from the parameter to joint positions (dof,)
    grid: Array  # (k,), parameters at which the time parameterization knows the path
    first: Array  # (k, dof), first derivatives there
    second: Array  # (k, dof), second derivatives there
    knots: NDArray[np.int64]  # (n,), indices of the waypoints in the grid

    @classmethod
    def through(cls, times: Array, points: Array, lower: Array, upper: Array) -> "JointPath":
        """Lay a cubic spline through waypoints (n, dof) at increasing times (n,), within limits."""
        since = times - times[0]
        spline = make_interp_spline(since, points, k=min(3, len(since) - 1))
        overshoots = np.any((spline.c < lower - PATH_TOLERANCE) | (spline.c > upper + PATH_TOLERANCE))
        spline.c = np.clip(spline.c, lower, upper)  # a B-spline lies between its coefficients
        plain, pieces = spline, np.ones(len(since) - 1, np.int64)
        for finer in (4, 8, 16, 32) if overshoots else ():  # the error at the waypoints falls with the square
            fine = np.interp(np.arange(finer * (len(since) - 1) + 1) / finer, np.arange(len(since)), since)
            spline = make_interp_spline(fine, _within(since, points, fine, finer, lower, upper), k=3)
            spline.c = np.clip(spline.c, lower, upper)
            moved = np.abs(plain(fine) - spline(fine)).max(axis=1) > PATH_TOLERANCE
            pieces[np.minimum(np.flatnonzero(moved) // finer, len(since) - 2)] = finer
            if np.abs(spline(since) - points).max() <= PATH_TOLERANCE:
                break
        count = np.clip(since[-1] / 15e-3, 1250, 2500)  # twice as many make a motion 0.4 % shorter
        each = np.maximum(pieces, np.ceil(np.diff(since) * (count / since[-1]) - 1e-9).astype(np.int64))
        knots = np.concatenate([[0], np.cumsum(each)])
        grid = np.interp(np.arange(knots[-1] + 1), knots, since)
        return cls(spline, grid, spline(grid, 1), spline(grid, 2), knots)

    def passed(self, speed: Array) -> Array:
        """Times at which the grid is passed [s] with parameter speeds (k,), squares of which are linear between."""
        return np.concatenate([[0.0], np.cumsum(2.0 * np.diff(self.grid) / (speed[1:] + speed[:-1]))])


def _within(since: Array, points: Array, fine: Array, finer: int, lower: Array, upper: Array) -> Array:
    """Positions (m, dof) of a path through waypoints that stays within limits, at times `fine` (m,)."""
    slopes = make_interp_spline(since, points, k=min(3, len(since) - 1))(since, 1)
    flat = np.asarray(PchipInterpolator(since, points)(since, 1))
    while True:
        path = CubicHermiteSpline(since, points, slopes)(fine)
        beyond = (path < lower - PATH_TOLERANCE) | (path > upper + PATH_TOLERANCE)
        piece = np.minimum(np.arange(len(fine)) // finer, len(since) - 2)
        wrong = np.zeros(points.shape, dtype=bool)
        for end in (0, 1):
            np.logical_or.at(wrong, piece + end, beyond)
        if not np.any(wrong & (slopes != flat)):
            return np.asarray(np.clip(path, lower, upper))
        slopes = np.where(wrong, flat, slopes)
