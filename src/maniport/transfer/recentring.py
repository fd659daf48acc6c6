"""Matching the means and nothing else."""

import numpy as np
from numpy.typing import ArrayLike

from maniport.transfer.rigid_adapter import RigidAdapter
from maniport.validation import Array


class Recentring(RigidAdapter):
    """Match the means and nothing else: f(T) = S̄^½ T̄^-½ T T̄^-½ S̄^½; neither turned nor dilated.

    Parameters
    ----------
    damping, floor, mounting
        As in `ParallelTransport`, which also turns, by the polar factor of S̄^-½ T̄^½.
    """

    scale, dispersion, recenter = False, "mean", "training"

    def __init__(self, damping: float | None = None, floor: float | None = None, mounting: ArrayLike | None = None):
        self.damping = damping
        self.floor = floor
        self.mounting = mounting

    def _fit_rotation(self, teacher: Array, student: Array) -> None:
        self.rotation_ = np.eye(teacher.shape[-1])
        self._found_at_once("closed form")
