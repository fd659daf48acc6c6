"""An arm, or a group of arms, follows target ellipsoids and paths step by step with the `Controller`."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from threadpoolctl import ThreadpoolController

from maniport.arms import VELOCITY, Arm, ArmGroup, EllipsoidSpec, as_group
from maniport.arms.collisions import Collisions, as_collisions
from maniport.errors import InvalidInputError
from maniport.motion.arm_model import require_trackable
from maniport.motion.arm_motion import ArmMotion
from maniport.motion.controller import Controller, ControlProblem, ControlState
from maniport.motion.effort import QUICK
from maniport.motion.follow.control import Control
from maniport.motion.limits import BrakingLimit, CollisionLimit
from maniport.motion.motion_limits import MotionLimits
from maniport.motion.objective import Damping, Objective
from maniport.motion.plan.plan_motion import plan_motion
from maniport.motion.plan.planner import ArmPlanner, Planner
from maniport.motion.plan.reachability_map import ReachabilityMap
from maniport.motion.problem import as_costs
from maniport.motion.robot_motion import RobotMotion
from maniport.motion.schedule import Schedule, as_limits, of_each, speed_limits
from maniport.motion.search.seed_bank import SeedBank
from maniport.motion.trajectory import Clearance, Trajectory
from maniport.util.defaults import DAMPING
from maniport.util.progress import Part, Progress, Step, between, nobody
from maniport.util.validation import Array, as_generator


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
    """Move arms so that their ellipsoids follow target ones, and their end effectors target paths.

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
    near = None if reference is None else group.require_within_limits(reference, "reference")
    arrays = {"profile": profile, "path": path, "weights": weights, "rotations": rotations}
    objectives, schedules = _targets(arm, settings, time, spec, damping, arrays, near)
    begin = _as_start(group, near[0] if start is None and near is not None else start)
    speeds = speed_limits(arm, settings.velocity_limits)
    accelerations = as_limits(arm, settings.acceleration_limits, "acceleration_limits")
    braking = BrakingLimit(arm.lower, arm.upper, speeds, accelerations)
    distances = CollisionLimit(model) if model is not None and model.known else None
    costs = as_costs(settings.costs, arm, schedules[0].time)
    controller = Controller(arm, braking, distances, costs, settings.limits, settings.lm_damping)
    step, planned = Step(progress, "Track trajectory"), 0.0 if begin is not None else 0.5  # the share of the work
    if begin is None:
        begin = _planned_start(arm, schedules, objectives, spec, settings, bank, random_state)
    parts = list(zip(objectives, schedules, group.columns, strict=True))
    sampled = [own.sampled(objective, settings.rate, settings.interpolation) for objective, own, _ in parts]
    joints, held = follow(controller, begin, sampled, objectives, between(step, planned, 1.0))
    motions = tuple(
        _evaluated(objective, own, sampled[0].time, joints[:, columns], held, speeds[columns])
        for objective, own, columns in parts
    )
    result = _joined(group, motions, model)
    step.end()
    return result


def _targets(
    arm: Arm | ArmGroup,
    settings: Control,
    time: ArrayLike,
    spec: EllipsoidSpec,
    damping: Damping,
    arrays: Mapping[str, Any],
    reference: Array | None,
) -> tuple[list[Objective], list[Schedule]]:
    """Check the targets of each arm."""
    group, alone = as_group(arm), isinstance(arm, Arm)
    columns = [(value,) if alone else of_each(value, name, len(group)) for name, value in arrays.items()]
    specs = (spec,) if alone else group.specs(spec)
    objectives, schedules = [], []
    for i, (profile, path, weights, rotations) in enumerate(zip(*columns, strict=True)):
        require_trackable(group.arms[i], spec)
        objective = Objective.of(group.arms[i], specs[i], damping, settings.position_cost, positive=True)
        objectives.append(objective.keeping(settings.orientation_axes, settings.orientation_weight))
        near = None if reference is None else reference[..., group.columns[i]]
        schedules.append(Schedule.checked(objectives[i], profile, time, path, weights, rotations, near))
    return objectives, schedules


