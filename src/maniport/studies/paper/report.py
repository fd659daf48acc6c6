"""Experiments as pages to read (Markdown), tables to compute with (CSV) and everything (JSON)."""

import csv
import io
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, fields
from typing import Any

from maniport.notebook import ShownInNotebooks
from maniport.studies.paper.outcome import Experiment, Outcome
from maniport.studies.paper.tables import OURS, PAPER
from maniport.telling.facts import Fact, Facts, Section, Table, told, warning
from maniport.telling.of_run import software
from maniport.telling.renderings import as_markdown

SETTINGS = PAPER, OURS
FORMS = {
    "per_dispersion": "÷ c",
    "undivided": "RMSE",
    "per_squared_dispersion": "÷ c²",
}
"""The three forms of the error and what stands above their columns; the paper's own first."""

CAPTION = (
    "Root mean squared affine-invariant distance to the truth, divided by the dispersion of the mapped set, as the "
    "paper prints it; mean ± standard deviation over draws. Less is better."
)

LEGEND = (
    "RMSE: root mean squared affine-invariant distance to the truth. ÷ c: divided by the mean distance of the mapped "
    "ellipsoids to their mean, the paper's form. ÷ c²: divided by their mean squared distance, as the authors' code "
    "does. Over several draws: mean ± standard deviation; iterations are means, times medians."
)


def as_csv(experiment: Experiment) -> str:
    """One line for each outcome; the columns are the attributes of `Outcome`."""
    stream = io.StringIO()
    table = csv.DictWriter(stream, [field.name for field in fields(Outcome)], lineterminator="\n")
    table.writeheader()
    table.writerows(asdict(outcome) for outcome in experiment.outcomes)
    return stream.getvalue()


@dataclass(frozen=True, repr=False)
class Reproduction(ShownInNotebooks):
    """The paper's experiments, run again.

    Attributes
    ----------
    experiments : tuple of Experiment
    seed : int
    seconds : float
        That all of it took.
    """

    experiments: tuple[Experiment, ...]
    seed: int
    seconds: float

    def __repr__(self) -> str:
        names = ", ".join(one.name for one in self.experiments)
        return f"Reproduction({names}; seed {self.seed}, {self.seconds:.0f} s)"


@told.register
def reproduction_facts(reproduction: Reproduction) -> Facts:
    """Tell what the paper printed and what came out, a section for each experiment."""
    return Facts(
        "The paper's experiments, run again",
        "Human-to-robot manipulability transfer by Riemannian ICP: what the paper prints, its settings run again, and "
        "maniport's defaults.",
        (
            *map(experiment_section, reproduction.experiments),
            Section(
                "What was done",
                (
                    Fact("Paper", "Reithmeir, Figueredo and Haddadin, IROS 2022 (arXiv 2208.07588)"),
                    Fact("Time", f"{reproduction.seconds:.0f} s", "That all experiments took.",
                         "duration", round(reproduction.seconds, 1), "s"),
                    *software(reproduction.seed),
                ),
            ),
        ),
    )  # fmt: skip


def experiment_section(experiment: Experiment) -> Section:
    """Tell of one experiment: a line for each row and evaluation set, the paper beside each of our settings."""
    settings = tuple(dict.fromkeys(outcome.settings for outcome in experiment.outcomes))
    lines: dict[tuple[str, ...], dict[str, Outcome]] = {}
    for outcome in experiment.outcomes:
        key: tuple[str, ...] = outcome.data, outcome.samples, outcome.method, outcome.evaluation
        lines.setdefault(key, {})[outcome.settings] = outcome
    rows = tuple(
        (*names, _number(next(iter(found.values())).paper_rmse), *(_error(found.get(one)) for one in settings))
        for names, found in lines.items()
    )
    numbers = [asdict(outcome) for outcome in experiment.outcomes]
    facts = [Fact(_capital(name), _number(value), key=name, value=value) for name, value in experiment.facts.items()]
    return Section(
        experiment.title,
        (*_warnings(experiment), *facts, Fact("", "", key="found", value=experiment.found)),
        (Table(("data", "samples", "method", "on", "paper", *settings), rows, CAPTION, "rows", numbers),),
        experiment.name,
        "\n".join(experiment.notes).replace("`", ""),
    )


def _warnings(experiment: Experiment) -> list[Fact]:
    # a fit has one outcome for each evaluation set
    fits = {(one.settings, one.data, one.samples, one.method): one for one in experiment.outcomes}
    warned: dict[str, tuple[int, int]] = {}
    for outcome in fits.values():
        count, draws = warned.get(outcome.settings, (0, 0))
        warned[outcome.settings] = count + outcome.warned, draws + outcome.draws
    return [
        warning(f"{experiment.title}, {settings}: the library warned in {count} of {draws} fits")
        for settings, (count, draws) in warned.items()
        if count
    ]


