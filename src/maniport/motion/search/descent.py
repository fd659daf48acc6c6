"""Levenberg-Marquardt within joint limits, many searches at once, and the pointwise optimum that they find.

Each search minimizes the objective of `maniport.motion.objective`. The damping of its steps follows Madsen, Nielsen &
Tingleff, Methods for Non-Linear Least Squares Problems, 2004, § 3.2. Several searches serve one target: as soon as one
has reached it the others end, and every few steps the worse half of them does.
"""

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from joblib import Parallel, delayed
from numpy.typing import NDArray

from maniport.motion.kernels import step_within_limits
from maniport.motion.objective import EXACT_WEIGHT, SEARCH_WEIGHT
from maniport.util.progress import Part, counted, nobody, pieces
from maniport.util.validation import Array

LARGEST_DAMPING = 1e8
STARTS = 32  # Samples that a search for the pointwise optimum starts from
LEAST_GAIN = 1e-4  # Share of the expected decrease of the cost that a step must bring to be taken


class JointLimits(Protocol):
    """An arm, or two with the joints of both."""

    lower: Array
    upper: Array
    dof: int


class PathCost(Protocol):
    """Targets, one row each, such as `maniport.motion.objective.Targets`."""

    @property
    def arm(self) -> JointLimits:
        """The arm, or two."""

    def __getitem__(self, rows: Any) -> "PathCost":
        """Some of the targets, or each several times."""

    def evaluate(self, q: Array) -> tuple[Array, Array, Array]:
        """√f (n,), half the gradient of f (n, dof) and its Gauss-Newton Hessian (n, dof, dof)."""

    def distance(self, q: Array) -> Array:
        """Distance of target and achieved ellipsoids, shape (n,)."""

    def tip_error(self, q: Array) -> Array | None:
        """Position errors [m], shape (n,) or (n, arms); None without paths."""

    def weighing(self, position_weight: float) -> "PathCost":
        """Change the weight of the position error [1/m]."""


