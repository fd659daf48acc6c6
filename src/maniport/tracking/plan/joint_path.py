"""A smooth joint path through waypoints, within the position limits, and the grid of its time parameterization."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline, CubicHermiteSpline, PchipInterpolator, make_interp_spline

from maniport.validation import Array

TOLERANCE = 1e-4
"""Largest distance from a waypoint, or beyond a limit, that needs no other spline [rad or m]."""


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
        overshoots = np.any((spline.c < lower - TOLERANCE) | (spline.c > upper + TOLERANCE))
        spline.c = np.clip(spline.c, lower, upper)  # a B-spline lies between its coefficients
        plain, pieces = spline, np.ones(len(since) - 1, np.int64)
        for finer in (4, 8, 16, 32) if overshoots else ():  # the error at the waypoints falls with the square
            fine = np.interp(np.arange(finer * (len(since) - 1) + 1) / finer, np.arange(len(since)), since)
            spline = make_interp_spline(fine, _within(since, points, fine, finer, lower, upper), k=3)
            spline.c = np.clip(spline.c, lower, upper)
            moved = np.abs(plain(fine) - spline(fine)).max(axis=1) > TOLERANCE
            pieces[np.minimum(np.flatnonzero(moved) // finer, len(since) - 2)] = finer
            if np.abs(spline(since) - points).max() <= TOLERANCE:
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
        beyond = (path < lower - TOLERANCE) | (path > upper + TOLERANCE)
        piece = np.minimum(np.arange(len(fine)) // finer, len(since) - 2)
        wrong = np.zeros(points.shape, dtype=bool)
        for end in (0, 1):
            np.logical_or.at(wrong, piece + end, beyond)
        if not np.any(wrong & (slopes != flat)):
            return np.asarray(np.clip(path, lower, upper))
        slopes = np.where(wrong, flat, slopes)
