"""Evaluation: what measuring an adapter beside the cheap alternatives gives."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from maniport.errors import unknown_name
from maniport.evaluation.measures import RMSE, Smoothness, Structure
from maniport.evaluation.reliability import Stability
from maniport.evaluation.verdict import Verdict, verdict
from maniport.notebook import ShownInNotebooks
from maniport.validation import Array


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
class Evaluation(ShownInNotebooks):
    """All measures of an adapter beside those of the cheap alternatives.

    Attributes
    ----------
    rows : tuple of Row
        The adapter first, then the alternatives.
    student_noise : Row
        The same measures where they make sense of fresh samples of the student itself: what sampling alone costs.
    settings : dict
        Sizes, regularisation, seed, and where draws came from; ready for JSON.
    """

    rows: tuple[Row, ...]
    student_noise: Row
    settings: dict[str, Any] = field(default_factory=dict)

    def __repr__(self) -> str:
        best = self.verdict.best
        return (
            f"Evaluation({self.adapter.name!r} beside {len(self.rows) - 1} alternatives{best and f'; best: {best!r}'})"
        )

    @property
    def adapter(self) -> Row:
        """The row of the adapter that was evaluated."""
        return self.rows[0]

    @property
    def verdict(self) -> Verdict:
        """Whether the adapter is better than doing nothing, and what to take instead."""
        return verdict(self.rows)

    def row(self, name: str) -> Row:
        """Return the row of that name; `UnknownNameError` where there is none."""
        named = {row.name: row for row in self.rows}
        if name not in named:
            raise unknown_name("row", str(name), named)
        return named[name]