def _joined(group: ArmGroup, motions: tuple[ArmMotion, ...], collisions: Collisions | None) -> RobotMotion:
    """Join the motions of all arms."""
    names = ("joint_positions", "control_positions", "control_velocities", "control_accelerations")
    trajectory = Trajectory(
        joint_names=group.joint_names,
        joint_units=group.joint_units,
        time=motions[0].time,
        control_time=motions[0].control_time,
        **{name: group.joined(*(getattr(motion, name) for motion in motions)) for name in names},
    )
    return RobotMotion(group, trajectory, motions, clearance=Clearance.of(collisions, trajectory))


def follow(
    controller: Controller,
    start: Array,
    schedules: Sequence[Schedule],
    objectives: Sequence[Objective],
    progress: Part = nobody,
) -> tuple[Array, NDArray[np.bool_]]:
    """Follow targets at evenly spaced times, from rest.

    Parameters
    ----------
    controller : Controller
    start : ndarray, shape (dof,)
    schedules, objectives
        Of each arm of the controller; their m times are the same.

    Returns
    -------
    joints : ndarray, shape (m, dof)
    held : ndarray, shape (m,)
        Steps without a solution, in which the arm braked, bool.
    """
    times = schedules[0].time
    dt = (times[-1] - times[0]) / (len(times) - 1)
    targets = [own.targets(objective) for own, objective in zip(schedules, objectives, strict=True)]
    has_reference = schedules[0].postures is not None
    references = np.tile(start, (len(times), 1))
    for own, columns in zip(schedules, controller.columns, strict=True):
        if own.postures is not None:
            references[:, columns] = own.postures
    joints, held = np.empty((len(times), len(start))), np.zeros(len(times), bool)
    joints[0], state = start, ControlState.at_rest(start)
    # On matrices this small, threads of BLAS only wait for one another
    with _threads().limit(limits=1, user_api="blas"):
        for i in range(1, len(times)):
            problem = ControlProblem(
                tuple(own[i : i + 1] for own in targets),
                tuple(None if own.positions is None else own.positions[i - 1] for own in schedules),
                references[i],
                0.3 if has_reference else 1e-2,  # a little for joints that no other cost determines
                float(times[i]),
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
    arm: Arm | ArmGroup,
    schedules: Sequence[Schedule],
    objectives: Sequence[Objective],
    spec: EllipsoidSpec,
    settings: Control,
    bank: SeedBank | None,
    random_state: Any,
) -> Array:
    """First configuration of a motion that is planned through the same targets."""
    limits, random = MotionLimits.of(arm, joint_limit_margin=0.0), as_generator(random_state)
    if isinstance(arm, ArmGroup):
        planner = Planner.of(limits, spec, False, random)
    else:
        bank = SeedBank.given_or_built(bank, arm, spec, random)
        own = ArmPlanner(limits, ReachabilityMap(arm, spec, random_state=random), bank)
        planner = Planner(limits, spec, (own,))
    columns = [(own.ellipsoids, own.positions, own.weights, own.rotations) for own in schedules]
    profiles, paths, weights, rotations = (
        None if values[0] is None else values for values in zip(*columns, strict=True)
    )
    assert profiles is not None
    plan = plan_motion(
        as_group(arm),
        profiles,
        time=schedules[0].time,
        paths=paths,
        spec=spec,
        damping=objectives[0].damping,
        weights=weights,
        rotations=rotations,
        planner=planner,
        planning_effort=QUICK,
        position_tolerance=1e-3,
        orientation_axes=settings.orientation_axes,
        orientation_weight=settings.orientation_weight,
        random_state=random,
    )
    return np.asarray(plan.trajectory.joint_positions[0])


def _evaluated(
    objective: Objective,
    schedule: Schedule,
    time: Array,
    joints: Array,
    held: NDArray[np.bool_],
    velocity_limits: Array,
) -> ArmMotion:
    """Compare joint positions (m, dof) at control times (m,) with their targets."""
    result = ArmMotion.of_motion(
        objective.arm,
        schedule.time,
        schedule.ellipsoids,
        time,
        joints,
        spec=objective.spec,
        damping=objective.damping,
        path=schedule.positions,
        velocity_limits=velocity_limits,
        held=held,
    )
    return replace(result, orientation_error=schedule.targets(objective).axis_angles(result.joint_positions))


def _as_start(group: ArmGroup, start: ArrayLike | None) -> Array | None:
    if start is None:
        return None
    q = group.require_within_limits(start, "start")
    if q.ndim != 1:
        raise InvalidInputError(f"start must be one configuration, shape ({group.dof},); found shape {q.shape}")
    return np.clip(q, group.lower, group.upper)
