"""Initial path of an arm fit: a global search at a few frames a second, joined into one continuous path.

At zero elevation of the shoulder the plane of elevation is arbitrary, and limits cut its circle of planes open, so that
a frame may have several local solutions. Each key frame keeps its best few, and the cheapest path through them,
residual and joint motion together, is found by dynamic programming (Viterbi).
"""

import numpy as np
from numpy.typing import NDArray

from maniport.mocap.directions import Directions
from maniport.mocap.path_solver import parts_of, solve_each
from maniport.util.validation import Array

KEY_RATE = 8.0  # Key frames per second
RESIDUAL_SCALE = 0.02  # A residual that costs as much [rad] …
MOTION_SCALE = 0.25  # … as this joint motion from one key frame to the next [rad]


def initial_path(directions: Directions, time: Array) -> Array:
    """Return joint angles for every frame, shape (n, dof): solved at key frames, interpolated in between."""
    keys = _key_frames(time)
    parts = parts_of(len(keys), 512)  # which bounds the memory
    solutions = [_local_solutions(directions.take(keys[part])) for part in parts]
    candidates, cost = (np.concatenate(arrays) for arrays in zip(*solutions, strict=True))
    path = _cheapest_path(candidates, cost)
    return np.stack([np.interp(time, time[keys], path[:, j]) for j in range(path.shape[1])], axis=-1)


def sampled(directions: Directions) -> tuple[Array, Array]:
    """Return samples of the joint range, shape (1024, dof), and their directions, shape (1024, k, 3)."""
    samples = directions.arm.sample(1024, random_state=0)
    return samples, directions.model(samples)[0]


def likest(targets: Array, samples: Array, count: int = 6) -> NDArray[np.intp]:
    """Return indices of the samples whose directions are nearest to each of the targets (n, k, 3), (n, count)."""
    flat = np.nan_to_num(targets).reshape(len(targets), -1)
    similarity = flat @ samples.reshape(len(samples), -1).T  # of unit vectors: the larger, the smaller their distances
    return np.argsort(-similarity, axis=1)[:, :count]


def _local_solutions(directions: Directions) -> tuple[Array, Array]:
    """Return local solutions for each frame, shape (n, k, dof), and their cost, shape (n, k)."""
    arm = directions.arm
    samples, modeled = sampled(directions)
    starts = samples[likest(directions.targets, modeled)]
    repeated = directions.take(np.repeat(np.arange(len(starts)), starts.shape[1]))
    solved, cost = solve_each(
        lambda q, rows: repeated.take(rows).residual(q), starts.reshape(-1, arm.dof), arm.lower, arm.upper
    )
    return solved.reshape(starts.shape), cost.reshape(starts.shape[:2])


def _key_frames(time: Array) -> NDArray[np.intp]:
    """Return frames at about `KEY_RATE`, with the first and the last, and both sides of every gap."""
    step = float(np.median(np.diff(time))) if len(time) > 1 else 1.0
    every = max(1, round(1 / (KEY_RATE * step)))
    gaps = np.flatnonzero(np.diff(time) > 1.5 * step)
    return np.unique(np.concatenate([np.arange(0, len(time), every), [len(time) - 1], gaps, gaps + 1]).astype(np.intp))


def _cheapest_path(candidates: Array, cost: Array) -> Array:
    """Choose one candidate (n, k, dof) for each frame, such that residuals and joint motion together are least."""
    n, k, _ = candidates.shape
    total = cost[0] / RESIDUAL_SCALE**2
    origin = np.zeros((n, k), dtype=np.intp)
    for t in range(1, n):
        motion = np.sum((candidates[t][None] - candidates[t - 1][:, None]) ** 2, axis=-1) / MOTION_SCALE**2
        through = total[:, None] + motion
        origin[t] = np.argmin(through, axis=0)
        total = through.min(axis=0) + cost[t] / RESIDUAL_SCALE**2
    chosen = np.empty(n, dtype=np.intp)
    chosen[-1] = np.argmin(total)
    for t in range(n - 1, 0, -1):
        chosen[t - 1] = origin[t, chosen[t]]
    return np.asarray(candidates[np.arange(n), chosen])
