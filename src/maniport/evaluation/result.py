"""Evaluation: what measuring an adapter beside the cheap alternatives gives."""

from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from maniport.errors import unknown_name
from maniport.evaluation.measures import RMSE, Smoothness, Structure
from maniport.evaluation.page import cells, in_words, page
from maniport.evaluation.reliability import Stability
from maniport.evaluation.verdict import Verdict, verdict
from maniport.notebook import Grid, ShownInNotebooks
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
        return f"Evaluation({self.adapter.name!r} beside {len(self.rows) - 1} alternatives: {in_words(self.verdict)})"

    def _facts(self) -> dict[str, object]:
        return {"adapter": self.adapter.name, "verdict": in_words(self.verdict)}

    def _grid(self) -> Grid:
        head, table = cells(self)
        return Grid(("", *head), table)

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

    def as_dict(self) -> dict[str, Any]:
        """Return everything as plain numbers, lists and dicts, ready for JSON; infinity becomes None."""
        table = {
            "verdict": self.verdict.as_dict(),
            "settings": self.settings,
            "student_noise": asdict(self.student_noise),
            "rows": [_with_ratios(row) for row in self.rows],
        }
        return dict(_plain(table))

    def as_markdown(self, title: str = "", level: int = 1, legend: bool = True) -> str:
        """Write a page: the verdict, then one table, then what its columns mean.

        Parameters
        ----------
        title : str
            Heading. Default: the adapter's name.
        level : int
            Level of the heading.
        legend : bool
            Whether to say what the columns mean.
        """
        return page(self, title or self.adapter.name, level, legend)


def _with_ratios(row: Row) -> dict[str, Any]:
    plain = asdict(row)
    if row.smoothness is not None:
        plain["smoothness"] |= {
            "largest_ratio": row.smoothness.largest_ratio,
            "median_ratio": row.smoothness.median_ratio,
        }
    return plain


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if isinstance(value, np.generic):
        value = value.item()
    return None if isinstance(value, float) and not np.isfinite(value) else value
