"""The result of a comparison of methods: metrics of each, the best, the recommended, and weaknesses.

A method without any weakness is sound. Recommended is, of the sound methods (of all, where none is), the first in the
order of `maniport.transfer.METHODS` whose mean feasibility gap no other undercuts by more than 5 %. Where the truth is
known, the root mean squared error decides alone.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from maniport.errors import unknown_name
from maniport.evaluation.metrics import RMSE, STILL, DistancePreservation, Smoothness
from maniport.transfer import METHODS
from maniport.transfer.length_field.fit import AXIS_MOVED, MIN_RANK_CORRELATION
from maniport.util.notebook import NotebookDisplay
from maniport.util.validation import Array

IDENTITY, MEAN_TRANSPORT, TRANSPORT, LOOKUP = "identity", "mean-transport", "parallel-transport", "nearest-neighbor"
BASELINES = (IDENTITY, MEAN_TRANSPORT, TRANSPORT)  # The default baselines, cheapest first
RELEVANT_RATIO = 0.95  # A value must fall below this fraction of another to count as better
MAX_STEP_RATIO = 1.5


@dataclass(frozen=True)
class Gaps:
    """Statistics of distances to the feasible set.

    Methods are compared by the mean: where half of a profile is feasible, the median is zero for all of them.

    Attributes
    ----------
    mean, median, p95, largest : float
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
        As in `maniport.transfer.METHODS`, or the class of the method.
    note : str
        A remark, or why nothing was measured.
    rmse : RMSE or None
        Where the truth is known.
    feasibility_gap, domain_feasibility_gap : Gaps or None
        Of the profile, and of samples of the teacher's domain, held out of the fit where the teacher's arm is known;
        None without the student's kinematics.
    smoothness : Smoothness or None
    preservation : DistancePreservation or None
        None where the teacher's ellipsoids do not change.
    failures : tuple of str
        Checks that the fit of a length field fails, see `FieldReport.failures`.
    warnings : tuple of str
        Warnings of its fits, each once.
    """

    name: str
    note: str = ""
    rmse: RMSE | None = None
    feasibility_gap: Gaps | None = None
    domain_feasibility_gap: Gaps | None = None
    smoothness: Smoothness | None = None
    preservation: DistancePreservation | None = None
    failures: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()

    @property
    def weaknesses(self) -> dict[str, float]:
        """Metrics beyond their limits, whatever the gaps.

        They are "large_step" (largest step over the teacher's), "plateau" (median step where the teacher moves),
        "rank_correlation" (of distances) and "rotated_axes" (of the longest axes [degrees]).
        """
        steps, kept = self.smoothness, self.preservation
        ratio, median = (0.0, np.inf) if steps is None else (steps.largest_ratio, steps.median)
        rank, angle = (1.0, 0.0) if kept is None else (kept.rank_correlation, kept.major_axis_angle or 0.0)
        metrics = {
            "large_step": (ratio, ratio > MAX_STEP_RATIO),
            "plateau": (median, median <= STILL),
            "rank_correlation": (rank, rank < MIN_RANK_CORRELATION),
            "rotated_axes": (angle, angle > AXIS_MOVED),
        }
        return {name: value for name, (value, weak) in metrics.items() if weak}


@dataclass(frozen=True)
class Evaluation(NotebookDisplay):
    """All metrics of an adapter and of the baselines.

    Attributes
    ----------
    rows : tuple of Row
        The adapter first, then the baselines.
    settings : dict
        Sizes, regularization, seed, and the source of samples; ready for JSON.
    rejected : tuple of str or None
        Of a method that was selected: why the length field was not, empty where it was; else None.
    """

    rows: tuple[Row, ...]
    settings: dict[str, Any] = field(default_factory=dict)
    rejected: tuple[str, ...] | None = None

    def __repr__(self) -> str:
        best = f"; best: {self.best!r}" if self.best else ""
        return f"Evaluation({self.adapter.name!r} and {len(self.rows) - 1} baselines{best})"

    @property
    def adapter(self) -> Row:
        """The row of the adapter that was evaluated."""
        return self.rows[0]

    def row(self, name: str) -> Row:
        """Return the row of that name; `UnknownNameError` where there is none."""
        named = {row.name: row for row in self.rows}
        if name not in named:
            raise unknown_name("row", str(name), named)
        return named[name]

    @property
    def measure(self) -> str:
        """Measure of the comparison: "rmse" with a ground truth, else "feasibility_gap" (mean), "" without a robot."""
        return next((name for name in ("rmse", "feasibility_gap") if getattr(self.adapter, name) is not None), "")

    @property
    def values(self) -> dict[str, float]:
        """The measure of every row that is compared, the adapter's first.

        A lookup of samples is compared only where the truth is known, since its gaps are zero by construction.
        """
        if self.measure == "rmse":
            return {row.name: row.rmse.undivided for row in self.rows if row.rmse is not None}
        rows = (row for row in self.rows if row is self.adapter or row.name != LOOKUP)
        return {row.name: row.feasibility_gap.mean for row in rows if row.feasibility_gap is not None}

    @property
    def best(self) -> str:
        """The row with the smallest value, the first of equals; empty where nothing is compared."""
        values = self.values
        return min(values, key=lambda name: values[name], default="")

    @property
    def recommended(self) -> str:
        """Recommended method; empty where nothing is compared."""
        values, order = self.values, list(METHODS)
        rows = [row for row in self.rows if row.name in values and (row.name in METHODS or row is self.adapter)]
        if self.measure != "rmse":
            rows = [row for row in rows if row.name != LOOKUP]
            rows = [row for row in rows if not (row.weaknesses or row.failures)] or rows
        names = sorted((row.name for row in rows), key=lambda name: (*order, name).index(name))
        best = min((values[name] for name in names), default=0.0)
        return next((name for name in names if RELEVANT_RATIO * values[name] <= best), "")
