"""The report of a length field: its effect on samples that were held out of the fit."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from maniport.spd.affine_invariant import distance_unchecked
from maniport.spd.ellipsoid import axis_angles
from maniport.spd.matrix_functions import to_vector
from maniport.transfer.length_field.field import LengthsMap, least_singular
from maniport.transfer.length_field.fit import Samples
from maniport.transfer.length_field.inverse import NEAR_SINGULAR
from maniport.util.sampling import rank_correlation

AXIS_MOVED = 10.0
"""Angle between the longest axes of an ellipsoid and of its image above which the axis counts as moved [degrees]."""

# Limits of `FieldReport.failures`, from fits to 13 arms for 3 persons each (table in docs/evaluation.md). The 18 good
# fits (Panda, xArm7, Tiago, Talos, G1 with seven joints, Jaco) have at most 0.07, 0.017 and 0.02, and a rank
# correlation of at least 0.92. The other 21 (UR5, Z1, IRB140, SO-100, iCub, G1 with four or five joints) exceed 0.11
# and 0.037.
MAX_REVERSING = 0.1
MAX_NONMONOTONE = 0.03
MAX_MOVED = 0.05
MIN_RANK_CORRELATION = 0.8


@dataclass(frozen=True)
class FieldReport:
    """Effect of a length field on the teacher's samples that were held out of the fit."""

    held_out: int  # number of samples held out; zero where the values are those at samples of the fit
    gap: float  # distance from their images to the nearest feasible ellipsoids, mean
    gap_p95: float  # and 95th percentile
    moved: float  # mean distance from the images of the map without a field
    step: float  # median distance between the images of two neighbors over that between the two
    rank_correlation: float  # rank correlation of all distances between images and between the samples
    turn: float  # median angle from the image's longest axis to the nearest axis of the sample [degrees]
    singular_value: float  # smallest of the map's derivative, see `LengthField.singular_values`
    near_singular: float  # fraction of the samples where the map folds, or nearly so
    moved_axes: float  # fraction whose longest axis is more than 10° from the image's; 0 where none is distinct
    reversing: float  # fraction where the determinant of the map's derivative is negative
    nonmonotone: float  # fraction where lengthening an axis shortens the image's

    @property
    def invertible(self) -> bool:
        """Whether the map folds at none of the samples; between them it may."""
        return self.near_singular == 0.0

    def failures(self) -> tuple[str, ...]:
        """Return the checks that the map fails, with value and limit; empty where it may be used."""
        at_most = (
            ("orientation-reversing at {:.0%} of the samples", self.reversing, MAX_REVERSING),
            ("own-axis slope not positive at {:.0%}", self.nonmonotone, MAX_NONMONOTONE),
            (f"longest axis moved by more than {AXIS_MOVED:g}° at {{:.0%}}", self.moved_axes, MAX_MOVED),
        )
        failed = [f"{text.format(value)} (limit {limit:.0%})" for text, value, limit in at_most if value > limit]
        if self.rank_correlation < MIN_RANK_CORRELATION:
            failed.append(f"rank correlation of distances {self.rank_correlation:.2f} (limit {MIN_RANK_CORRELATION:g})")
        return tuple(failed)

    def in_words(self) -> str:
        """Return it as one line."""
        where = f"at {self.held_out} held-out samples" if self.held_out else "at the samples of the fit"
        folds = "folds at none" if self.invertible else f"folds at {100 * self.near_singular:.1f} %"
        return (
            f"{where}: gap {self.gap:.3f} (95 % below {self.gap_p95:.3f}), lengths moved by {self.moved:.3f}, steps "
            f"{self.step:.2f} of their own, rank correlation {self.rank_correlation:.3f}, longest axis rotated by "
            f"{self.turn:.1f}° "
            f"(median) and moved by more than {AXIS_MOVED:g}° at {self.moved_axes:.0%}, orientation-reversing at "
            f"{self.reversing:.0%}, own-axis slope not positive at {self.nonmonotone:.0%}, least singular value "
            f"{self.singular_value:.2f} ({folds})"
        )

    def __repr__(self) -> str:
        return f"FieldReport({self.in_words()})"

    @classmethod
    def read(cls, plain: dict[str, Any]) -> "FieldReport":
        """Return the report of the values in a file; ValueError or TypeError where they are not numbers."""
        report = cls(**plain)
        report.in_words()
        return report


def reported(field: LengthsMap, samples: Samples, held_out: int) -> FieldReport:
    """Measure a field at samples."""
    points, images = samples.points, field.apply(samples.points)
    for _ in range(2):  # the second search also starts from what was found for neighbors
        nearest, _ = samples.projected(images)
    gaps, rigid = distance_unchecked(images, nearest), field.unscaled().apply(points)
    first, other = np.triu_indices(len(points), 1)
    apart, own = (distance_unchecked(each[first], each[other]) for each in (images, points))
    near = own <= np.percentile(own, 1.0)
    varied = min(np.ptp(apart), np.ptp(own)) > 0.0
    values, vectors = field.base(points)
    slopes = field.slopes(values, vectors)
    singular, moved = least_singular(slopes), axis_angles(images, points, -1)
    along = to_vector(np.einsum("nik,njk->nkij", vectors, vectors))  # (n, d, D): vec v vᵀ for each axis v
    return FieldReport(
        held_out=held_out,
        gap=float(gaps.mean()),
        gap_p95=float(np.percentile(gaps, 95)),
        moved=float(distance_unchecked(rigid, images).mean()),
        step=float(np.median(apart[near] / np.maximum(own[near], 1e-12))),
        rank_correlation=rank_correlation(apart, own) if varied else 1.0,
        turn=0.0,  # a field of lengths keeps all axes
        singular_value=float(singular.min()),
        near_singular=float(np.mean(singular <= NEAR_SINGULAR)),
        moved_axes=float(np.mean(moved > AXIS_MOVED)) if len(moved) else 0.0,
        reversing=float(np.mean(singular < 0.0)),
        nonmonotone=float(np.mean(np.einsum("nki,nij,nkj->nk", along, slopes, along).min(axis=1) <= 0.0)),
    )
