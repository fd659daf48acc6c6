"""The adapter that fits its rotation by manifold-aware ICP."""

import warnings
from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from maniport.errors import IdentifiabilityWarning, InvalidInputError
from maniport.spd.kernels import eigh
from maniport.transfer.adapter_file import Attribute, Schema, as_indices
from maniport.transfer.cloud_pair import CloudPair
from maniport.transfer.icp.algorithm import ICP, best_registration
from maniport.transfer.icp.correspondence import Correspondence, correspondence_of
from maniport.transfer.icp.initialization import aligned_frames, rotations_by_voting, rotations_of_pairs
from maniport.transfer.identifiability import ADVICE, LARGEST_EXAMINED, identify
from maniport.transfer.rigid_adapter import RigidAdapter
from maniport.transfer.rotation_group import rotation_angle
from maniport.util.validation import (
    Array,
    as_choice,
    as_count,
    as_flag,
    as_generator,
    as_number,
    as_points,
    as_rotation,
)

Pairs = tuple[ArrayLike, ArrayLike]


@dataclass(frozen=True)
class Search:
    """Initial rotations, iterations and acceptance of the search of `RiemannianICP`.

    Parameters
    ----------
    start : {"parallel-transport", "identity"}
        First rotation of recentered ellipsoids.
    n_starts : int
        Number of further initial rotations that are followed when no base_rotation is given: those that align the
        frames of the two clouds, and those that ellipsoids with equal eigenvalues vote for. Zero follows `start` alone.
    require_improvement : bool
        Keep the first rotation unless the result clearly brings the clouds nearer; see `CloudPair.improved`. False
        takes the rotation of lowest cost, as the paper does.
    most_singular : int, optional
        Match only this many ellipsoids of each domain, those with the largest condition number after recentering.
    max_iter : int
        Largest number of iterations from each initial rotation.
    tol : float
        Rotation [rad] below which an iteration counts as converged.

    Raises
    ------
    UnknownNameError, InvalidInputError
        When an option is wrong.
    """

    start: str = "parallel-transport"
    n_starts: int = 8
    require_improvement: bool = True
    most_singular: int | None = None
    max_iter: int = 100
    tol: float = 1e-8

    def __post_init__(self) -> None:
        as_choice(self.start, "start", ("parallel-transport", "identity"))
        as_count(self.n_starts, "n_starts", minimum=0)
        as_flag(self.require_improvement, "require_improvement")
        if self.most_singular is not None:
            as_count(self.most_singular, "most_singular", minimum=2)
        as_count(self.max_iter, "max_iter")
        as_number(self.tol, "tol", above=0.0)


DEFAULTS = Search()


