"""Joint paths through waypoints, and the time-optimal speed along them by reachability analysis.

With x the squared speed at the start of a piece of the path and u its constant path acceleration, every constraint low
≤ a u + b x ≤ high holds at rest, low < 0 < high, so that the speeds from which the path's end can be reached are those
below a largest one. The largest speeds are found from the end backward, the acceleration is then as large as they allow
from the start forward (Pham & Pham, "A new approach to time-optimal path parameterization based on reachability
analysis", IEEE Transactions on Robotics, 2018).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline, CubicHermiteSpline, PchipInterpolator, make_interp_spline

from maniport.util.jit import kernel, part
from maniport.util.validation import Array

FLAT = 1e-12  # Ratio of a to b below which a constraint bounds x alone
PATH_TOLERANCE = 1e-4
"""Largest distance of a path beyond a limit that needs no other spline [rad or m]."""


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
        pieces, finer = np.ones(len(since) - 1, np.int64), 32
        if overshoots:
            fine = np.interp(np.arange(finer * (len(since) - 1) + 1) / finer, np.arange(len(since)), since)
            plain, spline = spline, make_interp_spline(fine, _within(since, points, fine, finer, lower, upper), k=3)
            spline.c = np.clip(spline.c, lower, upper)
            moved = np.abs(plain(fine) - spline(fine)).max(axis=1) > PATH_TOLERANCE
            pieces[np.minimum(np.flatnonzero(moved) // finer, len(since) - 2)] = finer
        count = np.clip(since[-1] / 15e-3, 1250, 2500)  # twice as many make a motion 0.4 % shorter
        n_pieces = np.maximum(pieces, np.ceil(np.diff(since) * (count / since[-1]) - 1e-9).astype(np.int64))
        knots = np.concatenate([[0], np.cumsum(n_pieces)])
        grid = np.interp(np.arange(knots[-1] + 1), knots, since)
        return cls(spline, grid, spline(grid, 1), spline(grid, 2), knots)

    def passed(self, speed: Array) -> Array:
        """Return times of the grid points [s] for parameter speeds (k,) whose squares are linear between them."""
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


@kernel
def fill_speeds(a, b, low, high, steps, limits, speeds):  # type: ignore[no-untyped-def]
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
def _largest_start(a, b, low, high, step, limit, end):  # type: ignore[no-untyped-def]
    """Find the largest x up to a limit from which a piece can be passed and left with at most `end`."""
    x = limit
    for m in range(len(a)):
        if abs(a[m]) <= FLAT * abs(b[m]):
            if b[m] * x > high[m]:
                x = high[m] / b[m]
            elif b[m] * x < low[m]:
                x = low[m] / b[m]
    for _ in range(2 * len(a) + 4):  # Newton's method on a convex function: each iteration leaves a line for good
        lower, lower_slope, upper, upper_slope = _accelerations(a, b, low, high, step, x, end)
        gap = lower - upper
        if gap <= 1e-12 * (abs(lower) + abs(upper)):
            return x
        if lower_slope <= upper_slope:
            break
        x = max(0.0, x - gap / (lower_slope - upper_slope))
    return x


@part
def _accelerations(a, b, low, high, step, x, end):  # type: ignore[no-untyped-def]
    """Return the largest lower and the smallest upper bound of u at x, both followed by their slopes."""
    lower, lower_slope = -0.5 * x / step, -0.5 / step
    upper, upper_slope = 0.5 * (end - x) / step, -0.5 / step
    for m in range(len(a)):
        if abs(a[m]) > FLAT * abs(b[m]):
            slope, least, most = -b[m] / a[m], low[m] / a[m], high[m] / a[m]
            if a[m] < 0.0:
                least, most = most, least
            if slope * x + least > lower:
                lower, lower_slope = slope * x + least, slope
            if slope * x + most < upper:
                upper, upper_slope = slope * x + most, slope
    return lower, lower_slope, upper, upper_slope
