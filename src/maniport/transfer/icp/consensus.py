"""Registration by the pairs that agree: for clouds with a part in common, and with outliers.

A map is good where many ellipsoids coincide with one of the other cloud. Ellipsoids are paired where each is the
nearest to the other, and all of the map is fitted to the pairs (`maniport.transfer.icp.pairs`) with weights that
decrease with their distance. This is repeated, first from the registration of `icp.algorithm`, then from the starts of
`icp.congruence`. A pair agrees where it is at most half as far apart as the student's ellipsoid is from its own
nearest neighbor. Ellipsoids of clouds without common ones agree by chance only, up to a fifth of them for d = 3.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from maniport.errors import NotSPDError
from maniport.spd.affine_invariant import Indices, NeighborIndex, distance_unchecked
from maniport.spd.kernels import congruence, power_congruence, roots
from maniport.spd.matrix_functions import apply, to_vector
from maniport.transfer.icp.pairs import Factors, Weighting, fit_pairs
from maniport.util.sampling import evenly_spaced
from maniport.util.validation import Array

AGREEMENT = 0.5  # largest distance of a pair that agrees, in distances to the nearest neighbor

CHANCE = (
    0.2  # share of the smaller cloud that agrees by chance: at most 0.19 was measured for d = 3
)

CHANCE_PLANAR = 0.3  # the same for d = 2, where 0.29 was measured

FEWEST = 8  # pairs above that share which a consensus has: three pairs determine a map

SEEKERS = 200  # largest number of ellipsoids of the smaller cloud that are paired in the search

CERTAIN = 1.5  # times the least number of pairs: then no further start is followed

FOLLOWED = 12  # starts of those that are given

SEARCH_ROUNDS = 6  # pairings from one start, each followed by one step of the map

FINAL_ROUNDS = 20  # largest number of pairings of a map that is taken


@dataclass(frozen=True)
class Pairs:
    """Which ellipsoids are the nearest to each other, indices (k,) into both clouds, and their distances (k,)."""

    teacher: Indices
    student: Indices
    distances: Array


@dataclass(frozen=True)
class Consensus:
    """A map, the pairs that agree on it, and the root mean squared distance of pairs in each round."""

    factors: Factors
    pairs: Pairs
    history: list[float]
    converged: bool


class Clouds:
    """Two clouds of SPD matrices, shapes (n, d, d) and (m, d, d), whose ellipsoids are paired under a map."""

    def __init__(self, teacher: Array, student: Array, seekers: int | None = None):
        self.teacher = teacher
        self.student = student
        self.index = NeighborIndex(student)
        self.smaller = min(len(teacher), len(student))
        self._seeking = evenly_spaced(self.smaller, seekers)

    @property
    def count(self) -> int:
        """Number of ellipsoids that seek a partner."""
        return len(self._seeking)

    @property
    def least(self) -> float:
        """Number of pairs that agree above which they do so not by chance."""
        if self.student.shape[-1] == 2:
            chance = CHANCE_PLANAR
        else:
            chance = CHANCE
        return chance * self.count + FEWEST

    @cached_property
    def spacing(self) -> Array:
        """Distances of the student's ellipsoids to the nearest other one, shape (m,)."""
        return spacing_of(self.student)

    def pairs(self, factors: Factors) -> Pairs:
        """Pair the ellipsoids that are the nearest to each other under a map."""
        images = power_congruence(factors.left, self.teacher, factors.ratio, factors.right)
        image_index = NeighborIndex(images)
        if len(self.teacher) <= len(self.student):
            teacher = self._seeking
            student, distances = self.index.query(images[teacher])
            back, _ = image_index.query(self.student[student])
            mutual = back == teacher
        else:
            student = self._seeking
            teacher, distances = image_index.query(self.student[student])
            back, _ = self.index.query(images[teacher])
            mutual = back == student
        return Pairs(teacher[mutual], student[mutual], distances[mutual])

    def agreeing(self, pairs: Pairs) -> Pairs:
        """Return the pairs that agree."""
        largest = AGREEMENT * self.spacing[pairs.student] + 1e-9  # equal ellipsoids agree, too
        near = pairs.distances <= largest
        return Pairs(pairs.teacher[near], pairs.student[near], pairs.distances[near])


