"""Path of joint angles of an arm: a global search at a few frames per second, then a fit to all frames together.

At zero elevation of the shoulder the plane of elevation is arbitrary, and limits cut its circle of planes open, so that
a frame may have several local solutions. Each key frame keeps its best few, and dynamic programming (Viterbi) finds the
path through them with the least residuals and joint motion.
"""

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from maniport.arms import Arm
from maniport.mocap.data_quality import unobservable_joints
from maniport.mocap.directions import Directions
from maniport.mocap.path_solver import parts_of, solve_each, solve_long
from maniport.mocap.recording import Bools, when
from maniport.util.progress import Step
from maniport.util.validation import Array

FASTEST_JOINT = 1500.0
"""A joint that is faster from one frame to the next jumps [degrees/s]. In everyday motion none is; elbows of pitchers
reach 2300 and their shoulders 7000 (Fleisig et al., Journal of Biomechanics 32, 1999)."""

KEY_RATE = 8.0  # Key frames per second
RESIDUAL_SCALE = 0.02  # A residual that costs as much [rad] …
MOTION_SCALE = 0.25  # … as this joint motion from one key frame to the next [rad]


@dataclass(frozen=True)
class JointPriors:
    """Terms of the fit other than the residuals; each of shape (dof,)."""

    lower: Array  # limits, equal where a joint is fixed [rad]
    upper: Array
    pull: Array  # weight of the distance to the neutral angle
    neutral: Array  # [rad]
    cutoff: Array  # frequency up to which motion is followed [Hz]


def joint_priors(arm: Arm, roles: Collection[str]) -> JointPriors:
    """Return the priors of the joints of an arm with recorded points of these roles.

    Motion that is fully observed is followed up to 30 Hz; arms move below 10 Hz, and directions of little weight, such
    as the hand's, are followed up to about half of the cutoff. Unobservable joints move below 10 Hz, or are pulled to
    neutral: in proportion to the inverse of their range, so that all use about the same part of it.
    """
    neutral = np.clip(0.0, arm.lower, arm.upper)
    lower, upper, pull = arm.lower.copy(), arm.upper.copy(), np.zeros(arm.dof)
    cutoff = np.full(arm.dof, 30.0)
    for joint in unobservable_joints(arm, roles):
        cutoff[joint] = 10.0
        if "hand" not in roles:
            lower[joint] = upper[joint] = neutral[joint]
        else:
            pull[joint] = 0.004 * np.pi / (arm.upper[joint] - arm.lower[joint])
    return JointPriors(lower, upper, pull, neutral, cutoff)


def sample_directions(directions: Directions) -> tuple[Array, Array]:
    """Return samples of the joint range, shape (1024, dof), and their directions, shape (1024, k, 3)."""
    samples = directions.arm.sample(1024, random_state=0)
    return samples, directions.model(samples)[0]


def nearest_samples(targets: Array, samples: Array, count: int = 6) -> NDArray[np.intp]:
    """Return indices of the samples whose directions are nearest to each of the targets (n, k, 3), (n, count)."""
    flat = np.nan_to_num(targets).reshape(len(targets), -1)
    similarity = flat @ samples.reshape(len(samples), -1).T  # of unit vectors: the larger, the smaller their distances
    return np.argsort(-similarity, axis=1)[:, :count]


def solve_arm(directions: Directions, time: Array, roles: Collection[str], step: Step) -> Array:
    """Return the joint angles (n, dof) of the path."""
    step(0.1)
    priors = joint_priors(directions.arm, roles)
    steps = np.diff(time)
    usual = float(np.median(steps)) if len(steps) else 1.0
    joined = steps < 1.5 * usual
    start = np.clip(_initial_path(directions, time, usual, joined), priors.lower, priors.upper)
    step(0.4)
    weight = np.zeros_like(start)  # κ/Δt² of each joint's acceleration in each frame; zero at the ends and at gaps
    if len(steps) > 1:
        full = 1 / (2 * np.pi * priors.cutoff * usual) ** 2
        weight[1:-1] = np.where((joined[1:] & joined[:-1])[:, None], full, 0.0)
    return solve_long(
        lambda part: directions.take(part).residual,
        start,
        priors.lower,
        priors.upper,
        weight,
        priors.pull,
        priors.neutral,
        lambda part: step(0.4 + 0.6 * part),
    )


def _initial_path(directions: Directions, time: Array, usual: float, joined: Bools) -> Array:
    """Return joint angles for every frame, shape (n, dof): solved at key frames, interpolated in between.

    Key frames are about `KEY_RATE` a second, the first and the last, and both sides of every gap.
    """
    every, gaps = max(1, round(1 / (KEY_RATE * usual))), np.flatnonzero(~joined)
    keys = np.unique(np.concatenate([np.arange(0, len(time), every), [len(time) - 1], gaps, gaps + 1]).astype(np.intp))
    samples, modeled = sample_directions(directions)
    parts = parts_of(len(keys), 512)  # which bounds the memory
    solutions = [_local_solutions(directions.take(keys[part]), samples, modeled) for part in parts]
    candidates, cost = (np.concatenate(arrays) for arrays in zip(*solutions, strict=True))
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
    path = candidates[np.arange(n), chosen]
    return np.stack([np.interp(time, time[keys], path[:, j]) for j in range(path.shape[1])], axis=-1)


def _local_solutions(directions: Directions, samples: Array, modeled: Array) -> tuple[Array, Array]:
    """Return local solutions for each frame, shape (n, k, dof), and their cost, shape (n, k)."""
    arm, starts = directions.arm, samples[nearest_samples(directions.targets, modeled)]
    repeated = directions.take(np.repeat(np.arange(len(starts)), starts.shape[1]))
    solved, cost = solve_each(
        lambda q, rows: repeated.take(rows).residual(q), starts.reshape(-1, arm.dof), arm.lower, arm.upper
    )
    return solved.reshape(starts.shape), cost.reshape(starts.shape[:2])


def jump_warning(q: Array, time: Array, frames: NDArray[np.intp], names: tuple[str, ...]) -> str:
    """Report the frames into which a joint jumps from the preceding frame of the recording; empty without any.

    Joints jump where points are confused, and where the arm hangs straight down: there the plane in which it is raised
    may rotate by any angle at once.
    """
    speed = np.degrees(np.abs(np.diff(q, axis=0)).max(axis=1, initial=0.0)) / np.diff(time)
    jumps = np.flatnonzero((speed > FASTEST_JOINT) & (np.diff(frames) == 1)) + 1
    if not len(jumps):
        return ""
    steps = np.degrees(np.abs(q[jumps] - q[jumps - 1]))
    worst, joint = np.unravel_index(np.argmax(steps), steps.shape)
    return (
        f"joints jump in {len(jumps)} of {len(q)} frames, faster than {FASTEST_JOINT:g}°/s "
        f"({when(time, np.isin(np.arange(len(q)), jumps))}); most {names[joint]}, by {steps[worst, joint]:.1f}° in one "
        f"frame at {time[jumps[worst]]:.2f} s. They are kept"
    )
