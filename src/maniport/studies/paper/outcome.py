"""What an experiment measures: errors of one method on one evaluation set, averaged over draws."""

import time as clock
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from maniport.defaults import DAMPING
from maniport.errors import ManiportWarning
from maniport.estimator import clone
from maniport.evaluation import RMSE, rmse
from maniport.studies.paper.tables import OURS, PaperRow, in_words
from maniport.transfer import DomainAdapter, ParallelTransport, RiemannianICP
from maniport.validation import Array

DRAWS = 10
"""Random sets, over which errors are averaged."""

FORMS = tuple(form.name for form in fields(RMSE))


@dataclass(frozen=True)
class Draw:
    """What one fit gets and is measured on.

    Attributes
    ----------
    seed : int
    teacher, student : ndarray, shapes (n, d, d) and (m, d, d)
        Domains.
    evaluation : mapping of str to (ndarray, ndarray), shapes (k, d, d)
        By name: the teacher's ellipsoids and the student's that they should become.
    regularized : bool
        Whether the latter need no regularization: they are positive-definite, and compared as they are.
    """

    seed: int
    teacher: Array
    student: Array
    evaluation: Mapping[str, tuple[Array, Array]]
    regularized: bool = False


@dataclass(frozen=True)
class Outcome:
    """One method, fitted to every draw in one way, and its errors.

    Attributes
    ----------
    row : PaperRow or None
        Where the paper prints it; None for what the paper does not have.
    data, samples, method : str
        What was fitted to what, in the paper's words where it has any.
    settings : str
        How the adapter was fitted and measured: one of `PAPER`, `AUTHORS` and `OURS` in `tables.py`.
    adapter : str
        These settings in full.
    errors : mapping of str to tuple of RMSE
        By evaluation set, one for each draw.
    iterations, seconds : float
        Of the fit; mean and median over draws.
    draws, seed : int
        How many, and the seed of the first; the next ones follow.
    warned : int
        Draws in which the library warned.
    warnings : tuple of type
        Which warnings these were.
    """

    row: PaperRow | None
    data: str
    samples: str
    method: str
    settings: str
    adapter: str
    errors: Mapping[str, Sequence[RMSE]]
    iterations: float
    seconds: float
    draws: int
    seed: int
    warned: int
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
    """One experiment of the paper, run again.

    Attributes
    ----------
    name, title : str
    notes : tuple of str
        What was done, in sentences.
    outcomes : tuple of Outcome
    facts : mapping of str to float
        Further numbers, with their units in the names.
    """

    name: str
    title: str
    notes: tuple[str, ...]
    outcomes: tuple[Outcome, ...]
    facts: Mapping[str, Any] = field(default_factory=dict)

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


def measure_defaults(draws: Sequence[Draw], data: str, samples: str, mounting: ArrayLike) -> list[Outcome]:
    """What the paper did not try: our defaults with the mounting known, without and with matching."""
    adapters = {
        "PT only": ParallelTransport(damping=DAMPING, mounting=mounting),
        "PT + ICP": RiemannianICP(damping=DAMPING, mounting=mounting),
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
