"""Values that a report consists of, and the registry of functions that make a report of a result.

`facts_of` makes a `Report` of a result. Terminal, Markdown, JSON and notebook (`maniport.report.renderings`) and the
page (`maniport.report.page`) render the same report.
"""

import importlib
import shlex
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import singledispatch
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from maniport.errors import InvalidInputError

INFO, NOTE, WARNING = "info", "note", "warning"

MODULES = {
    "arms": "robot",
    "mocap": "recording",
    "transfer": "transfer",
    "evaluation": "transfer",
    "motion": "motion",
    "pipeline": "runs learning",
}
"""Modules here that describe the classes of a package; they are imported when they are needed."""


@dataclass(frozen=True)
class Metric:
    """A number, a setting, a note or a warning of a `Section`.

    Attributes
    ----------
    label : str
    text : str
        The value with its unit, or, in notes and warnings, sentences. Empty: the metric is in JSON only.
    description : str
    key, value, unit
        For programs: a name without the unit; a number, a text, or lists and mappings of these; the unit of all numbers
        in it. Without a key the metric is not in JSON. The key of a warning names its kind.
    severity : {"info", "note", "warning"}
    """

    label: str
    text: str
    description: str = ""
    key: str = ""
    value: Any = None
    unit: str = ""
    severity: str = INFO


@dataclass(frozen=True)
class Table:
    """Rows of text under column names, in a `Section`.

    Attributes
    ----------
    columns : tuple of str
    rows : tuple of tuple of str
    caption : str
    key, value
        As in `Metric`.
    """

    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    caption: str = ""
    key: str = ""
    value: Any = None

    def __post_init__(self) -> None:
        for row in self.rows:
            if len(row) != len(self.columns):
                raise InvalidInputError(
                    f"every row of a table must have {len(self.columns)} cells, one for each column; found {len(row)}"
                )


@dataclass(frozen=True)
class Section:
    """Metrics of a `Report` that belong together.

    Attributes
    ----------
    title : str
    metrics : tuple of Metric
    tables : tuple of Table
    key : str
        Name in JSON; without one the metrics are at the top level there.
    text : str
        Markdown below the title, one paragraph per line; names from files must be escaped.
    folded : bool
        Whether a page folds the section.
    """

    title: str
    metrics: tuple[Metric, ...] = ()
    tables: tuple[Table, ...] = ()
    key: str = ""
    text: str = ""
    folded: bool = False


@dataclass(frozen=True)
class Summary:
    """The outcome of a result, in a `Report`.

    Attributes
    ----------
    title : str
        The outcome in one sentence.
    text, quality_warnings : str
        What prevents a better outcome; what is doubtful about the data.
    advice, command : str
        The next step and its command, in which ``{folder}`` stands for the folder of the results; may be empty.
    status : {"green", "amber", "red", ""}
        See `maniport.report.summary.status_of`; empty where there is no outcome.
    reasons : tuple of str
        Keys of the warnings that the status follows from.
    metrics : tuple of Metric
        The most important ones first.
    """

    title: str
    text: str = ""
    quality_warnings: str = ""
    advice: str = ""
    command: str = ""
    status: str = ""
    reasons: tuple[str, ...] = ()
    metrics: tuple[Metric, ...] = ()

    @property
    def status_text(self) -> str:
        """The status and its reasons in words; empty without a status."""
        reasons = ", ".join(key.replace("-", " ") for key in self.reasons) or "no warnings"
        return f"Status: {self.status} ({reasons})." if self.status else ""

    def command_for(self, folder: str = "results") -> str:
        """Return the command with the folder of the results, quoted for a shell."""
        return self.command.replace("{folder}", shlex.quote(folder))


