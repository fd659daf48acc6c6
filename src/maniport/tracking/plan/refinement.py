"""All points of a motion at once: banded Gauss-Newton within joint limits.

Minimized is, over joint positions q_i at times t_i,

    Σ_i w_i f_i(q_i) + ∫ λ_v |q̇|² + λ_j |q⃛|² dt,

with f as in `maniport.tracking.objective`, w_i the time that a point stands for, and derivatives by divided differences
of neighbouring points. The third differences couple each point with three before it, so that the normal equations have
a band of 4 · dof − 1 diagonals. Where collisions are looked at, w_c² Σ (c − distance)² is added for all pairs of solids
that are nearer to one another than c; where limits are given, ∫ w_l Σ (|q̇| / limit − 1)² + (|q̈| / limit − 1)² dt over
what exceeds them. Steps are damped after Levenberg and Marquardt as in the searches for postures;
joints that a step would drive beyond a limit where they are stay there.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, solveh_banded

from maniport.tracking.plan.differences import Differences
from maniport.tracking.search.descent import LARGEST_DAMPING, LEAST_GAIN, Limited
from maniport.validation import Array

ORDERS = (1, 2, 3)
MOST_STEPS = 60
ENOUGH = 1e-4
CLEAR, CLEAR_WEIGHT = 0.015, 300.0
"""c [m] and w_c [1/m]."""
PACE_WEIGHT = 30.0
"""w_l [1/s]."""
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


class Watching(Protocol):
    """What tells again and again which pairs are near one another."""

    def gradient(self, q: Array) -> tuple[NDArray[np.intp], Array, Array]:
        """As `maniport.bodies.collisions.Collisions.gradient`, for configurations (n, dof)."""


class KeptApart(Protocol):
    """What is kept apart, such as `maniport.bodies.collisions.Collisions`."""

    def watch(self, threshold: float) -> Watching:
        """Look at what is nearer than a threshold [m]."""

    def collides(self, q: Array) -> NDArray[np.bool_]:
        """Whether configurations (n, dof) collide, shape (n,)."""


@dataclass(frozen=True)
class Asked:
    """What is asked of a motion beside following.

    Attributes
    ----------
    smoothness : Smoothness
    shares : ndarray, shape (n,), or None
        w_i [s]; None: the time that each point stands for.
    velocity, acceleration : ndarray, shape (dof,), or None
        Limits.
    collisions : KeptApart or None
        What is kept apart.
    enough : float
        Share of the cost that a step must bring for another one to follow.
    clear : float or ndarray, shape (n,)
        c: how far apart, at each point [m].
    """

    smoothness: Smoothness
    shares: Array | None = None
    velocity: Array | None = None
    acceleration: Array | None = None
    collisions: KeptApart | None = None
    enough: float = ENOUGH
    clear: float | Array = CLEAR


State = TypeVar("State")


class Postures(Protocol):
    """What is asked of the posture at each point, such as `maniport.tracking.objective.Targets`."""

    def cost(self, q: Array) -> Array:
        """Squared residuals f at q (n, dof), shape (n,)."""

    def evaluate(self, q: Array) -> tuple[Array, Array, Array]:
        """√f (n,), half the gradient of f (n, dof) and its Gauss-Newton Hessian (n, dof, dof)."""


class PosturesOnPaths(Postures, Protocol):
    """The same where tips shall be on paths."""

    @property
    def arm(self) -> Limited:
        """Whose postures they are."""

    def weighing(self, position_weight: float) -> "PosturesOnPaths":
        """The same with another weight of the tips' places [1/m]."""

    def tip_error(self, q: Array) -> Array | None:
        """How far tips are beside their paths [m], shape (n,) or (n, arms); None without paths."""


class Problem(Protocol[State]):
    """What `descend` minimizes."""

    def evaluate(self, state: State) -> tuple[float, Any]:
        """Cost and slopes."""

    def trial(self, state: State, slopes: Any, damping: float) -> tuple[State, float]:
        """Where a damped step leads, and by how much it should lower the cost."""


