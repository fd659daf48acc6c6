"""What is compiled: the joint angles of one frame, and what they tell the next one."""

import numpy as np

from maniport.demonstrations.frame_kernel import frame_terms
from maniport.jit import kernel
from maniport.tracking.kernels import step_within_limits

STILL = 1e-7
"""A step that moves no joint farther is the last [rad]."""
LEAST_DAMPING, DAMPING = 1e-9, 1e-3
"""Of the search, as long as each step lowers the cost, and once one does not."""


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
def search(q, targets, weights, body, held, mean, prior, most, gain, hessian):  # type: ignore[no-untyped-def]
    """Move q (dof,) to where |r(q)|² + |p (q − q₀)|² + (q − mean)ᵀ prior (q − mean) is least within the limits."""
    lower, upper, pull, neutral = held
    dof = len(q)
    gradient, whole, expected = np.empty((1, dof)), np.empty((1, dof, dof)), np.empty(1)
    trial, damping = np.empty((1, dof)), np.full(1, LEAST_DAMPING)
    slopes, curves = np.empty(dof), np.empty((dof, dof))
    here = np.empty((1, dof))
    cost, square = evaluate(q, targets, weights, body, pull, neutral, mean, prior, gradient[0], hessian)
    for _ in range(most):
        here[0], whole[0] = q, hessian + prior
        step_within_limits(here, gradient, whole, damping, lower, upper, trial, expected)
        moved = np.abs(trial[0] - q).max()
        new_cost, new_square = evaluate(trial[0], targets, weights, body, pull, neutral, mean, prior, slopes, curves)
        if new_cost < cost:
            gained = cost - new_cost
            q[:], gradient[0], hessian[:] = trial[0], slopes, curves
            cost, square = new_cost, new_square
            damping *= 0.2
            if moved < STILL or gained < gain * cost:
                break
        elif moved < STILL:
            break
        else:
            damping[:] = max(DAMPING, 8.0 * damping[0])
    return square


@kernel
def show(positions, linear, needed, segments, forward, shortest, targets):  # type: ignore[no-untyped-def]
    """Write the directions (k, 3) that points (n, 3) show, in the axes of the trunk; return whether the arm is seen."""
    for p in range(len(positions)):
        if needed[p] and np.isnan(positions[p, 0] + positions[p, 1] + positions[p, 2]):
            return False
    k = len(targets)
    vectors = np.zeros((k + 2, 3))
    for i in range(k + 2):
        for p in range(len(positions)):
            if linear[i, p] != 0.0:
                for j in range(3):
                    vectors[i, j] += linear[i, p] * positions[p, j]
    axes = np.empty((3, 3))
    up, across = vectors[k], vectors[k + 1]
    if not shorten(up, shortest):
        return False
    across -= (across[0] * up[0] + across[1] * up[1] + across[2] * up[2]) * up
    if not shorten(across, shortest):
        return False
    first, second = (up, across) if forward else (across, up)
    for j in range(3):
        n, m = (j + 1) % 3, (j + 2) % 3
        axes[1 if forward else 0, j] = first[n] * second[m] - first[m] * second[n]
        axes[0 if forward else 1, j], axes[2, j] = across[j], up[j]
    for i in range(k):
        shorten(vectors[i], 0.0)
        for j in range(3):
            targets[i, j] = vectors[i, 0] * axes[j, 0] + vectors[i, 1] * axes[j, 1] + vectors[i, 2] * axes[j, 2]
        if i < segments and np.isnan(targets[i, 0] + targets[i, 1] + targets[i, 2]):
            return False
    return True


@kernel
def leaping(before, targets, angle, angles):  # type: ignore[no-untyped-def]
    """Whether one of the first unit vectors turns from `before` (k, 3) by more than an angle and than its own (m,)."""
    for i in range(len(angles)):
        square = 0.0
        for j in range(3):
            square += (targets[i, j] - before[i, j]) ** 2
        if 2.0 * np.arcsin(min(0.5 * np.sqrt(square), 1.0)) > max(angle, angles[i]):
            return True
    return False


@kernel
def shorten(vector, shortest):  # type: ignore[no-untyped-def]
    """Make a vector (3,) one of length one, of nan where it is not longer than `shortest`; return whether it is."""
    length = np.sqrt(vector[0] ** 2 + vector[1] ** 2 + vector[2] ** 2)
    longer = length > shortest
    vector /= length if longer else np.nan
    return longer


@kernel
def predict(q, velocity, covariance, dt, slower, noise):  # type: ignore[no-untyped-def]
    """Go on for a time dt: q by the velocity, which falls to `slower` of it; `noise` is the accelerations' variance."""
    n = len(q)
    for i in range(n):
        q[i] += dt * velocity[i]
        velocity[i] *= slower
    for i in range(n):
        for j in range(2 * n):
            covariance[i, j] += dt * covariance[n + i, j]
    for i in range(2 * n):
        for j in range(n):
            covariance[i, j] += dt * covariance[i, n + j]
    for i in range(n):
        for j in range(2 * n):
            covariance[n + i, j] *= slower
    for i in range(2 * n):
        for j in range(n):
            covariance[i, n + j] *= slower
    for i in range(n):
        covariance[i, i] += dt**4 * noise[i]
        covariance[i, n + i] += dt**3 * noise[i]
        covariance[n + i, i] += dt**3 * noise[i]
        covariance[n + i, n + i] += dt**2 * noise[i]


@kernel
def learn(covariance, information):  # type: ignore[no-untyped-def]
    """Make the covariance (2n, 2n) that of what is known with an information (n, n) of the first n."""
    n = len(information)
    first = covariance[:n].copy()
    gain = np.linalg.solve(np.eye(n) + information @ first[:, :n].copy(), information @ first)
    left = covariance - first.T.copy() @ gain
    covariance[:] = 0.5 * (left + left.T)


@kernel
def follow(  # type: ignore[no-untyped-def]
    q, velocity, covariance, dt, slower, noise, targets, weights, body, held, most, gain, floor
):
    """Move angles, velocities and covariance on by dt and to what a frame shows; return |r|² there."""
    n = len(q)
    targets, weights = targets.copy(), weights.copy()
    for i in range(len(targets)):
        if np.isnan(targets[i, 0]):
            targets[i], weights[i] = 0.0, 0.0
    predict(q, velocity, covariance, dt, slower, noise)
    for i in range(n):
        q[i] = min(max(q[i], held[0][i]), held[1][i])
    mean, information = q.copy(), np.empty((n, n))
    prior = np.linalg.inv(covariance[:n, :n].copy())
    square = search(q, targets, weights, body, held, mean, prior, most, gain, information)
    velocity += covariance[n:, :n].copy() @ (prior @ (q - mean))
    for i in range(n):
        if (q[i] <= held[0][i] and velocity[i] < 0.0) or (q[i] >= held[1][i] and velocity[i] > 0.0):
            velocity[i] = 0.0
        information[i, i] += floor
    learn(covariance, information)
    return square
