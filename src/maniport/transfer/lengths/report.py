"""What a fit of the lengths field tells of itself, at samples that it has not seen."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from maniport.errors import FileFormatError
from maniport.spd.affine_invariant import distance_unchecked
from maniport.spd.kernels import eigh
from maniport.transfer.lengths.field import LengthsMap
from maniport.transfer.lengths.fit import Samples
from maniport.transfer.lengths.inverse import FOLDED
from maniport.validation import Array

ASKED = 2
"""How often the nearest ellipsoids are asked for, each time also from where those of alike ones were found."""
NEAR = 0.01
"""Share of the pairs of samples that count as neighbors."""
TINY = 1e-12


@dataclass(frozen=True)
class FieldReport:
    """What a lengths field does to the teacher's samples that were set apart from the fit.

    Attributes
    ----------
    held_out : int
        Number of samples set apart; all else is measured at them, or at those of the fit where it is zero.
    gap, gap_p95 : float
        Distance from their images to the nearest ellipsoids that the projector tells, mean and 95th percentile.
    moved : float
        Mean distance from the images of the map without a field.
    step : float
        Median distance between the images of two neighbors over that between the two.
    structure : float
        Rank correlation of all distances between images and between the samples: 1 where near stays near.
    turn : float
        Median angle from the image's longest axis to the nearest axis of the sample [degrees].
    singular_value : float
        Smallest of the map's derivative, see `LengthsField.singular_values`.
    folded : float
        Share of the samples where the map folds, or nearly so.
    agreement : float or None
        Mean distance between the images of two fits, each to one half of the samples; None where not asked for.
    """

    held_out: int
    gap: float
    gap_p95: float
    moved: float
    step: float
    structure: float
    turn: float
    singular_value: float
    folded: float
    agreement: float | None = None

    @property
    def invertible(self) -> bool:
        """Whether the map folds at none of the samples; between them it may."""
        return self.folded == 0.0

    def in_words(self) -> str:
        """Say it in a line."""
        where = f"at {self.held_out} samples set apart" if self.held_out else "at the samples of the fit"
        agreement = "" if self.agreement is None else f", two half-fits {self.agreement:.3f} apart"
        folds = "folds at none" if self.invertible else f"folds at {100 * self.folded:.1f} %"
        return (
            f"{where}: gap {self.gap:.3f} (95 % below {self.gap_p95:.3f}), lengths moved by {self.moved:.3f}, steps "
            f"{self.step:.2f} of their own, structure {self.structure:.3f}, longest axis turned by {self.turn:.1f}°, "
            f"least singular value {self.singular_value:.2f} ({folds}){agreement}"
        )

    def __repr__(self) -> str:
        return f"FieldReport({self.in_words()})"

    @classmethod
    def read(cls, path: Any, plain: Any) -> "FieldReport":
        """Make one of what a file held."""
        try:
            report = cls(**plain)
            report.in_words()
        except (TypeError, ValueError) as error:
            raise FileFormatError(f"{str(path)!r} is a damaged adapter file: {error}") from None
        return report


def reported(field: LengthsMap, samples: Samples, points: Array, held_out: int, agreement: float | None) -> FieldReport:
    """Measure a field at ellipsoids of the teacher (n, d, d), damped, in the student's frame, and their `samples`."""
    for _ in range(ASKED):
        images, found, _ = samples.asked(field)
    gaps, rigid = distance_unchecked(images, found), samples.plain.apply(points)
    from scipy.stats import spearmanr  # slow to load

    first, other = np.triu_indices(len(points), 1)
    apart, own = (distance_unchecked(each[first], each[other]) for each in (images, points))
    near = own <= np.percentile(own, 100.0 * NEAR)
    varied = min(np.ptp(apart), np.ptp(own)) > 0.0
    kept = np.abs(np.einsum("nji,nj->ni", samples.vectors, eigh(images)[1][..., -1])).max(axis=1)
    singular = field.singular_values(points)
    return FieldReport(
        held_out,
        float(gaps.mean()),
        float(np.percentile(gaps, 95)),
        float(distance_unchecked(rigid, images).mean()),
        float(np.median(apart[near] / np.maximum(own[near], TINY))),
        float(spearmanr(apart, own).statistic) if varied else 1.0,
        float(np.degrees(np.median(np.arccos(np.minimum(kept, 1.0))))),
        float(singular.min()),
        float(np.mean(singular <= FOLDED)),
        agreement,
    )
