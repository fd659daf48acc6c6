"""Curves of the shares of limits over time, as paths of SVG."""

from dataclasses import dataclass

import numpy as np

from maniport.audit.checks import COLLISION, SHARES, FrameTable
from maniport.util.validation import Array

WIDTH = 640.0
HEIGHT = 150.0
MOST = 1.5  # share at the upper edge, unless a curve is higher
HIGHEST = 4.0  # share at which curves are cut
POINTS = 300  # of a curve


@dataclass(frozen=True)
class Curves:
    """Curves of one episode in a box of `WIDTH` × `HEIGHT`.

    Attributes
    ----------
    paths : tuple of (str, str)
        Kind, and points ``x,y …`` of a polyline.
    limit : float
        Height of the line at 100 %.
    top : int
        Share at the upper edge [%].
    collisions : tuple of (float, float)
        Begin and width of intervals with collisions.
    duration : float
        [s].
    """

    paths: tuple[tuple[str, str], ...]
    limit: float
    top: int
    collisions: tuple[tuple[float, float], ...]
    duration: float

    @classmethod
    def of(cls, table: FrameTable) -> "Curves":
        """Make the curves of a table of frames."""
        time = table.time - table.time[0]
        largest = MOST
        for kind in SHARES:
            finite = table.shares[kind][np.isfinite(table.shares[kind])]
            largest = max(largest, float(finite.max(initial=0.0)))
        top = min(largest, HIGHEST)
        paths = []
        for kind in SHARES:
            share = table.shares[kind]
            if np.isfinite(share).all():
                paths.append((kind, _points(time, np.minimum(share, top) / top)))
        scale = WIDTH / float(time[-1])
        hit = np.concatenate([[False], table.exceeded[COLLISION], [False]])
        changes = np.flatnonzero(np.diff(hit.astype(int)))
        intervals = []
        for first, last in zip(changes[::2].tolist(), changes[1::2].tolist(), strict=True):
            begin = float(time[first])
            end = float(time[min(last, len(time) - 1)])
            intervals.append((scale * begin, max(scale * (end - begin), 1.0)))
        return cls(
            tuple(paths),
            HEIGHT * (1.0 - 1.0 / top),
            round(100.0 * top),
            tuple(intervals),
            float(time[-1]),
        )


def _points(time: Array, heights: Array) -> str:
    """Return the largest of neighboring heights (n,) in [0, 1] as points of a polyline."""
    size = max(1, -(-len(time) // POINTS))
    points = []
    for first in range(0, len(time), size):
        x = WIDTH * time[first] / time[-1]
        y = HEIGHT * (1.0 - heights[first : first + size].max())
        points.append(f"{x:.1f},{y:.1f}")
    return " ".join(points)
