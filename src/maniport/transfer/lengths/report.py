"""What a fit of the lengths field tells of itself, at samples that it has not seen."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from maniport.errors import FileFormatError
from maniport.spd.affine_invariant import distance_unchecked
from maniport.spd.ellipsoid import axis_angles
from maniport.spd.kernels import eigh
from maniport.spd.matrix_functions import to_vector
from maniport.transfer.lengths.field import LengthsMap, least_singular
from maniport.transfer.lengths.fit import Samples
from maniport.transfer.lengths.inverse import FOLDED
from maniport.validation import Array

ASKED = 2
"""How often the nearest ellipsoids are asked for, each time also from where those of alike ones were found."""
NEAR = 0.01
"""Share of the pairs of samples that count as neighbors."""
TINY = 1e-12
AXIS_MOVED = 10.0
"""Angle between the longest axes of an ellipsoid and of its image above which the axis counts as moved [degrees]."""
MOST_REVERSING, MOST_CONTRARY, MOST_MOVED, LEAST_STRUCTURE = 0.1, 0.03, 0.05, 0.8
"""Limits of `FieldReport.failures`, from fits to 13 arms for 3 persons each (table in docs/evaluation.md). The 18 good
fits (Panda, xArm7, Tiago, Talos, G1 with seven joints, Jaco) have at most 0.07, 0.017 and 0.02, and a structure of at
least 0.92. The other 21 (UR5, Z1, IRB140, SO-100, iCub, G1 with four or five joints) exceed 0.11 and 0.037."""


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
    moved_axes : float
        Fraction of the samples whose longest axis is more than 10° from the image's; 0 where none is distinct.
    reversing : float
        Fraction of the samples where the map reverses orientation: the determinant of its derivative is negative.
    contrary : float
        Fraction of the samples where some own-axis slope is not positive: lengthening the axis shortens its image.
        These three are nan in adapter files that do not hold them.
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
    moved_axes: float = np.nan
    reversing: float = np.nan
    contrary: float = np.nan

    @property
    def invertible(self) -> bool:
        """Whether the map folds at none of the samples; between them it may."""
        return self.folded == 0.0

    def failures(self) -> tuple[str, ...]:
        """Return the checks that the map fails, with value and limit; empty where it may be used."""
        at_most = (
            ("orientation-reversing at {:.0%} of the samples", self.reversing, MOST_REVERSING),
            ("own-axis slope not positive at {:.0%}", self.contrary, MOST_CONTRARY),
            (f"longest axis moved by more than {AXIS_MOVED:g}° at {{:.0%}}", self.moved_axes, MOST_MOVED),
        )
        failed = [f"{text.format(value)} (limit {limit:.0%})" for text, value, limit in at_most if value > limit]
        if self.structure < LEAST_STRUCTURE:
            failed.append(f"rank correlation of distances {self.structure:.2f} (limit {LEAST_STRUCTURE:g})")
        return tuple(failed)

    def in_words(self) -> str:
        """Say it in a line."""
        where = f"at {self.held_out} samples set apart" if self.held_out else "at the samples of the fit"
        agreement = "" if self.agreement is None else f", two half-fits {self.agreement:.3f} apart"
        folds = "folds at none" if self.invertible else f"folds at {100 * self.folded:.1f} %"
        return (
            f"{where}: gap {self.gap:.3f} (95 % below {self.gap_p95:.3f}), lengths moved by {self.moved:.3f}, steps "
            f"{self.step:.2f} of their own, structure {self.structure:.3f}, longest axis turned by {self.turn:.1f}° "
            f"(median) and moved by more than {AXIS_MOVED:g}° at {self.moved_axes:.0%}, orientation-reversing at "
            f"{self.reversing:.0%}, own-axis slope not positive at {self.contrary:.0%}, least singular value "
            f"{self.singular_value:.2f} ({folds}){agreement}"
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
    values, vectors = field.base(points)
    slopes = field.slopes(values, vectors)
    singular, moved = least_singular(slopes), axis_angles(images, points, -1)
    along = to_vector(np.einsum("nik,njk->nkij", vectors, vectors))  # (n, d, D): vec v vᵀ for each axis v
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
        float(np.mean(moved > AXIS_MOVED)) if len(moved) else 0.0,
        float(np.mean(singular < 0.0)),
        float(np.mean(np.einsum("nki,nij,nkj->nk", along, slopes, along).min(axis=1) <= 0.0)),
    )
