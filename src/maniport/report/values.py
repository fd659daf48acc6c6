"""Values that a report consists of: metrics, tables and sections."""

import os
import platform
import shlex
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Literal

import numpy as np

from maniport.util.atomic_io import free_path
from maniport.version import __version__

Severity = Literal["info", "note", "warning", "error"]
Status = Literal["", "green", "amber", "red"]

Value = object
"""A value for JSON: None, a number, text, `Statistics`, an array, or a list or mapping of values."""

STATUS: dict[Status, str] = {
    "green": "no warnings",
    "amber": "check the warnings before execution",
    "red": "do not execute",
}
"""Status of a result without warnings, with warnings and with errors, and its meaning."""

RECORDING = "recording"
FIT = "human-model"
"""Keys of warnings about a recording, and about the difference between model and person."""

SUFFIXES = {"mm": "_mm", "m": "_m", "°": "_deg", "s": "_s", "Hz": "_hz"}
"""Ends of keys in JSON by unit."""

FIRST_KEYS = ("force", "velocity")
"""Keys of what a motion is planned for, which a summary begins with."""

TIME_COLUMN = "time of maximum [s]"  # pages make links of its cells


@dataclass(frozen=True)
class Statistics:
    """Statistics of values over waypoints, in the unit of their metric."""

    median: float
    p95: float  # 95th percentile
    maximum: float
    time_of_maximum: float  # [s]
    tolerance: float | None = None
    far_share: float | None = None  # share of the waypoints that are far beyond the tolerance

    @property
    def numbers(self) -> dict[str, float]:
        """The statistics by their names in JSON."""
        numbers = {
            "median": self.median,
            "p95": self.p95,
            "max": self.maximum,
            "max_at_s": self.time_of_maximum,
        }
        if self.tolerance is not None:
            numbers["tolerance"] = self.tolerance
        if self.far_share is not None:
            numbers["far_share"] = self.far_share
        return numbers

    @property
    def cells(self) -> tuple[str, str, str, str]:
        """Median, 95th percentile and maximum, and the time of the maximum [s], as text."""
        return (
            f"{self.median:.2f}",
            f"{self.p95:.2f}",
            f"{self.maximum:.2f}",
            f"{self.time_of_maximum:.1f}",
        )


@dataclass(frozen=True)
class Metric:
    """A number, a setting, a note or a warning of a `Section`.

    Attributes
    ----------
    label : str
    text : str
        The value with its unit, or sentences of a note or warning; if empty, the metric is in JSON only.
    description : str
    key : str
        Name in JSON without the unit, or the kind of a warning. Without a key, the metric is not in JSON.
    value : number, str, list, dict or Statistics
    unit : str
        Of all numbers in the value.
    severity : {"info", "note", "warning", "error"}
        An error is a warning that prohibits the execution of a motion.
    main : bool
        Whether the metric is in the summary of a result.
    times : tuple of float
        Exact times of the rounded ones in the text, which pages link to [s].
    """

    label: str
    text: str
    description: str = ""
    key: str = ""
    value: Value = None
    unit: str = ""
    severity: Severity = "info"
    main: bool = False
    times: tuple[float, ...] = ()

    @property
    def is_warning(self) -> bool:
        """Whether the metric is a warning or an error."""
        return self.severity in ("warning", "error")

    @property
    def statistics(self) -> Statistics | None:
        """The value, if it is statistics over waypoints."""
        return self.value if isinstance(self.value, Statistics) else None

    @property
    def heading(self) -> str:
        """The label with the unit of statistics."""
        if self.statistics is not None and self.unit:
            return f"{self.label} [{self.unit}]"
        return self.label

    def number(self, name: str) -> float:
        """Return a number of a value that is a mapping."""
        assert isinstance(self.value, Mapping)
        return float(self.value[name])


@dataclass(frozen=True)
class Table:
    """Rows of text under column names, in a `Section`; key and value as in `Metric`."""

    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    caption: str = ""
    key: str = ""
    value: Value = None
    times: tuple[float, ...] = ()  # exact times of the column `TIME_COLUMN`, one for each row

    @classmethod
    def of(
        cls,
        records: Sequence[Mapping[str, Value]],
        columns: Mapping[str, str],
        caption: str,
        key: str,
    ) -> "Table":
        """Return a table of records: format strings by column name."""
        rows = []
        for record in records:
            cells = [template.format(**record) for template in columns.values()]
            rows.append(tuple(cells))
        return cls(tuple(columns), tuple(rows), caption, key, list(records))


