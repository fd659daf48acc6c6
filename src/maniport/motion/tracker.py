"""An arm, or a group of arms, follows target ellipsoids and paths step by step with the `Controller`."""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import ArrayLike, NDArray
from threadpoolctl import ThreadpoolController

from maniport.arms import Arm, ArmGroup, as_group
from maniport.arms.collisions import Collisions, as_collisions
from maniport.errors import ConvergenceWarning, InvalidInputError
from maniport.motion.collision_limit import Limit
from maniport.motion.controller import Controller, ControlProblem, ControlState
from maniport.motion.costs.cost import Cost, as_costs
from maniport.motion.costs.orientation import axis_weights
from maniport.motion.local_minima import local_minima
from maniport.motion.problem import FOLLOWING_WEIGHT, ArmProblem, CostWeights
from maniport.motion.robot_motion import RobotMotion
from maniport.motion.targets import (
    TargetTrajectory,
    as_limits,
    linear,
    speed_limits,
    targets_of_arms,
)
from maniport.motion.trajectory import Trajectory
from maniport.util.progress import Progress, ReportFraction, Step, between, ignore_fraction
from maniport.util.validation import Array, as_number, require_shape


@dataclass(frozen=True, kw_only=True)
class TrackOptions:
    """Options of `track`.

    Attributes
    ----------
    orientation_axes : {"pointing", "whole"}
        Which axes of target orientations count: z, or all.
    position_cost : float
        Weight of position errors [1/m].
    rate : float
        Control rate [Hz]; there is at least one step for each time of the targets.
    velocity_limits, acceleration_limits : array_like, shape (dof,) or one number, optional
        [rad/s], [rad/s²], or in meters. Default: the arm's own velocity limits, and no acceleration limits.
    collisions : Collisions or bool, optional
        Collision model; True: of the arm with itself, and with the other arms of the group.
    costs, limits : sequences of Cost and Limit
        Further costs and hard limits, see `maniport.motion.Cost` and `maniport.motion.Limit`.
    """

    orientation_axes: str = "pointing"
    position_cost: float = FOLLOWING_WEIGHT
    rate: float = 100.0
    velocity_limits: ArrayLike | None = None
    acceleration_limits: ArrayLike | None = None
    collisions: Collisions | bool | None = None
    costs: Sequence[Cost] = ()
    limits: Sequence[Limit] = ()

    def __post_init__(self) -> None:
        as_number(self.rate, "rate", above=0.0)
        as_number(self.position_cost, "position_cost", above=0.0)
        axis_weights(self.orientation_axes)


def track(
    robot: Arm | ArmGroup,
    targets: TargetTrajectory | Sequence[TargetTrajectory],
    options: TrackOptions | None = None,
    *,
    start: ArrayLike | None = None,
    reference: ArrayLike | None = None,
    progress: Progress | None = None,
) -> RobotMotion:
    """Track target ellipsoids and target paths of end effectors with a controller.

    Ellipsoids and paths may be infeasible. Where the quadratic program of a step has no solution, the arm brakes.
    A controller descends from the present configuration: it may stop in a local minimum although the target is
    reachable, which `ArmMotion.local_minimum` and a `ConvergenceWarning` report. Another start avoids it, or
    `maniport.motion.plan_motion`, which searches from many configurations.

    Parameters
    ----------
    robot : Arm or ArmGroup
        Arms with at least three joints, and a joint for each degree of freedom.
    targets : TargetTrajectory or sequence of TargetTrajectory
        Targets of the arm, or of each arm of a group, in its base frame.
    options : TrackOptions, optional
    start : array_like, shape (dof,), optional
        First configuration. Default: the first of the reference.
    reference : array_like, shape (n, dof), optional
        Configurations to stay near where path and ellipsoids leave freedom, such as a plan's [rad or m].
    progress : callable, optional
        Called with the name of a step and the fraction done.

    Raises
    ------
    InvalidInputError, NotSPDError
        When an argument has a wrong shape or value, or an arm has fewer than three joints or coupled ones.
    """
    if options is None:
        options = TrackOptions()
    group = as_group(robot)
    model = as_collisions(options.collisions, robot)
    near = None
    if reference is not None:
        near = group.require_within_limits(reference, "reference")
    checked = targets_of_arms(robot, targets)
    waypoint_times = checked[0].time
    if near is not None:
        shape = (len(waypoint_times), robot.dof)
        require_shape(near, "reference", shape, ", one row for each time")
    if start is None:
        if near is None:
            raise InvalidInputError(
                "start is required without reference: a configuration, such as the first of a plan"
            )
        start = near[0]
    begin = group.require_within_limits(start, "start", single=True)
    speeds = speed_limits(robot, options.velocity_limits)
    accelerations = as_limits(robot, options.acceleration_limits, "acceleration_limits")
    costs = as_costs(options.costs, robot, waypoint_times)
    controller = Controller(robot, speeds, accelerations, model, costs, options.limits)

    step = Step(progress, "Track trajectory")
    sampled = [target.sampled(options.rate) for target in checked]
    control_time = sampled[0].time
    references = None
    if near is not None:
        references = linear(waypoint_times, near, control_time)  # splines may exceed limits
    weights = CostWeights(options.position_cost, axis_weights(options.orientation_axes))
    joints, held = follow(
        controller,
        np.clip(begin, robot.lower, robot.upper),
        _problems(group, sampled, weights),
        references,
        between(step, 0.0, 1.0),
    )
    trajectory = Trajectory.of_positions(group, waypoint_times, control_time, joints)
    at_waypoints = _problems(group, checked, weights)
    motion = RobotMotion.of(group, at_waypoints, trajectory, model, speeds, held=held)
    result = with_local_minima(motion, at_waypoints)
    step.end()
    return result


def _problems(
    group: ArmGroup, targets: Sequence[TargetTrajectory], weights: CostWeights
) -> tuple[ArmProblem, ...]:
    problems = []
    for arm, target in zip(group.arms, targets, strict=True):
        problems.append(ArmProblem.of(arm, target, weights))
    return tuple(problems)


def with_local_minima(motion: RobotMotion, problems: Sequence[ArmProblem]) -> RobotMotion:
    """Return a motion with the local minima of each arm, and warn of them."""
    arms = []
    for arm, problem in zip(motion.arms, problems, strict=True):
        flags = None
        if not problem.pose_costs:
            flags = local_minima(problem, arm.joint_positions)
            if flags.any():
                text = (
                    f"{arm.arm!r} stops in a local minimum at {flags.sum()} of {len(flags)} waypoints although nearer "
                    "ellipsoids are reachable: start elsewhere, or use plan_motion"
                )
                warnings.warn(text, ConvergenceWarning, stacklevel=3)
        arms.append(replace(arm, local_minimum=flags))
    return replace(motion, arms=tuple(arms))


def follow(
    controller: Controller,
    start: Array,
    arms: Sequence[ArmProblem],
    references: Array | None = None,
    progress: ReportFraction = ignore_fraction,
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
