"""Taking an even part of a sequence that is too long."""

import numpy as np
from numpy.typing import NDArray


def evenly(count: int, most: int | None) -> NDArray[np.intp]:
    """Indices of at most `most` of `count` entries, evenly over their order and ascending; all without `most`."""
    if most is None or most >= count:
        return np.arange(count)
    return np.linspace(0, count - 1, most).round().astype(np.intp)
