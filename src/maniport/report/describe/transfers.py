"""Reports of a fitted adapter, of what the domains determine, and of the comparison with baselines."""

from dataclasses import asdict, dataclass
from typing import Literal

import numpy as np

from maniport.evaluation.metrics import RELEVANT_RATIO, Evaluation, Row
from maniport.report.values import Report, Section, Severity, Table, listed, sentence
from maniport.transfer import DomainAdapter
from maniport.transfer.adapter import is_fitted
from maniport.transfer.identifiability import HalfTurns, describe_determined
from maniport.transfer.rotation_group import rotation_angle
from maniport.util.validation import Array


def adapter_section(adapter: DomainAdapter) -> Section:
    """Describe the fit of an adapter."""
    section = Section("Adapter", key="adapter", folded=True)
    parameters = []
    for name, value in adapter.get_params().items():
        if name != "base_rotation" and value is not None:
            parameters.append(f"{name} {value}")
    about = f"{listed(parameters)}." if parameters else ""
    section.add("Method", "method", type(adapter).__name__, about=about)
    if not is_fitted(adapter):
        section.add("State", "", None, "not fitted; call fit(teacher, student)")
        return section

    _add_identifiability(section, adapter)
    _add_rotations(section, adapter)

    converged = bool(adapter.converged_)
    iterations = int(adapter.n_iter_)
    costs = f"cost {adapter.history_[0]:.4f} → {adapter.cost_:.4f}"
    state = "converged" if converged else "not converged"
    text = f"{iterations} iterations, {costs}; {adapter.stop_reason_} ({state})"
    section.add("Fit", "iterations", iterations, text)
    pairs = getattr(adapter, "n_pairs_", None)
    if pairs is not None:
        share = float(getattr(adapter, "overlap_", 0.0))
        about = "Pairs of ellipsoids that carry the fit, and their share of the smaller domain."
        section.add("Pairs", "n_pairs", int(pairs), f"{pairs}, {share:.0%}", about)
    section.numbers(converged=converged, cost=float(adapter.cost_), damping=adapter.damping)
    if hasattr(adapter, "report_"):
        samples = adapter.report_
        section.add("Held-out samples", "report", asdict(samples), samples.in_words())
    return section


def _add_identifiability(section: Section, adapter: DomainAdapter) -> None:
    """Add whether the domains determine the rotation, where the method asks for it."""
    free_axes = getattr(adapter, "free_axes_", None)
    if free_axes is None:
        return
    turns = HalfTurns(np.empty((0, 3)), 0.0, np.empty(0))
    distances = getattr(adapter, "half_turn_distances_", None)
    if distances is not None:  # files of earlier versions have none
        axes = getattr(adapter, "half_turns_", turns.axes)
        turns = HalfTurns(axes, float(distances[0]), distances[1:])
    text = describe_determined(free_axes, turns)
    is_open = len(free_axes) > 0 or len(turns.axes) > 0
    severity: Severity = "warning" if is_open else "note"
    section.warn("identifiability", text, severity=severity, value=text)


def _add_rotations(section: Section, adapter: DomainAdapter) -> None:
    """Add the rotation between the base frames, and that of the adapter."""
    base_rotation = adapter.base_rotation_
    matrix = None
    if base_rotation is not None:
        matrix = np.asarray(base_rotation).round(6).tolist()
        text = _matrix_text(base_rotation[:3, :3])
    elif adapter.base_rotation is None:
        text = "unknown"
    else:
        text = "none: both base frames have the same orientation"
    about = "From the teacher's base frame to the student's."
    section.add("Base rotation", "base_rotation", matrix, text, about)

    map_rotation = adapter.map_rotation_
    angle = np.degrees(rotation_angle(np.eye(len(map_rotation)), map_rotation))
    rotation = np.asarray(adapter.rotation_).round(6).tolist()
    section.add("Rotation", "rotation", rotation, f"{angle:.1f}° with the base rotation")


def _matrix_text(matrix: Array) -> str:
    rows = []
    for row in matrix:
        numbers = [f"{value:.3f}" for value in row]
        rows.append(" ".join(numbers))
    return f"[{'; '.join(rows)}]"


def evaluation_report(evaluation: Evaluation) -> Report:
    """Describe the comparison of an adapter with baselines, or the selection of a method."""
    settings = Section("Settings")
    settings.add("Fit", "", None, evaluation.adapter.note)
    for name, value in evaluation.settings.items():
        settings.add(name.capitalize(), "", None, str(value))
    settings.numbers(settings=evaluation.settings)
    return Report(evaluation.adapter.name, "", (evaluation_section(evaluation), settings))


