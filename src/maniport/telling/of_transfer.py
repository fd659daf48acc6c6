"""Facts of the transfer: fitted adapters, and what the domains determine."""

from dataclasses import asdict
from typing import Any

import numpy as np

from maniport.telling.facts import Fact, Facts, Section, Table, listed, numbers, sentence, told
from maniport.transfer import DomainAdapter
from maniport.transfer.adapter import is_fitted
from maniport.transfer.identifiability import Identifiability, axis_name
from maniport.transfer.rotation_group import rotation_angle
from maniport.validation import Array

APART = ("mounting", "damping", "floor")
"""Parameters of adapters that have facts of their own."""


@told.register
def adapter_facts(adapter: DomainAdapter) -> Facts:
    """Tell what an adapter is and how its fit went."""
    return Facts(type(adapter).__name__, "", (adapter_section(adapter),))


def adapter_section(adapter: DomainAdapter, *more: Fact, mounted: bool = False) -> Section:
    """Tell how the fit of an adapter went; `more` facts stand after the method."""
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
        *([Fact("Where it was not fitted", adapter.report_.in_words(), key="report", value=asdict(adapter.report_))]
          if hasattr(adapter, "report_") else []),
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
    return "not given" if adapter.mounting_ is None else mounting_in_words(adapter.mounting_)


def mounting_in_words(mounting: Array) -> str:
    """Write a rotation from the teacher's base frame to the student's, shape (d, d)."""
    if np.allclose(mounting, np.eye(len(mounting))):
        return "the student faces where the teacher faces"
    return f"[{'; '.join(' '.join(f'{value:.3f}' for value in row) for row in mounting[:3, :3])}]"


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
    """Say what the domains tell of the rotation, as far as the fit looked."""
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
    return Fact("Resampled domains", text, key="rotation_spread", value=found.spread_deg, unit="°")


@told.register
def identifiability_facts(found: Identifiability) -> Facts:
    """Tell which directions of the rotation the domains determine, and where the searches ended."""
    axes = [axis_name(axis) for axis in found.axes] or [f"direction {k + 1}" for k in range(len(found.flat))]
    rows = tuple(
        (name, f"{curve:.2g} ± {error:.1g}", "not determined" if flat else "determined")
        for name, curve, error, flat in zip(axes, found.curvature, found.standard_error, found.flat, strict=True)
    )
    ends = [
        f"{_degrees(one.rotation, found.rotation)} from the fitted rotation: cost {one.cost:.4g}, domains "
        f"{one.cloud_distance:.3g} apart, starts {one.n_starts}"
        for one in found.optima
    ]
    facts = (
        Fact("In words", found.in_words(), key="identifiability", value=found.in_words()),
        _spread(found),
        Fact("Searches ended at", "\n".join(ends), key="optima", value=[asdict(one)["cost"] for one in found.optima]),
    )
    return Facts("", "", (Section("", facts, (Table(("a turn about", "curvature [1/rad²]", ""), rows),)),))


def _degrees(rotation: Array, other: Array | None = None) -> str:
    start = np.eye(len(rotation)) if other is None else other
    return f"{np.degrees(rotation_angle(start, rotation)):.1f}°"


def _rows(matrix: Any) -> list[list[float]] | None:
    return None if matrix is None else np.asarray(matrix).round(6).tolist()
