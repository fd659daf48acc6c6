"""Joint descent in a placement and the trajectories there: banded Gauss-Newton with the placement as a border.

The numbers of a placement act like joints: a path that turns is an arm that turns the other way. The normal equations
of trajectory q and placement p, of several arms with a q for each,

    [A  B] [q]     [g]
    [Bᵀ C] [p] = − [h],

are solved for the placement first, (C − Bᵀ A⁻¹ B) p = Bᵀ A⁻¹ g − h, where A is banded.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from maniport.motion.kernels import add_log_residual, add_residual
from maniport.motion.objective import Targets
from maniport.motion.placement.problem import SIZE, ArmPath, PlacementProblem
from maniport.motion.plan.optimizer import TrajectoryCost, TrajectoryTerms, descend
from maniport.spd.kernels import compose
from maniport.util.validation import Array

State = tuple[Array, tuple[Array, ...]]  # A placement (7,) and joint positions (n, dof) of each arm


def descend_jointly(
    problem: PlacementProblem, place: Array, q: tuple[Array, ...], terms: Sequence[TrajectoryTerms]
) -> State:
    """Descend in a placement and the trajectories there."""
    joint = JointProblem(problem, terms)
    start = tuple(cost.within(positions) for cost, positions in zip(joint.costs, q, strict=True))
    return descend(joint, (place, start), terms[0].rel_tol)


class BorderedSlopes(NamedTuple):
    """Slopes of a trajectory, and those in the free numbers of its placement."""

    gradient: Array
    hessian: Array
    band: Array
    h: Array  # (k,)
    mixed: Array  # B, (n, dof, k)
    square: Array  # C, (k, k)


class JointProblem:
    """Cost of a placement and the trajectories there."""

    def __init__(self, problem: PlacementProblem, terms: Sequence[TrajectoryTerms]):
        self.problem = problem
        self.waypoints = [MovingPathCost(arm) for arm in problem.arms]
        self.costs = [
            TrajectoryCost(arm.objective.arm, waypoints, problem.time, own)
            for arm, waypoints, own in zip(problem.arms, self.waypoints, terms, strict=True)
        ]

    def evaluate(self, state: State) -> tuple[float, list[BorderedSlopes]]:
        """Cost, and slopes of each arm."""
        (place, trajectories), free = state, self.problem.free
        total, slopes = 0.0, []
        for waypoints, cost, q in zip(self.waypoints, self.costs, trajectories, strict=True):
            waypoints.move(place)
            value, (gradient, blocks, band) = cost.evaluate(q)
            total, weights, dof = total + value, cost.weights, q.shape[1]
            border = waypoints.hessian[:, :, dof:][:, :, free]
            slopes.append(
                BorderedSlopes(
                    gradient,
                    blocks,
                    band,
                    weights @ waypoints.gradient[:, dof:][:, free],
                    weights[:, None, None] * border[:, :dof],
                    np.tensordot(weights, border[:, dof:][:, free], 1),
                )
            )
        return total, slopes

    def trial(self, state: State, slopes: list[BorderedSlopes], damping: float) -> tuple[State, float]:
        """State after a damped step, within the limits, and the expected decrease of the cost."""
        (place, trajectories), free = state, self.problem.free
        h, square = np.sum([arm.h for arm in slopes], axis=0), np.sum([arm.square for arm in slopes], axis=0)
        inner, pull, solutions, damped = square, h, [], []
        for cost, q, arm in zip(self.costs, trajectories, slopes, strict=True):
            own = damping * (np.einsum("nii->ni", arm.hessian) + arm.band[0])
            sides = np.concatenate([arm.gradient[..., None], arm.mixed], axis=2)
            solution = cost.solve(sides, arm.hessian, arm.band, cost.blocked(q, arm.gradient), own)
            inner = inner - np.tensordot(arm.mixed, solution[..., 1:], ((0, 1), (0, 1)))
            pull = pull - np.tensordot(solution[..., 0], arm.mixed, 2)
            solutions.append(solution)
            damped.append(own)
        at, lower, upper = place[free], self.problem.lower[free], self.problem.upper[free]
        weight = np.diag(square)
        loose = ~(((at <= lower) & (h > 0.0)) | ((at >= upper) & (h < 0.0)) | (weight <= 0.0))
        inner = inner + np.diag((damping + 1e-9) * weight)  # path and arm may turn together at no cost
        step = np.zeros(len(at))
        step[loose] = -np.linalg.solve(inner[np.ix_(loose, loose)], pull[loose])
        moved = place.copy()
        moved[free] = np.clip(at + step, lower, upper)
        moved = self.problem.within(moved[None])[0][0]
        expected = float(step @ (damping * weight * step - h))
        trial = []
        for cost, q, solution, own, arm in zip(self.costs, trajectories, solutions, damped, slopes, strict=True):
            change = -(solution[..., 0] + solution[..., 1:] @ step)
            expected += float(np.sum(change * (own * change - arm.gradient)))
            trial.append(cost.within(q + change))
        return (moved, tuple(trial)), expected


class MovingPathCost:
    """Waypoint cost of a path at a variable placement; its derivatives have the placement after the joints."""

    targets: Targets
    gradient: Array
    hessian: Array

    def __init__(self, arm: ArmPath):
        self.arm = arm

    def move(self, place: Array) -> None:
        """Move the path to a placement (7,)."""
        self.targets = self.arm.targets(place)
        self._shifts, self._generators = self.arm.derivatives(place)

    def evaluate(self, q: Array) -> tuple[Array, Array, Array]:
        """As `Targets.evaluate`; all derivatives are kept in `gradient` and `hessian`."""
        targets, dof = self.targets, q.shape[1]
        values, vectors, singular, changes, jacobian, poses = targets.differentials(q)
        assert targets.positions is not None
        assert poses is not None
        achieved = targets.root @ compose(values, vectors) @ targets.root
        turned = achieved[:, None] @ self._generators - self._generators @ achieved[:, None]
        weight = targets.objective.position_weight
        error = weight * (poses[:, :3, 3] - targets.positions)
        error_slopes = weight * np.concatenate([jacobian[:, :3], -self._shifts], axis=2)
        n, count = len(q), dof + SIZE
        square, self.gradient, self.hessian = np.zeros(n), np.zeros((n, count)), np.zeros((n, count, count))
        changes = np.concatenate([changes, turned], axis=1)
        add_log_residual(values, vectors, targets.whitening, changes, square, self.gradient, self.hessian)
        add_residual(error, error_slopes, self.gradient, self.hessian)
        square += np.sum(error**2, axis=1)
        return np.sqrt(np.where(singular, np.inf, square)), self.gradient[:, :dof], self.hessian[:, :dof, :dof]
