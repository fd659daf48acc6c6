"""Riemannian ICP: match ellipsoids, turn them onto their partners, repeat."""

import warnings
from functools import partial
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike
from sklearn.base import clone

from maniport.errors import IdentifiabilityWarning
from maniport.spd.kernels import eigh
from maniport.transfer.cloud_pair import CloudPair
from maniport.transfer.icp.competition import Decision, compete, unopposed
from maniport.transfer.icp.correspondence import CORRESPONDENCES, correspondence_of
from maniport.transfer.icp.known_pairs import KnownPairs, regular_pairs
from maniport.transfer.icp.options import IcpOptions, checked_options
from maniport.transfer.icp.rotation_prior import RotationPrior
from maniport.transfer.icp.rotation_starts import starts, voted
from maniport.transfer.icp.search import Objective, best_search
from maniport.transfer.identifiability import ADVICE, Ending, identify
from maniport.transfer.resampling import drawn_again, refitted
from maniport.transfer.rigid_adapter import RigidAdapter
from maniport.validation import Array, as_count, as_generator


class RiemannianICP(RigidAdapter):
    """Manifold-aware iterative closest point with parallel-transport start (Reithmeir et al. 2022, Algorithm 1).

    Both domains are recentred at the identity and the teacher is dilated to the student's dispersion. Then every
    teacher ellipsoid is matched with the student ellipsoid that resembles it most, the best rotation for these pairs
    is found, and so on. There is no objective that falls in every iteration: the best iterate is kept, the start
    included, and `stop_reason_` says why the search ended.

    Parameters
    ----------
    damping, floor, mounting, scale, dispersion, recenter
        As in `ParallelTransport`. A given `mounting` is taken for knowledge: the search then starts there and
        nowhere else.
    start : {"parallel-transport", "identity"}
        First rotation of recentred ellipsoids.
    n_starts : int
        When `mounting` is None: how many rival starts, aligned with the frames of the two clouds, are also
        followed. Zero leaves `start` alone.
    margin : float
        Fraction by which a rival's cost must be lower to displace `start`. Clouds of arms are nearly symmetric, so that
        wrong rotations cost hardly more than the right one: between two draws of the Panda's own domain, a rival 1.2 %
        cheaper was off by 180°. Where the clouds do tell, the gain is large. Zero takes whatever is cheapest.
    correspondence : {"ellipsoid", "log-ellipsoid", "geodesic", "one-to-one", "transport"}
        Who matches whom: the largest score of direction and shape (the paper's), the same with shapes compared by
        ratio, the nearest ellipsoid on the manifold, or the least sum of squared distances with every ellipsoid
        taken once or with equal masses. The last two treat at most 2000 ellipsoids of each domain.
    direction : {"teacher", "student", "both"}
        Whether every teacher ellipsoid seeks a partner, every student ellipsoid, or both, with half of the weight
        each. No difference to "one-to-one" and "transport".
    trim : float
        Fraction, in [0, 1), of the worst matches (lowest score or largest distance) that each iteration leaves out.
    exponent : float
        k in the weights w^k of the matches, w being the score of "ellipsoid" and "log-ellipsoid" (the paper's best
        rows have 3; 0 gives equal weights). The other correspondences weigh by mass.
    prior_weight : float
        Adds prior_weight · θ² to the mean squared distance, θ [rad] being the turn away from the start (for large
        turns 2 (1 − cos θ) instead of θ²). Directions along which the cost of anew matched clouds is curved by much
        more than 2 · prior_weight are decided by the clouds, the others by the start. Sampling noise slopes the cost
        along flat directions too, so that few samples need a larger weight; zero leaves all to the clouds.
    compete : bool
        Keep the first start unless the rotation that is found clearly brings the clouds nearer; see
        `maniport.transfer.icp.competition`. False takes what is found, as the paper does.
    most_singular : int, optional
        Match only this many ellipsoids of each domain, those with the largest condition after recentring.
    max_iter : int
        Largest number of iterations from each start.
    tol : float
        Rotation [rad] below which an iteration counts as standing still.
    n_resamples : int
        On how many resampled domains (bootstrap) the fit is repeated, for `identifiability_`.
    random_state : None, int or numpy.random.Generator
        For resampling, and for random starts, which are only used when the clouds' frames say little.
    n_jobs : int, optional
        How many rivals, and resampled domains, are treated at the same time, through joblib: in processes, or as
        ``joblib.parallel_config`` says. Worth while for large domains only; the result is the same. Default: one after
        the other.

    Attributes
    ----------
    cost_ : float
        Weighted root mean squared distance of matched pairs, sqrt(Σ w^k d² / Σ w^k), at `rotation_`; known pairs and
        the penalty of the prior are included.
    start_rotation_, found_rotation_ : ndarray, shape (d, d)
        Where the search that won started, and what it found.
    start_kept_ : bool
        Whether `rotation_` is the first start, kept against what was found; then `stop_reason_` says why.
    identifiability_ : Identifiability
        Which rotations the clouds can tell apart.
    correspondence_, matched_teacher_ : ndarray, shape (k,)
        Indices of the student's and the teacher's (selected) ellipsoids that are matched at `rotation_`. With the
        default direction and no trimming, `matched_teacher_` counts all of the teacher's.

    See Also
    --------
    maniport.transfer.adapter.DomainAdapter : the other fitted attributes.
    """

    def __init__(
        self,
        damping: float | None = None,
        floor: float | None = None,
        mounting: ArrayLike | None = None,
        scale: bool = True,
        dispersion: str = "mean",
        recenter: str = "training",
        start: str = "parallel-transport",
        n_starts: int = 8,
        margin: float = 0.05,
        correspondence: str = "ellipsoid",
        direction: str = "teacher",
        trim: float = 0.0,
        exponent: float = 3.0,
        prior_weight: float = 0.0,
        compete: bool = True,
        most_singular: int | None = None,
        max_iter: int = 100,
        tol: float = 1e-8,
        n_resamples: int = 8,
        random_state: Any = None,
        n_jobs: int | None = None,
    ):
        self.damping = damping
        self.floor = floor
        self.mounting = mounting
        self.scale = scale
        self.dispersion = dispersion
        self.recenter = recenter
        self.start = start
        self.n_starts = n_starts
        self.margin = margin
        self.correspondence = correspondence
        self.direction = direction
        self.trim = trim
        self.exponent = exponent
        self.prior_weight = prior_weight
        self.compete = compete
        self.most_singular = most_singular
        self.max_iter = max_iter
        self.tol = tol
        self.n_resamples = n_resamples
        self.random_state = random_state
        self.n_jobs = n_jobs

    def fit(self, teacher: ArrayLike, student: ArrayLike, pairs: tuple[ArrayLike, ArrayLike] | None = None) -> Self:
        """Learn the map from samples of both domains, and from known correspondences where there are any.

        Parameters
        ----------
        teacher : array_like, shape (n, d, d)
            Ellipsoids that the teacher can make.
        student : array_like, shape (m, d, d)
            Ellipsoids that the student can make; m may differ from n.
        pairs : (array_like, array_like), shapes (k, d, d), optional
            Teacher's and student's ellipsoids that belong together: the same task at the same time. They get the
            regularisation of their domains. The search then starts at the rotation that suits them best, and in every
            rotation step they have half of the weight, the matches the other half. Where several rotations suit them
            equally (one pair leaves half turns about its axes open), the one nearest to `start` is taken, and the
            others are rivals that have to be clearly better on the clouds.

        Returns
        -------
        self

        Raises
        ------
        NotSPDError
            When an ellipsoid is asymmetric, indefinite, or singular without regularisation.
        InvalidInputError
            When a domain has fewer than two ellipsoids or no dispersion, sizes differ, or a parameter is wrong.
            The adapter then is what it was before.

        Warns
        -----
        IdentifiabilityWarning
            When neither the clouds nor the user determine the rotation.
        """
        refine = partial(self._fit_rotation, pairs=pairs)
        self._fit_or_restore(teacher, student, partial(self._fit_rigid, refine=refine))
        if self.mounting is None and pairs is None and not self.identifiability_.determined:
            warnings.warn(f"{self.identifiability_.in_words()}; {ADVICE}", IdentifiabilityWarning, stacklevel=2)
        return self

    def _fit_rotation(self, teacher: Array, student: Array, pairs: tuple[ArrayLike, ArrayLike] | None = None) -> None:
        options = checked_options(self)
        random = as_generator(self.random_state)
        known = None if pairs is None else self._recentred_pairs(pairs)
        moved, fixed = self._recentred(teacher, student)
        clouds = CloudPair(moved, fixed)
        moved, fixed = self._selected(moved), self._selected(fixed)
        first, candidates = self._starts(moved, fixed, known, options.limits.rivals, random)
        objective = self._objective(moved, fixed, first, known, options)
        result = best_search(objective, first, candidates, options.limits, self.n_jobs)
        decision = compete(clouds, result) if self.compete else unopposed(result.best)
        self.found_rotation_ = result.best.rotation
        self._keep(decision, objective)
        endings = [Ending(one.rotation, one.cost) for one in result.followed]
        again = self._resampled(teacher, student, pairs, random.spawn(options.resamples))
        self.identifiability_ = identify(clouds, self.rotation_, self.student_mean_, endings, again)

    def _selected(self, points: Array) -> Array:
        if self.most_singular is None:
            return points
        return _most_singular(points, as_count(self.most_singular, "most_singular", minimum=2))

    def _objective(
        self, teacher: Array, student: Array, first: Array, known: KnownPairs | None, options: IcpOptions
    ) -> Objective:
        prior = RotationPrior(first, options.prior_weight) if options.prior_weight > 0 else None
        matching = correspondence_of(
            CORRESPONDENCES[self.correspondence], teacher, student, self.direction, options.trim, options.exponent
        )
        return Objective(matching, options.tol, known, prior)

    def _keep(self, decision: Decision, objective: Objective) -> None:
        """Set the attributes that tell how the fit went."""
        search = decision.search
        self.rotation_, self.cost_ = decision.rotation, decision.cost
        self.start_rotation_, self.start_kept_ = search.start, decision.start_kept
        self.history_, self.n_iter_ = np.array(search.history), len(search.history) - 1
        self.converged_, self.stop_reason_ = search.converged, decision.reason
        matches = objective.problem(decision.rotation)[1] if decision.start_kept else search.matches
        self.correspondence_, self.matched_teacher_ = matches.student, matches.teacher

    def _resampled(
        self,
        teacher: Array,
        student: Array,
        pairs: tuple[ArrayLike, ArrayLike] | None,
        randoms: list[np.random.Generator],
    ) -> list[Array]:
        """Return the rotations that resampled domains lead to."""
        if self.start_kept_ and pairs is None and self.start == "parallel-transport":
            return self._transported_again(teacher, student, randoms)
        return refitted(partial(self._fitted_again, teacher, student, pairs), randoms, self.n_jobs)

    def _fitted_again(
        self, teacher: Array, student: Array, pairs: tuple[ArrayLike, ArrayLike] | None, random: np.random.Generator
    ) -> Array:
        """Fit the rotation to resampled domains: the same start, or the search from what was found."""
        again = clone(self)
        for name in ("teacher_damping_", "student_damping_", "mounting_"):
            setattr(again, name, getattr(self, name))
        again._fit_rigid(
            *(drawn_again(cloud, random) for cloud in (teacher, student)),
            refine=partial(again._follow, None if self.start_kept_ else self.rotation_, pairs),
        )
        return np.asarray(again.rotation_)

    def _follow(
        self, near: Array | None, pairs: tuple[ArrayLike, ArrayLike] | None, teacher: Array, student: Array
    ) -> None:
        """Set `rotation_` to the start of a fit, or to what the search from a rotation finds."""
        options = checked_options(self)
        known = None if pairs is None else self._recentred_pairs(pairs)
        moved, fixed = (self._selected(cloud) for cloud in self._recentred(teacher, student))
        first, _ = self._starts(moved, fixed, known, 0, np.random.default_rng(0))
        self.rotation_ = first
        if near is not None:
            objective = self._objective(moved, fixed, first, known, options)
            self.rotation_ = objective.search(near, options.limits.max_iter).rotation

    def _starts(
        self, teacher: Array, student: Array, known: KnownPairs | None, rivals: int, random: np.random.Generator
    ) -> tuple[Array, list[Array]]:
        """Return the first rotation of recentred clouds, and those that may compete with it."""
        first = self.rotation_ if self.start == "parallel-transport" else np.eye(teacher.shape[-1])
        candidates = list[Array]()
        if known is not None:
            first, *candidates = known.rotations(first, random)
        if self.mounting is not None or rivals == 0:
            return first, []
        return first, candidates if known is not None else [*voted(teacher, student), *starts(teacher, student, random)]

    def _recentred_pairs(self, pairs: tuple[ArrayLike, ArrayLike]) -> KnownPairs:
        """Treat known pairs as the domains are treated."""
        teacher, student = regular_pairs(pairs, (self.teacher_side, self.student_side), len(self.teacher_mean_))
        return KnownPairs(*self._recentred(teacher, student))


def _most_singular(points: Array, count: int) -> Array:
    """Select the ellipsoids with the largest condition number, in their order."""
    values, _ = eigh(points)
    return np.asarray(points[np.sort(np.argsort(-values[:, -1] / values[:, 0], kind="stable")[:count])])