def _error(outcome: Outcome | None) -> str:
    if outcome is None:
        return "–"
    spread = f" ± {_number(outcome.per_dispersion_spread)}" if outcome.draws > 1 else ""
    return _number(outcome.per_dispersion) + spread


def experiment_facts(experiment: Experiment) -> Facts:
    """Tell of one experiment alone."""
    return Facts(experiment.title, "", (experiment_section(experiment),))


def as_page(experiment: Experiment, figures: Iterable[str] = ()) -> str:
    """Write the page of an experiment in Markdown: its facts, every number, the settings, the figures."""
    lines = [as_markdown(experiment_facts(experiment)), "## Every number", "", LEGEND, ""]
    for data, outcomes in _sections(experiment):
        lines += [f"### {_capital(data)}", "", *_full_table(outcomes), ""]
    lines += ["## Settings", "", *_settings(experiment), ""]
    for name in figures:
        lines += [f"![{name}]({name}.png)", "", f"For a paper: [{name}.svg]({name}.svg)", ""]
    return "\n".join(lines)


def _full_table(outcomes: Sequence[Outcome]) -> list[str]:
    """Every row and evaluation set with all forms of the error, in both settings."""
    columns = [*FORMS.values(), "iterations", "ms"]
    shown = [one for one in SETTINGS if any(outcome.settings == one for outcome in outcomes)]
    heads = [f"{one}: {columns[0]}" if k == 0 else columns[k] for one in shown for k in range(len(columns))]
    lines = _table_head("samples", "method", "evaluation", "paper", *heads)
    for (samples, method), group in _rows(outcomes):
        for evaluation in dict.fromkeys(outcome.evaluation for outcome in group):
            found = {outcome.settings: outcome for outcome in group if outcome.evaluation == evaluation}
            first = next(iter(found.values()))
            paper = _number(first.paper_rmse)
            paper += f" ({first.paper_iterations} iterations)" if first.paper_iterations else ""
            cells = [cell for one in shown for cell in _cells(found.get(one))]
            lines.append(_line(samples, method, evaluation, paper, *cells))
    return lines


def _cells(outcome: Outcome | None) -> list[str]:
    if outcome is None:
        return [""] * (len(FORMS) + 2)
    forms = [
        _number(getattr(outcome, form))
        + (f" ± {_number(getattr(outcome, f'{form}_spread'))}" if outcome.draws > 1 else "")
        for form in FORMS
    ]
    return [*forms, f"{outcome.iterations:.3g}", f"{1e3 * outcome.seconds:.1f}"]


def _settings(experiment: Experiment) -> list[str]:
    """Say which adapter stands behind each row, with seeds, and where the library warned."""
    lines = _table_head("settings", "rows", "adapter", "draws", "first seed", "draws with a warning")
    for settings in SETTINGS:
        kept: dict[tuple[str, int, int, int], list[str]] = {}
        for outcome in experiment.outcomes:
            if outcome.settings == settings:
                key = outcome.adapter, outcome.draws, outcome.seed, outcome.warned
                name = f"{outcome.samples} {outcome.method}"
                kept.setdefault(key, [])
                kept[key] += [name] if name not in kept[key] else []
        lines += [_line(settings, "; ".join(rows), f"`{key[0]}`", *key[1:]) for key, rows in kept.items()]
    return lines


def _sections(experiment: Experiment) -> list[tuple[str, list[Outcome]]]:
    names = dict.fromkeys(outcome.data for outcome in experiment.outcomes)
    return [(name, [outcome for outcome in experiment.outcomes if outcome.data == name]) for name in names]


def _rows(outcomes: Sequence[Outcome]) -> list[tuple[tuple[str, str], list[Outcome]]]:
    """Group outcomes by what was fitted, in the order of their first appearance."""
    names = dict.fromkeys((outcome.samples, outcome.method) for outcome in outcomes)
    return [(key, [x for x in outcomes if (x.samples, x.method) == key]) for key in names]


def _table_head(*names: str) -> list[str]:
    return [_line(*names), _line(*("---" for _ in names))]


def _line(*cells: object) -> str:
    return f"| {' | '.join(str(cell) for cell in cells)} |"


def _number(value: Any) -> str:
    """Three decimals, or the power of ten where they would show nothing."""
    if value is None:
        return "–"
    if isinstance(value, int | str):
        return str(value)
    return f"{value:.3f}" if value >= 1e-3 or value == 0 else f"{value:.0e}"


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
