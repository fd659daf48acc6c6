"""Path of joint angles of an arm: a global search at a few frames per second, then a fit to all frames together.

At zero elevation of the shoulder the plane of elevation is arbitrary, and limits cut its circle of planes open, so that
a frame may have several local solutions. Each key frame keeps its best few, and dynamic programming (Viterbi) finds the
path through them with the least residuals and joint motion. From there, `solve_path` couples neighboring frames by
their joint acceleration (Levenberg-Marquardt with an active set of limits):

    minimize  Σ_t |r_t(q_t)|² + Σ_t |p (q_t - q₀)|² + Σ_t |κ/Δt² (q_{t+1} - 2 q_t + q_{t-1})|²,   lower ≤ q_t ≤ upper

with κ = 1 / (2π f)². A motion that the residual sees with sensitivity σ (|∂r/∂q|) is followed up to the frequency
f √σ: what is measured well is hardly changed, and what a frame leaves open (a straight elbow leaves the rotation of the
upper arm open) is carried over from the frames before and after instead of drifting or jumping.

Coupling fades within seconds. So a long path is solved in blocks, which bounds the memory, and then the frames around
each cut once more between fixed neighbors.
"""

from collections.abc import Callable, Collection
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, solveh_banded

from maniport.arms import Arm
from maniport.mocap.data_quality import unobservable_joints
from maniport.mocap.directions import BLOCK, Directions
from maniport.mocap.recording import Bools
from maniport.util.progress import Step
from maniport.util.validation import Array

# Values (n, k) at configurations (n, dof), and their derivatives
Residual = Callable[[Array], tuple[Array, Array]]
KEY_RATE = 8.0  # Key frames per second
RESIDUAL_SCALE = 0.02  # A residual that costs as much [rad] …
MOTION_SCALE = 0.25  # … as this joint motion from one key frame to the next [rad]

LEAST_DAMPING = 1e-12  # Keeps matrices regular where directions leave a joint open
LEAST_GAIN = 1e-5  # A small step that lowers the cost by a smaller share is the last
AROUND = 512  # Frames on either side of a cut that are solved again: 2 s at 240 Hz, 17 s at 30 Hz


@dataclass(frozen=True)
class JointPriors:
    """Terms of the fit other than the residuals; each of shape (dof,)."""

    lower: Array  # limits, equal where a joint is fixed [rad]
    upper: Array
    pull: Array  # weight of the distance to the neutral angle
    neutral: Array  # [rad]
    cutoff: Array | float = np.inf  # frequency up to which motion is followed [Hz]


def joint_priors(arm: Arm, roles: Collection[str]) -> JointPriors:
    """Return the priors of the joints of an arm with recorded points of these roles.

    Motion that is fully observed is followed up to 30 Hz; arms move below 10 Hz, but directions of little weight are
    followed up to about half of the cutoff. Unobservable joints are pulled to neutral with the inverse of their range.
    """
    neutral = np.clip(0.0, arm.lower, arm.upper)
    lower = arm.lower.copy()
    upper = arm.upper.copy()
    pull = np.zeros(arm.dof)
    cutoff = np.full(arm.dof, 30.0)
    for joint in unobservable_joints(roles):
        cutoff[joint] = 10.0
        if "hand" not in roles:
            lower[joint] = upper[joint] = neutral[joint]
        else:
            pull[joint] = 0.004 * np.pi / (arm.upper[joint] - arm.lower[joint])
    return JointPriors(lower, upper, pull, neutral, cutoff)


