"""Experiments as pages to read (Markdown), tables to compute with (CSV) and everything (JSON)."""

import csv
import io
import json
from collections.abc import Iterable, Sequence
from dataclasses import asdict, fields
from typing import Any

from maniport import __version__
from maniport.studies.paper.outcome import Experiment, Outcome
from maniport.studies.paper.settings import OURS, PAPER

SETTINGS = PAPER, OURS
FORMS = {
    "per_dispersion": "÷ c",
    "undivided": "RMSE",
    "per_squared_dispersion": "÷ c²",
}
"""The three forms of the error and what stands above their columns; the paper's own first."""

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


def as_json(experiment: Experiment) -> str:
    """Everything that is known about an experiment."""
    return json.dumps(numbers(experiment), indent=2, ensure_ascii=False) + "\n"


def numbers(experiment: Experiment) -> dict[str, Any]:
    """Collect everything that is known about an experiment, ready for JSON."""
    return {
        "maniport": __version__,
        "experiment": experiment.name,
        "title": experiment.title,
        "notes": list(experiment.notes),
        "facts": dict(experiment.facts),
        "rows": [asdict(outcome) for outcome in experiment.outcomes],
    }


def as_markdown(experiment: Experiment, figures: Iterable[str] = ()) -> str:
    """Write the page of an experiment: the short table, every number, the settings, the figures."""
    lines = [digest(experiment), "## How", "", *(f"- {note}" for note in experiment.notes)]
    lines += [f"- {_capital(name)}: {_number(value)}." for name, value in experiment.facts.items()]
    lines += ["", "## Every number", "", LEGEND, ""]
    for data, outcomes in _sections(experiment):
        lines += [f"### {_capital(data)}", "", *_full_table(outcomes), ""]
    lines += ["## Settings", "", *_settings(experiment), ""]
    for name in figures:
        lines += [f"![{name}]({name}.png)", "", f"For a paper: [{name}.svg]({name}.svg)", ""]
    return "\n".join(lines)


def digest(experiment: Experiment) -> str:
    """Write a short table in the paper's own form: one line for each row, the evaluation sets side by side."""
    names = " / ".join(dict.fromkeys(outcome.evaluation for outcome in experiment.outcomes))
    lines = [f"# {experiment.title}", "", f"RMSE divided by the dispersion of the mapped set, on {names}.", ""]
    lines += _table_head("data", "samples", "method", "paper", *SETTINGS)
    for data, outcomes in _sections(experiment):
        for (samples, method), group in _rows(outcomes):
            cells = [" / ".join(_number(x.paper_rmse) for x in _either(group)) if group[0].table else "–"]
            for one in SETTINGS:
                cells.append(" / ".join(_number(x.per_dispersion) for x in group if x.settings == one) or "–")
            lines.append(_line(data, samples, method, *cells))
    return "\n".join([*lines, ""])


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


def _either(outcomes: Sequence[Outcome]) -> list[Outcome]:
    """One outcome for each evaluation set, of whichever settings."""
    return list({outcome.evaluation: outcome for outcome in outcomes}.values())


def _table_head(*names: str) -> list[str]:
    return [_line(*names), _line(*("---" for _ in names))]


def _line(*cells: object) -> str:
    return f"| {' | '.join(str(cell) for cell in cells)} |"


def _number(value: Any) -> str:
    """Three decimals, or the power of ten where they would show nothing."""
    if value is None:
        return "–"
    if isinstance(value, int):
        return str(value)
    return f"{value:.3f}" if value >= 1e-3 or value == 0 else f"{value:.0e}"


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
