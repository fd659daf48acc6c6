"""The search for the place at which an arm can make the target ellipsoids best along a path.

For one placement x the cost is the mean over points of the path of min_q f(q), f as in `maniport.tracking.objective`.
Its derivative in x is that of the sum with q held at the minimum (envelope theorem; Danskin, SIAM J. Appl. Math. 14,
1966), so that descending in x costs no more than evaluating: no derivative of the inner minimum is needed.
"""

from dataclasses import dataclass, replace
from itertools import count
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.stats import qmc

from maniport.bodies.chain import rotation_about
from maniport.bodies.joint_space import _SEED
from maniport.spd.kernels import congruence
from maniport.steps import Part, between, nobody, pieces
from maniport.tracking.objective import Objective, Targets
from maniport.tracking.search.descent import descend, postures_along
from maniport.tracking.search.start_bank import StartBank
from maniport.validation import Array

UNITS = np.array([0.2, 0.3, 0.1, 0.1, 0.1])
"""First step of the descent in log scale, yaw [rad] and offset [m]."""
CANDIDATES, SIEVE, KEPT = 1024, 40, 6
"""How many placements are scored by a few points, how many of these by moving along them, and how many refined."""
COARSE_POINTS, COARSE_STARTS, COARSE_STEPS = 6, 2, 6
MOVING_POINTS, MOVING_STARTS = 40, 8
FINE_STARTS, FINE_STEPS, FINE_EVALUATIONS = 4, 25, 40
TOLERANCE = 1e-5
EQUALLY_GOOD = 1.05
"""Ratio of costs up to which the placement with the smaller yaw is taken."""


@dataclass(frozen=True)
class Journey:
    """A path around its centre with its ellipsoids, and what following it costs an arm.

    Attributes
    ----------
    objective : Objective
    bank : StartBank
        Of the objective's arm and ellipsoids.
    path : ndarray, shape (n, 3)
        Positions relative to the path's centre [m], turned as the ellipsoids were.
    profile : ndarray, shape (n, d, d)
        Target ellipsoids at yaw zero, without damping.
    """

    objective: Objective
    bank: StartBank
    path: Array
    profile: Array

    def thinned(self, points: int) -> "Journey":
        """The same with so many points, evenly spaced along the sequence."""
        rows = np.unique(np.linspace(0, len(self.path) - 1, points).round().astype(int))
        return replace(self, path=self.path[rows], profile=self.profile[rows])

    def placed(self, placements: Array) -> tuple[Array, Array]:
        """Tip positions (k, n, 3) and ellipsoids (k, n, d, d) for placements (log scale, yaw, offset), (k, 5)."""
        turns = np.stack([rotation_about(2, yaw) for yaw in placements[:, 1]])
        scaled = np.exp(placements[:, 0])[:, None, None] * self.path
        tips = scaled @ np.swapaxes(turns, -1, -2) + placements[:, None, 2:]
        turns = np.stack([self.objective.spec.rotation(turn) for turn in turns])
        return tips, congruence(turns[:, None], self.profile)

    def starts(self, tips: Array, profile: Array, each: int) -> Array:
        """Nearest samples of the bank, shape (n, each, dof)."""
        return self.bank.starts(profile, tips, each)


def best_placement(
    journey: Journey, given: Array, scales: tuple[float, float], points: int, seed: Any, tell: Part = nobody
) -> Array:
    """Search over what is nan in `given`, shape (5,): log scale, yaw and offset; the best placement, shape (5,).

    Parameters
    ----------
    journey : Journey
    given : ndarray, shape (5,)
        nan where free.
    scales : tuple of float
        Smallest and largest scale.
    points : int
        How many points of the path the descent looks at.
    seed : numpy.random.Generator
    tell : callable
        Called with the fraction done.
    """
    free = np.isnan(given)
    if not free.any():
        return given
    fine = journey.thinned(points)
    candidates = _candidates(journey, given, scales, CANDIDATES, seed)
    candidates = candidates[np.argsort(_coarse_costs(journey.thinned(COARSE_POINTS), candidates))[:SIEVE]]
    tell(0.1)
    moving = np.argsort(_moving_costs(journey, candidates))[:KEPT]
    tell(0.2)
    # the best to move along, and the best by their points
    chosen = dict.fromkeys([*moving, *range(min(KEPT, len(candidates)))])
    tells = pieces(between(tell, 0.2, 0.9), *[1.0] * len(chosen))
    found = [_refined(fine, candidates[i], free, scales, one) for i, one in zip(chosen, tells, strict=True)]
    if free[1:4].all():  # most arms can do as well after a turn about their first axis: turn the path little
        best = found[int(np.argmin(_moving_costs(journey, np.stack(found))))]
        unturned = np.array([best[0], 0.0, *rotation_about(2, -best[1]) @ best[2:]])
        found.append(_refined(fine, unturned, free, scales))
    placements = np.concatenate([found, candidates[moving]])
    costs = _moving_costs(journey, placements)
    equal = placements[costs <= EQUALLY_GOOD * costs.min()]
    return np.asarray(equal[np.argmin(np.abs(_wrapped(equal[:, 1])))])


