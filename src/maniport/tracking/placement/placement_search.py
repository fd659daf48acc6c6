"""The search for the place at which an arm can make the wanted ellipsoids best along a path.

For one placement x the cost is the mean over points of the path of min_q d²(A, M(q)) + (weight · |p(q) − p|)². Its
derivative in x is that of the sum with q held at the minimum (envelope theorem; Danskin, SIAM J. Appl. Math. 14,
1966), so that descending in x costs no more than evaluating: no derivative of the inner minimum is needed.
"""

from dataclasses import dataclass, replace
from itertools import count
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag
from scipy.optimize import minimize
from scipy.stats import qmc

from maniport.bodies import Arm
from maniport.bodies.chain import rotation_about
from maniport.bodies.joint_space import _SEED
from maniport.spd.kernels import congruence
from maniport.spd.matrix_functions import apply, roots
from maniport.steps import Part, between, nobody, pieces
from maniport.tracking.search.descent import Target, descend
from maniport.tracking.search.postures import postures_along
from maniport.tracking.search.start_bank import StartBank, semidefinite
from maniport.validation import Array

SEARCH_WEIGHT = 50.0
"""What a metre beside the path counts for during the search [1/m]; soft, since a stiff one creates local minima."""
STIFF_WEIGHT = 1000.0
"""The same for the reported distances [1/m]: the hand then stays beside the path by less than 0.1 mm."""
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
class Task:
    """A path around its centre with its ellipsoids, and the arm that shall follow.

    Attributes
    ----------
    arm : Arm
    bank : StartBank
        Of this arm; its options are those of the ellipsoids.
    path : ndarray, shape (n, 3)
        Hand positions relative to the path's centre [m], turned as the ellipsoids were.
    profile : ndarray, shape (n, d, d)
        Wanted ellipsoids at yaw zero, without floor.
    floor : float
        Added to wanted and own ellipsoids.
    """

    arm: Arm
    bank: StartBank
    path: Array
    profile: Array
    floor: float

    def thinned(self, points: int) -> "Task":
        """The same with so many points, evenly spaced along the sequence."""
        rows = np.unique(np.linspace(0, len(self.path) - 1, points).round().astype(int))
        return replace(self, path=self.path[rows], profile=self.profile[rows])

    def placed(self, placements: Array) -> tuple[Array, Array]:
        """Hand positions (k, n, 3) and ellipsoids (k, n, d, d) for placements (log scale, yaw, offset), (k, 5)."""
        turns = np.stack([rotation_about(2, yaw) for yaw in placements[:, 1]])
        scaled = np.exp(placements[:, 0])[:, None, None] * self.path
        hands = scaled @ np.swapaxes(turns, -1, -2) + placements[:, None, 2:]
        if self.profile.shape[-1] == 6:
            turns = np.stack([block_diag(turn, turn) for turn in turns])
        return hands, congruence(turns[:, None], self.profile)

    def target(self, hands: Array, profile: Array, weight: float) -> Target:
        """The inner problem for hand positions (n, 3) and ellipsoids (n, d, d)."""
        velocity = {name: value for name, value in self.bank.options.items() if name != "kind"}
        whitening = roots(profile + self.floor * np.eye(profile.shape[-1]))[1]
        return Target(self.arm, velocity, self.bank.options["kind"] == "force", self.floor, whitening, hands, weight)

    def starts(self, hands: Array, profile: Array, each: int) -> Array:
        """Nearest samples of the bank, shape (n, each, dof)."""
        return self.bank.query(semidefinite(profile), hands, each)


def best_placement(
    task: Task, given: Array, scales: tuple[float, float], points: int, seed: Any, tell: Part = nobody
) -> Array:
    """Search over what is nan in `given`, shape (5,): log scale, yaw and offset; the best placement, shape (5,).

    Parameters
    ----------
    task : Task
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
    fine = task.thinned(points)
    candidates = _candidates(task, given, scales, CANDIDATES, seed)
    candidates = candidates[np.argsort(_coarse_costs(task.thinned(COARSE_POINTS), candidates))[:SIEVE]]
    tell(0.1)
    moving = np.argsort(_moving_costs(task, candidates))[:KEPT]
    tell(0.2)
    # the best to move along, and the best by their points
    chosen = dict.fromkeys([*moving, *range(min(KEPT, len(candidates)))])
    tells = pieces(between(tell, 0.2, 0.9), *[1.0] * len(chosen))
    found = [_refined(fine, candidates[i], free, scales, one) for i, one in zip(chosen, tells, strict=True)]
    if free[1:4].all():  # most arms can do as well after a turn about their first axis: turn the path little
        best = found[int(np.argmin(_moving_costs(task, np.stack(found))))]
        unturned = np.array([best[0], 0.0, *rotation_about(2, -best[1]) @ best[2:]])
        found.append(_refined(fine, unturned, free, scales))
    placements = np.concatenate([found, candidates[moving]])
    costs = _moving_costs(task, placements)
    equal = placements[costs <= EQUALLY_GOOD * costs.min()]
    return np.asarray(equal[np.argmin(np.abs(_wrapped(equal[:, 1])))])


def _wrapped(angles: Array) -> Array:
    return np.remainder(angles + np.pi, 2.0 * np.pi) - np.pi


def _candidates(task: Task, given: Array, scales: tuple[float, float], n: int, seed: Any) -> Array:
    """Placements (n, 5): scales and yaws that fill their ranges, centres where the bank's hands are."""
    unit = qmc.Sobol(2, scramble=True, **{_SEED: seed}).random_base2(max(n - 1, 1).bit_length())[:n]
    low, high = np.log(scales)
    offsets = task.bank.hand_positions[seed.choice(len(task.bank), n, replace=n > len(task.bank))]
    table = np.column_stack([low + unit[:, 0] * (high - low), (2.0 * unit[:, 1] - 1.0) * np.pi, offsets])
    return np.where(np.isnan(given), table, given)


