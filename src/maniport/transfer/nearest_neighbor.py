"""The naive baseline: a table from each teacher sample to its nearest student sample."""

import numpy as np
from numpy.typing import ArrayLike

from maniport.errors import NotInvertibleError
from maniport.spd.neighbors import NeighborIndex, nearest
from maniport.subsample import evenly_spaced
from maniport.transfer.adapter import RELEASED, DomainAdapter
from maniport.validation import Array, as_count


class NearestNeighbor(DomainAdapter):
    """Look ellipsoids up: nearest teacher sample, then that sample's nearest student sample.

    The baseline of Reithmeir et al. 2022, § V-B. Every result is an ellipsoid that the student was sampled with, so
    it is feasible; but the map is a staircase, jumps along smooth motions, and has no inverse.

    Parameters
    ----------
    damping, floor, mounting
        As in `ParallelTransport`.
    n_samples : int
        Largest number of ellipsoids kept of each domain, taken evenly over its order (5000 in the paper).

    Attributes
    ----------
    cost_ : float
        Root mean squared distance between the samples that are paired.
    rotation_, dispersion_ratio_
        The identity and one: nothing is turned or scaled.

    See Also
    --------
    DomainAdapter : the other fitted attributes.

    References
    ----------
    Reithmeir, Figueredo and Haddadin, Human-to-robot manipulability domain adaptation with parallel transport and
    manifold-aware ICP, IROS 2022.
    """

    _index: NeighborIndex | None = None

    def __init__(
        self,
        damping: float | None = None,
        floor: float | None = None,
        mounting: ArrayLike | None = None,
        n_samples: int = 5000,
    ):
        super().__init__(damping, floor, mounting)
        self.n_samples = n_samples

    def _fit(self, teacher: Array, student: Array) -> None:
        limit = as_count(self.n_samples, "n_samples", minimum=2)
        keys, values = (points[evenly_spaced(len(points), limit)] for points in (teacher, student))
        index, gap = nearest(keys, values)
        self.keys_, self.values_ = keys, values[index]
        self._describe(teacher, student)
        self._found_at_once("nothing is searched for: each is looked up", float(np.sqrt(np.mean(gap**2))))
        self.released_damping_ = RELEASED * self.student_damping_  # every entry of the table carries all of it

    def _map(self, points: Array) -> tuple[Array, float]:
        index, _ = self._neighbors().query(points)
        return self.values_[index], self.released_damping_

    def _neighbors(self) -> NeighborIndex:
        """The search tree of the table, built at its first use; it is not saved with the adapter."""
        if self._index is None or self._index.points is not self.keys_:
            self._index = NeighborIndex(self.keys_)
        return self._index

    def _map_back(self, points: Array) -> Array:
        raise NotInvertibleError(
            "a nearest-neighbour table has no inverse; fit another one with teacher and student exchanged"
        )
