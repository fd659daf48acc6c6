"""Tables of the paper's experiments next to its numbers, and how many of these are matched."""

import csv
import io
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from itertools import product
from typing import Any

from maniport.report.metrics import describe
from maniport.report.results import software
from maniport.report.values import Metric, Report, Section, Table, warning
from maniport.studies.methods import Comparison, in_short
from maniport.studies.paper.outcome import Experiment
from maniport.studies.paper.tables import AUTHORS, OURS, PAPER
from maniport.util.notebook import NotebookDisplay

MATCHED, LOWER, HIGHER = "within 20 %", "lower", "higher"

FORMS = {"per_dispersion": "÷ c", "per_squared_dispersion": "÷ c²"}
"""Forms of the error in the paper's text and in the authors' program, with their column heads."""

LEGEND = (
    "RMSE: root mean squared affine-invariant distance to the truth. ÷ c: divided by the mean distance of the mapped "
    "ellipsoids to their mean, as in the paper's text. ÷ c²: by their mean squared distance, as in the authors' "
    "program. Over several draws: mean ± standard deviation; iterations are means."
)

EXACT = "the truth lies in the model class and the rotation search finds it; the authors' gradient exchanges a pair"
OPEN = (
    "the domains do not determine the rotation in the arm's plane; the angles of M-Eval-1 to -3 are not all published"
)
NO_TRUTH = (
    "no truth: errors are distances to a lookup, which depend on its samples; the Panda's paths are not published"
)
REASONS = {"I": EXACT, "II": f"{EXACT} (lower); {OPEN} (higher)", "III": NO_TRUTH}
"""Reasons for numbers that are lower or higher, by table."""


@dataclass(frozen=True, repr=False)
class Reproduction(NotebookDisplay):
    """The paper's experiments, repeated."""

    experiments: tuple[Experiment, ...]
    seed: int
    seconds: float  # of all experiments
    methods: Comparison | None = None

    def __repr__(self) -> str:
        names = ", ".join(experiment.name for experiment in self.experiments)
        return f"Reproduction({names}; seed {self.seed}, {self.seconds:.0f} s)"


@dataclass(frozen=True)
class Group:
    """Counts of the numbers of one table that are matched, lower and higher."""

    table: str  # Roman number
    settings: str  # of our fits
    error: str  # "÷ c" or "÷ c²"
    matched: int
    lower: int
    higher: int
    reason: str  # empty where all are matched


def compare(experiments: Iterable[Experiment], tolerance: float = 0.2) -> tuple[Group, ...]:
    """Count the paper's numbers that are matched, lower and higher, by table, settings and form of the error."""
    lines = [line for each in experiments for line in each.lines() if line["table"] and line["settings"] != OURS]
    ratios: dict[tuple[str, str, str], list[float]] = {}
    for line, form in product(lines, FORMS):
        key = line["table"], line["settings"], FORMS[form]
        ratios.setdefault(key, []).append(line[form] / line["paper_rmse"])
    groups = []
    for (table, settings, error), values in ratios.items():
        lower = sum(value < 1.0 - tolerance for value in values)
        higher = sum(value > 1.0 + tolerance for value in values)
        matched = len(values) - lower - higher
        groups.append(Group(table, settings, error, matched, lower, higher, REASONS[table] if lower + higher else ""))
    return tuple(groups)


def comparison_section(experiments: Iterable[Experiment]) -> Section:
    """Return the counts of `compare` as a table."""
    groups = compare(experiments)
    rows = tuple(tuple(map(str, asdict(group).values())) for group in groups)
    columns = "table", "settings", "error", MATCHED, LOWER, HIGHER, "reason"
    table = Table(columns, rows, "", "groups", [asdict(group) for group in groups])
    lead = "The paper's numbers against ours with the paper's settings; our defaults use the base rotation and damping."
    return Section("Comparison with the paper", (), (table,), "comparison", lead)


