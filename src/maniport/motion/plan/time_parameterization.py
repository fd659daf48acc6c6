"""Time parameterization: when a robot passes each waypoint, time-optimally within its limits.

A path through the waypoints is passed at the best speed by reachability analysis. With x the squared speed at the start
of a piece of the path and u its constant path acceleration, every constraint low ≤ a u + b x ≤ high holds at rest, low
< 0 < high, so that the speeds from which the path's end can be reached are those below a largest one. The largest
speeds are found from the end backward, the acceleration is then as large as they allow from the start forward (Pham &
Pham, "A new approach to time-optimal path parameterization based on reachability analysis", IEEE Transactions on
Robotics, 2018).
"""

from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import BSpline, CubicHermiteSpline, PchipInterpolator, make_interp_spline
from scipy.ndimage import uniform_filter1d

from maniport.errors import InvalidInputError
from maniport.motion.motion_limits import DERIVATIVES, MotionLimits
from maniport.motion.targets import require_few
from maniport.motion.trajectory import Trajectory
from maniport.util.defaults import RATE
from maniport.util.jit import kernel, part
from maniport.util.validation import Array

# Powers of the speed with which shares grow: of derivatives, torque and torque rate
POWERS = np.array([1, 2, 3, 2, 3])
RISE_TIME = 0.03
"""Longest time in which a torque rises from that of gravity at its limit of rate [s]. With 0.02 s the ladder recording
takes 52.2 s instead of 49.7 s; without a limit, it leaves its path by 3.5 mm instead of 2.3 mm."""
REST = 3  # Samples of rest at either end, so that differences up to the third see the robot start and stop
FLAT = 1e-12  # Ratio of a to b below which a constraint bounds x alone
PATH_TOLERANCE = 1e-4
"""Largest distance of a path beyond a limit that needs no other spline [rad or m]."""


def retime(
    limits: MotionLimits, time: ArrayLike, q: ArrayLike, *, rate: float = RATE
) -> Trajectory:
    """Pass waypoints (n, dof) at the demonstrated times (n,), or as soon as the limits allow where that is later.

    The result goes from rest at 0 s to rest and passes the waypoints at its ``time``. First, second and third
    differences of its samples, `rate` per second, are within the limits, and so are the positions. A joint that
    gravity alone overloads along the path exceeds its torque limit, by at most 5 % more.
    """
    path = JointPath.through(
        np.asarray(time), np.asarray(q, dtype=float), limits.arm.lower, limits.arm.upper
    )
    require_few(path.grid[-1] * rate)
    feasible, rows = _constraints(limits, path)
    speed = _fastest(feasible, path, rows)
    samples, at_rest, worst = _sampled(feasible, path, speed, rate)
    while worst.max() > 1.0:
        speed = speed / (1.0005 * (worst ** (1.0 / POWERS)).max())
        samples, at_rest, worst = _sampled(feasible, path, speed, rate)
    waypoints = path.passed(speed)[path.knots] + at_rest / rate
    clock = np.arange(len(samples)) / rate
    return Trajectory.of_positions(limits.arm, waypoints, clock, samples, limits)