def find_consensus(
    teacher: Array, student: Array, first: Factors, others: Iterable[Factors]
) -> Consensus | None:
    """Return the consensus of most pairs, fitted to all of them; None where no more pairs agree than by chance.

    Parameters
    ----------
    teacher, student : ndarray, shapes (n, d, d) and (m, d, d)
    first : Factors
        The map of the first start.
    others : iterable of Factors
        Further starts, taken only where the first leads to no certain consensus.
    """
    part = Clouds(teacher, student, SEEKERS)
    found = _search(part, [first])
    if found is None or len(found.pairs.distances) < CERTAIN * part.least:
        further = _promising(part, others)
        if found is not None:
            further.append(found.factors)
        found = _search(part, further)
    if found is None:
        return None

    whole = Clouds(teacher, student)
    final = refined(whole, found.factors, FINAL_ROUNDS, patient=True)
    if final is None or len(final.pairs.distances) < whole.least:
        return None
    return final


def _search(clouds: Clouds, starts: Iterable[Factors]) -> Consensus | None:
    """Return the consensus of most pairs, or the first one that is certain."""
    best: Consensus | None = None
    most = clouds.least
    for start in starts:
        consensus = refined(clouds, start, SEARCH_ROUNDS, patient=False)
        if consensus is None:
            continue
        count = len(consensus.pairs.distances)
        if count >= most:
            best = consensus
            most = count
        if count >= CERTAIN * clouds.least:
            break
    return best


def _promising(clouds: Clouds, starts: Iterable[Factors]) -> list[Factors]:
    """Return the `FOLLOWED` starts with the most pairs that are nearer than neighbors."""
    maps = []
    counts = []
    for start in starts:
        try:
            pairs = clouds.pairs(start)
        except NotSPDError:  # it dilates ellipsoids beyond what numbers hold
            continue
        maps.append(start)
        counts.append(int(np.sum(pairs.distances < clouds.spacing[pairs.student])))
    order = np.argsort(-np.array(counts), kind="stable")[:FOLLOWED]
    return [maps[place] for place in order]


def refined(clouds: Clouds, start: Factors, rounds: int, patient: bool) -> Consensus | None:
    """Pair and fit in turn until the pairs stay the same; None where no map comes of it.

    Unless `patient`, each round has one step of the fit, and a start is given up where fewer pairs agree after two
    rounds than a quarter of those that are due by chance.
    """
    factors = start
    history = list[float]()
    before: Pairs | None = None
    converged = False
    if patient:
        steps = 3
    else:
        steps = 1
    try:
        pairs = clouds.pairs(factors)
        for number in range(rounds):
            if len(pairs.distances) < FEWEST:
                return None
            if before is not None and _same(pairs, before) and patient:
                converged = True
                break
            scaled = pairs
            if patient:  # the others, up to half of the pairs, would keep the scale wide
                scaled = clouds.agreeing(pairs)
            if len(scaled.distances) < FEWEST:
                return None
            weighting = weighting_of(scaled.distances)
            chosen = clouds.teacher[pairs.teacher], clouds.student[pairs.student]
            factors, distances = fit_pairs(factors, *chosen, weighting, steps)
            history.append(_weighted_rms(distances, weighting))
            before = pairs
            pairs = clouds.pairs(factors)
            agreeing = len(clouds.agreeing(pairs).distances)
            if not patient and agreeing >= CERTAIN * clouds.least:
                break
            if not patient and number >= 2 and agreeing < 0.25 * clouds.least:
                break
    except NotSPDError:  # it dilates ellipsoids beyond what numbers hold
        return None
    return Consensus(factors, clouds.agreeing(pairs), history, converged)


def weighting_of(distances: Array) -> Weighting:
    """Weights (c² / (c² + d²))² of Geman and McClure, with the median distance as scale c."""
    scale = max(float(np.median(distances)), 1e-12)

    def weighting(values: Array) -> Array:
        return np.asarray((scale**2 / (scale**2 + values**2)) ** 2)

    return weighting


def spacing_of(points: Array, candidates: int = 6) -> Array:
    """Distances of SPD matrices (n, d, d) to the nearest other one, of those with the nearest logarithms; (n,)."""
    log_euclidean_mean = apply(apply(points, np.log).mean(axis=0), np.exp)
    _, whitening = roots(log_euclidean_mean)
    centered = congruence(whitening, points)
    vectors = to_vector(apply(centered, np.log))
    count = min(candidates, len(points))
    _, nearest = cKDTree(vectors).query(vectors, k=[*range(1, count + 1)])
    distances = distance_unchecked(centered[:, None], centered[nearest])
    itself: NDArray[np.bool_] = nearest == np.arange(len(points))[:, None]
    return np.asarray(np.where(itself, np.inf, distances).min(axis=1))


def _same(pairs: Pairs, others: Pairs) -> bool:
    return np.array_equal(pairs.teacher, others.teacher) and np.array_equal(
        pairs.student, others.student
    )


def _weighted_rms(distances: Array, weighting: Weighting) -> float:
    weights = weighting(distances)
    return float(np.sqrt(weights @ distances**2 / weights.sum()))
