"""Evaluation: what measuring an adapter beside the cheap alternatives gives."""

from dataclasses import dataclass, field
from typing import Any

from maniport.errors import unknown_name
from maniport.evaluation.verdict import Row, Verdict, verdict
from maniport.notebook import ShownInNotebooks


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
