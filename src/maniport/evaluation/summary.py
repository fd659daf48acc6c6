"""The rows of a comparison of methods, and its result: the best, the recommended, and weaknesses.

A method without any weakness is sound. Recommended is, of the sound methods (of all, where none is), the first in the
order of `maniport.transfer.METHODS` whose mean feasibility gap no other undercuts by more than 5 %. Where the truth is
known, the root mean squared error decides alone.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from maniport.errors import unknown_name
from maniport.evaluation.baselines import IDENTITY, LOOKUP
from maniport.evaluation.metrics import RMSE, STILL, DistancePreservation, Smoothness
from maniport.transfer import METHODS
from maniport.transfer.length_field.fit import AXIS_MOVED, MIN_RANK_CORRELATION
from maniport.util.notebook import NotebookDisplay
from maniport.util.validation import Array

RELEVANT_RATIO = 0.95  # A value must fall below this fraction of another to count as better


@dataclass(frozen=True)
class Gaps:
    """Statistics of distances to the feasible set.

    Methods are compared by the mean: where half of a profile is feasible, the median is zero for all of them.

    Attributes
    ----------
    mean, median, p95, largest : float
        Mean, median, 95th percentile and maximum.
    """

    mean: float
    median: float
    p95: float
    largest: float = np.nan

    @classmethod
    def of(cls, distances: Array) -> "Gaps":
        """Summarize distances, shape (n,)."""
        statistics = np.mean(distances), np.median(distances), np.percentile(distances, 95), np.max(distances)
        return cls(*map(float, statistics))


@dataclass(frozen=True)
class Row:
    """The metrics of one method; None where a metric does not apply.

    Attributes
    ----------
    name : str
    note : str
        A remark, or why nothing was measured.
    method : str
        Its name in `maniport.transfer.METHODS`, or its class where it has none.
    rmse : RMSE or None
        Where the truth is known.
    feasibility_gap, domain_feasibility_gap : Gaps or None
        Of the profile, and of samples of the teacher's domain, held out of the fit where the teacher's arm is known;
        None without the student's kinematics.
    smoothness : Smoothness or None
    preservation : DistancePreservation or None
        None where the teacher's ellipsoids do not change.
    identity : float or None
        Identity test: RMSE undivided, truth 0.
    failures : tuple of str
        Checks that the fit of a length field fails, see `FieldReport.failures`.
    warnings : tuple of str
        Warnings of its fits, each once.
    """

    name: str
    note: str = ""
    method: str = ""
    rmse: RMSE | None = None
    feasibility_gap: Gaps | None = None
    domain_feasibility_gap: Gaps | None = None
    smoothness: Smoothness | None = None
    preservation: DistancePreservation | None = None
    identity: float | None = None
    failures: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()

    def weaknesses(self, max_step_ratio: float = 1.5, max_identity_test: float = 0.15) -> "tuple[Weakness, ...]":
        """List the faults of the method, whatever its gaps."""
        steps, kept = self.smoothness, self.preservation
        ratio, median = (0.0, np.inf) if steps is None else (steps.largest_ratio, steps.median)
        rank, angle = (1.0, None) if kept is None else (kept.rank_correlation, kept.major_axis_angle)
        faults = (
            (ratio > max_step_ratio, "large_step", ratio, max_step_ratio),
            (median <= STILL, "plateau", median, STILL),
            (rank < MIN_RANK_CORRELATION, "rank_correlation", rank, MIN_RANK_CORRELATION),
            ((angle or 0.0) > AXIS_MOVED, "rotated_axes", angle or 0.0, AXIS_MOVED),
            ((self.identity or 0.0) > max_identity_test, "identity_test", self.identity or 0.0, max_identity_test),
        )
        return tuple(Weakness(code, value, limit) for present, code, value, limit in faults if present)


@dataclass(frozen=True)
class Weakness:
    """A fault of a method: its code, the metric, and the limit of the metric.

    Attributes
    ----------
    code : str
        "large_step" (largest step over the teacher's), "plateau" (median step where the teacher moves),
        "rank_correlation" (of distances), "rotated_axes" (of the longest axes [degrees]) or "identity_test".
    value, threshold : float
        Metric and its limit.
    """

    code: str
    value: float
    threshold: float


@dataclass(frozen=True)
class Summary:
    """The result of a comparison of an adapter with baselines.

    Attributes
    ----------
    measure : {"rmse", "feasibility_gap", ""}
        Measure of the comparison: RMSE with a ground truth, else the mean feasibility gap, else none.
    name : str
        The row of the adapter.
    values : dict of str to float
        The measure of every row that is compared, the adapter's first. A lookup is compared only where the truth is
        known, since its gaps are zero by construction.
    recommended : str
        Recommended method, by its name in `maniport.transfer.METHODS` where it has one. Empty where nothing is
        compared.
    same_as : tuple of str
        Rows with the same value as the adapter, but for rounding.
    weaknesses : tuple of Weakness
        Of the adapter.
    value, identity : float or None
        Values of the adapter and of the identity baseline; None where they are not compared.
    best : str
        The row with the smallest value, the first of equals; empty where nothing is compared.
    best_value : float or None
        Value of the best row.
    """

    measure: str
    name: str
    values: dict[str, float]
    recommended: str
    same_as: tuple[str, ...]
    weaknesses: tuple[Weakness, ...]
    value: float | None
    identity: float | None
    best: str
    best_value: float | None


def summarize(rows: Sequence[Row]) -> Summary:
    """Compare the first row with the others."""
    first, values = rows[0], dict[str, float]()
    measure = "rmse" if first.rmse is not None else "feasibility_gap" if first.feasibility_gap is not None else ""
    for row in rows:
        if measure == "rmse" and row.rmse is not None:
            values[row.name] = row.rmse.undivided
        elif measure == "feasibility_gap" and row.feasibility_gap is not None and (row is first or row.name != LOOKUP):
            values[row.name] = row.feasibility_gap.mean
    own, best = values.get(first.name), min(values, key=lambda name: values[name], default="")
    return Summary(
        measure,
        first.name,
        values,
        _recommended(rows, values, measure),
        tuple(row.name for row in rows[1:] if row.name in values and _equal(values[row.name], own or 0.0)),
        first.weaknesses(),
        own,
        values.get(IDENTITY),
        best,
        values.get(best),
    )


@dataclass(frozen=True)
class Evaluation(NotebookDisplay):
    """All metrics of an adapter and of the baselines.

    Attributes
    ----------
    rows : tuple of Row
        The adapter first, then the baselines.
    settings : dict
        Sizes, regularization, seed, and the source of samples; ready for JSON.
    """

    rows: tuple[Row, ...]
    settings: dict[str, Any] = field(default_factory=dict)

    def __repr__(self) -> str:
        best = self.summary.best
        return f"Evaluation({self.adapter.name!r} and {len(self.rows) - 1} baselines{best and f'; best: {best!r}'})"

    @property
    def adapter(self) -> Row:
        """The row of the adapter that was evaluated."""
        return self.rows[0]

    @property
    def summary(self) -> Summary:
        """Whether the adapter is better than the baselines, and which method is recommended."""
        return summarize(self.rows)

    def row(self, name: str) -> Row:
        """Return the row of that name; `UnknownNameError` where there is none."""
        named = {row.name: row for row in self.rows}
        if name not in named:
            raise unknown_name("row", str(name), named)
        return named[name]


def _recommended(rows: Sequence[Row], values: Mapping[str, float], measure: str) -> str:
    """Return the recommended method; empty where nothing is compared."""
    order = list(METHODS)
    candidates: dict[str, Row] = {}
    for row in rows:
        name = row.method if row.method in METHODS else row.name
        if row.name in values and (name in METHODS or row is rows[0]) and (name != LOOKUP or measure == "rmse"):
            candidates.setdefault(name, row)
    ranked = sorted(candidates, key=lambda name: order.index(name) if name in METHODS else len(order))
    if measure != "rmse":
        sound = [name for name in ranked if not (candidates[name].weaknesses() or candidates[name].failures)]
        ranked = sound or ranked
    reached = {name: values[candidates[name].name] for name in ranked}
    best = min(reached.values(), default=0.0)
    return next((name for name, value in reached.items() if RELEVANT_RATIO * value <= best or _equal(value, best)), "")


def _equal(value: float, other: float) -> bool:
    """Whether two values are the same but for rounding."""
    return abs(value - other) <= 1e-9 * max(abs(value), abs(other))