def with_approach(motion: Trajectory, limits: MotionLimits, home: Array) -> Trajectory:
    """Begin and end at a home configuration, with straight joint motions at 30 % of the limits, from rest to rest."""
    rate = (len(motion.control_time) - 1) / motion.control_time[-1]
    slow = replace(
        limits, **{quantity: 0.3 * getattr(limits, quantity) for quantity in DERIVATIVES}
    )

    def straight(first: Array, last: Array) -> Array:
        duration = float((np.abs(last - first) / slow.velocity).max())  # with velocity limits alone
        if duration < 1e-6:
            return np.repeat(first[None], REST + 1, axis=0)
        return retime(slow, [0.0, duration], np.stack([first, last]), rate=rate).control_positions

    between = motion.control_positions
    before = straight(home, between[0])
    after = straight(between[-1], home)
    positions = np.concatenate([before, between, after])
    time = np.arange(len(positions)) / rate
    return Trajectory.of_positions(
        limits.arm, motion.time + len(before) / rate, time, positions, limits
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
        below = spline.c < lower - PATH_TOLERANCE
        above = spline.c > upper + PATH_TOLERANCE
        overshoots = np.any(below | above)
        spline.c = np.clip(spline.c, lower, upper)  # a B-spline lies between its coefficients
        pieces = np.ones(len(since) - 1, np.int64)
        finer = 32
        if overshoots:
            rows = np.arange(finer * (len(since) - 1) + 1) / finer
            fine = np.interp(rows, np.arange(len(since)), since)
            plain = spline
            path = _within(since, points, fine, finer, lower, upper)
            spline = make_interp_spline(fine, path, k=3)
            spline.c = np.clip(spline.c, lower, upper)
            moved = np.abs(plain(fine) - spline(fine)).max(axis=1) > PATH_TOLERANCE
            pieces[np.minimum(np.flatnonzero(moved) // finer, len(since) - 2)] = finer
        count = np.clip(since[-1] / 15e-3, 1250, 2500)  # twice as many make a motion 0.4 % shorter
        by_duration = np.ceil(np.diff(since) * (count / since[-1]) - 1e-9).astype(np.int64)
        n_pieces = np.maximum(pieces, by_duration)
        knots = np.concatenate([[0], np.cumsum(n_pieces)])
        grid = np.interp(np.arange(knots[-1] + 1), knots, since)
        return cls(spline, grid, spline(grid, 1), spline(grid, 2), knots)

    def passed(self, speed: Array) -> Array:
        """Return times of the grid points [s] for parameter speeds (k,) with squares that are linear between them."""
        return np.concatenate(
            [[0.0], np.cumsum(2.0 * np.diff(self.grid) / (speed[1:] + speed[:-1]))]
        )


def _within(
    since: Array, points: Array, fine: Array, finer: int, lower: Array, upper: Array
) -> Array:
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


class Constraints(NamedTuple):
    """Constraints low ≤ a u + b x ≤ high, arrays of shape (k, m)."""

    a: Array
    b: Array
    low: Array
    high: Array

    def joined(self, other: "Constraints") -> "Constraints":
        """Return these constraints and others of the same rows."""
        return Constraints(
            np.hstack([self.a, other.a]),
            np.hstack([self.b, other.b]),
            np.hstack([self.low, other.low]),
            np.hstack([self.high, other.high]),
        )


def _constraints(limits: MotionLimits, path: JointPath) -> tuple[MotionLimits, list[Constraints]]:
    """Constraints of accelerations and torques at the grid points and between them; torque limits leave gravity 5 %."""
    # where full jerk takes longer than 0.1 s to an acceleration limit, less is used, so that the average stays short
    allowed = np.minimum(limits.acceleration, 0.1 * limits.jerk)
    middles = 0.5 * (path.grid[1:] + path.grid[:-1])
    points = [
        (path.grid, path.first, path.second),
        (middles, path.spline(middles, 1), path.spline(middles, 2)),
    ]
    rows = []
    for _, first, second in points:
        ones = np.ones(first.shape)
        rows.append(Constraints(first / allowed, second / allowed, -ones, ones))
    if limits.dynamics is None or not np.isfinite(limits.effort).any():
        return limits, rows
    terms = [limits.dynamics.along(path.spline(at), first, second) for at, first, second in points]
    gravity_efforts = np.abs(np.concatenate([gravity for *_, gravity in terms]))
    if np.any(gravity_efforts >= limits.effort):
        most = gravity_efforts.max(axis=0)
        limits = replace(limits, effort=np.where(most >= limits.effort, 1.05 * most, limits.effort))
    finite = np.isfinite(limits.effort)
    effort = limits.effort[finite]
    change = RISE_TIME * limits.effort_rate[finite] / effort
    for i, (a, b, gravity) in enumerate(terms):
        share = gravity[:, finite] / effort
        torques = Constraints(
            a[:, finite] / effort,
            b[:, finite] / effort,
            np.maximum(-1.0 - share, -change),
            np.minimum(1.0 - share, change),
        )
        rows[i] = rows[i].joined(torques)
    return limits, rows


def _fastest(limits: MotionLimits, path: JointPath, rows: Sequence[Constraints]) -> Array:
    """Parameter speeds at the grid, shape (k,): at most 1."""
    steps = np.diff(path.grid)
    middles = path.grid[:-1] + 0.5 * steps
    used = (np.abs(path.first) / limits.velocity).max(axis=1)
    between = (np.abs(path.spline(middles, 1)) / limits.velocity).max(axis=1)
    used = np.maximum(used, np.maximum(np.append(between, 0.0), np.append(0.0, between)))
    # a little less, since samples lie between grid points
    most = np.minimum(1.0, 0.999 / np.maximum(used, 0.999))
    # each constraint holds at the start, middle and end of a piece
    at_grid, at_middle = rows
    a, b, grid_low, grid_high = at_grid
    ahead = steps[:, None]
    speed = np.empty(len(path.grid))
    a_middle = at_middle.a + ahead * at_middle.b
    of_u = np.hstack([a[:-1], a_middle, a[1:] + 2.0 * ahead * b[1:]])
    of_x = np.hstack([b[:-1], at_middle.b, b[1:]])
    low = np.hstack([grid_low[:-1], at_middle.low, grid_low[1:]])
    high = np.hstack([grid_high[:-1], at_middle.high, grid_high[1:]])
    fill_speeds(of_u, of_x, low, high, steps, most**2, speed)
    lost = speed[1:] + speed[:-1] <= 0.0
    if lost.any():
        raise InvalidInputError(
            "q cannot be passed within the limits of acceleration and torque near "
            f"{path.grid[int(lost.argmax())]:.3f} s after its start: it is too abrupt there; give a smoother path"
        )
    return speed


def _sampled(
    limits: MotionLimits, path: JointPath, speed: Array, rate: float
) -> tuple[Array, int, Array]:
    """Return samples with limited jerk, the number of samples at rest, and the shares of `_largest_shares`."""
    passed = path.passed(speed)
    require_few(passed[-1] * rate)
    clock = np.minimum(np.arange(int(np.ceil(passed[-1] * rate)) + 1) / rate, passed[-1])
    cell = np.clip(np.searchsorted(passed, clock, side="right") - 1, 0, len(passed) - 2)
    since = clock - passed[cell]
    gain = 0.5 * np.diff(speed**2) / np.diff(path.grid)
    parameter = path.grid[cell] + since * (speed[cell] + 0.5 * gain[cell] * since)
    inside = np.clip(parameter, path.grid[cell], path.grid[cell + 1])
    # a joint a row: differences along rows are faster
    raw = np.ascontiguousarray(path.spline(inside).T)
    bends = np.abs(np.diff(np.pad(raw, ((0, 0), (1, 1)), "edge"), 2)).max(axis=1)
    abrupt = (2.0 * rate**2 * bends / limits.jerk).max()
    torques = np.zeros((0, raw.shape[1]))
    if np.isfinite(limits.effort_rate).any() and limits.dynamics is not None:
        # the torques of averaged positions are nearly the averaged torques
        torques = np.ascontiguousarray((limits.torques(raw.T, rate) / limits.effort_rate).T)
        moving = torques - (limits.dynamics.gravity(raw.T) / limits.effort_rate).T
        abrupt = max(abrupt, 2.2 * np.abs(moving).max())
    widest = max(0, int(np.ceil(0.5 * (abrupt * rate - 1.0))))
    require_few(len(clock) + 2.0 * widest)
    at_rest = ((0, 0), (widest + REST, widest + REST))  # samples before and after the motion
    padded = np.pad(raw, at_rest, "edge")
    padded_torques = np.pad(torques, at_rest, "edge")

    def averaged(values: Array, half: int) -> Array:
        if len(values):
            average = uniform_filter1d(values, 2 * half + 1, axis=1, mode="nearest")
        else:
            average = values
        return np.asarray(average[:, widest - half : values.shape[1] - widest + half])

    def smoothed(half: int) -> Array:
        return np.clip(averaged(padded, half).T, limits.arm.lower, limits.arm.upper)

    def suffices(half: int) -> bool:
        rates = np.abs(np.diff(averaged(padded_torques, half))).max(initial=0.0) * rate
        jerks = np.abs(np.diff(smoothed(half).T, 3)).max(axis=1) * rate**3
        return bool(np.all(jerks <= limits.jerk) and rates <= 0.98)

    half = bisect_left(range(widest), True, key=suffices)  # the least that does
    samples = smoothed(half)
    return samples, half + REST, _largest_shares(limits, samples, rate)


def _largest_shares(limits: MotionLimits, samples: Array, rate: float) -> Array:
    """Largest shares of derivatives, of what gravity leaves of the torques, and of torque rates; 0 where unknown."""
    shares = np.zeros(len(POWERS))
    for i, quantity in enumerate(DERIVATIVES):
        changes = np.abs(np.diff(samples.T, i + 1)).max(axis=1)
        shares[i] = (rate ** (i + 1) * changes / getattr(limits, quantity)).max()
    if (
        limits.dynamics is not None
        and (np.isfinite(limits.effort) | np.isfinite(limits.effort_rate)).any()
    ):
        torques = limits.torques(samples, rate)
        gravity = limits.dynamics.gravity(samples)
        moving = torques - gravity
        left = np.maximum(
            limits.effort - np.sign(moving) * gravity, 1e-3 * np.minimum(limits.effort, 1e6)
        )
        shares[3] = (np.abs(moving) / left).max()
        shares[4] = (np.abs(np.diff(torques, axis=0)) * (rate / limits.effort_rate)).max()
    return shares


@kernel
def fill_speeds(
    a: Array, b: Array, low: Array, high: Array, steps: Array, limits: Array, speeds: Array
) -> None:
    """Fill the fastest speeds (k,) from rest to rest with low ≤ a u + b x ≤ high, x ≤ limits (k,); zero where none is.

    `a`, `b`, `low` and `high`, shape (k - 1, m), are the constraints of each piece, of length `steps` (k - 1,).
    """
    last = len(steps)
    speeds[last] = 0.0
    for i in range(last - 1, -1, -1):
        speeds[i] = _largest_start(a[i], b[i], low[i], high[i], steps[i], limits[i], speeds[i + 1])
    speeds[0] = 0.0
    for i in range(last):
        upper = _accelerations(a[i], b[i], low[i], high[i], steps[i], speeds[i], speeds[i + 1])[2]
        speeds[i + 1] = max(0.0, min(speeds[i + 1], speeds[i] + 2.0 * steps[i] * upper))
    for i in range(last + 1):
        speeds[i] = np.sqrt(speeds[i])


@part
def _largest_start(
    a: Array, b: Array, low: Array, high: Array, step: float, limit: float, end: float
) -> float:
    """Find the largest x up to a limit from which a piece can be passed and left with at most `end`."""
    x = limit
    for m in range(len(a)):
        if abs(a[m]) <= FLAT * abs(b[m]):
            if b[m] * x > high[m]:
                x = high[m] / b[m]
            elif b[m] * x < low[m]:
                x = low[m] / b[m]
    # Newton's method on a convex function: each iteration leaves a line for good
    for _ in range(2 * len(a) + 4):
        lower, lower_slope, upper, upper_slope = _accelerations(a, b, low, high, step, x, end)
        gap = lower - upper
        if gap <= 1e-12 * (abs(lower) + abs(upper)):
            return x
        if lower_slope <= upper_slope:
            break
        x = max(0.0, x - gap / (lower_slope - upper_slope))
    return x


@part
def _accelerations(
    a: Array, b: Array, low: Array, high: Array, step: float, x: float, end: float
) -> tuple[float, float, float, float]:
    """Return the largest lower and the smallest upper bound of u at x, both followed by their slopes."""
    lower = -0.5 * x / step
    lower_slope = -0.5 / step
    upper = 0.5 * (end - x) / step
    upper_slope = -0.5 / step
    for m in range(len(a)):
        if abs(a[m]) > FLAT * abs(b[m]):
            slope = -b[m] / a[m]
            least = low[m] / a[m]
            most = high[m] / a[m]
            if a[m] < 0.0:
                least, most = most, least
            if slope * x + least > lower:
                lower = slope * x + least
                lower_slope = slope
            if slope * x + most < upper:
                upper = slope * x + most
                upper_slope = slope
    return lower, lower_slope, upper, upper_slope
