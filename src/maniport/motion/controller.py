"""One control step: a quadratic program on the costs of a motion problem, within hard limits.

With the costs f(q) = Σ |r(q)|² linearized at the present configuration, the displacement Δq of a step minimizes

    Σ |r + J Δq|² + w² |q + Δq − q_ref|² + Σ_arms (λ d² + μ) |Δq_arm|²

within the limits. d is the distance of an arm's ellipsoid to its target and λ the Levenberg-Marquardt damping. An arm
whose path is out of reach moves calmly by the damping μ = w_p² R e, with the weight w_p of position errors, the reach R
of the arm, and the distance e of the end effector from its previous target.

With a horizon, velocities are planned in further intervals, too: the cost is the mean of those at the ends of all
intervals, with the same linearization, and limits of velocity and acceleration hold throughout. So an arm whose
accelerations are limited brakes in time. Only the velocities of the first interval are used.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import daqp
import numpy as np

from maniport.arms import Arm, ArmGroup, as_group
from maniport.errors import InvalidInputError
from maniport.motion.limits import BrakingLimit, CollisionLimit, Limit
from maniport.motion.objective import Targets
from maniport.motion.problem import Cost, PostureCost
from maniport.util.validation import Array

LM_DAMPING = 3.0  # Keeps an arm calm where the target ellipsoid is out of reach


@dataclass(frozen=True, eq=False)
class ControlState:
    """State of an arm between two control steps.

    Attributes
    ----------
    q, velocity : ndarray, shape (dof,)
        Joint positions [rad or m], and velocities of the last step [1/s].
    dt : float, optional
        Duration of the last step [s]; None before the first step.
    solved : bool
        False if accelerations did not suffice to satisfy all inequalities of limits in the last step. They were
        violated as little as possible, or the arm braked if this would have led to a collision.
    """

    q: Array
    velocity: Array
    dt: float | None = None
    solved: bool = True

    @classmethod
    def at_rest(cls, q: Array) -> "ControlState":
        """Return the state of rest in a configuration (dof,)."""
        return cls(q.copy(), np.zeros(len(q)))


@dataclass(frozen=True, eq=False)
class ControlProblem:
    """Costs of one control step.

    Attributes
    ----------
    targets : tuple of Targets
        Targets of each arm, one row.
    posture : PostureCost
        Reference configuration.
    time : float
        Time of further costs [s].
    previous_positions : tuple of ndarray, shape (3,), or None
        Target positions of each arm in the last step [m]; None for no damping by the position error.
    horizon : tuple of float
        Durations of h intervals after the step for which velocities are planned, too [s].
    predicted_positions : tuple of ndarray, shape (h, 3), or None
        Target positions of each arm at the ends of these intervals [m].
    differentials : tuple, optional
        `Objective.differentials` of each arm at the present configuration. Default: computed.
    """

    targets: tuple[Targets, ...]
    posture: PostureCost
    time: float = 0.0
    previous_positions: tuple[Array | None, ...] | None = None
    horizon: tuple[float, ...] = ()
    predicted_positions: tuple[Array | None, ...] = ()
    differentials: tuple[tuple[Array, Array, Array, Array], ...] | None = None


class Controller:
    """Moves an arm or a group of arms, step by step.

    Parameters
    ----------
    arm : Arm or ArmGroup
    braking : BrakingLimit
    collisions : CollisionLimit, optional
        A step is taken only if neither it nor braking after it collides.
    costs : sequence of Cost
        Further costs.
    limits : sequence of Limit
        Further hard limits.
    lm_damping : float
        Levenberg-Marquardt damping of ellipsoids, λ.
    """

    def __init__(
        self,
        arm: Arm | ArmGroup,
        braking: BrakingLimit,
        collisions: CollisionLimit | None = None,
        costs: Sequence[Cost] = (),
        limits: Sequence[Limit] = (),
        lm_damping: float = LM_DAMPING,
    ):
        group = as_group(arm)
        self.braking, self.collisions, self.lm_damping = braking, collisions, lm_damping
        self._costs, self._limits = tuple(costs), (*limits, *(() if collisions is None else (collisions,)))
        self.columns = group.columns
        self._whole = len(group.arms) == 1  # hessians of an arm need no indexing, which is slow
        samples = [own.forward(own.sample(64, 0))[:, :3, 3] for own in group.arms]
        self._no_limits = np.empty((0, group.dof)), np.empty(0)
        self.reaches = tuple(
            float(np.linalg.norm(end_positions, axis=1).max()) for end_positions in samples
        )  # from the base [m]
        for i, limit in enumerate(limits):
            _require_fitting(limit, f"limits[{i}]", group)

    def step(self, problem: ControlProblem, state: ControlState, dt: float, speed_share: float = 1.0) -> ControlState:
        """Move for dt [s], or brake if the quadratic program has no solution or the solution collides.

        `speed_share` is the share of the velocity limits that may be used.
        """
        bounds = self._bounds(state, dt, speed_share)
        velocity, solved = self._solve(problem, state.q, bounds, dt, speed_share)
        if velocity is None:
            return self.brake(state, dt)
        velocity, configurations = self.braking.move(state.q, velocity, bounds, dt)
        if self.collisions is not None and self.collisions.collisions.collides(configurations).any():
            return self.brake(state, dt)
        return ControlState(configurations[0], velocity, dt, solved)

    def brake(self, state: ControlState, dt: float) -> ControlState:
        """Come to rest as soon as accelerations allow."""
        bounds = self._bounds(state, dt, 1.0)
        velocity, configurations = self.braking.move(state.q, np.zeros(len(state.q)), bounds, dt)
        return ControlState(configurations[0], velocity, dt, solved=False)

    def _bounds(self, state: ControlState, dt: float, speed_share: float) -> Array:
        last_dt = dt if state.dt is None else state.dt
        return self.braking.bounds(state.q, state.velocity, last_dt, dt, speed_share)

    def _solve(
        self, problem: ControlProblem, q: Array, bounds: Array, dt: float, speed_share: float
    ) -> tuple[Array | None, bool]:
        """Return the best velocities (dof,), or None, and whether they satisfy all inequalities."""
        hessian, gradients = self._objective(problem, q)
        if not math.isfinite(np.vdot(hessian, hessian) + np.vdot(gradients, gradients)):  # an ellipsoid is singular
            return None, False
        rows, allowed = self._no_limits
        if self._limits:
            pairs = [limit.inequalities(q, dt) for limit in self._limits]
            many = len(pairs) > 1
            rows, allowed = (np.concatenate(parts) if many else parts[0] for parts in zip(*pairs, strict=True))
        durations = np.array((dt, *problem.horizon))
        for relaxed in (False, True) if len(rows) else (False,):
            program = self.braking.program(hessian, gradients, durations, bounds, speed_share, rows, allowed, relaxed)
            step, _, exit_flag, _ = daqp.solve(*program)
            if exit_flag > 0 and math.isfinite(step.sum()):
                return step[: len(q)] / dt, not relaxed
        return None, False

    def _objective(self, problem: ControlProblem, q: Array) -> tuple[Array, Array]:
        """Return the Gauss-Newton Hessian (dof, dof) of all costs, with dampings, and half their gradients.

        The gradients (1 + h, dof) are those of the targets at the end of the step, and of the horizon's intervals.
        """
        dof, weight = len(q), problem.posture.weight**2
        gradient, damping = weight * (q - problem.posture.reference), np.full(dof, weight)  # of the posture
        hessian, later = np.zeros((dof, dof)), np.zeros((1 + len(problem.horizon), dof))
        for i, (targets, columns) in enumerate(zip(problem.targets, self.columns, strict=True)):
            differentials = None if problem.differentials is None else problem.differentials[i]
            parts = targets.linearize(q[None, columns], differentials)
            block = (slice(None), slice(None)) if self._whole else (columns[:, None], columns)
            hessian[block] += parts.hessian[0]
            gradient[block[1]] += parts.gradient[0]
            amount = self.lm_damping * parts.ellipsoid_square[0]
            previous = None if problem.previous_positions is None else problem.previous_positions[i]
            if previous is not None:
                offset = parts.poses[0, :3, 3] - previous
                distance = math.sqrt(offset @ offset)
                lag = distance * distance / (distance + 1e-3)  # about 1 mm is no sign of a path out of reach
                amount += targets.objective.position_weight**2 * self.reaches[i] * lag
            damping[block[1]] += amount
            predicted = problem.predicted_positions[i] if problem.horizon else None
            if predicted is not None and targets.positions is not None:
                moved = targets.positions - predicted
                later[1:, block[1]] += targets.objective.position_weight**2 * moved @ parts.jacobian[0, :3]
        for cost in self._costs:
            time = np.array([problem.time])
            residual, jacobian = cost.residual(q[None], time)[0], cost.jacobian(q[None], time)[0]
            hessian += jacobian.T @ jacobian
            gradient += residual @ jacobian
        hessian.reshape(-1)[:: dof + 1] += damping + 1e-12  # the diagonal
        return hessian, gradient + later


def _require_fitting(limit: Limit, name: str, group: ArmGroup) -> None:
    """Raise InvalidInputError unless a limit can be computed for the joints."""
    try:
        matrix, bound = map(np.asarray, limit.inequalities(group.sample(1, 0)[0], 0.01))
    except Exception as error:  # user code may raise anything
        raise InvalidInputError(
            f"{name} cannot be computed for {group.name!r}: {type(error).__name__}: {error}; found {limit!r}"
        ) from error
    if bound.ndim != 1 or matrix.shape != (len(bound), group.dof):
        raise InvalidInputError(
            f"{name}.inequalities must have shapes (k, {group.dof}) and (k,), one column for each joint of "
            f"{group.name!r}; found {matrix.shape} and {bound.shape}"
        )
