"""Values that a report consists of: metrics, tables and sections."""

import contextlib
import os
import platform
import shlex
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any, Literal

import numpy as np

from maniport.util.atomic_io import free_path
from maniport.version import __version__

Severity = Literal["info", "note", "warning", "error"]

STATUS = {
    "green": "no warnings",
    "amber": "check the warnings before execution",
    "red": "do not execute",
}
"""Status of a result without warnings, with warnings and with errors, and its meaning."""

RECORDING, FIT = "recording", "human-model"
"""Keys of warnings about a recording, and about the difference between model and person."""

SUFFIXES = {"mm": "_mm", "m": "_m", "°": "_deg", "s": "_s", "Hz": "_hz"}
"""Ends of keys in JSON by unit."""

TIME_COLUMN = "time of maximum [s]"  # pages make links of its cells


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
    value : number, str, list or dict
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
    value: Any = None
    unit: str = ""
    severity: Severity = "info"
    main: bool = False
    times: tuple[float, ...] = ()

    @property
    def is_warning(self) -> bool:
        """Whether the metric is a warning or an error."""
        return self.severity in ("warning", "error")

    @property
    def is_statistics(self) -> bool:
        """Whether the value has median, 95th percentile and maximum."""
        return isinstance(self.value, dict) and {"median", "p95", "max"} <= set(self.value)

    @property
    def cells(self) -> tuple[str, ...]:
        """Median, 95th percentile and maximum of statistics, and the time of the maximum [s], as text."""
        return (
            *(f"{self.value[name]:.2f}" for name in ("median", "p95", "max")),
            f"{self.value['max_at_s']:.1f}",
        )

    @property
    def heading(self) -> str:
        """The label with the unit of statistics."""
        return f"{self.label} [{self.unit}]" if self.is_statistics and self.unit else self.label


@dataclass(frozen=True)
class Table:
    """Rows of text under column names, in a `Section`; key and value as in `Metric`."""

    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    caption: str = ""
    key: str = ""
    value: Any = None
    times: tuple[float, ...] = ()  # exact times of the column `TIME_COLUMN`, one for each row

    @classmethod
    def of(
        cls,
        records: Sequence[Mapping[str, Any]],
        columns: Mapping[str, str],
        caption: str,
        key: str,
    ) -> "Table":
        """Return a table of records: format strings by column name."""
        rows = tuple(
            tuple(form.format(**record) for form in columns.values()) for record in records
        )
        return cls(tuple(columns), rows, caption, key, list(records))


