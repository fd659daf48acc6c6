"""A whole motion as one nonlinear program, solved by IPOPT through CasADi.

Joint positions are a cubic spline with a knot at every time. Its derivatives are splines too, and a spline lies within
the hull of its coefficients (de Boor, A Practical Guide to Splines, 2001, ch. IX): limits on the coefficients of
position, velocity and acceleration hold at all times, not only at the knots.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.interpolate import BSpline

from maniport.bodies import Arm
from maniport.optional import casadi
from maniport.steps import Part, pieces
from maniport.tracking.objective import Objective
from maniport.tracking.offline.symbolic import constant, log_vector, symbolic_kinematics
from maniport.tracking.schedule import Schedule
from maniport.validation import Array

PATH_PRICE = 1e4
"""What a metre beside the path costs, in units of squared distance [1/m]: more than it can save, so that the tip is on
the path wherever the arm can have it there."""
BARRIERS = (1e-3, 1e-1)
"""First barrier parameters of IPOPT: a small one stays near the start. A larger one goes astray more, and is tried
where the first attempt ends with ellipsoids worse than those of the start."""
WORSE = 1.02
INTERRUPTED = "NonIpopt_Exception_Thrown"
"""How IPOPT ends when Ctrl-C was pressed: the only exception that CasADi does not turn into another status, and it
does not tell Python."""
WORDS = {
    "Solve_Succeeded": "converged",
    "Solved_To_Acceptable_Level": "converged to a looser tolerance",
    "Maximum_Iterations_Exceeded": "stopped at the largest number of iterations",
    "Infeasible_Problem_Detected": "found no motion within the limits",
    "Restoration_Failed": "could not restore the limits",
    "Search_Direction_Becomes_Too_Small": "stopped where no step brings more",
    "Maximum_WallTime_Exceeded": "stopped at the time limit",
    "User_Requested_Stop": "interrupted",
    "Invalid_Number_Detected": "met a singular configuration; more damping avoids it",
}


USUAL = 15
"""After as many iterations two thirds of the way are told: most motions take two to four times as many."""
GO_ON, STOP = 0, 1
"""What CasADi takes as answers."""


@dataclass(frozen=True)
class Program:
    """What is asked; as in `maniport.tracking.offline.offline.optimize_trajectory`, checked.

    Attributes
    ----------
    objective : Objective
        With ellipsoids of velocity.
    schedule : Schedule
    path_tolerance : float
    free_offset : bool
    speeds, accelerations : ndarray, shape (dof,)
        Largest ones; infinite where there is no limit.
    smoothness : float
    """

    objective: Objective
    schedule: Schedule
    path_tolerance: float
    free_offset: bool
    speeds: Array
    accelerations: Array
    smoothness: float

    @cached_property
    def arm(self) -> Arm:
        """The arm that shall move."""
        return self.objective.arm

    @cached_property
    def whitening(self) -> Array:
        """(A + ε I)^-½ of the target ellipsoids A, shape (n, d, d)."""
        return self.schedule.targets(self.objective).whitening


@dataclass(frozen=True)
class Solution:
    """Spline of the joint positions, offset of the path (3,), what was minimized, and how the solver ended."""

    spline: BSpline
    cost: float
    offset: Array
    status: str
    converged: bool
    iterations: int


def solve(program: Program, start: Array, tol: float, max_iter: int, tell: Part | None = None) -> Solution:
    """Minimize from joint positions at all times, shape (n, dof); `tell` takes the fraction done."""
    time, n, dof = program.schedule.time, len(program.schedule.time), program.arm.dof
    knots = np.concatenate([np.repeat(time[0], 3), time, np.repeat(time[-1], 3)])
    parts = _Parts(program, knots)
    first = parts.first(start)
    begun = parts.squares(start).sum()
    once, again = (None, None) if tell is None else pieces(tell, 4.0, 1.0)
    cost, values, stats = parts.run(first, BARRIERS[0], tol, max_iter, once)
    if parts.squares(_positions(knots, values, n, dof)(time)).sum() > WORSE * begun:
        other = parts.run(first, BARRIERS[1], tol, max_iter, again)
        cost, values, stats = other if other[0] < cost else (cost, values, stats)
    word = stats["return_status"]
    spline = _positions(knots, values, n, dof)
    return Solution(
        BSpline(knots, np.clip(spline.c, program.arm.lower, program.arm.upper), 3),
        cost,
        values[-3:],
        WORDS.get(word, word.replace("_", " ").lower()),
        bool(stats["success"]),
        int(stats["iter_count"]),
    )


class _Parts:
    """The nonlinear program in CasADi: variables, cost, constraints and their derivatives.

    The variables are the coefficients of the spline, joint positions at the times (so that what is nonlinear falls
    apart into points), how far the tip is beside the path, forth and back in each coordinate, and the offset.
    """

    def __init__(self, program: Program, knots: Array):
        ca = casadi()
        self.program, self.knots = program, knots
        n, dof, at_points = len(program.schedule.time), program.arm.dof, program.schedule.positions is not None
        c, q = ca.MX.sym("c", dof, n + 2), ca.MX.sym("q", dof, n)
        beside, offset = ca.MX.sym("s", 6, n if at_points else 0), ca.MX.sym("o", 3)
        square, tip, curvature = _pointwise(program)
        data = ca.DM(np.column_stack([_data_of_point(program, i) for i in range(n)]))
        self.tips = tip.map(n)
        self.square, self.data = square.map(n), data

        derivatives = _derivatives(knots)
        share = np.diff(program.schedule.time) / (program.schedule.time[-1] - program.schedule.time[0]) / dof
        jerk = ca.mtimes(c, constant(derivatives[2]).T)
        smooth = program.smoothness * ca.dot(jerk**2, ca.DM(np.tile(share, (dof, 1))))
        design = constant(BSpline.design_matrix(program.schedule.time, knots, 3).toarray())
        cost = ca.sum2(self.square(q, data)) / n + smooth
        rows, bounds = [ca.vec(q - ca.mtimes(c, design.T))], [np.zeros(n * dof)]
        for matrix, limits in zip(derivatives[:2], (program.speeds, program.accelerations), strict=True):
            known = np.flatnonzero(np.isfinite(limits))
            if len(known):
                rows.append(ca.vec(ca.mtimes(c[known.tolist(), :], constant(matrix).T)))
                bounds.append(np.tile(limits[known], len(matrix)))
        if program.schedule.positions is not None:
            cost += PATH_PRICE / n * ca.sum1(ca.vec(beside))
            away = self.tips(q) - ca.DM(program.schedule.positions.T) - ca.repmat(offset, 1, n)
            rows.append(ca.vec(away - beside[:3, :] + beside[3:, :]))
            bounds.append(np.full(3 * n, program.path_tolerance / np.sqrt(3.0)))  # a cube within the sphere
        self.bounds, self.count = np.concatenate(bounds), beside.numel()
        x, g = ca.vertcat(ca.vec(c), ca.vec(q), ca.vec(beside), offset), ca.vertcat(*rows)
        self.problem = {"x": x, "f": cost, "g": g}

        weight, multipliers = ca.MX.sym("w"), ca.MX.sym("l", g.numel())
        pull = ca.reshape(multipliers[-3 * n :], 3, n) if at_points else ca.MX.zeros(3, n)
        blocks = curvature.map(n)(q, data, weight / n, pull)
        linear = ca.MX(self.count + 3, self.count + 3)
        hessian = ca.diagcat(weight * ca.hessian(smooth, c)[0], *ca.horzsplit(blocks, dof), linear)
        inputs = [x, ca.MX.sym("p", 0), weight, multipliers]
        names = ["x", "p", "lam_f", "lam_g"], ["triu_hess_gamma_x_x"]
        self.hessian = ca.Function("nlp_hess_l", inputs, [ca.triu(hessian)], *names)

    def squares(self, q: Array) -> Array:
        """Squared distances at joint positions (n, dof)."""
        return np.asarray(self.square(q.T, self.data)).ravel()

    def first(self, start: Array) -> Array:
        """First values of all variables: a spline near joint positions (n, dof), and its tip beside the path."""
        program, n = self.program, len(start)
        spread = np.linspace(program.schedule.time[0], program.schedule.time[-1], 4 * n)
        dense = np.stack([np.interp(spread, program.schedule.time, column) for column in start.T], axis=1)
        nearest = np.linalg.lstsq(BSpline.design_matrix(spread, self.knots, 3).toarray(), dense, rcond=None)[0]
        c = np.clip(nearest, program.arm.lower, program.arm.upper)
        q = BSpline(self.knots, c, 3)(program.schedule.time)
        values = [c.ravel(), q.ravel()]
        if program.schedule.positions is not None:
            away = np.asarray(self.tips(q.T)).T - program.schedule.positions
            values.append(np.concatenate([np.maximum(away, 0.0), np.maximum(-away, 0.0)], axis=1).ravel())
        return np.concatenate([*values, np.zeros(3)])

    def run(
        self, first: Array, barrier: float, tol: float, max_iter: int, tell: Part | None = None
    ) -> tuple[float, Array, dict[str, Any]]:
        """Cost, values of the variables and IPOPT's statistics."""
        ca = casadi()
        options: dict[str, Any] = {
            "print_time": False,
            "hess_lag": self.hessian,
            "ipopt": {
                "print_level": 0, "sb": "yes", "tol": tol, "max_iter": max_iter, "mu_init": barrier,
                "bound_relax_factor": 0.0,
            },
        }  # fmt: skip
        watch = None if tell is None else _iteration_callback(self.problem, tell)
        if watch is not None:
            options["iteration_callback"] = watch
        arm, shift = self.program.arm, np.full(3, np.inf if self.program.free_offset else 0.0)
        copies = 2 * len(self.program.schedule.time) + 2
        found = ca.nlpsol("trajectory", "ipopt", self.problem, options)
        answer = found(
            x0=first,
            lbx=np.concatenate([np.tile(arm.lower, copies), np.zeros(self.count), -shift]),
            ubx=np.concatenate([np.tile(arm.upper, copies), np.full(self.count, np.inf), shift]),
            lbg=-self.bounds,
            ubg=self.bounds,
        )
        if watch is not None and watch.raised is not None:
            raise watch.raised
        stats = found.stats()
        if stats["return_status"] == INTERRUPTED:
            raise KeyboardInterrupt
        return float(answer["f"]), np.asarray(answer["x"]).ravel(), stats


