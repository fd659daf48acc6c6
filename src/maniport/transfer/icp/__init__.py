"""The adapter that fits its rotation by manifold-aware ICP."""

import warnings

import numpy as np
from numpy.typing import ArrayLike

from maniport.errors import IdentifiabilityWarning
from maniport.spd.kernels import eigh
from maniport.spd.matrix_functions import apply
from maniport.transfer.icp.algorithm import (
    ICP,
    Registration,
    best_registration,
    rotations_by_voting,
)
from maniport.transfer.icp.congruence import congruent_starts
from maniport.transfer.icp.consensus import Consensus, find_consensus
from maniport.transfer.icp.correspondence import Correspondence, correspondence_of
from maniport.transfer.icp.energy import EnergyDistance, least_energy
from maniport.transfer.icp.pairs import Factors
from maniport.transfer.identifiability import (
    ADVICE,
    CloudPair,
    describe_determined,
    free_axes,
    half_turns,
)
from maniport.transfer.rigid_adapter import RigidAdapter, RigidMap, recenter
from maniport.transfer.rotation_group import rotation_angle
from maniport.util.validation import Array, as_choice, as_count, as_flag

CRITERIA = ("robust", "correspondence")

EXACT = 1e-6  # cost of matches of exact copies, up to rounding

ENERGY_CERTAINTY = 2.0
"""Standard errors by which the least energy distance must be below that of the start. Two samples of the Panda, of 400
and 1024 ellipsoids, have 0.2 to 1.5 where the start is right, and 2.1 to 8.8 where it is 29° to 89° off."""

ENERGY_SHARE = 0.25
"""Share of the energy distance of the start by which the least one must be below it. The same samples have 4 to 27 %
where the start is right, and 33 to 80 % where it is off."""

LEAST_CLOUD = 300
"""Ellipsoids that each domain must have for the energy distance to be used. Of 400 ellipsoids of one Panda, 16 of 20
minima of the energy are within 10°."""

CERTAIN_SHARE = 0.5
"""Share of the smaller domain whose pairs must agree to decide on free rotations. Separate domains of a planar arm have
27 % that agree by chance."""

LARGEST_LOG = 5.0
"""Largest logarithm of eigenvalues about the mean, in the median, with which pairs are sought: beyond, powers and
products may be indefinite by rounding."""

LARGEST_ROBUST = 6
"""Largest size d of ellipsoids with a robust fit: beyond, least squares over d² + d (d + 1) / 2 + 1 parameters take
seconds in each step."""


def is_moderate(cloud: Array) -> bool:
    """Whether the eigenvalues of most matrices (n, d, d) about the identity are neither tiny nor huge."""
    logs = np.abs(np.log(eigh(cloud)[0])).max(axis=1)
    return float(np.median(logs)) < LARGEST_LOG


