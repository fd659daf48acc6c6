"""The adapter that fits its rotation by manifold-aware ICP."""

import warnings
from functools import partial
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from maniport.errors import IdentifiabilityWarning, InvalidInputError
from maniport.spd.kernels import eigh
from maniport.spd.mean import dispersion, mean
from maniport.transfer.cloud_pair import CloudPair, resampled
from maniport.transfer.icp.algorithm import ICP, Search
from maniport.transfer.icp.correspondence import Correspondence, correspondence_of
from maniport.transfer.icp.starts import best_rival, checked_pairs, rotations_of_pairs, start_is_kept, starts, voted
from maniport.transfer.identifiability import ADVICE, LARGEST_EXAMINED, identify
from maniport.transfer.rigid_adapter import RigidAdapter, recentre
from maniport.util.validation import Array, as_count, as_generator

DEFAULTS = Search()
Pairs = tuple[ArrayLike, ArrayLike]


class RiemannianICP(RigidAdapter):
    """Manifold-aware iterative closest point with parallel-transport start (Reithmeir et al. 2022, Algorithm 1).

    Both domains are recentred at the identity and the teacher is dilated to the student's dispersion. Then matching and
    rotation alternate (`maniport.transfer.icp.algorithm`). The best iterate is kept, the start included, and
    `stop_reason_` says why the search ended.

    Parameters
    ----------
    damping, eigenvalue_floor, base_rotation, scale, dispersion, recenter
        As in `ParallelTransport`. With a given `base_rotation` the search has no other start.
    correspondence : {"ellipsoid", "log-ellipsoid", "geodesic", "one-to-one", "transport"} or Correspondence
        How ellipsoids are matched: the largest score of direction and shape (the paper's), the same with shapes
        compared by ratio, the nearest ellipsoid on the manifold, or the least sum of squared distances with every
        ellipsoid taken once or with equal masses; the last two match at most 2000 ellipsoids of each domain. A name
        stands for the defaults; an object, such as ``EllipsoidCorrespondence(direction="both", exponent=0)``, has its
        own options.
    search : Search
        Start, extent and acceptance of the search, such as ``Search(n_starts=0, compete=False)``.
    n_resamples : int
        On how many resampled domains (bootstrap) the fit is repeated, for `identifiability_`.
    random_state : None, int or numpy.random.Generator
        For resampling, and for random starts, which are only used when the clouds' frames say little.

    Attributes
    ----------
    cost_ : float
        Weighted root mean squared distance of matched pairs, sqrt(Σ w^k d² / Σ w^k), at `rotation_`; known pairs are
        included.
    start_rotation_, found_rotation_ : ndarray, shape (d, d)
        Start and result of the best search.
    start_kept_ : bool
        Whether `rotation_` is the first start rather than the result; then `stop_reason_` says why.
    identifiability_ : Identifiability
        Which rotations the domains can tell apart.
    correspondence_, matched_teacher_ : ndarray, shape (k,)
        Indices of the student's and the teacher's (selected) ellipsoids that are matched at `rotation_`.

    References
    ----------
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
        recenter: str = "training",
        correspondence: str | Correspondence = "ellipsoid",
        search: Search = DEFAULTS,
        n_resamples: int = 8,
        random_state: Any = None,
    ):
        super().__init__(damping, eigenvalue_floor, base_rotation)
        self.scale = scale
        self.dispersion = dispersion
        self.recenter = recenter
        self.correspondence = correspondence
        self.search = search
        self.n_resamples = n_resamples
        self.random_state = random_state

    def fit(self, teacher: ArrayLike, student: ArrayLike, pairs: Pairs | None = None) -> Self:
        """Learn the map from samples of both domains, and from known correspondences where there are any.

        Parameters
        ----------
        teacher, student
            As in `DomainAdapter.fit`, which also says what is returned and raised.
        pairs : (array_like, array_like), shapes (k, d, d), optional
            Teacher's and student's ellipsoids of the same task at the same time. They get the regularization of their
            domains. The search starts at the rotation that suits them best, and in every rotation step they have half
            of the weight, the matches the other half. Where several rotations suit them equally (one pair leaves half
            turns about its axes open), the one nearest to `start` comes first, and the others compete with it.

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
        if self.base_rotation is None and pairs is None and not self._silent and not self.identifiability_.determined:
            warnings.warn(f"{self.identifiability_.in_words()}; {ADVICE}", IdentifiabilityWarning, stacklevel=2)
        return self

    def _fit(self, teacher: Array, student: Array, pairs: Pairs | None = None) -> None:
        self._centre(teacher, student)
        self._fit_rotation(teacher, student, pairs)
        self._settle()

    def _fit_rotation(self, teacher: Array, student: Array, pairs: Pairs | None = None) -> None:
        random, search = as_generator(self.random_state), self.search
        clouds = self._recentred(teacher, student)
        known = None
        if pairs is not None:
            sides = self.teacher_side, self.student_side
            known = self._recentred(*checked_pairs(pairs, sides, len(self.teacher_mean_)))
        first, rivals = self._starts(clouds, known, random)
        icp = self._icp(clouds, known)
        start = found = icp.run(first, search.max_iter)
        courses = [start]
        if rivals:
            rival, others = best_rival(icp, rivals, search.n_starts, search.max_iter)
            courses += others
            if rival.cost < start.cost * (1.0 - search.margin) - 1e-6:
                found = rival
        pair = CloudPair(*clouds)
        kept, reason = start_is_kept(pair, start, found) if search.compete else (False, found.reason)
        self.found_rotation_, self.start_kept_, self.stop_reason_ = found.rotation, kept, reason
        self.rotation_, self.cost_, matches, course = found.rotation, found.cost, found.matches, found
        if kept:
            self.rotation_, self.cost_, matches, course = first, start.history[0], icp.problem(first)[1], start
        self.start_rotation_, self.converged_ = course.start, course.converged
        self.history_, self.n_iter_ = np.array(course.history), len(course.history) - 1
        self.correspondence_, self.matched_teacher_ = matches.student, matches.teacher
        if not self._silent:
            again = self._resampled(teacher, student, known, random.spawn(self.n_resamples))
            ends = [(one.rotation, one.cost) for one in courses]
            self.identifiability_ = identify(pair, self.rotation_, self.student_mean_, ends, again)

    def _starts(
        self, clouds: tuple[Array, Array], known: tuple[Array, Array] | None, random: np.random.Generator
    ) -> tuple[Array, list[Array]]:
        """Return the first rotation, and those that may compete with it."""
        d = len(self.rotation_)
        first, rivals = self.rotation_ if self.search.start == "parallel-transport" else np.eye(d), list[Array]()
        if known is not None:
            first, *rivals = rotations_of_pairs(*known, first, random)
        if self.base_rotation is not None or self.search.n_starts == 0 or d > LARGEST_EXAMINED:
            return first, []
        if known is None:
            teacher, student = (most_singular(cloud, self.search.most_singular) for cloud in clouds)
            rivals = [*voted(teacher, student), *starts(teacher, student, random)]
        return first, rivals

    def _icp(self, clouds: tuple[Array, Array], known: tuple[Array, Array] | None) -> ICP:
        teacher, student = (most_singular(cloud, self.search.most_singular) for cloud in clouds)
        return ICP(teacher, student, correspondence_of(self.correspondence), self.search.tol, known)

    def _resampled(
        self, teacher: Array, student: Array, known: tuple[Array, Array] | None, randoms: list[np.random.Generator]
    ) -> list[Array]:
        """Rotations fitted to resampled domains (bootstrap): parallel transport where it is kept, else ICP."""
        if self.start_kept_ and known is None:
            transported = self.search.start == "parallel-transport"
            return self._transported_again(teacher, student, randoms) if transported else []
        if len(self.rotation_) > LARGEST_EXAMINED:
            return []
        found = []
        for random in randoms:
            drawn = resampled(teacher, random), resampled(student, random)
            means = [mean(points) for points in drawn]
            spreads = [dispersion(points, center, self.dispersion) for points, center in zip(drawn, means, strict=True)]
            ratio = spreads[1] / spreads[0] if self.scale else 1.0
            icp = self._icp((recentre(drawn[0], means[0], ratio), recentre(drawn[1], means[1])), known)
            found.append(icp.run(self.rotation_, self.search.max_iter).rotation)
        return found


def most_singular(points: Array, count: int | None) -> Array:
    """Select the ellipsoids (n, d, d) with the largest condition number, in their order; all where `count` is None."""
    if count is None or count >= len(points):
        return points
    values, _ = eigh(points)
    chosen = np.sort(np.argsort(-values[:, -1] / values[:, 0], kind="stable")[:count])
    return np.asarray(points[chosen])
