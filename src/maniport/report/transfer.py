"""Metrics of a fitted adapter, of what the domains determine, and of the comparison with baselines."""

from dataclasses import asdict
from typing import Any, NamedTuple

import numpy as np

from maniport.evaluation.baselines import IDENTITY, TRANSPORT
from maniport.evaluation.comparison import GAP_SEARCH
from maniport.evaluation.selection import Choice
from maniport.evaluation.verdict import WORTH_WHILE, Evaluation, Row, Verdict, Weakness
from maniport.report.metrics import (
    Metric,
    Report,
    Section,
    Table,
    at_time,
    describe,
    listed,
    notes,
    numbers,
    sentence,
    warnings_of,
)
from maniport.transfer import DomainAdapter
from maniport.transfer.adapter import is_fitted
from maniport.transfer.identifiability import Identifiability, axis_name
from maniport.transfer.rotation_group import rotation_angle
from maniport.util.validation import Array


@describe.register
def adapter_report(adapter: DomainAdapter) -> Report:
    """Describe an adapter and its fit."""
    return Report(type(adapter).__name__, "", (adapter_section(adapter),))


def adapter_section(adapter: DomainAdapter, *more: Metric, mounted: bool = False) -> Section:
    """Describe the fit of an adapter; `mounted`: the base rotation is known."""
    # base_rotation, damping and floor have metrics of their own
    parameters = [f"{name} {value}" for name, value in adapter.get_params(deep=False).items()
                  if name not in ("base_rotation", "damping", "eigenvalue_floor") and value is not None]  # fmt: skip
    name = type(adapter).__name__
    method = Metric("Method", name, sentence(listed(parameters)) if parameters else "", "method", name)
    if not is_fitted(adapter):
        state = Metric("State", "not fitted yet; call fit(teacher, student)")
        return Section("Adapter", (method, state), key="adapter")
    ratio, start, end = float(adapter.dispersion_ratio_), float(adapter.history_[0]), float(adapter.cost_)
    teacher, student = float(adapter.teacher_dispersion_), float(adapter.student_dispersion_)
    ended = "converged" if adapter.converged_ else "not converged"
    base_rotation = None if adapter.base_rotation_ is None else np.asarray(adapter.base_rotation_)
    metrics = (
        *_identifiability(adapter, mounted or base_rotation is not None),
        method,
        *more,
        Metric("Base rotation", "not given" if base_rotation is None else base_rotation_text(base_rotation),
               "From the teacher's base frame to the student's.", "base_rotation",
               None if base_rotation is None else base_rotation.round(6).tolist()),
        *numbers(dimension=len(adapter.rotation_)),
        Metric("Rotation", f"{_degrees(adapter.rotation_)} between centered domains; {_degrees(adapter.turn_)} with "
               "the base rotation", "", "rotation", np.asarray(adapter.rotation_).round(6).tolist()),
        Metric("Dispersion", f"teacher {teacher:.4g}, student {student:.4g}, ratio {ratio:.4g}",
               "Root mean squared distance of the ellipsoids from their mean.", "dispersion_ratio", ratio),
        *_regularization(adapter),
        Metric("Fit", f"{adapter.n_iter_} iterations, cost {start:.4f} → {end:.4f}, {ended}", "", "iterations",
               int(adapter.n_iter_)),
        Metric("Stopped", adapter.stop_reason_, key="stop_reason", value=adapter.stop_reason_),
        *([Metric("Held-out samples", adapter.report_.in_words(), key="report", value=asdict(adapter.report_))]
          if hasattr(adapter, "report_") else []),
        *numbers(teacher_dispersion=teacher, converged=bool(adapter.converged_), student_dispersion=student,
                 cost_start=start, cost=end),
    )  # fmt: skip
    return Section("Adapter", metrics, key="adapter")


def base_rotation_text(base_rotation: Array) -> str:
    """Write a rotation from the teacher's base frame to the student's, shape (d, d)."""
    if np.allclose(base_rotation, np.eye(len(base_rotation))):
        return "none: both base frames have the same orientation"
    return f"[{'; '.join(' '.join(f'{value:.3f}' for value in row) for row in base_rotation[:3, :3])}]"


def _regularization(adapter: DomainAdapter) -> list[Metric]:
    teacher, student = float(adapter.teacher_damping_), float(adapter.student_damping_)
    released = float(adapter.released_damping_)
    text = (
        "none"
        if adapter.eigenvalue_floor is None
        else f"eigenvalues are raised to at least {adapter.eigenvalue_floor:g}"
    )
    if adapter.damping is not None:
        text = f"damping {adapter.damping:g}: adds {teacher:.3g} to the teacher, {student:.3g} to the student; "
        text += f"{released:.3g} is subtracted from results"
    return [
        Metric("Regularization", text, "Distances need ellipsoids of full rank."),
        *numbers(damping=adapter.damping, eigenvalue_floor=adapter.eigenvalue_floor, teacher_damping=teacher, student_damping=student,
                 released_damping=released),
    ]  # fmt: skip


