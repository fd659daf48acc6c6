"""All points of a motion at once: banded Gauss-Newton within joint limits.

Minimized is, over joint positions q_i at times t_i,

    Σ_i w_i f_i(q_i) + ∫ λ_v |q̇|² + λ_j |q⃛|² dt,

with f as in `maniport.tracking.objective`, w_i the time that a point stands for, and derivatives by divided differences
of neighbouring points. The third differences couple each point with three before it, so that the normal equations have
a band of 4 · dof − 1 diagonals. Where collisions are looked at, w_c² Σ (c − distance)² is added for all pairs of solids
that are nearer to one another than c. Steps are damped after Levenberg and Marquardt as in the searches for postures;
joints that a step would drive beyond a limit where they are stay there.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, solveh_banded

from maniport.bodies.collisions import Collisions
from maniport.tracking.objective import Targets
from maniport.tracking.search.descent import LARGEST_DAMPING, LEAST_GAIN
from maniport.validation import Array

ORDERS = (1, 3)
MOST_STEPS = 60
ENOUGH = 1e-4
"""Share of the cost that a step must bring for another one to follow."""
CLEAR, CLEAR_WEIGHT = 0.015, 300.0
"""c [m] and w_c [1/m]."""
FIRST_DAMPING = 1e-3


@dataclass(frozen=True)
class Smoothness:
    """What quick motion costs beside squared distances: `velocity` [s²/rad²] and `jerk` [s⁶/rad²]."""

    velocity: float
    jerk: float

    def times(self, share: float) -> "Smoothness":
        """So much of it."""
        return Smoothness(share * self.velocity, share * self.jerk)


def durations_of(time: Array) -> Array:
    """The time that each of the points at `time` stands for [s], shape (n,): half way to its neighbours."""
    halves = 0.5 * np.diff(time)
    return np.asarray(np.concatenate([halves, [0.0]]) + np.concatenate([[0.0], halves]))


def refine(
    targets: Targets,
    time: Array,
    q: Array,
    smoothness: Smoothness,
    weights: tuple[float, ...],
    shares: Array | None = None,
    collisions: Collisions | None = None,
) -> Array:
    """Lower the cost of a whole motion from joint positions q (n, dof) on; they end within the limits.

    Parameters
    ----------
    targets : Targets
        One for each point.
    time : ndarray, shape (n,)
        Increasing [s].
    q : ndarray, shape (n, dof)
    smoothness : Smoothness
    weights : tuple of float
        What a metre of the tip beside its path counts for, in one descent after the other [1/m].
    shares : ndarray, shape (n,), optional
        w_i [s]. Default: by `time`.
    collisions : Collisions, optional
        What is kept apart, as far as it is known.
    """
    for weight in weights:
        posed = replace(targets, objective=replace(targets.objective, position_weight=weight))
        q = _Motion(posed, time, smoothness, shares, collisions).descended(q)
    return q


def motion_cost(targets: Targets, time: Array, q: Array, smoothness: Smoothness) -> float:
    """What is minimized, at joint positions q (n, dof), by the weights that the targets have."""
    return _Motion(targets, time, smoothness).cost(q)


class _Motion:
    """The cost of a motion, its gradient and its banded Hessian."""

    def __init__(
        self,
        targets: Targets,
        time: Array,
        smoothness: Smoothness,
        shares: Array | None = None,
        collisions: Collisions | None = None,
    ):
        self.collisions = collisions
        self.targets, self.arm = targets, targets.objective.arm
        self.shares = durations_of(time) if shares is None else shares
        dof = self.arm.dof
        self.band = np.zeros((min(4, len(time)), len(time)))
        """Lower diagonals of the points' Hessian of smoothness, alike for all joints."""
        for order, factor in zip(ORDERS, (smoothness.velocity, smoothness.jerk), strict=True):
            if factor > 0.0 and len(time) > order:
                self._add_differences(time, order, factor)
        self.dof = dof

    def _add_differences(self, time: Array, order: int, factor: float) -> None:
        """Add ∫ |order-th derivative|², by divided differences with their weights in q."""
        n = len(time)
        rows = np.eye(order + 1)[None] * np.ones((n - order, 1, 1))  # derivative of each difference in its points
        at = np.stack([time[k : n - order + k] for k in range(order + 1)], axis=1)
        for level in range(1, order + 1):
            gap = at[:, level:] - at[:, : at.shape[1] - level]
            rows = (rows[:, 1:] - rows[:, :-1]) / gap[..., None] * level
        row = rows[:, 0]
        spans = factor * (at[:, -1] - at[:, 0]) / order
        for below in range(order + 1):
            for k in range(order + 1 - below):
                self.band[below, k : k + n - order] += spans * row[:, k] * row[:, k + below]

    def smooth(self, q: Array) -> Array:
        """Half the gradient of smoothness (n, dof): its Hessian times q."""
        out = self.band[0][:, None] * q
        for below in range(1, len(self.band)):
            line = self.band[below, : len(q) - below, None]
            out[below:] += line * q[:-below]
            out[:-below] += line * q[below:]
        return np.asarray(out)

    def evaluate(self, q: Array) -> tuple[float, Array, Array]:
        """Cost, half its gradient (n, dof), and Gauss-Newton blocks of the points (n, dof, dof)."""
        length, gradient, hessian = self.targets.evaluate(q)
        square = length**2
        if self.collisions is not None:
            rows, distance, slope = self.collisions.gradient(q, CLEAR)
            short = CLEAR - distance
            np.add.at(square, rows, CLEAR_WEIGHT**2 * short**2)
            np.add.at(gradient, rows, -(CLEAR_WEIGHT**2) * short[:, None] * slope)
            np.add.at(hessian, rows, CLEAR_WEIGHT**2 * slope[:, :, None] * slope[:, None, :])
        smooth = self.smooth(q)
        cost = float(np.sum(self.shares * square) + np.sum(q * smooth))
        return cost, self.shares[:, None] * gradient + smooth, self.shares[:, None, None] * hessian

    def cost(self, q: Array) -> float:
        square = self.targets.cost(q)
        if self.collisions is not None:
            rows, distance, _ = self.collisions.gradient(q, CLEAR)
            np.add.at(square, rows, CLEAR_WEIGHT**2 * (CLEAR - distance) ** 2)
        return float(np.sum(self.shares * square) + np.sum(q * self.smooth(q)))

    def descended(self, q: Array) -> Array:
        """Descend until a step brings next to nothing; the damping follows the searches for postures."""
        lower, upper = self.arm.lower, self.arm.upper
        q = np.clip(q, lower, upper)
        cost, gradient, hessian = self.evaluate(q)
        damping, growth = FIRST_DAMPING, 2.0
        for _ in range(MOST_STEPS):
            stuck = ((q <= lower) & (gradient > 0.0)) | ((q >= upper) & (gradient < 0.0))
            own = np.einsum("nii->ni", hessian) + self.band[0][:, None]
            step = self.step(gradient, hessian, own, stuck, damping)
            trial = np.clip(q + step, lower, upper)
            found = self.cost(trial)
            gained, expected = cost - found, float(np.sum(step * (damping * own * step - gradient)))
            if gained > LEAST_GAIN * expected > 0.0:
                q, growth = trial, 2.0
                damping *= max(1.0 / 3.0, 1.0 - (2.0 * gained / expected - 1.0) ** 3)
                if gained <= ENOUGH * found:
                    break
                cost, gradient, hessian = self.evaluate(q)
            else:
                damping, growth = damping * growth, growth * 2.0
                if damping > LARGEST_DAMPING or expected <= ENOUGH * cost:
                    break
        return q

    def step(self, gradient: Array, hessian: Array, own: Array, stuck: NDArray[np.bool_], damping: float) -> Array:
        """Solve the banded normal equations, with the diagonal `own`, for the joints that are not stuck."""
        n, dof = gradient.shape
        free = ~stuck
        blocks = hessian * free[:, :, None] * free[:, None, :]
        band = np.zeros((dof * len(self.band), n * dof))
        table = band.reshape(len(band), n, dof)
        for i in range(dof):
            for j in range(i + 1):
                table[i - j, :, j] = blocks[:, i, j]
        for below in range(len(self.band)):
            both = free[below:] & free[: n - below]
            table[below * dof, : n - below] += self.band[below, : n - below, None] * both
        table[0] += damping * own + np.where(free, 1e-12 * own.max(), own)
        try:
            solved = solveh_banded(band, -(gradient * free).ravel(), lower=True, check_finite=False)
        except LinAlgError:
            return np.zeros_like(gradient)
        return np.asarray(solved.reshape(n, dof) * free)
