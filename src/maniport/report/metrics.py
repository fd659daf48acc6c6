"""The registry of metrics and of red warnings, and reports of objects.

`report_of` makes a `Report` of a result. Terminal, Markdown, JSON and notebook (`maniport.report.renderings`), the page
(`maniport.report.page`) and the table of a batch render the same report.
"""

import importlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import singledispatch
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from maniport.motion.status import NEAR_DISTANCE
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

METRICS = {
    metric.key: metric
    for metric in (
        Metric("Ellipsoid distance", "", "0.1: one axis is 5 % too long; 1: 65 %.", "distance", main=True),
        Metric("Position error", "", "Of the end effector; it has priority over ellipsoids.", "position_error",
               unit="mm", main=True),
        Metric("Orientation error", "", "Between the constrained axes and their target.", "orientation_error",
               unit="°", main=True),
        Metric("Duration", "", "Time-scaled to satisfy the limits; other times are demonstrated.", "duration",
               unit="s", main=True),
        Metric("Limits", "", "Largest value relative to the limit.", "limits", main=True),
        Metric("Collisions", "", "Between convex hulls of links, table and obstacles.", "collisions", main=True),
        Metric("Mean distance", "", "Infeasible: distance to the feasible set. Path: added by the path constraint. "
               "Motion: added by limits.", "mean_distance", main=True),
        Metric("Waypoints", "", f"Distance at most {NEAR_DISTANCE:g}, position error within the tolerance.",
               "waypoints"),
        Metric("Ratio to the best pointwise distances found", "", "Of root mean squares; no bound.",
               "pointwise_ratio"),
        Metric("Distance to the feasible set", "", "Of the target; an upper bound.", "feasibility_gap"),
        Metric("Angle between longest axes", "", "Where both ellipsoids have a longest axis.", "major_axis_angle",
               unit="°"),
        Metric("Jumps of the recording", "", "Mostly errors of the recording or of its fit.", "jumps"),
        Metric("Cost of the orientation", "", "Mean distance with and without the constraint.", "orientation_cost"),
        Metric("Lowest point", "", "Of the moving links, above the base plane.", "lowest_point"),
        Metric("Relative position error", "", "From the scaled vector between the hands.",
               "relative_position_error", unit="mm"),
    )
}  # fmt: skip
"""Metrics of a robot's motion by key, in the order in which they are reported."""

PROHIBITIVE = frozenset({"collision", "limits-exceeded", "held"})
"""Keys of the warnings that make the status of a result red; all others make it amber."""


def status_of(keys: Iterable[str]) -> str:
    """Return the status of a result whose warnings have these keys."""
    found = set(keys)
    return RED if found & PROHIBITIVE else AMBER if found else GREEN


def as_metric(key: str, value: ArrayLike | tuple[str, Any], time: ArrayLike | None = None) -> Metric:
    """Return a registered metric of a value for each waypoint at times [s], or of a text and its value for JSON."""
    template = METRICS[key]
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


def listed(values: Iterable[object]) -> str:
    """Write values with commas between them."""
    return ", ".join(map(str, values))
