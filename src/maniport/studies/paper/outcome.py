"""What an experiment measures: errors of one method on one evaluation set, averaged over draws."""

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
from maniport.studies.paper.tables import OURS, PaperRow, in_words
from maniport.transfer import DomainAdapter, ParallelTransport, RiemannianICP
from maniport.util.defaults import DAMPING
from maniport.util.validation import Array

DRAWS = 10  # Random sets, over which errors are averaged

FORMS = tuple(form.name for form in fields(RMSE))


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
    """One method, fitted to every draw in one way, and its errors."""

    row: PaperRow | None  # of the paper, where it prints it
    data: str
    samples: str
    method: str  # these three in the words of the paper, where it has any
    settings: str  # of the fit: `PAPER`, `AUTHORS` or `OURS`
    adapter: str  # the settings in full
    errors: Mapping[str, Sequence[RMSE]]  # by evaluation set, one for each draw
    iterations: float  # mean over draws
    seconds: float  # of a fit, median over draws
    draws: int
    seed: int  # of the first draw; the next ones follow
    warned: int  # draws in which the library warned
    warnings: tuple[type[Warning], ...] = ()

    def lines(self) -> list[dict[str, Any]]:
        """Write it as lines of a table, one for each evaluation set: means and spreads (population) over draws."""
        row, lines = self.row, []
        for name, several in self.errors.items():
            forms: dict[str, float] = {}
            for form in FORMS:
                values = [getattr(one, form) for one in several]
                forms |= {form: float(np.mean(values)), f"{form}_spread": float(np.std(values))}
            line = {
                "table": row and row.table,
                "row": row and row.row,
                "data": self.data,
                "samples": self.samples,
                "method": self.method,
                "evaluation": name,
                "paper_rmse": row and row.rmse[name],
                "paper_iterations": row and row.iterations,
                "settings": self.settings,
                "adapter": self.adapter,
                **forms,
            }
            lines.append(
                line | {key: getattr(self, key) for key in ("iterations", "seconds", "draws", "seed", "warned")}
            )
        return lines


@dataclass(frozen=True)
class Experiment:
    """One experiment of the paper, run again."""

    name: str
    title: str
    notes: tuple[str, ...]  # what was done, in sentences
    outcomes: tuple[Outcome, ...]
    facts: Mapping[str, Any] = field(default_factory=dict)  # further numbers, with their units in the names

    @property
    def found(self) -> str:
        """One line for the progress display."""
        return f"{len(self.lines())} results"

    def lines(self) -> list[dict[str, Any]]:
        """Lines of all outcomes; see `Outcome.lines`."""
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
    iterations, seconds, warned = [], [], list[set[type[Warning]]]()
    for draw in draws:
        fitted = clone(adapter)
        if "random_state" in fitted.get_params():
            fitted.set_params(random_state=draw.seed)
        started = clock.perf_counter()
        warned.append(fit_quietly(fitted, draw))
        seconds.append(clock.perf_counter() - started)
        iterations.append(fitted.n_iter_)
        for name, (points, truth) in draw.evaluation.items():
            errors[name].append(score(fitted, points, truth, draw.regularized))
    return Outcome(
        row=row,
        data=data,
        samples=row.label if row else samples,
        method=row.method if row else method,
        settings=settings,
        adapter=in_words(adapter),
        errors=errors,
        iterations=float(np.mean(iterations)),
        seconds=float(np.median(seconds)),
        draws=len(draws),
        seed=draws[0].seed,
        warned=sum(map(bool, warned)),
        warnings=tuple(sorted(set().union(*warned), key=lambda kind: kind.__name__)),
    )


def measure_defaults(draws: Sequence[Draw], data: str, samples: str, base_rotation: ArrayLike) -> list[Outcome]:
    """What the paper did not try: our defaults with the base_rotation known, without and with matching."""
    adapters = {
        "PT only": ParallelTransport(damping=DAMPING, base_rotation=base_rotation),
        "PT + ICP": RiemannianICP(damping=DAMPING, base_rotation=base_rotation),
    }
    return [measure(one, draws, OURS, data, samples=samples, method=method) for method, one in adapters.items()]


def fit_quietly(adapter: DomainAdapter, draw: Draw) -> set[type[Warning]]:
    """Fit an adapter to a draw; return which warnings the library has, instead of warning."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", ManiportWarning)
        adapter.fit(draw.teacher, draw.student)
    return {one.category for one in caught if issubclass(one.category, ManiportWarning)}


def score(adapter: DomainAdapter, points: Array, truth: Array, regularized: bool = False) -> RMSE:
    """Return errors of a fitted adapter; a truth that is not regularized gets what the student's domain got."""
    mapped = adapter.transform(points) + adapter.released_damping_ * np.eye(points.shape[-1])
    return rmse(truth if regularized else adapter.student_side(truth, "truth"), mapped)
