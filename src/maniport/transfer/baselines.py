"""The baselines: identity, matching the means, and a nearest-neighbor lookup."""

from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from maniport.errors import NotInvertibleError
from maniport.spd.neighbors import NeighborIndex, nearest
from maniport.transfer.adapter import RELEASED, DomainAdapter
from maniport.transfer.adapter_file import Attribute, Schema
from maniport.transfer.rigid_adapter import RigidAdapter
from maniport.util.sampling import evenly_spaced
from maniport.util.validation import Array, as_count, as_positive_semidefinite


class IdentityMap(DomainAdapter):
    """Return the teacher's ellipsoids in the student's frame, S = R_b T R_bᵀ.

    Parameters
    ----------
    damping, eigenvalue_floor, base_rotation
        As in `ParallelTransport`. Damping is only exchanged for the student's, which `transform` takes off again.
    """

    def _fit(self, teacher: Array, student: Array) -> None:
        self._describe(teacher, student)
        self.released_damping_ = RELEASED * self.student_damping_
        self._set_closed_form("nothing to fit")

    def _map(self, points: Array) -> tuple[Array, float]:
        return self._exchanged(points, 1.0), self.released_damping_

    def _map_back(self, points: Array) -> Array:
        return self._exchanged(points, -1.0)

    def _exchanged(self, points: Array, sign: float) -> Array:
        """Exchange the teacher's damping for the student's, or back."""
        return points + sign * (self.student_damping_ - self.teacher_damping_) * np.eye(points.shape[-1])


class MeanTransport(RigidAdapter):
    """Match the means only: f(T) = S̄^½ T̄^-½ T T̄^-½ S̄^½, without rotation and dilation.

    Parameters
    ----------
    damping, eigenvalue_floor, base_rotation
        As in `ParallelTransport`, which also rotates, by the polar factor of S̄^-½ T̄^½.
    """

    scale, dispersion, recenter = False, "mean", "training"

    def _fit_rotation(self, teacher: Array, student: Array) -> None:
        self.rotation_ = np.eye(teacher.shape[-1])
        self._set_closed_form("closed form")


class NearestNeighbor(DomainAdapter):
    """Look ellipsoids up: nearest teacher sample, then that sample's nearest student sample.

    The baseline of Reithmeir et al. 2022, § V-B. Every result is a sample of the student, so that it is feasible; but
    the map is piecewise constant, jumps along smooth motions, and has no inverse.

    Parameters
    ----------
    damping, eigenvalue_floor, base_rotation
        As in `ParallelTransport`.
    n_samples : int
        Largest number of ellipsoids kept of each domain, taken evenly over its order (5000 in the paper).

    Attributes
    ----------
    cost_ : float
        Root mean squared distance between the samples that are paired.
    keys_, values_ : ndarray, shape (n, d, d)
        The teacher's samples and the student's that are paired with them.

    References
    ----------
    Reithmeir, Figueredo and Haddadin, Human-to-robot manipulability domain adaptation with parallel transport and
    manifold-aware ICP, IROS 2022.
    """

    schema: ClassVar[Schema] = DomainAdapter.schema | {
        "keys_": Attribute(("n", "d", "d"), as_positive_semidefinite),
        "values_": Attribute(("n", "d", "d"), as_positive_semidefinite),
    }

    _index: NeighborIndex | None = None

    def __init__(
        self,
        damping: float | None = None,
        eigenvalue_floor: float | None = None,
        base_rotation: ArrayLike | None = None,
        n_samples: int = 5000,
    ):
        super().__init__(damping, eigenvalue_floor, base_rotation)
        self.n_samples = n_samples

    def _fit(self, teacher: Array, student: Array) -> None:
        limit = as_count(self.n_samples, "n_samples", minimum=2)
        keys, values = (points[evenly_spaced(len(points), limit)] for points in (teacher, student))
        index, gap = nearest(keys, values)
        self.keys_, self.values_ = keys, values[index]
        self._describe(teacher, student)
        self._set_closed_form("lookup table", float(np.sqrt(np.mean(gap**2))))
        self.released_damping_ = RELEASED * self.student_damping_  # every entry of the table carries all of it

    def _map(self, points: Array) -> tuple[Array, float]:
        if self._index is None or self._index.points is not self.keys_:  # built at its first use, not saved
            self._index = NeighborIndex(self.keys_)
        index, _ = self._index.query(points)
        return self.values_[index], self.released_damping_

    def _map_back(self, points: Array) -> Array:
        raise NotInvertibleError(
            "a nearest-neighbor table has no inverse; fit another one with teacher and student exchanged"
        )
