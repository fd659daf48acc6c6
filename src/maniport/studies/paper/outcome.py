"""Errors of a method on the evaluation sets of an experiment, averaged over draws."""

import time as clock
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from maniport.errors import ManiportWarning
from maniport.estimator import clone
from maniport.evaluation import RMSE, rmse
from maniport.studies.paper.tables import OURS, PaperRow
from maniport.transfer import DomainAdapter, ParallelTransport, RiemannianICP
from maniport.util.defaults import DAMPING
from maniport.util.validation import Array

DRAWS = 10  # Random sets over which errors are averaged


@dataclass(frozen=True)
class Draw:
    """The data of one fit and its evaluation."""

    seed: int
    teacher: Array  # (n, d, d), a domain
    student: Array  # (m, d, d), a domain
    evaluation: Mapping[str, tuple[Array, Array]]  # by name: ellipsoids (k, d, d) of the teacher, and the truth
    regularized: bool = False  # whether the truth needs no regularization


@dataclass(frozen=True)
class Outcome:
    """Errors of one method that was fitted to all draws with the same settings."""

    row: PaperRow | None  # of the paper, if it prints the number
    data: str
    samples: str
    method: str
    settings: str  # of the fit: `PAPER`, `AUTHORS` or `OURS`
    adapter: str  # the settings in full
    errors: Mapping[str, Sequence[RMSE]]  # by evaluation set, one for each draw
    iterations: float  # mean over draws
    seconds: float  # of a fit, median over draws
    draws: int
    seed: int  # of the first draw; the next ones follow
    warned: int  # draws in which the library warned

    def lines(self) -> list[dict[str, Any]]:
        """Return one line of a table for each evaluation set: means and standard deviations over draws."""
        row = self.row
        lines = []
        for name, errors in self.errors.items():
            forms: dict[str, float] = {}
            for form in (form.name for form in fields(RMSE)):
                values = [getattr(error, form) for error in errors]
                forms |= {form: float(np.mean(values)), f"{form}_spread": float(np.std(values))}
            lines.append(
                {
                    "table": row and row.table,
                    "row": row and row.row,
                    **{key: getattr(self, key) for key in ("data", "samples", "method")},
                    "evaluation": name,
                    "paper_rmse": row and row.rmse[name],
                    "paper_iterations": row and row.iterations,
                    **{key: getattr(self, key) for key in ("settings", "adapter")},
                    **forms,
                    **{key: getattr(self, key) for key in ("iterations", "seconds", "draws", "seed", "warned")},
                }
            )
        return lines


@dataclass(frozen=True)
class Experiment:
    """One experiment of the paper, repeated."""

    name: str
    title: str
    notes: tuple[str, ...]
    outcomes: tuple[Outcome, ...]
    facts: Mapping[str, Any] = field(default_factory=dict)  # further numbers, with their units in the names

    def lines(self) -> list[dict[str, Any]]:
        """Return the lines of all outcomes; see `Outcome.lines`."""
        return [line for outcome in self.outcomes for line in outcome.lines()]


def measure(
    adapter: DomainAdapter,
    draws: Sequence[Draw],
    settings: str,
    data: str,
    row: PaperRow | None = None,
    samples: str = "",
    method: str = "",
) -> Outcome:
    """Fit an adapter to every draw and average its errors."""
    errors: dict[str, list[RMSE]] = {name: [] for name in draws[0].evaluation}
    iterations, seconds, warned = [], [], 0
    for draw in draws:
        fitted = clone(adapter)
        if "random_state" in fitted.get_params():
            fitted.set_params(random_state=draw.seed)
        started = clock.perf_counter()
        warned += fit_quietly(fitted, draw)
        seconds.append(clock.perf_counter() - started)
        iterations.append(fitted.n_iter_)
        for name, (points, truth) in draw.evaluation.items():
            # a truth that is not regularized gets the regularization of the student's domain
            target = truth if draw.regularized else fitted.student_side(truth, "truth")
            damped = fitted.transform(points) + fitted.released_damping_ * np.eye(points.shape[-1])
            errors[name].append(rmse(target, damped))
    return Outcome(
        row=row,
        data=data,
        samples=row.label if row else samples,
        method=row.method if row else method,
        settings=settings,
        adapter=repr(adapter),
        errors=errors,
        iterations=float(np.mean(iterations)),
        seconds=float(np.median(seconds)),
        draws=len(draws),
        seed=draws[0].seed,
        warned=warned,
    )


def measure_defaults(draws: Sequence[Draw], data: str, samples: str, base_rotation: ArrayLike) -> list[Outcome]:
    """Measure our defaults with the base rotation, without and with matching."""
    adapters = {
        "PT only": ParallelTransport(damping=DAMPING, base_rotation=base_rotation),
        "PT + ICP": RiemannianICP(damping=DAMPING, base_rotation=base_rotation),
    }
    return [measure(kind, draws, OURS, data, samples=samples, method=method) for method, kind in adapters.items()]


def fit_quietly(adapter: DomainAdapter, draw: Draw) -> bool:
    """Fit an adapter to a draw; return whether the library warned."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", ManiportWarning)
        adapter.fit(draw.teacher, draw.student)
    return any(issubclass(warning.category, ManiportWarning) for warning in caught)
