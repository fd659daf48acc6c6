"""Gaps in a point's track: finding them, telling short from long, and filling the short ones."""

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import Akima1DInterpolator

Array = NDArray[np.float64]

LONGEST_GAP = 0.2
"""Gaps up to this many seconds are interpolated by default: the time in which a hand changes its speed appreciably."""


def find_gaps(
    time: Array, missing: NDArray[np.bool_], longest: float
) -> tuple[list[tuple[int, int]], list[tuple[int, int]]]:
    """Split the runs of missing frames into those up to `longest` seconds and the rest, as (start, stop) indices.

    Runs at the beginning and at the end belong to the rest: there is nothing to interpolate from.
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[0], missing.astype(int), [0]])))
    runs = [(int(start), int(stop)) for start, stop in zip(edges[::2], edges[1::2], strict=True)]
    short = [
        (start, stop)
        for start, stop in runs
        if start > 0 and stop < len(time) and time[stop] - time[start - 1] <= longest * (1 + 1e-9)
    ]
    return short, [run for run in runs if run not in short]


def interpolate(time: Array, track: Array, runs: list[tuple[int, int]]) -> None:
    """Fill the runs of one point's track, shape (n_frames, 3), in place."""
    seen = ~np.isnan(track[:, 0])
    if seen.sum() > 2:
        spline = Akima1DInterpolator(time[seen], track[seen])
    else:  # Akima's spline needs more than two points

        def spline(at: Array) -> Array:
            return np.stack([np.interp(at, time[seen], track[seen, k]) for k in range(3)], axis=-1)

    for start, stop in runs:
        track[start:stop] = spline(time[start:stop])
