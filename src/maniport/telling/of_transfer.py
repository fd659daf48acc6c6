"""Facts of the transfer: fitted adapters, what the clouds determine, and whether it is better than doing less."""

from dataclasses import asdict
from typing import Any, NamedTuple

import numpy as np

from maniport.evaluation.report import GAP_SEARCH, Evaluation
from maniport.evaluation.verdict import RAW_COPY, RECENTRING, TRANSPORT, WORTH_WHILE, Row, Verdict, Weakness
from maniport.telling.facts import Fact, Facts, Section, Table, listed, notes, numbers, sentence, told, warning
from maniport.transfer import DomainAdapter
from maniport.transfer.adapter import is_fitted
from maniport.transfer.identifiability import Identifiability, axis_name
from maniport.transfer.rotation_group import rotation_angle
from maniport.validation import Array

APART = ("mounting", "damping", "floor")
"""Parameters of adapters that have facts of their own."""

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


_SPREAD = ("mean", "median", "p95"), "{:.3f} / {:.3f} / {:.3f}"
_ERRORS = ("undivided", "per_dispersion", "per_squared_dispersion"), "{:.3f} / {:.3f} / {:.3f}"

COLUMNS = (
    Column("RMSE", "rmse", *_ERRORS,
           "distance to the truth: undivided / by the mean distance / by the mean squared distance."),
    Column("feasibility gap", "feasibility_gap", *_SPREAD,
           "from the profile to what the student can make in its limits, an upper bound: mean / median / 95 %."),
    Column("feasibility gap, domain", "domain_feasibility_gap", *_SPREAD,
           "the same of samples of the teacher's domain."),
    Column("step", "smoothness", ("largest_ratio", "median_ratio"), "{:.2f} / {:.2f}",
           "largest / median step of the profile over the teacher's own; 1 keeps it."),
    Column("structure", "structure", ("spearman", "distortion"), "{:.3f} / {:.3f}",
           "pairwise distances: rank correlation (1 is best) / distortion (0 is best)."),
    Column("turn of axes", "structure", ("major_turn", "minor_turn"), "{:.1f}° / {:.1f}°",
           "median angle to the teacher's longest / shortest axes."),
    Column("energy distance", "energy_distance", (), "{:.3f}",
           "from the mapped domain of the teacher to the student's."),
    Column("identity test", "identity", (), "{:.3f}",
           "student → student, where nothing should change; 0 is best."),
    Column("stability", "stability", ("rotation_rms", "map_spread"), "{:.2f}° / {:.3f}",
           "over independent draws: spread of the rotation (rms) / of the mapped profile (rms)."),
)  # fmt: skip
"""The measures in the order of the table."""


@told.register
def adapter_facts(adapter: DomainAdapter) -> Facts:
    """Tell what an adapter is and how its fit went."""
    return Facts(type(adapter).__name__, "", (adapter_section(adapter),))


def adapter_section(adapter: DomainAdapter, *more: Fact, mounted: bool = False) -> Section:
    """Tell how the fit of an adapter went; `more` facts stand after the method, `mounted` where the mounting is known.

    Without a mounting of its own the adapter takes the axes of both bases for the same.
    """
    method = Fact("Method", type(adapter).__name__, _parameters(adapter), "method", type(adapter).__name__)
    if not is_fitted(adapter):
        state = Fact("State", "not fitted yet; call fit(teacher, student)")
        return Section("The adapter", (method, state), key="adapter")
    d = len(adapter.rotation_)
    ratio, start, end = adapter.dispersion_ratio_, float(adapter.history_[0]), float(adapter.cost_)
    ended = "converged" if adapter.converged_ else "not converged"
    facts = (
        *_knowledge(adapter, mounted or adapter.mounting_ is not None),
        method,
        *more,
        Fact("Mounting", _mounting(adapter), "Rotation from the teacher's base frame to the student's.",
             "mounting", _rows(adapter.mounting_)),
        Fact("Size", f"{d} × {d}", key="dimension", value=d),
        Fact("Rotation", f"R turns recentred ellipsoids by {_degrees(adapter.rotation_)}; the map turns by "
             f"{_degrees(adapter.turn_)}, the mounting included",
             key="rotation", value=_rows(adapter.rotation_)),
        Fact("Dispersion", f"teacher {adapter.teacher_dispersion_:.4g}, student {adapter.student_dispersion_:.4g}, "
             f"ratio s = {ratio:.4g}",
             "How widely each body's ellipsoids scatter about their mean; a method that scales stretches by the ratio.",
             "dispersion_ratio", float(ratio)),
        *_regularization(adapter),
        Fact("Fit", f"{adapter.n_iter_} iterations, cost {start:.4f} → {end:.4f}, {ended}",
             key="iterations", value=int(adapter.n_iter_)),
        Fact("Ended because", adapter.stop_reason_, key="stop_reason", value=adapter.stop_reason_),
        *numbers(teacher_dispersion=float(adapter.teacher_dispersion_), converged=bool(adapter.converged_),
                 student_dispersion=float(adapter.student_dispersion_), cost_start=start, cost=end),
    )  # fmt: skip
    return Section("The adapter", facts, key="adapter")


def _parameters(adapter: DomainAdapter) -> str:
    """What the adapter was told, but for what has facts of its own."""
    parameters = adapter.get_params(deep=False).items()
    told_it = [f"{name} {value}" for name, value in parameters if name not in APART and value is not None]
    return sentence(listed(told_it)) if told_it else ""