@dataclass
class Section:
    """Metrics of a `Report` that belong together; methods add some.

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
        Whether it is a detail: the page folds it, and a summary in Markdown omits it.
    """

    title: str
    metrics: tuple[Metric, ...] = ()
    tables: tuple[Table, ...] = ()
    key: str = ""
    text: str = ""
    folded: bool = False

    def add(
        self,
        label: str,
        key: str,
        value: Value,
        text: str | None = None,
        about: str = "",
        *,
        unit: str = "",
        main: bool = False,
        times: tuple[float, ...] = (),
    ) -> None:
        """Add a setting or a number with a description; its text is the value by default."""
        if text is None:
            text = written(value)
        metric = Metric(label, text, about, key, value, unit, main=main, times=times)
        self.metrics = (*self.metrics, metric)

    def numbers(self, **values: Value) -> None:
        """Add metrics that are in JSON only; the keys have the units."""
        for key, value in values.items():
            metric = Metric("", "", key=key, value=value)
            self.metrics = (*self.metrics, metric)

    def warn(
        self,
        key: str,
        *texts: str,
        severity: Severity = "warning",
        value: Value = None,
        times: Sequence[float] = (),
    ) -> None:
        """Add warnings, or notes, with a stable key for programs; `times` as in `Metric`."""
        for text in texts:
            metric = Metric(
                "",
                sentence(text),
                key=key,
                value=value,
                severity=severity,
                times=tuple(times),
            )
            self.metrics = (*self.metrics, metric)

    def note(self, *texts: str) -> None:
        """Add notes."""
        self.warn("", *texts, severity="note")

    @property
    def lines(self) -> list[Metric]:
        """Settings and notes: metrics that are a line of text each."""
        lines = []
        for metric in self.metrics:
            if metric.text and not metric.is_warning and metric.statistics is None:
                lines.append(metric)
        return lines

    def statistics(self, without: Sequence[str] = ()) -> list[Table]:
        """Return a table of the statistics, but for those with some keys; none where it has no rows."""
        rows = []
        times = []
        for metric in self.metrics:
            statistics = metric.statistics
            if statistics is not None and metric.key not in without:
                rows.append((metric.heading, *statistics.cells))
                times.append(statistics.time_of_maximum)
        if not rows:
            return []

        columns = ("", "median", "95th percentile", "max", TIME_COLUMN)
        return [Table(columns, tuple(rows), times=tuple(times))]


