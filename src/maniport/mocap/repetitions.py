"""Repetitions in a recording: the times at which the hand moves out the farthest way, and back."""

from itertools import pairwise

import numpy as np
from scipy.ndimage import gaussian_filter1d

from maniport.mocap.arm_ik_result import ArmFit
from maniport.util.validation import Array


def repetitions(
    fit: ArmFit, width: float = 0.1, least: float = 0.5, returned: float = 0.9
) -> list[tuple[float, float]]:
    """Find (start, stop) [s] of each time that the hand moves out and back.

    The path is smoothed over `width` [s]; a repetition reaches at least a share `least` of the farthest one, and lasts
    from where the hand has `returned` by this share before, to where it has after.
    """
    from scipy.signal import find_peaks, peak_widths  # takes half a second to load

    if len(fit) < 3:
        return []
    hand = fit.arm.forward(fit.joint_angles)[:, :3, 3]
    step = float(np.median(np.diff(fit.time)))
    path = _along(gaussian_filter1d(hand, width / step, axis=0, mode="nearest"))
    peaks, found = find_peaks(path, prominence=np.finfo(float).tiny)
    if not len(peaks):
        return []
    heights = found["prominences"]
    high = heights >= least * heights.max()
    peaks = peaks[high]
    prominences = (heights[high], found["left_bases"][high], found["right_bases"][high])
    _, _, left, right = peak_widths(path, peaks, returned, prominences)
    valleys = [int(a + np.argmin(path[a:b])) for a, b in pairwise(peaks)]
    first = np.maximum(np.ceil(left).astype(int), [0, *(valley + 1 for valley in valleys)])
    last = np.minimum(np.floor(right).astype(int), [*valleys, len(path) - 1])
    return [(float(fit.time[a]), float(fit.time[b])) for a, b in zip(first, last, strict=True)]


def _along(hand: Array) -> Array:
    """Project places (n, 3) from their median on the line on which they vary most, the longer side positive."""
    offsets = hand - np.median(hand, axis=0)
    path = offsets @ np.linalg.svd(offsets - offsets.mean(axis=0), full_matrices=False)[2][0]
    return np.asarray(path if path.max() >= -path.min() else -path)