def _identifiability(adapter: DomainAdapter, mounted: bool) -> list[Metric]:
    """Describe what the domains determine of the rotation, as far as the fit examined it."""
    found = getattr(adapter, "identifiability_", None)
    if found is None:
        return []
    words, free = found.in_words(), not found.determined
    text = f"the base orientation is taken as known, since {words}" if mounted and free else words
    severity = "warning" if free else "note"
    return [Metric("", sentence(text), key="identifiability", value=words, severity=severity)]


@describe.register
def identifiability_report(found: Identifiability) -> Report:
    """Describe which directions of the rotation the domains determine."""
    axes = [axis_name(axis) for axis in found.axes] or [f"direction {k + 1}" for k in range(len(found.flat))]
    rows = tuple(
        (name, f"{curve:.2g} ± {error:.1g}", "not determined" if flat else "determined")
        for name, curve, error, flat in zip(axes, found.curvature, found.standard_error, found.flat, strict=True)
    )
    metrics = (Metric("Result", found.in_words(), key="identifiability", value=found.in_words()),)
    return Report("", "", (Section("", metrics, (Table(("rotation about", "curvature [1/rad²]", ""), rows),)),))


def _degrees(rotation: Array, other: Array | None = None) -> str:
    start = np.eye(len(rotation)) if other is None else other
    return f"{np.degrees(rotation_angle(start, rotation)):.1f}°"


class Column(NamedTuple):
    """A column of the comparison: attributes of a row's measure, separated by " / "."""

    head: str
    measure: str
    attributes: tuple[str, ...]
    formats: str
    about: str

    def cell(self, row: Row) -> str:
        """Return the text for a row; empty where it was not measured."""
        measured = getattr(row, self.measure)
        if measured is None:
            return ""
        values = [getattr(measured, name) for name in self.attributes]
        pairs = zip(self.formats.split(" / "), values, strict=True)
        return " / ".join("none" if value is None else form.format(value) for form, value in pairs)


COLUMNS = (
    Column("RMSE", "rmse", ("undivided", "per_dispersion"), "{:.3f} / {:.3f}",
           "distance to the truth: undivided / divided by the mean distance."),
    Column("feasibility gap", "feasibility_gap", ("mean", "p95", "largest"), "{:.3f} / {:.3f} / {:.3f}",
           "distance from the targets to the feasible set, an upper bound: mean / 95 % / max."),
    Column("held out", "domain_feasibility_gap", ("mean", "p95"), "{:.3f} / {:.3f}",
           "the same for further samples of the teacher: mean / 95 %."),
    Column("step", "smoothness", ("largest_ratio", "median_ratio"), "{:.2f} / {:.2f}",
           "successive distances relative to the teacher's: largest / median."),
    Column("structure", "structure", ("spearman",), "{:.3f}", "rank correlation of pairwise distances."),
    Column("turn of axes", "structure", ("major_turn",), "{:.1f}°", "median angle of longest axes to the teacher's."),
)  # fmt: skip
"""Columns of the comparison; JSON has every measure."""


@describe.register
def evaluation_report(evaluation: Evaluation) -> Report:
    """Describe the comparison of an adapter with baselines."""
    return Report(evaluation.adapter.name, "", (evaluation_section(evaluation), _settings(evaluation)))


@describe.register
def choice_report(choice: Choice) -> Report:
    """Describe the selection of a method."""
    section = evaluation_section(choice.evaluation, choice=choice)
    return Report(choice.method, "", (section, _settings(choice.evaluation)))