def _coarse_costs(task: Task, placements: Array) -> Array:
    hands, profiles = task.placed(placements)
    flat, wanted = hands.reshape(-1, 3), profiles.reshape(-1, *profiles.shape[2:])
    target = task.target(flat, wanted, SEARCH_WEIGHT)
    q = descend(target, task.starts(flat, wanted, COARSE_STARTS), TOLERANCE, COARSE_STEPS)
    return np.asarray(np.mean(_squares(target, q)[0].reshape(hands.shape[:2]), axis=1))


def _moving_costs(task: Task, placements: Array) -> Array:
    """Mean costs of moving along the path at placements (k, 5), from posture to posture; see `postures_along`."""
    part = task.thinned(MOVING_POINTS)
    hands, profiles = part.placed(placements)
    starts = task.starts(hands[:, 0], profiles[:, 0], MOVING_STARTS)
    target = task.target(hands.reshape(-1, 3), profiles.reshape(-1, *profiles.shape[2:]), SEARCH_WEIGHT)
    return postures_along(target, starts, len(placements))[1]


def _refined(
    task: Task, start: Array, free: NDArray[np.bool_], scales: tuple[float, float], tell: Part = nobody
) -> Array:
    """Descend from one placement to the one that is reached."""
    units = UNITS[free]
    last: dict[str, Array | None] = {"q": None}
    evaluations = count(1)

    def cost(steps: Array) -> tuple[float, Array]:
        placement = start.copy()
        placement[free] += units * steps
        value, gradient, last["q"] = _cost(task, placement, last["q"])
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


def _cost(task: Task, placement: Array, q: Array | None) -> tuple[float, Array, Array]:
    """Mean cost, its derivative (5,) in the placement, and the joint positions; `q` (n, dof) is tried as a start."""
    hands, profiles = (values[0] for values in task.placed(placement[None]))
    target = task.target(hands, profiles, SEARCH_WEIGHT)
    starts = task.starts(hands, profiles, FINE_STARTS)
    if q is not None:
        starts = np.concatenate([q[:, None], starts], axis=1)
    q = descend(target, starts, TOLERANCE, FINE_STEPS)
    squares, away = _squares(target, q)
    pull = -2.0 * SEARCH_WEIGHT**2 * away
    arms = hands - placement[2:]
    turning = pull[:, 1] * arms[:, 0] - pull[:, 0] * arms[:, 1] + _yaw_slopes(task, profiles, q)
    slopes = np.column_stack([np.sum(pull * arms, axis=1), turning, pull])
    return float(squares.mean()), slopes.mean(axis=0), q


def _squares(target: Target, q: Array) -> tuple[Array, Array]:
    """d² + (weight · |position error|)², shape (n,), and the position error, shape (n, 3)."""
    away = target.arm.forward(q)[:, :3, 3] - np.asarray(target.hands)
    return target.distance(q) ** 2 + target.weight**2 * np.sum(away**2, axis=1), away


def _yaw_slopes(task: Task, profiles: Array, q: Array) -> Array:
    """Derivative of d²(A, M) as A turns about the vertical: 4 tr(log(A⁻¹ M) K) with K the generator of the turn."""
    d = profiles.shape[-1]
    generator = np.zeros((d, d))
    for first in range(0, d, 3):
        generator[first + 1, first], generator[first, first + 1] = 1.0, -1.0
    raised = task.floor * np.eye(d)
    root, inverse = roots(profiles + raised)
    logs = apply(congruence(inverse, task.arm.manipulability(q, **task.bank.options) + raised), np.log)
    return np.asarray(4.0 * np.einsum("nij,ji->n", inverse @ logs @ root, generator))
