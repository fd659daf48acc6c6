"""Reports of a fitted adapter, of what the domains determine, and of the comparison with baselines."""

from dataclasses import asdict

import numpy as np

from maniport.evaluation.metrics import RELEVANT_RATIO, Evaluation, Row
from maniport.report.values import Report, Section, Table, listed, sentence
from maniport.transfer import DomainAdapter
from maniport.transfer.adapter import is_fitted
from maniport.transfer.identifiability import describe_free_axes
from maniport.transfer.rotation_group import rotation_angle


def adapter_section(adapter: DomainAdapter) -> Section:
    """Describe the fit of an adapter."""
    section = Section("Adapter", key="adapter", folded=True)
    parameters = listed(f"{name} {value}" for name, value in adapter.get_params().items()
                        if name != "base_rotation" and value is not None)  # fmt: skip
    section.add(
        "Method", "method", type(adapter).__name__, about=f"{parameters}." if parameters else ""
    )
    if not is_fitted(adapter):
        section.add("State", "", None, "not fitted; call fit(teacher, student)")
        return section
    if (axes := getattr(adapter, "free_axes_", None)) is not None:
        text = describe_free_axes(axes)
        section.warn(
            "identifiability", text, severity="warning" if len(axes) else "note", value=text
        )
    rotation, turn = adapter.base_rotation_, adapter.map_rotation_
    matrix = None if rotation is None else np.asarray(rotation).round(6).tolist()
    text = (
        "unknown"
        if adapter.base_rotation is None
        else "none: both base frames have the same orientation"
    )
    if rotation is not None:
        text = (
            f"[{'; '.join(' '.join(f'{value:.3f}' for value in row) for row in rotation[:3, :3])}]"
        )
    section.add(
        "Base rotation",
        "base_rotation",
        matrix,
        text,
        "From the teacher's base frame to the student's.",
    )
    text = f"{np.degrees(rotation_angle(np.eye(len(turn)), turn)):.1f}° with the base rotation"
    section.add("Rotation", "rotation", np.asarray(adapter.rotation_).round(6).tolist(), text)
    text = f"{adapter.n_iter_} iterations, cost {adapter.history_[0]:.4f} → {adapter.cost_:.4f}; {adapter.stop_reason_}"
    converged = bool(adapter.converged_)
    section.add(
        "Fit",
        "iterations",
        int(adapter.n_iter_),
        f"{text} ({'' if converged else 'not '}converged)",
    )
    section.numbers(converged=converged, cost=float(adapter.cost_), damping=adapter.damping)
    if hasattr(adapter, "report_"):
        section.add(
            "Held-out samples", "report", asdict(adapter.report_), adapter.report_.in_words()
        )
    return section


def evaluation_report(evaluation: Evaluation) -> Report:
    """Describe the comparison of an adapter with baselines, or the selection of a method."""
    settings = Section("Settings")
    settings.add("Fit", "", None, evaluation.adapter.note)
    for name, value in evaluation.settings.items():
        settings.add(name.capitalize(), "", None, str(value))
    settings.numbers(settings=evaluation.settings)
    return Report(evaluation.adapter.name, "", (evaluation_section(evaluation), settings))


COLUMNS = {
    "RMSE": ("rmse", ("undivided", "per_dispersion"),
             "distance to the truth: undivided / divided by the mean distance"),
    "feasibility gap": ("feasibility_gap", ("mean", "p95", "largest"),
                        "distance from the targets to the feasible set, an upper bound: mean / 95 % / max"),
    "rank correlation": ("preservation", ("rank_correlation",), "of pairwise distances"),
}  # fmt: skip
"""Columns of the comparison by name: measure of a row, its attributes and their meaning; JSON has all."""


def evaluation_section(evaluation: Evaluation) -> Section:
    """Describe the result of a comparison or of the selection, then compare all methods in a table."""
    rows, adapter = evaluation.rows, evaluation.adapter
    columns = [
        name
        for name, (measure, *_) in COLUMNS.items()
        if any(getattr(row, measure) for row in rows)
    ]

    def cell(row: Row, column: str) -> str:
        measure, names, _ = COLUMNS[column]
        measured = getattr(row, measure)
        return " / ".join(f"{getattr(measured, name):.3f}" for name in names) if measured else "–"

    cells = [(row.name, *(cell(row, column) for column in columns)) for row in rows]
    caption = " ".join(sentence(f"{column}: {COLUMNS[column][2]}") for column in columns)
    values = {
        row.name: {key: value for key, value in asdict(row).items() if key != "name"}
        for row in rows
    }
    measured = tuple(line for line in cells if set(line[1:]) != {"–"})
    table = Table(("", *columns), measured, caption, "rows", values)
    section = Section("Comparison with baselines", (), (table,), "evaluation", folded=True)
    _compare(section, evaluation)
    summary = {key: getattr(evaluation, key) for key in ("measure", "values", "recommended")}
    section.numbers(summary=summary | {"weaknesses": adapter.weaknesses})
    for code, value in adapter.weaknesses.items():
        text = f"{label(adapter.name)}: {code.replace('_', ' ')} {value:.3g}{'°' * (code == 'rotated_axes')}"
        section.warn(
            code.replace("_", "-"),
            text,
            severity="warning" if code == "rank_correlation" else "note",
        )
    section.warn("evaluation", *(f"{adapter.name}: {text}" for text in adapter.warnings))
    section.note(
        *(f"{row.name}: {text}" for row in rows[1:] for text in (row.note, *row.warnings) if text)
    )
    return section


def label(name: str) -> str:
    """Write the name of a method in words."""
    return name.replace("-", " ")


def _compare(section: Section, evaluation: Evaluation) -> None:
    """Compare the method with the baselines, as a warning unless it is better; or report the selected method."""
    method, values = evaluation.adapter.name, dict(evaluation.values)
    name, own = sentence(label(method))[:-1], values.pop(method, None)
    nearest = min(values, key=lambda row: values[row], default="")
    others = {row: values[row] for row in dict.fromkeys(("identity", nearest)) if row in values}
    if own is None or "identity" not in {method, *values}:
        section.note(f"{name} is not compared: neither the truth nor the robot is available")
        return
    measure = {"rmse": "RMSE", "feasibility_gap": "mean feasibility gap"}[evaluation.measure]
    compared = "; ".join(
        [f"{measure} {own:.3f}", *(f"{label(row)} {value:.3f}" for row, value in others.items())]
    )
    worse = [label(row) for row, value in others.items() if own >= RELEVANT_RATIO * value]
    if (failures := evaluation.rejected) is not None:
        reason = (
            f"the length field was rejected: {'; '.join(failures)}"
            if failures
            else "it passes its checks"
        )
        value = {"method": method, "failures": list(failures)}
        text = f"Selected {label(method)}: {reason}. {sentence(compared)}"
        section.warn("choice", text, severity="note", value=value)
    elif not worse or method == "identity":
        section.note(f"{name}{' is better than all baselines' * (not worse)}: {compared}")
    else:
        recommended = evaluation.recommended
        advice = f". Use {recommended}" if recommended not in ("", method) else ""
        section.warn(
            "not-better",
            f"{name} is not clearly better than {' or '.join(worse)}: {compared}{advice}",
        )