@dataclass
class Section:
    """Metrics of a `Report` that belong together; methods add some."""

    title: str
    metrics: tuple[Metric, ...] = ()
    tables: tuple[Table, ...] = ()
    key: str = ""  # name in JSON; without one the metrics are at the top level there
    text: str = (
        ""  # Markdown below the title, one paragraph per line; names from files must be escaped
    )
    folded: bool = (
        False  # whether it is a detail: the page folds it, and a summary in Markdown omits it
    )

    def add(
        self,
        label: str,
        key: str,
        value: Any,
        text: str | None = None,
        about: str = "",
        **more: Any,
    ) -> None:
        """Add a setting or a number with a description; its text is the value by default."""
        written = (
            (listed(value) if isinstance(value, list | tuple) else str(value))
            if text is None
            else text
        )
        self.metrics += (Metric(label, written, about, key, value, **more),)

    def numbers(self, **values: Any) -> None:
        """Add metrics that are in JSON only; the keys have the units."""
        self.metrics += tuple(Metric("", "", key=key, value=value) for key, value in values.items())

    def warn(
        self,
        key: str,
        *texts: str,
        severity: Severity = "warning",
        value: Any = None,
        times: Sequence[float] = (),
    ) -> None:
        """Add warnings, or notes, with a stable key for programs; `times` as in `Metric`."""
        exact = tuple(times)
        self.metrics += tuple(
            Metric("", sentence(text), "", key, value, severity=severity, times=exact)
            for text in texts
        )

    def note(self, *texts: str) -> None:
        """Add notes."""
        self.warn("", *texts, severity="note")

    @property
    def lines(self) -> list[Metric]:
        """Settings and notes: metrics that are a line of text each."""
        return [
            metric
            for metric in self.metrics
            if metric.text and not (metric.is_warning or metric.is_statistics)
        ]

    def statistics(self, without: Sequence[str] = ()) -> list[Table]:
        """Return a table of the statistics, but for those with some keys; none where it has no rows."""
        metrics = [
            metric for metric in self.metrics if metric.is_statistics and metric.key not in without
        ]
        if not metrics:
            return []
        rows = tuple((metric.heading, *metric.cells) for metric in metrics)
        times = tuple(metric.value["max_at_s"] for metric in metrics)
        columns = ("", "median", "95th percentile", "max", TIME_COLUMN)
        return [Table(columns, rows, times=times)]


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
        return tuple(metric for section in self.sections for metric in section.metrics)

    @property
    def times(self) -> tuple[float, ...]:
        """Exact times that texts name [s], each once."""
        times = set[float]()
        for metric in self.metrics:
            times.update(metric.times)
        return tuple(sorted(times))

    @property
    def main_metrics(self) -> tuple[Metric, ...]:
        """The metrics of the summary; statistics come first, those of one kind together."""
        metrics = [metric for metric in self.metrics if metric.main and metric.text]
        order = list(dict.fromkeys(metric.key for metric in metrics))
        return tuple(
            sorted(metrics, key=lambda metric: (not metric.is_statistics, order.index(metric.key)))
        )

    @property
    def warning_metrics(self) -> tuple[Metric, ...]:
        """The warnings, each text once; errors come first, then those about the data."""
        unique, rank = dict[str, Metric](), {RECORDING: -2, FIT: -1}
        for metric in self.metrics:
            if metric.is_warning and metric.text:
                unique.setdefault(metric.text, metric)
        return tuple(
            sorted(
                unique.values(),
                key=lambda metric: (metric.severity != "error", rank.get(metric.key, 0)),
            )
        )

    @property
    def warnings(self) -> tuple[str, ...]:
        """Texts of the warnings."""
        return tuple(metric.text for metric in self.warning_metrics)

    @property
    def warning_keys(self) -> tuple[str, ...]:
        """Keys of the warnings, each once."""
        return tuple(dict.fromkeys(metric.key for metric in self.warning_metrics))

    @property
    def status(self) -> str:
        """``"green"``, ``"amber"`` or ``"red"``: the worst of all metrics; empty where there is no outcome."""
        if not (self.outcome and self.graded):
            return ""
        severities = {metric.severity for metric in self.metrics}
        return list(STATUS)[2 if "error" in severities else "warning" in severities]

    @property
    def status_text(self) -> str:
        """The status with its meaning and the kinds of the warnings in words; empty without a status."""
        kinds = ", ".join(key.replace("-", " ") for key in self.warning_keys)
        return (
            f"{self.status.capitalize()}: {STATUS[self.status]}{kinds and f' ({kinds})'}."
            if self.status
            else ""
        )

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
            text = word.replace("{folder}", folder)
            if words and words[-1] == "-o":
                text = str(free_path(Path(text)))
            words.append(word if "{folder}" not in word else shlex.quote(text))
        return " ".join(words)


def sentence(text: str) -> str:
    """Let a text begin with a capital letter and end with a full stop."""
    return text[:1].upper() + text[1:] + ("" if text.endswith((".", ":", "!", "?")) else ".")


def listed(values: Iterable[object]) -> str:
    """Write values with commas between them."""
    return ", ".join(map(str, values))


def at_time(time: float) -> str:
    """Write a time [s]; pages make links of these."""
    return f"at {time:.1f} s"


def in_axes(distance: float) -> str:
    """Write a distance between ellipsoids as the error of one axis that has the same distance."""
    ratio = float(np.exp(0.5 * distance))
    size = (
        f"{ratio:.1f} times as long" if ratio >= 1.95 else f"{100.0 * (ratio - 1.0):.0f} % too long"
    )
    return f"like one semi-axis {size}"


def software(seed: int | None) -> list[Metric]:
    """Return the seed and the versions of the software."""
    versions = {"maniport": __version__, "Python": platform.python_version()}
    for package, name in {
        "numpy": "NumPy",
        "scipy": "SciPy",
        "pin": "Pinocchio",
        "pin-pink": "Pink",
    }.items():
        with contextlib.suppress(
            metadata.PackageNotFoundError
        ):  # it is installed by other means than a package
            versions[name] = metadata.version(package)
    about = "The same seed and versions give the same numbers."
    return [
        Metric("Seed", "none" if seed is None else str(seed), about, "random_state", seed),
        Metric("Versions", listed(map(" ".join, versions.items())), key="versions", value=versions),
    ]
