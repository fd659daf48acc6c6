"""One pass of an arm along target ellipsoids and positions: Pink's inverse kinematics, step by step."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pink
from numpy.typing import ArrayLike, NDArray
from pink.limits import ConfigurationLimit, Limit, VelocityLimit
from pink.tasks import Task
from threadpoolctl import ThreadpoolController

from maniport.bodies import Arm, Arms, EllipsoidSpec
from maniport.errors import InvalidInputError
from maniport.steps import Part, nobody
from maniport.tracking.arm_model import robot_model, tip_frames
from maniport.tracking.follow.stepper import Stepper, Tip
from maniport.tracking.limits import BrakingLimit
from maniport.tracking.objective import FOLLOWING_WEIGHT, ORIENTATION_WEIGHT, POINTING, Objective, axis_weights
from maniport.tracking.schedule import Schedule, as_limits, speed_limits
from maniport.tracking.tasks.ellipsoid_task import ManipulabilityEllipsoidTask
from maniport.tracking.tasks.frame_tasks import as_gain, as_lm_damping
from maniport.validation import Array, as_choice, as_number


@dataclass(frozen=True)
class Control:
    """Settings of the tracker.

    Attributes
    ----------
    rate : float
        Control steps per second, at least one for each time [Hz].
    interpolation : {"cubic", "linear"}
        Between the times: splines (of logarithms for ellipsoids), or geodesics and straight lines.
    velocity_limits, acceleration_limits : array_like, shape (dof,) or one number, optional
        [rad/s], [rad/s²], or in metres. Default: the arm's own velocity limits, and no limits of acceleration.
    gain : float
        Of the ellipsoid task, in (0, 1].
    lm_damping : float
        Levenberg-Marquardt damping of the ellipsoid task, not negative.
    position_cost : float
        Weight of the position error beside the distance between ellipsoids [1/m].
    keep, orientation_weight
        As in `maniport.tracking.PlanControl`.
    tasks, limits : sequence of pink.tasks.Task, and of pink.limits.Limit
        Further tasks and limits for the arm's model, ``maniport.tracking.robot_model(arm)``; their owner sets targets.

    Raises
    ------
    InvalidInputError
        When a value is out of its range, or is no object of Pink.
    """

    rate: float = 100.0
    interpolation: str = "cubic"
    velocity_limits: ArrayLike | None = None
    acceleration_limits: ArrayLike | None = None
    gain: float = 1.0
    lm_damping: float = 3.0
    position_cost: float = FOLLOWING_WEIGHT
    keep: str = POINTING
    orientation_weight: float = ORIENTATION_WEIGHT
    tasks: Sequence[Task] = ()
    limits: Sequence[Limit] = ()

    def __post_init__(self) -> None:
        as_number(self.rate, "rate", above=0.0)
        as_choice(self.interpolation, "interpolation", ("cubic", "linear"))
        as_gain(self.gain)
        as_number(self.position_cost, "position_cost", above=0.0)
        axis_weights(self.keep, as_number(self.orientation_weight, "orientation_weight", above=0.0))
        as_lm_damping(self.lm_damping)
        for name, kind in (("tasks", Task), ("limits", Limit)):
            given = getattr(self, name)
            if not isinstance(given, Sequence):
                raise InvalidInputError(f"{name} must be a sequence of pink's {kind.__name__}; found {given!r}")
            for i, one in enumerate(given):
                if not isinstance(one, kind):
                    raise InvalidInputError(f"{name}[{i}] must be a pink.{name}.{kind.__name__}; found {one!r}")


class Follower:
    """An arm, or a pair of arms, with the tasks and limits with which it follows a schedule."""

    def __init__(
        self,
        objective: Objective | tuple[Objective, Objective],
        control: Control | None = None,
        pair: Arms | None = None,
    ):
        self.control = control = Control() if control is None else control
        objectives = objective if isinstance(objective, tuple) else (objective,)
        self.objective = objectives[0]
        self.arm: Any = self.objective.arm if pair is None else pair
        self.tips = [
            Tip(
                frame,
                ManipulabilityEllipsoidTask(frame, gain=control.gain, spec=self._spec(one), damping=one.damping),
                one,
                _reach(one.arm),
            )
            for frame, one in zip(tip_frames(self.arm), objectives, strict=True)
        ]
        self.task, self.reach = self.tips[0].task, self.tips[0].reach
        for tip in self.tips:
            tip.task.lm_damping = control.lm_damping
        for tip, columns in zip(self.tips, () if pair is None else pair.columns, strict=pair is not None):
            tip.task.slowed = np.diag(np.isin(np.arange(self.arm.dof), columns).astype(float))
        self.velocity_limits = speed_limits(self.arm, control.velocity_limits)
        self.acceleration_limits = as_limits(self.arm, control.acceleration_limits, "acceleration_limits")
        self.model = robot_model(self.arm)
        # Pink keeps limits with a model that in turn keep the model. Python cannot see such a circle, since it goes
        # through Pinocchio, and would never let go of it: these keep a copy.
        apart = self.model.copy()
        self.model.configuration_limit, self.model.velocity_limit = ConfigurationLimit(apart), VelocityLimit(apart)
        self.data = self.model.createData()
        self._require_fitting(self.arm.sample(1, 0)[0])
        self._threads = ThreadpoolController()  # looks at all loaded libraries: once, not for each step

    def _spec(self, objective: Objective) -> EllipsoidSpec:
        """The ellipsoids of one arm with weights for all joints of the model, where there are any."""
        spec = objective.spec
        if self.arm is objective.arm or spec.joint_weights is None:
            return spec
        i = [one is objective.arm for one in self.arm.each].index(True)
        weights = np.ones(self.arm.dof)
        weights[self.arm.columns[i]] = objective.arm.resolved(spec).weights(objective.arm.dof)
        return EllipsoidSpec(spec.kind, spec.part, weights)

    def _require_fitting(self, q: Array) -> None:
        """Raise unless the user's own tasks and limits can be computed for this arm's model."""
        here, nv = pink.Configuration(self.model, self.data, q), self.model.nv
        for one in (*self.control.tasks, *self.control.limits):
            try:
                is_task = isinstance(one, Task)
                found = one.compute_qp_objective(here) if is_task else one.compute_qp_inequalities(here, 1e-2)
            except Exception as error:  # whatever a stranger's object raises is told by its name
                told = f"{type(error).__name__}: {error}"
                raise InvalidInputError(f"{one!r} cannot be computed for {self.arm.name!r}: {told}") from error
            if found is not None and found[0].shape[-1] != nv:
                raise InvalidInputError(f"{one!r} is for {found[0].shape[-1]} joints; robot_model(arm) has {nv}")

    def follow(
        self, start: Array, asked: Schedule | tuple[Schedule, ...], tell: Part = nobody
    ) -> tuple[Array, NDArray[np.bool_]]:
        """Joint positions (m, dof) from `start` on, and at which steps the arm was held for want of an answer (m,)."""
        each = asked if isinstance(asked, tuple) else (asked,)
        schedule = each[0]
        dt = abs(float(schedule.time[-1] - schedule.time[0])) / (len(schedule) - 1)
        bounds = BrakingLimit(self.model, self.velocity_limits, self.acceleration_limits)
        stepper = Stepper(self, start, self._limits(bounds, dt), each)
        joints, held = np.empty((len(schedule), len(start))), np.zeros(len(schedule), bool)
        joints[0] = start
        # On matrices this small, threads of BLAS only wait for one another.
        with self._threads.limit(limits=1, user_api="blas"):
            for i in range(1, len(joints)):
                stepper.aim_each(each, i, [None if one.positions is None else one.positions[i - 1] for one in each])
                velocity = stepper.velocity(dt)
                held[i] = velocity is None
                least, most = bounds.bounds(joints[i - 1], dt)  # the solver keeps them to 1e-6 only
                change = np.clip(0.0 if velocity is None else velocity * dt, least, most)
                joints[i] = np.clip(joints[i - 1] + change, self.arm.lower, self.arm.upper)
                bounds.last_step = joints[i] - joints[i - 1]
                stepper.configuration.update(joints[i])
                if i % 100 == 0:
                    tell(i / len(joints))
        return joints, held

    def _limits(self, bounds: BrakingLimit, dt: float) -> list[Limit]:
        if np.all(np.isinf(self.acceleration_limits)):
            return [
                ConfigurationLimit(self.model, min(0.5, dt / 0.1)),
                VelocityLimit(self.model, self.velocity_limits),
            ]
        return [bounds]


def _reach(arm: Arm) -> float:
    """Largest distance from the base to the end effector at samples [m]."""
    return float(np.linalg.norm(arm.forward(arm.sample(64, 0))[:, :3, 3], axis=1).max())
