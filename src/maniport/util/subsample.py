"""Evenly spaced subsets of long sequences."""

import numpy as np
from numpy.typing import NDArray


def evenly_spaced(count: int, most: int | None) -> NDArray[np.intp]:
    """Return ascending indices of at most `most` of `count` entries, evenly spaced; all of them for None."""
    if most is None or most >= count:
        return np.arange(count)
    return np.linspace(0, count - 1, most).round().astype(np.intp)
