"""The verdict on the rows of a comparison, as data: what is best, what is recommended, what is wrong."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

from maniport.evaluation.rows import LOOKUP, RAW_COPY, Row
from maniport.evaluation.rule import Weakness, equal, recommended, weaknesses


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
        Method to take by `maniport.evaluation.rule`, by its name in `maniport.transfer.METHODS` where it has one. Empty
        where nothing is compared.
    same_as : tuple of str
        Rows that do the same as the adapter: it does no more than they do.
    weaknesses : tuple of Weakness
        Of the adapter.

    See Also
    --------
    Evaluation : has one.
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
        recommended(rows, values, measure),
        tuple(row.name for row in rows[1:] if row.name in values and equal(values[row.name], mine)),
        tuple(weaknesses(first, rows)),
    )


def _value(row: Row, measure: str) -> float | None:
    if measure == "rmse":
        return None if row.rmse is None else row.rmse.undivided
    return None if not measure or row.feasibility_gap is None else row.feasibility_gap.mean
