"""One control step after another: the tasks of an arm that follows, and what they make of a moment."""

import math
from typing import TYPE_CHECKING

import numpy as np
import pink
import pinocchio as pin
import qpsolvers
from pink.configuration import Configuration
from pink.exceptions import PinkError
from pink.limits import Limit
from pink.tasks import PostureTask, Task
from qpsolvers.exceptions import QPError

from maniport.errors import NotSPDError
from maniport.tracking.arm_model import frame_id
from maniport.tracking.schedule import Schedule
from maniport.tracking.tasks.orientation_task import OrientationTask
from maniport.tracking.tasks.position_task import PositionTask
from maniport.validation import Array

if TYPE_CHECKING:
    from maniport.tracking.follow.follower import Follower

SOLVER = "daqp"
POSTURE_COST = 1e-2
"""Cost of a radian away from the start: what holds joints that nothing else does."""
REFERENCE_COST = 0.3
"""The same of a radian away from a plan."""
LEAST_DAMPING = 1e-12
NEGLIGIBLE = 1e-3
"""Distances off the path of this size are no sign that it is out of reach [m]."""


class NearTask(PostureTask):  # type: ignore[misc]  # Pink is untyped
    """Pink's task of staying near a posture, for joints with one coordinate each: the same without its products.

    Its Jacobian is the identity, and its weight a number: both products are that number's.
    """

    def compute_qp_objective(self, configuration: Configuration) -> tuple[Array, Array]:
        """Pair (H, c), shapes (nv, nv) and (nv,)."""
        away = configuration.q - self.target_q
        return self.cost * self.cost * configuration.tangent.eye, self.cost * away * self.cost


class Stepper:
    """Tasks and limits of an arm on its way; whoever asks for changes moves the configuration.

    Parameters
    ----------
    follower : Follower
        The arm, its ellipsoid task and the user's own tasks and limits.
    start : ndarray, shape (dof,)
        Where it begins, and stays near where nothing else is asked for.
    limits : list of pink.limits.Limit
        Of the motion.
    asked : Schedule
        Has what will be asked for: positions, rotations and postures, or not.
    reference_cost : float
        Cost of a radian away from those postures.

    Attributes
    ----------
    configuration : pink.Configuration
        Where the arm is.
    """

    def __init__(
        self,
        follower: "Follower",
        start: Array,
        limits: list[Limit],
        asked: Schedule,
        reference_cost: float = REFERENCE_COST,
    ):
        control, objective = follower.control, follower.objective
        self._task, self._limits = follower.task, [*limits, *control.limits]
        self._position = PositionTask(objective.arm.frame, objective.position_weight)
        self._posture = NearTask(cost=POSTURE_COST if asked.postures is None else reference_cost)
        self._posture.set_target(start)
        self._orientation = OrientationTask(objective.arm.frame, objective.axis_weights)
        self._tasks: list[Task] = [self._task, self._posture]
        self._tasks += [] if asked.positions is None else [self._position]
        self._tasks += [] if asked.rotations is None else [self._orientation]
        self._tasks += control.tasks
        self._stiffness = objective.position_weight**2 * follower.reach
        self._off_path = 0.0
        self.configuration = pink.Configuration(follower.model, follower.data, start)
        self._frame = frame_id(follower.model, objective.arm.frame)

    def aim(self, asked: Schedule, i: int, before: Array | None) -> None:
        """Set all targets to row `i` of what is asked for; the tip was to be at `before` by now (3,) [m].

        Rows of a schedule are checked.
        """
        self._task.set_target(asked.ellipsoids[i])
        if asked.weights is not None:
            self._task.set_weights(asked.weights[i])
        if asked.postures is not None:
            self._posture.set_target(asked.postures[i])
        if asked.rotations is not None:
            self._orientation.set_target(asked.rotations[i])
        if asked.positions is not None:
            assert before is not None
            self._off_path = self._beside(before)
            self._position.target = asked.positions[i]

    def velocity(self, dt: float) -> Array | None:
        """Joint velocities that serve the tasks best in a step of dt [s]; None where the QP has no solution."""
        damping = LEAST_DAMPING + self._stiffness * self._off_path
        try:
            problem = pink.build_ik(self.configuration, self._tasks, dt, damping=damping, limits=self._limits)
            change = qpsolvers.solve_problem(problem, solver=SOLVER).x
        except (PinkError, QPError, NotSPDError):
            return None
        return change / dt if change is not None and np.isfinite(change).all() else None

    def tip(self) -> tuple[Array, Array]:
        """Where the tip is (3,), and its Jacobian (6, nv), in the base frame; without computing them anew."""
        model, data = self.configuration.model, self.configuration.data
        place = data.oMf[self._frame].translation.copy()
        return place, np.asarray(pin.getFrameJacobian(model, data, self._frame, pin.LOCAL_WORLD_ALIGNED))

    def _beside(self, target: Array) -> float:
        """Distance of the tip from where it was to be by now [m], less where it is negligible."""
        way = self.configuration.data.oMf[self._frame].translation - target
        away = math.sqrt(way @ way)
        return away * away / (away + NEGLIGIBLE)
