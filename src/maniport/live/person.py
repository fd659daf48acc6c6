"""The person, frame by frame: from points to joint angles, causally.

Offline all frames are fitted together, each joint's acceleration weighed against what the points show
(`maniport.demonstrations.path_solver`). That is the most probable path of joints whose accelerations are noise; here
the same is asked of the past alone. What earlier frames tell is kept as a mean and a covariance of angles and
velocities (an extended Kalman filter), and each new frame is solved within the joint limits, to convergence, with the
weights, residuals and pulls of the offline fit. What differs: a joint that no point shows comes to rest instead of
being carried over to when it is seen again, points are not smoothed, mended or filled before, and what the whole joint
range has to offer is looked at where directions are missed, not at every key frame.
"""

import math
from dataclasses import dataclass

import numpy as np

from maniport.bodies import EllipsoidSpec
from maniport.bodies.kinematics import Kinematics
from maniport.bodies.manipulability import manipulability, squared
from maniport.demonstrations import ArmFit
from maniport.demonstrations.arm_fit import held_by
from maniport.demonstrations.cleaning import LEAST_LEAP
from maniport.demonstrations.data_quality import MEASUREMENT_ERROR, PRIOR
from maniport.demonstrations.directions import Directions
from maniport.demonstrations.initial_path import KEY_RATE, MOTION_SCALE, RESIDUAL_SCALE, likest, sampled
from maniport.demonstrations.jumps import FASTEST_JOINT
from maniport.demonstrations.marker_sets import POINTS
from maniport.demonstrations.observation import vectors_of
from maniport.demonstrations.path_solver import LEAST_GAIN
from maniport.demonstrations.roles import SHORTEST, Basis, across_role, direction, points_of, role_position
from maniport.live.kernels import follow, leaping, learn, search, show
from maniport.validation import Array

STEPS, FIRST_STEPS = 6, 30
"""Most steps of the search in a frame that follows another, and in one that begins anew."""
TO_REST = 0.25
"""Time constant with which joints that no point shows come to rest [s]."""
FASTEST = math.radians(FASTEST_JOINT)
"""Of joints [rad/s]."""
AT_FIRST = 20.0
"""What is known of a joint's velocity in the first frame: about this much, standard deviation [rad/s]."""
ANOTHER = math.radians(1.0)
"""Postures that are farther apart in a joint are two [rad]."""
FLOOR = (MEASUREMENT_ERROR / PRIOR) ** 2
"""Information of each joint that is there without any measurement."""


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
    looked : float
        How long ago the whole joint range was searched [s].
    """

    q: Array
    velocity: Array
    covariance: Array
    targets: Array
    looked: float = 0.0


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
        self._kinematics = Kinematics(self.arm.chain)
        self.points = tuple(points_of(roles))
        basis = Basis(self.points)
        vectors = vectors_of(basis, roles, str(self.arm.side))
        second = across_role(roles)
        trunk = [direction(basis, roles[role]) for role in ("trunk_up", second)]
        self._forward = second == "trunk_front"
        self._linear = np.stack([*vectors.values(), *trunk]).astype(np.float64)
        needed = [role_position(basis, names) for role, names in roles.items() if role in POINTS]
        self._needed = np.any(np.stack([*needed, *trunk]) != 0, axis=0)
        directions = Directions(self.arm, tuple(vectors), np.empty((0, len(vectors), 3)))
        self._body, self._full = directions.arrays()
        self._samples, self._shown = sampled(directions)
        held = held_by(self.arm, roles)
        self._held = held.lower, held.upper, held.pull**2, held.neutral
        self._noise = (2 * np.pi * held.cutoff) ** 4
        # a direction that leaps takes an end of its segment elsewhere, by more than the least leap of a point
        lengths = [fit.segment_lengths[name] for name in fit.segments]
        self._least_leap = LEAST_LEAP / np.array(lengths)

    def seen(self, positions: Array) -> Array | None:
        """Directions (k, 3) in the trunk frame that points (n, 3) show, nan where not; None without arm or trunk."""
        targets = np.empty((len(self._full), 3))
        segments = len(self._least_leap)
        shown = show(positions, self._linear, self._needed, segments, self._forward, SHORTEST, targets)
        return targets if shown else None

    def hand(self, q: Array, spec: EllipsoidSpec) -> tuple[Array, Array]:
        """Ellipsoid (d, d) of joint angles (dof,), and where the hand is (3,) [m], in the trunk frame."""
        poses, jacobians = self._kinematics.motion(self._kinematics.positions(q[None]))
        jacobian, plain = self._kinematics.coupled(jacobians)[0], spec.kind == "velocity" and spec.joint_weights is None
        ellipsoid = squared(jacobian[spec.rows]) if plain else manipulability(jacobian, self.arm.resolved(spec))
        return ellipsoid, poses[0, :3, 3]

    def leaps(self, before: Posture, targets: Array, dt: float) -> bool:
        """Whether a segment turns faster than joints do, and farther than by errors of a few centimetres."""
        return bool(leaping(before.targets, targets, FASTEST * dt, self._least_leap))

    def hurries(self, before: Posture, found: Posture, dt: float) -> bool:
        """Whether a joint is faster than joints are."""
        return bool(np.abs(found.q - before.q).max() > FASTEST * dt)

    def begin(self, targets: Array, near: Array | None = None) -> Posture:
        """Find the arm with nothing known but, perhaps, which posture (dof,) it was in not long ago."""
        n, weights = self.arm.dof, np.where(np.isnan(targets[:, 0]), 0.0, self._full)
        starts = self._samples[likest(targets[None], self._shown)[0]]
        starts = starts.copy() if near is None else np.concatenate([near[None], starts])
        costs, information, nothing = np.empty(len(starts)), np.empty((len(starts), n, n)), np.zeros((n, n))
        seen = np.nan_to_num(targets)
        for i, q in enumerate(starts):
            square = search(
                q, seen, weights, self._body, self._held, q, nothing, FIRST_STEPS, LEAST_GAIN, information[i]
            )
            costs[i] = square / RESIDUAL_SCALE**2
        if near is not None:
            costs += np.sum((starts - near) ** 2, axis=1) / MOTION_SCALE**2
        best = int(np.argmin(costs))
        covariance = np.diag((np.repeat([PRIOR, AT_FIRST], n) / MEASUREMENT_ERROR) ** 2)
        learn(covariance, information[best] + FLOOR * np.eye(n))
        return Posture(starts[best], np.zeros(n), covariance, targets)

    def follow(self, before: Posture, targets: Array, dt: float) -> Posture:
        """Find the arm a time dt [s] after it was found `before`."""
        q, velocity, covariance = before.q.copy(), before.velocity.copy(), before.covariance.copy()
        square = follow(
            q, velocity, covariance, dt, math.exp(-dt / TO_REST), self._noise, targets, self._full, self._body,
            self._held, STEPS, LEAST_GAIN, FLOOR,
        )  # fmt: skip
        looked = before.looked + dt
        if square > RESIDUAL_SCALE**2 and looked > 1.0 / KEY_RATE:
            # perhaps the arm is on the wrong way: then another posture is worth the motion to it
            other = self.begin(targets, q)
            if np.abs(other.q - q).max() > ANOTHER:
                return other
            looked = 0.0
        return Posture(q, velocity, covariance, targets, looked)