@dataclass(frozen=True)
class Report:
    """Everything that is reported of a result, see `facts_of`.

    Attributes
    ----------
    title, lead : str
    sections : tuple of Section
    summary : Summary or None
    data_warnings : tuple of Metric
        Warnings about the data, which precede those of the sections.
    """

    title: str
    lead: str = ""
    sections: tuple[Section, ...] = ()
    summary: Summary | None = None
    data_warnings: tuple[Metric, ...] = ()

    @property
    def warning_metrics(self) -> tuple[Metric, ...]:
        """The warnings, each text once."""
        unique = dict[str, Metric]()
        for metric in (*self.data_warnings, *self._with_severity(WARNING)):
            unique.setdefault(metric.text, metric)
        return tuple(unique.values())

    @property
    def warnings(self) -> tuple[str, ...]:
        """Texts of the warnings."""
        return tuple(metric.text for metric in self.warning_metrics)

    @property
    def warning_keys(self) -> tuple[str, ...]:
        """Keys of the warnings, each once."""
        return tuple(dict.fromkeys(metric.key for metric in self.warning_metrics))

    @property
    def notes(self) -> tuple[str, ...]:
        """Texts of the notes, each once."""
        return tuple(dict.fromkeys(metric.text for metric in self._with_severity(NOTE)))

    def metric(self, key: str) -> Metric:
        """Return the first metric with this key; KeyError where there is none."""
        by_key = {metric.key: metric for section in reversed(self.sections) for metric in reversed(section.metrics)}
        return by_key[key]

    def _with_severity(self, severity: str) -> list[Metric]:
        return [
            metric
            for section in self.sections
            for metric in section.metrics
            if metric.severity == severity and metric.text
        ]


def facts_of(thing: Any) -> Report:
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


def statistics(
    label: str, key: str, values: ArrayLike, time: ArrayLike | None = None, unit: str = "", description: str = ""
) -> Metric:
    """Return median, 95th percentile and maximum of values over time [s] as a metric."""
    array = np.asarray(values, dtype=float)
    index = int(np.argmax(array))
    where = {"max_at": index} if time is None else {"max_at_s": float(np.asarray(time)[index])}
    value = {
        "median": float(np.median(array)),
        "p95": float(np.percentile(array, 95)),
        "max": float(array[index]),
        **where,
    }
    suffix = f" {unit}" if unit and unit != "°" else unit
    place = f"at index {index}" if time is None else at_time(where["max_at_s"])
    median, p95, largest = (f"{value[name]:.2f}{suffix}" for name in ("median", "p95", "max"))
    text = f"{median} (median), {p95} (95th percentile), {largest} (max {place})"
    return Metric(label, text, description, key, value, unit)


# Label, unit and description of metrics that several reports and the page have, by key.
DEFINITIONS = {
    "distance": ("Ellipsoid distance", "", "From target to achieved; 0.1 is one axis 5 % too long, 1 is 65 %."),
    "tip_error": ("Position error", "mm", "From the path to the end effector; position has priority over ellipsoids."),
    "orientation_error": ("Orientation error", "°", "Angle between the constrained axes and their target."),
    "pointwise_best": (
        "Best pointwise solution found",
        "",
        "Per waypoint, with the end effector on its path; no bound.",
    ),
    "feasibility_gap": (
        "Distance to the feasible set",
        "",
        "From the target to the nearest ellipsoid found within the joint limits; an upper bound.",
    ),
    "beside_way": ("Relative position error", "mm", "From the scaled, rotated vector between the hands."),
}


def defined(key: str, values: ArrayLike, time: ArrayLike | None = None) -> Metric:
    """Return the statistics of a metric of `DEFINITIONS`."""
    label, unit, description = DEFINITIONS[key]
    return statistics(label, key, values, time, unit, description)


def at_time(time: float) -> str:
    """Write a time [s]; pages make links of these."""
    return f"at {time:.1f} s"


def in_axes(distance: float) -> str:
    """Write a distance between ellipsoids as the error of one axis that has the same distance."""
    ratio = float(np.exp(0.5 * distance))
    return (
        f"one axis {ratio:.1f} times as long" if ratio >= 1.95 else f"one axis {100.0 * (ratio - 1.0):.0f} % too long"
    )


def listed(values: Sequence[object]) -> str:
    """Write values with commas between them."""
    return ", ".join(map(str, values))
