"""Where the path begins: a global search at a few frames a second, joined into one continuous path.

A shoulder has blind spots (at zero elevation its plane is arbitrary) and limits that cut its circle of planes open, so
that a frame may have several local solutions. Each key frame keeps its best few, and the cheapest path through them,
residual and joint motion together, is found by dynamic programming (Viterbi).
"""

import numpy as np
from numpy.typing import NDArray

from maniport.demonstrations.directions import Directions
from maniport.demonstrations.long_paths import parts_of
from maniport.demonstrations.path_solver import solve_each
from maniport.validation import Array

KEY_RATE = 8.0
"""Key frames per second."""
SAMPLES = 1024
CANDIDATES = 6
TOGETHER = 512
"""So many key frames are solved at a time, one alone as well as all: it bounds the memory."""
RESIDUAL_SCALE = 0.02
"""A residual that costs as much [rad] …"""
MOTION_SCALE = 0.25
"""… as this joint motion from one key frame to the next [rad]."""


def initial_path(directions: Directions, time: Array) -> Array:
    """Joint angles for every frame, shape (n, dof): solved at key frames, interpolated in between."""
    keys = _key_frames(time)
    found = [_solved(directions.take(keys[part])) for part in parts_of(len(keys), TOGETHER)]
    candidates, cost = (np.concatenate(one) for one in zip(*found, strict=True))
    chosen = _cheapest_path(candidates, cost)
    return np.stack([np.interp(time, time[keys], chosen[:, j]) for j in range(chosen.shape[1])], axis=-1)


def _solved(wanted: Directions) -> tuple[Array, Array]:
    """Local solutions for each frame, shape (n, CANDIDATES, dof), and their cost, shape (n, CANDIDATES)."""
    arm = wanted.arm
    starts = _nearest_samples(wanted)
    repeated = wanted.take(np.repeat(np.arange(len(starts)), starts.shape[1]))
    solved, cost = solve_each(
        lambda q, some: repeated.take(some).residual(q), starts.reshape(-1, arm.dof), arm.lower, arm.upper
    )
    return solved.reshape(starts.shape), cost.reshape(starts.shape[:2])


def _key_frames(time: Array) -> NDArray[np.intp]:
    """Frames at about `KEY_RATE`, with the first and the last, and both sides of every gap."""
    step = float(np.median(np.diff(time))) if len(time) > 1 else 1.0
    every = max(1, round(1 / (KEY_RATE * step)))
    gaps = np.flatnonzero(np.diff(time) > 1.5 * step)
    return np.unique(np.concatenate([np.arange(0, len(time), every), [len(time) - 1], gaps, gaps + 1]).astype(np.intp))


def _nearest_samples(wanted: Directions) -> Array:
    """For each frame the samples of the joint range whose directions are nearest, shape (n, CANDIDATES, dof)."""
    samples, shown = sampled(wanted)
    return samples[likest(wanted.targets, shown)]


def sampled(wanted: Directions) -> tuple[Array, Array]:
    """Samples of the joint range, shape (SAMPLES, dof), and what directions they show, shape (SAMPLES, k, 3)."""
    samples = wanted.arm.sample(SAMPLES, random_state=0)
    return samples, wanted.model(samples)[0]


def likest(targets: Array, shown: Array) -> NDArray[np.intp]:
    """Indices of those whose directions are nearest to each of the targets (n, k, 3), shape (n, CANDIDATES)."""
    flat = np.nan_to_num(targets).reshape(len(targets), -1)
    likeness = flat @ shown.reshape(len(shown), -1).T  # of unit vectors: the larger, the smaller their distances
    return np.argsort(-likeness, axis=1)[:, :CANDIDATES]


def _cheapest_path(candidates: Array, cost: Array) -> Array:
    """Choose one candidate (n, k, dof) for each frame, such that residuals and joint motion together are least."""
    n, k, _ = candidates.shape
    total = cost[0] / RESIDUAL_SCALE**2
    origin = np.zeros((n, k), dtype=np.intp)
    for t in range(1, n):
        motion = np.sum((candidates[t][None] - candidates[t - 1][:, None]) ** 2, axis=-1) / MOTION_SCALE**2
        ways = total[:, None] + motion
        origin[t] = np.argmin(ways, axis=0)
        total = ways.min(axis=0) + cost[t] / RESIDUAL_SCALE**2
    chosen = np.empty(n, dtype=np.intp)
    chosen[-1] = np.argmin(total)
    for t in range(n - 1, 0, -1):
        chosen[t - 1] = origin[t, chosen[t]]
    return np.asarray(candidates[np.arange(n), chosen])
