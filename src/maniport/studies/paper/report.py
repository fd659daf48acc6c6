"""What there is to say of experiments, and their numbers as a table to compute with (CSV)."""

import csv
import io
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from maniport.errors import ConvergenceWarning, IdentifiabilityWarning
from maniport.report.metrics import describe, warning
from maniport.report.runs import software
from maniport.report.values import Metric, Report, Section, Table
from maniport.studies.methods import Comparison, in_short
from maniport.studies.paper.comparison import COMPARED, HEADS, comparison_sections
from maniport.studies.paper.outcome import Experiment
from maniport.studies.paper.tables import OURS
from maniport.util.notebook import ShownInNotebooks

WHAT = "data", "samples", "method", "evaluation"
"""Names of what is measured on what, which is the same in the paper and in each of our settings."""

WARNED: dict[type[Warning], str] = {
    IdentifiabilityWarning: "the domains do not determine the rotation that is fitted",
    ConvergenceWarning: "an iteration stopped before its stopping rule was met",
}
"""What the library warns of."""

LEGEND = (
    "RMSE: root mean squared affine-invariant distance to the truth. ÷ c: divided by the mean distance of the mapped "
    "ellipsoids to their mean, as in the paper's text. ÷ c²: by their mean squared distance, as in the authors' "
    "program. Over several draws: mean ± standard deviation; iterations are means, times medians."
)


def as_csv(experiment: Experiment) -> str:
    """One line for each outcome and evaluation set."""
    stream, lines = io.StringIO(), experiment.lines()
    table = csv.DictWriter(stream, list(lines[0]), lineterminator="\n")
    table.writeheader()
    table.writerows(lines)
    return stream.getvalue()


@dataclass(frozen=True, repr=False)
class Reproduction(ShownInNotebooks):
    """The paper's experiments, run again."""

    experiments: tuple[Experiment, ...]
    seed: int
    seconds: float  # of all experiments
    methods: Comparison | None = None  # of several methods, where that was asked for

    def __repr__(self) -> str:
        names = ", ".join(one.name for one in self.experiments)
        return f"Reproduction({names}; seed {self.seed}, {self.seconds:.0f} s)"


@describe.register
def reproduction_facts(reproduction: Reproduction) -> Report:
    """Tell what the paper printed and what came out, a section for each experiment."""
    return Report(
        "The paper's experiments, run again",
        "Human-to-robot manipulability transfer by Riemannian ICP: what the paper prints, its settings run again, and "
        "maniport's defaults.",
        (
            *map(experiment_section, reproduction.experiments),
            *([in_short(reproduction.methods)] if reproduction.methods is not None else []),
            Section(
                "What was done",
                (
                    Metric("Paper", "Reithmeir, Figueredo and Haddadin, IROS 2022 (arXiv 2208.07588)"),
                    Metric("Time", f"{reproduction.seconds:.0f} s", "That all experiments took.",
                         "duration", round(reproduction.seconds, 1), "s"),
                    *software(reproduction.seed),
                ),
            ),
            *comparison_sections(reproduction.experiments),
        ),
    )  # fmt: skip


def experiment_section(experiment: Experiment) -> Section:
    """Tell of one experiment: the paper's rows with our numbers below each, and rows that the paper does not have."""
    lines = experiment.lines()
    facts = [Metric(_capital(name), _number(value), key=name, value=value) for name, value in experiment.facts.items()]
    printed, further = ([line for line in lines if (line["table"] is None) is other] for other in (False, True))
    tables = [_pivot(printed, LEGEND, "rows", lines)]
    if further:
        tables.append(_pivot(further, f"Rows that the paper does not have, {HEADS['per_dispersion']}:"))
    return Section(
        experiment.title,
        (*_warnings(experiment), *facts, Metric("", "", key="found", value=experiment.found)),
        tuple(tables),
        experiment.name,
        "\n".join(experiment.notes),
    )


