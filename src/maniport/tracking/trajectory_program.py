"""A whole motion as one nonlinear program, solved by IPOPT through CasADi.

Joint positions are a cubic spline with a knot at every time. Its derivatives are splines too, and a spline lies within
the hull of its coefficients (de Boor, A Practical Guide to Splines, 2001, ch. IX): limits on the coefficients of
position, velocity and acceleration hold at all times, not only at the knots.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.interpolate import BSpline, make_lsq_spline

from maniport.bodies import Arm
from maniport.tracking.symbolic_chain import symbolic_kinematics
from maniport.tracking.symbolic_distance import log_vector
from maniport.validation import Array

PATH_PRICE = 1000.0
"""What a metre beside the path costs, in units of squared distance [1/m]: more than it can save, so that the hand is on
the path wherever the arm can have it there."""
WORDS = {
    "Solve_Succeeded": "converged",
    "Solved_To_Acceptable_Level": "converged to a looser tolerance",
    "Maximum_Iterations_Exceeded": "stopped at the largest number of iterations",
    "Infeasible_Problem_Detected": "found no motion within the limits",
    "Restoration_Failed": "could not restore the limits",
    "Search_Direction_Becomes_Too_Small": "stopped where no step brings more",
    "Maximum_WallTime_Exceeded": "stopped at the time limit",
    "User_Requested_Stop": "interrupted",
    "Invalid_Number_Detected": "met a singular configuration; a larger floor avoids it",
}


@dataclass(frozen=True)
class Program:
    """What is asked; shapes as in `maniport.tracking.offline.optimize_trajectory`, checked.

    Attributes
    ----------
    arm : Arm
    part : str
    joint_weights : ndarray, shape (dof,), or None
    floor : float
    time : ndarray, shape (n,)
    whitening : ndarray, shape (n, d, d)
        A^-½ of the wanted ellipsoids A, floor included.
    weights : ndarray, shape (n, m, m), or None
    path : ndarray, shape (n, 3), or None
    free_offset : bool
    speeds, accelerations : ndarray, shape (dof,)
        Largest ones; infinite where there is no limit.
    smoothness : float
    """

    arm: Arm
    part: str
    joint_weights: Array | None
    floor: float
    time: Array
    whitening: Array
    weights: Array | None
    path: Array | None
    free_offset: bool
    speeds: Array
    accelerations: Array
    smoothness: float


@dataclass(frozen=True)
class Solution:
    """Spline of the joint positions, offset of the path (3,), and how the solver ended."""

    spline: BSpline
    offset: Array
    status: str
    converged: bool
    iterations: int


def solve(program: Program, start: Array, tol: float, max_iter: int) -> Solution:
    """Minimize from joint positions at all times, shape (n, dof)."""
    import casadi as ca

    time, dof, n = program.time, program.arm.dof, len(program.time)
    knots = np.concatenate([np.repeat(time[0], 3), time, np.repeat(time[-1], 3)])
    at, derivatives = BSpline.design_matrix(time, knots, 3).toarray(), _derivatives(knots)
    c, q = ca.MX.sym("c", dof, n + 2), ca.MX.sym("q", dof, n)
    beside, offset = ca.MX.sym("s", 6, n if program.path is not None else 0), ca.MX.sym("o", 3)
    squares, hands, curvature = _pointwise(program)
    data = _columns(program)

    jerk = ca.mtimes(c, ca.sparsify(ca.DM(derivatives[2])).T)
    share = ca.DM(np.diff(time) / (time[-1] - time[0]) / dof)
    smooth = program.smoothness * ca.dot(jerk**2, ca.repmat(share.T, dof, 1))
    cost = ca.sum2(squares.map(n)(q, data)) / n + smooth
    rows = [ca.vec(q - ca.mtimes(c, ca.sparsify(ca.DM(at)).T))]
    lower, upper = [np.zeros(n * dof)], [np.zeros(n * dof)]
    for matrix, limits in zip(derivatives, (program.speeds, program.accelerations), strict=False):
        known = np.flatnonzero(np.isfinite(limits))
        if len(known):
            rows.append(ca.vec(ca.mtimes(c[known.tolist(), :], ca.sparsify(ca.DM(matrix)).T)))
            upper.append(np.tile(limits[known], len(matrix)))
            lower.append(-upper[-1])
    if program.path is not None:
        cost += PATH_PRICE / n * ca.sum1(ca.vec(beside))
        away = hands.map(n)(q) - ca.DM(program.path.T) - ca.repmat(offset, 1, n)
        rows.append(ca.vec(away - beside[:3, :] + beside[3:, :]))
        lower.append(np.zeros(3 * n))
        upper.append(np.zeros(3 * n))

    x, g = ca.vertcat(ca.vec(c), ca.vec(q), ca.vec(beside), offset), ca.vertcat(*rows)
    weight, multipliers = ca.MX.sym("w"), ca.MX.sym("l", g.numel())
    pull = ca.reshape(multipliers[-3 * n :], 3, n) if program.path is not None else ca.MX.zeros(3, n)
    blocks = curvature.map(n)(q, data, weight / n, pull)
    hessian = ca.diagcat(
        weight * ca.hessian(smooth, c)[0], *ca.horzsplit(blocks, dof), ca.MX(beside.numel() + 3, beside.numel() + 3)
    )
    names = ["x", "p", "lam_f", "lam_g"]
    options = {
        "print_time": False,
        "hess_lag": ca.Function(
            "nlp_hess_l", [x, ca.MX.sym("p", 0), weight, multipliers], [ca.triu(hessian)], names, ["triu_hess_gamma_x_x"]
        ),
        "ipopt": {
            "print_level": 0, "sb": "yes", "tol": tol, "max_iter": max_iter, "bound_relax_factor": 0.0,
            "mu_init": MU_INIT, "mu_strategy": MU,
        },
    }  # fmt: skip
    solver = ca.nlpsol("trajectory", "ipopt", {"x": x, "f": cost, "g": g}, options)

    first, limits = _first(program, start, knots, hands), program.arm
    shift = np.full(3, np.inf if program.free_offset else 0.0)
    count = beside.numel()
    found = solver(
        x0=first,
        lbx=np.concatenate([np.tile(limits.lower, 2 * n + 2), np.zeros(count), -shift]),
        ubx=np.concatenate([np.tile(limits.upper, 2 * n + 2), np.full(count, np.inf), shift]),
        lbg=np.concatenate(lower),
        ubg=np.concatenate(upper),
    )
    values, stats = np.asarray(found["x"]).ravel(), solver.stats()
    coefficients = values[: (n + 2) * dof].reshape(n + 2, dof)
    word = WORDS.get(stats["return_status"], stats["return_status"].replace("_", " ").lower())
    return Solution(
        BSpline(knots, np.clip(coefficients, limits.lower, limits.upper), 3),
        values[-3:],
        word,
        bool(stats["success"]),
        int(stats["iter_count"]),
    )


def _pointwise(program: Program) -> tuple[Any, Any, Any]:
    """CasADi functions of one point: squared distance, hand position, and the Hessian of their weighted sum."""
    import casadi as ca

    d = program.whitening.shape[-1]
    q, data = ca.SX.sym("q", program.arm.dof), ca.SX.sym("d", len(_data_of_point(program, 0)))
    pose, jacobian = symbolic_kinematics(program.arm, q)
    rows = {"translation": slice(0, 3), "rotation": slice(3, 6), "full": slice(0, 6)}[program.part]
    weighted = jacobian[rows, :]
    if program.joint_weights is not None:
        weighted = ca.mtimes(weighted, ca.diag(ca.DM(program.joint_weights)))
    whitened = ca.mtimes(ca.reshape(data[: d * d], d, d), weighted)
    lift = program.floor * ca.mtimes(ca.reshape(data[: d * d], d, d), ca.reshape(data[: d * d], d, d).T)
    residual = log_vector(ca.mtimes(whitened, whitened.T) + lift)
    if program.weights is None:
        square = ca.sumsqr(residual)
    else:
        metric = ca.reshape(data[d * d :], residual.numel(), residual.numel())
        square = ca.dot(residual, ca.mtimes(metric, residual))
    weight, pull = ca.SX.sym("w"), ca.SX.sym("l", 3)
    hand = pose[:3, 3]
    hessian = ca.hessian(weight * square + ca.dot(pull, hand), q)[0]
    return (
        ca.Function("square", [q, data], [square]),
        ca.Function("hand", [q], [hand]),
        ca.Function("curvature", [q, data, weight, pull], [ca.densify(hessian)]),
    )


def _columns(program: Program) -> Any:
    import casadi as ca

    return ca.DM(np.column_stack([_data_of_point(program, i) for i in range(len(program.time))]))


def _data_of_point(program: Program, i: int) -> Array:
    metric = [] if program.weights is None else program.weights[i].ravel()
    return np.concatenate([program.whitening[i].ravel(), metric])


def _derivatives(knots: Array) -> list[Array]:
    """Matrices from the coefficients of a cubic spline to those of its first, second and third derivatives."""
    count = len(knots) - 4
    spline = BSpline(knots, np.eye(count), 3)
    return [spline.derivative(order).c[: count - order] for order in (1, 2, 3)]


def _first(program: Program, start: Array, knots: Array, hands: Any) -> Array:
    """First values of all variables: a spline near the starting motion, and how far its hand is beside the path."""
    n = len(start)
    spread = np.linspace(program.time[0], program.time[-1], 4 * n)
    dense = np.stack([np.interp(spread, program.time, column) for column in start.T], axis=1)
    spline = make_lsq_spline(spread, dense, knots, 3)
    c = np.clip(spline.c, program.arm.lower, program.arm.upper)
    q = BSpline(knots, c, 3)(program.time)
    if program.path is None:
        return np.concatenate([c.ravel(), q.ravel(), np.zeros(3)])
    away = np.asarray(hands.map(n)(q.T)).T - program.path
    beside = np.concatenate([np.maximum(away, 0.0), np.maximum(-away, 0.0)], axis=1)
    return np.concatenate([c.ravel(), q.ravel(), beside.ravel(), np.zeros(3)])
MU_INIT, MU = 1e-3, "monotone"
