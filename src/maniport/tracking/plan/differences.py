"""Derivatives of a motion at uneven times, by divided differences of neighboring points."""

from dataclasses import dataclass

import numpy as np

from maniport.validation import Array


@dataclass(frozen=True)
class Differences:
    """The k-th derivative as a banded matrix D of m = n − k rows.

    Attributes
    ----------
    rows : ndarray, shape (m, k + 1)
        What multiplies the points i to i + k in row i.
    spans : ndarray, shape (m,)
        The time that a row stands for [s].
    """

    rows: Array
    spans: Array

    @classmethod
    def of(cls, time: Array, order: int) -> "Differences":
        """Make them for points at `time` (n,), increasing, n > order."""
        count = len(time) - order
        at = np.stack([time[k : count + k] for k in range(order + 1)], axis=1)
        rows = np.eye(order + 1)[None] * np.ones((count, 1, 1))
        for level in range(1, order + 1):
            gap = at[:, level:] - at[:, : at.shape[1] - level]
            rows = level * (rows[:, 1:] - rows[:, :-1]) / gap[..., None]
        return cls(rows[:, 0], (at[:, -1] - at[:, 0]) / order)

    @property
    def order(self) -> int:
        """K."""
        return int(self.rows.shape[1]) - 1

    def __call__(self, values: Array) -> Array:
        """D applied to values (n, dof), shape (m, dof)."""
        m = len(self.rows)
        return np.asarray(sum(self.rows[:, k, None] * values[k : m + k] for k in range(self.order + 1)))

    def back(self, values: Array) -> Array:
        """Dᵀ applied to values (m, dof), shape (n, dof)."""
        m = len(self.rows)
        out = np.zeros((m + self.order, values.shape[1]))
        for k in range(self.order + 1):
            out[k : m + k] += self.rows[:, k, None] * values
        return out

    def normal(self, weights: Array) -> Array:
        """Lower diagonals of Dᵀ W D for each joint, shape (k + 1, n, dof); W is diagonal, `weights` (m, dof)."""
        m = len(self.rows)
        band = np.zeros((self.order + 1, m + self.order, weights.shape[1]))
        for below in range(self.order + 1):
            for k in range(self.order + 1 - below):
                band[below, k : m + k] += weights * (self.rows[:, k] * self.rows[:, k + below])[:, None]
        return band
