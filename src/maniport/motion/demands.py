"""Demands of a path on an arm: velocities and accelerations, and the ellipsoids that should contain them.

With joint limits V of velocity or acceleration, the ellipsoid of J V² Jᵀ contains what the end effector reaches by
joints within their limits. A demanded vector v uses the share √(vᵀ (J V² Jᵀ)⁻¹ v) of it.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from maniport.arms import EllipsoidSpec
from maniport.motion.motion_limits import MotionLimits
from maniport.util.validation import Array

EXCESS_WEIGHT = 10.0  # Weight of the share that exceeds 1, relative to an affine-invariant distance

Demand = tuple[EllipsoidSpec, Array]  # ellipsoids, and vectors (n, 3) that they should contain


def inverses(ellipsoids: Array, share: float = 1e-4) -> Array:
    """Invert ellipsoids (n, 3, 3) after adding a share of the mean eigenvalue, so that they are not singular."""
    means = np.trace(ellipsoids, axis1=1, axis2=2) / 3.0
    return np.linalg.inv(ellipsoids + share * means[:, None, None] * np.eye(3))


def demands_of(
    limits: MotionLimits,
    time: Array,
    path: Array,
    rows: NDArray[Any],
    smoothing: float = 0.03,
    percentile: float = 99.0,
) -> tuple[Demand, Demand]:
    """Return the largest velocities [m/s] and accelerations [m/s²] of a path (n, 3) around each of its rows.

    The path is smoothed (Gaussian, standard deviation in seconds). Larger values than the percentile are jumps of the
    recording, and are shortened to it.
    """
    windows: Sequence[NDArray[Any]] = np.split(
        np.arange(len(time)), (rows[1:] + rows[:-1] + 1) // 2
    )
    values, demands = (
        gaussian_filter1d(path, smoothing / np.median(np.diff(time)), axis=0, mode="nearest"),
        [],
    )
    for limit in (limits.velocity, limits.acceleration):
        values = np.gradient(values, time, axis=0)
        lengths = np.linalg.norm(values, axis=1)
        shares = np.minimum(1.0, np.percentile(lengths, percentile) / np.maximum(lengths, 1e-9))
        at = [window[lengths[window].argmax()] for window in windows]
        demands.append((EllipsoidSpec(joint_weights=limit), (shares[:, None] * values)[at]))
    return demands[0], demands[1]
