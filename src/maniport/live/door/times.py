"""How long each frame took, in little memory however many there were."""

import math

import numpy as np

SHORTEST, PER_DECADE, DECADES = 1e-6, 200, 9
"""Times from a microsecond to a quarter of an hour are told apart by 1.2 %."""


class Times:
    """A histogram of times over their logarithm."""

    def __init__(self) -> None:
        self._counts = np.zeros(PER_DECADE * DECADES, dtype=np.int64)
        self.largest = 0.0
        """[s], exactly."""

    def add(self, seconds: float) -> None:
        """Count a time."""
        place = round(PER_DECADE * math.log10(max(seconds, SHORTEST) / SHORTEST))
        self._counts[min(place, len(self._counts) - 1)] += 1
        self.largest = max(self.largest, seconds)

    def quantile(self, share: float) -> float:
        """The time that a share of all stay within [s]; nan where there are none."""
        total = int(self._counts.sum())
        if not total:
            return math.nan
        place = int(np.searchsorted(np.cumsum(self._counts), share * total))
        return float(min(SHORTEST * 10.0 ** (place / PER_DECADE), self.largest))
