"""Long paths: solved in blocks by several threads, with memory that does not grow, and joined without a seam.

The frames of a path are tied to their neighbours alone, and what ties them fades within seconds. So blocks are solved
each on its own, to their own end, and then the frames around each cut once more, between neighbours that stand still:
the result is that of the whole path solved at once to the same end, and no joint steps at a cut.
"""

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from itertools import pairwise

import numpy as np
from numba import config

from maniport.demonstrations.path_solver import Residual, solve_path
from maniport.validation import Array

BLOCK = 4096
"""The most frames that are solved at once."""

AROUND = 512
"""So many frames on either side of a cut are solved again: at 240 Hz those of 2 s, at 30 Hz of 17 s."""

TIED = 2
"""Frames at either end of these that stand still: a second difference reaches so far."""


def solve_long(
    residual: Callable[[slice], Residual],
    start: Array,
    lower: Array,
    upper: Array,
    smoothing: Array,
    pull: Array,
    neutral: Array,
    progress: Callable[[float], None] | None = None,
    block: int = BLOCK,
) -> Array:
    """Fit all frames together, at most so many at a time."""
    if len(start) <= block:
        return solve_path(residual(slice(None)), start, lower, upper, smoothing, pull, neutral, progress)
    q = start.copy()
    cuts = [part.start for part in parts_of(len(q), block)][1:]

    def solve(part: slice, still: int) -> None:
        rows = smoothing[part]
        q[part] = solve_path(residual(part), q[part], lower, upper, rows, pull, neutral, still=still)

    done = 0
    blocks = [(slice(a, b), 0) for a, b in pairwise([0, *cuts, len(q)])]
    joints = [(slice(cut - AROUND, cut + AROUND), TIED) for cut in cuts]
    threads = ThreadPoolExecutor(max(1, int(config.NUMBA_NUM_THREADS)), thread_name_prefix="maniport-fit")
    try:
        for stage in (blocks, joints):
            for task in as_completed([threads.submit(solve, *one) for one in stage]):
                task.result()
                done += 1
                if progress is not None:
                    progress(done / (len(blocks) + len(joints)))
    finally:
        threads.shutdown(cancel_futures=True)  # Ctrl-C waits for the blocks that are being solved, not for all
    return q


def parts_of(count: int, most: int) -> Iterator[slice]:
    """Share a number of rows evenly among as few parts as hold at most so many each."""
    edges = np.linspace(0, count, max(1, -(-count // most)) + 1).round().astype(int)
    for first, last in pairwise(edges.tolist()):
        yield slice(first, last)
