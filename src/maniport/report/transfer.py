"""Reports of a fitted adapter, of what the domains determine, and of the comparison with baselines."""

from dataclasses import asdict, replace

import numpy as np

from maniport.evaluation.metrics import IDENTITY, RELEVANT_RATIO, Evaluation, Row
from maniport.report.values import (
    Metric,
    Report,
    Section,
    Table,
    describe,
    info,
    listed,
    notes,
    numbers,
    sentence,
    warning,
)
from maniport.transfer import DomainAdapter
from maniport.transfer.adapter import is_fitted
from maniport.transfer.identifiability import describe_free_axes
from maniport.transfer.rotation_group import rotation_angle


@describe.register
def adapter_report(adapter: DomainAdapter) -> Report:
    """Describe an adapter and its fit."""
    return Report(type(adapter).__name__, "", (adapter_section(adapter),))


def adapter_section(adapter: DomainAdapter, *more: Metric) -> Section:
    """Describe the fit of an adapter."""
    # base_rotation and damping have metrics of their own
    parameters = [f"{name} {value}" for name, value in adapter.get_params(deep=False).items()
                  if name not in ("base_rotation", "damping") and value is not None]  # fmt: skip
    about = f"{listed(parameters)}." if parameters else ""
    method = info("Method", "method", type(adapter).__name__, description=about)
    if not is_fitted(adapter):
        return Section("Adapter", (method, Metric("State", "not fitted; call fit(teacher, student)")), key="adapter")
    teacher, student = float(adapter.teacher_dispersion_), float(adapter.student_dispersion_)
    ratio, start, end = float(adapter.dispersion_ratio_), float(adapter.history_[0]), float(adapter.cost_)
    rotation, turn = adapter.base_rotation_, adapter.map_rotation_
    rotated = "unknown" if adapter.base_rotation is None else "none: both base frames have the same orientation"
    if rotation is not None:
        rotated = f"[{'; '.join(' '.join(f'{value:.3f}' for value in row) for row in rotation[:3, :3])}]"
    regularized = "none"
    if adapter.damping is not None:
        added = f"adds {adapter.teacher_damping_:.3g} to the teacher, {adapter.student_damping_:.3g} to the student"
        regularized = f"damping {adapter.damping:g}: {added}"
    ended = f"{adapter.stop_reason_} ({'' if adapter.converged_ else 'not '}converged)"
    determined = []
    if (axes := getattr(adapter, "free_axes_", None)) is not None:
        text = describe_free_axes(axes)
        metric = warning("identifiability", text) if len(axes) else replace(notes([text])[0], key="identifiability")
        determined.append(replace(metric, value=text))
    metrics = (
        *determined,
        method,
        *more,
        info("Base rotation", "base_rotation", None if rotation is None else np.asarray(rotation).round(6).tolist(),
             rotated, "From the teacher's base frame to the student's."),
        info("Rotation", "rotation", np.asarray(adapter.rotation_).round(6).tolist(),
             f"{np.degrees(rotation_angle(np.eye(len(turn)), turn)):.1f}° with the base rotation"),
        info("Dispersion", "dispersion_ratio", ratio,
             f"teacher {teacher:.4g}, student {student:.4g}, ratio {ratio:.4g}",
             "Mean distance of the ellipsoids from their mean."),
        Metric("Regularization", regularized, "Distances need ellipsoids of full rank."),
        info("Fit", "iterations", int(adapter.n_iter_),
             f"{adapter.n_iter_} iterations, cost {start:.4f} → {end:.4f}; {ended}"),
        *([info("Held-out samples", "report", asdict(adapter.report_), adapter.report_.in_words())]
          if hasattr(adapter, "report_") else []),
        *numbers(damping=adapter.damping, converged=bool(adapter.converged_), cost=end),
    )  # fmt: skip
    return Section("Adapter", metrics, key="adapter")


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

WEAKNESSES = {
    "large_step": "largest successive distance {:.1f} times the teacher's",
    "plateau": "at least half of the successive distances are zero where the teacher moves",
    "rank_correlation": "rank correlation of distances {:.2f}",
    "rotated_axes": "longest axes rotated by {:.0f}° (median)",
}
"""Weaknesses of a method by code; a lost order of distances is a warning."""


@describe.register
def evaluation_report(evaluation: Evaluation) -> Report:
    """Describe the comparison of an adapter with baselines, or the selection of a method."""
    settings = (
        Metric("Fit", evaluation.adapter.note),
        *(Metric(name.capitalize(), str(value)) for name, value in evaluation.settings.items()),
        *numbers(settings=evaluation.settings),
    )
    return Report(evaluation.adapter.name, "", (evaluation_section(evaluation), Section("Settings", settings)))


