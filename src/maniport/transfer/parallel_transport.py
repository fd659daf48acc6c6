"""Parallel transport between the means of two domains, with equal dispersion: closed form."""

import numpy as np
from numpy.typing import ArrayLike

from maniport.spd.neighbors import nearest
from maniport.transfer.cloud_pair import CloudPair
from maniport.transfer.identifiability import identify
from maniport.transfer.rigid_adapter import RigidAdapter
from maniport.util.validation import Array


class ParallelTransport(RigidAdapter):
    """Move the teacher's mean onto the student's by parallel transport and make the dispersions equal.

    In closed form and without matching: what is known about the two bodies' base_rotation decides the rotation, not the
    clouds. After Yair, Ben-Chen and Talmon 2019 and Reithmeir et al. 2022, § IV-C; unlike the latter's text, the
    transported set is recentered with its own new mean, and the transport stays part of the map.

    Parameters
    ----------
    damping : float, optional
        Add ε I, ε = damping · tr(mean of the domain) / d, to every ellipsoid; see `maniport.spd.regularization`.
    floor : float, optional
        Lift eigenvalues below it, in the unit of M. Excludes `damping`. Default: neither; singular input is an error.
    base_rotation : array_like, shape (d, d), or (3, 3) for d = 6, optional
        R_b, rotation from the teacher's base frame to the student's, when the base orientation is known. The teacher's
        ellipsoids are first expressed in the student's frame, R_b T R_bᵀ. Default: the same frame.
    scale : bool
        Whether to make the dispersions equal; otherwise s = 1.
    dispersion : {"mean", "rms"}
        See `maniport.spd.dispersion`.

    Attributes
    ----------
    cost_ : float
        Root mean squared distance from each mapped training ellipsoid to the nearest one of the student.
    identifiability_ : Identifiability
        Which rotations the clouds could distinguish from this one.

    References
    ----------
    Yair, Ben-Chen and Talmon, Parallel transport on the cone manifold of SPD matrices for domain adaptation, IEEE
    Trans. Signal Process. 67, 2019.

    Reithmeir, Figueredo and Haddadin, Human-to-robot manipulability domain adaptation with parallel transport and
    manifold-aware ICP, IROS 2022.
    """

    def __init__(
        self,
        damping: float | None = None,
        eigenvalue_floor: float | None = None,
        base_rotation: ArrayLike | None = None,
        scale: bool = True,
        dispersion: str = "mean",
    ):
        super().__init__(damping, eigenvalue_floor, base_rotation)
        self.scale = scale
        self.dispersion = dispersion

    def _fit_rotation(self, teacher: Array, student: Array) -> None:
        mapped = self._rigid_map().apply(teacher)
        self._set_closed_form("closed form", float(np.sqrt(np.mean(nearest(mapped, student)[1] ** 2))))
        if self._silent:
            return
        clouds = CloudPair(*self._recentered(teacher, student))
        self.identifiability_ = identify(clouds, self.rotation_, self.student_mean_)
