"""The evaluation as a page to read: the verdict first, then one table."""

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any

from maniport.evaluation.verdict import RECENTRING, TRANSPORT, WORTH_WHILE, Verdict, Weakness

if TYPE_CHECKING:
    from maniport.evaluation.result import Evaluation, Row

Cell = Callable[["Row"], str]


def page(evaluation: "Evaluation", title: str, level: int, legend: bool) -> str:
    """Write the page in Markdown; columns that no row has are left out."""
    rows = [evaluation.student_noise, *evaluation.rows]
    heads, lines = cells(evaluation)
    table = ["| | " + " | ".join(heads) + " |", "|---" * (len(heads) + 1) + "|"]
    for row, (name, *values) in zip(rows, lines, strict=True):
        shown = f"**{name}**" if row is evaluation.adapter else name
        table.append(f"| {shown} | " + " | ".join(values) + " |")
    notes = [f"- {row.name}: {text}." for row in rows for text in (row.note, *row.warnings) if text]
    return "\n".join(
        [
            f"{'#' * level} {title}",
            "",
            f"**{in_words(evaluation.verdict)}**",
            "",
            *table,
            "",
            *([*notes, ""] if notes else []),
            *([*legend_lines(heads), ""] if legend else []),
            *_settings(evaluation.settings),
        ]
    )


def cells(evaluation: "Evaluation") -> tuple[list[str], list[list[str]]]:
    """Return the headings of the columns that any row has, and for each row its name and what it has there."""
    rows = [evaluation.student_noise, *evaluation.rows]
    columns = [(head, cell) for head, cell, _ in COLUMNS if any(cell(row) for row in rows)]
    return [head for head, _ in columns], [[row.name, *(cell(row) or "–" for _, cell in columns)] for row in rows]


def legend_lines(heads: Iterable[str]) -> list[str]:
    """Say what the columns with these headings mean."""
    meaning = {head: about for head, _, about in COLUMNS}
    return [f"- {head}: {meaning[head]}" for head in heads]


def in_words(verdict: Verdict) -> str:
    """Say a verdict in a sentence or a few."""
    same = [
        f"It does no more here than {label(name)} does." for name in (RECENTRING, TRANSPORT) if name in verdict.same_as
    ]
    return " ".join([*_comparison(verdict), *same, *(_weakness(one) for one in verdict.weaknesses)])


def label(name: str) -> str:
    """Call a method as people do."""
    return name.replace("-", " ")


def _comparison(verdict: Verdict) -> list[str]:
    name, mine, nothing = verdict.name, verdict.value, verdict.raw_copy
    if mine is None or nothing is None:
        return [f"{name} is not compared: neither the truth nor the student's kinematics is known."]
    measure = {"rmse": "RMSE", "feasibility_gap": "mean feasibility gap"}[verdict.measure]
    others = {row: value for row, value in verdict.values.items() if row != name and row not in verdict.same_as}
    advice = [] if verdict.value == verdict.best_value or not verdict.recommended else [f"Take {verdict.recommended}."]
    if "raw-copy" not in others:
        return [f"{name} does what a raw copy does ({measure} {mine:.3f}).", *advice]
    best = min(others, key=lambda other: others[other])
    if mine >= WORTH_WHILE * nothing:
        gain = "hardly" if mine < nothing else "not"
        return [f"{name} is {gain} better than doing nothing: {measure} {mine:.3f}, raw copy {nothing:.3f}.", *advice]
    against = f"{measure} {mine:.3f} against {nothing:.3f} of a raw copy"
    if best == "raw-copy":
        return [f"{name} is better than doing nothing: {against}."]
    if mine >= WORTH_WHILE * others[best]:
        gain = "hardly" if mine < others[best] else "not"
        beside = f"{gain} better than {label(best)} ({others[best]:.3f})"
        return [f"{name} is better than doing nothing ({against}), but {beside}.", *advice]
    beside = f"{others[best]:.3f} of {label(best)}"
    return [f"{name} is better than doing nothing and than every cheap alternative: {against}, {beside}."]


def _weakness(one: Weakness) -> str:
    if one.code == "rough":
        return f"Its largest step is {one.value:.1f} times the teacher's own."
    if one.code == "staircase":
        return "It is a staircase: where the teacher moves, half of its steps or more are zero."
    if one.code == "shuffled":
        return f"It mixes up near and far: rank correlation of distances {one.value:.2f}."
    if one.code == "restless":
        beside = "" if one.beside is None else f"; {label(TRANSPORT)}: {one.beside:.3f}"
        return f"It changes the student's own ellipsoids by {one.value:.3f} where nothing should change{beside}."
    return (
        f"Its rotation is off by {one.value:.0f}° (root mean square) between draws of the same domains: the clouds do "
        "not determine it."
    )


def _settings(settings: dict[str, Any]) -> list[str]:
    return ["; ".join(f"{name} {value}" for name, value in settings.items()) + ".", ""] if settings else []


def _rmse(row: "Row") -> str:
    one = row.rmse
    return "" if one is None else f"{one.undivided:.3f} / {one.per_dispersion:.3f} / {one.per_squared_dispersion:.3f}"


def _gap(name: str) -> Cell:
    def cell(row: "Row") -> str:
        gaps = getattr(row, name)
        return "" if gaps is None else f"{gaps.mean:.3f} / {gaps.median:.3f} / {gaps.p95:.3f}"

    return cell


def _steps(row: "Row") -> str:
    steps = row.smoothness
    return "" if steps is None else f"{steps.largest_ratio:.2f} / {steps.median_ratio:.2f}"


def _ranks(row: "Row") -> str:
    return "" if row.structure is None else f"{row.structure.spearman:.3f} / {row.structure.distortion:.3f}"


def _turns(row: "Row") -> str:
    if row.structure is None:
        return ""
    turns = (row.structure.major_turn, row.structure.minor_turn)
    return " / ".join("none" if turn is None else f"{turn:.1f}°" for turn in turns)


def _number(name: str) -> Cell:
    def cell(row: "Row") -> str:
        value = getattr(row, name)
        return "" if value is None else f"{value:.3f}"

    return cell


def _spread(row: "Row") -> str:
    return "" if row.stability is None else f"{row.stability.rotation_rms:.2f}° / {row.stability.map_spread:.3f}"


COLUMNS: tuple[tuple[str, Cell, str], ...] = (
    ("RMSE", _rmse, "distance to the truth: undivided / by the mean distance / by the mean squared distance."),
    (
        "feasibility gap",
        _gap("feasibility_gap"),
        "from the profile to what the student can make in its limits: mean / median / 95 %.",
    ),
    ("feasibility gap, domain", _gap("domain_feasibility_gap"), "the same of samples of the teacher's domain."),
    ("step", _steps, "largest / median step of the profile over the teacher's own; 1 keeps it."),
    ("structure", _ranks, "pairwise distances: rank correlation (1 is best) / distortion (0 is best)."),
    ("turn of axes", _turns, "median angle to the teacher's longest / shortest axes."),
    ("energy distance", _number("energy_distance"), "from the mapped domain of the teacher to the student's."),
    ("identity test", _number("identity"), "student → student, where nothing should change; 0 is best."),
    ("stability", _spread, "over independent draws: spread of the rotation (rms) / of the mapped profile (rms)."),
)
"""Heading, how a row fills it (empty: not measured), and what it means."""
