"""Directions of axes over time, without the jumps that their undefined sign would make."""

import numpy as np

from maniport.spd.ellipsoid import axes
from maniport.validation import Array

ROUND = 0.97
"""Two semi-axes whose lengths are nearer to equal than this ratio have no direction of their own."""

OPPOSITE = 0.5
"""Of two profiles, vectors are opposite when the angle between them is more than 120°; this is minus its cosine."""


def axis_over_time(points: Array, which: int, like: Array | None = None) -> Array:
    """Unit vectors along the major or the minor axis of every ellipsoid of a profile.

    An axis is a line, not an arrow: v and −v are the same. Every vector is given the sign that agrees with the last
    one before it, so that the components are continuous as long as the axis turns by less than 90° a step. Where the
    next axis has almost the same length, no direction is defined and the components are nan.

    Parameters
    ----------
    points : ndarray, shape (n, d, d)
        A profile.
    which : {-1, 0}
        −1 for the major, 0 for the minor axis.
    like : ndarray, shape (n, d), optional
        The same axis of another profile: the sign agrees with it where both are first defined, and changes where the
        two become opposite, as after a moment in which one of them turned quickly. Without it the largest component
        of the first vector is positive.

    Returns
    -------
    ndarray, shape (n, d)
    """
    lengths, directions = axes(points)
    short, long = (lengths[:, -2], lengths[:, -1]) if which == -1 else (lengths[:, 0], lengths[:, 1])
    defined = np.flatnonzero(short < ROUND * long)
    vectors = np.full(directions.shape[:2], np.nan)
    if len(defined) == 0:
        return vectors
    kept = directions[defined, :, which]
    turned = np.sum(kept[1:] * kept[:-1], axis=1) < 0
    kept[1:] *= np.where(np.cumsum(turned) % 2, -1.0, 1.0)[:, None]
    kept *= np.sign(kept[0, np.argmax(np.abs(kept[0]))])
    if like is not None:
        agreement, sign, allowed = np.sum(kept * like[defined], axis=1), 1.0, 0.0
        for k in np.flatnonzero(np.isfinite(agreement)):
            if sign * agreement[k] < allowed:
                kept[k:] *= -1.0
                sign = -sign
            allowed = -OPPOSITE
    vectors[defined] = kept
    return vectors
