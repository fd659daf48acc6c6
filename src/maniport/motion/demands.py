"""Demands of a path on an arm: velocities and accelerations, and the ellipsoids that should contain them.

With joint limits V of velocity or acceleration, the ellipsoid of J V² Jᵀ contains what the end effector reaches by
joints within their limits. A demanded vector v uses the share √(vᵀ (J V² Jᵀ)⁻¹ v) of it.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from maniport.arms import EllipsoidSpec
from maniport.motion.motion_limits import MotionLimits
from maniport.util.validation import Array

LONG_GAP = 0.1  # Longer gaps between two rows of a path are not closed [s]
EXCESS_WEIGHT = 10.0  # Weight of the share that exceeds 1, relative to an affine-invariant distance

Demand = tuple[EllipsoidSpec, Array]  # ellipsoids, and vectors (n, 3) that they should contain


def regularized_inverses(ellipsoids: Array, share: float = 1e-4) -> Array:
    """Invert ellipsoids (n, 3, 3) after adding a share of the mean eigenvalue, so that they are not singular."""
    means = np.trace(ellipsoids, axis1=1, axis2=2) / 3.0
    return np.linalg.inv(ellipsoids + share * means[:, None, None] * np.eye(3))


def demands_of(
    limits: MotionLimits,
    time: Array,
    path: Array,
    rows: NDArray[np.intp],
    smoothing: float = 0.03,
    percentile: float = 99.0,
) -> tuple[Demand, Demand]:
    """Return the largest velocities [m/s] and accelerations [m/s²] of a path (n, 3) around each of its rows.

    The path is smoothed (Gaussian, standard deviation in seconds) between gaps. Larger values than the percentile are
    jumps of the recording, and are shortened to it.
    """
    middles = (rows[1:] + rows[:-1] + 1) // 2
    windows = np.split(np.arange(len(time)), middles)
    demands = []
    derivatives = _derivatives(time, path, smoothing)
    for limit, values in zip((limits.velocity, limits.acceleration), derivatives, strict=True):
        lengths = np.linalg.norm(values, axis=1)
        shares = np.minimum(1.0, np.percentile(lengths, percentile) / np.maximum(lengths, 1e-9))
        at = [window[lengths[window].argmax()] for window in windows]
        demands.append((EllipsoidSpec(joint_weights=limit), (shares[:, None] * values)[at]))
    return demands[0], demands[1]


def _derivatives(time: Array, path: Array, smoothing: float) -> tuple[Array, Array]:
    """Return velocities and accelerations (n, 3) of a smoothed path with times (n,) that may have gaps.

    The path is linear in short gaps, as live control closes them. The hand's motion in a longer gap is unknown: both
    sides are smoothed for themselves, and both derivatives are zero within two standard deviations of the gap, where
    the smoothed path is bent.
    """
    period = float(np.median(np.diff(time)))
    velocity = np.zeros(path.shape)
    acceleration = np.zeros(path.shape)
    starts = np.flatnonzero(np.diff(time) > max(LONG_GAP, 2.5 * period)) + 1
    for run in np.split(np.arange(len(time)), starts):
        if len(run) < 2:
            continue
        times = time[run]
        positions = path[run]
        is_even = bool((np.abs(np.diff(times) - period) < 0.5 * period).all())
        if not is_even:
            times = np.linspace(times[0], times[-1], round((times[-1] - times[0]) / period) + 1)
            positions = _interpolated(times, time[run], path[run])
        smoothed = gaussian_filter1d(positions, smoothing / period, axis=0, mode="nearest")
        velocities = np.gradient(smoothed, times, axis=0)
        accelerations = np.gradient(velocities, times, axis=0)
        if not is_even:
            velocities = _interpolated(time[run], times, velocities)
            accelerations = _interpolated(time[run], times, accelerations)

        after_gap = (run[0] > 0) & (time[run] < time[run[0]] + 2.0 * smoothing)
        before_gap = (run[-1] < len(time) - 1) & (time[run] > time[run[-1]] - 2.0 * smoothing)
        known = ~(after_gap | before_gap)
        velocity[run[known]] = velocities[known]
        acceleration[run[known]] = accelerations[known]
    return velocity, acceleration


def _interpolated(at: Array, time: Array, values: Array) -> Array:
    """Interpolate values (n, 3) with times (n,) linearly at other times (m,)."""
    return np.stack([np.interp(at, time, column) for column in values.T], axis=1)