def descend(problem: Problem[State], state: State, enough: float) -> State:
    """Descend until a step brings no more than a share `enough` of the cost; damping follows the posture searches."""
    cost, slopes = problem.evaluate(state)
    damping, growth = FIRST_DAMPING, 2.0
    for _ in range(MOST_STEPS):
        trial, expected = problem.trial(state, slopes, damping)
        found, there = problem.evaluate(trial)  # most steps are taken: asking for the cost alone first takes longer
        gained = cost - found
        if gained > LEAST_GAIN * expected > 0.0:
            state, cost, slopes, growth = trial, found, there, 2.0
            damping *= max(1.0 / 3.0, 1.0 - (2.0 * gained / expected - 1.0) ** 3)
            if gained <= enough * found:
                break
        else:
            damping, growth = damping * growth, growth * 2.0
            if damping > LARGEST_DAMPING or expected <= enough * cost:
                break
    return state


def refine(targets: PosturesOnPaths, time: Array, q: Array, asked: Asked, weights: tuple[float, ...]) -> Array:
    """Lower the cost of a whole motion from joint positions q (n, dof) on; they end within the limits."""
    for weight in weights:
        q = descended(targets.arm, targets.weighing(weight), time, q, asked)
    return q


def descended(arm: Limited, postures: Postures, time: Array, q: Array, asked: Asked) -> Array:
    """The same for anything else that may be asked of an arm's postures, one descent."""
    return Motion(arm, postures, time, asked).descended(q)


def motion_cost(targets: PosturesOnPaths, time: Array, q: Array, asked: Asked) -> float:
    """What is minimized, at joint positions q (n, dof), by the weights that the targets have."""
    return Motion(targets.arm, targets, time, asked).cost(q)