class RiemannianICP(RigidAdapter):
    """Manifold-aware iterative closest point with parallel-transport start (Reithmeir et al. 2022, Algorithm 1).

    Both domains are recentered at the identity and the teacher's is scaled to the student's dispersion. Then matching
    and rotation alternate (`maniport.transfer.icp.algorithm`). The best iterate is kept, the start included.

    The default is robust. Where the matches are not exact, means, dispersion and rotation are fitted again to the pairs
    that agree, if these are more than by chance (`maniport.transfer.icp.consensus`): domains may have only a part in
    common, noise, and outliers. Where no pairs agree, as between separate samples of two arms, and without a
    `base_rotation`, rotation and dispersion have the least energy distance (`maniport.transfer.icp.energy`).

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
    criterion : {"robust", "correspondence"}
        "correspondence" is the paper's algorithm: means and dispersions of whole domains, and the rotation of the
        lowest cost of its matches.

    Attributes
    ----------
    criterion_ : {"correspondence", "pairs", "energy"}
        What decided: the matches, the pairs that agree, or the energy distance.
    cost_ : float
        Weighted root mean squared distance of matched pairs, sqrt(Σ w^k d² / Σ w^k), at `rotation_`; of mutual nearest
        pairs if `criterion_` is "pairs"; the energy distance if it is "energy".
    n_pairs_ : int or None
        Number of pairs that carry the fit, if `criterion_` is "pairs". Means and dispersion ratio are then those of the
        map that fits the pairs, not of the domains.
    overlap_ : float or None
        `n_pairs_` by the size of the smaller domain.
    start_rotation_, found_rotation_ : ndarray, shape (d, d)
        Start and result of the best search.
    start_kept_ : bool
        Whether `rotation_` is the first start rather than the result; then `stop_reason_` is the reason.
    free_axes_ : ndarray, shape (k, 3)
        Axes in the student's base frame about which the domains do not determine the rotation; for d = 3 and without
        `base_rotation` only.
    half_turns_ : ndarray, shape (k, 3)
        Axes in the student's base frame, half turns about which leave the domains as near as they are, besides the free
        ones; where `free_axes_` is set.
    half_turn_distances_ : ndarray, shape (k + 1,)
        Mean distance between the domains, and with each of these half turns.

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
        criterion: str = "robust",
    ):
        super().__init__(damping, base_rotation)
        self.correspondence = correspondence
        self.start = start
        self.n_starts = n_starts
        self.require_improvement = require_improvement
        self.most_singular = most_singular
        self.criterion = criterion

    def _fit_rotation(self, teacher: Array, student: Array) -> None:
        d = teacher.shape[-1]
        robust = as_choice(self.criterion, "criterion", CRITERIA) == "robust"
        selective = as_flag(self.require_improvement, "require_improvement")
        clouds = (
            recenter(teacher, self.teacher_mean_, self.dispersion_ratio_),
            recenter(student, self.student_mean_),
        )
        whole = clouds
        start, best = self._matched(clouds, selective)
        self.criterion_ = "correspondence"
        self.n_pairs_: int | None = None
        self.overlap_: float | None = None

        robust = robust and best.cost > EXACT  # matches of exact copies need no more
        consensus = None
        if robust and d <= LARGEST_ROBUST and is_moderate(clouds[0]) and is_moderate(clouds[1]):
            consensus = self._consensus(teacher, student, best.rotation)
        if consensus is not None:
            self._take_pairs(consensus, start, min(len(teacher), len(student)))
            pair = CloudPair(
                recenter(teacher, self.teacher_mean_, self.dispersion_ratio_),
                recenter(student, self.student_mean_),
            )
        elif robust and self._may_use_energy(clouds):
            pair = self._take_energy(clouds, CloudPair(*clouds), [start, best], selective)
        else:
            pair = CloudPair(*clouds)
            self._take_matches(pair, start, best, selective)
        if self.base_rotation is None and d == 3:
            if self.overlap_ is not None and self.overlap_ < CERTAIN_SHARE:
                pair = CloudPair(*whole)  # symmetric domains have pairs that agree by chance
            self._report_free_rotations(pair)

    def _consensus(self, teacher: Array, student: Array, rotation: Array) -> Consensus | None:
        """Find pairs of ellipsoids that agree on a map, from the map with a rotation and others."""
        plain = RigidMap(
            self.teacher_mean_, self.student_mean_, rotation, float(self.dispersion_ratio_)
        )
        others = congruent_starts(teacher, student)
        return find_consensus(teacher, student, Factors(*plain.factors), others)

    def _may_use_energy(self, clouds: tuple[Array, Array]) -> bool:
        """Return whether clouds are large enough for the energy distance, and other rotations are searched."""
        if min(len(clouds[0]), len(clouds[1])) < LEAST_CLOUD:
            return False
        return self.base_rotation is None and self.n_starts > 0

    def _report_free_rotations(self, pair: CloudPair) -> None:
        """Set the axes of free rotations and of half turns, and warn of them."""
        self.free_axes_ = free_axes(pair, self.rotation_, self.student_mean_)
        turns = half_turns(pair, self.rotation_, self.student_mean_, self.free_axes_)
        self.half_turns_ = turns.axes
        self.half_turn_distances_ = np.array([turns.before, *turns.after])
        if len(self.free_axes_) or len(self.half_turns_):
            text = f"{describe_determined(self.free_axes_, turns)}; {ADVICE}"
            warnings.warn(text, IdentifiabilityWarning, stacklevel=5)

    def _matched(
        self, clouds: tuple[Array, Array], selective: bool
    ) -> tuple[Registration, Registration]:
        """Follow the matches from the first start and others; return the first registration and the best."""
        d = clouds[0].shape[-1]
        count = as_count(self.n_starts, "n_starts", minimum=0)
        first = self.rotation_
        if as_choice(self.start, "start", ("parallel-transport", "identity")) == "identity":
            first = np.eye(d)
        matched = clouds
        if self.most_singular is not None:
            limit = as_count(self.most_singular, "most_singular", minimum=2)
            matched = _most_singular(clouds[0], limit), _most_singular(clouds[1], limit)

        others = list[Array]()
        # beyond, m × m derivatives in each step take minutes
        if self.base_rotation is None and count > 0 and d <= 6:
            others = rotations_by_voting(*matched, count)
        icp = ICP(*matched, correspondence_of(self.correspondence))
        # Clouds of arms are nearly symmetric: between two draws of the Panda's own domain, a rotation with a cost 1.2 %
        # lower was off by 180°.
        if selective:
            margin = 0.05
        else:
            margin = 0.0
        return best_registration(icp, first, others, margin=margin)

    def _take_matches(
        self, pair: CloudPair, start: Registration, best: Registration, selective: bool
    ) -> None:
        """Set the rotation of the best matches, or the first one where it brings the clouds no nearer."""
        run = best
        self.stop_reason_ = best.reason
        self.found_rotation_ = best.rotation
        self.start_kept_ = False
        self.rotation_ = best.rotation
        self.cost_ = best.cost
        if selective:
            improved, effect = pair.improved(start.start, best.rotation)
            if not improved:
                run = start
                self.start_kept_ = True
                self.rotation_ = start.start
                self.cost_ = start.history[0]
            if effect:
                angle = np.rad2deg(rotation_angle(start.start, best.rotation))
                self.stop_reason_ = (
                    f"the start is kept: the rotation {angle:.1f}° away ({best.reason}) {effect}"
                )
        self.start_rotation_ = run.start
        self.converged_ = run.converged
        self.history_ = np.array(run.history)
        self.n_iter_ = len(run.history) - 1

    def _take_energy(
        self,
        clouds: tuple[Array, Array],
        pair: CloudPair,
        starts: list[Registration],
        selective: bool,
    ) -> CloudPair:
        """Set rotation and dispersion of the least energy distance, where it is clearly less; return the clouds."""
        first = starts[0].start
        minimum = least_energy(*clouds, [first, starts[-1].rotation])
        improved = True
        effect = ""
        if selective:
            improved, effect = pair.improved(
                first, minimum.rotation, ENERGY_CERTAINTY, ENERGY_SHARE
            )

        before = EnergyDistance(*clouds).value(first, 1.0)
        self.criterion_ = "energy"
        self.start_rotation_ = first
        self.found_rotation_ = minimum.rotation
        self.start_kept_ = not improved
        self.converged_ = True
        self.n_iter_ = 1
        self.history_ = np.array([before, minimum.distance])
        if not improved:
            self.rotation_ = first
            self.cost_ = before
            self.stop_reason_ = "the start has the least energy distance"
            if effect:
                angle = np.rad2deg(rotation_angle(first, minimum.rotation))
                away = f"the rotation {angle:.1f}° away, of least energy distance,"
                self.stop_reason_ = f"the start is kept: {away} {effect}"
            return pair

        self.rotation_ = minimum.rotation
        self.dispersion_ratio_ = self.dispersion_ratio_ * minimum.ratio
        self.cost_ = minimum.distance
        self.stop_reason_ = "least energy distance of the domains"
        dilated = apply(clouds[0], lambda values: values**minimum.ratio)
        return CloudPair(dilated, clouds[1])

    def _take_pairs(self, consensus: Consensus, start: Registration, smaller: int) -> None:
        """Set the map that fits the pairs that agree."""
        rigid = consensus.factors.rigid()
        self.criterion_ = "pairs"
        self.teacher_mean_ = rigid.teacher_mean
        self.student_mean_ = rigid.student_mean
        self.rotation_ = rigid.rotation
        self.dispersion_ratio_ = rigid.ratio
        self.start_rotation_ = start.start
        self.found_rotation_ = rigid.rotation
        self.start_kept_ = False

        count = len(consensus.pairs.distances)
        share = count / smaller
        self.n_pairs_ = count
        self.overlap_ = share
        self.cost_ = consensus.history[-1]
        self.history_ = np.array(consensus.history)
        self.n_iter_ = len(consensus.history) - 1
        self.converged_ = consensus.converged
        self.stop_reason_ = f"{count} pairs carry the fit, {share:.0%} of the smaller domain"


def _most_singular(points: Array, limit: int) -> Array:
    """Select the ellipsoids (n, d, d) with the largest condition number, in their order."""
    values, _ = eigh(points)
    return np.asarray(
        points[np.sort(np.argsort(-values[:, -1] / values[:, 0], kind="stable")[:limit])]
    )
