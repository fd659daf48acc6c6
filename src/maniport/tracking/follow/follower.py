"""One pass of an arm along wanted ellipsoids and hand positions: Pink's inverse kinematics, step by step."""

from dataclasses import dataclass

import numpy as np
import pink
from numpy.typing import NDArray
from pink.exceptions import PinkError
from pink.limits import ConfigurationLimit, Limit, VelocityLimit
from pink.tasks import PostureTask, Task
from qpsolvers.exceptions import QPError
from threadpoolctl import ThreadpoolController

from maniport.bodies import Arm
from maniport.errors import NotSPDError
from maniport.steps import Part, nobody
from maniport.tracking.arm_model import robot_model
from maniport.tracking.limits.braking_limit import BrakingLimit
from maniport.tracking.tasks.ellipsoid_task import ManipulabilityEllipsoidTask
from maniport.tracking.tasks.position_task import PositionTask
from maniport.validation import Array

SOLVER = "daqp"
POSTURE_COST = 1e-2
"""Cost of a radian away from the start: what holds joints that nothing else does."""
POSITION_COST = 200.0
"""Cost of a metre beside the path, in units of distance between ellipsoids."""
LEAST_DAMPING = 1e-12
REACH_SAMPLES = 64
NEGLIGIBLE = 1e-3
"""Distances off the path of this size are no sign that it is out of reach [m]."""
BRAKING_TIME = 0.1
"""Time constant with which a joint comes to rest at a position limit [s]; limits of acceleration see to it else."""
TOLD_EACH = 100
"""Every so many control steps the fraction done is told."""


@dataclass(frozen=True)
class Schedule:
    """What is wanted at each control step, one row for each.

    Attributes
    ----------
    time : ndarray, shape (m,)
        Evenly spaced [s].
    ellipsoids : ndarray, shape (m, d, d)
        Without floor.
    hands : ndarray, shape (m, 3), or None
        [m]
    weights : ndarray, shape (m, e, e), or None
        Of the ellipsoid's error.
    """

    time: Array
    ellipsoids: Array
    hands: Array | None
    weights: Array | None


class Follower:
    """An arm with the tasks and limits that it follows a schedule with.

    Parameters
    ----------
    arm : Arm
    task : ManipulabilityEllipsoidTask
        For the arm's tip.
    velocity_limits, acceleration_limits : ndarray, shape (dof,)
        Infinite where there is none.
    position_cost : float
        Of a metre.
    """

    def __init__(
        self,
        arm: Arm,
        task: ManipulabilityEllipsoidTask,
        velocity_limits: Array,
        acceleration_limits: Array,
        position_cost: float = POSITION_COST,
    ):
        self.arm, self.task = arm, task
        self.model = robot_model(arm)
        self.data = self.model.createData()
        self.velocity_limits, self.acceleration_limits = velocity_limits, acceleration_limits
        self.position_cost = position_cost
        # A stretched arm that cannot reach its path would swing at full speed about the nearest point, since to first
        # order all directions but the right one are open. What it lacks are the second derivatives of the position,
        # no larger than levers are long, times the distance off the path: damping of that size makes up for them.
        self.reach = float(np.linalg.norm(arm.forward(arm.sample(REACH_SAMPLES, 0))[:, :3, 3], axis=1).max())
        self._threads = ThreadpoolController()  # looks at all loaded libraries: once, not for each step

    def follow(self, start: Array, schedule: Schedule, tell: Part = nobody) -> tuple[Array, NDArray[np.bool_]]:
        """Joint positions (m, dof) from `start` on, and at which steps the arm was held for want of an answer (m,)."""
        position = PositionTask(self.arm.frame, self.position_cost)
        posture = PostureTask(cost=POSTURE_COST)
        posture.set_target(start)
        tasks: list[Task] = [self.task, posture] + ([] if schedule.hands is None else [position])
        dt = abs(float(schedule.time[-1] - schedule.time[0])) / (len(schedule.time) - 1)
        bounds = BrakingLimit(self.model, self.velocity_limits, self.acceleration_limits)
        limits = self._limits(bounds, dt)
        configuration = pink.Configuration(self.model, self.data, start)
        joints, held = np.empty((len(schedule.time), len(start))), np.zeros(len(schedule.time), bool)
        joints[0] = start
        off_path = 0.0
        # On matrices this small, threads of BLAS only wait for one another.
        with self._threads.limit(limits=1, user_api="blas"):
            for i in range(1, len(joints)):
                self.task.set_target(schedule.ellipsoids[i])
                if schedule.weights is not None:
                    self.task.set_weights(schedule.weights[i])
                if schedule.hands is not None:
                    off_path = _off_path(configuration, position, schedule.hands[i - 1])
                    position.set_target(schedule.hands[i])
                step = self._step(configuration, tasks, dt, limits, self.position_cost**2 * self.reach * off_path)
                held[i] = step is None
                least, most = bounds.bounds(joints[i - 1], dt)  # the solver keeps them to 1e-6 only
                wanted = 0.0 if step is None else step
                joints[i] = np.clip(joints[i - 1] + np.clip(wanted, least, most), self.arm.lower, self.arm.upper)
                bounds.last_step = joints[i] - joints[i - 1]
                configuration.update(joints[i])
                if i % TOLD_EACH == 0:
                    tell(i / len(joints))
        return joints, held

    def _limits(self, bounds: BrakingLimit, dt: float) -> list[Limit]:
        if np.all(np.isinf(self.acceleration_limits)):
            return [
                ConfigurationLimit(self.model, min(0.5, dt / BRAKING_TIME)),
                VelocityLimit(self.model, self.velocity_limits),
            ]
        return [bounds]

    @staticmethod
    def _step(
        configuration: pink.Configuration, tasks: list[Task], dt: float, limits: list[Limit], damping: float
    ) -> Array | None:
        """Wanted change of the joint positions; None where the QP has no solution."""
        try:
            velocity = pink.solve_ik(
                configuration, tasks, dt, solver=SOLVER, limits=limits, damping=LEAST_DAMPING + damping
            )
        except (PinkError, QPError, NotSPDError):
            return None
        return np.asarray(velocity * dt) if np.all(np.isfinite(velocity)) else None


def _off_path(configuration: pink.Configuration, position: PositionTask, hand: Array) -> float:
    """Distance of the hand from where it was to be by now [m], less where it is negligible."""
    position.set_target(hand)
    away = float(np.linalg.norm(position.compute_error(configuration)))
    return away * away / (away + NEGLIGIBLE)
