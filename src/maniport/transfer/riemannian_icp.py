"""Riemannian ICP: match ellipsoids, turn them onto their partners, repeat."""

from copy import copy
from dataclasses import dataclass
from typing import Any

import numpy as np
from joblib import Parallel, delayed
from numpy.typing import ArrayLike

from maniport.errors import InvalidInputError
from maniport.spd.kernels import eigh
from maniport.transfer.correspondence import EllipsoidFeatures, MatchTree
from maniport.transfer.rigid_adapter import RigidAdapter
from maniport.transfer.rigid_map import recentre
from maniport.transfer.rotation import RotationProblem, Whitening, rotation_angle, starts
from maniport.validation import Array, as_choice, as_count, as_generator, as_number

SCOUTS = 400
"""Teacher ellipsoids that the rival starts are compared on."""

SCOUTING = 2
"""Iterations after which rivals are compared; the best one is followed to its end."""

SCOUTING_TOL = 1e-3
"""Gradient norm to which rotations are found then."""

PATIENCE = 5
"""Iterations without a better cost after which the search ends."""

ROUNDING = 1e-6
"""Costs that differ by less, absolutely, are equal."""


class RiemannianICP(RigidAdapter):
    """Manifold-aware iterative closest point with parallel-transport start (Reithmeir et al. 2022, Algorithm 1).

    Both domains are recentred at the identity and the teacher is dilated to the student's dispersion. Then every
    teacher ellipsoid is matched with the student ellipsoid that resembles it most, the best rotation for these pairs
    is found, and so on. There is no objective that falls in every iteration: the best iterate is kept, the start
    included, and `stop_reason_` says why the search ended.

    Parameters
    ----------
    damping, floor, frame_rotation, scale, dispersion, recenter
        As in `ParallelTransport`. A given `frame_rotation` is taken for knowledge: the search then starts there and
        nowhere else.
    start : {"parallel-transport", "identity"}
        First rotation of recentred ellipsoids.
    n_starts : int
        When `frame_rotation` is None: how many rival starts, aligned with the frames of the two clouds, are also
        followed. Zero leaves `start` alone.
    margin : float
        Fraction by which a rival's cost must be lower to displace `start`. Clouds of arms are nearly symmetric, so that
        wrong rotations cost hardly more than the right one: between two draws of the Panda's own domain, a rival 1.2 %
        cheaper was off by 180°. Where the clouds do tell, the gain is large. Zero takes whatever is cheapest.
    exponent : float
        k in the weights w^k of the pairs, w being the matching score (the paper's best rows have 3; 0 gives equal
        weights).
    most_singular : int, optional
        Match only this many ellipsoids of each domain, those with the largest condition after recentring.
    max_iter : int
        Largest number of iterations from each start.
    tol : float
        Rotation [rad] below which an iteration counts as standing still.
    random_state : None, int or numpy.random.Generator
        For random starts, which are only used when the clouds' frames say little.
    n_jobs : int, optional
        How many rivals are followed at the same time, through joblib: in processes, or as ``joblib.parallel_config``
        says. Worth while for large domains only; the result is the same. Default: one after the other.

    Attributes
    ----------
    cost_ : float
        Weighted root mean squared distance of matched pairs, sqrt(Σ w^k d² / Σ w^k), at `rotation_`.
    start_rotation_ : ndarray, shape (d, d)
        Where the search that won started.
    correspondence_ : ndarray, shape (n,)
        Index of the student ellipsoid that each (selected) teacher ellipsoid is matched with.

    See Also
    --------
    maniport.transfer.adapter.DomainAdapter : the other fitted attributes.
    """

    def __init__(
        self,
        damping: float | None = None,
        floor: float | None = None,
        frame_rotation: ArrayLike | None = None,
        scale: bool = True,
        dispersion: str = "mean",
        recenter: str = "training",
        start: str = "parallel-transport",
        n_starts: int = 8,
        margin: float = 0.05,
        exponent: float = 3.0,
        most_singular: int | None = None,
        max_iter: int = 100,
        tol: float = 1e-8,
        random_state: Any = None,
        n_jobs: int | None = None,
    ):
        self.damping = damping
        self.floor = floor
        self.frame_rotation = frame_rotation
        self.scale = scale
        self.dispersion = dispersion
        self.recenter = recenter
        self.start = start
        self.n_starts = n_starts
        self.margin = margin
        self.exponent = exponent
        self.most_singular = most_singular
        self.max_iter = max_iter
        self.tol = tol
        self.random_state = random_state
        self.n_jobs = n_jobs

    def _fit_rotation(self, teacher: Array, student: Array) -> None:
        as_choice(self.start, "start", ("parallel-transport", "identity"))
        rivals = as_count(self.n_starts, "n_starts", minimum=0)
        rivals = rivals if self.frame_rotation is None else 0
        exponent, margin = as_number(self.exponent, "exponent"), as_number(self.margin, "margin", below=1.0)
        if exponent < 0:
            raise InvalidInputError(f"exponent must not be negative; found {exponent:g}")
        if margin < 0:
            raise InvalidInputError(f"margin must not be negative; found {margin:g}")
        limits = _Limits(
            exponent,
            as_count(self.max_iter, "max_iter"),
            as_number(self.tol, "tol", above=0.0),
        )
        random = as_generator(self.random_state)
        moved = recentre(teacher, self.teacher_mean_, self.dispersion_ratio_)
        fixed = recentre(student, self.student_mean_)
        if self.most_singular is not None:
            count = as_count(self.most_singular, "most_singular", minimum=2)
            moved, fixed = _most_singular(moved, count), _most_singular(fixed, count)
        first = self.rotation_ if self.start == "parallel-transport" else np.eye(teacher.shape[-1])
        matching = _Matching(moved, fixed, limits)
        start, search = _best_search(matching, first, rivals, margin, random, self.n_jobs)
        self.rotation_, self.start_rotation_ = search.rotation, start
        self.cost_, self.history_ = search.cost, np.array(search.history)
        self.n_iter_, self.stop_reason_ = len(search.history) - 1, search.reason
        self.converged_ = search.converged
        self.correspondence_ = search.index


