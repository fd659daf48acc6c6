"""What a fit of the lengths field does with the teacher's samples: divides them, fits to some, reports on others."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from maniport.errors import InvalidInputError
from maniport.spd.affine_invariant import distance_unchecked
from maniport.spd.kernels import compose
from maniport.spd.matrix_functions import to_vector
from maniport.subsample import evenly_spaced
from maniport.transfer.lengths.field import LengthsMap
from maniport.transfer.lengths.fit import TIE, Samples, centers_among, fitted
from maniport.transfer.lengths.report import FieldReport, reported
from maniport.validation import Array

CENTERS = 300
"""Most centres of the field, where nothing else is asked for."""
HELD_OUT, SHARE, FEWEST = 400, 8, 16
"""Samples that are set apart at most, one of so many, and none where that leaves fewer than these; nor are there more
for the turns."""


@dataclass(frozen=True)
class FitPlan:
    """What is asked of a fit; the arguments of `LengthsField`, checked.

    Attributes
    ----------
    base : LengthsMap
        Without centres.
    projector : Projector or SearchingProjector
    damping : float
        ε of the student.
    n_centers : int or None
    ridge : float
    rounds : int
    turn : bool
    """

    base: LengthsMap
    projector: Any
    damping: float
    n_centers: int | None
    ridge: float
    rounds: int
    turn: bool

    def divided(self, teacher: Array, most: int) -> tuple[Array, Array, Array]:
        """Divide ellipsoids (n, d, d) into those to fit to, more of them, and some set apart; alike in any order."""
        values, vectors = self.base.base(teacher)
        keys = np.column_stack([values.sum(axis=1), values, to_vector(compose(values, vectors))])
        order = np.lexsort(np.round(keys / TIE).T[::-1])  # the axes decide between samples of equal eigenvalues
        count = min(HELD_OUT, len(order) // SHARE)
        apart = evenly_spaced(len(order), count) if count >= FEWEST else evenly_spaced(0, 0)
        rest = np.delete(order, apart)
        seen = evenly_spaced(len(rest), most)
        more = np.delete(rest, seen)
        return teacher[rest[seen]], teacher[more[evenly_spaced(len(more), most)]], teacher[order[apart]]

    def fitted(self, points: Array, more: Array) -> tuple[LengthsMap, list[float]]:
        """Fit a field to ellipsoids, and its turns to `more`, too; see `maniport.transfer.lengths.fit.fitted`."""
        x = self._vectors(points)
        count = min(CENTERS, len(x)) if self.n_centers is None else self.n_centers
        if count > len(x):
            raise InvalidInputError(f"n_centers must be at most the number of samples, {len(x)}; found {count}")
        centers = x[centers_among(x, count)]
        plain = replace(self.base, centers=centers, lengths=np.zeros((count, self.base.lengths.shape[1])))
        samples = self._samples(plain, points)
        others = self._samples(plain, more) if self.turn and len(more) >= FEWEST else None
        return fitted(samples, others, self.ridge, self.rounds, self.turn)

    def reported(self, field: LengthsMap, seen: Array, more: Array, apart: Array, halves: bool) -> FieldReport:
        """Measure a field at ellipsoids that were set apart, or at some of the fit where there are none."""
        points, agreement = apart if len(apart) else seen[:HELD_OUT], None
        if halves:
            images = [self.fitted(seen[half::2], more[half::2])[0].apply(points) for half in range(2)]
            agreement = float(distance_unchecked(*images).mean())
        plain = replace(field, lengths=0.0 * field.lengths, turns=field.turns[:0])
        return reported(field, self._samples(plain, points), points, len(apart), agreement)

    def _samples(self, plain: LengthsMap, points: Array) -> Samples:
        return Samples.of(plain, points, self.projector, self.damping)

    def _vectors(self, points: Array) -> Array:
        return to_vector(compose(*self.base.base(points)))
