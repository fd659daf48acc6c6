"""Where a motion is repeated in a recording: the times at which the hand goes out the farthest way, and comes back."""

from itertools import pairwise

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.signal import find_peaks, peak_widths

from maniport.demonstrations.arm_fit_result import ArmFit
from maniport.validation import Array

SMOOTHED = 0.1
"""Width of what the hand's way is smoothed with [s]."""

FEWEST = 3
"""A way out and back has at least so many frames."""

AS_FAR = 0.5
"""A repetition goes at least so far as this share of the farthest one."""

ALL_BUT = 0.9
"""A repetition lasts from where the hand has come this share of its way back, before, to where it has, after."""


def repetitions(fit: ArmFit) -> list[tuple[float, float]]:
    """Find (start, stop) [s] of each time that the hand goes out and comes back."""
    if len(fit) < FEWEST:
        return []
    hand = fit.arm.forward(fit.joint_angles)[:, :3, 3]
    step = float(np.median(np.diff(fit.time)))
    smooth = gaussian_filter1d(hand, SMOOTHED / step, axis=0, mode="nearest")
    way = _along(smooth)
    peaks, found = find_peaks(way, prominence=np.finfo(float).tiny)
    if not len(peaks):
        return []
    heights = found["prominences"]
    high = heights >= AS_FAR * heights.max()
    peaks, heights = peaks[high], heights[high]
    _, _, left, right = peak_widths(
        way, peaks, ALL_BUT, (heights, found["left_bases"][high], found["right_bases"][high])
    )
    valleys = [int(a + np.argmin(way[a:b])) for a, b in pairwise(peaks)]
    first = np.maximum(np.ceil(left).astype(int), [0, *(valley + 1 for valley in valleys)])
    last = np.minimum(np.floor(right).astype(int), [*valleys, len(way) - 1])
    return [(float(fit.time[a]), float(fit.time[b])) for a, b in zip(first, last, strict=True)]


def _along(hand: Array) -> Array:
    """How far places (n, 3) are from their median on the line on which they vary most, the longer side positive."""
    beside = hand - np.median(hand, axis=0)
    way = beside @ np.linalg.svd(beside - beside.mean(axis=0), full_matrices=False)[2][0]
    return np.asarray(way if way.max() >= -way.min() else -way)
