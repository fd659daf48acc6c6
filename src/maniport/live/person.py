"""The person, frame by frame: from points to joint angles, causally.

Offline all frames are fitted together, each joint's acceleration weighed against what the points show
(`maniport.demonstrations.path_solver`). That is the most probable path of joints whose accelerations are noise; here
the same is asked of the past alone. What earlier frames tell is kept as a mean and a covariance of angles and
velocities (an extended Kalman filter), and each new frame is solved within the joint limits, to convergence, with the
weights, residuals and pulls of the offline fit. What differs: a joint that no point shows comes to rest instead of
being carried over to when it is seen again, and points are not smoothed, mended or filled before.
"""

from dataclasses import dataclass

import numpy as np

from maniport.demonstrations import ArmFit
from maniport.demonstrations.arm_fit import held_by
from maniport.demonstrations.determined import MEASUREMENT_ERROR, PRIOR
from maniport.demonstrations.dialects import POINTS
from maniport.demonstrations.directions import Directions
from maniport.demonstrations.leaps import FASTEST_JOINT
from maniport.demonstrations.path_solver import LEAST_GAIN
from maniport.demonstrations.repair import LEAST_LEAP
from maniport.demonstrations.roles import Basis, across_role, direction, role_position, trunk_axes
from maniport.demonstrations.shown import points_of, unit, vectors_of
from maniport.demonstrations.starts import MOTION_SCALE, RESIDUAL_SCALE, likest, sampled
from maniport.tracking.kernels import step_within_limits
from maniport.validation import Array

STEPS, FIRST_STEPS = 6, 30
"""Most steps of the search in a frame that follows another, and in one that begins anew."""
STILL = 1e-7
"""A step that moves no joint farther is the last [rad]."""
TO_REST = 0.25
"""Time constant with which joints that no point shows come to rest [s]."""
FASTEST = 20.0
"""What is known of a joint's velocity in the first frame: about this much, standard deviation [rad/s]."""


@dataclass(frozen=True)
class Posture:
    """Joint angles of a frame, and what they tell the next one.

    Attributes
    ----------
    q, velocity : ndarray, shape (dof,)
        [rad], [rad/s].
    covariance : ndarray, shape (2 dof, 2 dof)
        Of both, in units of the squared error of a direction of weight one.
    targets : ndarray, shape (k, 3)
        The directions that were seen.
    """

    q: Array
    velocity: Array
    covariance: Array
    targets: Array


