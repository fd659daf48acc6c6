"""The rotation between two recentred clouds, from arrays and options to a result."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from maniport.spd.kernels import eigh
from maniport.transfer.cloud_pair import CloudPair
from maniport.transfer.icp.correspondence.contract import Correspondence
from maniport.transfer.icp.rotation import RotationPrior
from maniport.transfer.icp.search import Course, Objective, Search, SearchResult, best_search
from maniport.transfer.icp.starts import KnownPairs, starts, voted
from maniport.transfer.identifiability import LARGEST_EXAMINED
from maniport.transfer.rotation_group import rotation_angle
from maniport.validation import Array

CERTAIN = 3.0
"""Standard errors by which the mean distance between the clouds must fall, or more ellipsoids coincide.

Measured for the latter, 30 draws each of 8 to 1000 ellipsoids of arms, where the start is right: at most 2.5.
"""

WORTH_WHILE = 0.1
"""Share of the energy distance between the clouds that must be gained.

Measured on ten draws each, 4096 and 16384 ellipsoids: where the start was right, −0.6 to 0.4 standard errors (Panda to
Panda); where the domains differ in shape, −1.9 to 3.8 and at most 4 % (human to Panda), and the rotation found was
another one for every draw; where the start was 30° off, 3.9 to 5.9 and more than half.
"""

EXACT = 0.5
"""Share of the start's cost below which the matches are so good that no chance explains them.

Measured: 0.62 at least between independent draws of 12 ellipsoids and 0.89 of 400 (human to Panda).
"""

STILL = 1e-6
"""Rotations closer than this are the same [rad]."""


def compete(pair: CloudPair, result: SearchResult) -> tuple[bool, str]:
    """Ask whether the rotation that was found clearly brings the clouds nearer than the start."""
    start, found = result.plain, result.best
    angle = rotation_angle(start.start, found.rotation)
    if angle < STILL:
        return True, found.reason
    if found.cost <= EXACT * start.history[0]:
        return False, found.reason
    gain = pair.gain(start.start, found.rotation)
    share = 2.0 * gain.mean / pair.energy_distance(start.start)
    if gain.certainty >= CERTAIN and share >= WORTH_WHILE:
        return False, found.reason
    if pair.coincidence(pair.nearest(start.start), pair.nearest(found.rotation)).certainty >= CERTAIN:
        return False, found.reason
    off = f"the start is kept: the rotation found ({found.reason}), {np.rad2deg(angle):.1f}° away,"
    if gain.mean <= 0.0:
        return True, f"{off} does not bring the domains nearer"
    return True, f"{off} brings the domains nearer by {share:.1%} ± {share / gain.certainty:.1%} only"


@dataclass(frozen=True)
class Found:
    """What a search came to: the course that counts, and whether the first start was kept or found again."""

    course: Course
    start_kept: bool
    result: SearchResult
    clouds: CloudPair


@dataclass(frozen=True)
class RotationTask:
    """One cloud is to be turned onto another by iterative closest point.

    Clouds, shapes (n, d, d) and (m, d, d), and pairs are recentred at the identity, the teacher's dilated. It starts at
    the rotation `start`, unless the search is told to start at the identity or `pairs` suggest another one.
    """

    teacher: Array
    student: Array
    start: Array
    correspondence: Correspondence
    search: Search
    pairs: KnownPairs | None

    def solve(self, random: np.random.Generator, rivals: bool, n_jobs: int | None = None) -> Found:
        """Search, with `random` starts among the `rivals` if these may compete, `n_jobs` of them at the same time."""
        clouds = CloudPair(self.teacher, self.student)
        first, candidates = self._starts(random, rivals)
        objective = self._objective(first)
        result = best_search(objective, first, candidates, self.search, n_jobs)
        kept, reason = compete(clouds, result) if self.search.compete else (False, result.best.reason)
        course = result.best
        if kept:
            matches = objective.problem(first)[1]
            course = replace(result.plain, rotation=first, cost=result.plain.history[0], matches=matches, reason=reason)
        return Found(course, kept, result, clouds)

    def follow(self, near: Array | None) -> Array:
        """Return the start of the search, or where it leads from the rotation `near`; for resampled domains."""
        first, _ = self._starts(np.random.default_rng(0), rivals=False)
        return first if near is None else self._objective(first).search(near, self.search.max_iter).rotation

    @cached_property
    def _matched(self) -> tuple[Array, Array]:
        """Those of both clouds that are matched."""
        count = self.search.most_singular
        return most_singular(self.teacher, count), most_singular(self.student, count)

    def _objective(self, first: Array) -> Objective:
        prior = RotationPrior(first, self.search.prior_weight) if self.search.prior_weight > 0 else None
        matching = self.correspondence.between(*self._matched)
        return Objective(*self._matched, matching, self.search.tol, self.pairs, prior)

    def _starts(self, random: np.random.Generator, rivals: bool) -> tuple[Array, list[Array]]:
        """Return the first rotation, and those that may compete with it."""
        d = len(self.start)
        first, candidates = self.start if self.search.start == "parallel-transport" else np.eye(d), list[Array]()
        if self.pairs is not None:
            first, *candidates = self.pairs.rotations(first, random)
        if not rivals or self.search.n_starts == 0 or d > LARGEST_EXAMINED:
            return first, []
        if self.pairs is None:
            candidates = [*voted(*self._matched), *starts(*self._matched, random)]
        return first, candidates


def most_singular(points: Array, count: int | None) -> Array:
    """Select the ellipsoids (n, d, d) with the largest condition number, in their order; all where `count` is None."""
    if count is None or count >= len(points):
        return points
    values, _ = eigh(points)
    chosen = np.sort(np.argsort(-values[:, -1] / values[:, 0], kind="stable")[:count])
    return np.asarray(points[chosen])
