"""One control step: a quadratic program on the costs of a motion problem, within hard limits.

With the costs f(q) = Σ |r(q)|² linearized at the present configuration, the displacement Δq of a step minimizes

    Σ |r + J Δq|² + w² |q + Δq − q_ref|² + Σ_arms (λ d² + μ) |Δq_arm|²

within the limits. d is the distance of an arm's ellipsoid to its target and λ the Levenberg-Marquardt damping. An arm
whose path is out of reach moves calmly by the damping μ = w_p² R e, with the weight w_p of position errors, the reach R
of the arm, and the distance e of the end effector from its previous target.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import daqp
import numpy as np

from maniport.arms import Arm, ArmGroup, as_group
from maniport.errors import InvalidInputError
from maniport.motion.costs.cost import Cost
from maniport.motion.costs.posture import PostureCost
from maniport.motion.limits import BrakingLimit, CollisionLimit, Limit
from maniport.motion.objective import Targets
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
        False if the last step had no collision-free solution and the arm braked.
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
    previous_positions : tuple of ndarray, shape (3,), or None
        Target positions of each arm in the last step [m].
    posture : PostureCost
        Reference configuration.
    time : float
        Time of further costs [s].
    """

    targets: tuple[Targets, ...]
    previous_positions: tuple[Array | None, ...]
    posture: PostureCost
    time: float = 0.0


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
        samples = [own.forward(own.sample(64, 0))[:, :3, 3] for own in group.arms]
        self.reaches = tuple(float(np.linalg.norm(tips, axis=1).max()) for tips in samples)  # from the base [m]
        for i, limit in enumerate(limits):
            _require_fitting(limit, f"limits[{i}]", group)

    def step(self, problem: ControlProblem, state: ControlState, dt: float, speed_share: float = 1.0) -> ControlState:
        """Move for dt [s], or brake where the quadratic program has no solution or the solution collides.

        `speed_share` is the share of the velocity limits that may be used.
        """
        bounds = self._bounds(state, dt, speed_share)
        velocity = self._solve(problem, state.q, bounds, dt)
        if velocity is None:
            return self.brake(state, dt)
        velocity, configurations = self.braking.move(state.q, velocity, bounds, dt)
        if self.collisions is not None and self.collisions.collisions.collides(configurations).any():
            return self.brake(state, dt)
        return ControlState(configurations[0], velocity, dt)

    def brake(self, state: ControlState, dt: float) -> ControlState:
        """Come to rest as soon as accelerations allow."""
        bounds = self._bounds(state, dt, 1.0)
        velocity, configurations = self.braking.move(state.q, np.zeros(len(state.q)), bounds, dt)
        return ControlState(configurations[0], velocity, dt, solved=False)

    def _bounds(self, state: ControlState, dt: float, speed_share: float) -> Array:
        last_dt = dt if state.dt is None else state.dt
        return self.braking.bounds(state.q, state.velocity, last_dt, dt, speed_share)

    def _solve(self, problem: ControlProblem, q: Array, bounds: Array, dt: float) -> Array | None:
        """Return the best velocities within all limits, shape (dof,), or None."""
        hessian, gradient = self._objective(problem, q)
        if not math.isfinite(hessian.sum() + gradient.sum()):  # an ellipsoid is singular
            return None
        rows, upper = [np.empty((0, len(q)))], [dt * bounds[1]]
        for limit in self._limits:
            matrix, bound = limit.inequalities(q, dt)
            rows.append(matrix)
            upper.append(bound)
        above = np.concatenate(upper)
        below = np.full(len(above), -1e30)  # no lower bound
        below[: len(q)] = dt * bounds[0]
        sense = np.zeros(len(above), dtype=np.int32)
        step, _, exit_flag, _ = daqp.solve(hessian, gradient, np.concatenate(rows), above, below, sense)
        return step / dt if exit_flag > 0 and np.isfinite(step).all() else None

    def _objective(self, problem: ControlProblem, q: Array) -> tuple[Array, Array]:
        """Return the Gauss-Newton Hessian (dof, dof) and half the gradient (dof,) of all costs, with dampings."""
        dof, time, weight = len(q), np.array([problem.time]), problem.posture.weight**2
        gradient, damping = weight * (q - problem.posture.reference), np.full(dof, weight)  # of the posture
        hessian = np.zeros((dof, dof))
        for i, (targets, columns) in enumerate(zip(problem.targets, self.columns, strict=True)):
            parts = targets.linearize(q[None, columns])
            hessian[columns[:, None], columns] += parts.hessian[0]
            gradient[columns] += parts.gradient[0]
            amount = self.lm_damping * parts.ellipsoid_square[0]
            previous = problem.previous_positions[i]
            if previous is not None:
                offset = parts.poses[0, :3, 3] - previous
                distance = math.sqrt(offset @ offset)
                lag = distance * distance / (distance + 1e-3)  # about 1 mm is no sign of a path out of reach
                amount += targets.objective.position_weight**2 * self.reaches[i] * lag
            damping[columns] += amount
        for cost in self._costs:
            residual, jacobian = cost.residual(q[None], time)[0], cost.jacobian(q[None], time)[0]
            hessian += jacobian.T @ jacobian
            gradient += residual @ jacobian
        hessian.flat[:: dof + 1] += damping + 1e-12  # the diagonal
        return hessian, gradient


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
