"""The arm of a person, frame by frame: from points to joint angles, causally.

Offline all frames are fitted together, each joint's acceleration weighted against the directions that the points show
(`maniport.mocap.arm_path`): the most probable path of joints whose accelerations are noise. Here the same
is computed from the past alone. Earlier frames give a mean and a covariance of angles and velocities (an extended
Kalman filter), and each new frame is solved within the joint limits, to convergence, with the weights, residuals and
pulls of the offline fit. Differences: a joint that no point shows comes to rest, points are not smoothed but
filled from the points around them, and the whole joint range is searched where directions are missed, not at every key
frame.
"""

import math
from typing import NamedTuple

import numpy as np

from maniport.arms import EllipsoidSpec
from maniport.errors import InvalidInputError, NotSPDError
from maniport.live.kernels import (
    follow,
    search_all,
    trunk_directions,
    turned,
    unit_vectors,
    updated,
)
from maniport.live.targets import Target
from maniport.mocap import ArmFit, Recording
from maniport.mocap.arm_path import (
    KEY_RATE,
    LEAST_GAIN,
    MOTION_SCALE,
    RESIDUAL_SCALE,
    joint_priors,
    nearest_samples,
    sample_directions,
)
from maniport.mocap.cleaning import MIN_JUMP
from maniport.mocap.data_quality import FASTEST_JOINT, MEASUREMENT_ERROR, PRIOR
from maniport.mocap.directions import Directions, vectors_of
from maniport.mocap.roles import SHORTEST, across_role, direction, points_of
from maniport.motion import Placement
from maniport.spd.kernels import congruence
from maniport.transfer import DomainAdapter
from maniport.util.validation import Array

MAX_SPEED = math.radians(FASTEST_JOINT)  # Of a person's joints [rad/s]
# Information on each joint that is there without any measurement
PRIOR_INFORMATION = (MEASUREMENT_ERROR / PRIOR) ** 2


class ArmEstimate(NamedTuple):
    """Joint angles of a frame, and the prediction of the next frame from them."""

    q: Array  # (dof,) [rad]
    velocity: Array  # (dof,) [rad/s]
    # (2 dof, 2 dof), of both, in units of the squared error of a direction of weight one
    covariance: Array
    directions: Array  # (k, 3), of the frame
    since_search: float = 0.0  # Time since the whole joint range was searched [s]


class OneEuroFilter:
    """Low-pass filter of unit vectors (n, 3), nan where not seen (Casiez, Roussel and Vogel, CHI 2012).

    The cutoff frequency grows with the filtered angular speed, from 0.5 Hz at rest by 0.5 Hz for each rad/s: noise is
    reduced where the arm is slow, and the delay is 0.1 s at 2 rad/s. A vector that was not seen for 0.25 s begins anew.
    """

    # [Hz], [Hz s/rad], [Hz], [s]
    CUTOFF = 0.5
    SLOPE = 0.5
    SPEED_CUTOFF = 1.0
    LONGEST_GAP = 0.25

    def __init__(self, count: int):
        self._values = np.zeros((count, 3))
        self._speeds = np.zeros((count, 3))
        self._times = np.full(count, -np.inf)

    def __call__(self, vectors: Array, now: float) -> Array:
        """Return the filtered vectors at a time [s]."""
        seen = ~np.isnan(vectors[:, 0])
        elapsed = np.where(seen, now - self._times, np.inf)[:, None]
        new = elapsed > self.LONGEST_GAP
        speeds = np.where(new, 0.0, (vectors - self._values) / elapsed)
        turns = 2.0 * np.pi * elapsed
        share = 1.0 - 1.0 / (1.0 + self.SPEED_CUTOFF * turns)
        self._speeds = np.where(new, 0.0, self._speeds + share * (speeds - self._speeds))
        cutoff = self.CUTOFF + self.SLOPE * np.linalg.norm(self._speeds, axis=1, keepdims=True)
        filtered = self._values + np.where(new, 1.0, 1.0 - 1.0 / (1.0 + cutoff * turns)) * (
            vectors - self._values
        )
        self._values[seen] = filtered[seen]
        self._times[seen] = now
        return filtered


