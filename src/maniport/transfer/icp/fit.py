"""The rotation between two recentred clouds, from arrays and options to a result."""

from dataclasses import dataclass, replace

import numpy as np

from maniport.spd.kernels import eigh
from maniport.transfer.cloud_pair import CloudPair
from maniport.transfer.icp.competition import compete
from maniport.transfer.icp.correspondence.contract import Correspondence
from maniport.transfer.icp.rotation import RotationPrior
from maniport.transfer.icp.search import Course, Objective, Search, best_search
from maniport.transfer.icp.starts import KnownPairs, starts, voted
from maniport.transfer.identifiability import LARGEST_EXAMINED, Ending
from maniport.validation import Array


@dataclass(frozen=True)
class Found:
    """What a search between two clouds came to.

    Attributes
    ----------
    course : Course
        The search that counts; its rotation is the one that is taken.
    best : ndarray, shape (d, d)
        The best rotation that was found, taken or not.
    start_kept : bool
        Whether the first start was kept against what was found, or found again.
    endings : list of Ending
        Where each start led.
    clouds : CloudPair
        Both, to be looked at as wholes.
    """

    course: Course
    best: Array
    start_kept: bool
    endings: list[Ending]
    clouds: CloudPair


def find_rotation(
    teacher: Array,
    student: Array,
    start: Array,
    correspondence: Correspondence,
    search: Search,
    pairs: KnownPairs | None,
    random: np.random.Generator,
    rivals: bool = True,
    n_jobs: int | None = None,
) -> Found:
    """Turn one cloud onto another by iterative closest point.

    Parameters
    ----------
    teacher, student : ndarray, shapes (n, d, d) and (m, d, d)
        Recentred at the identity, the teacher dilated.
    start : ndarray, shape (d, d)
        Where to start, unless the search is told to start at the identity or `pairs` suggest another rotation.
    correspondence : Correspondence
    search : Search
    pairs : KnownPairs or None
        Recentred as the clouds are.
    random : numpy.random.Generator
        For random starts.
    rivals : bool
        Whether other starts may compete.
    n_jobs : int, optional
        How many of these are followed at the same time.
    """
    clouds = CloudPair(teacher, student)
    moved, fixed = (most_singular(cloud, search.most_singular) for cloud in (teacher, student))
    first, candidates = _starts(moved, fixed, start, search, random, pairs, rivals)
    objective = _objective(moved, fixed, first, correspondence, search, pairs)
    result = best_search(objective, first, candidates, search, n_jobs)
    kept, reason = compete(clouds, result) if search.compete else (False, result.best.reason)
    course = result.best
    if kept:
        matches = objective.problem(first)[1]
        course = replace(result.plain, rotation=first, cost=result.plain.history[0], matches=matches, reason=reason)
    return Found(course, result.best.rotation, kept, result.endings, clouds)


def follow(
    teacher: Array,
    student: Array,
    start: Array,
    correspondence: Correspondence,
    search: Search,
    pairs: KnownPairs | None,
    near: Array | None,
) -> Array:
    """Return the start of such a search, or where it leads from the rotation `near`; for resampled clouds."""
    moved, fixed = (most_singular(cloud, search.most_singular) for cloud in (teacher, student))
    first, _ = _starts(moved, fixed, start, search, np.random.default_rng(0), pairs, rivals=False)
    if near is None:
        return first
    return _objective(moved, fixed, first, correspondence, search, pairs).search(near, search.max_iter).rotation


def most_singular(points: Array, count: int | None) -> Array:
    """Select the ellipsoids (n, d, d) with the largest condition number, in their order; all where `count` is None."""
    if count is None or count >= len(points):
        return points
    values, _ = eigh(points)
    chosen = np.sort(np.argsort(-values[:, -1] / values[:, 0], kind="stable")[:count])
    return np.asarray(points[chosen])


def _objective(
    teacher: Array, student: Array, first: Array, correspondence: Correspondence, search: Search,
    pairs: KnownPairs | None,
) -> Objective:  # fmt: skip
    prior = RotationPrior(first, search.prior_weight) if search.prior_weight > 0 else None
    return Objective(teacher, student, correspondence.between(teacher, student), search.tol, pairs, prior)


def _starts(
    teacher: Array,
    student: Array,
    start: Array,
    search: Search,
    random: np.random.Generator,
    pairs: KnownPairs | None,
    rivals: bool,
) -> tuple[Array, list[Array]]:
    """Return the first rotation, and those that may compete with it."""
    first, candidates = start if search.start == "parallel-transport" else np.eye(teacher.shape[-1]), list[Array]()
    if pairs is not None:
        first, *candidates = pairs.rotations(first, random)
    if not rivals or search.n_starts == 0 or teacher.shape[-1] > LARGEST_EXAMINED:
        return first, []
    return first, candidates if pairs is not None else [*voted(teacher, student), *starts(teacher, student, random)]