def _positions(knots: Array, values: Array, n: int, dof: int) -> BSpline:
    return BSpline(knots, values[: (n + 2) * dof].reshape(n + 2, dof), 3)


def _pointwise(program: Program) -> tuple[Any, Any, Any]:
    """CasADi functions of one point: squared distance, tip position, and the Hessian of their weighted sum."""
    ca = casadi()
    d = program.whitening.shape[-1]
    q, data = ca.SX.sym("q", program.arm.dof), ca.SX.sym("d", len(_data_of_point(program, 0)))
    pose, jacobian = symbolic_kinematics(program.arm, q)
    spec, epsilon = program.arm.resolved(program.objective.spec), program.objective.damping.epsilon
    weighted = jacobian[spec.rows, :]
    if spec.joint_weights is not None:
        weighted = ca.mtimes(weighted, ca.diag(ca.DM(spec.weights(program.arm.dof))))
    whitening = ca.reshape(data[: d * d], d, d)
    whitened, lift = ca.mtimes(whitening, weighted), epsilon * ca.mtimes(whitening, whitening.T)
    residual = log_vector(ca.mtimes(whitened, whitened.T) + lift)
    if program.schedule.weights is None:
        square = ca.sumsqr(residual)
    else:
        metric = ca.reshape(data[d * d :], residual.numel(), residual.numel())
        square = ca.dot(residual, ca.mtimes(metric, residual))
    weight, pull = ca.SX.sym("w"), ca.SX.sym("l", 3)
    tip = pose[:3, 3]
    hessian = ca.hessian(weight * square + ca.dot(pull, tip), q)[0]
    return (
        ca.Function("square", [q, data], [square]),
        ca.Function("tip", [q], [tip]),
        ca.Function("curvature", [q, data, weight, pull], [ca.densify(hessian)]),
    )