class Motion:
    """The cost of a motion, its gradient and its banded Hessian."""

    def __init__(self, arm: Limited, targets: Postures, time: Array, asked: Asked):
        self.targets: Postures = targets
        self.arm, self.asked = arm, asked
        self.shares = durations_of(time) if asked.shares is None else asked.shares
        n, dof = len(time), self.arm.dof
        self.clear = np.broadcast_to(asked.clear, n)
        self.stiff = (CLEAR_WEIGHT * (CLEAR / self.clear)) ** 2
        """w_c² at the points: what touching costs does not depend on c."""
        self.watch = None if asked.collisions is None else asked.collisions.watch(float(self.clear.max()))
        self.derivatives = {order: Differences.of(time, order) for order in ORDERS if n > order}
        self.steady = np.zeros((min(max(ORDERS) + 1, n), n, dof))
        """Lower diagonals of the points' Hessian of smoothness."""
        for order, factor in ((1, asked.smoothness.velocity), (3, asked.smoothness.jerk)):
            if order in self.derivatives:
                one = self.derivatives[order]
                self.steady[: order + 1] += one.normal(np.repeat(factor * one.spans[:, None], dof, axis=1))

    def smooth(self, q: Array) -> Array:
        """Half the gradient of smoothness (n, dof): its Hessian times q."""
        out = self.steady[0] * q
        for below in range(1, len(self.steady)):
            line = self.steady[below, : len(q) - below]
            out[below:] += line * q[:-below]
            out[:-below] += line * q[below:]
        return np.asarray(out)

    def excess(self, q: Array) -> Iterator[tuple[Differences, Array, Array]]:
        """For velocity and acceleration: differences, and how far they exceed their limits, as shares, with sign."""
        for order, most in ((1, self.asked.velocity), (2, self.asked.acceleration)):
            if most is not None and order in self.derivatives:
                share = self.derivatives[order](q) / most
                yield self.derivatives[order], np.sign(share) * np.maximum(np.abs(share) - 1.0, 0.0), most

    def short(self, q: Array) -> tuple[NDArray[np.intp], Array, Array]:
        """Which points are too near to a collision, what they lack [m], and how distances change there."""
        assert self.watch is not None
        rows, distance, slope = self.watch.gradient(q)
        short = self.clear[rows] - distance
        lacks = short > 0.0
        return rows[lacks], short[lacks], slope[lacks]

    def room(self, q: Array) -> Array:
        """How far points are from a collision that are nearer than c [m], infinite for others, shape (n,)."""
        room = np.full(len(q), np.inf)
        if self.watch is not None:
            rows, short, _ = self.short(q)
            np.minimum.at(room, rows, self.clear[rows] - short)
        return room

    def hurried(self, q: Array) -> NDArray[np.bool_]:
        """Which points have a part in a velocity or an acceleration beyond its limit, shape (n,)."""
        found = np.zeros(len(q), bool)
        for one, over, _ in self.excess(q):
            rows = np.flatnonzero(over.any(axis=1))
            found[rows[:, None] + np.arange(one.order + 1)] = True
        return found

    def evaluate(self, q: Array) -> tuple[float, Any]:
        """Cost; half its gradient (n, dof), Gauss-Newton blocks of the points (n, dof, dof), and bands of joints."""
        length, gradient, hessian = self.targets.evaluate(q)
        square = length**2
        if self.watch is not None:
            rows, short, slope = self.short(q)
            stiff = self.stiff[rows]
            np.add.at(square, rows, stiff * short**2)
            np.add.at(gradient, rows, (-stiff * short)[:, None] * slope)
            np.add.at(hessian, rows, stiff[:, None, None] * slope[:, :, None] * slope[:, None, :])
        smooth, band = self.smooth(q), self.steady.copy()
        cost = float(np.sum(self.shares * square) + np.sum(q * smooth))
        gradient = self.shares[:, None] * gradient + smooth
        for one, over, most in self.excess(q):
            weight = PACE_WEIGHT * one.spans[:, None]
            cost += float(np.sum(weight * over**2))
            gradient += one.back(weight * over / most)
            band[: one.order + 1] += one.normal(weight * (over != 0.0) / most**2)
        return cost, (gradient, self.shares[:, None, None] * hessian, band)

    def cost(self, q: Array) -> float:
        """Cost alone."""
        square = self.targets.cost(q)
        if self.watch is not None:
            rows, short, _ = self.short(q)
            np.add.at(square, rows, self.stiff[rows] * short**2)
        paced = sum(float(np.sum(PACE_WEIGHT * one.spans[:, None] * over**2)) for one, over, _ in self.excess(q))
        return float(np.sum(self.shares * square) + np.sum(q * self.smooth(q))) + paced

    def descended(self, q: Array) -> Array:
        """Descend until a step brings next to nothing."""
        return descend(self, self.within(q), self.asked.enough)

    def trial(self, q: Array, slopes: Any, damping: float) -> tuple[Array, float]:
        """Where a damped step leads, within the limits, and by how much it should lower the cost."""
        gradient, hessian, band = slopes
        stuck, own = self.stuck(q, gradient), np.einsum("nii->ni", hessian) + band[0]
        step = -self.solved(gradient[..., None], hessian, band, stuck, damping * own)[..., 0]
        return self.within(q + step), float(np.sum(step * (damping * own * step - gradient)))

    def within(self, q: Array) -> Array:
        """Joint positions within the limits."""
        return np.clip(q, self.arm.lower, self.arm.upper)

    def stuck(self, q: Array, gradient: Array) -> NDArray[np.bool_]:
        """Which joints are at a limit that the cost pushes them against, shape (n, dof)."""
        return np.asarray(((q <= self.arm.lower) & (gradient > 0.0)) | ((q >= self.arm.upper) & (gradient < 0.0)))

    def solved(self, sides: Array, hessian: Array, band: Array, stuck: NDArray[np.bool_], damped: Array) -> Array:
        """Solve the banded normal equations, with `damped` on the diagonal, for the joints that are not stuck."""
        n, dof, k = sides.shape
        free = ~stuck
        blocks = hessian * free[:, :, None] * free[:, None, :]
        lines = np.zeros((dof * len(band), n * dof))
        table = lines.reshape(len(lines), n, dof)
        for i in range(dof):
            for j in range(i + 1):
                table[i - j, :, j] = blocks[:, i, j]
        for below in range(len(band)):
            table[below * dof, : n - below] += band[below, : n - below] * (free[below:] & free[: n - below])
        table[0] += damped + np.where(free, 1e-12 * damped.max(), 1.0)
        asked = (sides * free[..., None]).reshape(n * dof, k)
        try:
            found = solveh_banded(lines, asked, lower=True, check_finite=False)
        except LinAlgError:
            return np.zeros_like(sides)
        return np.asarray(found.reshape(n, dof, k) * free[..., None])
