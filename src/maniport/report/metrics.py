"""The registry of a motion's metrics with their grades and warnings, and `report_of`.

Terminal, Markdown, JSON and notebook (`maniport.report.renderings`), the page (`maniport.report.page`) and the table of
a batch render the same `Report`.
"""

import importlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import singledispatch
from operator import itemgetter
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from maniport.motion.status import ENOUGH_DISTANCE, NEAR_DISTANCE
from maniport.report.values import ERROR, WARNING, Metric, Report, statistics, warning


@dataclass(frozen=True)
class Definition:
    """A metric of a robot's motion: its words, its grades, and from which level on it is a warning."""

    label: str
    description: str
    unit: str = ""
    main: bool = False
    text: str = ""  # format of the value; without one, the metric is statistics over the waypoints
    level: Callable[[Any], float] = itemgetter("median")  # number of the value that is graded
    grades: Mapping[str, float] = field(default_factory=dict)  # largest levels by words
    warn_above: float = np.inf  # level
    warning_key: str = ""
    warning: str = ""  # format of the value
    severity: str = WARNING


MISSED_SHARE = 0.05
"""Largest share of waypoints that may be missed without a warning."""

METRICS = {
    "distance": Definition(
        "Ellipsoid distance", "0.1: one axis is 5 % too long; 1: 65 %.", main=True,
        grades={"ellipsoids tracked": ENOUGH_DISTANCE, "ellipsoids approximated": NEAR_DISTANCE,
                "ellipsoids approximated in part": 1.2, "ellipsoids not tracked": np.inf}),  # 1.2: 82 % too long
    "position_error": Definition(
        "Position error", "Of the end effector; it has priority over ellipsoids.", "mm", main=True,
        level=lambda value: value.get("far_share", 0.0), warn_above=0.0, warning_key="position-error",
        warning="the position error is up to {max:.1f} mm (at {max_at_s:.1f} s); tolerance {tolerance:g} mm",
        grades={"position tracked": 0.0, "position mostly tracked": MISSED_SHARE, "position not tracked": np.inf}),
    "orientation_error": Definition(
        "Orientation error", "Between the constrained axes and their target.", "°", main=True),
    "duration": Definition(
        "Duration", "Time-scaled to satisfy the limits; other times are demonstrated.", "s", main=True,
        text="{robot:.1f} s (human {person:.1f} s)"),
    **{
        key: Definition(
            label, description, main=True, text="{_text}",
            level=lambda value: max(use["share"] for use in value["used"].values()), warn_above=1.001, severity=ERROR,
            warning_key=f"{key}-exceeded", warning="the motion exceeds limits of the robot: {_exceeded}")
        for key, label, description in (
            ("limits", "Limits", "Largest value relative to the limit."),
            ("torques", "Torques", "Largest value relative to the limit, by inverse dynamics."),
        )
    },
    "collisions": Definition(
        "Collisions", "Between convex hulls of links, table and obstacles.", main=True, text="{_text}",
        level=itemgetter("share"), warn_above=0.0, severity=ERROR, warning_key="collision",
        warning="the robot collides {_when}: {_pair}"),
    **{
        key: Definition(
            label, "Along the direction in which the person has most; resemblance over all directions.", unit,
            main=True, text="{_text}")
        for key, label, unit in (("force", "Force", "N"), ("velocity", "Speed", "m/s"))
    },
    "mean_distance": Definition(
        "Mean distance", "Infeasible: distance to the feasible set. Path: added by the path constraint. "
        "Motion: added by limits.", main=True, text="{_text}"),
    "waypoints": Definition(
        "Waypoints", f"Distance at most {NEAR_DISTANCE:g}, position error within the tolerance.",
        text="{_reached} of {count} reached{_reasons}", level=lambda value: value["missed"] / value["count"],
        warn_above=MISSED_SHARE, warning_key="targets-missed",
        warning="{missed} of {count} waypoints are missed{_reasons}"),
    "pointwise_ratio": Definition(
        "Ratio to the best pointwise distances found", "Of root mean squares; no bound.", text="{:.2f}"),
    "feasibility_gap": Definition(
        "Distance to the feasible set", "Of the target; an upper bound.", warn_above=NEAR_DISTANCE,
        warning_key="infeasible-targets",
        warning="the targets are infeasible: median distance to the feasible set {median:.2f}"),
    "major_axis_angle": Definition(
        "Angle between longest axes", "Where both ellipsoids have a longest axis.", "°", warn_above=30.0,
        warning_key="longest-axis",
        warning="the longest axis of the ellipsoid is {median:.0f}° (median) from that of the target"),
    "jumps": Definition("Jumps of the recording", "Mostly errors of the recording or of its fit.", text="{_text}"),
    "lowest_point": Definition(
        "Lowest point", "Of the moving links, above the base plane.", text="{height_mm:.0f} mm, {link} at {at_s:.1f} s",
        level=itemgetter("_depth"), warn_above=0.0, warning_key="below-base-plane",
        warning="{link} is up to {_depth:.0f} mm below the base plane (at {at_s:.1f} s). "
        "{_option} keeps the robot above it"),
    "relative_position_error": Definition(
        "Relative position error", "From the scaled vector between the hands.", "mm"),
}  # fmt: skip
"""Metrics of a robot's motion by key, in the order in which they are reported."""


def measure(key: str, values: Any = None, time: ArrayLike | None = None, **entries: Any) -> list[Metric]:
    """Return a registered metric, after the warning that it gives.

    `values` are a number, or one for each waypoint at times [s]; `entries` of the value with a leading underscore are
    for the texts alone, and not in JSON.
    """
    definition, value = METRICS[key], {name: item for name, item in entries.items() if name[0] != "_"}
    if definition.text:
        number = () if values is None else (values,)
        text, value = definition.text.format(*number, **entries), value if values is None else values
    else:
        measured = statistics(definition.label, key, values, time, definition.unit)
        text, value = measured.text, measured.value | value
    words, graded = (value if isinstance(value, dict) else {}) | entries, definition.grades or definition.warning
    level = definition.level(words) if graded else 0.0
    grade = next((name for name, bound in definition.grades.items() if level <= bound), "")
    metric = Metric(definition.label, text, definition.description, key, value, definition.unit,
                    main=definition.main, grade=grade)  # fmt: skip
    if level <= definition.warn_above:
        return [metric]
    return [warning(definition.warning_key, definition.warning.format(**words), definition.severity), metric]


MODULES = {
    "arms": "robot",
    "mocap": "recording",
    "transfer": "transfer",
    "evaluation": "transfer",
    "motion": "motion robot",
    "pipeline": "results learning",
}
"""Modules of this package that describe the classes of another package; they are imported when they are needed."""


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


def in_axes(distance: float) -> str:
    """Write a distance between ellipsoids as the error of one axis that has the same distance."""
    ratio = float(np.exp(0.5 * distance))
    return (
        f"one axis {ratio:.1f} times as long" if ratio >= 1.95 else f"one axis {100.0 * (ratio - 1.0):.0f} % too long"
    )
