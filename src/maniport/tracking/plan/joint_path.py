"""A smooth path of the joints through postures, within the position limits, and the grid that a search sees of it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline, CubicHermiteSpline, PchipInterpolator, make_interp_spline

from maniport.validation import Array

CELL, FEWEST, MOST = 7.5e-3, 2500, 5000
"""Length of the pieces in which a path is searched [s], and within which bounds their least number stays: coarser ones
cost time on the way, finer ones take longer to search. Half of them lengthen a motion by 0.4 %."""
FINER = (4, 8, 16, 32)
"""Points for each piece of a path that is smoothed anew because it came too close to a limit: the first that is enough,
since what is smoothed passes the postures in a distance that falls with their square."""
ENOUGH = 1e-4
"""How far a path may be moved to stay within its limits without being smoothed anew, and then so finely that it passes
the postures in no larger distance [rad or m]."""


@dataclass(frozen=True, eq=False)
class JointPath:
    """A path with continuous second derivatives; its parameter is the person's time since the first posture [s].

    Attributes
    ----------
    spline : BSpline
        From the parameter to joint positions (dof,).
    grid : ndarray, shape (k,)
        Where a search looks.
    first, second : ndarray, shape (k, dof)
        Derivatives there.
    knots : ndarray of int, shape (n,)
        Indices of the postures in the grid.
    """

    spline: BSpline
    grid: Array
    first: Array
    second: Array
    knots: NDArray[np.int64]

    @classmethod
    def through(cls, times: Array, points: Array, lower: Array, upper: Array, fineness: float = 1.0) -> "JointPath":
        """Lay a cubic spline through postures, shape (n, dof), at increasing times, shape (n,), within limits."""
        since = times - times[0]
        spline = make_interp_spline(since, points, k=min(3, len(since) - 1))
        swings = np.any((spline.c < lower - ENOUGH) | (spline.c > upper + ENOUGH))
        spline.c = np.clip(spline.c, lower, upper)  # a B-spline lies between its coefficients
        plain, smoothed = spline, np.ones(len(since) - 1, np.int64)
        """In how many pieces a search must see each of the path's, so as to see how it was smoothed."""
        for finer in FINER if swings else ():
            fine = np.interp(np.arange(finer * (len(since) - 1) + 1) / finer, np.arange(len(since)), since)
            spline = make_interp_spline(fine, _held_back(since, points, fine, finer, lower, upper), k=3)
            spline.c = np.clip(spline.c, lower, upper)
            moved = np.abs(plain(fine) - spline(fine)).max(axis=1) > ENOUGH
            smoothed[np.minimum(np.flatnonzero(moved) // finer, len(since) - 2)] = finer
            if np.abs(spline(since) - points).max() <= ENOUGH:
                break
        count = fineness * np.clip(since[-1] / CELL, FEWEST, MOST)
        each = np.maximum(smoothed, np.ceil(np.diff(since) * (count / since[-1]) - 1e-9).astype(np.int64))
        knots = np.concatenate([[0], np.cumsum(each)])
        grid = np.interp(np.arange(knots[-1] + 1), knots, since)
        return cls(spline, grid, spline(grid, 1), spline(grid, 2), knots)

    def passed(self, speed: Array) -> Array:
        """When the points of the grid are passed [s] at these speeds (k,), squares of which are linear in between."""
        return np.concatenate([[0.0], np.cumsum(2.0 * np.diff(self.grid) / (speed[1:] + speed[:-1]))])


def _held_back(since: Array, points: Array, fine: Array, finer: int, lower: Array, upper: Array) -> Array:
    """Points (m, dof) of a path through postures that stays within limits, at times `fine` (m,), so many a piece."""
    slopes, flat = make_interp_spline(since, points, k=min(3, len(since) - 1))(since, 1), _slopes(since, points)
    while True:
        path = CubicHermiteSpline(since, points, slopes)(fine)
        beyond = (path < lower - ENOUGH) | (path > upper + ENOUGH)
        piece = np.minimum(np.arange(len(fine)) // finer, len(since) - 2)
        wrong = np.zeros(points.shape, dtype=bool)
        for end in (0, 1):
            np.logical_or.at(wrong, piece + end, beyond)
        if not np.any(wrong & (slopes != flat)):
            return np.asarray(np.clip(path, lower, upper))
        slopes = np.where(wrong, flat, slopes)


def _slopes(since: Array, points: Array) -> Array:
    return np.asarray(PchipInterpolator(since, points)(since, 1))
