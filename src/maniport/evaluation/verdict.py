"""The rows of a comparison and the verdict on them, as data: what is best, what is recommended, what is wrong."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from maniport.evaluation.measures import RMSE, STILL, Smoothness, Structure
from maniport.evaluation.reliability import Stability
from maniport.transfer import METHODS
from maniport.validation import Array

RAW_COPY, RECENTRING, TRANSPORT, LOOKUP = "raw-copy", "recentring", "parallel-transport", "nearest-neighbor"
"""Rows are called by the names in `maniport.transfer.METHODS`."""

WORTH_WHILE = 0.95
"""A measure must fall below this fraction of another's to count as better."""

EQUAL = 1e-9
"""Relative difference up to which two methods do the same."""

ROUGH = 1.5
"""A largest step of more than this times the teacher's own is a weakness."""

SHUFFLED = 0.95
"""A rank correlation of pairwise distances below this is one."""

RESTLESS = 0.15
"""Root mean squared change of the student's own ellipsoids above which the identity test is failed."""

UNSTEADY = 5.0
"""Spread of the rotation over draws [degrees, root mean square] above which the clouds do not determine it."""


@dataclass(frozen=True)
class Gaps:
    """Mean, median and 95th percentile of distances.

    The mean is what adapters are compared by: where half of a profile is feasible the median tells nothing.
    """

    mean: float
    median: float
    p95: float

    @classmethod
    def of(cls, distances: Array) -> "Gaps":
        """Summarise distances, shape (n,)."""
        return cls(float(np.mean(distances)), float(np.median(distances)), float(np.percentile(distances, 95)))


@dataclass(frozen=True)
class Row:
    """The measures of one adapter; None where a measure does not apply. See `maniport.evaluation`.

    Attributes
    ----------
    name : str
    method : str
        Its name in `maniport.transfer.METHODS`, or its class where it has none.
    note : str
        What to know about it, or why nothing could be measured.
    rmse : RMSE or None
        Where the truth is known.
    feasibility_gap, domain_feasibility_gap : Gaps or None
        Of the profile, and of samples of the teacher's domain, where the student's kinematics is known.
    smoothness : Smoothness or None
    structure : Structure or None
        None where the teacher's ellipsoids do not change.
    energy_distance : float or None
        From the mapped domain of the teacher to the student's.
    identity : float or None
        Identity test, RMSE undivided; truth 0.
    stability : Stability or None
    warnings : tuple of str
        What its fits warned of, each once.
    """

    name: str
    note: str = ""
    method: str = ""
    rmse: RMSE | None = None
    feasibility_gap: Gaps | None = None
    domain_feasibility_gap: Gaps | None = None
    smoothness: Smoothness | None = None
    structure: Structure | None = None
    energy_distance: float | None = None
    identity: float | None = None
    stability: Stability | None = None
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True)
class Weakness:
    """Something that an adapter does badly, whatever its gaps.

    Attributes
    ----------
    code : {"rough", "staircase", "shuffled", "restless", "unsteady"}
        Largest step over the teacher's own; median step where the teacher moves; rank correlation of distances;
        change in the identity test; spread of the rotation over draws [degrees].
    value, threshold : float
        What was measured, and from where on it is a weakness.
    beside : float or None
        The same of parallel transport, for the identity test.
    """

    code: str
    value: float
    threshold: float
    beside: float | None = None


@dataclass(frozen=True)
class Verdict:
    """Whether an adapter is worth while, beside doing nothing and the other cheap alternatives.

    Attributes
    ----------
    measure : {"rmse", "feasibility_gap", ""}
        What rows are compared by: the RMSE where the truth is known, else the mean feasibility gap, else nothing.
    name : str
        The row of the adapter that was asked about.
    values : dict of str to float
        The measure of every row that takes part, the adapter's first. A lookup takes part only where the truth is
        known, since its gaps are none by construction.
    recommended : str
        Method to take, by its name in `maniport.transfer.METHODS` where it has one: the cheapest that no other
        undercuts by `WORTH_WHILE`. Empty where nothing is compared.
    same_as : tuple of str
        Rows that do the same as the adapter: it does no more than they do.
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
        """What the adapter reaches; None where nothing is compared."""
        return self.values.get(self.name)

    @property
    def raw_copy(self) -> float | None:
        """What doing nothing reaches."""
        return self.values.get(RAW_COPY)

    @property
    def best(self) -> str:
        """The row with the smallest value, the first of equals; empty where nothing is compared."""
        return min(self.values, key=lambda name: self.values[name], default="")

    @property
    def best_value(self) -> float | None:
        """What the best row reaches."""
        return self.values.get(self.best)

    def as_dict(self) -> dict[str, Any]:
        """Return everything as plain values, ready for JSON."""
        derived = {name: getattr(self, name) for name in ("value", "raw_copy", "best", "best_value")}
        return {**asdict(self), **derived}


def verdict(rows: Sequence[Row]) -> Verdict:
    """Compare the first row with the others by the most telling measure there is."""
    first = rows[0]
    measure = "rmse" if first.rmse is not None else "feasibility_gap" if first.feasibility_gap is not None else ""
    values = {
        row.name: value
        for row in rows
        if (value := _value(row, measure)) is not None and (row is first or row.name != LOOKUP or measure == "rmse")
    }
    mine = values.get(first.name, 0.0)
    return Verdict(
        measure,
        first.name,
        values,
        _recommended(rows, values, measure),
        tuple(row.name for row in rows[1:] if row.name in values and _equal(values[row.name], mine)),
        tuple(_weaknesses(first, rows)),
    )


def _value(row: Row, measure: str) -> float | None:
    if measure == "rmse":
        return None if row.rmse is None else row.rmse.undivided
    return None if not measure or row.feasibility_gap is None else row.feasibility_gap.mean


def _recommended(rows: Sequence[Row], values: dict[str, float], measure: str) -> str:
    """Name the cheapest method that no other undercuts by enough; METHODS are in the order of their cost.

    A lookup is never recommended for its gaps, which are none by construction.
    """
    names = {row.name: row.method if row.method in METHODS else row.name for row in rows if row.name in values}
    own = names.get(rows[0].name)
    offered = {names[row]: value for row, value in values.items() if names[row] in METHODS or names[row] == own}
    if measure != "rmse":
        offered.pop(LOOKUP, None)
    if not offered:
        return ""
    best = min(offered.values())
    order = list(METHODS)
    good = [name for name, value in offered.items() if WORTH_WHILE * value <= best or _equal(value, best)]
    return min(good, key=lambda name: order.index(name) if name in order else len(order))


def _equal(value: float, other: float) -> bool:
    return abs(value - other) <= EQUAL * max(abs(value), abs(other))


def _weaknesses(first: Row, rows: Sequence[Row]) -> list[Weakness]:
    found = []
    steps, kept = first.smoothness, first.structure
    if steps is not None and steps.largest_ratio > ROUGH:
        found.append(Weakness("rough", steps.largest_ratio, ROUGH))
    if steps is not None and steps.median <= STILL:
        found.append(Weakness("staircase", steps.median, STILL))
    if kept is not None and kept.spearman < SHUFFLED:
        found.append(Weakness("shuffled", kept.spearman, SHUFFLED))
    if first.identity is not None and first.identity > RESTLESS:
        beside = next((row.identity for row in rows[1:] if row.name == TRANSPORT), None)
        found.append(Weakness("restless", first.identity, RESTLESS, beside))
    if first.stability is not None and first.stability.rotation_rms > UNSTEADY:
        found.append(Weakness("unsteady", first.stability.rotation_rms, UNSTEADY))
    return found
