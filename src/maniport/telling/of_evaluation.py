"""Facts of an evaluation: whether an adapter is better than simpler ways, and which method was chosen."""

from dataclasses import asdict
from typing import Any, NamedTuple

from maniport.evaluation.baselines import RAW_COPY, RECENTRING, TRANSPORT
from maniport.evaluation.comparison import GAP_SEARCH
from maniport.evaluation.selection import Choice
from maniport.evaluation.verdict import WORTH_WHILE, Evaluation, Row, Verdict, Weakness
from maniport.telling.facts import (
    Fact,
    Facts,
    Section,
    Table,
    at_moment,
    notes,
    numbers,
    sentence,
    told,
    warnings_of,
)
from maniport.transfer.lengths.report import AXIS_MOVED
from maniport.validation import Array

MEASURES = {"rmse": "RMSE", "feasibility_gap": "mean feasibility gap"}


class Column(NamedTuple):
    """A column of the table: which attributes of a row's measure it shows, and how; they are parted by " / "."""

    head: str
    measure: str
    attributes: tuple[str, ...]
    formats: str
    about: str

    def cell(self, row: Row) -> str:
        """Write what a row has of it; empty where it was not measured."""
        measured = getattr(row, self.measure)
        if measured is None:
            return ""
        values = [getattr(measured, name) for name in self.attributes] or [measured]
        pairs = zip(self.formats.split(" / "), values, strict=True)
        return " / ".join("none" if value is None else form.format(value) for form, value in pairs)


_SPREAD = ("mean", "median", "p95", "largest"), "{:.3f} / {:.3f} / {:.3f} / {:.3f}"
_ERRORS = ("undivided", "per_dispersion", "per_squared_dispersion"), "{:.3f} / {:.3f} / {:.3f}"

COLUMNS = (
    Column("RMSE", "rmse", *_ERRORS,
           "distance to the truth: undivided / by the mean distance / by the mean squared distance."),
    Column("feasibility gap", "feasibility_gap", *_SPREAD,
           "from the profile to what the student can make, an upper bound: mean / median / 95 % / largest."),
    Column("feasibility gap, domain", "domain_feasibility_gap", *_SPREAD,
           "the same of further samples of the teacher's domain."),
    Column("step", "smoothness", ("largest_ratio", "median_ratio"), "{:.2f} / {:.2f}",
           "largest / median step of the profile over the teacher's own; 1 keeps it."),
    Column("structure", "structure", ("spearman", "distortion"), "{:.3f} / {:.3f}",
           "pairwise distances: rank correlation (1 is best) / distortion (0 is best)."),
    Column("turn of axes", "structure", ("major_turn", "major_moved", "minor_turn"), "{:.1f}° / {:.0%} / {:.1f}°",
           f"longest axes, angle to the teacher's: median / fraction above {AXIS_MOVED:g}° / shortest axes: median."),
    Column("energy distance", "energy_distance", (), "{:.3f}",
           "from the mapped domain of the teacher to the student's."),
    Column("identity test", "identity", (), "{:.3f}",
           "student → student, where nothing should change; 0 is best."),
    Column("stability", "stability", ("rotation_rms", "map_spread"), "{:.2f}° / {:.3f}",
           "over independent draws: spread of the rotation (rms) / of the mapped profile (rms)."),
)  # fmt: skip
"""The measures in the order of the table."""


@told.register
def evaluation_facts(evaluation: Evaluation) -> Facts:
    """Tell whether an adapter is better than the cheap alternatives."""
    return Facts(evaluation.adapter.name, "", (evaluation_section(evaluation), _settings(evaluation)))


@told.register
def choice_facts(choice: Choice) -> Facts:
    """Tell which method was chosen, and why."""
    return Facts(
        choice.method, "", (evaluation_section(choice.evaluation, choice=choice), _settings(choice.evaluation))
    )


def evaluation_section(
    evaluation: Evaluation, explained: bool = True, choice: Choice | None = None, time: Array | None = None
) -> Section:
    """Say the verdict, or the choice where there was one; then show every measure of any row, `explained` or not."""
    rows, verdict = [evaluation.student_noise, *evaluation.rows], evaluation.verdict
    search = evaluation.settings.get(GAP_SEARCH, "")
    columns = [column for column in COLUMNS if any(map(column.cell, rows))]
    cells = tuple((row.name, *(column.cell(row) or "–" for column in columns)) for row in rows)
    caption = " ".join(sentence(f"{one.head}: {one.about}") for one in columns) if explained else ""
    values = {row.name: _numbers(row) for row in rows}
    return Section(
        "Is it better than simpler ways?",
        (
            *(verdict_facts(verdict) if choice is None else [_choice(choice), *_weaknesses(verdict)]),
            *numbers(verdict=verdict.as_dict()),
            *_largest(evaluation.rows[0], time),
            *([Fact(GAP_SEARCH.capitalize(), search, key="gap_search", value=search)] if search else []),
            *warnings_of("evaluation", [f"{row.name}: {text}" for row in evaluation.rows[:1] for text in row.warnings]),
            *notes(f"{row.name}: {text}" for row in evaluation.rows[1:] for text in (row.note, *row.warnings) if text),
        ),
        (Table(("", *(column.head for column in columns)), cells, caption, "rows", values),),
        "evaluation",
    )


def _largest(row: Row, time: Array | None) -> list[Fact]:
    """Say when the largest gap of the profile is."""
    gaps = row.feasibility_gap
    if gaps is None or time is None:
        return []
    when = float(time[gaps.where])
    return [Fact("Largest gap", f"{gaps.largest:.3f} {at_moment(when)}", key="largest_gap_at", value=when, unit="s")]