@dataclass(frozen=True)
class Report:
    """Everything that is reported of a result, see `report_of`.

    Attributes
    ----------
    title, lead : str
        Title, and a sentence about the kind of result.
    sections : tuple of Section
        Metrics and tables by topic.
    outcome : str
        The outcome of a result in one sentence; empty for other objects.
    cause, advice : str
        What prevents a better outcome, and the next step.
    command : str
        Command of the next step, with ``{folder}`` for the folder of the results.
    graded : bool
        Whether the result has a status.
    """

    title: str
    lead: str = ""
    sections: tuple[Section, ...] = ()
    outcome: str = ""
    cause: str = ""
    advice: str = ""
    command: str = ""
    graded: bool = True

    @property
    def metrics(self) -> tuple[Metric, ...]:
        """The metrics of all sections."""
        metrics: list[Metric] = []
        for section in self.sections:
            metrics.extend(section.metrics)
        return tuple(metrics)

    @property
    def times(self) -> tuple[float, ...]:
        """Exact times that texts name [s], each once."""
        times = set[float]()
        for metric in self.metrics:
            times.update(metric.times)
        return tuple(sorted(times))

    @property
    def main_metrics(self) -> tuple[Metric, ...]:
        """The metrics of the summary: force and speed, then statistics, those of one kind together, then others."""
        metrics = [metric for metric in self.metrics if metric.main and metric.text]
        order = list(dict.fromkeys(metric.key for metric in metrics))

        def rank(metric: Metric) -> tuple[bool, bool, int]:
            is_other = metric.key not in FIRST_KEYS
            return is_other, is_other and metric.statistics is None, order.index(metric.key)

        return tuple(sorted(metrics, key=rank))

    @property
    def warning_metrics(self) -> tuple[Metric, ...]:
        """The warnings, each text once; errors come first, then those about the data."""
        by_text = dict[str, Metric]()
        for metric in self.metrics:
            if metric.is_warning and metric.text:
                by_text.setdefault(metric.text, metric)
        about_data = {RECORDING: -2, FIT: -1}

        def rank(metric: Metric) -> tuple[bool, int]:
            return metric.severity != "error", about_data.get(metric.key, 0)

        return tuple(sorted(by_text.values(), key=rank))

    @property
    def warnings(self) -> tuple[str, ...]:
        """Texts of the warnings."""
        return tuple(metric.text for metric in self.warning_metrics)

    @property
    def warning_keys(self) -> tuple[str, ...]:
        """Keys of the warnings, each once."""
        keys = [metric.key for metric in self.warning_metrics]
        return tuple(dict.fromkeys(keys))

    @property
    def status(self) -> Status:
        """``"green"``, ``"amber"`` or ``"red"``: the worst of all metrics; empty where there is no outcome."""
        if not self.outcome or not self.graded:
            return ""
        severities = {metric.severity for metric in self.metrics}
        if "error" in severities:
            return "red"
        if "warning" in severities:
            return "amber"
        return "green"

    @property
    def status_text(self) -> str:
        """The status with its meaning and the kinds of the warnings in words; empty without a status."""
        if not self.status:
            return ""
        text = f"{self.status.capitalize()}: {STATUS[self.status]}"
        kinds = listed(key.replace("-", " ") for key in self.warning_keys)
        if kinds:
            text += f" ({kinds})"
        return text + "."

    def command_for(self, folder: str = "") -> str:
        """Return the command of the next step for a shell; empty unless the results were written to a folder.

        Its own results go to a new folder.
        """
        if not folder:
            return ""
        if folder in (".", "..") or folder.startswith("-"):
            folder = os.path.abspath(folder)

        words = list[str]()
        for word in self.command.split(" "):
            if "{folder}" not in word:
                words.append(word)
                continue
            path = word.replace("{folder}", folder)
            if words and words[-1] == "-o":
                path = str(free_path(Path(path)))
            words.append(shlex.quote(path))
        return " ".join(words)


def sentence(text: str) -> str:
    """Let a text begin with a capital letter and end with a full stop."""
    text = text[:1].upper() + text[1:]
    if not text.endswith((".", ":", "!", "?")):
        text += "."
    return text


def listed(values: Iterable[object]) -> str:
    """Write values with commas between them."""
    return ", ".join(map(str, values))


def written(value: Value) -> str:
    """Write a value."""
    if isinstance(value, list | tuple):
        return listed(value)
    return str(value)


def at_time(time: float) -> str:
    """Write a time [s]; pages make links of these."""
    return f"at {time:.1f} s"


def in_axes(distance: float) -> str:
    """Write a distance between ellipsoids as the error of one axis that has the same distance."""
    ratio = float(np.exp(0.5 * distance))
    if ratio >= 1.95:
        return f"like one semi-axis {ratio:.1f} times as long"
    return f"like one semi-axis {100.0 * (ratio - 1.0):.0f} % too long"


PACKAGES = {
    "numpy": "NumPy",
    "scipy": "SciPy",
    "pin": "Pinocchio",
    "pin-pink": "Pink",
}
"""Names of packages on which numbers depend, by their names in the index of packages."""


def software(seed: int | None) -> list[Metric]:
    """Return the seed and the versions of the software."""
    versions = {"maniport": __version__, "Python": platform.python_version()}
    for package, name in PACKAGES.items():
        try:
            versions[name] = metadata.version(package)
        except metadata.PackageNotFoundError:
            continue  # it is installed by other means than a package

    about = "The same seed and versions give the same numbers."
    seed_text = "none" if seed is None else str(seed)
    versions_text = listed(map(" ".join, versions.items()))
    return [
        Metric("Seed", seed_text, about, "random_state", seed),
        Metric("Versions", versions_text, key="versions", value=versions),
    ]
