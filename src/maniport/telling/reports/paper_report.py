"""The report of the paper's experiments, run again."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from maniport.telling.page import Fact, Motion, Picture, Report, Section, Table
from maniport.telling.reports.versions import versions

if TYPE_CHECKING:
    from maniport.studies.paper.outcome import Experiment, Outcome
    from maniport.studies.paper.run import Reproduction

KEYS = ("data", "samples", "method", "on")
CAPTION = (
    "Root mean squared affine-invariant distance to the truth, divided by the dispersion of the mapped set, as the "
    "paper prints it; mean ± standard deviation over draws. Less is better."
)


def of_reproduction(reproduction: Reproduction, shown: Mapping[str, Sequence[Picture | Motion]]) -> Report:
    """Tell what the paper printed and what came out, a section for each experiment.

    Parameters
    ----------
    reproduction : Reproduction
    shown : mapping of str to sequence of Picture or Motion
        What there is to look at, by the name of the experiment.
    """
    sections = [_section(one, shown.get(one.name, ())) for one in reproduction.experiments]
    done = (
        Fact("Paper", "Reithmeir, Figueredo and Haddadin, IROS 2022 (arXiv 2208.07588)"),
        Fact("First seed", str(reproduction.seed), "The same seed and versions give the same numbers."),
        Fact("Time", f"{reproduction.seconds:.0f} s", "That all experiments took."),
        *versions(),
    )
    return Report(
        "The paper's experiments, run again",
        "Human-to-robot manipulability transfer by Riemannian ICP: what the paper prints, its settings run again, and "
        "maniport's defaults.",
        tuple(text for one in reproduction.experiments for text in _warnings(one)),
        (*sections, Section("What was done", "", (done,))),
    )


def _section(experiment: Experiment, shown: Sequence[Picture | Motion]) -> Section:
    facts = tuple(Fact(_capital(name), _number(value)) for name, value in experiment.facts.items())
    parts = (*shown, _table(experiment.outcomes), *((facts,) if facts else ()))
    return Section(experiment.title, "\n".join(experiment.notes).replace("`", ""), parts)


def _warnings(experiment: Experiment) -> list[str]:
    # a fit has one outcome for each evaluation set
    fits = {(one.settings, one.data, one.samples, one.method): one for one in experiment.outcomes}
    warned: dict[str, tuple[int, int]] = {}
    for outcome in fits.values():
        count, draws = warned.get(outcome.settings, (0, 0))
        warned[outcome.settings] = count + outcome.warned, draws + outcome.draws
    return [
        f"{experiment.title}, {settings}: the library warned in {count} of {draws} fits."
        for settings, (count, draws) in warned.items()
        if count
    ]


def _table(outcomes: Sequence[Outcome]) -> Table:
    """One line for each row and evaluation set; the paper and each of our settings side by side."""
    settings = tuple(dict.fromkeys(outcome.settings for outcome in outcomes))
    lines: dict[tuple[str, ...], dict[str, Outcome]] = {}
    for outcome in outcomes:
        key: tuple[str, ...] = outcome.data, outcome.samples, outcome.method, outcome.evaluation
        lines.setdefault(key, {})[outcome.settings] = outcome
    rows = []
    for names, found in lines.items():
        paper = _number(next(iter(found.values())).paper_rmse)
        rows.append((*names, paper, *(_error(found.get(one)) for one in settings)))
    return Table((*KEYS, "paper", *settings), tuple(rows), CAPTION)


def _error(outcome: Outcome | None) -> str:
    if outcome is None:
        return "–"
    spread = f" ± {_number(outcome.per_dispersion_spread)}" if outcome.draws > 1 else ""
    return _number(outcome.per_dispersion) + spread


def _number(value: Any) -> str:
    if value is None:
        return "–"
    if isinstance(value, int | str):
        return str(value)
    return f"{value:.3f}" if value >= 1e-3 or value == 0 else f"{value:.0e}"


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
