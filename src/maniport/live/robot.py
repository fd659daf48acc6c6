"""The robot that follows: its arms move toward the targets of the present within all limits."""

import math
from collections.abc import Sequence

import numpy as np

from maniport.arms import EllipsoidSpec, as_group
from maniport.arms.collisions import Collisions
from maniport.live.targets import Target, TargetQueue
from maniport.motion import Limit, MotionLimits
from maniport.motion.arm_model import require_trackable
from maniport.motion.controller import Controller, ControlProblem, ControlState
from maniport.motion.costs.cost import Cost
from maniport.motion.objective import FOLLOWING_WEIGHT, Damping, Objective
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
        self._objectives = [
            Objective.of(arm, own, damping, FOLLOWING_WEIGHT, positive=True)
            for arm, own in zip(group.arms, group.specs(spec), strict=True)
        ]
        # configurations to stay near, with a weight [1/rad] that is high enough that a robot that cannot follow fast
        # enough stays on its branch of configurations, and low enough that the end effector is on its path where that
        # is feasible
        self._candidates, self._weight = start[None], 1e-2
        if reference is not None:
            self._candidates, self._weight = reference[evenly_spaced(len(reference), 500)], 0.5
        parts = zip(self._objectives, group.split(self._candidates), strict=True)
        self._there = list[tuple[Array, Array]]()  # positions and damped ellipsoids of each arm
        for own, q in parts:
            poses, ellipsoids = own.arm.posed_ellipsoids(q, own.spec)
            self._there.append((poses[:, :3, 3], own.damped(ellipsoids)))
        self._controller = Controller(
            limits.arm, limits.velocity, limits.acceleration, collisions, costs, own_limits
        )
        self.rest(start)

    def rest(self, q: Array) -> None:
        """Be at rest in a configuration (dof,), without any memory of earlier steps."""
        self._reference, self._reference_time = q, -math.inf
        self._set(ControlState.at_rest(q))

    def _set(self, state: ControlState) -> None:
        self.q, self.velocity, self._state = state.q, state.velocity, state  # (dof,)
        self.resting = not state.velocity.any()
        parts = zip(self._objectives, self._controller.columns, strict=True)
        self._differentials = tuple(
            own.differentials(state.q[None, columns]) for own, columns in parts
        )
        self.positions = [poses[0, :3, 3] for poses, *_ in self._differentials]  # of each arm
        self.achieved = [
            ellipsoids[0] for _, _, ellipsoids, _ in self._differentials
        ]  # (d, d) of each arm

    def distance(self, arm: int, target: Array) -> float:
        """Affine-invariant distance of a target (d, d) and the achieved ellipsoid of an arm, with the damping."""
        damped = self._objectives[arm].damped
        return float(distance_unchecked(damped(target), damped(self.achieved[arm])))

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
        rows = tuple(
            objective.targets(
                own.ellipsoid[None], None if own.position is None else own.position[None]
            )
            for objective, own in zip(self._objectives, targets, strict=True)
        )
        for i in range(steps):
            ends = tuple(
                queue.positions(time - elapsed * (steps - 1 - i) / steps, INTERVAL_ENDS)
                for queue in queues
            )
            problem = ControlProblem(
                rows, self._reference, self._weight, time, None, HORIZON, self._differentials, ends
            )
            self._set(self._controller.step(problem, self._state, elapsed / steps, speed_share))

    def _choose_reference(self, targets: Sequence[Target], count: int = 5) -> None:
        """Choose the candidate nearest to the present configuration of those that suit the targets best."""
        cost = np.zeros(len(self._candidates))
        for own, (positions, ellipsoids), (target, position) in zip(
            self._objectives, self._there, targets, strict=True
        ):
            cost += distance_unchecked(own.damped(target), ellipsoids) ** 2
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
