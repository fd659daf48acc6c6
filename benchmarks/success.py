"""How often the multi-start of the rotation step finds the best known optimum."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from joblib import Parallel, delayed
from scipy.stats import special_ortho_group

from maniport.transfer import Search
from maniport.transfer.icp.initialization import aligned_frames
from maniport.transfer.icp.rotation import RotationProblem

from .inputs import Array
from .measure import Row

PAIRS = 100
REFINED = Search().n_starts
"""Of all starts the most promising ones that are refined, as many as the ICP follows."""

REFERENCE_STARTS = 128
WANTED = 0.99
KINDS = ("copies", "noisy copies", "isotropic copies", "noisy isotropic copies", "unrelated clouds")


@dataclass(frozen=True)
class Outcome:
    """Costs of one problem: by the multi-start, and the best known."""

    kind: str
    cost: float
    reference: float
    single: float

    def found(self, cost: float) -> bool:
        """Whether a cost is that of the best known optimum."""
        return cost <= self.reference * (1.0 + 1e-6) + 1e-9


def rows(quick: bool) -> Iterator[Row]:
    """500 synthetic problems with fixed seeds, 100 of each kind."""
    each = 4 if quick else 100
    work = [(kind, seed) for kind in KINDS for seed in range(each)]
    outcomes: list[Outcome] = Parallel(n_jobs=-1, batch_size=5)(delayed(solve)(*one) for one in work)
    rates = {
        kind: np.mean([outcome.found(outcome.cost) for outcome in outcomes if outcome.kind == kind]) for kind in KINDS
    }
    rate = float(np.mean(list(rates.values())))
    single = float(np.mean([outcome.found(outcome.single) for outcome in outcomes]))
    yield Row(
        f"best known optimum of the rotation step, {len(work)} problems of {PAIRS} pairs",
        f"{rate:.1%}",
        f"one random start: {single:.1%}",
        f"{rate:.1%}",
        f"≥ {WANTED:.0%}",
        rate >= WANTED,
        ", ".join(f"{kind} {100 * share:.0f} %" for kind, share in rates.items())
        + f"; reference: the best of {REFERENCE_STARTS} random starts and all of ours",
    )


def solve(kind: str, seed: int) -> Outcome:
    """Make one problem, solve it by multi-start and by brute force."""
    random = np.random.default_rng([KINDS.index(kind), seed])
    student, teacher = clouds(kind, random)
    weights = random.uniform(0.5, 1.0, size=PAIRS) ** 3
    problem = RotationProblem(student, teacher, weights / weights.sum())
    candidates = aligned_frames(teacher, student, random)
    promising = sorted(candidates, key=problem.cost)[:REFINED]
    cost = min(problem.minimize(start).cost for start in promising)
    others = [problem.minimize(start).cost for start in special_ortho_group.rvs(3, REFERENCE_STARTS, random)]
    rest = [problem.minimize(start).cost for start in candidates]
    return Outcome(kind, cost, min(cost, *others, *rest), others[0])


def clouds(kind: str, random: np.random.Generator) -> tuple[Array, Array]:
    """Student and teacher, pairs of SPD matrices about the identity, shapes (n, 3, 3)."""
    stretch = np.ones(3) if "isotropic" in kind else np.array([1.5, 1.0, 0.6])
    if kind == "unrelated clouds":
        return _exponential(_symmetric(random, stretch)), _exponential(_symmetric(random, stretch))
    logarithms = _symmetric(random, stretch)
    rotation = special_ortho_group.rvs(3, random_state=random)
    noise = 0.3 * _symmetric(random, np.ones(3)) if "noisy" in kind else 0.0
    return _exponential(rotation @ logarithms @ rotation.T + noise), _exponential(logarithms)


def _symmetric(random: np.random.Generator, stretch: Array) -> Array:
    gaussian = random.normal(size=(PAIRS, 3, 3))
    return (gaussian + np.swapaxes(gaussian, 1, 2)) / 2.0 * np.sqrt(np.outer(stretch, stretch))


def _exponential(symmetric: Array) -> Array:
    values, vectors = np.linalg.eigh(symmetric)
    product = (vectors * np.exp(values)[:, None, :]) @ np.swapaxes(vectors, 1, 2)
    return (product + np.swapaxes(product, 1, 2)) / 2.0