@dataclass(frozen=True)
class Column:
    """A column of the comparison: attributes of a measure of a row, and their meaning."""

    name: str
    measure: Literal["rmse", "domain_distance", "feasibility_gap", "preservation"]
    attributes: tuple[str, ...]  # empty where the measure is a number
    meaning: str

    def cell(self, row: Row) -> str:
        """Write the attributes of a row, or a dash where the measure does not apply."""
        measured = getattr(row, self.measure)
        if measured is None:
            return "–"
        if not self.attributes:
            return f"{measured:.4f}"
        numbers = [f"{getattr(measured, attribute):.3f}" for attribute in self.attributes]
        return " / ".join(numbers)


COLUMNS = (
    Column(
        name="RMSE",
        measure="rmse",
        attributes=("undivided", "per_dispersion"),
        meaning="distance to the truth: undivided / divided by the mean distance",
    ),
    Column(
        name="feasibility gap",
        measure="feasibility_gap",
        attributes=("mean", "p95", "largest"),
        meaning="distance from the targets to the feasible set, an upper bound: mean / 95 % / max",
    ),
    Column(
        name="domain distance",
        measure="domain_distance",
        attributes=(),
        meaning="energy distance of the mapped domain from the robot's",
    ),
    Column(
        name="rank correlation",
        measure="preservation",
        attributes=("rank_correlation",),
        meaning="of pairwise distances",
    ),
)
"""Columns of the comparison; JSON has all metrics."""


def evaluation_section(evaluation: Evaluation) -> Section:
    """Describe the result of a comparison or of the selection, then compare all methods in a table."""
    adapter = evaluation.adapter
    section = Section("Comparison with baselines", key="evaluation", folded=True)
    section.tables = (_comparison_table(evaluation),)
    _compare(section, evaluation)
    summary = {
        "measure": evaluation.measure,
        "values": evaluation.values,
        "recommended": evaluation.recommended,
        "weaknesses": adapter.weaknesses,
    }
    section.numbers(summary=summary)

    for weakness, value in adapter.weaknesses.items():
        severity: Severity = "note"
        text = f"{label(adapter.name)}: {weakness.replace('_', ' ')} {value:.3g}"
        if weakness == "rotated_axes":
            text += "°"
        if weakness == "rank_correlation":
            severity = "warning"
        section.warn(weakness.replace("_", "-"), text, severity=severity)
    for text in adapter.warnings:
        section.warn("evaluation", f"{adapter.name}: {text}")
    for row in evaluation.rows[1:]:
        for text in (row.note, *row.warnings):
            if text:
                section.note(f"{row.name}: {text}")
    return section


def _comparison_table(evaluation: Evaluation) -> Table:
    """Return the measures of all methods; JSON has all metrics of each."""
    columns = []
    for column in COLUMNS:
        if any(getattr(row, column.measure) is not None for row in evaluation.rows):
            columns.append(column)

    lines = []
    value = {}
    for row in evaluation.rows:
        cells = [column.cell(row) for column in columns]
        if set(cells) != {"–"}:
            lines.append((row.name, *cells))
        metrics = asdict(row)
        del metrics["name"]
        value[row.name] = metrics
    names = []
    meanings = []
    for column in columns:
        names.append(column.name)
        meanings.append(sentence(f"{column.name}: {column.meaning}"))
    return Table(("", *names), tuple(lines), " ".join(meanings), "rows", value)


def label(name: str) -> str:
    """Write the name of a method in words."""
    return name.replace("-", " ")


MEASURES = {"rmse": "RMSE", "feasibility_gap": "mean feasibility gap"}
"""Names of the measures of a comparison."""


def _compare(section: Section, evaluation: Evaluation) -> None:
    """Compare the method with the baselines, as a warning unless it is better; or report the selected method."""
    method = evaluation.adapter.name
    name = sentence(label(method)).removesuffix(".")
    values = dict(evaluation.values)
    is_compared = method in values and "identity" in values
    if not is_compared:
        section.note(f"{name} is not compared: neither the truth nor the robot is available")
        return

    achieved = values.pop(method)
    nearest = min(values, key=lambda baseline: values[baseline], default="")
    texts = [f"{MEASURES[evaluation.measure]} {achieved:.3f}"]
    as_good = []  # baselines
    for baseline in dict.fromkeys(("identity", nearest)):
        if baseline in values:
            texts.append(f"{label(baseline)} {values[baseline]:.3f}")
            if achieved >= RELEVANT_RATIO * values[baseline]:
                as_good.append(label(baseline))
    compared = "; ".join(texts)

    failures = evaluation.rejected
    if failures is not None:
        reason = "it passes its checks"
        if failures:
            reason = f"the length field was rejected: {'; '.join(failures)}"
        text = f"Selected {label(method)}: {reason}. {sentence(compared)}"
        choice = {"method": method, "failures": list(failures)}
        section.warn("choice", text, severity="note", value=choice)
    elif not as_good:
        section.note(f"{name} is better than all baselines: {compared}")
    elif method == "identity":
        section.note(f"{name}: {compared}")
    else:
        text = f"{name} is not clearly better than {' or '.join(as_good)}: {compared}"
        if evaluation.recommended not in ("", method):
            text += f". Use {evaluation.recommended}"
        section.warn("not-better", text)
