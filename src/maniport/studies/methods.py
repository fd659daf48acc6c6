"""Comparison of transfer methods on six motions of a human arm, for the Panda."""

import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from maniport.arms import Arm, load_arm
from maniport.domain import sample_domain
from maniport.errors import ManiportWarning, NotInvertibleError
from maniport.evaluation import Evaluation, evaluate, select_method
from maniport.evaluation.comparison import with_feasible_set
from maniport.evaluation.summary import BASELINES, LOOKUP, TRANSPORT
from maniport.mocap import fit_arm, read_recording, shipped_recording
from maniport.report.transfer import evaluation_section
from maniport.report.values import Report, Section, Table
from maniport.spd.kernels import congruence, roots
from maniport.spd.matrix_functions import apply, from_vector, logarithm, to_vector
from maniport.studies.paper import trajectories
from maniport.transfer import METHODS, DomainAdapter, method_of
from maniport.util.defaults import AUTO, DAMPING, ROBOT, STUDENT_SAMPLES, TEACHER_SAMPLES
from maniport.util.optional import optimal_transport
from maniport.util.progress import Progress, Step
from maniport.util.sampling import evenly_spaced
from maniport.util.validation import Array

FITTED_METHODS = ("icp", "length-field")  # Methods in every table besides the baselines

RECORDINGS = {"ladder": "a person climbs a ladder (BVH)", "freeform": "free arm motion (C3D)"}

EVALUATIONS = {
    "H-Eval-1": "sideways motion of the extended arm at 140° elevation",
    "H-Eval-2": "elbow fold",
    "H-Eval-3": "elbow and shoulder fold",
    "H-Eval-4": "upward motion of the extended arm in the plane of 60°",
}

CAPTION = (
    "Feasibility gap: mean over the motions / largest 95th percentile of a motion. Held out: the same for samples of "
    "the persons that the fits do not use. Successive distance: mean over the motions of the median, relative to the "
    "demonstrated one. Rank correlation: minimum, of pairwise distances. Axis rotation: largest median angle of the "
    "longest axes."
)


@dataclass(frozen=True, eq=False)
class Motion:
    """A motion of a human arm."""

    name: str
    about: str
    person: Arm  # its base frame is the trunk
    profile: Array  # (n, 3, 3), velocity ellipsoids of the hand


def motions(names: Iterable[str] | None = None) -> tuple[Motion, ...]:
    """Return the evaluation motions of Reithmeir et al. 2022 (rHuMan) and the recordings, 150 ellipsoids each."""
    selected = []
    person, paths = trajectories.human_arm(), trajectories.human_evaluation()
    for name in (*EVALUATIONS, *RECORDINGS) if names is None else names:
        if name in EVALUATIONS:
            selected.append(Motion(name, EVALUATIONS[name], person, person.manipulability(paths[name])))
            continue
        with warnings.catch_warnings():  # models and people differ
            warnings.simplefilter("ignore", ManiportWarning)
            fit = fit_arm(read_recording(shipped_recording(name)))
        ellipsoids = fit.arm.manipulability(fit.joint_angles[evenly_spaced(len(fit), 150)])
        selected.append(Motion(name, RECORDINGS[name], fit.arm, ellipsoids))
    return tuple(selected)


def study(
    method: str = AUTO,
    names: Iterable[str] | None = None,
    random_state: int = 0,
    progress: Progress | None = None,
    rows: Sequence[str | DomainAdapter] = (*BASELINES, LOOKUP, *FITTED_METHODS),
) -> dict[Motion, Evaluation]:
    """Evaluate a method on the motions, by motion, with other methods in further rows."""
    robot = load_arm(ROBOT)
    shared: dict[str, Any] = {"damping": DAMPING, "base_rotation": np.eye(3)}
    student, evaluated = sample_domain(robot, STUDENT_SAMPLES, random_state + 1), {}
    for motion in motions(names):
        step, teacher = Step(progress, motion.name), sample_domain(motion.person, TEACHER_SAMPLES, random_state)
        options: dict[str, Any] = {"robot": robot, "random_state": random_state}
        if method == AUTO:
            adapter, _ = select_method(teacher, student, motion.profile, **options, **shared)
        else:
            adapter = with_feasible_set(method_of(method, random_state=random_state, **shared), robot)
            adapter.fit(teacher, student)
        options |= {"person": motion.person, "rows": rows}
        evaluated[motion] = evaluate(adapter, teacher, student, motion.profile, **options)
        step.end(f"{evaluated[motion].adapter.name} and {len(evaluated[motion].rows) - 1} more")
    return evaluated


