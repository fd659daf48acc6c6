"""The arm of a person, frame by frame: from points to joint angles, causally.

Offline all frames are fitted together, each joint's acceleration weighted against the directions that the points show
(`maniport.mocap.path_solver`): the most probable path of joints whose accelerations are noise. Here the same
is computed from the past alone. Earlier frames give a mean and a covariance of angles and velocities (an extended
Kalman filter), and each new frame is solved within the joint limits, to convergence, with the weights, residuals and
pulls of the offline fit. Differences: a joint that no point shows comes to rest, points are neither smoothed nor
filled, and the whole joint range is searched where directions are missed, not at every key frame.
"""

import math
from dataclasses import dataclass

import numpy as np

from maniport.arms import EllipsoidSpec
from maniport.live.kernels import follow, search, trunk_directions, turned_farther, unit_vectors, updated
from maniport.mocap import ArmFit
from maniport.mocap.arm_path import (
    FASTEST_JOINT,
    KEY_RATE,
    MOTION_SCALE,
    RESIDUAL_SCALE,
    joint_priors,
    nearest_samples,
    sample_directions,
)
from maniport.mocap.cleaning import MIN_JUMP
from maniport.mocap.data_quality import MEASUREMENT_ERROR, PRIOR
from maniport.mocap.directions import Directions, vectors_of
from maniport.mocap.path_solver import LEAST_GAIN
from maniport.mocap.roles import SHORTEST, Basis, across_role, direction, points_of
from maniport.util.validation import Array

MAX_SPEED = math.radians(FASTEST_JOINT)  # Of a person's joints [rad/s]
PRIOR_INFORMATION = (MEASUREMENT_ERROR / PRIOR) ** 2  # Information on each joint that is there without any measurement


@dataclass(frozen=True)
class ArmEstimate:
    """Joint angles of a frame, and the prediction of the next frame from them."""

    q: Array  # Shape (dof,) [rad]
    velocity: Array  # Shape (dof,) [rad/s]
    covariance: Array  # Of both, in units of the squared error of a direction of weight one, shape (2 dof, 2 dof)
    targets: Array  # Directions of the frame, shape (k, 3)
    since_search: float = 0.0  # Time since the whole joint range was searched [s]


class OneEuroFilter:
    """Low-pass filter of unit vectors (n, 3), nan where not seen (Casiez, Roussel and Vogel, CHI 2012).

    The cutoff frequency grows with the filtered angular speed, from 0.5 Hz at rest by 0.5 Hz for each rad/s: noise is
    reduced where the arm is slow, and the delay is 0.1 s at 2 rad/s. A vector that was not seen for 0.25 s begins anew.
    """

    CUTOFF, SLOPE, SPEED_CUTOFF, LONGEST_GAP = 0.5, 0.5, 1.0, 0.25  # [Hz], [Hz s/rad], [Hz], [s]

    def __init__(self, count: int):
        self._values, self._speeds, self._times = np.zeros((count, 3)), np.zeros((count, 3)), np.full(count, -np.inf)

    def __call__(self, vectors: Array, now: float) -> Array:
        """Return the filtered vectors at a time [s]."""
        seen = ~np.isnan(vectors[:, 0])
        elapsed = np.where(seen, now - self._times, np.inf)[:, None]
        new = elapsed > self.LONGEST_GAP
        speeds = np.where(new, 0.0, (vectors - self._values) / elapsed)
        self._speeds = np.where(new, 0.0, self._speeds + _share(self.SPEED_CUTOFF, elapsed) * (speeds - self._speeds))
        cutoff = self.CUTOFF + self.SLOPE * np.linalg.norm(self._speeds, axis=1, keepdims=True)
        filtered = self._values + np.where(new, 1.0, _share(cutoff, elapsed)) * (vectors - self._values)
        self._values[seen], self._times[seen] = filtered[seen], now
        return filtered


def _share(cutoff: Array | float, elapsed: Array) -> Array:
    """Return how far a low-pass filter moves to a new value after a time."""
    return np.asarray(1.0 / (1.0 + 1.0 / (2.0 * np.pi * cutoff * elapsed)))


