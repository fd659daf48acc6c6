"""The robot, control step by control step: what it makes of a target within its limits, and how it brakes."""

import math

import numpy as np

from maniport.bodies import Arm, EllipsoidSpec
from maniport.bodies.collisions import Collisions
from maniport.bodies.manipulability import squared
from maniport.spd.affine_invariant import distance_unchecked
from maniport.tracking import Control, MotionLimits, Objective, StartBank
from maniport.tracking.arm_model import require_trackable
from maniport.tracking.follow.follower import Follower
from maniport.tracking.follow.stepper import Stepper
from maniport.tracking.limits import RememberingLimit, UnevenLimit
from maniport.tracking.objective import FOLLOWING_WEIGHT, Damping
from maniport.tracking.schedule import Schedule
from maniport.tracking.search.descent import descend
from maniport.validation import Array

APPROACH = 0.1
"""The room to what could be run into is used up with this time constant, or slower [s]."""

BANK_SIZE, STARTS = 4096, 48
"""Samples of the robot among which a start is looked for, and how many of them are."""
LEAST_WAY = 1e-9
"""That is as good as none [m]."""
BRAKING = 0.5
"""Of the acceleration that the slowest joint gives a stretched arm's tip, so much brakes it before its place."""
REFERENCE_COST = 2.0
"""Cost of a radian away from the reference: so much that a robot which a person leads faster than it can follow does
not leave the branch of postures that it gets on with, and so little that the tip is on its path where it can be."""
ALIKE = 5
"""So many postures of the reference suit a target."""
FAR = 1e6
"""Added to the cost of samples, which are taken only where nothing that was found from them is free."""