def compare_methods(
    rows: Sequence[str], random_state: int = 0, progress: Progress | None = None, names: Sequence[str] | None = None
) -> dict[str, Evaluation]:
    """Evaluate methods by motion; if every method is requested, the transport between Gaussians comes last."""
    further = [GaussianTransport(DAMPING, np.eye(3))] if set(rows) >= set(METHODS) else []
    evaluated = study(TRANSPORT, names, random_state, progress, rows=(*rows, *further))
    return {motion.name: evaluation for motion, evaluation in evaluated.items()}


def methods_report(evaluations: Mapping[str, Evaluation]) -> Report:
    """Describe all methods, in a summary and by motion."""
    tables = (
        replace(evaluation_section(evaluation, explained=not index), title=motion, key=motion, metrics=())
        for index, (motion, evaluation) in enumerate(evaluations.items())
    )
    return Report("Comparison of methods", "", (replace(methods_section(evaluations), title="Summary"), *tables))


def methods_section(evaluations: Mapping[str, Evaluation]) -> Section:
    """One line for each method, over all motions."""
    every, values, cells = list(evaluations.values()), dict[str, dict[str, float]](), []
    for name in (row.name for row in every[0].rows if row.feasibility_gap is not None):
        rows = [evaluation.row(name) for evaluation in every]
        gaps = [row.feasibility_gap for row in rows if row.feasibility_gap is not None]
        held = [row.domain_feasibility_gap for row in rows if row.domain_feasibility_gap is not None]
        kept = [row.preservation for row in rows if row.preservation is not None]
        values[name] = own = {
            "gap": float(np.mean([gap.mean for gap in gaps])),
            "gap_p95": max(gap.p95 for gap in gaps),
            "held_out": float(np.mean([gap.mean for gap in held])),
            "held_out_p95": max(gap.p95 for gap in held),
            "successive_distance": float(
                np.mean([row.smoothness.median_ratio for row in rows if row.smoothness is not None])
            ),
            "rank_correlation": min(own.rank_correlation for own in kept),
            "axis_rotation_deg": max(own.major_axis_angle or 0.0 for own in kept),
        }
        forms = (
            "{gap:.3f} / {gap_p95:.3f}", "{held_out:.3f} / {held_out_p95:.3f}", "{successive_distance:.2f}",
            "{rank_correlation:.3f}", "{axis_rotation_deg:.1f}°",
        )  # fmt: skip
        cells.append((name, *(form.format(**own) for form in forms)))
    columns = ("", "feasibility gap", "held out", "successive distance", "rank correlation", "axis rotation")
    return Section("Metrics", (), (Table(columns, tuple(cells), CAPTION, "rows", values),), "methods")


class GaussianTransport(DomainAdapter):
    """The linear transport between Gaussians with the means and covariances of two clouds of log-vectors."""

    def _fit(self, teacher: Array, student: Array) -> None:
        self._describe(teacher, student)
        start, goal = _log_vectors(teacher, self.teacher_mean_), _log_vectors(student, self.student_mean_)
        self._solver = optimal_transport().da.LinearTransport().fit(Xs=start, Xt=goal)
        self._set_closed_form("closed form")

    def _map(self, points: Array) -> Array:
        moved = self._solver.transform(Xs=_log_vectors(points, self.teacher_mean_))
        return congruence(roots(self.student_mean_)[0], apply(from_vector(moved), np.exp))

    def _map_back(self, points: Array) -> Array:
        raise NotInvertibleError(f"{type(self).__name__} has no inverse")


def _log_vectors(points: Array, center: Array) -> Array:
    """Return Mandel vectors of log(C^-½ X C^-½), shape (n, d (d + 1) / 2)."""
    return to_vector(logarithm(congruence(roots(center)[1], points)))