@describe.register
def reproduction_report(reproduction: Reproduction) -> Report:
    """Return a section for each experiment, and the comparison with the paper."""
    method = [in_short(reproduction.methods)] if reproduction.methods is not None else []
    run = Section(
        "Run",
        (
            Metric("Paper", "Reithmeir, Figueredo and Haddadin, IROS 2022 (arXiv 2208.07588)"),
            Metric("Time", f"{reproduction.seconds:.0f} s", "Of all experiments.",
                   "duration", round(reproduction.seconds, 1), "s"),
            *software(reproduction.seed),
        ),
    )  # fmt: skip
    sections = map(experiment_section, reproduction.experiments)
    return Report(
        "The paper's experiments, repeated",
        "Human-to-robot manipulability transfer by Riemannian ICP: the paper's numbers, its settings repeated, and "
        "maniport's defaults.",
        (*sections, *method, run, comparison_section(reproduction.experiments)),
    )


def experiment_section(experiment: Experiment) -> Section:
    """Return the paper's rows with our numbers below each, and rows that the paper does not have."""
    lines = experiment.lines()
    metrics = [Metric(name, _number(value), key=name, value=value) for name, value in experiment.facts.items()]
    for settings in dict.fromkeys(outcome.settings for outcome in experiment.outcomes):
        counts = [(one.warned, one.draws) for one in experiment.outcomes if one.settings == settings]
        warned, draws = map(sum, zip(*counts, strict=True))
        if warned:
            metrics.append(warning("fits", f"{experiment.title}, {settings}: warnings in {warned} of {draws} fits"))
    printed, further = ([line for line in lines if (line["table"] is None) is extra] for extra in (False, True))
    tables = [_pivot(printed, LEGEND, "rows", lines)]
    if further:
        tables.append(_pivot(further, f"Rows that the paper does not have, {FORMS['per_dispersion']}:"))
    return Section(experiment.title, tuple(metrics), tuple(tables), experiment.name, "\n".join(experiment.notes))


def experiment_report(experiment: Experiment, figures: Iterable[str] = ()) -> Report:
    """Return the report of one experiment alone, with its figures by name."""
    links = "\n".join(f"![{name}]({name}.png)\nVector graphics: [{name}.svg]({name}.svg)" for name in figures)
    return Report(experiment.title, "", (experiment_section(experiment), Section("Figures", text=links)))


def as_csv(experiment: Experiment) -> str:
    """Return one line for each outcome and evaluation set."""
    stream, lines = io.StringIO(), experiment.lines()
    table = csv.DictWriter(stream, list(lines[0]), lineterminator="\n")
    table.writeheader()
    table.writerows(lines)
    return stream.getvalue()


def _pivot(lines: list[dict[str, Any]], caption: str, key: str = "", value: Any = None) -> Table:
    """Arrange lines as the paper does: a column for each evaluation set, a row for each settings and form."""
    names = "data", "samples", "method"
    columns = [*dict.fromkeys(line["evaluation"] for line in lines)]
    if any(line["paper_iterations"] for line in lines):
        columns.append("iterations")
    rows: dict[tuple[str, ...], dict[str, dict[str, str]]] = {}  # cells by numbers' origin, by data
    for line in lines:
        block = rows.setdefault(tuple(line[name] for name in names), {})
        if line["table"] is not None:
            cells = block.setdefault("paper", {"iterations": _number(line["paper_iterations"])})
            cells[line["evaluation"]] = _number(line["paper_rmse"])
        compared = line["table"] is not None and line["settings"] in (PAPER, AUTHORS)
        for form, head in list(FORMS.items())[: 2 if compared else 1]:
            origin = line["settings"] if line["table"] is None else f"{line['settings']} {head}"
            cells = block.setdefault(origin, {"iterations": f"{line['iterations']:.3g}"})
            spread = f" ± {_number(line[f'{form}_spread'])}" if line["draws"] > 1 else ""
            cells[line["evaluation"]] = _number(line[form]) + spread
    cells_of = tuple(
        (*data, origin, *(cells.get(column, "–") for column in columns))
        for data, block in rows.items()
        for origin, cells in block.items()
    )
    return Table((*names, "numbers of", *columns), cells_of, caption, key, value)


def _number(value: Any) -> str:
    """Three decimals, or the power of ten of small values."""
    if value is None:
        return "–"
    if isinstance(value, int | str):
        return str(value)
    return f"{value:.3f}" if value >= 1e-3 or value == 0 else f"{value:.0e}"
