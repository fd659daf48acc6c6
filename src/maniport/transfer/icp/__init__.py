"""The adapter that fits its rotation by manifold-aware ICP."""

import warnings

import numpy as np
from numpy.typing import ArrayLike

from maniport.errors import IdentifiabilityWarning
from maniport.spd.kernels import eigh
from maniport.transfer.icp.algorithm import ICP, best_registration, rotations_by_voting
from maniport.transfer.icp.correspondence import Correspondence, correspondence_of
from maniport.transfer.identifiability import ADVICE, CloudPair, describe_free_axes, free_axes
from maniport.transfer.rigid_adapter import RigidAdapter, recenter
from maniport.transfer.rotation_group import rotation_angle
from maniport.util.validation import Array, as_choice, as_count, as_flag


class RiemannianICP(RigidAdapter):
    """Manifold-aware iterative closest point with parallel-transport start (Reithmeir et al. 2022, Algorithm 1).

    Both domains are recentered at the identity and the teacher's is scaled to the student's dispersion. Then matching
    and rotation alternate (`maniport.transfer.icp.algorithm`). The best iterate is kept, the start included.

    Parameters
    ----------
    damping, base_rotation
        As in `ParallelTransport`. With a `base_rotation` there is one initial rotation only.
    correspondence : {"ellipsoid", "geodesic"} or Correspondence
        How ellipsoids are matched: the largest score of direction and shape (the paper's), or the nearest ellipsoid
        on the manifold. A name means the defaults; an object, such as ``EllipsoidCorrespondence(exponent=0)``, has its
        own options and is not saved with the adapter.
    start : {"parallel-transport", "identity"}
        First rotation of recentered ellipsoids.
    n_starts : int
        Largest number of further initial rotations when no base_rotation is given: those that ellipsoids with nearly
        equal eigenvalues vote for. Zero follows `start` alone.
    require_improvement : bool
        Keep the first rotation unless the result clearly brings the clouds nearer; see
        `maniport.transfer.identifiability`. False takes the rotation of lowest cost, as the paper does.
    most_singular : int, optional
        Match only this many ellipsoids of each domain, those with the largest condition number after recentering.

    Attributes
    ----------
    cost_ : float
        Weighted root mean squared distance of matched pairs, sqrt(Σ w^k d² / Σ w^k), at `rotation_`.
    start_rotation_, found_rotation_ : ndarray, shape (d, d)
        Start and result of the best search.
    start_kept_ : bool
        Whether `rotation_` is the first start rather than the result; then `stop_reason_` is the reason.
    free_axes_ : ndarray, shape (k, 3)
        Axes in the student's base frame about which the domains do not determine the rotation; for d = 3 and without
        `base_rotation` only.

    References
    ----------
    Reithmeir, Figueredo and Haddadin, Human-to-robot manipulability domain adaptation with parallel transport and
    manifold-aware ICP, IROS 2022.
    """

    def __init__(
        self,
        damping: float | None = None,
        base_rotation: ArrayLike | None = None,
        correspondence: str | Correspondence = "ellipsoid",
        start: str = "parallel-transport",
        n_starts: int = 4,
        require_improvement: bool = True,
        most_singular: int | None = None,
    ):
        super().__init__(damping, base_rotation)
        self.correspondence = correspondence
        self.start = start
        self.n_starts = n_starts
        self.require_improvement = require_improvement
        self.most_singular = most_singular

    def _fit_rotation(self, teacher: Array, student: Array) -> None:
        d, count = teacher.shape[-1], as_count(self.n_starts, "n_starts", minimum=0)
        selective = as_flag(self.require_improvement, "require_improvement")
        if as_choice(self.start, "start", ("parallel-transport", "identity")) == "identity":
            self.rotation_ = np.eye(d)
        clouds = (
            recenter(teacher, self.teacher_mean_, self.dispersion_ratio_),
            recenter(student, self.student_mean_),
        )
        matched, others = clouds, list[Array]()
        if self.most_singular is not None:
            limit = as_count(self.most_singular, "most_singular", minimum=2)
            matched = _most_singular(clouds[0], limit), _most_singular(clouds[1], limit)
        if (
            self.base_rotation is None and count > 0 and d <= 6
        ):  # beyond, m × m derivatives in each step take minutes
            others = rotations_by_voting(*matched, count)
        icp = ICP(*matched, correspondence_of(self.correspondence))
        # Clouds of arms are nearly symmetric: between two draws of the Panda's own domain, a rotation with a cost 1.2 %
        # lower was off by 180°.
        start, best = best_registration(
            icp, self.rotation_, others, margin=0.05 if selective else 0.0
        )
        pair, run, self.stop_reason_ = CloudPair(*clouds), best, best.reason
        self.found_rotation_, self.start_kept_ = best.rotation, False
        self.rotation_, self.cost_ = best.rotation, best.cost
        if selective:
            improved, effect = pair.improved(start.start, best.rotation)
            if not improved:
                run, self.start_kept_ = start, True
                self.rotation_, self.cost_ = start.start, start.history[0]
            if effect:
                angle = np.rad2deg(rotation_angle(start.start, best.rotation))
                self.stop_reason_ = (
                    f"the start is kept: the rotation {angle:.1f}° away ({best.reason}) {effect}"
                )
        self.start_rotation_, self.converged_ = run.start, run.converged
        self.history_, self.n_iter_ = np.array(run.history), len(run.history) - 1
        if self.base_rotation is None and d == 3:
            self.free_axes_ = free_axes(pair, self.rotation_, self.student_mean_)
            if len(self.free_axes_):
                text = f"{describe_free_axes(self.free_axes_)}; {ADVICE}"
                warnings.warn(text, IdentifiabilityWarning, stacklevel=4)


def _most_singular(points: Array, limit: int) -> Array:
    """Select the ellipsoids (n, d, d) with the largest condition number, in their order."""
    values, _ = eigh(points)
    return np.asarray(
        points[np.sort(np.argsort(-values[:, -1] / values[:, 0], kind="stable")[:limit])]
    )