def _settings(evaluation: Evaluation) -> Section:
    facts = (
        Fact("The fit", evaluation.adapter.note),
        *(Fact(name.capitalize(), str(value)) for name, value in evaluation.settings.items() if name != GAP_SEARCH),
        *numbers(settings=evaluation.settings),
    )
    return Section("What was done", facts)


def _numbers(row: Row) -> dict[str, Any]:
    """The measures of a row."""
    values = {key: value for key, value in asdict(row).items() if key != "name"}
    if row.smoothness is not None:
        ratios = {key: getattr(row.smoothness, key) for key in ("largest_ratio", "median_ratio")}
        values["smoothness"] |= ratios
    return values


def verdict_facts(verdict: Verdict) -> list[Fact]:
    """Say a verdict: the comparison with what to do, in a warning unless the method is worth while; then weaknesses."""
    said, worth_while = _comparison(verdict)
    mine = verdict.value is not None and verdict.value != verdict.best_value
    advice = f" Take {verdict.recommended}." if verdict.recommended and mine and not worth_while else ""
    key, severity = ("", "note") if worth_while else ("not-better", "warning")
    return [Fact("", said + advice, key=key, severity=severity), *_weaknesses(verdict)]


def _weaknesses(verdict: Verdict) -> list[Fact]:
    return [
        Fact("", _weakness(one, verdict.name), severity="warning" if one.code == "shuffled" else "note")
        for one in verdict.weaknesses
    ]


def _choice(choice: Choice) -> Fact:
    """Report the chosen method, why, and its gap next to that of the best baseline."""
    verdict = choice.evaluation.verdict
    others = {row: value for row, value in verdict.values.items() if row != choice.method}
    nearest = min(others, key=lambda row: others[row], default="")
    against = f" ({label(nearest)}: {others[nearest]:.3f})" if nearest else ""
    why = f"the length field was rejected: {'; '.join(choice.failures)}" if choice.failures else "it passes its checks"
    text = f"{choice.method} was chosen, {why}. Mean feasibility gap {verdict.value or 0.0:.3f}{against}."
    value = {"method": choice.method, "failures": list(choice.failures)}
    return Fact("", text, key="choice", value=value, severity="note")


def label(name: str) -> str:
    """Call a method as people do."""
    return name.replace("-", " ")


def _comparison(verdict: Verdict) -> tuple[str, bool]:
    """Compare the method with the others; also whether it is worth while."""
    name, mine, nothing = verdict.name, verdict.value, verdict.raw_copy
    if mine is None or nothing is None:
        return f"{name} is not compared: neither the truth nor the student's kinematics is known.", True
    measure, more = MEASURES[verdict.measure], _no_more(verdict, mine)
    also = f" It {more}." if more else ""
    others = {row: value for row, value in verdict.values.items() if row != name and row not in verdict.same_as}
    if RAW_COPY not in others:
        return f"{name} does what a raw copy does ({measure} {mine:.3f}).{also}", name == RAW_COPY
    if mine >= WORTH_WHILE * nothing:
        gain = "hardly" if mine < nothing else "not"
        said = f"{name} is {gain} better than doing nothing: {measure} {mine:.3f}, raw copy {nothing:.3f}.{also}"
        return said, False
    best = min(others, key=lambda other: others[other])
    against = f"{measure} {mine:.3f} against {nothing:.3f} of a raw copy"
    if best == RAW_COPY:
        return f"{name} is better than doing nothing: {against}.{also}", True
    if mine >= WORTH_WHILE * others[best]:
        gain = "hardly" if mine < others[best] else "not"
        beside = f"{gain} better than {label(best)} ({others[best]:.3f}).{also}"
        beside = f"{more}." if more and _alike(mine, others[best]) else beside
        return f"{name} is better than doing nothing ({against}), but {beside}", False
    beside = f"{others[best]:.3f} of {label(best)}"
    return f"{name} is better than doing nothing and than every cheap alternative: {against}, {beside}.{also}", True


def _no_more(verdict: Verdict, mine: float) -> str:
    """Name the closed forms that reach the same, as far as it is written; empty where none does."""
    tied = [
        label(row) for row in (RECENTRING, TRANSPORT) if row != verdict.name and _alike(mine, verdict.values.get(row))
    ]
    if not tied:
        return ""
    do = f"do ({mine:.3f} each)" if len(tied) > 1 else f"does ({mine:.3f})"
    return f"does no more here than {' and '.join(tied)} {do}"


def _alike(mine: float, other: float | None) -> bool:
    return other is not None and mine >= WORTH_WHILE * other and f"{mine:.3f}" == f"{other:.3f}"


def _weakness(one: Weakness, name: str) -> str:
    beside = "" if one.beside is None else f"; {label(TRANSPORT)}: {one.beside:.3f}"
    return {
        "rough": f"The largest step of {name} is {one.value:.1f} times the teacher's own.",
        "staircase": f"{name} is a staircase: where the teacher moves, half of its steps or more are zero.",
        "shuffled": f"{name} mixes up near and far: rank correlation of distances {one.value:.2f}.",
        "turned": f"{name} turns the longest axes by {one.value:.0f}° (median).",
        "restless": f"{name} changes the student's own ellipsoids by {one.value:.3f} where nothing should "
        f"change{beside}.",
        "unsteady": f"The rotation of {name} is off by {one.value:.0f}° (root mean square) between draws of the same "
        "domains: the domains do not determine it.",
    }[one.code]
