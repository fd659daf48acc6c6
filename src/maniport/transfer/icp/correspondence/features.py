"""What the score of two ellipsoids compares."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from maniport.spd.kernels import eigh
from maniport.validation import Array

EQUAL_EIGENVALUES = 1e-6
"""Relative gap below which an eigenvector is undefined and must not decide a match."""


@dataclass(frozen=True)
class EllipsoidFeatures:
    """What the paper's score compares (Reithmeir et al. 2022, eq. 16).

    Attributes
    ----------
    minor, major : ndarray, shape (n, d)
        Eigenvectors of the smallest and the largest eigenvalue; zero where they are undefined.
    condition : ndarray, shape (n,)
        λ_max / λ_min, which the paper calls the inverse condition number.
    volume : ndarray, shape (n,)
        Product of the semi-axes.
    """

    minor: Array
    major: Array
    condition: Array
    volume: Array

    @classmethod
    def of(cls, points: Array) -> "EllipsoidFeatures":
        """Measure SPD matrices, shape (n, d, d)."""
        values, vectors = eigh(points)
        low_gap = (values[:, 1] - values[:, 0]) / values[:, 1]
        high_gap = (values[:, -1] - values[:, -2]) / values[:, -1]
        return cls(
            minor=vectors[:, :, 0] * (low_gap > EQUAL_EIGENVALUES)[:, None],
            major=vectors[:, :, -1] * (high_gap > EQUAL_EIGENVALUES)[:, None],
            condition=values[:, -1] / values[:, 0],
            volume=np.sqrt(np.prod(values, axis=-1)),
        )

    def turned(self, rotation: Array) -> "EllipsoidFeatures":
        """Features of R X Rᵀ: only the directions change."""
        return EllipsoidFeatures(self.minor @ rotation.T, self.major @ rotation.T, self.condition, self.volume)

    def pick(self, index: Any) -> "EllipsoidFeatures":
        """Take some of the ellipsoids, in the order of `index`."""
        return EllipsoidFeatures(self.minor[index], self.major[index], self.condition[index], self.volume[index])