class Person:
    """The arm of a person that was fitted to a recording, estimated in new frames of the same `points`."""

    def __init__(self, fit: ArmFit):
        self.arm = fit.arm
        roles = fit.roles
        self.is_noisy = fit.smoothed
        self.points = tuple(points_of(roles))
        # a recording of the identity gives coefficients of the points
        identity = np.eye(len(self.points))[..., None]
        basis = Recording(
            self.points, np.repeat(identity, 3, axis=2), np.arange(float(len(identity)))
        )
        vectors = vectors_of(basis, roles, str(self.arm.side))
        second = across_role(roles)
        trunk = [direction(basis, roles[role]) for role in ("trunk_up", second)]
        self._forward = second == "trunk_front"
        self._linear = np.stack([*vectors.values(), *trunk])[..., 0].copy()
        self.count = len(self._linear)
        directions = Directions(self.arm, tuple(vectors), np.empty((0, len(vectors), 3)))
        self._body = directions.kinematics.arrays()
        self._weights = directions.weights
        self._samples, self._sampled_directions = sample_directions(directions)
        priors = joint_priors(self.arm, roles)
        self._priors = (priors.lower, priors.upper, priors.pull**2, priors.neutral)
        noise = (2 * np.pi * priors.cutoff) ** 4
        self._constants = (
            noise,
            self._weights,
            self._body,
            self._priors,
            PRIOR_INFORMATION,
            LEAST_GAIN,
        )
        # an outlier takes an end of a segment elsewhere, by more than the least jump of a point
        self._least_jump = MIN_JUMP / np.array(list(fit.segment_lengths.values()))

    def vectors(self, positions: Array) -> Array:
        """Compute unit vectors (k + 2, 3) along segments, joint axes and the trunk; nan where a point is not seen."""
        return np.asarray(unit_vectors(self._linear, positions, SHORTEST))

    def directions(self, vectors: Array) -> Array | None:
        """Compute directions (k, 3) in the trunk frame of `vectors`, nan where not seen.

        None without trunk, upper arm or forearm. A hand that is not seen comes to rest.
        """
        targets, seen = trunk_directions(vectors, self._forward, 2)
        if not seen:
            return None
        return np.asarray(targets)

    def begin(self, targets: Array, near: Array | None = None) -> ArmEstimate:
        """Search the whole joint range, with a preference for a configuration (dof,) `near` which the arm was lately.

        The standard deviation of the unknown velocities is 20 rad/s.
        """
        n = self.arm.dof
        weights = np.where(np.isnan(targets[:, 0]), 0.0, self._weights)
        starts = self._samples[nearest_samples(targets[None], self._sampled_directions)[0]]
        if near is not None:
            starts = np.concatenate([near[None], starts])
        information = np.empty((len(starts), n, n))
        no_prior = np.zeros((n, n))
        squares = search_all(
            starts,
            targets,
            weights,
            self._body,
            self._priors,
            no_prior,
            30,
            LEAST_GAIN,
            information,
        )
        costs = squares / RESIDUAL_SCALE**2
        if near is not None:
            costs += np.sum((starts - near) ** 2, axis=1) / MOTION_SCALE**2
        best = int(np.argmin(costs))
        covariance = np.diag((np.repeat([PRIOR, 20.0], n) / MEASUREMENT_ERROR) ** 2)
        covariance = updated(covariance, information[best], PRIOR_INFORMATION)
        return ArmEstimate(starts[best], np.zeros(n), covariance, targets)

    def follow(self, before: ArmEstimate, targets: Array, dt: float) -> ArmEstimate | None:
        """Estimate the arm a time dt [s] after an estimate; None where a joint is faster than joints are.

        Joints that no point shows come to rest within 0.25 s.
        """
        decay = math.exp(-dt / 0.25)
        state = before.q, before.velocity, before.covariance
        q, velocity, covariance, square, moved = follow(
            *state, targets, dt, decay, *self._constants
        )
        since_search = before.since_search + dt
        if square > RESIDUAL_SCALE**2 and since_search > 1.0 / KEY_RATE:
            # the arm may be in a wrong local minimum: then another configuration is worth the motion to it
            other = self.begin(targets, q)
            if np.abs(other.q - q).max() > math.radians(1.0):
                if np.abs(other.q - before.q).max() <= MAX_SPEED * dt:
                    return other
                return None
            since_search = 0.0
        if moved <= MAX_SPEED * dt:
            return ArmEstimate(q, velocity, covariance, targets, since_search)
        return None


