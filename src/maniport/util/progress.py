"""Progress of long work by steps; `maniport.progress` displays it as bars."""

from collections.abc import Callable, Iterable, Iterator
from itertools import pairwise
from typing import TypeVar

T = TypeVar("T")

Progress = Callable[..., None]
"""Called as progress(step, fraction) during a step and progress(step, 1.0, result) at its end."""

ReportFraction = Callable[[float], None]
"""Called with the fraction, from 0 to 1, of a piece of a step that is done."""

ALMOST = 0.999
"""Largest fraction before the end of a step, which is reported with its result."""


class Step:
    """One step of long work: called with the fraction done, it reports that with the name of the step."""

    def __init__(self, progress: Progress | None, name: str):
        self._progress = progress
        self._name = name
        self(0.0)

    def __call__(self, fraction: float) -> None:
        """Report the fraction done."""
        if self._progress is not None:
            self._progress(self._name, min(fraction, ALMOST))

    def end(self, result: str = "") -> None:
        """Report the end of the step and its result."""
        if self._progress is not None:
            self._progress(self._name, 1.0, result)


def no_progress(step: str, fraction: float, result: str = "") -> None:
    """Ignore progress."""


def ignore_fraction(fraction: float) -> None:
    """Ignore a fraction."""


def between(report: ReportFraction, start: float, stop: float) -> ReportFraction:
    """Return the progress of a piece that covers the fractions from `start` to `stop`."""
    return lambda fraction: report(start + (stop - start) * fraction)


def pieces(report: ReportFraction, *efforts: float) -> list[ReportFraction]:
    """Return the progress of consecutive pieces, whose durations are proportional to `efforts`."""
    ends = []
    for i in range(len(efforts) + 1):
        ends.append(sum(efforts[:i]) / sum(efforts))
    return [between(report, start, stop) for start, stop in pairwise(ends)]


def counted(items: Iterable[T], count: int, report: ReportFraction) -> Iterator[T]:
    """Iterate over `count` items and report the fraction done after each."""
    for i, item in enumerate(items, 1):
        yield item
        report(i / count)