class Person:
    """The arm of a person that was fitted to a recording, estimated in new frames of the same `points`."""

    def __init__(self, fit: ArmFit):
        self.arm, roles, self.is_noisy = fit.arm, fit.roles, fit.smoothed
        self.points = tuple(points_of(roles))
        basis = Basis(self.points)
        vectors, second = vectors_of(basis, roles, str(self.arm.side)), across_role(roles)
        trunk = [direction(basis, roles[role]) for role in ("trunk_up", second)]
        self._forward = second == "trunk_front"
        self._linear = np.stack([*vectors.values(), *trunk]).astype(np.float64)
        self.count = len(self._linear)
        directions = Directions(self.arm, tuple(vectors), np.empty((0, len(vectors), 3)))
        self._body, self._weights = directions.arrays()
        self._samples, self._sampled_directions = sample_directions(directions)
        held = joint_priors(self.arm, roles)
        self._held = held.lower, held.upper, held.pull**2, held.neutral
        noise = (2 * np.pi * held.cutoff) ** 4
        self._constants = noise, self._weights, self._body, self._held, PRIOR_INFORMATION, LEAST_GAIN
        # an outlier takes an end of a segment elsewhere, by more than the least jump of a point
        self._least_jump = MIN_JUMP / np.array([fit.segment_lengths[name] for name in fit.segments])

    def vectors(self, positions: Array) -> Array:
        """Compute unit vectors (k + 2, 3) along segments, joint axes and the trunk; nan where a point is not seen."""
        return np.asarray(unit_vectors(positions, self._linear, SHORTEST))

    def directions(self, vectors: Array) -> Array | None:
        """Compute directions (k, 3) in the trunk frame of `vectors`, nan where not seen; None without arm or trunk."""
        targets = trunk_directions(vectors, self._forward)
        return None if np.isnan(targets[: len(self._least_jump)]).any() else targets

    def hand(self, q: Array, spec: EllipsoidSpec) -> tuple[Array, Array]:
        """Ellipsoid (d, d) of joint angles (dof,), and the position of the hand (3,) [m], in the trunk frame."""
        pose, ellipsoid = self.arm.posed_ellipsoids(q, spec)
        return ellipsoid, pose[:3, 3]

    def jumps(self, before: ArmEstimate, targets: Array, dt: float) -> bool:
        """Whether a segment turns faster than joints do, and farther than by errors of a few centimeters."""
        return bool(turned_farther(before.targets, targets, MAX_SPEED * dt, self._least_jump))

    def is_too_fast(self, before: ArmEstimate, estimate: ArmEstimate, dt: float) -> bool:
        """Whether a joint is faster than joints are."""
        return bool(np.abs(estimate.q - before.q).max() > MAX_SPEED * dt)

    def begin(self, targets: Array, near: Array | None = None) -> ArmEstimate:
        """Search the whole joint range, with a preference for a configuration (dof,) `near` which the arm was lately.

        The standard deviation of the unknown velocities is 20 rad/s.
        """
        n, start_weights = self.arm.dof, np.where(np.isnan(targets[:, 0]), 0.0, self._weights)
        starts = self._samples[nearest_samples(targets[None], self._sampled_directions)[0]]
        starts = starts.copy() if near is None else np.concatenate([near[None], starts])
        costs, information, no_prior = np.empty(len(starts)), np.empty((len(starts), n, n)), np.zeros((n, n))
        seen = np.nan_to_num(targets)
        for i, q in enumerate(starts):
            square = search(q, seen, start_weights, self._body, self._held, q, no_prior, 30, LEAST_GAIN, information[i])
            costs[i] = square / RESIDUAL_SCALE**2
        if near is not None:
            costs += np.sum((starts - near) ** 2, axis=1) / MOTION_SCALE**2
        best = int(np.argmin(costs))
        covariance = np.diag((np.repeat([PRIOR, 20.0], n) / MEASUREMENT_ERROR) ** 2)
        covariance = updated(covariance, information[best], PRIOR_INFORMATION)
        return ArmEstimate(starts[best], np.zeros(n), covariance, targets)

    def follow(self, before: ArmEstimate, targets: Array, dt: float) -> ArmEstimate:
        """Estimate the arm a time dt [s] after an estimate; joints that no point shows come to rest within 0.25 s."""
        decay = math.exp(-dt / 0.25)
        state = before.q, before.velocity, before.covariance
        q, velocity, covariance, square = follow(*state, targets, dt, decay, *self._constants)
        since_search = before.since_search + dt
        if square > RESIDUAL_SCALE**2 and since_search > 1.0 / KEY_RATE:
            # the arm may be in a wrong local minimum: then another configuration is worth the motion to it
            other = self.begin(targets, q)
            if np.abs(other.q - q).max() > math.radians(1.0):
                return other
            since_search = 0.0
        return ArmEstimate(q, velocity, covariance, targets, since_search)
