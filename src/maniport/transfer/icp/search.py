"""The search of the iterative closest point: its options, from one start, and over rival starts."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from maniport.transfer.cloud_pair import in_turn
from maniport.transfer.icp.correspondence.contract import Matches, Matching, Options
from maniport.transfer.icp.rotation import RotationPrior, RotationProblem, Whitening
from maniport.transfer.icp.starts import KnownPairs
from maniport.transfer.identifiability import LARGEST_EXAMINED, Ending
from maniport.transfer.rotation_group import rotation_angle
from maniport.validation import Array, as_choice, as_count, as_flag, as_number

SCOUTS = 400
"""Ellipsoids of a seeking side that the rival starts are compared on; half of them are enough to rank many."""

SCOUTING = 2
"""Iterations after which rivals are compared; the best one is followed to its end."""

SCOUTING_TOL = 1e-3
"""Gradient norm to which rotations are found then."""

HASTY_STEPS = 2
"""Steps of a descent between two matchings beyond d = 6, where each is dear; the search still ends where both stand."""

PATIENCE = 5
"""Iterations without a better cost after which the search ends."""

ROUNDING = 1e-6
"""Costs that differ by less, absolutely, are equal."""


@dataclass(frozen=True, repr=False)
class Search(Options):
    """Where, how widely and how long `RiemannianICP` searches, and what becomes of what it finds.

    Parameters
    ----------
    start : {"parallel-transport", "identity"}
        First rotation of recentred ellipsoids.
    n_starts : int
        When no mounting is given: how many rival starts, aligned with the frames of the two clouds or proposed by
        ellipsoids that look like copies, are also followed. Zero leaves `start` alone.
    margin : float
        Fraction by which a rival's cost must be lower to displace `start`. Clouds of arms are nearly symmetric, so that
        wrong rotations cost hardly more than the right one: between two draws of the Panda's own domain, a rival 1.2 %
        cheaper was off by 180°. Where the clouds do tell, the gain is large. Zero takes whatever is cheapest.
    compete : bool
        Keep the first start unless the rotation that is found clearly brings the clouds nearer; see
        `maniport.transfer.icp.fit`. False takes what is found, as the paper does.
    prior_weight : float
        Adds prior_weight · θ² to the mean squared distance, θ [rad] being the turn away from the start (for large
        turns 2 (1 − cos θ) instead of θ²). Directions along which the cost of anew matched clouds is curved by much
        more than 2 · prior_weight are decided by the clouds, the others by the start. Sampling noise slopes the cost
        along flat directions too, so that few samples need a larger weight; zero leaves all to the clouds.
    most_singular : int, optional
        Match only this many ellipsoids of each domain, those with the largest condition after recentring.
    max_iter : int
        Largest number of iterations from each start.
    tol : float
        Rotation [rad] below which an iteration counts as standing still.

    Raises
    ------
    UnknownNameError, InvalidInputError
        When an option is wrong.

    See Also
    --------
    RiemannianICP : takes it.
    """

    start: str = "parallel-transport"
    n_starts: int = 8
    margin: float = 0.05
    compete: bool = True
    prior_weight: float = 0.0
    most_singular: int | None = None
    max_iter: int = 100
    tol: float = 1e-8

    def __post_init__(self) -> None:
        as_choice(self.start, "start", ("parallel-transport", "identity"))
        as_count(self.n_starts, "n_starts", minimum=0)
        as_number(self.margin, "margin", minimum=0.0, below=1.0)
        as_flag(self.compete, "compete")
        as_number(self.prior_weight, "prior_weight", minimum=0.0)
        if self.most_singular is not None:
            as_count(self.most_singular, "most_singular", minimum=2)
        as_count(self.max_iter, "max_iter")
        as_number(self.tol, "tol", above=0.0)


@dataclass(frozen=True)
class Course:
    """How the search from one start went; rotation, cost and matches belong to its best iterate."""

    start: Array
    rotation: Array
    cost: float
    matches: Matches
    history: list[float]
    reason: str
    converged: bool


@dataclass(frozen=True)
class SearchResult:
    """The search that won, the one from the given start, and where every start led, the given one first."""

    best: Course
    plain: Course
    endings: list[Ending]


class Objective:
    """What the search minimises: weighted squared distances of matched and of known pairs, and the prior.

    Known pairs take half of the weight in every rotation step. They and the clouds, shapes (n, d, d) and (m, d, d), are
    recentred; `matching` is that of the clouds, and `tol` is explained at `Search`.
    """

    def __init__(
        self,
        teacher: Array,
        student: Array,
        matching: Matching,
        tol: float,
        pairs: KnownPairs | None = None,
        prior: RotationPrior | None = None,
    ):
        self.matching, self.tol, self.prior = matching, tol, prior
        self._known: Matches | None = None
        if pairs is not None:  # they stand behind the clouds
            place, count = np.arange(len(pairs.teacher)), len(pairs.teacher)
            self._known = Matches(len(teacher) + place, len(student) + place, np.full(count, 1.0 / count))
            teacher, student = np.concatenate([teacher, pairs.teacher]), np.concatenate([student, pairs.student])
        self._teacher, self._student = teacher, Whitening.of(student)

    def problem(self, rotation: Array, scouts: int | None = None) -> tuple[RotationProblem, Matches]:
        """Match under `rotation`, or only `scouts` of each side that seeks; return the rotation problem, and these."""
        matches = self.matching(rotation, scouts)
        every = matches if self._known is None else matches.beside(self._known)
        student, teacher = self._student.pick(every.student), self._teacher[every.teacher]
        return RotationProblem(student, teacher, every.weight, self.prior), matches

    def search(self, start: Array, max_iter: int, gradient_tol: float = 1e-9, scouts: int | None = None) -> Course:
        """Alternate matching and rotation, to a gradient norm, until nothing changes; keep the best iterate."""
        rotation, history = start, list[float]()
        seen: dict[bytes, Array] = {}
        best: tuple[float, Array, Matches] | None = None
        best_iteration = 0
        reason, converged = f"{max_iter} iterations without standing still", False
        steps = 100 if len(start) <= LARGEST_EXAMINED else HASTY_STEPS
        for iteration in range(max_iter + 1):
            problem, matches = self.problem(rotation, scouts)
            # the last iterate is only measured
            step = problem.minimize(rotation, gradient_tol, steps if iteration < max_iter else 0)
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
        return Course(start, best[1], best[0], best[2], history, reason, converged)


def best_search(
    objective: Objective, first: Array, candidates: Sequence[Array], options: Search, n_jobs: int | None = None
) -> SearchResult:
    """Follow the first start and the most promising candidates on part of the teacher; return the winner."""
    plain = objective.search(first, options.max_iter)
    if not candidates or options.n_starts == 0:
        return SearchResult(plain, plain, [Ending(plain.rotation, plain.cost)])
    costs = [objective.problem(rotation, SCOUTS // 2)[0].cost(rotation) for rotation in candidates]
    chosen = [candidates[i] for i in np.argsort(costs, kind="stable")[: options.n_starts]]
    most = min(SCOUTING, options.max_iter)
    courses = in_turn(
        partial(objective.search, max_iter=most, gradient_tol=SCOUTING_TOL, scouts=SCOUTS), chosen, n_jobs
    )
    place = min(range(len(courses)), key=lambda i: courses[i].cost)
    # part of the teacher may mislead: the best rival has to beat the first start on all of it
    courses[place] = rival = replace(objective.search(courses[place].rotation, options.max_iter), start=chosen[place])
    best = rival if rival.cost < plain.cost * (1.0 - options.margin) - ROUNDING else plain
    return SearchResult(best, plain, [Ending(one.rotation, one.cost) for one in (plain, *courses)])