class RiemannianICP(RigidAdapter):
    """Manifold-aware iterative closest point with parallel-transport start (Reithmeir et al. 2022, Algorithm 1).

    Both domains are recentered at the identity and the teacher's is dilated to the student's dispersion. Then matching
    and rotation alternate (`maniport.transfer.icp.algorithm`). The best iterate is kept, the start included.

    Parameters
    ----------
    damping, eigenvalue_floor, base_rotation, scale, dispersion
        As in `ParallelTransport`. With a `base_rotation` there is one initial rotation only.
    correspondence : {"ellipsoid", "log-ellipsoid", "geodesic", "one-to-one", "transport"} or Correspondence
        How ellipsoids are matched: the largest score of direction and shape (the paper's), the same with shapes
        compared by ratio, the nearest ellipsoid on the manifold, or the least sum of squared distances with every
        ellipsoid taken once or with equal masses; the last two match at most 2000 ellipsoids of each domain. A name
        means the defaults; an object, such as ``EllipsoidCorrespondence(direction="both", exponent=0)``, has its
        own options.
    search : Search
        Initial rotations, iterations and acceptance, such as ``Search(n_starts=0, require_improvement=False)``.
    random_state : None, int or numpy.random.Generator
        For random initial rotations, which are only used where the frames of the clouds are ill-defined.

    Attributes
    ----------
    cost_ : float
        Weighted root mean squared distance of matched pairs, sqrt(Σ w^k d² / Σ w^k), at `rotation_`; known pairs are
        included.
    start_rotation_, found_rotation_ : ndarray, shape (d, d)
        Start and result of the best search.
    start_kept_ : bool
        Whether `rotation_` is the first start rather than the result; then `stop_reason_` is the reason.
    identifiability_ : Identifiability
        Which rotations the domains can distinguish.
    correspondence_, matched_teacher_ : ndarray, shape (k,)
        Indices of the student's and the teacher's (selected) ellipsoids that are matched at `rotation_`.

    References
    ----------
    Reithmeir, Figueredo and Haddadin, Human-to-robot manipulability domain adaptation with parallel transport and
    manifold-aware ICP, IROS 2022.
    """

    schema: ClassVar[Schema] = RigidAdapter.schema | {
        "found_rotation_": Attribute(("d", "d"), as_rotation, optional=True),
        "start_rotation_": Attribute(("d", "d"), as_rotation, optional=True),
        "start_kept_": Attribute((), as_flag, optional=True),
        "correspondence_": Attribute(("matched",), as_indices, optional=True),
        "matched_teacher_": Attribute(("matched",), as_indices, optional=True),
    }
    option_classes = (Search, Correspondence)

    def __init__(
        self,
        damping: float | None = None,
        eigenvalue_floor: float | None = None,
        base_rotation: ArrayLike | None = None,
        scale: bool = True,
        dispersion: str = "mean",
        correspondence: str | Correspondence = "ellipsoid",
        search: Search = DEFAULTS,
        random_state: Any = None,
    ):
        super().__init__(damping, eigenvalue_floor, base_rotation)
        self.scale = scale
        self.dispersion = dispersion
        self.correspondence = correspondence
        self.search = search
        self.random_state = random_state

    def fit(self, teacher: ArrayLike, student: ArrayLike, pairs: Pairs | None = None) -> Self:
        """Learn the map from samples of both domains, and from known correspondences where there are any.

        Parameters
        ----------
        teacher, student
            As in `DomainAdapter.fit`, which also describes the returned value and errors.
        pairs : (array_like, array_like), shapes (k, d, d), optional
            Teacher's and student's ellipsoids of the same task at the same time. They get the regularization of their
            domains. The search starts at the rotation that suits them best, and in every rotation step they have half
            of the weight, the matches the other half. Where several rotations suit them equally (one pair leaves half
            turns about its axes open), the nearest to `start` comes first, and the others are further starts.

        Warns
        -----
        IdentifiabilityWarning
            When neither the clouds nor the user determine the rotation.
        """
        correspondence_of(self.correspondence)
        if not isinstance(self.search, Search):
            raise InvalidInputError(f"search must be a Search, such as Search(n_starts=0); found {self.search!r}")
        self._fit_or_restore(teacher, student, partial(self._fit, pairs=pairs))
        if self.base_rotation is None and pairs is None and not self._silent and not self.identifiability_.determined:
            warnings.warn(f"{self.identifiability_.in_words()}; {ADVICE}", IdentifiabilityWarning, stacklevel=2)
        return self

    def _fit(self, teacher: Array, student: Array, pairs: Pairs | None = None) -> None:
        self._center(teacher, student)
        self._fit_rotation(teacher, student, pairs)
        self._settle()

    def _fit_rotation(self, teacher: Array, student: Array, pairs: Pairs | None = None) -> None:
        search, d = self.search, len(self.teacher_mean_)
        clouds = self._recentered(teacher, student)
        matched_t, matched_s = clouds if search.most_singular is None else map(self._most_singular, clouds)
        recentered_pairs = None if pairs is None else self._recentered(*self._checked_pairs(pairs))
        first = self.rotation_ if search.start == "parallel-transport" else np.eye(d)
        rotations = [first]
        multi_start = self.base_rotation is None and search.n_starts > 0 and d <= LARGEST_EXAMINED
        if multi_start or pairs is not None:
            random = as_generator(self.random_state)
            if recentered_pairs is not None:
                rotations = rotations_of_pairs(*recentered_pairs, first, random)
            else:
                rotations += rotations_by_voting(matched_t, matched_s) + aligned_frames(matched_t, matched_s, random)
        icp = ICP(matched_t, matched_s, correspondence_of(self.correspondence), search.tol, recentered_pairs)
        # Clouds of arms are nearly symmetric: between two draws of the Panda's own domain, a rotation with a cost 1.2 %
        # lower was off by 180°.
        margin = 0.05 if search.require_improvement else 0.0
        others = rotations[1:] if multi_start else []
        start, best = best_registration(icp, rotations[0], others, search.n_starts, search.max_iter, margin)
        pair, improved, reason = CloudPair(*clouds), True, best.reason
        if search.require_improvement:
            improved, effect = pair.improved(start.start, best.rotation)
            if effect:
                angle = np.rad2deg(rotation_angle(start.start, best.rotation))
                reason = f"the start is kept: the rotation {angle:.1f}° away ({reason}) {effect}"
        self.found_rotation_, self.start_kept_, self.stop_reason_ = best.rotation, not improved, reason
        self.rotation_, self.cost_, matches, run = best.rotation, best.cost, best.matches, best
        if not improved:
            self.rotation_, self.cost_, matches, run = start.start, start.history[0], icp.problem(start.start)[1], start
        self.start_rotation_, self.converged_ = run.start, run.converged
        self.history_, self.n_iter_ = np.array(run.history), len(run.history) - 1
        self.correspondence_, self.matched_teacher_ = matches.student, matches.teacher
        if not self._silent:
            self.identifiability_ = identify(pair, self.rotation_, self.student_mean_)

    def _checked_pairs(self, pairs: Pairs) -> tuple[Array, Array]:
        """Check known pairs and regularize both sides as their domains; shapes (k, d, d)."""
        try:
            first, other = pairs
        except (TypeError, ValueError):
            raise InvalidInputError(
                "pairs must be two sets of ellipsoids, (teacher, student), each of shape (k, d, d); "
                f"found {type(pairs).__name__}" + (f" of {len(pairs)}" if hasattr(pairs, "__len__") else "")
            ) from None
        d = len(self.teacher_mean_)
        teacher = as_points(self.teacher_side(first, "pairs[0]"), "pairs[0]", d, minimum=1)
        student = as_points(self.student_side(other, "pairs[1]"), "pairs[1]", d, minimum=1)
        if len(teacher) != len(student):
            raise InvalidInputError(
                "pairs must hold equally many ellipsoids of teacher and student, the same task at the same time; "
                f"found {len(teacher)} and {len(student)}"
            )
        return teacher, student

    def _most_singular(self, points: Array) -> Array:
        """Select the ellipsoids (n, d, d) with the largest condition number, in their order."""
        values, _ = eigh(points)
        chosen = np.sort(np.argsort(-values[:, -1] / values[:, 0], kind="stable")[: self.search.most_singular])
        return np.asarray(points[chosen])