def solve_arm(directions: Directions, time: Array, roles: Collection[str], step: Step) -> Array:
    """Return the joint angles (n, dof) of the path."""
    step(0.1)
    priors = joint_priors(directions.arm, roles)
    steps = np.diff(time)
    if len(steps):
        usual = float(np.median(steps))
    else:
        usual = 1.0
    joined = steps < 1.5 * usual
    q = np.clip(_initial_path(directions, time, usual, joined), priors.lower, priors.upper)
    step(0.4)
    # κ/Δt² of each joint's acceleration in each frame; zero at the ends and at gaps
    smoothing = np.zeros_like(q)
    smoothing[1:-1][joined[1:] & joined[:-1]] = 1 / (2 * np.pi * priors.cutoff * usual) ** 2
    blocks = np.array_split(np.arange(len(q)), -(-len(q) // BLOCK))
    parts = [(block, 0) for block in blocks]
    for block in blocks[1:]:
        seam = np.arange(block[0] - AROUND, block[0] + AROUND)
        parts.append((seam, 2))
    for done, (part, fixed) in enumerate(parts, start=1):
        q[part] = solve_path(
            directions.take(part).residual, q[part], priors, smoothing[part], fixed
        )
        step(0.4 + 0.6 * done / len(parts))
    return q


def sample_directions(directions: Directions) -> tuple[Array, Array]:
    """Return samples of the joint range, shape (1024, dof), and their directions, shape (1024, k, 3)."""
    samples = directions.arm.sample(1024, random_state=0)
    return samples, directions.model(samples)[0]


def nearest_samples(targets: Array, samples: Array, count: int = 6) -> NDArray[np.intp]:
    """Return indices (n, count) of the samples, unordered, with the nearest directions to targets (n, k, 3)."""
    flat = np.where(np.isnan(targets), 0.0, targets).reshape(len(targets), -1)
    # the larger the products of unit vectors, the smaller their distances
    similarity = flat @ samples.reshape(len(samples), -1).T
    return np.argpartition(-similarity, count, axis=1)[:, :count]


def _initial_path(directions: Directions, time: Array, usual: float, joined: Bools) -> Array:
    """Return joint angles for every frame, shape (n, dof): solved at key frames, interpolated in between."""
    every = max(1, round(1 / (KEY_RATE * usual)))
    gaps = np.flatnonzero(~joined)
    keys = np.unique(
        np.concatenate([np.arange(0, len(time), every), [len(time) - 1], gaps, gaps + 1]).astype(
            np.intp
        )
    )
    samples, modeled = sample_directions(directions)
    parts = np.array_split(keys, -(-len(keys) // 512))  # which bounds the memory
    solutions = []
    costs = []
    for part in parts:
        of_part, costs_of_part = local_solutions(directions.take(part), samples, modeled)
        solutions.append(of_part)
        costs.append(costs_of_part)
    path = cheapest_path(np.concatenate(solutions), np.concatenate(costs))
    return np.stack([np.interp(time, time[keys], angles) for angles in path.T], axis=-1)


def cheapest_path(solutions: Array, cost: Array) -> Array:
    """Choose one of the solutions (n, k, dof) of each key frame, with the least residuals and joint motion (Viterbi).

    Parameters
    ----------
    solutions : ndarray, shape (n, k, dof)
        Joint angles [rad].
    cost : ndarray, shape (n, k)
        Squared residuals [rad²].

    Returns
    -------
    ndarray, shape (n, dof)
    """
    total = cost[0] / RESIDUAL_SCALE**2  # of the cheapest path to each solution of a key frame
    origins = []  # the solution before, on these paths
    for t in range(1, len(solutions)):
        change = solutions[t][None] - solutions[t - 1][:, None]
        motion = np.sum(change**2, axis=-1) / MOTION_SCALE**2
        through = total[:, None] + motion
        origins.append(np.argmin(through, axis=0))
        total = through.min(axis=0) + cost[t] / RESIDUAL_SCALE**2

    chosen = [np.argmin(total)]
    for origin in reversed(origins):
        chosen.append(origin[chosen[-1]])
    return np.asarray(solutions[np.arange(len(solutions)), chosen[::-1]])


def local_solutions(directions: Directions, samples: Array, modeled: Array) -> tuple[Array, Array]:
    """Return local solutions for each frame, shape (n, k, dof), and their cost, shape (n, k); each row on its own."""
    arm = directions.arm
    starts = samples[nearest_samples(directions.targets, modeled)]
    rows = directions.take(np.repeat(np.arange(len(starts)), starts.shape[1]))
    q = trial = starts.reshape(-1, arm.dof)
    cost = np.full(len(q), np.inf)
    damping = np.full(len(q), 5e-3)
    gradient = np.zeros_like(q)
    hessian = np.zeros((*q.shape, arm.dof))
    for _ in range(30):
        values, slopes = rows.residual(trial)
        better = np.sum(values**2, axis=-1) < cost
        q = np.where(better[:, None], trial, q)
        cost = np.where(better, np.sum(values**2, axis=-1), cost)
        damping = np.maximum(damping * np.where(better, 0.2, 8.0), LEAST_DAMPING)
        gradient[better] = (values[better, None] @ slopes[better])[:, 0]
        hessian[better] = np.swapaxes(slopes[better], 1, 2) @ slopes[better]
        free = ~_blocked(q, gradient, arm.lower, arm.upper)
        matrix = hessian * (free[:, :, None] & free[:, None, :])
        matrix[:, range(arm.dof), range(arm.dof)] += damping[:, None] + ~free
        trial = np.clip(
            q - np.linalg.solve(matrix, (gradient * free)[..., None])[..., 0], arm.lower, arm.upper
        )
        if np.abs(trial - q).max() < 1e-6:
            break
    return q.reshape(starts.shape), cost.reshape(starts.shape[:2])


def _smoothing_bands(stiffness: Array, n: int) -> Array:
    """Return second derivatives of the smoothing term, (3, n, dof): of each frame, with the next two."""
    bands = np.zeros((3, n, stiffness.shape[1]))
    for offset, row in enumerate(([1.0, 4.0, 1.0], [-2.0, -2.0], [1.0])):
        for frame, factor in enumerate(row):
            bands[offset, frame : max(n - 2, 0) + frame] += factor * stiffness
    return bands


def solve_path(
    residual: Residual, start: Array, priors: JointPriors, smoothing: Array, fixed: int = 0
) -> Array:
    """Fit all frames together; `fixed` frames at either end stay. `smoothing` is κ/Δt² (n, dof)."""
    n, dof = start.shape
    stiffness = smoothing[1:-1] ** 2
    smooth = _smoothing_bands(stiffness, n)
    q = start
    trial = start
    cost = np.inf
    damping = 5e-6
    for iteration in range(100):
        values, slopes = residual(trial)
        bending = np.diff(trial, 2, axis=0)
        offsets = priors.pull * (trial - priors.neutral)
        new_cost = float(np.sum(values**2) + np.sum(offsets**2) + np.sum(stiffness * bending**2))
        if new_cost < cost:
            moved = float(np.abs(trial - q).max())
            gained = cost - new_cost
            q = trial
            cost = new_cost
            damping = max(damping * 0.2, LEAST_DAMPING)
            # Where the arm hangs straight, a joint rotates far for a small part of the cost of a long path.
            if iteration and (moved < 1e-9 or (gained < LEAST_GAIN * cost and moved < 1e-3)):
                break
            gradient = (values[:, None] @ slopes)[:, 0] + priors.pull * offsets
            for shift, factor in enumerate((1.0, -2.0, 1.0)):
                gradient[shift : max(n - 2, 0) + shift] += factor * stiffness * bending
            blocked = _blocked(q, gradient, priors.lower, priors.upper)
            blocked[:fixed] = True
            blocked[n - fixed :] = True
            bands = np.zeros((2 * dof + 1, n, dof))  # of the lower half of the second derivatives
            hessian = np.swapaxes(slopes, 1, 2) @ slopes + np.diag(priors.pull**2)
            for offset in range(dof):
                bands[offset, :, : dof - offset] = np.diagonal(hessian, -offset, axis1=1, axis2=2)
            bands[::dof] += smooth
        else:
            damping *= 5.0
            if damping > 1e8 or np.abs(trial - q).max() < 1e-10:
                break
        step = _banded_step(bands.reshape(-1, n * dof), gradient, blocked, damping)
        trial = np.clip(q + step, priors.lower, priors.upper)
    return q


def _blocked(q: Array, gradient: Array, lower: Array, upper: Array) -> Bools:
    """Mark the joints that lie at a limit and would leave it downhill."""
    return np.asarray(((q <= lower) & (gradient > 0)) | ((q >= upper) & (gradient < 0)))


def _banded_step(bands: Array, gradient: Array, blocked: Bools, damping: float) -> Array:
    """Return the Newton step of the free joints (n, dof), with more damping while the matrix is singular."""
    size = bands.shape[1]
    fixed = blocked.ravel()
    matrix = bands[:size].copy()  # a path of one or two frames is shorter than the bands are wide
    matrix[0] += damping
    for offset in range(len(matrix)):
        matrix[offset, : size - offset][fixed[: size - offset] | fixed[offset:]] = 0.0
    matrix[0, fixed] = 1.0
    try:
        right = np.where(blocked, 0.0, gradient).ravel()
        return np.asarray(-solveh_banded(matrix, right, lower=True)).reshape(blocked.shape)
    except LinAlgError:
        return _banded_step(bands, gradient, blocked, 5.0 * damping)
