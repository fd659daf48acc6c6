"""Quantiles of many values, in little memory however many there are."""

import math

import numpy as np

LEAST, PER_DECADE, DECADES = 1e-6, 200, 9
"""Bins from 1e-6 to 1000, in s or m; each is 1.2 % wide."""


class Histogram:
    """Count positive values over their logarithm.

    Attributes
    ----------
    largest, largest_at : float
        The largest value, exactly, and the time at which it was added [s]; nan without any.
    """

    def __init__(self) -> None:
        self._counts = np.zeros(PER_DECADE * DECADES, dtype=np.int64)
        self.largest = self.largest_at = math.nan

    def add(self, value: float, at: float = math.nan) -> None:
        """Count a value, at a time [s]."""
        place = round(PER_DECADE * math.log10(max(value, LEAST) / LEAST))
        self._counts[min(place, len(self._counts) - 1)] += 1
        if not value <= self.largest:
            self.largest, self.largest_at = value, at

    def quantile(self, share: float) -> float:
        """Return the value that a share of all does not exceed; nan where there are none."""
        total = int(self._counts.sum())
        if not total:
            return math.nan
        place = int(np.searchsorted(np.cumsum(self._counts), share * total))
        return float(min(LEAST * 10.0 ** (place / PER_DECADE), self.largest))