def _wrapped(angles: Array) -> Array:
    return np.remainder(angles + np.pi, 2.0 * np.pi) - np.pi


def _candidates(journey: Journey, given: Array, scales: tuple[float, float], n: int, seed: Any) -> Array:
    """Placements (n, 5): scales and yaws that fill their ranges, centres where the bank's tips are."""
    unit = qmc.Sobol(2, scramble=True, **{_SEED: seed}).random_base2(max(n - 1, 1).bit_length())[:n]
    low, high = np.log(scales)
    offsets = journey.bank.tip_positions[seed.choice(len(journey.bank), n, replace=n > len(journey.bank))]
    table = np.column_stack([low + unit[:, 0] * (high - low), (2.0 * unit[:, 1] - 1.0) * np.pi, offsets])
    return np.where(np.isnan(given), table, given)


def _coarse_costs(journey: Journey, placements: Array) -> Array:
    tips, profiles = journey.placed(placements)
    flat, ellipsoids = tips.reshape(-1, 3), profiles.reshape(-1, *profiles.shape[2:])
    targets = journey.objective.targets(ellipsoids, flat)
    q = descend(targets, journey.starts(flat, ellipsoids, COARSE_STARTS), TOLERANCE, COARSE_STEPS)
    return np.asarray(np.mean(targets.cost(q).reshape(tips.shape[:2]), axis=1))


def _moving_costs(journey: Journey, placements: Array) -> Array:
    """Mean costs of moving along the path at placements (k, 5), from posture to posture; see `postures_along`."""
    part = journey.thinned(MOVING_POINTS)
    tips, profiles = part.placed(placements)
    starts = journey.starts(tips[:, 0], profiles[:, 0], MOVING_STARTS)
    targets = journey.objective.targets(profiles.reshape(-1, *profiles.shape[2:]), tips.reshape(-1, 3))
    return postures_along(targets, starts, len(placements))[1]


def _refined(
    journey: Journey, start: Array, free: NDArray[np.bool_], scales: tuple[float, float], tell: Part = nobody
) -> Array:
    """Descend from one placement to the one that is reached."""
    units = UNITS[free]
    last: dict[str, Array | None] = {"q": None}
    evaluations = count(1)

    def cost(steps: Array) -> tuple[float, Array]:
        placement = start.copy()
        placement[free] += units * steps
        value, gradient, last["q"] = _cost(journey, placement, last["q"])
        tell(min(next(evaluations) / FINE_EVALUATIONS, 1.0))
        return value, units * gradient[free]

    ends = [np.log(scales) - start[0], (-np.inf, np.inf), *3 * [(-np.inf, np.inf)]]
    bounds = [tuple(np.asarray(end) / unit) for end, unit, moves in zip(ends, UNITS, free, strict=True) if moves]
    found = minimize(
        cost, np.zeros(free.sum()), jac=True, method="L-BFGS-B", bounds=bounds,
        options={"maxfun": FINE_EVALUATIONS, "ftol": 1e-4, "maxls": 8},
    )  # fmt: skip
    placement = start.copy()
    placement[free] += units * found.x
    return placement


def _cost(journey: Journey, placement: Array, q: Array | None) -> tuple[float, Array, Array]:
    """Mean cost, its derivative (5,) in the placement, and the joint positions; `q` (n, dof) is tried as a start."""
    tips, profiles = (values[0] for values in journey.placed(placement[None]))
    targets = journey.objective.targets(profiles, tips)
    starts = journey.starts(tips, profiles, FINE_STARTS)
    if q is not None:
        starts = np.concatenate([q[:, None], starts], axis=1)
    q = descend(targets, starts, TOLERANCE, FINE_STEPS)
    pull = -2.0 * journey.objective.position_weight**2 * targets.tip_offset(q)
    arms = tips - placement[2:]
    turning = pull[:, 1] * arms[:, 0] - pull[:, 0] * arms[:, 1] + _yaw_slopes(targets, q)
    slopes = np.column_stack([np.sum(pull * arms, axis=1), turning, pull])
    return float(targets.cost(q).mean()), slopes.mean(axis=0), q


def _yaw_slopes(targets: Targets, q: Array) -> Array:
    """Derivative of d²(A, M) as A turns about the vertical: 4 tr(log(A⁻¹ M) K) with K the generator of the turn."""
    d = targets.objective.spec.size
    generator = np.zeros((d, d))
    for first in range(0, d, 3):
        generator[first + 1, first], generator[first, first + 1] = 1.0, -1.0
    logs = targets.whitening @ targets.logarithms(q) @ targets.root
    return np.asarray(4.0 * np.einsum("nij,ji->n", logs, generator))