@dataclass(frozen=True)
class _Limits:
    exponent: float
    max_iter: int
    tol: float


@dataclass(frozen=True)
class _Search:
    """How a search from one start went; rotation, cost and index belong to its best iterate."""

    rotation: Array
    cost: float
    index: Any
    history: list[float]
    reason: str
    converged: bool


class _Matching:
    """Recentred clouds and how they are matched under a rotation of the teacher."""

    def __init__(self, teacher: Array, student: Array, limits: _Limits):
        self.teacher, self.student, self.limits = teacher, student, limits
        self._features = EllipsoidFeatures.of(teacher)
        self._tree, self._white = MatchTree(EllipsoidFeatures.of(student)), Whitening(student)

    def subset(self, limit: int) -> "_Matching":
        """Keep at most `limit` teacher ellipsoids, evenly over their order, and all of the student's."""
        if len(self.teacher) <= limit:
            return self
        chosen = np.linspace(0, len(self.teacher) - 1, limit).round().astype(int)
        part = copy(self)
        part.teacher = self.teacher[chosen]
        part._features = EllipsoidFeatures.of(part.teacher)
        return part

    def pairs(self, rotation: Array) -> tuple[RotationProblem, Any]:
        """Match under `rotation`; return the weighted pairs and the index of each teacher's partner."""
        index, score = self._tree.query(self._features.turned(rotation))
        best = score.max()
        weights = (score / best) ** self.limits.exponent if best > 0 else np.ones_like(score)
        return RotationProblem(self._white.pick(index), self.teacher, weights / weights.sum()), index

    def search(self, start: Array, max_iter: int, tol: float = 1e-9) -> _Search:
        """Alternate matching and rotation, to gradient norm `tol`, until nothing changes; keep the best iterate."""
        rotation, history = start, list[float]()
        seen: dict[bytes, Array] = {}
        best: tuple[float, Array, Any] = (np.inf, start, None)
        best_iteration = 0
        reason, converged = f"{max_iter} iterations without standing still", False
        for iteration in range(max_iter + 1):
            problem, index = self.pairs(rotation)
            # the last iterate is only measured
            step = problem.minimize(rotation, tol, 100 if iteration < max_iter else 0)
            cost, moved = float(np.sqrt(step.start_cost)), step.rotation
            history.append(cost)
            if cost < best[0]:
                best, best_iteration = (cost, rotation, index), iteration
            if iteration == max_iter:
                break
            if iteration - best_iteration >= PATIENCE:
                reason = f"no better cost in {PATIENCE} iterations; iteration {best_iteration} is kept"
                break
            if rotation_angle(moved, rotation) <= self.limits.tol:
                reason, converged = "matches and rotation stand still", True
                break
            key = index.tobytes()
            if key in seen and rotation_angle(seen[key], moved) <= self.limits.tol:
                reason, converged = f"matches repeat in a cycle; iteration {best_iteration} is kept", True
                break
            seen[key] = rotation = moved
        cost, rotation, index = best
        return _Search(rotation, cost, index, history, reason, converged)


def _best_search(
    matching: _Matching, first: Array, rivals: int, margin: float, random: np.random.Generator, n_jobs: int | None
) -> tuple[Array, _Search]:
    """Follow the first start and the most promising rivals on part of the teacher; return the winner and its search.

    A rival wins only when it is clearly better, so that of about equally good rotations (a nearly symmetric domain
    has many) the one that the means suggest is taken.
    """
    plain = matching.search(first, matching.limits.max_iter)
    if rivals == 0:
        return first, plain
    scouts = matching.subset(SCOUTS)
    candidates = starts(matching.teacher, matching.student, random)
    costs = [scouts.pairs(rotation)[0].cost(rotation) for rotation in candidates]
    followed = [candidates[i] for i in np.argsort(costs, kind="stable")[:rivals]]
    steps = min(SCOUTING, matching.limits.max_iter)
    if n_jobs is None:
        ends = [scouts.search(rotation, steps, SCOUTING_TOL) for rotation in followed]
    else:
        tasks = (delayed(scouts.search)(rotation, steps, SCOUTING_TOL) for rotation in followed)
        ends = list(Parallel(n_jobs=n_jobs)(tasks))
    best = min(range(len(ends)), key=lambda i: ends[i].cost)
    # part of the teacher may mislead: the best rival has to beat the first start on all of it
    rival = matching.search(ends[best].rotation, matching.limits.max_iter)
    if rival.cost < plain.cost * (1.0 - margin) - ROUNDING:
        return followed[best], rival
    return first, plain


def _most_singular(points: Array, count: int) -> Array:
    """Select the ellipsoids with the largest condition number, in their order."""
    values, _ = eigh(points)
    return np.asarray(points[np.sort(np.argsort(-values[:, -1] / values[:, 0], kind="stable")[:count])])