def evaluation_section(evaluation: Evaluation, explained: bool = True) -> Section:
    """Describe the result of a comparison or of the selection, then compare all methods in a table."""
    rows = evaluation.rows

    def cell(row: Row, column: str) -> str:
        measure, attributes, form, _ = COLUMNS[column]
        measured = getattr(row, measure)
        values = [getattr(measured, name) for name in attributes] if measured is not None else [None]
        return "–" if None in values else form.format(*values)

    columns = [column for column in COLUMNS if any(cell(row, column) != "–" for row in rows)]
    cells = [(row.name, *(cell(row, column) for column in columns)) for row in rows]
    caption = " ".join(sentence(f"{column}: {COLUMNS[column][-1]}") for column in columns) if explained else ""
    values = {row.name: {key: value for key, value in asdict(row).items() if key != "name"} for row in rows}
    for row in rows:
        if row.smoothness is not None:
            ratios = {key: getattr(row.smoothness, key) for key in ("largest_ratio", "median_ratio")}
            values[row.name]["smoothness"] |= ratios
    name, weaknesses = label(rows[0].name), rows[0].weaknesses
    texts = {code: f"{name}: {WEAKNESSES[code].format(value)}" for code, value in weaknesses.items()}
    lost_order = texts.pop("rank_correlation", "")
    summary = {key: getattr(evaluation, key) for key in ("measure", "values", "best", "recommended")}
    summary["weaknesses"] = weaknesses
    metrics = [
        _comparison(evaluation) if evaluation.rejected is None else _selection(evaluation),
        *([warning("rank-correlation", lost_order)] if lost_order else []),
        *notes(texts.values()),
        *numbers(summary=summary),
        *(warning("evaluation", f"{rows[0].name}: {text}") for text in rows[0].warnings),
        *notes(f"{row.name}: {text}" for row in rows[1:] for text in (row.note, *row.warnings) if text),
    ]
    measured = tuple(row for row in cells if set(row[1:]) != {"–"})
    table = Table(("", *columns), measured, caption, "rows", values)
    return Section("Comparison with baselines", tuple(metrics), (table,), "evaluation")


def _selection(evaluation: Evaluation) -> Metric:
    """Report the selected method, the reason, and its gap next to that of the best baseline."""
    method, values, failures = evaluation.adapter.name, evaluation.values, evaluation.rejected
    others = {row: value for row, value in values.items() if row != method}
    nearest = min(others, key=lambda row: others[row], default="")
    against = f" ({label(nearest)}: {others[nearest]:.3f})" if nearest else ""
    reason = f"the length field was rejected: {'; '.join(failures)}" if failures else "it passes its checks"
    text = f"Selected {label(method)}: {reason}. Mean feasibility gap {values[method]:.3f}{against}."
    return replace(notes([text])[0], key="choice", value={"method": method, "failures": list(failures or ())})


def label(name: str) -> str:
    """Write the name of a method in words."""
    return name.replace("-", " ")


def _comparison(evaluation: Evaluation) -> Metric:
    """Compare the method with the baselines, as a warning unless it is better."""
    row, every = evaluation.adapter.name, evaluation.values
    name, own, identity = sentence(label(row))[:-1], every.get(row), every.get(IDENTITY)
    if own is None or identity is None:
        return notes([f"{name} is not compared: neither the truth nor the robot is available"])[0]
    measure = {"rmse": "RMSE", "feasibility_gap": "mean feasibility gap"}[evaluation.measure]
    others = {other: value for other, value in every.items() if not np.isclose(value, own, rtol=1e-9, atol=0.0)}
    best = min(others, key=lambda other: others[other], default="")
    values = {IDENTITY: identity, best: others[best]} if best else {}
    compared = f"{measure} {own:.3f}; {', '.join(f'{label(row)} {value:.3f}' for row, value in values.items())}."
    worse = [label(row) for row, value in values.items() if own >= RELEVANT_RATIO * value]
    if IDENTITY not in others:
        text, better = f"{name} equals the identity baseline ({measure} {own:.3f}).", row == IDENTITY
    elif worse:
        text, better = f"{name} is not clearly better than {' or '.join(worse)}: {compared}", False
    else:
        text, better = f"{name} is better than all baselines: {compared}", True
    if better:
        return notes([text])[0]
    recommended = evaluation.recommended
    advice = f" Use {recommended}." if recommended and row != evaluation.best else ""
    return warning("not-better", text + advice)
