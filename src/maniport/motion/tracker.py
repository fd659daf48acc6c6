"""An arm, or a group of arms, follows target ellipsoids and paths step by step with the `Controller`."""

from collections.abc import Sequence
from functools import cache

import numpy as np
from numpy.typing import ArrayLike, NDArray
from threadpoolctl import ThreadpoolController

from maniport.arms import VELOCITY, Arm, ArmGroup, EllipsoidSpec, as_group
from maniport.arms.collisions import Collisions, as_collisions
from maniport.errors import InvalidInputError
from maniport.motion.collision_limit import Limit
from maniport.motion.controller import Controller, ControlProblem, ControlState
from maniport.motion.costs.cost import Cost, as_costs
from maniport.motion.costs.orientation import axis_weights
from maniport.motion.objective import FOLLOWING_WEIGHT, Damping
from maniport.motion.robot_motion import RobotMotion
from maniport.motion.schedule import Schedule, as_limits, schedules_of, speed_limits
from maniport.motion.trajectory import Trajectory
from maniport.util.defaults import DAMPING
from maniport.util.progress import Part, Progress, Step, between, ignore_fraction
from maniport.util.validation import Array, as_number


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
    orientation_axes: str = "pointing",
    position_cost: float = FOLLOWING_WEIGHT,
    rate: float = 100.0,
    velocity_limits: ArrayLike | None = None,
    acceleration_limits: ArrayLike | None = None,
    collisions: Collisions | bool | None = None,
    costs: Sequence[Cost] = (),
    limits: Sequence[Limit] = (),
    progress: Progress | None = None,
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
        First configuration. Default: the first of the reference.
    reference : array_like, shape (n, dof), optional
        Configurations to stay near where path and ellipsoids leave freedom, such as a plan's [rad or m].
    spec, damping, orientation_axes
        As in `maniport.motion.plan_motion`; the damping is above zero, since arms pass singular configurations.
    weights : array_like, shape (n, m, m), optional
        Weights of the directions of the ellipsoids, see `maniport.learning.tracking_weights`; m = d (d + 1) / 2.
    position_cost : float
        Weight of position errors [1/m].
    rate : float
        Control rate [Hz]; there is at least one step for each time of the profile.
    velocity_limits, acceleration_limits : array_like, shape (dof,) or one number, optional
        [rad/s], [rad/s²], or in meters. Default: the arm's own velocity limits, and no acceleration limits.
    collisions : Collisions or bool, optional
        Collision model; True: of the arm with itself, and with the other arms of the group.
    costs, limits : sequences of Cost and Limit
        Further costs and hard limits, see `maniport.motion.Cost` and `maniport.motion.Limit`.
    progress : optional
        Called with the name of a step and the fraction done.

    Raises
    ------
    InvalidInputError, NotSPDError
        When an argument has a wrong shape or value, an ellipsoid is asymmetric or indefinite, or an arm has fewer than
        three joints or coupled ones.
    """
    group, model = as_group(arm), as_collisions(collisions, arm)
    control_rate = as_number(rate, "rate", above=0.0)
    position_weight, axes = (
        as_number(position_cost, "position_cost", above=0.0),
        axis_weights(orientation_axes),
    )
    near = None if reference is None else group.require_within_limits(reference, "reference")
    arrays = {"profile": profile, "path": path, "weights": weights, "rotations": rotations}
    schedules = schedules_of(arm, time, spec, damping, position_weight, axes, arrays, near)
    if start is None:
        if near is None:
            raise InvalidInputError(
                "start is required without reference: a configuration, such as the first of a plan"
            )
        start = near[0]
    begin = group.require_within_limits(start, "start", single=True)
    speeds = speed_limits(arm, velocity_limits)
    accelerations = as_limits(arm, acceleration_limits, "acceleration_limits")
    costs = as_costs(costs, arm, schedules[0].time)
    controller = Controller(arm, speeds, accelerations, model, costs, limits)
    step, sampled = (
        Step(progress, "Track trajectory"),
        [own.sampled(control_rate) for own in schedules],
    )
    joints, held = follow(
        controller, np.clip(begin, arm.lower, arm.upper), sampled, between(step, 0.0, 1.0)
    )
    trajectory = Trajectory.of_positions(group, schedules[0].time, sampled[0].time, joints)
    result = RobotMotion.of(group, schedules, trajectory, model, speeds, held=held)
    step.end()
    return result


def follow(
    controller: Controller,
    start: Array,
    schedules: Sequence[Schedule],
    progress: Part = ignore_fraction,
) -> tuple[Array, NDArray[np.bool_]]:
    """Follow the targets of each arm, whose m times are the same and evenly spaced, from rest at `start` (dof,).

    Return configurations (m, dof), and the steps (m,) without a solution, in which the arm braked.
    """
    times = schedules[0].time
    dt = (times[-1] - times[0]) / (len(times) - 1)
    targets = [schedule.targets() for schedule in schedules]
    has_reference = schedules[0].configurations is not None
    reference_weight = (
        0.3 if has_reference else 1e-2
    )  # a little for joints that no other cost determines
    references = np.tile(start, (len(times), 1))
    for schedule, columns in zip(schedules, controller.columns, strict=True):
        if schedule.configurations is not None:
            references[:, columns] = schedule.configurations
    joints, held = np.empty((len(times), len(start))), np.zeros(len(times), bool)
    joints[0], state = start, ControlState.at_rest(start)
    # On matrices this small, threads of BLAS only wait for one another
    with _threads().limit(limits=1, user_api="blas"):
        for i in range(1, len(times)):
            previous = tuple(
                None if own.positions is None else own.positions[i - 1] for own in schedules
            )
            rows = tuple(own[i : i + 1] for own in targets)
            problem = ControlProblem(
                rows, references[i], reference_weight, float(times[i]), previous
            )
            state = controller.step(problem, state, dt)
            joints[i], held[i] = state.q, not state.solved
            if i % 100 == 0:
                progress(i / len(times))
    return joints, held


_threads = cache(ThreadpoolController)  # its search of all loaded libraries takes time
