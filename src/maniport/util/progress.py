"""The steps of long work, and how far each of them is.

Functions that take long have an argument `progress`, of the kind below; `maniport.progress` makes one that shows bars.
"""

from collections.abc import Callable, Iterable, Iterator
from itertools import pairwise
from typing import TypeVar

T = TypeVar("T")

Progress = Callable[..., None]
"""Called as progress(step, fraction) on the way and progress(step, 1.0, found) at the end of a step."""

Part = Callable[[float], None]  # Called with the fraction, from 0 to 1, of a piece of a step that is done

ALMOST = 0.999
"""The largest fraction of a step before its end: whoever works at it last does not know what was found in all."""


class Step:
    """One step of long work: called with the fraction done, it passes that on with the step's name."""

    def __init__(self, progress: Progress | None, name: str):
        self._progress, self._name = progress, name
        self(0.0)

    def __call__(self, fraction: float) -> None:
        """Tell how far the step is."""
        if self._progress is not None:
            self._progress(self._name, min(fraction, ALMOST))

    def end(self, found: str = "") -> None:
        """Tell that it is done, and what was found."""
        if self._progress is not None:
            self._progress(self._name, 1.0, found)


def untold(step: str, fraction: float, found: str = "") -> None:
    """Take progress that nobody wants to know."""


def nobody(fraction: float) -> None:
    """Take a fraction that nobody wants to know."""


def between(tell: Part, start: float, stop: float) -> Part:
    """Return what to call with the fraction of a piece that takes its whole from `start` to `stop`."""
    return lambda fraction: tell(start + (stop - start) * fraction)


def pieces(tell: Part, *efforts: float) -> list[Part]:
    """Return what to call with the fraction of each piece of a whole, in their order."""
    ends = [sum(efforts[:i]) / sum(efforts) for i in range(len(efforts) + 1)]
    return [between(tell, start, stop) for start, stop in pairwise(ends)]


def counted(items: Iterable[T], count: int, tell: Part) -> Iterator[T]:
    """Go through `count` items and tell after each one what fraction of them is done."""
    for i, item in enumerate(items, 1):
        yield item
        tell(i / count)