def _data_of_point(program: Program, i: int) -> Array:
    metric = [] if program.schedule.weights is None else program.schedule.weights[i].ravel()
    return np.concatenate([program.whitening[i].ravel(), metric])


def _derivatives(knots: Array) -> list[Array]:
    """Matrices from the coefficients of a cubic spline to those of its first, second and third derivatives."""
    count = len(knots) - 4
    spline = BSpline(knots, np.eye(count), 3)
    return [spline.derivative(order).c[: count - order] for order in (1, 2, 3)]


def _iteration_callback(problem: dict[str, Any], tell: Part) -> Any:
    """Make a CasADi callback for the option ``iteration_callback``: it tells 1 − exp(−iterations / USUAL).

    Parameters
    ----------
    problem : dict
        ``"x"``, ``"f"`` and ``"g"``, as for `casadi.nlpsol`.
    tell : callable

    Returns
    -------
    casadi.Callback
        To be kept until the solver has ended. What `tell` raises stops the solver and is in ``raised`` then, since
        CasADi lets nothing through.
    """
    ca = casadi()
    sizes = {"f": 1, **dict.fromkeys(("x", "lam_x"), problem["x"].numel())}
    sizes |= dict.fromkeys(("g", "lam_g"), problem["g"].numel())

    class Iterations(ca.Callback):  # type: ignore[misc,name-defined]  # CasADi is untyped
        def __init__(self) -> None:
            ca.Callback.__init__(self)
            self.count = 0
            self.raised: BaseException | None = None
            self.construct("iterations", {})

        def get_n_in(self) -> int:
            return int(ca.nlpsol_n_out())

        def get_n_out(self) -> int:
            return 1

        def get_sparsity_in(self, i: int) -> Any:
            return ca.Sparsity.dense(sizes.get(ca.nlpsol_out(i), 0), 1)

        def eval(self, arguments: Any) -> list[int]:
            self.count += 1
            try:
                tell(1.0 - float(np.exp(-self.count / USUAL)))
            except BaseException as error:  # noqa: BLE001  # raised again by the caller; Ctrl-C too
                self.raised = error
                return [STOP]
            return [GO_ON]

    return Iterations()
