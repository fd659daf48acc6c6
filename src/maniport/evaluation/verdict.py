"""The verdict: whether an adapter is better than doing nothing, in words."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from maniport.evaluation.alternatives import LOOKUP, RAW_COPY, RECENTRING, TRANSPORT
from maniport.evaluation.faithfulness import STILL

if TYPE_CHECKING:
    from maniport.evaluation.result import Row

WORTH_WHILE = 0.95
"""A measure must fall below this fraction of another's to count as better."""

ROUGH = 1.5
"""A largest step of more than this times the teacher's own is told."""

SHUFFLED = 0.95
"""A rank correlation of pairwise distances below this is told."""

RESTLESS = 0.15
"""Root mean squared change of the student's own ellipsoids above which the identity test is told."""

UNSTEADY = 5.0
"""Spread of the rotation over draws [degrees, root mean square] above which it is told."""


def verdict(rows: Sequence["Row"]) -> str:
    """Compare the first row with the others by the most telling measure there is, then name its weaknesses.

    That is the RMSE where the truth is known, else the mean true gap, else the mean sample gap. The lookup table takes
    part only where the truth is known, since its gaps are none by construction.
    """
    measure, values = _measure(rows)
    first = rows[0]
    mine = values[first.name]
    others = {
        name: value
        for name, value in values.items()
        if name != first.name and (name != LOOKUP or measure == "RMSE") and abs(value - mine) > 1e-9 * mine
    }
    same = [
        f"It does no more here than {name} does."
        for name in (RECENTRING, TRANSPORT)
        if name in values and name not in others
    ]
    return " ".join([_comparison(first.name, measure, mine, others), *same, *_weaknesses(first, rows)])


def _measure(rows: Sequence["Row"]) -> tuple[str, dict[str, float]]:
    if rows[0].rmse is not None:
        return "RMSE", {row.name: row.rmse.undivided for row in rows if row.rmse is not None}
    if rows[0].true_gap is not None:
        return "mean true gap", {row.name: row.true_gap.mean for row in rows if row.true_gap is not None}
    return "mean sample gap", {row.name: row.sample_gap.mean for row in rows if row.sample_gap is not None}


def _comparison(name: str, measure: str, mine: float, others: dict[str, float]) -> str:
    if RAW_COPY not in others:
        return f"{name} does what a {RAW_COPY} does ({measure} {mine:.3f})."
    nothing = others[RAW_COPY]
    best = min(others, key=lambda other: others[other])
    if mine >= WORTH_WHILE * nothing:
        gain = "hardly" if mine < nothing else "not"
        return f"{name} is {gain} better than doing nothing: {measure} {mine:.3f}, {RAW_COPY} {nothing:.3f}."
    against = f"{measure} {mine:.3f} against {nothing:.3f} of a {RAW_COPY}"
    if best == RAW_COPY:
        return f"{name} is better than doing nothing: {against}."
    if mine >= WORTH_WHILE * others[best]:
        gain = "hardly" if mine < others[best] else "not"
        return f"{name} is better than doing nothing ({against}), but {gain} better than {best} ({others[best]:.3f})."
    beside = f"{others[best]:.3f} of {best}"
    return f"{name} is better than doing nothing and than every cheap alternative: {against}, {beside}."


def _weaknesses(first: "Row", rows: Sequence["Row"]) -> list[str]:
    found = []
    if first.smoothness is not None and first.smoothness.largest_ratio > ROUGH:
        found.append(f"Its largest step is {first.smoothness.largest_ratio:.1f} times the teacher's own.")
    if first.smoothness is not None and first.smoothness.median <= STILL:
        found.append("It is a staircase: where the teacher moves, half of its steps or more are zero.")
    if first.structure is not None and first.structure.spearman < SHUFFLED:
        found.append(f"It mixes up near and far: rank correlation of distances {first.structure.spearman:.2f}.")
    if first.identity is not None and first.identity > RESTLESS:
        closed = next((row.identity for row in rows[1:] if row.name == TRANSPORT), None)
        beside = "" if closed is None or first.name == TRANSPORT else f"; {TRANSPORT}: {closed:.3f}"
        found.append(
            f"It changes the student's own ellipsoids by {first.identity:.3f} where nothing should change{beside}."
        )
    if first.stability is not None and first.stability.rotation_rms > UNSTEADY:
        found.append(
            f"Its rotation is off by {first.stability.rotation_rms:.0f}° (root mean square) between draws of the same "
            "domains: the clouds do not determine it."
        )
    return found