class Robot:
    """An arm that follows targets of the moment as `maniport.tracking.track` does those of a motion.

    Parameters
    ----------
    limits : MotionLimits
    collisions : Collisions or None
        What it is kept apart from.
    spec : EllipsoidSpec
        Of velocity.
    damping : float or Regularization
    start : ndarray, shape (dof,)
        Where it is, at rest.
    path : bool
        Whether the tip has places to go to.
    reference : ndarray, shape (n, dof), optional
        Postures of which it stays near the one that suits its target best.

    Attributes
    ----------
    q, velocity : ndarray, shape (dof,)
    objective : Objective
    """

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
        self.objective = Objective.of(limits.arm, spec, damping, FOLLOWING_WEIGHT, positive=True)
        self._collision = (
            RememberingLimit(collisions, way_out=0.0) if collisions is not None and collisions.known else None
        )
        self._bounds = UnevenLimit(limits)
        d, spec = spec.size, limits.arm.resolved(spec)
        self._rows, self._weights = spec.rows, None if spec.joint_weights is None else spec.weights(limits.arm.dof)
        self._added = self.objective.damped(np.zeros((d, d)))
        self._guide = None if reference is None else StartBank(limits.arm, reference, self.objective.damping, spec)
        self._asked = Schedule(
            np.zeros(1),
            np.eye(d)[None],
            np.zeros((1, 3)) if path else None,
            postures=None if reference is None else start[None].copy(),
        )
        follower = Follower(self.objective, Control())
        own = [self._bounds] if self._collision is None else [self._bounds, self._collision]
        self._stepper = Stepper(follower, start, own, self._asked, REFERENCE_COST)
        self._made: tuple[Array, Array] | None = None
        self._acceleration = BRAKING * follower.reach * float(limits.acceleration.min())
        self.rest(start)

    def rest(self, q: Array) -> None:
        """Be at rest in a posture (dof,), as if nothing had been before."""
        self.q, self._made = q.copy(), None
        self._bounds.velocity, self._bounds.last = np.zeros(len(q)), None
        self._stepper.configuration.update(self.q)
        if self._collision is not None:
            self._collision.forget()
        if self._asked.postures is not None:
            self._asked.postures[0] = q

    def distance(self, target: Array, achieved: Array) -> float:
        """Affine-invariant distance of two ellipsoids (d, d), with the damping."""
        return float(distance_unchecked(target + self._added, achieved + self._added))

    @property
    def velocity(self) -> Array:
        """In the last step, shape (dof,)."""
        return self._bounds.velocity

    def makes(self) -> tuple[Array, Array]:
        """Where its tip is (3,) [m], and its ellipsoid (d, d)."""
        if self._made is None:
            place, jacobian = self._stepper.tip()
            rows = jacobian[self._rows]
            self._made = place, squared(rows if self._weights is None else rows * self._weights)
        return self._made

    @property
    def resting(self) -> bool:
        """Whether it stands still."""
        return not self._bounds.velocity.any()

    def lean(self, ellipsoid: Array, tip: Array | None) -> None:
        """Stay near the posture of the reference that suits a target best, of those the one that is near."""
        if self._guide is None:
            return
        assert self._asked.postures is not None
        near = self._guide.query(ellipsoid[None], None if tip is None else tip[None], k=ALIKE)[0]
        self._asked.postures[0] = near[np.argmin(np.sum((near - self.q) ** 2, axis=1))]

    def follow(self, ellipsoid: Array, tip: Array | None, before: Array | None, dt: float, share: float) -> None:
        """Move for a time dt [s] towards an ellipsoid (d, d) and a place of the tip (3,); it was to be at `before`."""
        self._bounds.share = share
        if self._collision is not None:
            self._collision.gain = -np.expm1(-dt / APPROACH)
        self._asked.ellipsoids[0] = ellipsoid
        if tip is not None:
            assert self._asked.positions is not None
            assert before is not None
            self._asked.positions[0] = tip - self._left_for_later(before, dt)
        self._stepper.aim(self._asked, 0, before)
        velocity = self._stepper.velocity(dt)
        if velocity is None or not self._moved(velocity, dt, checked=True):
            self.brake(dt)

    def _left_for_later(self, before: Array, dt: float) -> Array:
        """What of the way to where the tip was to be by now is not caught up within dt, so that it can brake there."""
        way = before - self._stepper.tip()[0]
        away = math.sqrt(way @ way)
        return np.asarray(way * max(0.0, 1.0 - dt * math.sqrt(2.0 * self._acceleration / max(away, LEAST_WAY))))

    def brake(self, dt: float) -> None:
        """Come to rest as soon as accelerations allow, for a time dt [s]."""
        self._bounds.share = 1.0
        self._moved(np.zeros(len(self.q)), dt, checked=False)

    def _moved(self, velocity: Array, dt: float, checked: bool) -> bool:
        """Move as fast as asked for or as limits allow; with `checked` only where the way to rest is free."""
        made, postures = self._bounds.step(self.q, velocity, dt)
        if checked and self._collision is not None and not self._collision.free(postures):
            return False
        self._bounds.velocity, self._bounds.last = made, dt
        self.q, self._made = postures[0], None
        self._stepper.configuration.update(self.q)
        return True


def suiting(
    arm: Arm,
    spec: EllipsoidSpec,
    damping: Damping,
    ellipsoid: Array,
    tip: Array | None,
    collisions: Collisions | None,
    random_state: int,
) -> Array:
    """The posture (dof,) of an arm that suits an ellipsoid (d, d) and a place of its tip best, of the free ones."""
    bank = StartBank.build(arm, BANK_SIZE, random_state, spec=spec, collisions=collisions)
    objective = Objective.of(arm, spec, damping, positive=True)
    ellipsoids, tips = np.repeat(ellipsoid[None], STARTS, axis=0), None if tip is None else np.tile(tip, (STARTS, 1))
    targets = objective.targets(ellipsoids, tips)
    near = bank.starts(ellipsoid[None], None if tip is None else tip[None], STARTS)[0]
    found = np.concatenate([descend(targets, near[:, None], 1e-6, 100), near])
    found = found[np.argsort(np.concatenate([targets.cost(found[:STARTS]), targets.cost(near) + FAR]), kind="stable")]
    return np.asarray(found[0] if collisions is None else found[np.argmin(collisions.collides(found))])
