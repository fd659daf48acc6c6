"""Optimal transport of the axes' lengths: the axes are kept, the spectra become those of the student."""

from itertools import permutations

import numpy as np
from numpy.typing import ArrayLike

from maniport.errors import InvalidInputError, NotInvertibleError
from maniport.spd.kernels import compose, eigh
from maniport.transfer.adapter import DomainAdapter
from maniport.transfer.cloud_pair import thinned
from maniport.transfer.entropic_map import EntropicMap
from maniport.transfer.lengths.field import KAPPA
from maniport.transfer.release import released
from maniport.validation import Array, as_count, as_number

LARGEST = 3
"""Size of the ellipsoids up to which all orders of the axes are gone through."""

SMALLEST_SPREAD = 1e-12
"""Variance of logarithms that entropy is measured by at least, for students whose spectra are all equal."""


class SpectralTransport(DomainAdapter):
    """Keep the axes and transport the logarithms of their squared lengths from the teacher's domain to the student's.

    The spectra are first dilated to the student's dispersion and moved to its mean volume; then the debiased entropic
    transport map (`maniport.transfer.entropic_map`) moves them to the student's. It treats all orders of the axes
    alike, so that the map is smooth where axes are equally long. It knows which spectra the student has, but not at
    which axes. A row of the comparison, which `maniport.transfer.LengthsField` is measured against.

    Parameters
    ----------
    damping, floor, mounting
        As in `ParallelTransport`.
    entropy : float
        ε over the mean squared distance of the student's spectra to their mean, times two.
    n_samples : int
        Spectra of each domain that are transported.

    Raises
    ------
    InvalidInputError
        From `fit`, for ellipsoids larger than 3×3, whose axes have too many orders.

    See Also
    --------
    LengthsField : changes lengths as well, toward what the student can make.
    DomainAdapter : the other fitted attributes.
    """

    def __init__(
        self,
        damping: float | None = None,
        floor: float | None = None,
        mounting: ArrayLike | None = None,
        entropy: float = 0.1,
        n_samples: int = 512,
    ):
        super().__init__(damping, floor, mounting)
        self.entropy = entropy
        self.n_samples = n_samples

    def _fit(self, teacher: Array, student: Array) -> None:
        limit, share = as_count(self.n_samples, "n_samples", minimum=2), as_number(self.entropy, "entropy", above=0.0)
        if (d := teacher.shape[-1]) > LARGEST:
            raise InvalidInputError(f"teacher must hold ellipsoids of at most {LARGEST}×{LARGEST}; found {d}×{d}")
        self._describe(teacher, student)
        self.dispersion_ratio_ = self.student_dispersion_ / self.teacher_dispersion_
        own, other = (np.log(eigh(points)[0]) for points in (teacher, student))
        self.shift_ = float(other.mean() - self.dispersion_ratio_ * own.mean())
        start, end = thinned(self._moved(own), limit), thinned(other, limit)
        spread = max(float(np.sum(np.var(other, axis=0))), SMALLEST_SPREAD)
        found = EntropicMap.of(_orders(start), _orders(end), 2.0 * share * spread)
        self.start_, self.end_, self.epsilon_ = start, end, found.epsilon
        self.start_potential_, self.end_potential_ = found.start_potential, found.end_potential
        self.released_damping_ = (1.0 - np.sqrt(KAPPA)) * self.student_damping_  # off an eigenvalue of ε
        self._found_at_once(f"transport between {len(start)} and {len(end)} spectra")

    def _moved(self, logs: Array) -> Array:
        return self.dispersion_ratio_ * logs + self.shift_

    def _map(self, points: Array) -> tuple[Array, float]:
        values, axes = eigh(points)
        transport = EntropicMap(
            _orders(self.start_), _orders(self.end_), self.start_potential_, self.end_potential_, self.epsilon_
        )
        lengths = np.exp(transport(self._moved(np.log(values))))
        return compose(lengths, axes), self.released_damping_

    def _images(self, points: Array) -> Array:
        return released(self._map(points)[0], float(self.student_damping_))

    def _map_back(self, points: Array) -> Array:
        raise NotInvertibleError("a transport with entropy has no inverse; fit one with teacher and student exchanged")


def _orders(spectra: Array) -> Array:
    """All orders of each spectrum (n, d), shape (n, d!, d)."""
    return spectra[:, np.array(list(permutations(range(spectra.shape[1]))))]
