"""The robot that follows: its arms move toward the targets of the present within all limits."""

import math
from collections.abc import Sequence

import numpy as np

from maniport.arms import EllipsoidSpec, as_group
from maniport.arms.collisions import Collisions
from maniport.live.targets import Target, TargetQueue
from maniport.motion import Limit, MotionLimits
from maniport.motion.arm_model import require_trackable
from maniport.motion.configurations import Configurations
from maniport.motion.controller import Controller, ControlProblem, ControlState
from maniport.motion.costs.cost import Cost
from maniport.motion.problem import FOLLOWING_WEIGHT, ArmProblem, CostWeights
from maniport.motion.targets import Damping, TargetTrajectory, damping_of
from maniport.spd.affine_invariant import distance_unchecked
from maniport.util.sampling import evenly_spaced
from maniport.util.validation import Array

HORIZON = (0.05, 0.1)
"""Durations of the intervals after a step for which the controller plans, too [s]. A Panda changes the velocity of its
end effector by 1 m/s in about 0.15 s; longer or finer horizons did not lower position errors."""
INTERVAL_ENDS = np.cumsum((0.0, *HORIZON))  # of all intervals, after the step [s]
CONTROL_STEP = 0.01  # A longer time between two frames is shared among several control steps [s]


class Robot:
    """A group of arms that follows targets of the present, as `maniport.motion.track` follows those of a motion."""

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
        group = as_group(limits.arm)
        for arm in group.arms:
            require_trackable(arm, spec)
        self._arms = group.arms
        self._specs = group.specs(spec)
        self._dampings = []
        for arm, arm_spec in zip(self._arms, self._specs, strict=True):
            self._dampings.append(damping_of(arm, arm_spec, damping, positive=True))
        # configurations to stay near, with a weight [1/rad] that is high enough that a robot that cannot follow fast
        # enough stays on its branch of configurations, and low enough that the end effector is on its path where that
        # is feasible
        self._candidates = start[None]
        self._weight = 1e-2
        if reference is not None:
            self._candidates = reference[evenly_spaced(len(reference), 500)]
            self._weight = 0.5
        self._there = list[tuple[Array, Array]]()  # positions and damped ellipsoids of each arm
        for i, q in enumerate(group.split(self._candidates)):
            poses, ellipsoids = self._arms[i].posed_ellipsoids(q, self._specs[i])
            self._there.append((poses[:, :3, 3], self._damped(i, ellipsoids)))
        self._controller = Controller(
            limits.arm, limits.velocity, limits.acceleration, collisions, costs, own_limits
        )
        self.rest(start)

    def rest(self, q: Array) -> None:
        """Be at rest in a configuration (dof,), without any memory of earlier steps."""
        self._reference = q
        self._reference_time = -math.inf
        self._set(ControlState.at_rest(q))

    def _set(self, state: ControlState) -> None:
        # (dof,)
        self.q = state.q
        self.velocity = state.velocity
        self._state = state
        self.resting = not state.velocity.any()
        self.positions = []  # (3,) of each arm
        self.achieved = []  # (d, d) of each arm
        configurations = []
        for i, columns in enumerate(self._controller.columns):
            at = Configurations(self._arms[i], state.q[None, columns], np.zeros(1))
            at.ellipsoid_derivatives(self._specs[i].bounded)  # the next step needs them
            self.positions.append(at.poses[0, :3, 3])
            self.achieved.append(at.ellipsoids(self._specs[i].bounded)[0])
            configurations.append(at)
        self._configurations = tuple(configurations)

    def distance(self, arm: int, target: Array) -> float:
        """Affine-invariant distance of a target (d, d) and the achieved ellipsoid of an arm, with the damping."""
        achieved = self._damped(arm, self.achieved[arm])
        return float(distance_unchecked(self._damped(arm, target), achieved))

    def _damped(self, arm: int, ellipsoids: Array) -> Array:
        return np.asarray(ellipsoids + self._dampings[arm].epsilon * np.eye(self._specs[arm].size))

    def _problem(self, arm: int, target: Target) -> ArmProblem:
        """Return the problem of an arm with the target of the present."""
        positions = None
        if target.position is not None:
            positions = target.position[None]
        trajectory = TargetTrajectory(
            time=np.zeros(1),
            ellipsoids=target.ellipsoid[None],
            spec=self._specs[arm],
            damping=self._dampings[arm],
            positions=positions,
        )
        return ArmProblem.of(self._arms[arm], trajectory, CostWeights(FOLLOWING_WEIGHT))

    def follow(
        self,
        targets: Sequence[Target],
        queues: Sequence[TargetQueue],
        elapsed: float,
        speed_share: float,
        time: float,
        period: float = 0.05,
    ) -> None:
        """Move for the time that has elapsed [s] toward the target of each arm.

        `speed_share` is the share of the velocity limits to use, `time` that of the robot's clock [s], at which the
        queues have the targets. The reference is looked up anew after a `period` [s].
        """
        if time - self._reference_time > period:
            self._choose_reference(targets)
            self._reference_time = time
        steps = max(1, math.ceil(elapsed / CONTROL_STEP - 1e-9))
        arms = tuple(self._problem(i, target) for i, target in enumerate(targets))
        for i in range(steps):
            ends = tuple(
                queue.positions(time - elapsed * (steps - 1 - i) / steps, INTERVAL_ENDS)
                for queue in queues
            )
            problem = ControlProblem(
                arms=arms,
                reference=self._reference,
                reference_weight=self._weight,
                time=time,
                horizon=HORIZON,
                configurations=self._configurations,
                positions=ends,
            )
            self._set(self._controller.step(problem, self._state, elapsed / steps, speed_share))

    def _choose_reference(self, targets: Sequence[Target], count: int = 5) -> None:
        """Choose the candidate nearest to the present configuration of those that suit the targets best."""
        cost = np.zeros(len(self._candidates))
        for i, (target, position) in enumerate(targets):
            positions, ellipsoids = self._there[i]
            cost += distance_unchecked(self._damped(i, target), ellipsoids) ** 2
            if position is not None:
                cost += np.sum((6.0 * (positions - position)) ** 2, axis=1)  # [1/m]
        near = self._candidates[np.argpartition(cost, min(count, len(cost) - 1))[:count]]
        self._reference = near[np.argmin(np.sum((near - self.q) ** 2, axis=1))]

    def brake(self, elapsed: float) -> None:
        """Come to rest as soon as accelerations allow, for the time that has elapsed [s]."""
        steps = max(1, math.ceil(elapsed / CONTROL_STEP - 1e-9))
        for _ in range(steps):
            self._set(self._controller.brake(self._state, elapsed / steps))
            if self.resting:
                break
