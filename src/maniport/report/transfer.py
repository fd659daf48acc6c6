"""Metrics of a fitted adapter, of what the domains determine, and of the comparison with baselines."""

from dataclasses import asdict

import numpy as np

from maniport.evaluation.baselines import IDENTITY
from maniport.evaluation.comparison import GAP_SEARCH
from maniport.evaluation.selection import Choice
from maniport.evaluation.summary import RELEVANT_RATIO, Evaluation, Row, Summary
from maniport.report.metrics import describe, listed, notes, numbers, sentence, warnings_of
from maniport.report.values import NOTE, WARNING, Metric, Report, Section, Table
from maniport.transfer import DomainAdapter
from maniport.transfer.adapter import is_fitted
from maniport.transfer.identifiability import Identifiability
from maniport.transfer.rotation_group import rotation_angle
from maniport.util.validation import Array


@describe.register
def adapter_report(adapter: DomainAdapter) -> Report:
    """Describe an adapter and its fit."""
    return Report(type(adapter).__name__, "", (adapter_section(adapter),))


def adapter_section(adapter: DomainAdapter, *more: Metric, mounted: bool = False) -> Section:
    """Describe the fit of an adapter; `mounted`: the base rotation is known."""
    # base_rotation, damping and eigenvalue_floor have metrics of their own
    parameters = [f"{name} {value}" for name, value in adapter.get_params(deep=False).items()
                  if name not in ("base_rotation", "damping", "eigenvalue_floor") and value is not None]  # fmt: skip
    name = type(adapter).__name__
    method = Metric("Method", name, sentence(listed(parameters)) if parameters else "", "method", name)
    if not is_fitted(adapter):
        return Section("Adapter", (method, Metric("State", "not fitted; call fit(teacher, student)")), key="adapter")
    ratio, start, end = float(adapter.dispersion_ratio_), float(adapter.history_[0]), float(adapter.cost_)
    teacher, student = float(adapter.teacher_dispersion_), float(adapter.student_dispersion_)
    base_rotation = None if adapter.base_rotation_ is None else np.asarray(adapter.base_rotation_)
    ended = f"{adapter.stop_reason_} ({'' if adapter.converged_ else 'not '}converged)"
    metrics = (
        *_identifiability(adapter, mounted or base_rotation is not None),
        method,
        *more,
        Metric("Base rotation", "none" if base_rotation is None else rotation_text(base_rotation),
               "From the teacher's base frame to the student's.", "base_rotation",
               None if base_rotation is None else base_rotation.round(6).tolist()),
        Metric("Rotation", f"{_degrees(adapter.map_rotation_)} with the base rotation", "", "rotation",
               np.asarray(adapter.rotation_).round(6).tolist()),
        Metric("Dispersion", f"teacher {teacher:.4g}, student {student:.4g}, ratio {ratio:.4g}",
               "Root mean squared distance of the ellipsoids from their mean.", "dispersion_ratio", ratio),
        *_regularization(adapter),
        Metric("Fit", f"{adapter.n_iter_} iterations, cost {start:.4f} → {end:.4f}; {ended}", "", "iterations",
               int(adapter.n_iter_)),
        *([Metric("Held-out samples", adapter.report_.in_words(), key="report", value=asdict(adapter.report_))]
          if hasattr(adapter, "report_") else []),
        *numbers(dimension=len(adapter.rotation_), teacher_dispersion=teacher, student_dispersion=student,
                 converged=bool(adapter.converged_), stop_reason=adapter.stop_reason_, cost_start=start, cost=end),
    )  # fmt: skip
    return Section("Adapter", metrics, key="adapter")


def rotation_text(rotation: Array) -> str:
    """Write a rotation, shape (d, d)."""
    if np.allclose(rotation, np.eye(len(rotation))):
        return "none: both base frames have the same orientation"
    return f"[{'; '.join(' '.join(f'{value:.3f}' for value in row) for row in rotation[:3, :3])}]"


