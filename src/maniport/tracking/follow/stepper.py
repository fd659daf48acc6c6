"""One control step after another: the tasks of an arm that follows, and what they make of a moment."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
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
from maniport.tracking.objective import Objective
from maniport.tracking.schedule import Schedule
from maniport.tracking.tasks.ellipsoid_task import ManipulabilityEllipsoidTask
from maniport.tracking.tasks.frame_tasks import OrientationTask, PositionTask
from maniport.validation import Array

if TYPE_CHECKING:
    from maniport.tracking.follow.follower import Follower

SOLVER = "daqp"
POSTURE_COST = 1e-2
"""Cost of a radian from the start, for joints that nothing else holds."""


class NearTask(PostureTask):  # type: ignore[misc]  # Pink is untyped
    """Pink's task of staying near a posture, for joints with one coordinate each: the same without its products."""

    def compute_qp_objective(self, configuration: Configuration) -> tuple[Array, Array]:
        """Pair (H, c), shapes (nv, nv) and (nv,)."""
        away = configuration.q - self.target_q
        return self.cost * self.cost * configuration.tangent.eye, self.cost * away * self.cost


@dataclass(frozen=True)
class Tip:
    """An end effector that follows."""

    frame: str  # in the model
    task: ManipulabilityEllipsoidTask
    objective: Objective
    reach: float  # [m]


class Aim:
    """The tasks of one tip, as far as something is asked for."""

    def __init__(self, tip: Tip, model: pin.Model, asked: Schedule):
        self._task, objective = tip.task, tip.objective
        self.stiffness = objective.position_weight**2 * tip.reach
        self._position = PositionTask(tip.frame, objective.position_weight)
        self._position.slowed = tip.task.slowed
        self._orientation = OrientationTask(tip.frame, objective.axis_weights)
        self.tasks: list[Task] = [self._task]
        self.tasks += [] if asked.positions is None else [self._position]
        self.tasks += [] if asked.rotations is None else [self._orientation]
        self.frame = frame_id(model, tip.frame)

    def slow(self, amount: float) -> float:
        """Slow the joints of this tip's arm by a damping; what of it is left to slow all joints of the model."""
        if self._position.slowed is None:
            return amount
        self._position.slowing = amount
        return 0.0

    def set(self, asked: Schedule, i: int) -> None:
        """Set targets to row `i` of what is asked for."""
        self._task.set_target(asked.ellipsoids[i])
        if asked.weights is not None:
            self._task.set_weights(asked.weights[i])
        if asked.rotations is not None:
            self._orientation.set_target(asked.rotations[i])
        if asked.positions is not None:
            self._position.target = asked.positions[i]


class Stepper:
    """Tasks and limits of one or several arms, one control step after the other; the caller moves the configuration."""

    def __init__(
        self,
        follower: "Follower",
        start: Array,
        limits: list[Limit],
        asked: Schedule | tuple[Schedule, ...],
        reference_cost: float = 0.3,
    ):
        control, each = follower.control, asked if isinstance(asked, tuple) else (asked,)
        self._limits = [*limits, *control.limits]
        self._posture = NearTask(cost=POSTURE_COST if each[0].postures is None else reference_cost)
        self._posture.set_target(start)
        self._aims = [Aim(tip, follower.model, one) for tip, one in zip(follower.tips, each, strict=True)]
        own, *others = self._aims[0].tasks
        self._tasks: list[Task] = [own, self._posture, *others]
        self._tasks += [task for aim in self._aims[1:] for task in aim.tasks]
        self._tasks += control.tasks
        self._damping = 0.0
        self.configuration = pink.Configuration(follower.model, follower.data, start)

    def aim(self, asked: Schedule, i: int, before: Array | None) -> None:
        """Set all targets to row `i` of what is asked for; the tip was to be at `before` by now (3,) [m]."""
        self.aim_each((asked,), i, (before,))

    def aim_each(self, asked: tuple[Schedule, ...], i: int, before: Sequence[Array | None]) -> None:
        """The same for all tips."""
        if asked[0].postures is not None:
            self._posture.set_target(asked[0].postures[i])
        for aim, one, place in zip(self._aims, asked, before, strict=True):
            aim.set(one, i)
            if one.positions is not None:
                assert place is not None
                self._damping = aim.slow(aim.stiffness * self._beside(aim.frame, place))

    def velocity(self, dt: float) -> Array | None:
        """Joint velocities that serve the tasks best in a step of dt [s]; None where the QP has no solution."""
        damping = 1e-12 + self._damping
        try:
            problem = pink.build_ik(self.configuration, self._tasks, dt, damping=damping, limits=self._limits)
            change = qpsolvers.solve_problem(problem, solver=SOLVER).x
        except (PinkError, QPError, NotSPDError):
            return None
        return change / dt if change is not None and np.isfinite(change).all() else None

    def tip(self) -> tuple[Array, Array]:
        """Where the first tip is (3,), and its Jacobian (6, nv), in the base frame; without computing them anew."""
        model, data, frame = self.configuration.model, self.configuration.data, self._aims[0].frame
        place = data.oMf[frame].translation.copy()
        return place, np.asarray(pin.getFrameJacobian(model, data, frame, pin.LOCAL_WORLD_ALIGNED))

    def _beside(self, frame: int, target: Array) -> float:
        """Distance of the tip from where it was to be by now [m], less where it is negligible."""
        way = self.configuration.data.oMf[frame].translation - target
        away = math.sqrt(way @ way)
        return away * away / (away + 1e-3)  # 1 mm is no sign that the path is out of reach
