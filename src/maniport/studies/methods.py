"""Comparison of all transfer methods on six motions of a human arm, for the Panda."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from maniport.errors import NotInvertibleError
from maniport.evaluation import Evaluation, Row
from maniport.evaluation.baselines import TRANSPORT
from maniport.report.metrics import describe
from maniport.report.transfer import evaluation_section
from maniport.report.values import Report, Section, Table
from maniport.spd.kernels import compose, eigh
from maniport.spd.matrix_functions import apply, congruence, from_vector, logarithm, roots, to_vector
from maniport.studies.human_to_panda import study
from maniport.transfer import METHODS
from maniport.transfer.length_field.field import KAPPA, released
from maniport.transfer.rigid_adapter import RigidAdapter
from maniport.util.notebook import NotebookDisplay
from maniport.util.optional import optimal_transport
from maniport.util.progress import Progress
from maniport.util.validation import Array

CAPTION = (
    "Feasibility gap: mean over the motions / worst of the motions' 95 %. Held out: the same at samples of the persons "
    "that no fit has seen. Step: mean over the motions of the median step over the teacher's own; 1 keeps it. "
    "Rank correlation: least, of pairwise distances. Turn: largest median angle of the longest axes. "
    "Identity test: from one draw of the Panda's domain to another, where nothing should change."
)


@dataclass(frozen=True, repr=False)
class Comparison(NotebookDisplay):
    """Evaluations of the same rows, by motion."""

    evaluations: Mapping[str, Evaluation]

    def __repr__(self) -> str:
        return f"Comparison({', '.join(self.evaluations)})"


def compare_methods(
    rows: Sequence[str], random_state: int = 0, progress: Progress | None = None, names: Sequence[str] | None = None
) -> Comparison:
    """Measure methods on the motions; if every row is requested, transports of whole clouds come last."""
    further = {"gaussian-transport": GaussianTransport} if set(rows) >= set(METHODS) else None
    found = study((TRANSPORT,), names, random_state, progress=progress, further=further, rows=rows)
    return Comparison({motion: evaluation for (motion, _), (_, evaluation) in found.items()})


@describe.register
def comparison_report(comparison: Comparison) -> Report:
    """Describe all methods, in a summary and by motion."""
    tables = (
        replace(evaluation_section(evaluation, explained=not index), title=motion, key=motion, metrics=())
        for index, (motion, evaluation) in enumerate(comparison.evaluations.items())
    )
    return Report("Comparison of methods", "", (replace(in_short(comparison), title="Summary"), *tables))


def in_short(comparison: Comparison) -> Section:
    """One line for each method, over all motions."""
    every = list(comparison.evaluations.values())
    found = {row.name: [one.row(row.name) for one in every] for row in every[0].rows if row.feasibility_gap is not None}
    columns = ("", "feasibility gap", "held out", "step", "rank correlation", "turn", "identity test")
    values = {name: _summary(rows) for name, rows in found.items()}
    cells = tuple((name, *_cells(one)) for name, one in values.items())
    return Section("Metrics", (), (Table(columns, cells, CAPTION, "rows", values),), "methods")


def _summary(rows: Sequence[Row]) -> dict[str, float]:
    gaps, held = ([getattr(row, name) for row in rows] for name in ("feasibility_gap", "domain_feasibility_gap"))
    kept, steps = [row.preservation for row in rows], [row.smoothness for row in rows]
    return {
        "gap": float(np.mean([one.mean for one in gaps])),
        "gap_p95": max(one.p95 for one in gaps),
        "held_out": float(np.mean([one.mean for one in held])),
        "held_out_p95": max(one.p95 for one in held),
        "step": float(np.mean([one.median_ratio for one in steps if one is not None])),
        "rank_correlation": min(one.rank_correlation for one in kept if one is not None),
        "turn_deg": max(one.major_axis_angle or 0.0 for one in kept if one is not None),
        "identity": float(np.mean([row.identity for row in rows if row.identity is not None])),
    }


def _cells(one: Mapping[str, float]) -> tuple[str, ...]:
    pairs = (f"{one[name]:.3f} / {one[f'{name}_p95']:.3f}" for name in ("gap", "held_out"))
    return (
        *pairs,
        f"{one['step']:.2f}",
        f"{one['rank_correlation']:.3f}",
        f"{one['turn_deg']:.1f}°",
        f"{one['identity']:.3f}",
    )


class GaussianTransport(RigidAdapter):
    """The linear transport between Gaussians with the means and covariances of two clouds of log-vectors."""

    scale, dispersion = True, "mean"

    def _fit_rotation(self, teacher: Array, student: Array) -> None:
        clouds = self._rigid_map().apply(teacher), student
        start, goal = (log_vectors(cloud, self.student_mean_) for cloud in clouds)
        self._solver = optimal_transport().da.LinearTransport().fit(Xs=start, Xt=goal)
        self._set_closed_form("closed form")

    def _settle(self) -> None:
        self.released_damping_ = (1.0 - np.sqrt(KAPPA)) * self.student_damping_  # off an eigenvalue of ε

    def _map(self, points: Array) -> tuple[Array, float]:
        moved = self._solver.transform(Xs=log_vectors(self._rigid_map().apply(points), self.student_mean_))
        return congruence(roots(self.student_mean_)[0], apply(from_vector(moved), np.exp)), self.released_damping_

    def _images(self, points: Array) -> Array:
        images, epsilon = self._map(points)[0], float(self.student_damping_)
        if epsilon == 0.0:
            return images
        values, vectors = eigh(images)
        return compose(released(values, epsilon), vectors)

    def _map_back(self, points: Array) -> Array:
        raise NotInvertibleError(f"{type(self).__name__} has no inverse")

    def compiled(self) -> Any:
        """Return `transform`."""
        self._dimension()
        return self.transform


def log_vectors(points: Array, center: Array) -> Array:
    """Return Mandel vectors of log(C^-½ X C^-½), shape (n, d (d + 1) / 2)."""
    return to_vector(logarithm(congruence(roots(center)[1], points)))