def evaluation_section(
    evaluation: Evaluation, explained: bool = True, choice: Choice | None = None, time: Array | None = None
) -> Section:
    """Describe the result of a comparison or of the selection, then compare all methods in a table."""
    rows, verdict = [evaluation.student_noise, *evaluation.rows], evaluation.verdict
    search, first = evaluation.settings.get(GAP_SEARCH, ""), evaluation.rows[0]
    columns = [column for column in COLUMNS if any(map(column.cell, rows))]
    measured = [row for row in rows if any(column.cell(row) for column in columns)]
    cells = tuple((row.name, *(column.cell(row) or "–" for column in columns)) for row in measured)
    caption = " ".join(sentence(f"{column.head}: {column.about}") for column in columns) if explained else ""
    values = {row.name: _values(row) for row in rows}
    largest = []
    if first.feasibility_gap is not None and time is not None:
        when = float(time[first.feasibility_gap.where])
        text = f"{first.feasibility_gap.largest:.3f} {at_time(when)}"
        largest = [Metric("Largest gap", text, key="largest_gap_at", value=when, unit="s")]
    others = [f"{row.name}: {text}" for row in evaluation.rows[1:] for text in (row.note, *row.warnings) if text]
    metrics = (
        *(verdict_facts(verdict) if choice is None else [_selection(choice), *_weaknesses(verdict)]),
        *numbers(verdict=verdict.as_dict()),
        *largest,
        *([Metric(GAP_SEARCH.capitalize(), search, key="gap_search", value=search)] if search else []),
        *warnings_of("evaluation", [f"{first.name}: {text}" for text in first.warnings]),
        *notes(others),
    )
    table = Table(("", *(column.head for column in columns)), cells, caption, "rows", values)
    return Section("Comparison with baselines", metrics, (table,), "evaluation")


def _settings(evaluation: Evaluation) -> Section:
    others = {name: value for name, value in evaluation.settings.items() if name != GAP_SEARCH}
    metrics = (
        Metric("Fit", evaluation.adapter.note),
        *(Metric(name.capitalize(), str(value)) for name, value in others.items()),
        *numbers(settings=evaluation.settings),
    )
    return Section("Settings", metrics)


def _values(row: Row) -> dict[str, Any]:
    """Return the measures of a row."""
    values = {key: value for key, value in asdict(row).items() if key != "name"}
    if row.smoothness is not None:
        values["smoothness"] |= {key: getattr(row.smoothness, key) for key in ("largest_ratio", "median_ratio")}
    return values


def verdict_facts(verdict: Verdict) -> list[Metric]:
    """Report a comparison, as a warning unless the method is better than the baselines, and weaknesses."""
    text, better = _comparison(verdict)
    improvable = verdict.value is not None and verdict.value != verdict.best_value
    advice = f" Take {verdict.recommended}." if verdict.recommended and improvable and not better else ""
    key, severity = ("", "note") if better else ("not-better", "warning")
    return [Metric("", text + advice, key=key, severity=severity), *_weaknesses(verdict)]


def _weaknesses(verdict: Verdict) -> list[Metric]:
    return [
        Metric("", _weakness(one, verdict.name), severity="warning" if one.code == "shuffled" else "note")
        for one in verdict.weaknesses
    ]


def _selection(choice: Choice) -> Metric:
    """Report the selected method, the reason, and its gap next to that of the best baseline."""
    verdict = choice.evaluation.verdict
    others = {row: value for row, value in verdict.values.items() if row != choice.method}
    nearest = min(others, key=lambda row: others[row], default="")
    against = f" ({label(nearest)}: {others[nearest]:.3f})" if nearest else ""
    why = f"the length field was rejected: {'; '.join(choice.failures)}" if choice.failures else "it passes its checks"
    text = f"{choice.method} was chosen, {why}. Mean feasibility gap {verdict.value or 0.0:.3f}{against}."
    value = {"method": choice.method, "failures": list(choice.failures)}
    return Metric("", text, key="choice", value=value, severity="note")


def label(name: str) -> str:
    """Write the name of a method in words."""
    return name.replace("-", " ")


def _comparison(verdict: Verdict) -> tuple[str, bool]:
    """Compare the method with the others; also whether it is worth while."""
    name, mine, nothing = verdict.name, verdict.value, verdict.identity
    if mine is None or nothing is None:
        return f"{name} is not compared: neither the truth nor the student's kinematics is known.", True
    measure = {"rmse": "RMSE", "feasibility_gap": "mean feasibility gap"}[verdict.measure]
    others = {row: value for row, value in verdict.values.items() if row != name and row not in verdict.same_as}
    if IDENTITY not in others:
        return f"{name} does what the identity baseline does ({measure} {mine:.3f}).", name == IDENTITY
    best = min(others, key=lambda other: others[other])
    against = f"{measure} {mine:.3f} against {nothing:.3f} of the identity baseline"
    against += "" if best == IDENTITY else f", {others[best]:.3f} of {label(best)}"
    if mine >= WORTH_WHILE * nothing:
        return f"{name} is not clearly better than doing nothing: {against}.", False
    if mine >= WORTH_WHILE * others[best]:
        return f"{name} is better than doing nothing, but not clearly better than {label(best)}: {against}.", False
    alternatives = " and than every cheap alternative" if len(others) > 1 else ""
    return f"{name} is better than doing nothing{alternatives}: {against}.", True


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
