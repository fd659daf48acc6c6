"""The baselines without a map of their own: identity and a nearest-neighbor lookup."""

from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from maniport.errors import NotInvertibleError
from maniport.spd.affine_invariant import NeighborIndex, nearest
from maniport.transfer.adapter import DomainAdapter
from maniport.transfer.adapter_file import Attribute, Schema
from maniport.util.sampling import evenly_spaced
from maniport.util.validation import Array, as_count, as_positive_semidefinite


class IdentityMap(DomainAdapter):
    """Express the teacher's ellipsoids in the student's frame, S = R_b T R_bᵀ.

    Parameters
    ----------
    damping, base_rotation
        As in `ParallelTransport`. The teacher's damping is replaced by the student's, which `transform` removes.
    """

    def _fit(self, teacher: Array, student: Array) -> None:
        self._describe(teacher, student)
        self._set_closed_form("nothing to fit")

    def _map(self, points: Array) -> Array:
        return self._exchanged(points, 1.0)

    def _map_back(self, points: Array) -> Array:
        return self._exchanged(points, -1.0)

    def _exchanged(self, points: Array, sign: float) -> Array:
        """Exchange the teacher's damping for the student's, or back."""
        return points + sign * (self.student_damping_ - self.teacher_damping_) * np.eye(
            points.shape[-1]
        )


class NearestNeighbor(DomainAdapter):
    """Map each ellipsoid to the student sample that is paired with the nearest teacher sample.

    The baseline of Reithmeir et al. 2022, § V-B. Every result is a sample of the student, so that it is feasible; but
    the map is piecewise constant, jumps along smooth motions, and has no inverse.

    Parameters
    ----------
    damping, base_rotation
        As in `ParallelTransport`.
    n_samples : int
        Largest number of ellipsoids kept of each domain, taken evenly over its order (5000 in the paper).

    Attributes
    ----------
    cost_ : float
        Root mean squared distance between the samples that are paired.
    keys_, values_ : ndarray, shape (n, d, d)
        The teacher's samples and the student's that are paired with them.
    """

    schema: ClassVar[Schema] = DomainAdapter.schema | {
        "keys_": Attribute(("n", "d", "d"), as_positive_semidefinite),
        "values_": Attribute(("n", "d", "d"), as_positive_semidefinite),
    }

    _index: NeighborIndex

    def __init__(
        self,
        damping: float | None = None,
        base_rotation: ArrayLike | None = None,
        n_samples: int = 5000,
    ) -> None:
        super().__init__(damping, base_rotation)
        self.n_samples = n_samples

    def _fit(self, teacher: Array, student: Array) -> None:
        limit = as_count(self.n_samples, "n_samples", minimum=2)
        keys, values = (points[evenly_spaced(len(points), limit)] for points in (teacher, student))
        index, gap = nearest(keys, values)
        self.keys_ = keys
        self.values_ = values[index]
        self._describe(teacher, student)
        self._set_closed_form("lookup table", float(np.sqrt(np.mean(gap**2))))

    def _settle(self) -> None:
        self._index = NeighborIndex(self.keys_)

    def _map(self, points: Array) -> Array:
        return self.values_[self._index.query(points)[0]]

    def _map_back(self, points: Array) -> Array:
        raise NotInvertibleError(
            "a nearest-neighbor table has no inverse; fit another one with teacher and student exchanged"
        )