class HiddenPoints:
    """Fills hidden points: since the last frame they move with the points near them, as a rigid body.

    The weights of these are their distances to the power -4. A marker of a pair, as at the elbow, is filled for 2 s
    while the other is seen, with errors of directions of about 5°; other points for 0.1 s.
    """

    def __init__(self, linear: Array, longest_in_pair: float = 2.0, longest: float = 0.1):
        # coefficients are smaller than one in the mean of the points of a role
        signs = np.sign(linear) * (np.abs(linear) < 1.0)
        self._together = (signs[:, :, None] * signs[:, None] > 0.0).any(axis=0)
        self._longest = (longest, longest_in_pair)  # times for which a point is filled [s]
        self._points = np.full((linear.shape[1], 3), np.nan)
        self._times = np.full(linear.shape[1], -np.inf)

    def fill(self, points: Array, now: float) -> Array:
        """Return points (n, 3) at a time [s], filled where possible."""
        hidden = np.isnan(points[:, 0])
        if not hidden.any():
            return points
        remembered = ~np.isnan(self._points[:, 0])
        seen = np.flatnonzero(~hidden & remembered)
        longest = np.where(self._together[:, seen].any(axis=1), self._longest[1], self._longest[0])
        filled = points.copy()
        for i in np.flatnonzero(
            hidden & remembered & (now - self._times <= longest) & (len(seen) > 0)
        ):
            distance = np.linalg.norm(self._points[seen] - self._points[i], axis=1)
            nearest = seen[distance.argmin()]
            weights = (distance.min() / np.maximum(distance, 1e-9)) ** 4
            before = self._points[seen] - self._points[nearest]
            after = points[seen] - points[nearest]
            left, _, right = np.linalg.svd(
                (weights * before.T) @ after + 1e-9 * distance.min() ** 2 * np.eye(3)
            )
            turn = left * [1.0, 1.0, np.linalg.det(left @ right)] @ right
            filled[i] = points[nearest] + (self._points[i] - self._points[nearest]) @ turn
        return filled

    def remember(self, points: Array, filled: Array, now: float) -> None:
        """Take a frame as the last one in which the points were where they are."""
        self._points = filled
        self._times[~np.isnan(points[:, 0])] = now


class LedArm:
    """An arm of the robot and of the person who leads it: the person's estimate, and the target of the robot."""

    def __init__(
        self,
        person: Person,
        rows: list[int],
        adapter: DomainAdapter,
        base: Array,
        path: Placement | None,
        spec: EllipsoidSpec,
    ):
        self.person = person
        self._map = adapter.transform
        self._spec = spec
        self._path = path
        self._rows = np.array(rows)  # indexing by a list is slow
        size = len(adapter.teacher_mean_)
        if size != spec.size:
            raise InvalidInputError(
                f"adapter must map {spec.size}×{spec.size} ellipsoids; found {size}×{size}"
            )
        # an affine map is determined by its images of the origin and of the axes
        if path is not None:
            self._turn = spec.rotation(path.rotation)
            self._origin = path.apply(base)
            self._axes = path.apply(base + np.eye(3)) - self._origin
        self.forget()

    def forget(self) -> None:
        """Forget all frames."""
        self._last_seen = -np.inf
        if self.person.is_noisy:
            self._filter: OneEuroFilter | None = OneEuroFilter(self.person.count)
        else:
            self._filter = None
        self._hidden = HiddenPoints(self.person._linear)
        self.estimate: ArmEstimate | None = None
        self.target: Target | None = None
        self.demonstrated: Array | None = None  # (d, d)

    def update(self, positions: Array, now: float, anew: bool, longest_gap: float = 0.1) -> bool:
        """Update estimate and target with a frame; False where the arm is not seen in it, or jumps.

        `anew` or after a longer gap [s], the whole joint range of the person is searched.
        """
        points = positions[self._rows]
        before = self.estimate
        filled = self._hidden.fill(points, now)
        vectors = self.person.vectors(filled)
        directions = self.person.directions(vectors)
        dt = now - self._last_seen
        least = np.maximum(MAX_SPEED * dt, self.person._least_jump)  # joints are not faster
        if directions is None or (
            before is not None and turned(before.directions, directions, least)
        ):
            return False
        if self._filter is not None:
            directions = self.person.directions(self._filter(vectors, now))
            if directions is None:
                return False
        if before is None or anew or dt > longest_gap:
            estimate: ArmEstimate | None = self.person.begin(
                directions, None if before is None else before.q
            )
        else:
            estimate = self.person.follow(before, directions, dt)
        if estimate is None:
            return False
        try:
            demonstrated, target = self._transferred(estimate.q)
        except NotSPDError:  # a flat ellipsoid, which an adapter without damping does not map
            return False
        self.demonstrated = demonstrated
        self.target = target
        self.estimate = estimate
        self._last_seen = now
        self._hidden.remember(points, filled, now)
        return True

    def _transferred(self, q: Array) -> tuple[Array, Target]:
        """Return the ellipsoid (d, d) of the person at joint angles q (dof,), and the target of the robot."""
        pose, demonstrated = self.person.arm.posed_ellipsoids(q, self._spec)
        ellipsoid = self._map(demonstrated)
        position = None
        if self._spec.kind == "force":
            ellipsoid = np.asarray(np.linalg.inv(ellipsoid))
        if self._path is not None:
            ellipsoid = congruence(self._turn, ellipsoid)
            position = pose[:3, 3] @ self._axes + self._origin
        return demonstrated, Target(ellipsoid, position)
