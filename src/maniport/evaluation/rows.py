"""The rows of a comparison, as data: what was measured of each method."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from maniport.evaluation.measures import RMSE, Smoothness, Structure
from maniport.evaluation.reliability import Stability
from maniport.validation import Array

RAW_COPY, RECENTRING, TRANSPORT, LOOKUP = "raw-copy", "recentring", "parallel-transport", "nearest-neighbor"
"""Rows are called by the names in `maniport.transfer.METHODS`."""


@dataclass(frozen=True)
class Gaps:
    """Mean, median, 95th percentile and largest of distances or errors, and which one is the largest.

    The mean is what adapters are compared by: where half of a profile is feasible the median tells nothing.

    Attributes
    ----------
    mean, median, p95, largest : float
    where : int
        Row of the largest.

    See Also
    --------
    Row : has several.
    """

    mean: float
    median: float
    p95: float
    largest: float = np.nan
    where: int = 0

    @classmethod
    def of(cls, distances: Array, rows: NDArray[np.intp] | None = None) -> "Gaps":
        """Summarise distances, shape (n,); `rows` are their numbers, where they are not counted from 0."""
        mean, median, p95 = float(np.mean(distances)), float(np.median(distances)), float(np.percentile(distances, 95))
        worst = int(np.argmax(distances))
        return cls(mean, median, p95, float(distances[worst]), worst if rows is None else int(rows[worst]))


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
        Of the profile, and of samples of the teacher's domain, held out of the fit where the teacher's arm is known;
        None without the student's kinematics.
    smoothness : Smoothness or None
    structure : Structure or None
        None where the teacher's ellipsoids do not change.
    energy_distance : float or None
        From the mapped domain of the teacher to the student's.
    identity : float or None
        Identity test, RMSE undivided; truth 0.
    stability : Stability or None
    failures : tuple of str
        Checks that the fit of a length field fails, see `FieldReport.failures`.
    warnings : tuple of str
        What its fits warned of, each once.

    See Also
    --------
    Evaluation : has a row for every adapter.
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
    failures: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
