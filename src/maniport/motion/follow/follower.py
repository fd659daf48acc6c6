"""One pass of an arm along target ellipsoids and positions: Pink's inverse kinematics, step by step."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pink
import pinocchio as pin
import qpsolvers
from numpy.typing import ArrayLike, NDArray
from pink.configuration import Configuration
from pink.exceptions import PinkError
from pink.limits import ConfigurationLimit, Limit, VelocityLimit
from pink.tasks import PostureTask, Task
from qpsolvers.exceptions import QPError
from threadpoolctl import ThreadpoolController

from maniport.arms import Arm, ArmGroup, EllipsoidSpec
from maniport.errors import InvalidInputError, NotSPDError
from maniport.motion.arm_model import frame_id, robot_model, tip_frames
from maniport.motion.limits import BrakingLimit
from maniport.motion.objective import FOLLOWING_WEIGHT, ORIENTATION_WEIGHT, POINTING, Objective, axis_weights
from maniport.motion.schedule import Schedule, as_limits, speed_limits
from maniport.motion.tasks.ellipsoid_task import ManipulabilityEllipsoidTask
from maniport.motion.tasks.frame_tasks import OrientationTask, PositionTask, as_gain, as_lm_damping
from maniport.util.progress import Part, nobody
from maniport.util.validation import Array, as_choice, as_number


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
    orientation_axes, orientation_weight
        As in `maniport.motion.PlanControl`.
    tasks, limits : sequence of pink.tasks.Task, and of pink.limits.Limit
        Further tasks and limits for the arm's model, ``maniport.motion.robot_model(arm)``; their owner sets targets.

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
    orientation_axes: str = POINTING
    orientation_weight: float = ORIENTATION_WEIGHT
    tasks: Sequence[Task] = ()
    limits: Sequence[Limit] = ()

    def __post_init__(self) -> None:
        as_number(self.rate, "rate", above=0.0)
        as_choice(self.interpolation, "interpolation", ("cubic", "linear"))
        as_gain(self.gain)
        as_number(self.position_cost, "position_cost", above=0.0)
        axis_weights(self.orientation_axes, as_number(self.orientation_weight, "orientation_weight", above=0.0))
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
        objectives: Sequence[Objective],
        control: Control | None = None,
        pair: ArmGroup | None = None,
    ):
        self.control = control = Control() if control is None else control
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
        self.reach = self.tips[0].reach
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
        i = [one is objective.arm for one in self.arm.arms].index(True)
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

    def follow(self, start: Array, asked: Sequence[Schedule], tell: Part = nobody) -> tuple[Array, NDArray[np.bool_]]:
        """Joint positions (m, dof) from `start` on, and at which steps the arm was held for want of an answer (m,)."""
        schedule = asked[0]
        dt = abs(float(schedule.time[-1] - schedule.time[0])) / (len(schedule) - 1)
        bounds = BrakingLimit(self.model, self.velocity_limits, self.acceleration_limits)
        stepper = Stepper(self, start, self._limits(bounds, dt), asked)
        joints, held = np.empty((len(schedule), len(start))), np.zeros(len(schedule), bool)
        joints[0] = start
        # On matrices this small, threads of BLAS only wait for one another.
        with self._threads.limit(limits=1, user_api="blas"):
            for i in range(1, len(joints)):
                stepper.aim(asked, i, [None if one.positions is None else one.positions[i - 1] for one in asked])
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
        follower: Follower,
        start: Array,
        limits: list[Limit],
        asked: Sequence[Schedule],
        reference_cost: float = 0.3,
    ):
        control = follower.control
        self._limits = [*limits, *control.limits]
        # a little for joints that nothing else holds
        self._posture = NearTask(cost=1e-2 if asked[0].postures is None else reference_cost)
        self._posture.set_target(start)
        self._aims = [Aim(tip, follower.model, one) for tip, one in zip(follower.tips, asked, strict=True)]
        own, *others = self._aims[0].tasks
        self._tasks: list[Task] = [own, self._posture, *others]
        self._tasks += [task for aim in self._aims[1:] for task in aim.tasks]
        self._tasks += control.tasks
        self._damping = 0.0
        self.configuration = pink.Configuration(follower.model, follower.data, start)

    def aim(self, asked: Sequence[Schedule], i: int, before: Sequence[Array | None]) -> None:
        """Set all targets to row `i` of what each tip is asked for; tips were to be at `before` (3,) by now [m]."""
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
            change = qpsolvers.solve_problem(problem, solver="daqp").x
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
