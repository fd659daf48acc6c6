"""The compiled search for the joint angles of one frame."""

import numpy as np

from maniport.demonstrations.frame_kernel import frame_terms
from maniport.jit import kernel
from maniport.tracking.kernels import step_within_limits


@kernel
def evaluate(q, targets, weights, body, pull, neutral, mean, prior, gradient, hessian):  # type: ignore[no-untyped-def]
    """Cost of `search` and |r|²; its halved gradient, and its halved second derivative without the prior."""
    coupling, offset, products, places, slides, joints, vectors, ends = body
    gradient[:], hessian[:] = 0.0, 0.0
    square = frame_terms(
        q, coupling, offset, products, places, slides, joints, vectors, ends, targets, weights, gradient, hessian
    )
    cost = square
    for i in range(len(q)):
        off = pull[i] * (q[i] - neutral[i])
        cost += off * (q[i] - neutral[i])
        gradient[i] += off
        hessian[i, i] += pull[i]
        off = 0.0
        for j in range(len(q)):
            off += prior[i, j] * (q[j] - mean[j])
        cost += off * (q[i] - mean[i])
        gradient[i] += off
    return cost, square


@kernel
def search(q, targets, weights, body, held, mean, prior, max_iterations, gain, hessian):  # type: ignore[no-untyped-def]
    """Move q (dof,) to where |r(q)|² + |p (q − q₀)|² + (q − mean)ᵀ prior (q − mean) is least within the limits.

    Levenberg's method: little damping as long as each step lowers the cost. A step that moves no joint by 1e-7 rad is
    the last.
    """
    lower, upper, pull, neutral = held
    dof = len(q)
    gradient, whole, expected = np.empty((1, dof)), np.empty((1, dof, dof)), np.empty(1)
    trial, damping = np.empty((1, dof)), np.full(1, 1e-9)
    slopes, curves = np.empty(dof), np.empty((dof, dof))
    here = np.empty((1, dof))
    cost, square = evaluate(q, targets, weights, body, pull, neutral, mean, prior, gradient[0], hessian)
    for _ in range(max_iterations):
        here[0], whole[0] = q, hessian + prior
        step_within_limits(here, gradient, whole, damping, lower, upper, trial, expected)
        moved = np.abs(trial[0] - q).max()
        new_cost, new_square = evaluate(trial[0], targets, weights, body, pull, neutral, mean, prior, slopes, curves)
        if new_cost < cost:
            gained = cost - new_cost
            q[:], gradient[0], hessian[:] = trial[0], slopes, curves
            cost, square = new_cost, new_square
            damping *= 0.2
            if moved < 1e-7 or gained < gain * cost:
                break
        elif moved < 1e-7:
            break
        else:
            damping[:] = max(1e-3, 8.0 * damping[0])
    return square
