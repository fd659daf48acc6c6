"""Trajectory optimizer: banded Gauss-Newton over all waypoints at once, within joint limits.

It minimizes, over joint positions q_i at times t_i,

    Σ_i w_i f_i(q_i) + ∫ λ_v |q̇|² + λ_j |q⃛|² dt,

with f of `maniport.motion.problem`, w_i the time around a waypoint, and derivatives by divided differences
of neighboring waypoints. The third differences couple each waypoint with three before it, so that the normal equations
have a band of 4 · dof − 1 diagonals. Penalties are added for pairs of solids nearer than the clearance c, w_c² Σ
(c − distance)², and for what exceeds limits, ∫ w_l Σ (|q̇| / limit − 1)² + (|q̈| / limit − 1)² dt. Steps are damped after
Levenberg and Marquardt; joints that a step would drive beyond a position limit stay there.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, solveh_banded
from scipy.ndimage import maximum_filter1d

from maniport.arms import Arm, ArmGroup
from maniport.arms.collisions import Collisions
from maniport.motion.costs.cost import NormalEquations
from maniport.motion.costs.smoothness import SmoothnessCost
from maniport.motion.problem import MotionProblem
from maniport.motion.search import LARGEST_DAMPING, LEAST_GAIN, WaypointProblem
from maniport.motion.status import FAR
from maniport.util.validation import Array

CLEARANCE = 0.015  # Distance that motions keep from collisions [m]
CLEARANCE_WEIGHT = 300.0  # w_c [1/m]
POSITION_WEIGHTS = (30.0, 50.0, 100.0, 200.0, 400.0, 1000.0)
"""Weights of the position error, tried in turn until it is within the tolerance [1/m]."""


@dataclass(frozen=True)
class TrajectoryTerms:
    """What a trajectory costs besides its waypoints."""

    velocity_cost: float  # λ_v [s²/rad²]
    jerk_cost: float  # λ_j [s⁶/rad²]
    weights: Array | None = None  # w (n,) [s]; None: half the time to both neighbors
    velocity: Array | float = np.inf  # limits (dof,)
    acceleration: Array | float = np.inf  # limits (dof,)
    collisions: Collisions | None = None
    rel_tol: float = 1e-4  # smallest relative decrease of the cost for another step
    clearance: float | Array = CLEARANCE  # c, or c at each waypoint (n,) [m]


def optimize(
    problem: WaypointProblem, time: Array, q: Array, terms: TrajectoryTerms, position_weight: float
) -> Array:
    """Descend from joint positions q (n, dof); they end within the limits."""
    weighted = problem.with_position_weight(position_weight)
    cost = TrajectoryCost(problem.robot, weighted, time, terms)
    return np.asarray(levenberg_marquardt(cost, cost.within(q), terms.rel_tol))


def optimize_to_tolerance(
    problem: MotionProblem, time: Array, q: Array, terms: TrajectoryTerms, tolerance: float
) -> Array:
    """Optimize joint positions (n, dof) until the 95th percentile of the position error is within a tolerance [m].

    The position weight is raised in turn; the last attempt also smooths less.
    """
    less = replace(terms, velocity_cost=0.1 * terms.velocity_cost, jerk_cost=0.1 * terms.jerk_cost)
    needed = 0.0
    attempts = [(weight, terms) for weight in POSITION_WEIGHTS]
    attempts.append((POSITION_WEIGHTS[-1], less))
    for weight, chosen_terms in attempts:
        if weight < min(needed, POSITION_WEIGHTS[-1]):
            continue
        q = optimize(problem, time, q, chosen_terms, weight)
        errors = problem.position_errors(q)
        if errors is None:
            break
        reached = float(np.percentile(errors, 95.0, axis=0).max())
        if reached <= tolerance:
            break
        # the error falls with the square of the weight
        needed = 0.7 * weight * np.sqrt(reached / tolerance)
    return q


def relaxed(
    problem: MotionProblem,
    time: Array,
    q: Array,
    terms: TrajectoryTerms,
    tolerance: float,
    rounds: int = 6,
) -> Array:
    """Optimize joint positions (n, dof) again around position errors far beyond the tolerance [m].

    Each round has half the clearance and 1.5 times the duration there, as long as that helps. Returns the same array
    where no error is that large, or no round helps.
    """

    def largest_error(q: Array) -> Array:
        errors = problem.position_errors(q)
        if errors is None:
            return np.zeros(len(q))
        return np.asarray(errors.max(axis=1))

    clearance = np.full(len(time), CLEARANCE)
    error = largest_error(q)
    for _ in range(rounds):
        far = maximum_filter1d(error > FAR * tolerance, 5)
        if not far.any():
            break
        clearance = np.where(far, np.maximum(0.5 * clearance, 0.003), clearance)
        time = np.append(
            time[0], time[0] + np.cumsum(np.where(far[1:] & far[:-1], 1.5, 1.0) * np.diff(time))
        )
        # the cost is of all waypoints, so that it hardly changes where few of them do
        changed = replace(terms, clearance=clearance, rel_tol=0.1 * terms.rel_tol)
        trial = optimize(problem, time, q, changed, POSITION_WEIGHTS[-1])
        if terms.collisions is not None and terms.collisions.collides(trial[far]).any():
            break
        trial_error = largest_error(trial)
        if trial_error[far].max() > 0.95 * error[far].max():
            break
        q = trial
        error = trial_error
    return q


def time_weights(time: Array) -> Array:
    """Time around each waypoint [s], shape (n,): half of that to both neighbors."""
    halves = 0.5 * np.diff(time)
    return np.asarray(np.append(halves, 0.0) + np.append(0.0, halves))


State = TypeVar("State")
Slopes = TypeVar("Slopes")


class DescentProblem(Protocol[State, Slopes]):
    """A cost of states that `levenberg_marquardt` lowers."""

    def evaluate(self, state: State, /) -> tuple[float, Slopes]:
        """Return the cost and its slopes."""

    def trial(self, state: State, slopes: Slopes, damping: float, /) -> tuple[State, float]:
        """Return the state after a damped step, and the expected decrease of the cost."""


def levenberg_marquardt(
    problem: DescentProblem[State, Slopes], state: State, rel_tol: float, max_iter: int = 60
) -> State:
    """Descend until a step lowers the cost by less than its share `rel_tol`."""
    cost, slopes = problem.evaluate(state)
    damping = 1e-3
    growth = 2.0
    for _ in range(max_iter):
        trial, expected = problem.trial(state, slopes, damping)
        # most steps are taken: to evaluate the cost alone first takes longer
        trial_cost, trial_slopes = problem.evaluate(trial)
        gained = cost - trial_cost
        if gained > LEAST_GAIN * expected > 0.0:
            state = trial
            cost = trial_cost
            slopes = trial_slopes
            growth = 2.0
            damping *= max(1.0 / 3.0, 1.0 - (2.0 * gained / expected - 1.0) ** 3)
            if gained <= rel_tol * cost:
                break
        else:
            damping = damping * growth
            growth = growth * 2.0
            if damping > LARGEST_DAMPING or expected <= rel_tol * cost:
                break
    return state


class Waypoints(Protocol):
    """The costs of single waypoints, such as a `MotionProblem`."""

    def normal_equations(self, q: Array, /) -> NormalEquations:
        """Return the costs and their derivatives at q (n, dof)."""


class TrajectorySlopes(NamedTuple):
    """Derivatives of the cost of a trajectory of n waypoints."""

    gradient: Array  # half of it, (n, dof)
    hessian: Array  # Gauss-Newton blocks of the waypoints, (n, dof, dof)
    band: Array  # lower diagonals of each joint, (m, n, dof)


class TrajectoryCost:
    """Cost of a trajectory, its gradient and its banded Hessian."""

    def __init__(
        self, arm: Arm | ArmGroup, waypoints: Waypoints, time: Array, terms: TrajectoryTerms
    ):
        self.arm = arm
        self.waypoints = waypoints
        self.terms = terms
        self.weights = time_weights(time) if terms.weights is None else terms.weights
        self.clearance = np.broadcast_to(terms.clearance, len(time))
        factors = (terms.velocity_cost, terms.jerk_cost)
        limits = (terms.velocity, terms.acceleration)
        self.smoothness = SmoothnessCost(time, factors, limits)

    def evaluate(self, q: Array) -> tuple[float, TrajectorySlopes]:
        """Return cost and derivatives at q (n, dof)."""
        equations = self.waypoints.normal_equations(q)
        square = equations.distance**2
        gradient = equations.gradient
        hessian = equations.hessian
        if self.terms.collisions is not None:
            add_clearance_cost(self.terms.collisions, q, square, gradient, hessian, self.clearance)
        cost = float(self.weights @ square)
        gradient = self.weights[:, None] * gradient
        band = np.zeros((min(4, len(q)), *q.shape))  # lower diagonals of each joint
        cost = float(self.smoothness.add(q, cost, gradient, band))
        hessian = self.weights[:, None, None] * hessian
        return cost, TrajectorySlopes(gradient, hessian, band)

    def trial(self, q: Array, slopes: TrajectorySlopes, damping: float) -> tuple[Array, float]:
        """Return joint positions (n, dof) after a damped step, within the limits, and the expected decrease."""
        gradient, hessian, band = slopes
        damped = damping * (np.einsum("nii->ni", hessian) + band[0])
        blocked = blocked_joints(self.arm, q, gradient)
        step = -solve_banded(gradient[..., None], hessian, band, blocked, damped)[..., 0]
        return self.within(q + step), float(np.sum(step * (damped * step - gradient)))

    def within(self, q: Array) -> Array:
        """Return joint positions (n, dof) clipped to the limits."""
        return np.clip(q, self.arm.lower, self.arm.upper)


def add_clearance_cost(
    collisions: Collisions,
    q: Array,
    square: Array,
    gradient: Array,
    hessian: Array,
    clearance: Array | float = CLEARANCE,
) -> None:
    """Add the cost of pairs nearer than the clearance, one or (n,) [m], to squares (n,) and normal equations of q."""
    clearance = np.broadcast_to(clearance, len(q))
    stiffness = CLEARANCE_WEIGHT * (CLEARANCE / clearance)  # contact costs the same for every c
    rows, distance, slope = collisions.gradient(q, float(clearance.max()), scaled=True)
    lacking = stiffness[rows] * np.maximum(clearance[rows] - distance, 0.0)
    slope = (stiffness[rows] * (lacking > 0.0))[:, None] * slope
    np.add.at(square, rows, lacking**2)
    np.add.at(gradient, rows, -lacking[:, None] * slope)
    np.add.at(hessian, rows, slope[:, :, None] * slope[:, None, :])


def blocked_joints(arm: Arm | ArmGroup, q: Array, gradient: Array) -> NDArray[np.bool_]:
    """Return which joints are at a limit that the cost pushes them against, shape (..., dof)."""
    below = (q <= arm.lower) & (gradient > 0.0)
    above = (q >= arm.upper) & (gradient < 0.0)
    return np.asarray(below | above)


def solve_banded(
    sides: Array, hessian: Array, band: Array, blocked: NDArray[np.bool_], damped: Array
) -> Array:
    """Solve normal equations of a trajectory for sides (n, dof, k).

    Parameters
    ----------
    sides : ndarray, shape (n, dof, k)
    hessian : ndarray, shape (n, dof, dof)
        Blocks of each waypoint.
    band : ndarray, shape (m, n, dof)
        Lower diagonals of each joint, which couple waypoints.
    blocked : ndarray, shape (n, dof)
        Joints that do not move.
    damped : ndarray, shape (n, dof)
        What is added to the diagonal.

    Returns
    -------
    ndarray, shape (n, dof, k)
        Zero for blocked joints, and where the equations are singular.
    """
    n, dof, k = sides.shape
    free = ~blocked
    blocks = hessian * free[:, :, None] * free[:, None, :]
    lines = np.zeros((dof * len(band), n * dof))
    table = lines.reshape(len(lines), n, dof)
    for i in range(dof):
        for j in range(i + 1):
            table[i - j, :, j] = blocks[:, i, j]
    for below in range(len(band)):
        both_free = free[below:] & free[: n - below]
        table[below * dof, : n - below] += band[below, : n - below] * both_free
    table[0] += damped + np.where(free, 1e-12 * damped.max(), 1.0)
    right = (sides * free[..., None]).reshape(n * dof, k)
    try:
        solution = solveh_banded(lines, right, lower=True, check_finite=False)
    except LinAlgError:
        return np.zeros_like(sides)
    return np.asarray(solution.reshape(n, dof, k) * free[..., None])