def _regularization(adapter: DomainAdapter) -> list[Metric]:
    teacher, student = float(adapter.teacher_damping_), float(adapter.student_damping_)
    floor, text = adapter.eigenvalue_floor, "none"
    if floor is not None:
        text = f"eigenvalues are raised to at least {floor:g}"
    if adapter.damping is not None:
        text = f"damping {adapter.damping:g}: adds {teacher:.3g} to the teacher, {student:.3g} to the student"
    return [
        Metric("Regularization", text, "Distances need ellipsoids of full rank."),
        *numbers(damping=adapter.damping, eigenvalue_floor=floor, teacher_damping=teacher, student_damping=student,
                 released_damping=float(adapter.released_damping_)),
    ]  # fmt: skip


def _identifiability(adapter: DomainAdapter, mounted: bool) -> list[Metric]:
    """Describe which part of the rotation the domains determine, as far as the fit examined it."""
    found = getattr(adapter, "identifiability_", None)
    if found is None:
        return []
    words, free = found.in_words(), not found.determined
    text = f"the base orientation is taken as known, since {words}" if mounted and free else words
    severity = WARNING if free else NOTE
    return [Metric("", sentence(text), key="identifiability", value=words, severity=severity)]


@describe.register
def identifiability_report(found: Identifiability) -> Report:
    """Describe which directions of the rotation the domains determine."""
    metric = Metric("Result", found.in_words(), key="identifiability", value=found.in_words())
    return Report("", "", (Section("", (metric,)),))


def _degrees(rotation: Array) -> str:
    return f"{np.degrees(rotation_angle(np.eye(len(rotation)), rotation)):.1f}°"


COLUMNS = {
    "RMSE": ("rmse", ("undivided", "per_dispersion"), "{:.3f} / {:.3f}",
             "distance to the truth: undivided / divided by the mean distance."),
    "feasibility gap": ("feasibility_gap", ("mean", "p95", "largest"), "{:.3f} / {:.3f} / {:.3f}",
                        "distance from the targets to the feasible set, an upper bound: mean / 95 % / max."),
    "held out": ("domain_feasibility_gap", ("mean", "p95"), "{:.3f} / {:.3f}",
                 "the same for further samples of the teacher: mean / 95 %."),
    "successive distance": ("smoothness", ("largest_ratio", "median_ratio"), "{:.2f} / {:.2f}",
                            "relative to the teacher's: largest / median."),
    "rank correlation": ("preservation", ("rank_correlation",), "{:.3f}", "of pairwise distances."),
}  # fmt: skip
"""Columns of the comparison by name: measure of a row, its attributes, their format and meaning; JSON has all."""


def _cell(row: Row, column: str) -> str:
    """Return the text of a column for a row; empty where it was not measured."""
    measure, attributes, form, _ = COLUMNS[column]
    measured = getattr(row, measure)
    values = [getattr(measured, name) for name in attributes] if measured is not None else [None]
    return "" if None in values else form.format(*values)


@describe.register
def evaluation_report(found: Evaluation | Choice) -> Report:
    """Describe the comparison of an adapter with baselines, or the selection of a method."""
    evaluation, choice = (found.evaluation, found) if isinstance(found, Choice) else (found, None)
    settings = (
        Metric("Fit", evaluation.adapter.note),
        *(Metric(name.capitalize(), str(value)) for name, value in evaluation.settings.items()),
        *numbers(settings=evaluation.settings),
    )
    title = evaluation.adapter.name if choice is None else choice.method
    return Report(title, "", (evaluation_section(evaluation, choice=choice), Section("Settings", settings)))


