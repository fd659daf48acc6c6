"""The search of the iterative closest point: from one start, and over rival starts."""

from copy import copy
from dataclasses import dataclass, replace

import numpy as np
from joblib import Parallel, delayed

from maniport.transfer.icp.correspondence import Correspondence, Matches
from maniport.transfer.icp.known_pairs import KnownPairs
from maniport.transfer.icp.rotation import RotationProblem, Whitening, rotation_angle
from maniport.transfer.icp.rotation_prior import RotationPrior
from maniport.validation import Array

SCOUTS = 400
"""Ellipsoids of a seeking side that the rival starts are compared on."""

SCOUTING = 2
"""Iterations after which rivals are compared; the best one is followed to its end."""

SCOUTING_TOL = 1e-3
"""Gradient norm to which rotations are found then."""

PATIENCE = 5
"""Iterations without a better cost after which the search ends."""

ROUNDING = 1e-6
"""Costs that differ by less, absolutely, are equal."""

PAIRS_SHARE = 0.5
"""Share of known pairs in the total weight, however many they are."""


@dataclass(frozen=True)
class SearchLimits:
    """How long, how widely and for how much gain is searched; see the parameters of `RiemannianICP`."""

    max_iter: int
    rivals: int
    margin: float


@dataclass(frozen=True)
class Search:
    """How a search from one start went; rotation, cost and matches belong to its best iterate."""

    start: Array
    rotation: Array
    cost: float
    matches: Matches
    history: list[float]
    reason: str
    converged: bool


@dataclass(frozen=True)
class Followed:
    """A start, where the search from it led, and the cost there.

    Attributes
    ----------
    start, rotation : ndarray, shape (d, d)
    cost : float
        Root of the objective; see `RiemannianICP.cost_`.
    complete : bool
        Whether it was followed to its end with all ellipsoids; others were given up after a few iterations on some.
    """

    start: Array
    rotation: Array
    cost: float
    complete: bool


@dataclass(frozen=True)
class SearchResult:
    """The search that won, the one from the given start, and every start that was followed, the given one first."""

    best: Search
    plain: Search
    followed: list[Followed]


class Objective:
    """What the search minimises: weighted squared distances of matched and of known pairs, and the prior.

    Parameters
    ----------
    correspondence : Correspondence
        Of both recentred clouds.
    tol : float
        Rotation [rad] below which an iteration counts as standing still.
    pairs : KnownPairs, optional
        They take half of the weight in every rotation step.
    prior : RotationPrior, optional
    """

    def __init__(
        self,
        correspondence: Correspondence,
        tol: float,
        pairs: KnownPairs | None = None,
        prior: RotationPrior | None = None,
    ):
        self.correspondence, self.tol, self.pairs, self.prior = correspondence, tol, pairs, prior
        self._white = Whitening(correspondence.student)
        self._white_pairs = None if pairs is None else Whitening(pairs.student)

    def scouts(self, limit: int) -> "Objective":
        """Match at most `limit` ellipsoids of each side that seeks."""
        part = copy(self)
        part.correspondence = self.correspondence.scouts(limit)
        return part

    def problem(self, rotation: Array) -> tuple[RotationProblem, Matches]:
        """Match under `rotation`; return the rotation problem of the matches, and these."""
        matches = self.correspondence.match(rotation)
        student, teacher = self._white.pick(matches.student), self.correspondence.teacher[matches.teacher]
        weight = matches.weight
        if self.pairs is not None and self._white_pairs is not None:
            count = len(self.pairs.teacher)
            student = student.followed_by(self._white_pairs)
            teacher = np.concatenate([teacher, self.pairs.teacher])
            weight = np.concatenate([(1.0 - PAIRS_SHARE) * weight, np.full(count, PAIRS_SHARE / count)])
        return RotationProblem(student, teacher, weight, self.prior), matches

    def cost(self, rotation: Array) -> float:
        """Return the cost of a rotation with the matches that it leads to; squared distance."""
        return self.problem(rotation)[0].cost(rotation)

    def search(self, start: Array, max_iter: int, gradient_tol: float = 1e-9) -> Search:
        """Alternate matching and rotation, to a gradient norm, until nothing changes; keep the best iterate."""
        rotation, history = start, list[float]()
        seen: dict[bytes, Array] = {}
        best: tuple[float, Array, Matches] | None = None
        best_iteration = 0
        reason, converged = f"{max_iter} iterations without standing still", False
        for iteration in range(max_iter + 1):
            problem, matches = self.problem(rotation)
            # the last iterate is only measured
            step = problem.minimize(rotation, gradient_tol, 100 if iteration < max_iter else 0)
            cost, moved = float(np.sqrt(step.start_cost)), step.rotation
            history.append(cost)
            if best is None or cost < best[0]:
                best, best_iteration = (cost, rotation, matches), iteration
            if iteration == max_iter:
                break
            if iteration - best_iteration >= PATIENCE:
                reason = f"no better cost in {PATIENCE} iterations; iteration {best_iteration} is kept"
                break
            if rotation_angle(moved, rotation) <= self.tol:
                reason, converged = "matches and rotation stand still", True
                break
            key = matches.partners()
            if key in seen and rotation_angle(seen[key], moved) <= self.tol:
                reason, converged = f"matches repeat in a cycle; iteration {best_iteration} is kept", True
                break
            seen[key] = rotation = moved
        assert best is not None  # the loop runs at least once
        return Search(start, best[1], best[0], best[2], history, reason, converged)


def best_search(
    objective: Objective,
    first: Array,
    candidates: list[Array],
    limits: SearchLimits,
    n_jobs: int | None = None,
) -> SearchResult:
    """Follow the first start and the most promising candidates on part of the teacher; return the winner.

    A rival wins only when it is clearly better, so that of about equally good rotations (a nearly symmetric domain
    has many) the one that the means suggest is taken.
    """
    plain = objective.search(first, limits.max_iter)
    if not candidates or limits.rivals == 0:
        return SearchResult(plain, plain, [_followed(plain, True)])
    scouts = objective.scouts(SCOUTS)
    cost = objective.scouts(SCOUTS // 2).cost  # enough to rank what is far apart
    costs = [cost(rotation) for rotation in candidates]
    chosen = [candidates[i] for i in np.argsort(costs, kind="stable")[: limits.rivals]]
    steps = min(SCOUTING, limits.max_iter)
    if n_jobs is None:
        ends = [scouts.search(rotation, steps, SCOUTING_TOL) for rotation in chosen]
    else:
        ends = list(Parallel(n_jobs=n_jobs)(delayed(scouts.search)(start, steps, SCOUTING_TOL) for start in chosen))
    place = min(range(len(ends)), key=lambda i: ends[i].cost)
    # part of the teacher may mislead: the best rival has to beat the first start on all of it
    rival = replace(objective.search(ends[place].rotation, limits.max_iter), start=chosen[place])
    best = rival if rival.cost < plain.cost * (1.0 - limits.margin) - ROUNDING else plain
    followed = [_followed(end, False) for end in ends]
    followed[place] = _followed(rival, True)
    return SearchResult(best, plain, [_followed(plain, True), *followed])


def _followed(search: Search, complete: bool) -> Followed:
    return Followed(search.start, search.rotation, search.cost, complete)
