"""Riemannian ICP: match ellipsoids, turn them onto their partners, repeat."""

import warnings
from functools import partial
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from maniport.errors import IdentifiabilityWarning, InvalidInputError
from maniport.estimator import clone
from maniport.transfer.cloud_pair import drawn_again, in_turn
from maniport.transfer.icp.correspondence import Correspondence, correspondence_of
from maniport.transfer.icp.fit import RotationTask
from maniport.transfer.icp.search import Search
from maniport.transfer.icp.starts import KnownPairs, regular_pairs
from maniport.transfer.identifiability import ADVICE, LARGEST_EXAMINED, identify
from maniport.transfer.rigid_adapter import RigidAdapter
from maniport.validation import Array, as_count, as_generator

DEFAULTS = Search()
Pairs = tuple[ArrayLike, ArrayLike]


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
    correspondence : {"ellipsoid", "log-ellipsoid", "geodesic", "one-to-one", "transport"} or Correspondence
        Who matches whom: the largest score of direction and shape (the paper's), the same with shapes compared by
        ratio, the nearest ellipsoid on the manifold, or the least sum of squared distances with every ellipsoid
        taken once or with equal masses; the last two treat at most 2000 ellipsoids of each domain. A name stands for
        the defaults; an object, such as ``EllipsoidCorrespondence(direction="both", trim=0.1, exponent=0)``, has its
        own. Any object that derives from `maniport.transfer.Correspondence` will do.
    search : Search
        Where, how widely and how long is searched, and what becomes of what is found, such as
        ``Search(n_starts=0, compete=False)``.
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
        Which rotations the domains can tell apart.
    correspondence_, matched_teacher_ : ndarray, shape (k,)
        Indices of the student's and the teacher's (selected) ellipsoids that are matched at `rotation_`. With the
        default direction and no trimming, `matched_teacher_` counts all of the teacher's.

    See Also
    --------
    DomainAdapter : the other fitted attributes.

    References
    ----------
    Reithmeir, Figueredo and Haddadin, Human-to-robot manipulability domain adaptation with parallel transport and
    manifold-aware ICP, IROS 2022.
    """

    def __init__(
        self,
        damping: float | None = None,
        floor: float | None = None,
        mounting: ArrayLike | None = None,
        scale: bool = True,
        dispersion: str = "mean",
        recenter: str = "training",
        correspondence: str | Correspondence = "ellipsoid",
        search: Search = DEFAULTS,
        n_resamples: int = 8,
        random_state: Any = None,
        n_jobs: int | None = None,
    ):
        super().__init__(damping, floor, mounting)
        self.scale = scale
        self.dispersion = dispersion
        self.recenter = recenter
        self.correspondence = correspondence
        self.search = search
        self.n_resamples = n_resamples
        self.random_state = random_state
        self.n_jobs = n_jobs

    def fit(self, teacher: ArrayLike, student: ArrayLike, pairs: Pairs | None = None) -> Self:
        """Learn the map from samples of both domains, and from known correspondences where there are any.

        Parameters
        ----------
        teacher, student
            As in `DomainAdapter.fit`, which also says what is returned and raised.
        pairs : (array_like, array_like), shapes (k, d, d), optional
            Teacher's and student's ellipsoids that belong together: the same task at the same time. They get the
            regularisation of their domains. The search then starts at the rotation that suits them best, and in every
            rotation step they have half of the weight, the matches the other half. Where several rotations suit them
            equally (one pair leaves half turns about its axes open), the one nearest to `start` is taken, and the
            others are rivals that have to be clearly better on the clouds.

        Warns
        -----
        IdentifiabilityWarning
            When neither the clouds nor the user determine the rotation.
        """
        correspondence_of(self.correspondence)
        if not isinstance(self.search, Search):
            raise InvalidInputError(f"search must be a Search, such as Search(n_starts=0); found {self.search!r}")
        as_count(self.n_resamples, "n_resamples", minimum=0)
        self._fit_or_restore(teacher, student, partial(self._fit, pairs=pairs))
        if self.mounting is None and pairs is None and not self._silent and not self.identifiability_.determined:
            warnings.warn(f"{self.identifiability_.in_words()}; {ADVICE}", IdentifiabilityWarning, stacklevel=2)
        return self

    def _fit(self, teacher: Array, student: Array, pairs: Pairs | None = None) -> None:
        self._centre(teacher, student)
        self._fit_rotation(teacher, student, pairs)
        self._settle()

    def _task(self, teacher: Array, student: Array, pairs: Pairs | None) -> RotationTask:
        """Both clouds about the identity, and known pairs treated as the clouds are."""
        clouds, told = self._recentred(teacher, student), None
        if pairs is not None:
            sides = self.teacher_side, self.student_side
            told = KnownPairs(*self._recentred(*regular_pairs(pairs, sides, len(self.teacher_mean_))))
        return RotationTask(*clouds, self.rotation_, correspondence_of(self.correspondence), self.search, told)

    def _fit_rotation(self, teacher: Array, student: Array, pairs: Pairs | None = None) -> None:
        random = as_generator(self.random_state)
        found = self._task(teacher, student, pairs).solve(random, rivals=self.mounting is None, n_jobs=self.n_jobs)
        course, result = found.course, found.result
        self.rotation_, self.cost_, self.start_rotation_ = course.rotation, course.cost, course.start
        self.found_rotation_, self.start_kept_ = result.best.rotation, found.start_kept
        self.history_, self.n_iter_ = np.array(course.history), len(course.history) - 1
        self.converged_, self.stop_reason_ = course.converged, course.reason
        self.correspondence_, self.matched_teacher_ = course.matches.student, course.matches.teacher
        if self._silent:
            return
        again = self._resampled(teacher, student, pairs, random.spawn(self.n_resamples))
        self.identifiability_ = identify(found.clouds, self.rotation_, self.student_mean_, result.endings, again)

    def _resampled(
        self, teacher: Array, student: Array, pairs: Pairs | None, randoms: list[np.random.Generator]
    ) -> list[Array]:
        """Return the rotations that resampled domains lead to; none where following the search would take too long."""
        if self.start_kept_ and pairs is None and self.search.start == "parallel-transport":
            return self._transported_again(teacher, student, randoms)
        if teacher.shape[-1] > LARGEST_EXAMINED:
            return []
        return in_turn(partial(self._fitted_again, teacher, student, pairs), randoms, self.n_jobs)

    def _fitted_again(self, teacher: Array, student: Array, pairs: Pairs | None, random: np.random.Generator) -> Array:
        """Fit the rotation to resampled domains: the same start, or the search from what was found."""
        again = clone(self)
        for name in ("teacher_damping_", "student_damping_", "mounting_"):
            setattr(again, name, getattr(self, name))
        drawn = [drawn_again(cloud, random) for cloud in (teacher, student)]
        again._centre(*drawn)
        return np.asarray(again._task(drawn[0], drawn[1], pairs).follow(None if self.start_kept_ else self.rotation_))
