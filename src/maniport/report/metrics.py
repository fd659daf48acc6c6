"""Registries of metrics, warnings and reports.

`report_of` makes a `Report` of a result. Terminal, Markdown, JSON and notebook (`maniport.report.renderings`), the page
(`maniport.report.page`) and the table of a batch render the same report.
"""

import importlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import singledispatch
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from maniport.report.values import AMBER, GREEN, NOTE, RED, WARNING, Metric, Report, Table, at_time

MODULES = {
    "arms": "robot",
    "mocap": "recording",
    "transfer": "transfer",
    "evaluation": "transfer",
    "motion": "motion robot",
    "pipeline": "runs learning",
}
"""Modules of this package that describe the classes of another package; they are imported when they are needed."""


Value = ArrayLike | tuple[str, Any] | None
"""Value of a metric for each waypoint, or its text and its value for programs, or nothing."""


METRICS: dict[str, tuple[Metric, Callable[[Any], Value]]] = {}
"""Metrics of a robot's motion by key, in the order in which they are reported, and the functions of their values."""

WARNINGS: dict[str, tuple[str, Callable[[Any], Iterable[str]]]] = {}
"""Status and function of the warnings of a robot's motion by key."""


def metric(
    key: str, label: str, unit: str = "", description: str = "", *, main: bool = False
) -> Callable[[Callable[[Any], Value]], Callable[[Any], Value]]:
    """Register a function of a motion as a metric; with the attributes of `Metric`."""

    def register(function: Callable[[Any], Value]) -> Callable[[Any], Value]:
        METRICS[key] = Metric(label, "", description, key, unit=unit, main=main), function
        return function

    return register


def warns(key: str, status: str = AMBER) -> Callable[[Callable[[Any], Iterable[str]]], Callable[[Any], Iterable[str]]]:
    """Register a function of a motion that yields texts of warnings with this key; they have the status."""

    def register(function: Callable[[Any], Iterable[str]]) -> Callable[[Any], Iterable[str]]:
        WARNINGS[key] = (status, function)
        return function

    return register


def status_of(keys: Iterable[str]) -> str:
    """Return the status of a result whose warnings have these keys."""
    found = {WARNINGS[key][0] if key in WARNINGS else AMBER for key in keys}
    return RED if RED in found else AMBER if found else GREEN


def measured(run: Any, time: ArrayLike | None) -> list[Metric]:
    """Return all registered metrics of a motion; `time`: times of the waypoints [s]."""
    values = {key: function(run) for key, (_, function) in METRICS.items()}
    return [as_metric(key, value, time) for key, value in values.items() if value is not None]


def as_metric(key: str, value: Any, time: ArrayLike | None = None) -> Metric:
    """Return a registered metric with a value, see `Value`."""
    template, _ = METRICS[key]
    if isinstance(value, tuple):
        return replace(template, text=value[0], value=value[1])
    measured = statistics(template.label, key, value, time, template.unit)
    return replace(template, text=measured.text, value=measured.value)


def report_of(thing: Any) -> Report:
    """Return the `Report` of a result, an arm, a recording, an adapter or another object of maniport.

    Parameters
    ----------
    thing : any object
        Of an unknown object only the prompt is reported.

    Returns
    -------
    Report
    """
    for kind in type(thing).__mro__:
        top, package, *_ = [*kind.__module__.split("."), ""]
        if top == "maniport" and package in MODULES:
            for module in MODULES[package].split():
                importlib.import_module(f"maniport.report.{module}")
    return describe(thing)


@singledispatch
def describe(thing: Any) -> Report:
    """Describe an object whose module is imported; `describe.register` adds a class."""
    return Report(type(thing).__name__, repr(thing))


def warning(key: str, text: str) -> Metric:
    """Return a warning with a stable key for programs."""
    return Metric("", sentence(text), key=key, severity=WARNING)


def warnings_of(key: str, texts: Iterable[str]) -> tuple[Metric, ...]:
    """Return warnings with one key."""
    return tuple(warning(key, text) for text in texts)


def notes(texts: Iterable[str]) -> list[Metric]:
    """Return notes."""
    return [Metric("", sentence(text), severity=NOTE) for text in texts]


def numbers(**values: Any) -> list[Metric]:
    """Return metrics that are in JSON only; the keys have the units."""
    return [Metric("", "", key=key, value=value) for key, value in values.items()]


def sentence(text: str) -> str:
    """Let a text begin with a capital letter and end with a full stop."""
    return text[:1].upper() + text[1:] + ("" if text.endswith((".", ":", "!", "?")) else ".")


def statistics(label: str, key: str, values: ArrayLike, time: ArrayLike | None = None, unit: str = "") -> Metric:
    """Return median, 95th percentile and maximum of values over time [s] as a metric; nan is ignored."""
    array = np.asarray(values, dtype=float)
    index = int(np.nanargmax(array))
    where = {"max_at": index} if time is None else {"max_at_s": float(np.asarray(time)[index])}
    median, p95 = np.nanpercentile(array, [50.0, 95.0]).tolist()
    value = {"median": median, "p95": p95, "max": float(array[index]), **where}
    suffix = f" {unit}" if unit and unit != "°" else unit
    place = f"at index {index}" if time is None else at_time(where["max_at_s"])
    texts = (f"{number:.2f}{suffix}" for number in (median, p95, array[index]))
    text = "{} (median), {} (95th percentile), {} (max {})".format(*texts, place)
    return Metric(label, text, "", key, value, unit)


def table_of(
    records: Sequence[Mapping[str, Any]], columns: Mapping[str, str], caption: str = "", key: str = ""
) -> Table:
    """Return a table of records: format strings by column name."""
    rows = tuple(tuple(form.format(**record) for form in columns.values()) for record in records)
    return Table(tuple(columns), rows, caption, key, list(records))


def in_axes(distance: float) -> str:
    """Write a distance between ellipsoids as the error of one axis that has the same distance."""
    ratio = float(np.exp(0.5 * distance))
    return (
        f"one axis {ratio:.1f} times as long" if ratio >= 1.95 else f"one axis {100.0 * (ratio - 1.0):.0f} % too long"
    )


def listed(values: Sequence[object]) -> str:
    """Write values with commas between them."""
    return ", ".join(map(str, values))
