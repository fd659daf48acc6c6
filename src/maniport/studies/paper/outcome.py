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

Line = dict[str, Any]
"""Errors of one method on one evaluation set: means over draws, with the row of the paper where it prints the number.

Keys: ``table``, ``row``, ``paper_rmse`` and ``paper_iterations`` (None where the paper has none), ``data``,
``samples``, ``method``, ``evaluation``, ``settings`` (`PAPER`, `AUTHORS` or `OURS`), ``adapter``, each form of `RMSE`
with its standard deviation (``_spread``), ``iterations``, ``seconds`` of a fit (median), ``draws``, ``seed`` of the
first draw, and ``warned``, the number of fits with warnings.
"""


@dataclass(frozen=True)
class Draw:
    """The data of one fit and its evaluation."""

    seed: int
    teacher: Array  # (n, d, d), a domain
    student: Array  # (m, d, d), a domain
    evaluation: Mapping[str, tuple[Array, Array]]  # by name: ellipsoids (k, d, d) of the teacher, and the truth
    regularized: bool = False  # whether the truth needs no regularization


@dataclass(frozen=True)
class Experiment:
    """One experiment of the paper, repeated."""

    name: str
    title: str
    notes: tuple[str, ...]
    lines: tuple[Line, ...]
    facts: Mapping[str, Any] = field(default_factory=dict)  # further numbers, with their units in the names


def measure(
    adapter: DomainAdapter,
    draws: Sequence[Draw],
    settings: str,
    data: str,
    row: PaperRow | None = None,
    samples: str = "",
    method: str = "",
) -> list[Line]:
    """Fit an adapter to every draw; return a line for each evaluation set."""
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
    lines = []
    for name, own in errors.items():
        forms: dict[str, float] = {}
        for form in (form.name for form in fields(RMSE)):
            values = [getattr(error, form) for error in own]
            forms |= {form: float(np.mean(values)), f"{form}_spread": float(np.std(values))}
        lines.append(
            {
                "table": row and row.table,
                "row": row and row.row,
                "data": data,
                "samples": row.label if row else samples,
                "method": row.method if row else method,
                "evaluation": name,
                "paper_rmse": row and row.rmse[name],
                "paper_iterations": row and row.iterations,
                "settings": settings,
                "adapter": repr(adapter),
                **forms,
                "iterations": float(np.mean(iterations)),
                "seconds": float(np.median(seconds)),
                "draws": len(draws),
                "seed": draws[0].seed,
                "warned": warned,
            }
        )
    return lines


def measure_defaults(draws: Sequence[Draw], data: str, samples: str, base_rotation: ArrayLike) -> list[Line]:
    """Measure our defaults with the base rotation, without and with matching."""
    options: dict[str, Any] = {"damping": DAMPING, "base_rotation": base_rotation}
    adapters = {"PT only": ParallelTransport(**options), "PT + ICP": RiemannianICP(**options)}
    return [
        line
        for method, adapter in adapters.items()
        for line in measure(adapter, draws, OURS, data, samples=samples, method=method)
    ]


def fit_quietly(adapter: DomainAdapter, draw: Draw) -> bool:
    """Fit an adapter to a draw; return whether the library warned."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", ManiportWarning)
        adapter.fit(draw.teacher, draw.student)
    return any(issubclass(warning.category, ManiportWarning) for warning in caught)