def _mounting(adapter: DomainAdapter) -> str:
    if adapter.mounting_ is None:
        return "not given"
    if np.allclose(adapter.mounting_, np.eye(len(adapter.mounting_))):
        return "the student faces where the teacher faces"
    return f"[{'; '.join(' '.join(f'{value:.3f}' for value in row) for row in adapter.mounting_[:3, :3])}]"


def _regularization(adapter: DomainAdapter) -> list[Fact]:
    teacher, student = float(adapter.teacher_damping_), float(adapter.student_damping_)
    released = float(adapter.released_damping_)
    text = "none" if adapter.floor is None else f"eigenvalues below {adapter.floor:g} are lifted to it"
    if adapter.damping is not None:
        text = (
            f"damping {adapter.damping:g}: {teacher:.3g} for the teacher, {student:.3g} for the student, of which "
            f"{released:.3g} is taken off results"
        )
    return [
        Fact("Singular ellipsoids", text, "A stretched arm loses a direction; distances need all of them."),
        *numbers(damping=adapter.damping, floor=adapter.floor, teacher_damping=teacher, student_damping=student,
                 released_damping=released),
    ]  # fmt: skip


def _knowledge(adapter: DomainAdapter, mounted: bool) -> list[Fact]:
    """Say what the clouds tell of the rotation, as far as the fit looked."""
    found = getattr(adapter, "identifiability_", None)
    if found is None:
        return []
    words = found.in_words()
    free = not found.determined
    said = f"the mounting is taken as known, since {words}" if mounted and free else words
    first = Fact("", sentence(said), key="identifiability", value=words, severity="warning" if free else "note")
    return [first, _spread(found)]


def _spread(found: Identifiability) -> Fact:
    text = f"spread the rotation by {found.spread_deg:.2g}°" if len(found.resampled) else ""
    return Fact("Resampled clouds", text, key="rotation_spread", value=found.spread_deg, unit="°")


@told.register
def identifiability_facts(found: Identifiability) -> Facts:
    """Tell which directions of the rotation the clouds determine, and where the searches ended."""
    axes = [axis_name(axis) for axis in found.axes] or [f"direction {k + 1}" for k in range(len(found.flat))]
    rows = tuple(
        (name, f"{curve:.2g} ± {error:.1g}", "not determined" if flat else "determined")
        for name, curve, error, flat in zip(axes, found.curvature, found.standard_error, found.flat, strict=True)
    )
    ends = [
        f"{_degrees(one.rotation, found.rotation)} from the fitted rotation: cost {one.cost:.4g}, clouds "
        f"{one.cloud_distance:.3g} apart, starts {one.n_starts}"
        for one in found.optima
    ]
    facts = (
        Fact("In words", found.in_words(), key="identifiability", value=found.in_words()),
        _spread(found),
        Fact("Searches ended at", "\n".join(ends), key="optima", value=[asdict(one)["cost"] for one in found.optima]),
    )
    return Facts("", "", (Section("", facts, (Table(("a turn about", "curvature [1/rad²]", ""), rows),)),))


@told.register
def evaluation_facts(evaluation: Evaluation) -> Facts:
    """Tell whether an adapter is better than the cheap alternatives."""
    return Facts(evaluation.adapter.name, "", (evaluation_section(evaluation), _settings(evaluation)))


def evaluation_section(evaluation: Evaluation, explained: bool = True) -> Section:
    """Say the verdict, then show every measure that any row has, `explained` or not."""
    rows, verdict = [evaluation.student_noise, *evaluation.rows], evaluation.verdict
    search = evaluation.settings.get(GAP_SEARCH, "")
    columns = [column for column in COLUMNS if any(map(column.cell, rows))]
    cells = tuple((row.name, *(column.cell(row) or "–" for column in columns)) for row in rows)
    caption = " ".join(sentence(f"{one.head}: {one.about}") for one in columns) if explained else ""
    values = {row.name: _numbers(row) for row in rows}
    return Section(
        "Is it better than doing less?",
        (
            *verdict_facts(verdict),
            *numbers(verdict=verdict.as_dict()),
            *([Fact(GAP_SEARCH.capitalize(), search, key="gap_search", value=search)] if search else []),
            *(warning(f"{row.name}: {text}") for row in evaluation.rows[:1] for text in row.warnings),
            *notes(f"{row.name}: {text}" for row in evaluation.rows[1:] for text in (row.note, *row.warnings) if text),
        ),
        (Table(("", *(column.head for column in columns)), cells, caption, "rows", values),),
        "evaluation",
    )


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
    first = Fact("", said + advice, severity="note" if worth_while else "warning")
    return [first, *(Fact("", _weakness(one, verdict.name), severity="note") for one in verdict.weaknesses)]


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
        "restless": f"{name} changes the student's own ellipsoids by {one.value:.3f} where nothing should "
        f"change{beside}.",
        "unsteady": f"The rotation of {name} is off by {one.value:.0f}° (root mean square) between draws of the same "
        "domains: the clouds do not determine it.",
    }[one.code]


def _degrees(rotation: Array, other: Array | None = None) -> str:
    start = np.eye(len(rotation)) if other is None else other
    return f"{np.degrees(rotation_angle(start, rotation)):.1f}°"


def _rows(matrix: Any) -> list[list[float]] | None:
    return None if matrix is None else np.asarray(matrix).round(6).tolist()