def evaluation_section(evaluation: Evaluation, explained: bool = True, choice: Choice | None = None) -> Section:
    """Describe the result of a comparison or of the selection, then compare all methods in a table."""
    rows, summary, first = evaluation.rows, evaluation.summary, evaluation.rows[0]
    columns = [column for column in COLUMNS if any(_cell(row, column) for row in rows)]
    cells = [(row.name, *(_cell(row, column) or "–" for column in columns)) for row in rows]
    caption = " ".join(sentence(f"{column}: {COLUMNS[column][-1]}") for column in columns) if explained else ""
    others = [f"{row.name}: {text}" for row in evaluation.rows[1:] for text in (row.note, *row.warnings) if text]
    metrics = [
        _comparison(summary) if choice is None else _selection(choice),
        *_weaknesses(summary),
        *numbers(summary=asdict(summary), gap_search=evaluation.settings.get(GAP_SEARCH, "")),
        *warnings_of("evaluation", [f"{first.name}: {text}" for text in first.warnings]),
        *notes(others),
    ]
    measured = tuple(row for row in cells if set(row[1:]) != {"–"})
    table = Table(("", *columns), measured, caption, "rows", {row.name: asdict(row) for row in rows})
    return Section("Comparison with baselines", tuple(metrics), (table,), "evaluation")


def _selection(choice: Choice) -> Metric:
    """Report the selected method, the reason, and its gap next to that of the best baseline."""
    summary = choice.evaluation.summary
    others = {row: value for row, value in summary.values.items() if row != choice.method}
    nearest = min(others, key=lambda row: others[row], default="")
    against = f" ({label(nearest)}: {others[nearest]:.3f})" if nearest else ""
    why = f"the length field was rejected: {'; '.join(choice.failures)}" if choice.failures else "it passes its checks"
    text = f"Selected {label(choice.method)}: {why}. Mean feasibility gap {summary.value or 0.0:.3f}{against}."
    value = {"method": choice.method, "failures": list(choice.failures)}
    return Metric("", text, key="choice", value=value, severity=NOTE)


def label(name: str) -> str:
    """Write the name of a method in words."""
    return name.replace("-", " ")


def _comparison(summary: Summary) -> Metric:
    """Compare the method with the baselines, as a warning unless it is better."""
    name, own, identity = sentence(label(summary.name))[:-1], summary.value, summary.identity
    if own is None or identity is None:
        text = f"{name} is not compared: neither the truth nor the robot is available."
        return Metric("", text, severity=NOTE)
    measure = {"rmse": "RMSE", "feasibility_gap": "mean feasibility gap"}[summary.measure]
    others = {row: value for row, value in summary.values.items() if row not in (summary.name, *summary.same_as)}
    best = min(others, key=lambda other: others[other], default="")
    values = {IDENTITY: identity, best: others[best]} if best else {}
    compared = f"{measure} {own:.3f}; {', '.join(f'{label(row)} {value:.3f}' for row, value in values.items())}."
    worse = [label(row) for row, value in values.items() if own >= RELEVANT_RATIO * value]
    if IDENTITY not in others:
        text, better = f"{name} equals the identity baseline ({measure} {own:.3f}).", summary.name == IDENTITY
    elif worse:
        text, better = f"{name} is not clearly better than {' or '.join(worse)}: {compared}", False
    else:
        text, better = f"{name} is better than all baselines: {compared}", True
    if better:
        return Metric("", text, severity=NOTE)
    advice = f" Take {summary.recommended}." if summary.recommended and own != summary.best_value else ""
    return Metric("", text + advice, key="not-better", severity=WARNING)


def _weaknesses(summary: Summary) -> list[Metric]:
    """Report weaknesses of the method; a lost order of distances is a warning."""
    texts = {
        "large_step": "largest successive distance {:.1f} times the teacher's",
        "plateau": "at least half of the successive distances are zero where the teacher moves",
        "rank_correlation": "rank correlation of distances {:.2f}",
        "rotated_axes": "longest axes rotated by {:.0f}° (median)",
        "identity_test": "changes the student's own ellipsoids by {:.3f}",
    }
    return [
        Metric("", f"{sentence(label(summary.name))[:-1]}: {texts[one.code].format(one.value)}.",
               severity=WARNING if one.code == "rank_correlation" else NOTE)
        for one in summary.weaknesses
    ]  # fmt: skip
