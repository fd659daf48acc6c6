"""Matching the means and nothing else."""

import numpy as np
from numpy.typing import ArrayLike

from maniport.transfer.rigid_adapter import RigidAdapter
from maniport.validation import Array, as_rotation


class Recentring(RigidAdapter):
    """Match the means and nothing else: f(T) = B T̄^-½ T T̄^-½ Bᵀ with B = S̄^½ R_b; neither turned nor dilated.

    Parameters
    ----------
    damping, floor, mounting
        As in `ParallelTransport`. R_b is taken as it is; parallel transport turns by the polar factor of S̄^-½ R_b T̄^½.
    """

    scale, dispersion, recenter = False, "mean", "training"

    def __init__(self, damping: float | None = None, floor: float | None = None, mounting: ArrayLike | None = None):
        self.damping = damping
        self.floor = floor
        self.mounting = mounting

    def _fit_rotation(self, teacher: Array, student: Array) -> None:
        d = teacher.shape[-1]
        self.rotation_ = np.eye(d) if self.mounting is None else as_rotation(self.mounting, "mounting", d)
        self._found_at_once("closed form")
