"""A robot arm, control step by control step: it moves towards a target within its limits, or brakes."""

import math

import numpy as np

from maniport.arms import Arm, EllipsoidSpec
from maniport.arms.collisions import Collisions
from maniport.arms.manipulability import squared
from maniport.motion import MotionLimits, Objective, SeedBank
from maniport.motion.arm_model import require_trackable
from maniport.motion.follow.follower import Follower, Stepper
from maniport.motion.limits import RememberingLimit, UnevenLimit
from maniport.motion.objective import FOLLOWING_WEIGHT, Damping
from maniport.motion.schedule import Schedule
from maniport.motion.search.descent import descend
from maniport.spd.affine_invariant import distance_unchecked
from maniport.util.validation import Array

COLLISION_TIME = 0.1  # The clearance is used up with this time constant, or slower [s]
# This share of the acceleration that the slowest joint gives a stretched arm's end effector brakes it before its target
BRAKING = 0.5
REFERENCE_COST = 2.0
"""Cost of a radian away from the reference: high enough that a robot which is led faster than it can follow stays on
its branch of configurations, and low enough that the end effector is on its path where it can be."""


class Robot:
    """An arm that follows targets of the present as `maniport.motion.track` does those of a motion."""

    def __init__(
        self,
        limits: MotionLimits,
        collisions: Collisions | None,
        spec: EllipsoidSpec,
        damping: Damping,
        start: Array,
        path: bool,
        reference: Array | None = None,
    ):
        require_trackable(limits.arm, spec)
        objective = Objective.of(limits.arm, spec, damping, FOLLOWING_WEIGHT, positive=True)
        self._collision = (
            RememberingLimit(collisions, way_out=0.0) if collisions is not None and collisions.known else None
        )
        self._bounds = UnevenLimit(limits)
        d, spec = spec.size, limits.arm.resolved(spec)
        self._rows, self._weights = spec.rows, None if spec.joint_weights is None else spec.weights(limits.arm.dof)
        self._damping = objective.damped(np.zeros((d, d)))
        self._reference = None if reference is None else SeedBank(limits.arm, reference, objective.damping, spec)
        self._targets = Schedule(
            np.zeros(1),
            np.eye(d)[None],
            np.zeros((1, 3)) if path else None,
            postures=None if reference is None else start[None].copy(),
        )
        follower = Follower((objective,))
        constraints = [self._bounds] if self._collision is None else [self._bounds, self._collision]
        self._stepper = Stepper(follower, start, constraints, (self._targets,), REFERENCE_COST)
        self._acceleration = BRAKING * follower.reach * float(limits.acceleration.min())
        self.rest(start)

    def rest(self, q: Array) -> None:
        """Be at rest in a configuration (dof,), without any memory of earlier steps."""
        self._bounds.velocity, self._bounds.last = np.zeros(len(q)), None
        if self._collision is not None:
            self._collision.forget()
        if self._targets.postures is not None:
            self._targets.postures[0] = q
        self._set(q.copy())

    def _set(self, q: Array) -> None:
        """Take a configuration."""
        self.q = q
        self._stepper.configuration.update(q)
        self.tip, jacobian = self._stepper.tip()
        rows = jacobian[self._rows]
        self.achieved = squared(rows if self._weights is None else rows * self._weights)

    def distance(self, target: Array) -> float:
        """Affine-invariant distance of a target (d, d) and the achieved ellipsoid, with the damping."""
        return float(distance_unchecked(target + self._damping, self.achieved + self._damping))

    @property
    def velocity(self) -> Array:
        """In the last step, shape (dof,)."""
        return self._bounds.velocity

    @property
    def resting(self) -> bool:
        """Whether it is at rest."""
        return not self.velocity.any()

    def choose_reference(self, ellipsoid: Array, tip: Array | None, candidates: int = 5) -> None:
        """Stay near that configuration of the reference, of those that suit a target best, which is nearest."""
        if self._reference is not None:
            assert self._targets.postures is not None
            near = self._reference.query(ellipsoid[None], None if tip is None else tip[None], k=candidates)[0]
            self._targets.postures[0] = near[np.argmin(np.sum((near - self.q) ** 2, axis=1))]

    def follow(self, ellipsoid: Array, tip: Array | None, before: Array | None, dt: float, share: float) -> None:
        """Move for dt [s] towards an ellipsoid (d, d) and a position (3,), whose last value was `before`.

        `share` is that of the velocity limits that may be used.
        """
        self._bounds.share = share
        if self._collision is not None:
            self._collision.gain = -np.expm1(-dt / COLLISION_TIME)
        self._targets.ellipsoids[0] = ellipsoid
        if tip is not None:
            assert self._targets.positions is not None
            assert before is not None
            self._targets.positions[0] = tip - self._left_for_later(before, dt)
        self._stepper.aim((self._targets,), 0, (before,))
        velocity = self._stepper.velocity(dt)
        if velocity is None or not self._move(velocity, dt, checked=True):
            self.brake(dt)

    def _left_for_later(self, before: Array, dt: float) -> Array:
        """The part of the error at the last target that is not made up for within dt, so that braking is possible."""
        error = before - self.tip
        away = max(math.sqrt(error @ error), 1e-9)
        return np.asarray(error * max(0.0, 1.0 - dt * math.sqrt(2.0 * self._acceleration / away)))

    def brake(self, dt: float) -> None:
        """Come to rest as soon as accelerations allow, for a time dt [s]."""
        self._bounds.share = 1.0
        self._move(np.zeros(len(self.q)), dt, checked=False)

    def _move(self, velocity: Array, dt: float, checked: bool) -> bool:
        """Move at a velocity, or as limits allow; with `checked` only where the way to rest is collision-free."""
        achieved, configurations = self._bounds.step(self.q, velocity, dt)
        if checked and self._collision is not None and not self._collision.free(configurations):
            return False
        self._bounds.velocity, self._bounds.last = achieved, dt
        self._set(configurations[0])
        return True


def best_start(
    arm: Arm,
    spec: EllipsoidSpec,
    damping: Damping,
    ellipsoid: Array,
    tip: Array | None,
    collisions: Collisions | None,
    random_state: int,
    samples: int = 4096,
    starts: int = 48,
) -> Array:
    """The collision-free configuration (dof,) found that suits an ellipsoid (d, d) and a position of the tip best."""
    bank = SeedBank.build(arm, samples, random_state, spec=spec, collisions=collisions)
    objective = Objective.of(arm, spec, damping, positive=True)
    positions = None if tip is None else np.tile(tip, (starts, 1))
    targets = objective.targets(np.repeat(ellipsoid[None], starts, axis=0), positions)
    near = bank.starts(ellipsoid[None], None if tip is None else tip[None], starts)[0]
    found = np.concatenate([descend(targets, near[:, None], 1e-6, 100), near])
    # samples are taken only where no configuration that was found from them is free
    costs = np.concatenate([targets.cost(found[:starts]), targets.cost(near) + 1e6])
    found = found[np.argsort(costs, kind="stable")]
    return np.asarray(found[0] if collisions is None else found[np.argmin(collisions.collides(found))])
