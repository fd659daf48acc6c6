"""Values that a report consists of: metrics, tables, sections and the summary."""

import shlex
from dataclasses import dataclass
from typing import Any

from maniport.errors import InvalidInputError

INFO, NOTE, WARNING = "info", "note", "warning"
GREEN, AMBER, RED = "green", "amber", "red"
"""No warning; warnings to resolve before the motion runs; a motion that must not run."""


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
    severity : {"info", "note", "warning"}
    main : bool
        Whether the metric is in the summary of a result.
    """

    label: str
    text: str
    description: str = ""
    key: str = ""
    value: Any = None
    unit: str = ""
    severity: str = INFO
    main: bool = False

    @property
    def is_statistics(self) -> bool:
        """Whether the value has median, 95th percentile and maximum."""
        return isinstance(self.value, dict) and {"median", "p95", "max"} <= set(self.value)

    @property
    def where(self) -> str:
        """Time of the maximum of statistics; empty where there is none."""
        return at_time(self.value["max_at_s"]) if self.is_statistics and "max_at_s" in self.value else ""

    def cells(self, decimals: int = 2) -> tuple[str, str, str]:
        """Return median, 95th percentile and maximum of statistics as text."""
        median, p95, largest = (f"{self.value[name]:.{decimals}f}" for name in ("median", "p95", "max"))
        return median, p95, largest

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

    def __post_init__(self) -> None:
        for row in self.rows:
            if len(row) != len(self.columns):
                raise InvalidInputError(
                    f"every row of a table must have {len(self.columns)} cells, one for each column; found {len(row)}"
                )


@dataclass(frozen=True)
class Section:
    """Metrics of a `Report` that belong together."""

    title: str
    metrics: tuple[Metric, ...] = ()
    tables: tuple[Table, ...] = ()
    key: str = ""  # name in JSON; without one the metrics are at the top level there
    text: str = ""  # Markdown below the title, one paragraph per line; names from files must be escaped
    folded: bool = False  # whether it is a detail: the page folds it, and a summary in Markdown omits it


@dataclass(frozen=True)
class Summary:
    """The outcome of a result, in a `Report`."""

    title: str  # the outcome in one sentence
    text: str = ""  # what prevents a better outcome
    advice: str = ""  # the next step
    command: str = ""  # its command, in which ``{folder}`` stands for the folder of the results
    status: str = ""  # "green", "amber" or "red", from the warnings alone; empty where there is no outcome
    reasons: tuple[str, ...] = ()  # keys of the warnings that the status follows from
    metrics: tuple[Metric, ...] = ()  # the most important ones first

    @property
    def status_text(self) -> str:
        """The status with its meaning and its reasons in words; empty without a status."""
        meaning = {GREEN: "no warnings", AMBER: "resolve the warnings before it runs", RED: "do not run it"}
        if not self.status:
            return ""
        reasons = f" ({', '.join(key.replace('-', ' ') for key in self.reasons)})" if self.reasons else ""
        return f"{self.status.capitalize()}: {meaning[self.status]}{reasons}."

    def command_for(self, folder: str = "results") -> str:
        """Return the command with the folder of the results, quoted for a shell."""
        return self.command.replace("{folder}", shlex.quote(folder))


@dataclass(frozen=True)
class Report:
    """Everything that is reported of a result, see `report_of`.

    Attributes
    ----------
    title, lead : str
        Title, and a sentence about the kind of result.
    sections : tuple of Section
        Metrics and tables by topic.
    summary : Summary, optional
        Result, advice and reasons.
    data_warnings : tuple of Metric
        Warnings about the data, which precede those of the sections.
    """

    title: str
    lead: str = ""
    sections: tuple[Section, ...] = ()
    summary: Summary | None = None
    data_warnings: tuple[Metric, ...] = ()

    @property
    def metrics(self) -> tuple[Metric, ...]:
        """The metrics of all sections."""
        return tuple(metric for section in self.sections for metric in section.metrics)

    @property
    def warning_metrics(self) -> tuple[Metric, ...]:
        """The warnings, each text once."""
        own = (metric for metric in self.metrics if metric.severity == WARNING and metric.text)
        unique = dict[str, Metric]()
        for metric in (*self.data_warnings, *own):
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
        return tuple(dict.fromkeys(metric.text for metric in self.metrics if metric.severity == NOTE and metric.text))

    def metric(self, key: str) -> Metric:
        """Return the first metric with this key; KeyError where there is none."""
        return {metric.key: metric for metric in reversed(self.metrics)}[key]


def at_time(time: float) -> str:
    """Write a time [s]; pages make links of these."""
    return f"at {time:.1f} s"
