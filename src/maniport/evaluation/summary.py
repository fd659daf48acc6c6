"""The rows of a comparison of methods, and its result: the best, the recommended, and weaknesses.

A method without any weakness is sound. Recommended is, of the sound methods (of all, where none is), the first in the
order of `maniport.transfer.METHODS` whose mean feasibility gap no other undercuts by more than 5 %. Where the truth is
known, the root mean squared error decides alone.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from maniport.errors import unknown_name
from maniport.evaluation.baselines import IDENTITY, LOOKUP, TRANSPORT
from maniport.evaluation.metrics import RMSE, STILL, DistancePreservation, Smoothness
from maniport.transfer import METHODS
from maniport.transfer.length_field.report import AXIS_MOVED, MIN_RANK_CORRELATION
from maniport.util.notebook import NotebookDisplay
from maniport.util.validation import Array

RELEVANT_RATIO = 0.95  # A value must fall below this fraction of another to count as better

MAX_STEP_RATIO = 1.5  # Largest step over the teacher's largest above which a method is rough

MAX_IDENTITY_TEST = 0.15  # Largest passing value of the identity test


@dataclass(frozen=True)
class Gaps:
    """Mean, median, 95th percentile and maximum of distances to the feasible set.

    Methods are compared by the mean: where half of a profile is feasible, the median is zero for all of them.

    Attributes
    ----------
    mean, median, p95, largest : float
    where : int
        Row of the largest.
    """

    mean: float
    median: float
    p95: float
    largest: float = np.nan
    where: int = 0

    @classmethod
    def of(cls, distances: Array, rows: NDArray[np.intp] | None = None) -> "Gaps":
        """Summarize distances, shape (n,); `rows` are their indices where these are not 0 … n − 1."""
        worst = int(np.argmax(distances))
        where = worst if rows is None else int(rows[worst])
        mean, median, p95 = np.mean(distances), np.median(distances), np.percentile(distances, 95)
        return cls(float(mean), float(median), float(p95), float(distances[worst]), where)


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
    energy_distance : float or None
        From the mapped domain of the teacher to the student's.
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
    energy_distance: float | None = None
    identity: float | None = None
    failures: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()

    def value(self, measure: str) -> float | None:
        """Return the RMSE or the mean feasibility gap, if there is one."""
        if measure == "rmse":
            return None if self.rmse is None else self.rmse.undivided
        return None if not measure or self.feasibility_gap is None else self.feasibility_gap.mean


@dataclass(frozen=True)
class Weakness:
    """A fault of a method, whatever its gaps.

    Attributes
    ----------
    code : {"large_step", "plateau", "rank_correlation", "rotated_axes", "identity_test"}
        Largest step over the teacher's; median step where the teacher moves; rank correlation of distances; rotation of
        the longest axes [degrees]; identity test.
    value, threshold : float
        The metric, and its limit.
    reference : float or None
        Value of parallel transport, for the identity test.
    """

    code: str
    value: float
    threshold: float
    reference: float | None = None


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
    """

    measure: str
    name: str
    values: dict[str, float] = field(default_factory=dict)
    recommended: str = ""
    same_as: tuple[str, ...] = ()
    weaknesses: tuple[Weakness, ...] = ()

    @property
    def value(self) -> float | None:
        """Value of the adapter; None where nothing is compared."""
        return self.values.get(self.name)

    @property
    def identity(self) -> float | None:
        """Value of the identity baseline."""
        return self.values.get(IDENTITY)

    @property
    def best(self) -> str:
        """The row with the smallest value, the first of equals; empty where nothing is compared."""
        return min(self.values, key=lambda name: self.values[name], default="")

    @property
    def best_value(self) -> float | None:
        """Value of the best row."""
        return self.values.get(self.best)

    def as_dict(self) -> dict[str, Any]:
        """Return everything as plain values, ready for JSON."""
        derived = {name: getattr(self, name) for name in ("value", "identity", "best", "best_value")}
        return {**asdict(self), **derived}


def summarize(rows: Sequence[Row]) -> Summary:
    """Compare the first row with the others."""
    first = rows[0]
    measure = "rmse" if first.rmse is not None else "feasibility_gap" if first.feasibility_gap is not None else ""
    values = {
        row.name: value
        for row in rows
        if (value := row.value(measure)) is not None and (row is first or row.name != LOOKUP or measure == "rmse")
    }
    own = values.get(first.name, 0.0)
    same = tuple(row.name for row in rows[1:] if row.name in values and _equal(values[row.name], own))
    recommended = _recommended(rows, values, measure)
    return Summary(measure, first.name, values, recommended, same, tuple(_weaknesses(first, rows)))


@dataclass(frozen=True)
class Evaluation(NotebookDisplay):
    """All metrics of an adapter and of the baselines.

    Attributes
    ----------
    rows : tuple of Row
        The adapter first, then the baselines.
    student_noise : Row
        The energy distance of fresh samples of the student to its own domain: the effect of sampling alone.
    settings : dict
        Sizes, regularization, seed, and the source of samples; ready for JSON.
    """

    rows: tuple[Row, ...]
    student_noise: Row
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


def _weaknesses(row: Row, others: Sequence[Row] = ()) -> list[Weakness]:
    """List the faults of a method; parallel transport is looked up among the other rows."""
    found, steps, kept = [], row.smoothness, row.preservation
    if steps is not None and steps.largest_ratio > MAX_STEP_RATIO:
        found.append(Weakness("large_step", steps.largest_ratio, MAX_STEP_RATIO))
    if steps is not None and steps.median <= STILL:
        found.append(Weakness("plateau", steps.median, STILL))
    if kept is not None and kept.rank_correlation < MIN_RANK_CORRELATION:
        found.append(Weakness("rank_correlation", kept.rank_correlation, MIN_RANK_CORRELATION))
    if kept is not None and kept.major_axis_angle is not None and kept.major_axis_angle > AXIS_MOVED:
        found.append(Weakness("rotated_axes", kept.major_axis_angle, AXIS_MOVED))
    if row.identity is not None and row.identity > MAX_IDENTITY_TEST:
        transport = next((other.identity for other in others if other.name == TRANSPORT and other is not row), None)
        found.append(Weakness("identity_test", row.identity, MAX_IDENTITY_TEST, transport))
    return found


def _recommended(rows: Sequence[Row], values: Mapping[str, float], measure: str) -> str:
    """Return the recommended method; empty where nothing is compared."""
    order = {name: index for index, name in enumerate(METHODS)}
    candidates: dict[str, Row] = {}
    for row in rows:
        name = row.method if row.method in METHODS else row.name
        if row.name in values and (name in METHODS or row is rows[0]) and (name != LOOKUP or measure == "rmse"):
            candidates.setdefault(name, row)
    ranked = sorted(candidates, key=lambda name: order.get(name, len(order)))
    if measure != "rmse":
        sound = [name for name in ranked if not (_weaknesses(candidates[name]) or candidates[name].failures)]
        ranked = sound or ranked
    reached = {name: values[candidates[name].name] for name in ranked}
    best = min(reached.values(), default=0.0)
    return next((name for name, value in reached.items() if RELEVANT_RATIO * value <= best or _equal(value, best)), "")


def _equal(value: float, other: float) -> bool:
    """Whether two values are the same but for rounding."""
    return abs(value - other) <= 1e-9 * max(abs(value), abs(other))