def _pivot(lines: list[dict[str, Any]], caption: str, key: str = "", value: Any = None) -> Table:
    """Arrange lines as the paper does: a column for each evaluation set, a row for each settings and metric."""
    sets = tuple(dict.fromkeys(line["evaluation"] for line in lines))
    counted = any(line["paper_iterations"] for line in lines)
    rows: dict[tuple[str, ...], dict[str, str]] = {}
    for line in lines:
        what = tuple(line[name] for name in WHAT[:-1])
        if line["table"] is not None:
            cells = rows.setdefault((*what, "paper"), {"iterations": _number(line["paper_iterations"])})
            cells[line["evaluation"]] = _number(line["paper_rmse"])
        for form in _forms(line):
            name = f"{line['settings']} {HEADS[form]}" if line["table"] is not None else line["settings"]
            cells = rows.setdefault((*what, name), {"iterations": f"{line['iterations']:.3g}"})
            cells[line["evaluation"]] = _error(line, form)
    columns = *sets, *(("iterations",) if counted else ())
    order = list(dict.fromkeys(row[:-1] for row in rows))
    ranked = sorted(rows, key=lambda row: order.index(row[:-1]))
    shown = tuple((*row, *(rows[row].get(column, "–") for column in columns)) for row in ranked)
    return Table((*WHAT[:-1], "numbers of", *columns), shown, caption, key, value)


def _forms(line: dict[str, Any]) -> tuple[str, ...]:
    """Return the forms of the error that a line shows: also the authors' where the paper prints the number."""
    return COMPARED if line["table"] is not None and line["settings"] != OURS else COMPARED[:1]


def _warnings(experiment: Experiment) -> list[Metric]:
    told = []
    for settings in dict.fromkeys(one.settings for one in experiment.outcomes):
        alike = [one for one in experiment.outcomes if one.settings == settings]
        count, draws = sum(one.warned for one in alike), sum(one.draws for one in alike)
        kinds = dict.fromkeys(WARNED.get(kind, kind.__name__) for one in alike for kind in one.warnings)
        if count:
            text = f"the library warned in {count} of {draws} fits that {' or '.join(kinds)}"
            told.append(warning("fits", f"{experiment.title}, {settings}: {text}"))
    return told


def experiment_facts(experiment: Experiment, figures: Iterable[str] = ()) -> Report:
    """Tell of one experiment alone, with every number, the settings in full, and figures by their names."""
    shown = (f"![{name}]({name}.png)\nFor a paper: [{name}.svg]({name}.svg)" for name in figures)
    return Report(
        experiment.title,
        "",
        (
            experiment_section(experiment),
            _every_number(experiment),
            _settings(experiment),
            Section("Figures", text="\n".join(shown)),
        ),
    )


def _every_number(experiment: Experiment) -> Section:
    """Every outcome and evaluation set with all forms of the error, a table for each kind of data."""
    columns = (*WHAT[1:], "settings", "paper", *HEADS.values(), "iterations", "ms")
    rows: dict[str, list[tuple[str, ...]]] = {}
    for line in experiment.lines():
        also = f" ({line['paper_iterations']} iterations)" if line["paper_iterations"] else ""
        names = (line[name] for name in (*WHAT[1:], "settings"))
        cells = (*names, _number(line["paper_rmse"]) + also, *(_error(line, form) for form in HEADS))
        rows.setdefault(line["data"], []).append((*cells, f"{line['iterations']:.3g}", f"{1e3 * line['seconds']:.1f}"))
    tables = (Table(columns, tuple(several), f"{_capital(data)}:") for data, several in rows.items())
    return Section("Every number", tables=tuple(tables), text=LEGEND)


def _settings(experiment: Experiment) -> Section:
    """Say which adapter stands behind each row, with seeds, and where the library warned."""
    columns = "settings", "adapter", "draws", "first seed", "draws with a warning", "rows"
    fits: dict[tuple[str, ...], list[str]] = {}
    for one in experiment.outcomes:
        key = one.settings, f"`{one.adapter}`", str(one.draws), str(one.seed), str(one.warned)
        fits.setdefault(key, []).append(f"{one.samples} {one.method}")
    rows = tuple((*key, "; ".join(dict.fromkeys(names))) for key, names in fits.items())
    return Section("Settings", tables=(Table(columns, rows),))


def _error(line: dict[str, Any], form: str) -> str:
    spread = f" ± {_number(line[f'{form}_spread'])}" if line["draws"] > 1 else ""
    return _number(line[form]) + spread


def _number(value: Any) -> str:
    """Three decimals, or the power of ten where they would show nothing."""
    if value is None:
        return "–"
    if isinstance(value, int | str):
        return str(value)
    return f"{value:.3f}" if value >= 1e-3 or value == 0 else f"{value:.0e}"


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
