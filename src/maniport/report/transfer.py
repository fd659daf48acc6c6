"""Metrics of a fitted adapter, of what the domains determine, and of the comparison with baselines."""

from dataclasses import asdict
from typing import Any, NamedTuple

import numpy as np

from maniport.evaluation.baselines import IDENTITY
from maniport.evaluation.comparison import GAP_SEARCH
from maniport.evaluation.selection import Choice
from maniport.evaluation.summary import RELEVANT_RATIO, Evaluation, Row, Summary
from maniport.report.metrics import describe, listed, notes, numbers, sentence, warnings_of
from maniport.report.values import NOTE, WARNING, Metric, Report, Section, Table, at_time
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
        Metric("Rotation", f"{_degrees(adapter.rotation_)} between centered domains; "
               f"{_degrees(adapter.map_rotation_)} with the base rotation", "", "rotation",
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
    """Describe which directions of the rotation the domains determine, and the local optima."""
    axes = [axis_name(axis) for axis in found.axes] or [f"direction {k + 1}" for k in range(len(found.flat))]
    rows = tuple(
        (name, f"{curve:.2g} ± {error:.1g}", "not determined" if flat else "determined")
        for name, curve, error, flat in zip(axes, found.curvature, found.standard_error, found.flat, strict=True)
    )
    metrics = (Metric("Result", found.in_words(), key="identifiability", value=found.in_words()),)
    return Report("", "", (Section("", metrics, (Table(("rotation about", "curvature [1/rad²]", ""), rows),)),))


def _degrees(rotation: Array) -> str:
    return f"{np.degrees(rotation_angle(np.eye(len(rotation)), rotation)):.1f}°"


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
    Column("successive distance", "smoothness", ("largest_ratio", "median_ratio"), "{:.2f} / {:.2f}",
           "relative to the teacher's: largest / median."),
    Column("rank correlation", "preservation", ("rank_correlation",), "{:.3f}", "of pairwise distances."),
    Column("axis rotation", "preservation", ("major_axis_angle",), "{:.1f}°", "median, of longest axes."),
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
    rows, summary, first = evaluation.rows, evaluation.summary, evaluation.rows[0]
    columns = [column for column in COLUMNS if any(map(column.cell, rows))]
    cells = [(row.name, *(column.cell(row) or "–" for column in columns)) for row in rows]
    caption = " ".join(sentence(f"{column.head}: {column.about}") for column in columns) if explained else ""
    others = [f"{row.name}: {text}" for row in evaluation.rows[1:] for text in (row.note, *row.warnings) if text]
    metrics = [
        *(comparison_metrics(summary) if choice is None else [_selection(choice), *_weaknesses(summary)]),
        *numbers(summary=summary.as_dict(), gap_search=evaluation.settings.get(GAP_SEARCH, "")),
        *warnings_of("evaluation", [f"{first.name}: {text}" for text in first.warnings]),
        *notes(others),
    ]
    if first.feasibility_gap is not None and time is not None:
        when = float(time[first.feasibility_gap.where])
        text = f"{first.feasibility_gap.largest:.3f} {at_time(when)}"
        metrics.append(Metric("Largest gap", text, key="largest_gap_at", value=when, unit="s"))
    measured = tuple(row for row in cells if set(row[1:]) != {"–"})
    table = Table(("", *(column.head for column in columns)), measured, caption, "rows",
                  {row.name: _values(row) for row in rows})  # fmt: skip
    return Section("Comparison with baselines", tuple(metrics), (table,), "evaluation")


def _settings(evaluation: Evaluation) -> Section:
    metrics = (
        Metric("Fit", evaluation.adapter.note),
        *(Metric(name.capitalize(), str(value)) for name, value in evaluation.settings.items()),
        *numbers(settings=evaluation.settings),
    )
    return Section("Settings", metrics)


def _values(row: Row) -> dict[str, Any]:
    """Return the measures of a row."""
    values = {key: value for key, value in asdict(row).items() if key != "name"}
    if row.smoothness is not None:
        values["smoothness"] |= {key: getattr(row.smoothness, key) for key in ("largest_ratio", "median_ratio")}
    return values


def comparison_metrics(summary: Summary) -> list[Metric]:
    """Report a comparison, as a warning unless the method is better than the baselines, and weaknesses."""
    text, better = _comparison(summary)
    improvable = summary.value is not None and summary.value != summary.best_value
    advice = f" Take {summary.recommended}." if summary.recommended and improvable and not better else ""
    key, severity = ("", NOTE) if better else ("not-better", WARNING)
    return [Metric("", text + advice, key=key, severity=severity), *_weaknesses(summary)]


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


def _comparison(summary: Summary) -> tuple[str, bool]:
    """Compare the method with the baselines; also return whether it is better."""
    name, own, identity = sentence(label(summary.name))[:-1], summary.value, summary.identity
    if own is None or identity is None:
        return f"{name} is not compared: neither the truth nor the robot is available.", True
    measure = {"rmse": "RMSE", "feasibility_gap": "mean feasibility gap"}[summary.measure]
    others = {row: value for row, value in summary.values.items() if row not in (summary.name, *summary.same_as)}
    best = min(others, key=lambda other: others[other], default="")
    if IDENTITY not in others:
        return f"{name} equals the identity baseline ({measure} {own:.3f}).", summary.name == IDENTITY
    values = {IDENTITY: identity, best: others[best]}
    text = f"{measure} {own:.3f}; {', '.join(f'{label(row)} {value:.3f}' for row, value in values.items())}."
    worse = [label(row) for row, value in values.items() if own >= RELEVANT_RATIO * value]
    if worse:
        return f"{name} is not clearly better than {' or '.join(worse)}: {text}", False
    return f"{name} is better than all baselines: {text}", True


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
