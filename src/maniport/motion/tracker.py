"""An arm, or a group of arms, follows target ellipsoids and paths step by step with the `Controller`."""

from collections.abc import Sequence
from functools import cache, partial

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
from maniport.motion.problem import FOLLOWING_WEIGHT, ArmProblem, CostWeights
from maniport.motion.robot_motion import RobotMotion
from maniport.motion.targets import (
    Damping,
    as_limits,
    checked_targets,
    linear,
    speed_limits,
)
from maniport.motion.trajectory import Trajectory
from maniport.util.defaults import DAMPING
from maniport.util.progress import Part, Progress, Step, between, ignore_fraction
from maniport.util.validation import Array, as_number, require_shape


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
    position_weight = as_number(position_cost, "position_cost", above=0.0)
    weighting = CostWeights(position_weight, axis_weights(orientation_axes))
    near = None if reference is None else group.require_within_limits(reference, "reference")
    arrays = {"profile": profile, "path": path, "weights": weights, "rotations": rotations}
    targets = checked_targets(arm, time, spec, damping, arrays)
    waypoint_times = targets[0].time
    if near is not None:
        require_shape(near, "reference", (len(waypoint_times), arm.dof), ", one row for each time")
    if start is None:
        if near is None:
            raise InvalidInputError(
                "start is required without reference: a configuration, such as the first of a plan"
            )
        start = near[0]
    begin = group.require_within_limits(start, "start", single=True)
    speeds = speed_limits(arm, velocity_limits)
    accelerations = as_limits(arm, acceleration_limits, "acceleration_limits")
    costs = as_costs(costs, arm, waypoint_times)
    controller = Controller(arm, speeds, accelerations, model, costs, limits)
    step = Step(progress, "Track trajectory")
    sampled = [target.sampled(control_rate) for target in targets]
    control_time = sampled[0].time
    references = None
    if near is not None:
        references = linear(waypoint_times, near, control_time)  # splines may exceed limits
    problems = tuple(map(partial(ArmProblem.of, weights=weighting), group.arms, sampled))
    joints, held = follow(
        controller,
        np.clip(begin, arm.lower, arm.upper),
        problems,
        references,
        between(step, 0.0, 1.0),
    )
    trajectory = Trajectory.of_positions(group, waypoint_times, control_time, joints)
    at_waypoints = tuple(map(partial(ArmProblem.of, weights=weighting), group.arms, targets))
    result = RobotMotion.of(group, at_waypoints, trajectory, model, speeds, held=held)
    step.end()
    return result


def follow(
    controller: Controller,
    start: Array,
    arms: Sequence[ArmProblem],
    references: Array | None = None,
    progress: Part = ignore_fraction,
) -> tuple[Array, NDArray[np.bool_]]:
    """Follow the targets of each arm, whose m times are the same and evenly spaced, from rest at `start` (dof,).

    The robot stays near the `references` (m, dof) where the targets leave freedom. Return configurations (m, dof), and
    the steps (m,) without a solution, in which the arm braked.
    """
    times = arms[0].target.time
    dt = (times[-1] - times[0]) / (len(times) - 1)
    reference_weight = 0.3
    if references is None:
        references = np.tile(start, (len(times), 1))
        reference_weight = 1e-2  # for joints that no other cost determines
    joints = np.empty((len(times), len(start)))
    held = np.zeros(len(times), bool)
    joints[0] = start
    state = ControlState.at_rest(start)
    # On matrices this small, threads of BLAS only wait for one another
    with _threads().limit(limits=1, user_api="blas"):
        for i in range(1, len(times)):
            previous = []
            for arm in arms:
                positions = arm.target.positions
                previous.append(None if positions is None else positions[i - 1])
            problem = ControlProblem(
                arms=tuple(arm[i : i + 1] for arm in arms),
                reference=references[i],
                reference_weight=reference_weight,
                time=float(times[i]),
                previous_positions=tuple(previous),
            )
            state = controller.step(problem, state, dt)
            joints[i] = state.q
            held[i] = not state.solved
            if i % 100 == 0:
                progress(i / len(times))
    return joints, held


_threads = cache(ThreadpoolController)  # its search of all loaded libraries takes time
