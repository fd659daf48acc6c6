"""Tables I, II and III of Reithmeir et al. 2022 (arXiv 2208.07588), row by row, and how every row is fitted again.

There are two ways: as the paper did, and as maniport does by default.
"""

import csv
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.resources import files

from numpy.typing import ArrayLike

from maniport.transfer import DomainAdapter, EllipsoidCorrespondence, ParallelTransport, RiemannianICP
from maniport.util.defaults import DAMPING
from maniport.util.validation import as_choice

PAPER, OURS = "ours, paper's settings", "ours, defaults"  # How a row is fitted and measured

TRAJECTORIES, RANDOM = "trajectories", "random"


@dataclass(frozen=True)
class PaperRow:
    """One row of a table of the paper."""

    table: str  # Roman number
    row: int  # counted from the top, beginning with 1
    data: str  # the domains of the fit: trajectories or random samples
    samples: int  # of each domain
    method: str  # as printed
    rmse: Mapping[str, float]  # by evaluation set; divided by the dispersion of the mapped set (eq. 19)
    start: str  # of ICP, see `maniport.RiemannianICP`
    exponent: float | None  # k of the weights w^k; None for parallel transport without ICP
    most_singular: int | None  # samples that are matched, when not all
    iterations: int | None  # until convergence, where printed

    @property
    def label(self) -> str:
        """Number of samples, as the paper writes it."""
        return f"{self.most_singular} most singular of {self.samples}" if self.most_singular else str(self.samples)


TOY = ("10 new points",)
EVALUATIONS = {
    "I": TOY,
    "II": tuple(f"M-Eval-{i}" for i in range(1, 4)),
    "III": tuple(f"H-Eval-{i}" for i in range(1, 5)),
}
"""Sets that the maps of each table are evaluated on, in the order of its columns."""


def paper_table(number: str) -> tuple[PaperRow, ...]:
    """Rows of Table I, II or III, from the top, as in `printed.csv` next to this module."""
    names = EVALUATIONS[as_choice(number, "table", tuple(EVALUATIONS))]
    lines = (files(__package__) / "printed.csv").read_text(encoding="utf-8").splitlines()
    rows = [line for line in csv.DictReader(lines[1:]) if line["table"] == number]
    return tuple(
        PaperRow(
            number,
            place,
            row["data"],
            int(row["samples"]),
            row["method"],
            dict(zip(names, map(float, row["errors"].split()), strict=True)),
            row["start"],
            float(row["exponent"]) if row["exponent"] else None,
            int(row["most_singular"]) if row["most_singular"] else None,
            int(row["iterations"]) if row["iterations"] else None,
        )
        for place, row in enumerate(rows, start=1)
    )


def paper_adapter(row: PaperRow) -> DomainAdapter:
    """Return the adapter that a row of the paper was made with, by the paper's text."""
    if row.exponent is None:
        return ParallelTransport()
    return RiemannianICP(
        correspondence=EllipsoidCorrespondence(row.exponent),
        start=row.start,
        require_improvement=False,
        most_singular=row.most_singular,
    )


def our_adapter(
    row: PaperRow, base_rotation: ArrayLike | None = None, damping: float | None = DAMPING
) -> DomainAdapter:
    """Return the same method with the library's defaults and, where it is known, the base_rotation of the student."""
    if row.exponent is None:
        return ParallelTransport(damping, base_rotation)
    return RiemannianICP(damping, base_rotation, most_singular=row.most_singular)
