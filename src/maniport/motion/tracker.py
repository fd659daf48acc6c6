"""An arm, or a group of arms, follows target ellipsoids and paths step by step with the `Controller`."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from threadpoolctl import ThreadpoolController

from maniport.arms import VELOCITY, Arm, ArmGroup, EllipsoidSpec, as_group
from maniport.arms.collisions import Collisions, as_collisions
from maniport.errors import InvalidInputError
from maniport.motion.controller import LM_DAMPING, Controller, ControlProblem, ControlState
from maniport.motion.limits import BrakingLimit, CollisionLimit, Limit
from maniport.motion.motion_limits import MotionLimits
from maniport.motion.objective import FOLLOWING_WEIGHT, POINTING, Damping, axis_weights
from maniport.motion.plan.plan_motion import plan_motion
from maniport.motion.plan.planner import Planner
from maniport.motion.problem import Cost, PostureCost, as_costs
from maniport.motion.robot_motion import RobotMotion
from maniport.motion.schedule import Schedule, as_limits, schedules_of, speed_limits
from maniport.motion.search import SeedBank
from maniport.motion.trajectory import Trajectory
from maniport.util.defaults import DAMPING
from maniport.util.progress import Part, Progress, Step, between, ignore_fraction
from maniport.util.validation import Array, as_choice, as_generator, as_number


@dataclass(frozen=True)
class Control:
    """Settings of the tracker.

    Attributes
    ----------
    rate : float
        Control rate [Hz]; there is at least one step for each time of the profile.
    interpolation : {"cubic", "linear"}
        Interpolation of targets: splines (of logarithms for ellipsoids), or geodesics and straight lines.
    velocity_limits, acceleration_limits : array_like, shape (dof,) or one number, optional
        [rad/s], [rad/s²], or in meters. Default: the arm's own velocity limits, and no acceleration limits.
    lm_damping : float
        Levenberg-Marquardt damping of the ellipsoid cost, not negative.
    position_cost : float
        Weight of position errors [1/m].
    orientation_axes : {"pointing", "whole"}
        As in `maniport.motion.PlanSettings`.
    costs : sequence of Cost
        Further costs, see `maniport.motion.Cost`.
    limits : sequence of Limit
        Further hard limits, see `maniport.motion.Limit`.

    Raises
    ------
    InvalidInputError
        When a value is out of its range, or is no cost or limit.
    """

    rate: float = 100.0
    interpolation: str = "cubic"
    velocity_limits: ArrayLike | None = None
    acceleration_limits: ArrayLike | None = None
    lm_damping: float = LM_DAMPING
    position_cost: float = FOLLOWING_WEIGHT
    orientation_axes: str = POINTING
    costs: Sequence[Cost] = ()
    limits: Sequence[Limit] = ()

    def __post_init__(self) -> None:
        as_number(self.rate, "rate", above=0.0)
        as_choice(self.interpolation, "interpolation", ("cubic", "linear"))
        as_number(self.position_cost, "position_cost", above=0.0)
        axis_weights(self.orientation_axes)
        as_number(self.lm_damping, "lm_damping", minimum=0.0)
        for name in ("costs", "limits"):
            if not isinstance(getattr(self, name), Sequence) or isinstance(getattr(self, name), str):
                raise InvalidInputError(f"{name} must be a sequence; found {getattr(self, name)!r}")
        for i, limit in enumerate(self.limits):
            if not isinstance(limit, Limit):
                raise InvalidInputError(f"limits[{i}] must have the method inequalities; found {limit!r}")


def track(
    arm: Arm | ArmGroup,
    profile: ArrayLike | Sequence[ArrayLike],
    *,
    time: ArrayLike,
    path: ArrayLike | Sequence[ArrayLike] | None = None,
    start: ArrayLike | None = None,
    reference: ArrayLike | None = None,
    spec: EllipsoidSpec = VELOCITY,
    damping: Damping = DAMPING,
    weights: ArrayLike | Sequence[ArrayLike] | None = None,
    rotations: ArrayLike | Sequence[ArrayLike] | None = None,
    collisions: Collisions | bool | None = None,
    bank: SeedBank | None = None,
    random_state: Any = 0,
    progress: Progress | None = None,
    **control: Any,
) -> RobotMotion:
    """Track target ellipsoids and target paths of end effectors with a controller.

    Profiles and paths may be infeasible. Where the quadratic program of a step has no solution, the arm brakes.

    Parameters
    ----------
    arm : Arm or ArmGroup
        With at least three joints, and a joint for each degree of freedom.
    profile : array_like, shape (n, d, d)
        Target ellipsoids in the base frame, without damping, n ≥ 2; `path`, `weights`, `rotations` and this are
        sequences for a group, with an item for each arm.
    time : array_like, shape (n,)
        Increasing [s].
    path, rotations : array_like, shapes (n, 3) and (n, 3, 3), optional
        Target positions [m] and orientations of the end effector in the base frame.
    start : array_like, shape (dof,), optional
        First configuration. Default: the first of the reference, else that of a planned motion.
    reference : array_like, shape (n, dof), optional
        Configurations to stay near where path and ellipsoids leave freedom, such as a plan's [rad or m].
    spec, damping
        As in `maniport.motion.plan_motion`; the damping is above zero, since arms pass singular configurations.
    weights : array_like, shape (n, m, m), optional
        Weights of the directions of the ellipsoids, see `maniport.learning.tracking_weights`; m = d (d + 1) / 2.
    collisions : Collisions or bool, optional
        Collision model; True: of the arm with itself, and with the other arms of the group.
    bank : SeedBank, optional
        Seed configurations of the planned start of a single arm. Default: 16 384 new samples (0.1 s).
    random_state, progress : optional
        Random seed; called with the name of a step and the fraction done.
    **control
        Of `maniport.motion.Control`.

    Raises
    ------
    InvalidInputError, NotSPDError
        When an argument has a wrong shape or value, an ellipsoid is asymmetric or indefinite, an arm has fewer than
        three joints or coupled ones, or the bank was made for another arm.
    """
    settings, group, model = Control(**control), as_group(arm), as_collisions(collisions, arm)
    if bank is not None:
        bank.require_fits(group.arms[0], spec)
    near = None if reference is None else group.require_within_limits(reference, "reference")
    arrays = {"profile": profile, "path": path, "weights": weights, "rotations": rotations}
    axes = axis_weights(settings.orientation_axes)
    schedules = schedules_of(arm, time, spec, damping, settings.position_cost, axes, arrays, near)
    begin = near[0] if start is None and near is not None else start
    if begin is not None:
        begin = np.clip(group.require_within_limits(begin, "start", single=True), group.lower, group.upper)
    speeds = speed_limits(arm, settings.velocity_limits)
    accelerations = as_limits(arm, settings.acceleration_limits, "acceleration_limits")
    braking = BrakingLimit(arm.lower, arm.upper, speeds, accelerations)
    distances = CollisionLimit(model) if model is not None and model.checked else None
    costs = as_costs(settings.costs, arm, schedules[0].time)
    controller = Controller(arm, braking, distances, costs, settings.limits, settings.lm_damping)
    step, planned = Step(progress, "Track trajectory"), 0.0 if begin is not None else 0.5  # the share of the work
    if begin is None:
        begin = _planned_start(group, schedules, spec, settings, bank, random_state)
    sampled = [schedule.sampled(settings.rate, settings.interpolation) for schedule in schedules]
    joints, held = follow(controller, begin, sampled, between(step, planned, 1.0))
    trajectory = Trajectory.of_positions(group, schedules[0].time, sampled[0].time, joints)
    result = RobotMotion.of(group, schedules, trajectory, model, speeds, held=held)
    step.end()
    return result


def follow(
    controller: Controller, start: Array, schedules: Sequence[Schedule], progress: Part = ignore_fraction
) -> tuple[Array, NDArray[np.bool_]]:
    """Follow the targets of each arm, whose m times are the same and evenly spaced, from rest at `start` (dof,).

    Return configurations (m, dof), and the steps (m,) without a solution, in which the arm braked.
    """
    times = schedules[0].time
    dt = (times[-1] - times[0]) / (len(times) - 1)
    targets = [schedule.targets() for schedule in schedules]
    has_reference = schedules[0].configurations is not None
    posture_weight = 0.3 if has_reference else 1e-2  # a little for joints that no other cost determines
    references = np.tile(start, (len(times), 1))
    for schedule, columns in zip(schedules, controller.columns, strict=True):
        if schedule.configurations is not None:
            references[:, columns] = schedule.configurations
    joints, held = np.empty((len(times), len(start))), np.zeros(len(times), bool)
    joints[0], state = start, ControlState.at_rest(start)
    # On matrices this small, threads of BLAS only wait for one another
    with _threads().limit(limits=1, user_api="blas"):
        for i in range(1, len(times)):
            problem = ControlProblem(
                tuple(own[i : i + 1] for own in targets),
                PostureCost(references[i], posture_weight),
                float(times[i]),
                tuple(None if own.positions is None else own.positions[i - 1] for own in schedules),
            )
            state = controller.step(problem, state, dt)
            joints[i], held[i] = state.q, not state.solved
            if i % 100 == 0:
                progress(i / len(times))
    return joints, held


@cache
def _threads() -> ThreadpoolController:
    """Return the controller of thread pools, whose search of all loaded libraries takes time."""
    return ThreadpoolController()


def _planned_start(
    group: ArmGroup,
    schedules: Sequence[Schedule],
    spec: EllipsoidSpec,
    settings: Control,
    bank: SeedBank | None,
    random_state: Any,
) -> Array:
    """First configuration of a motion that is planned through the same targets."""
    random = as_generator(random_state)
    planner = Planner.of(MotionLimits.of(group, joint_limit_margin=0.0), spec, False, random)
    if bank is not None:
        planner = replace(planner, arms=(replace(planner.arms[0], bank=bank),))
    names = {"profiles": "ellipsoids", "paths": "positions", "weights": "weights", "rotations": "rotations"}
    values = {name: [getattr(schedule, own) for schedule in schedules] for name, own in names.items()}
    plan = plan_motion(
        group,
        **{name: None if parts[0] is None else parts for name, parts in values.items()},  # type: ignore[arg-type]
        time=schedules[0].time,
        spec=spec,
        damping=schedules[0].objective.damping,
        planner=planner,
        position_tolerance=1e-3,
        orientation_axes=settings.orientation_axes,
        random_state=random,
    )
    return np.asarray(plan.trajectory.joint_positions[0])
