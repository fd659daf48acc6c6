"""The robot that follows: its target of the present, and the motion towards it within all limits."""

import math
from collections.abc import Sequence

import numpy as np

from maniport.arms import Arm, EllipsoidSpec
from maniport.arms.collisions import Collisions
from maniport.arms.manipulability import manipulability
from maniport.motion import MotionLimits, Objective, SeedBank
from maniport.motion.arm_model import require_trackable
from maniport.motion.controller import Controller, ControlProblem, ControlState
from maniport.motion.limits import BrakingLimit, CollisionLimit, Limit
from maniport.motion.objective import FOLLOWING_WEIGHT, Damping
from maniport.motion.problem import Cost
from maniport.motion.search.descent import descend
from maniport.spd.affine_invariant import distance_unchecked
from maniport.util.validation import Array

# This share of the acceleration that the slowest joint gives a stretched arm's end effector brakes it before its target
BRAKING = 0.5
REFERENCE_WEIGHT = 2.0
"""Weight of the distance from the reference [1/rad]: high enough that a robot that cannot follow fast enough stays on
its branch of configurations, and low enough that the end effector is on its path where that is feasible."""


class Robot:
    """An arm that follows targets of the present, as `maniport.motion.track` follows those of a motion."""

    def __init__(
        self,
        limits: MotionLimits,
        collisions: Collisions | None,
        spec: EllipsoidSpec,
        damping: Damping,
        start: Array,
        reference: Array | None = None,
        costs: Sequence[Cost] = (),
        own_limits: Sequence[Limit] = (),
    ):
        require_trackable(limits.arm, spec)
        self._arm, self._spec = limits.arm, limits.arm.resolved(spec)
        self._objective = Objective.of(limits.arm, spec, damping, FOLLOWING_WEIGHT, positive=True)
        self._references = None if reference is None else SeedBank(limits.arm, reference, self._objective.damping, spec)
        self._collision = None
        if collisions is not None and collisions.known:
            self._collision = CollisionLimit(collisions, separation_share=0.0)
        braking = BrakingLimit(limits.lower, limits.upper, limits.velocity, limits.acceleration)
        self._controller = Controller(limits.arm, braking, self._collision, costs, own_limits)
        self._acceleration = BRAKING * self._controller.reaches[0] * float(limits.acceleration.min())
        self.rest(start)

    def rest(self, q: Array) -> None:
        """Be at rest in a configuration (dof,), without any memory of earlier steps."""
        if self._collision is not None:
            self._collision.reset()
        self._reference = q
        self._set(ControlState.at_rest(q))

    def _set(self, state: ControlState) -> None:
        self._state = state
        poses, jacobians = self._arm.motion(state.q[None])
        self.tip = poses[0, :3, 3]
        self.achieved = manipulability(jacobians[0], self._spec)  # (d, d)

    @property
    def q(self) -> Array:
        """Configuration, shape (dof,)."""
        return self._state.q

    @property
    def velocity(self) -> Array:
        """In the last step, shape (dof,)."""
        return self._state.velocity

    @property
    def resting(self) -> bool:
        """Whether it is at rest."""
        return not self.velocity.any()

    def distance(self, target: Array) -> float:
        """Affine-invariant distance of a target (d, d) and the achieved ellipsoid, with the damping."""
        return float(distance_unchecked(self._objective.damped(target), self._objective.damped(self.achieved)))

    def choose_reference(self, ellipsoid: Array, tip: Array | None, candidates: int = 5) -> None:
        """Stay near that configuration of the reference, of those that suit a target best, which is nearest."""
        if self._references is not None:
            near = self._references.query(ellipsoid[None], None if tip is None else tip[None], k=candidates)[0]
            self._reference = near[np.argmin(np.sum((near - self.q) ** 2, axis=1))]

    def follow(
        self, ellipsoid: Array, tip: Array | None, before: Array | None, dt: float, speed_share: float, time: float
    ) -> None:
        """Move for dt [s] towards an ellipsoid (d, d) and a position (3,).

        `before` is the position in the step before, `speed_share` the share of the velocity limits to use, and
        `time` that of the step, for further costs [s].
        """
        position = None
        if tip is not None:
            assert before is not None
            position = (tip - self._left_for_later(before, dt))[None]
        problem = ControlProblem(
            (self._objective.targets(ellipsoid[None], position),),
            (before,),
            self._reference,
            1e-2 if self._references is None else REFERENCE_WEIGHT,
            time,
        )
        self._set(self._controller.step(problem, self._state, dt, speed_share))

    def _left_for_later(self, before: Array, dt: float) -> Array:
        """The part of the error at the last target that is not corrected within dt, so that braking is possible."""
        error = before - self.tip
        away = max(math.sqrt(error @ error), 1e-9)
        return np.asarray(error * max(0.0, 1.0 - dt * math.sqrt(2.0 * self._acceleration / away)))

    def brake(self, dt: float) -> None:
        """Come to rest as soon as accelerations allow, for a time dt [s]."""
        self._set(self._controller.brake(self._state, dt))


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
    near = bank.starts_for(targets[:1], starts)[0]
    found = np.concatenate([descend(targets, near[:, None], 1e-6, 100, block=starts), near])
    # samples are taken only where no configuration that was found from them is free
    costs = np.concatenate([targets.cost(found[:starts]), targets.cost(near) + 1e6])
    found = found[np.argsort(costs, kind="stable")]
    return np.asarray(found[0] if collisions is None else found[np.argmin(collisions.collides(found))])