class Person:
    """The arm of a person that was fitted before, found in new frames.

    Parameters
    ----------
    fit : ArmFit
        Of a recording of the same person with the same points.

    Attributes
    ----------
    points : tuple of str
        The names of the points that are needed.
    """

    def __init__(self, fit: ArmFit):
        self.arm, roles = fit.arm, fit.roles
        self.points = tuple(points_of(roles))
        basis = Basis(self.points)
        vectors = vectors_of(basis, roles, str(self.arm.side))
        second = across_role(roles)
        trunk = [direction(basis, roles[role]) for role in ("trunk_up", second)]
        self._forward = second == "trunk_front"
        self._linear = np.stack([*vectors.values(), *trunk])
        needed = [role_position(basis, names) for role, names in roles.items() if role in POINTS]
        self._uses = np.stack([*vectors.values(), *trunk]) != 0
        self._needed = np.any(np.stack([*needed, *trunk]) != 0, axis=0)
        directions = Directions(self.arm, tuple(vectors), np.empty((0, len(vectors), 3)))
        self._terms = directions.one()
        self._samples, self._shown = sampled(directions)
        self._held = held_by(self.arm, roles)
        self._noise = (2 * np.pi * self._held.cutoff) ** 4
        # a direction that leaps takes an end of its segment elsewhere, by more than the least leap of a point
        lengths = [fit.segment_lengths[name] for name in fit.segments]
        self._least_leap = LEAST_LEAP / np.array(lengths)

    def seen(self, positions: Array) -> Array | None:
        """Directions (k, 3) in the trunk frame that points (n, 3) show, nan where not; None without arm or trunk."""
        lost = np.isnan(positions).any(axis=1)
        if (lost & self._needed).any():
            return None
        vectors = self._linear @ np.where(lost[:, None], 0.0, positions)
        targets = unit(vectors[:-2] @ trunk_axes(vectors[-2], vectors[-1], self._forward))
        if lost.any():
            targets[(self._uses[:-2] & lost).any(axis=1)] = np.nan
        return None if np.isnan(targets[: len(self._least_leap)]).any() else targets

    def leaps(self, before: Posture, targets: Array, dt: float) -> bool:
        """Whether a segment turns faster than joints do, and farther than by errors of a few centimetres."""
        segments = slice(0, len(self._least_leap))
        chords = np.linalg.norm(targets[segments] - before.targets[segments], axis=1)
        angles = 2.0 * np.arcsin(np.minimum(0.5 * chords, 1.0))
        return bool((angles > np.maximum(np.radians(FASTEST_JOINT) * dt, self._least_leap)).any())

    def hurries(self, before: Posture, found: Posture, dt: float) -> bool:
        """Whether a joint is faster than joints are."""
        return bool(np.abs(found.q - before.q).max() > np.radians(FASTEST_JOINT) * dt)

    def begin(self, targets: Array, near: Array | None = None) -> Posture:
        """Find the arm with nothing known but, perhaps, which posture (dof,) it was in not long ago."""
        starts = self._samples[likest(targets[None], self._shown)[0]]
        starts = starts if near is None else np.concatenate([near[None], starts])
        nothing = np.zeros((self.arm.dof, self.arm.dof))
        found = [self._solved(start, targets, start, nothing, FIRST_STEPS) for start in starts]
        costs = np.array([cost for _, cost, _ in found]) / RESIDUAL_SCALE**2
        if near is not None:
            costs += np.sum((np.array([q for q, _, _ in found]) - near) ** 2, axis=1) / MOTION_SCALE**2
        q, _, information = found[int(np.argmin(costs))]
        known = np.repeat([PRIOR, FASTEST], self.arm.dof) / MEASUREMENT_ERROR
        return self._updated(q, np.zeros(self.arm.dof), np.diag(known**2), information, targets)

    def follow(self, before: Posture, targets: Array, dt: float) -> Posture:
        """Find the arm a time dt [s] after it was found `before`."""
        n, slower = self.arm.dof, np.exp(-dt / TO_REST)
        mean, velocity = before.q + dt * before.velocity, slower * before.velocity
        mean = np.clip(mean, self._held.lower, self._held.upper)
        covariance = before.covariance.copy()
        covariance[:n] += dt * before.covariance[n:]
        covariance[:, :n] += dt * covariance[:, n:]
        covariance[n:] *= slower
        covariance[:, n:] *= slower
        every = np.arange(n)
        covariance[every, every] += dt**4 * self._noise
        covariance[every, n + every] += dt**3 * self._noise
        covariance[n + every, every] += dt**3 * self._noise
        covariance[n + every, n + every] += dt**2 * self._noise
        prior = np.linalg.inv(covariance[:n, :n])
        q, _, information = self._solved(mean, targets, mean, prior, STEPS)
        velocity = velocity + covariance[n:, :n] @ (prior @ (q - mean))
        return self._updated(q, velocity, covariance, information, targets)

    def _updated(self, q: Array, velocity: Array, covariance: Array, information: Array, targets: Array) -> Posture:
        """What is known after a frame told so much of the joint angles."""
        n = self.arm.dof
        stuck = ((q <= self._held.lower) & (velocity < 0)) | ((q >= self._held.upper) & (velocity > 0))
        # no joint is ever less known than without any measurement
        told = information + (MEASUREMENT_ERROR / PRIOR) ** 2 * np.eye(n)
        gain = np.linalg.solve(np.eye(n) + told @ covariance[:n, :n], told @ covariance[:n])
        left = covariance - covariance[:, :n] @ gain
        return Posture(q, np.where(stuck, 0.0, velocity), 0.5 * (left + left.T), targets)

    def _solved(self, start: Array, targets: Array, mean: Array, prior: Array, most: int) -> tuple[Array, float, Array]:
        """Best joint angles near a start, their |r|², and JᵀJ with the pull.

        Minimises |r(q)|² + |pull (q − neutral)|² + (q − mean)ᵀ prior (q − mean) within the limits.
        """
        held, pull = self._held, self._held.pull**2
        q, damping = np.clip(start, held.lower, held.upper), np.array([1e-9])
        trial, expected = np.empty((1, len(q))), np.empty(1)

        def evaluate(q: Array) -> tuple[float, float, Array, Array]:
            square, gradient, hessian = self._terms(q, targets)
            hessian[np.diag_indices(len(q))] += pull
            pulled, away = pull * (q - held.neutral), prior @ (q - mean)
            cost = square + float(pulled @ (q - held.neutral)) + float(away @ (q - mean))
            return cost, square, gradient + pulled + away, hessian

        cost, square, gradient, hessian = evaluate(q)
        for _ in range(most):
            whole = hessian + prior
            step_within_limits(q[None], gradient[None], whole[None], damping, held.lower, held.upper, trial, expected)
            tried = evaluate(trial[0])
            moved = float(np.abs(trial[0] - q).max())
            if tried[0] < cost:
                gained, q = cost - tried[0], trial[0].copy()
                cost, square, gradient, hessian = tried
                damping *= 0.2
                if moved < STILL or gained < LEAST_GAIN * cost:
                    break
            elif moved < STILL:
                break
            else:
                damping[:] = np.maximum(1e-3, 8.0 * damping)
        return q, square, hessian