class Searches:
    """The state of all searches, shapes (n · k, ...): the k of the first target, then those of the second and so on."""

    def __init__(self, target: PathCost, starts: Array):
        self.target, (self.count, self.each, dof) = target, starts.shape
        self.lower, self.upper = target.arm.lower, target.arm.upper
        self.q = np.clip(starts.reshape(-1, dof), self.lower, self.upper)
        self.owner = np.repeat(np.arange(self.count), self.each)
        self.length, self.gradient, self.hessian = target[self.owner].evaluate(self.q)
        self.damping, self.growth = np.full(len(self.q), 0.1), np.full(len(self.q), 2.0)

    def step(self, active: NDArray[np.intp]) -> None:
        """Try one step in each active search and take those that lower the cost."""
        trial, expected = np.empty((len(active), self.q.shape[1])), np.empty(len(active))
        step_within_limits(
            self.q[active], self.gradient[active], self.hessian[active], self.damping[active],
            self.lower, self.upper, trial, expected,
        )  # fmt: skip
        length, gradient, hessian = self.target[self.owner[active]].evaluate(trial)
        gain = 0.5 * (self.length[active] ** 2 - length**2)
        taken = gain > LEAST_GAIN * expected
        rows, lost = active[taken], active[~taken]
        ratio = gain[taken] / expected[taken]
        self.q[rows], self.length[rows] = trial[taken], length[taken]
        self.gradient[rows], self.hessian[rows] = gradient[taken], hessian[taken]
        self.damping[rows] *= np.maximum(1.0 / 3.0, 1.0 - (2.0 * ratio - 1.0) ** 3)
        self.growth[rows] = 2.0
        self.damping[lost] *= self.growth[lost]
        self.growth[lost] *= 2.0

    def still_open(self, active: NDArray[np.intp], tol: float) -> NDArray[np.intp]:
        """The active searches that have something left to gain, of targets that none has reached."""
        q, slope, length = self.q[active], self.gradient[active], self.length[active]
        held = ((q <= self.lower) & (slope > 0)) | ((q >= self.upper) & (slope < 0))
        curvature = np.diagonal(self.hessian[active], axis1=1, axis2=2)
        # flatter joints, such as one whose axis goes through the end effector, have only rounding in both
        flat = np.maximum(1e-9 * curvature.max(axis=1, keepdims=True), np.finfo(np.float64).tiny)
        curvature = np.maximum(curvature, flat)
        promise = np.where(held, 0.0, 0.5 * slope**2 / curvature).max(axis=1)
        reached = (self.length.reshape(self.count, self.each).min(axis=1) <= tol)[self.owner[active]]
        going = ~reached & (promise > tol * length) & np.isfinite(length) & (self.damping[active] < LARGEST_DAMPING)
        return np.asarray(active[going])

    def better_half(self, active: NDArray[np.intp]) -> NDArray[np.intp]:
        """Of each target's active searches the better half, at least one."""
        order = active[np.lexsort((self.length[active], self.owner[active]))]
        owner = self.owner[order]
        first = np.searchsorted(owner, owner)
        size = np.searchsorted(owner, owner, side="right") - first
        return np.sort(order[np.arange(len(order)) - first < (size + 1) // 2])


def descend(
    target: PathCost,
    starts: Array,
    tol: float,
    max_iter: int,
    *,
    block: int,
    halving: int = 4,
    n_jobs: int | None = None,
    progress: Part = nobody,
) -> Array:
    """Search for each target from starts (n, k, dof); return the best joint positions (n, dof).

    Every `halving` steps the worse half of the searches for a target ends. `block` targets are searched together.
    """
    blocks = [slice(i, i + block) for i in range(0, len(starts), block)]
    tasks = (delayed(_descend)(target[rows], starts[rows], tol, max_iter, halving) for rows in blocks)
    results = Parallel(n_jobs=n_jobs, return_as="generator")(tasks)
    return np.concatenate(list(counted(results, len(blocks), progress)))


def _descend(target: PathCost, starts: Array, tol: float, max_iter: int, halving: int) -> Array:
    searches = Searches(target, starts)
    active = searches.still_open(np.arange(len(searches.q)), tol)
    for iteration in range(1, max_iter + 1):
        if not len(active):
            break
        searches.step(active)
        active = searches.still_open(active, tol)
        if iteration % halving == 0:
            active = searches.better_half(active)
    lengths = searches.length.reshape(searches.count, searches.each)
    best = np.arange(searches.count) * searches.each + np.argmin(lengths, axis=1)
    return np.asarray(searches.q[best])


@dataclass(frozen=True)
class PointwiseBest:
    """The best configuration for each target by itself, with the end effector in place: no motion, it may jump."""

    joint_positions: Array  # (n, dof) [rad or m]
    distance: Array  # (n,), to the target ellipsoids; smooth motions stay above it
    position_error: Array | None  # (n,) [m]


def pointwise_best(
    targets: PathCost, starts: Array, known: Array | None = None, progress: Part = nobody
) -> PointwiseBest:
    """Search from starts (n, k, dof), then from the results of the neighbors and from known configurations (n, dof)."""
    first, then = pieces(progress, 4.0, 1.0)
    q = descend(targets.weighing(SEARCH_WEIGHT), starts, 1e-6, 100, block=64, progress=first)
    candidates = [q, np.roll(q, 1, axis=0), np.roll(q, -1, axis=0), *([] if known is None else [known])]
    return improved_from(targets, np.stack(candidates, axis=1), then)


def improved_from(targets: PathCost, starts: Array, progress: Part = nobody) -> PointwiseBest:
    """Search from known configurations (n, k, dof) alone."""
    q = descend(targets.weighing(EXACT_WEIGHT), starts, 1e-6, 100, block=64, progress=progress)
    return PointwiseBest(q, targets.distance(q), targets.tip_error(q))


def interpolated_distance(rows: NDArray[np.intp], distance: Array, count: int) -> Array:
    """Distances (count,) from those at some rows: the square is linear, which keeps the mean square."""
    return np.asarray(np.sqrt(np.interp(np.arange(count), rows, distance**2)))
