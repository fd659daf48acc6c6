"""One control step: a quadratic program on the costs of a motion problem, within hard limits.

With the costs f(q) = Σ |r(q)|² linearized at the present configuration, the displacement Δq of a step minimizes

    Σ |r + J Δq|² + w² |q + Δq − q_ref|² + Σ_arms (λ d² + μ) |Δq_arm|²

within the limits. d is the distance of an arm's ellipsoid to its target and λ the Levenberg-Marquardt damping. An arm
whose path is out of reach moves calmly by the damping μ = w_p² R e, with the weight w_p of position errors, the reach R
of the arm, and the distance e of the end effector from its previous target.

With a horizon, velocities are planned in further intervals, too: the cost is the mean of those at the ends of all
intervals, with the same linearization, and limits of velocity and acceleration hold throughout. So an arm whose
accelerations are limited brakes in time. Only the velocities of the first interval are used. Where later target
positions are available, each interval has the position cost of its own.

A joint may be no faster than it can brake before its position limit. With the distance D to the limit, the acceleration
a and steps of dt, this velocity is √(2 a D) − a dt / 2, and D / dt where the joint can stop within a step. From each
configuration and velocity that respects this bound, a step exists that respects it again; the steps may have different
durations. So limits of position, velocity and acceleration never contradict one another. A joint that begins beyond a
position limit, at rest, moves inward only.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import daqp
import numpy as np
from numpy.typing import NDArray

from maniport.arms import Arm, ArmGroup, as_group
from maniport.arms.collisions import Collisions
from maniport.motion.collision_limit import CollisionLimit, Limit, as_own_limits
from maniport.motion.configurations import Configurations
from maniport.motion.costs.cost import Cost
from maniport.motion.problem import ArmProblem
from maniport.util.jit import kernel, part
from maniport.util.validation import Array

Block = tuple[slice | NDArray[np.intp], slice | NDArray[np.intp]]
"""Rows and columns of the joints of an arm in a Hessian of its group."""

LM_DAMPING = 3.0  # Keeps an arm calm where the target ellipsoid is out of reach


@dataclass(frozen=True, eq=False)
class ControlState:
    """State of an arm between two control steps."""

    q: Array  # (dof,) [rad or m]
    velocity: Array  # (dof,), of the last step [1/s]
    dt: float | None = None  # duration of the last step [s]; None before the first step
    # False if accelerations did not suffice to satisfy all inequalities of limits in the last step. They were violated
    # as little as possible, or the arm braked if this would have led to a collision.
    solved: bool = True
    # multipliers of its program, at which the next one begins
    multipliers: Array = field(default_factory=lambda: np.empty(0))

    @classmethod
    def at_rest(cls, q: Array) -> "ControlState":
        """Return the state of rest in a configuration (dof,)."""
        return cls(q.copy(), np.zeros(len(q)))


@dataclass(frozen=True, eq=False)
class ControlProblem:
    """Costs of one control step."""

    arms: tuple[ArmProblem, ...]  # one row each
    reference: Array  # q_ref, (dof,)
    reference_weight: float  # w [1/rad or 1/m]
    time: float = 0.0  # of further costs [s]
    # (3,), target positions of each arm in the last step [m]; None for no damping by the position error
    previous_positions: tuple[Array | None, ...] | None = None
    # durations of intervals after the step for which velocities are planned, too [s]
    horizon: tuple[float, ...] = ()
    # present configuration of each arm, whose kinematics are known; None: to be computed
    configurations: tuple[Configurations, ...] | None = None
    # (1 + len(horizon), 3) of each arm: target positions at the ends of all intervals [m]; None: those of `arms`
    positions: tuple[Array | None, ...] | None = None


class Controller:
    """Moves an arm or a group of arms, step by step, within its position limits.

    `velocity` and `acceleration` (dof,) are the largest magnitudes, infinite where a joint has no limit. A step is
    taken only if neither it nor braking after it collides. `costs` and `limits` are further ones.
    """

    def __init__(
        self,
        arm: Arm | ArmGroup,
        velocity: Array,
        acceleration: Array,
        collisions: Collisions | None = None,
        costs: Sequence[Cost] = (),
        limits: Sequence[Limit] = (),
    ):
        group = as_group(arm)
        self._robot = arm
        self.columns: Sequence[slice | NDArray[np.intp]] = group.columns
        self._blocks: list[Block] = [(columns[:, None], columns) for columns in group.columns]
        if len(group.arms) == 1:  # indexing by arrays is slow
            self.columns = [slice(None)]
            self._blocks = [(slice(None), slice(None))]
        self._bounds = np.array([arm.lower, arm.upper, velocity, acceleration], dtype=np.float64)
        if collisions is not None and collisions.checked:
            self._collisions: Collisions | None = collisions
        else:
            self._collisions = None
        self._costs = tuple(costs)
        self._limits = as_own_limits(limits, group)
        if self._collisions is not None:
            self._limits = (*self._limits, CollisionLimit(self._collisions))
        self._reaches = []  # largest distances of the end effectors from the base [m]
        for member in group.arms:
            positions = member.forward(member.sample(64, 0))[:, :3, 3]
            self._reaches.append(float(np.linalg.norm(positions, axis=1).max()))

    def step(
        self, problem: ControlProblem, state: ControlState, dt: float, speed_share: float = 1.0
    ) -> ControlState:
        """Move for dt [s], or brake if the quadratic program has no solution or the solution collides.

        `speed_share` is the share of the velocity limits that may be used. A joint that is faster slows down as its
        acceleration allows.
        """
        bounds = _velocity_bounds(
            state.q, state.velocity, self._bounds, state.dt or dt, dt, speed_share
        )
        velocity, solved, multipliers = self._solve(problem, state, bounds, dt, speed_share)
        if velocity is not None:
            velocity, configurations = _moved(state.q, velocity, bounds, self._bounds, dt)
            if self._collisions is None or not self._collisions.collides(configurations).any():
                return ControlState(configurations[0], velocity, dt, solved, multipliers)
        return self.brake(state, dt)

    def brake(self, state: ControlState, dt: float) -> ControlState:
        """Come to rest as soon as accelerations allow."""
        bounds = _velocity_bounds(state.q, state.velocity, self._bounds, state.dt or dt, dt, 1.0)
        velocity, configurations = _moved(state.q, np.zeros(len(state.q)), bounds, self._bounds, dt)
        return ControlState(configurations[0], velocity, dt, solved=False)

    def _solve(
        self,
        problem: ControlProblem,
        state: ControlState,
        bounds: Array,
        dt: float,
        speed_share: float,
    ) -> tuple[Array | None, bool, Array]:
        """Return the best velocities (dof,), or None, whether they satisfy all inequalities, and multipliers."""
        q = state.q
        none = np.empty(0)
        hessian, gradients = self._objective(problem, q)
        # an ellipsoid may be singular
        if not math.isfinite(np.vdot(hessian, hessian) + np.vdot(gradients, gradients)):
            return None, False, none
        rows = np.empty((0, len(q)))
        allowed = np.empty(0)
        for limit in self._limits:
            more, sides = limit.inequalities(q, dt)
            if not len(rows):
                rows = more
                allowed = sides
            else:
                rows = np.vstack([rows, more])
                allowed = np.append(allowed, sides)
        durations = np.array((dt, *problem.horizon))
        for relaxed in (False, True) if len(rows) else (False,):
            limits = bounds, self._bounds, speed_share, rows, allowed, relaxed
            program = _program(hessian, gradients, durations, *limits, state.multipliers)
            step, _, exit_flag, results = daqp.solve(*program)
            if exit_flag > 0 and math.isfinite(np.vdot(step, step)):
                return step[: len(q)] / dt, not relaxed, results["lam"]
        return None, False, none

    def _objective(self, problem: ControlProblem, q: Array) -> tuple[Array, Array]:
        """Return the damped Gauss-Newton Hessian (dof, dof), and half the gradients of all intervals (m, dof)."""
        dof = len(q)
        posture_weight = problem.reference_weight**2
        gradient = posture_weight * (q - problem.reference)
        damping = np.zeros(dof)
        hessian = np.zeros((dof, dof))
        changes = np.zeros((1 + len(problem.horizon), dof))
        for i, (arm, block) in enumerate(zip(problem.arms, self._blocks, strict=True)):
            columns = block[1]
            if problem.configurations is None:
                at = arm.at(q[None, columns])
            else:
                at = problem.configurations[i]
            equations = arm.normal_equations(at.joint_positions, at)
            hessian[block] += equations.hessian[0]
            gradient[columns] += equations.gradient[0]
            amount = LM_DAMPING * equations.ellipsoid_square[0]
            position_weight = 0.0 if arm.position is None else arm.position.weight**2
            positions = None if problem.positions is None else problem.positions[i]
            if positions is not None and arm.position is not None:
                offsets = position_weight * (arm.position.positions - positions)
                changes[:, columns] = offsets @ at.jacobians[0, :3]
            if problem.previous_positions is None:
                previous = None
            else:
                previous = problem.previous_positions[i]
            if previous is not None:
                distance = math.dist(at.poses[0, :3, 3], previous)
                # about 1 mm is no sign of a path out of reach
                lag = distance * distance / (distance + 1e-3)
                amount += position_weight * self._reaches[i] * lag
            damping[columns] += amount
        at = Configurations(self._robot, q[None], np.array([problem.time]))
        for cost in self._costs:
            residual = cost.residual(at)[0]
            jacobian = cost.jacobian(at)[0]
            hessian += jacobian.T @ jacobian
            gradient += residual @ jacobian
        hessian.reshape(-1)[:: dof + 1] += damping + (posture_weight + 1e-12)  # the diagonal
        return hessian, gradient + changes


@kernel
def _velocity_bounds(
    q: Array, velocity: Array, limits: Array, last_dt: float, dt: float, speed_share: float
) -> Array:
    """Return the smallest and the largest velocities of the next step, shape (2, dof)."""
    bounds = np.empty((2, len(q)))
    for i in range(len(q)):
        v = velocity[i]
        a = limits[3, i]
        change = 0.5 * a * (last_dt + dt)
        fastest = max(speed_share * limits[2, i], abs(v) - change)
        upper = min(fastest, v + change, _braking_speed(limits[1, i] - q[i], a, dt))
        bounds[0, i] = min(
            -min(fastest, change - v, _braking_speed(q[i] - limits[0, i], a, dt)), upper
        )
        bounds[1, i] = upper
    return bounds


@part
def _braking_speed(distance: float, a: float, dt: float) -> float:
    distance = max(distance, 0.0)
    half = 0.5 * a * dt
    fast: float = np.sqrt(2.0 * a * distance) - half  # nan without a limit of acceleration
    if fast > half:
        return fast
    return distance / dt


@kernel
def _moved(
    q: Array, velocity: Array, bounds: Array, limits: Array, dt: float
) -> tuple[Array, Array]:
    """Return the velocity within bounds, and two configurations (2, dof): after the step, and after braking."""
    achieved = np.empty(len(q))
    configurations = np.empty((2, len(q)))
    for i in range(len(q)):
        achieved[i] = min(max(velocity[i], bounds[0, i]), bounds[1, i])
        # a start beyond a limit is left where it is until the joint moves inward
        least = min(limits[0, i], q[i])
        most = max(limits[1, i], q[i])
        configurations[0, i] = min(max(q[i] + dt * achieved[i], least), most)
        slower = max(abs(achieved[i]) - 0.5 * limits[3, i] * dt, 0.0)
        configurations[1, i] = configurations[0, i] + np.sign(achieved[i]) * slower**2 / (
            2.0 * limits[3, i]
        )
    return achieved, configurations


@kernel
def _program(
    hessian: Array,
    gradients: Array,
    durations: Array,
    bounds: Array,
    limits: Array,
    speed_share: float,
    rows: Array,
    allowed: Array,
    relaxed: bool,
    multipliers: Array,
) -> tuple[Array, Array, Array, Array, Array, NDArray[np.int32]]:
    """Return the arguments of `daqp.solve` for the velocities in m intervals, times the first duration.

    The cost is the mean over the durations (m,) of costs at the ends of the intervals, with one Hessian (dof, dof), and
    halved gradients (m, dof) at the present configuration. `bounds` and the inequalities
    rows (k, dof) · Δq ≤ allowed (k,) hold for the first interval. Later velocities are within the share of the limits
    that may be used, and reached within the limits of acceleration. `relaxed` lets inequalities be violated, as little
    as possible. The solver begins with the constraints that had multipliers.
    """
    stages, dof = gradients.shape
    size = stages * dof
    count = len(rows)
    dt = durations[0]
    unlimited = 1e30
    quadratic = np.zeros((size, size))
    linear = np.zeros(size)
    matrix = np.zeros((count + size - dof, size))
    above = np.full(size + len(matrix), unlimited)
    below = -above
    for k in range(stages):
        for a in range((k + 1) * dof):
            weight = durations[k] / durations.sum() * durations[a // dof] / dt
            linear[a] += weight * gradients[k, a % dof]
            for b in range((k + 1) * dof):
                quadratic[a, b] += weight * durations[b // dof] / dt * hessian[a % dof, b % dof]
    for i in range(dof):
        above[i] = min(dt * bounds[1, i], unlimited)
        below[i] = max(dt * bounds[0, i], -unlimited)
    for i in range(dof, size):
        fastest = min(dt * speed_share * limits[2, i % dof], unlimited)
        above[i] = max(fastest, above[i - dof])
        below[i] = min(-fastest, below[i - dof])
        row = count + i - dof
        k = i // dof
        matrix[row, i] = 1.0
        matrix[row, i - dof] = -1.0
        change = min(0.5 * (durations[k - 1] + durations[k]) * limits[3, i % dof] * dt, unlimited)
        above[size + row] = change
        below[size + row] = -change
    matrix[:count, :dof] = rows
    above[size : size + count] = allowed
    sense = np.zeros(len(above), np.int32)
    for i in range(len(sense) if len(sense) == len(multipliers) else 0):
        # active above or below
        if multipliers[i] > 0.0:
            sense[i] = 1
        elif multipliers[i] < 0.0:
            sense[i] = 3
        else:
            sense[i] = 0
    if relaxed:
        sense[size : size + count] = 8  # soft
    return quadratic, linear, matrix, above, below, sense
