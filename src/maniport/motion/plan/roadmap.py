"""Roadmap of a path: many configurations at each of its stages, and the best sequence of them by graph search."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from maniport.arms import Arm
from maniport.motion.costs.cost import NormalEquations
from maniport.motion.plan.optimizer import time_weights
from maniport.motion.problem import SEARCH_WEIGHT, ArmProblem
from maniport.util.jit import kernel
from maniport.util.validation import Array

IN_PLACE = 1e-4  # Largest position error of a node that counts as on the path [m]
NEWTON_STEPS = 4
LARGEST_CHANGE = {"rad": 1.0, "m": 0.3}
"""Change of a joint from stage to stage above which it jumps. With 0.6 rad and 0.2 m, force ellipsoids of UR5 and
G1 are 8 and 12 % farther from their targets."""
JOINT_MOTION_WEIGHT = (
    0.3  # Weight of squared joint velocities relative to d²; with 0.02 the motion is 1 % worse
)


@dataclass(frozen=True)
class Roadmap:
    """Configurations at the stages of a path, sorted by stage."""

    q: Array  # (n, dof)
    cost: Array  # (n,), by the objective
    # (stages + 1,); nodes of stage s are first[s] to first[s + 1], at least one
    first: NDArray[np.intp]

    def without(self, bad: NDArray[np.bool_]) -> "Roadmap":
        """Drop bad nodes, except at stages that have no others."""
        owner = np.repeat(np.arange(len(self.first) - 1), np.diff(self.first))
        kept = ~bad | ~np.isin(owner, owner[~bad])
        return Roadmap(
            self.q[kept], self.cost[kept], np.searchsorted(owner[kept], np.arange(len(self.first)))
        )


def stages_of(time: Array, longest: float) -> NDArray[np.intp]:
    """Rows of waypoints at most `longest` [s] apart where the waypoints allow, the first and last included."""
    rows = [0]
    last = len(time) - 1
    for i in range(1, last + 1):
        if i == last or time[i + 1] - time[rows[-1]] > longest:
            rows.append(i)
    return np.array(rows)


def shortest_path(
    nodes: Roadmap, time: Array, largest: Array, joint_motion_weight: float = JOINT_MOTION_WEIGHT
) -> NDArray[np.intp]:
    """Choose a node for each stage with the least sum of cost and joint motion; penalize jumps, beyond `largest`."""
    gaps = np.diff(time, prepend=time[0])
    weights = time_weights(time)
    first = nodes.first
    value = np.full(len(nodes.q), np.inf)
    before = np.full(len(nodes.q), -1, np.intp)
    value[first[0] : first[1]] = nodes.cost[first[0] : first[1]] * weights[0]
    for stage in range(1, len(weights)):
        order = first[stage - 1] + np.argsort(value[first[stage - 1] : first[stage]])
        here = slice(first[stage], first[stage + 1])
        weight = joint_motion_weight / gaps[stage]
        _fill_stage(nodes.q, order, here.start, here.stop, weight, largest[stage], value, before)
        value[here] += nodes.cost[here] * weights[stage]
    chosen = np.empty(len(first) - 1, np.intp)
    chosen[-1] = first[-2] + np.argmin(value[first[-2] : first[-1]])
    for stage in range(len(chosen) - 1, 0, -1):
        chosen[stage - 1] = before[chosen[stage]]
    return chosen


@kernel
def _fill_stage(
    q: Array,
    order: NDArray[np.intp],
    begin: int,
    end: int,
    weight: float,
    largest: Array,
    value: Array,
    before: NDArray[np.intp],
    jump_penalty: float = 1000.0,
) -> None:
    """Fill the least cost of a path to each node from `begin` to `end`, its own left out, and the node before it."""
    for k in range(begin, end):
        best = np.inf
        chosen = order[0]
        for n in range(len(order)):
            i = order[n]
            total = value[i]
            if total >= best:
                break
            for j in range(q.shape[1]):
                change = abs(q[k, j] - q[i, j])
                total += weight * change * change
                if change > largest[j]:
                    total += jump_penalty * ((change / largest[j]) ** 2 - 1.0)
                if total >= best:
                    break
            if total < best:
                best = total
                chosen = i
        value[k] = best
        before[k] = chosen


def moved_to_positions(arm: Arm, q: Array, positions: Array) -> tuple[Array, Array]:
    """Bring end effectors to positions (n, 3) by Newton steps within the limits; return q and position errors (n,)."""
    q, rows, error = q.copy(), np.arange(len(q)), np.full(len(q), np.inf)
    for step in range(NEWTON_STEPS + 1):
        poses, jacobians = arm.motion(q[rows])
        offset = positions[rows] - poses[:, :3, 3]
        error[rows] = np.linalg.norm(offset, axis=1)
        far = error[rows] > IN_PLACE
        if step == NEWTON_STEPS or not far.any():
            break
        rows = rows[far]
        offset = offset[far]
        jacobian = jacobians[far, :3]
        square = jacobian @ np.swapaxes(jacobian, 1, 2)
        square += 1e-6 * np.trace(square, axis1=1, axis2=2)[:, None, None] * np.eye(3)
        change = np.swapaxes(jacobian, 1, 2) @ np.linalg.solve(square, offset[..., None])
        q[rows] = _stepped(arm, q[rows], change[..., 0])
    return q, error


def turned_to_rotations(problem: ArmProblem, q: Array) -> Array:
    """Turn end effectors at q (n, dof) toward their target rotations, and bring them near their positions."""
    arm = problem.arm
    pose_costs = problem.with_position_weight(SEARCH_WEIGHT).pose_costs
    for _ in range(NEWTON_STEPS):
        at = problem.at(q)
        equations = NormalEquations.zeros(*q.shape)
        equations.hessian[:] = np.eye(arm.dof)  # a little weight on motion
        for cost in pose_costs:
            equations.add(cost, at)
        change = -np.linalg.solve(equations.hessian, equations.gradient[..., None])[..., 0]
        q = _stepped(arm, q, change)
    return q


def _stepped(arm: Arm, q: Array, change: NDArray[np.floating], longest: float = 0.3) -> Array:
    """Change no joint by more than `longest`, within the limits."""
    size = np.maximum(np.abs(change).max(axis=1, keepdims=True), 1e-12)
    return np.asarray(np.clip(q + change * np.minimum(1.0, longest / size), arm.lower, arm.upper))
