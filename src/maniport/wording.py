"""How ranges and places are said in messages, once."""

from typing import Any, TypedDict

import numpy as np


class Bounds(TypedDict, total=False):
    """The range of a number: `minimum` and `maximum` belong to it, `above` and `below` do not."""

    minimum: float
    above: float
    maximum: float
    below: float


def inside(values: Any, bounds: Bounds) -> Any:
    """Whether numbers lie in a range, one by one."""
    low, above = bounds.get("minimum", -np.inf), bounds.get("above", -np.inf)
    high, below = bounds.get("maximum", np.inf), bounds.get("below", np.inf)
    return (values >= low) & (values > above) & (values <= high) & (values < below)


def range_in_words(bounds: Bounds) -> str:
    """Say a range in words, with a space before them; empty where there are no bounds."""
    left = f"({bounds['above']:g}" if "above" in bounds else f"[{bounds['minimum']:g}" if "minimum" in bounds else ""
    right = f"{bounds['below']:g})" if "below" in bounds else f"{bounds['maximum']:g}]" if "maximum" in bounds else ""
    if left and right:
        return f" in {left}, {right}"
    words = {"above": "above", "minimum": "of at least", "below": "below", "maximum": "of at most"}
    return "".join(f" {words[key]} {value:g}" for key, value in bounds.items())


def first(mask: Any) -> tuple[int, ...]:
    """Index of the first entry that is true."""
    return tuple(int(i) for i in np.argwhere(mask)[0])


def show(index: tuple[int, ...]) -> str:
    """Say an index by itself."""
    return str(index[0]) if len(index) == 1 else str(tuple(int(i) for i in index))


def at(index: Any) -> str:
    """Say an index behind a name."""
    return f"[{', '.join(str(int(i)) for i in index)}]" if len(index) else ""
