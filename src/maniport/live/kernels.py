"""Compiled steps of the estimate of a person's arm in one frame."""

import numpy as np

from maniport.arms.kernels import place_points
from maniport.motion.kernels import step_within_limits
from maniport.util.jit import kernel


@kernel
def evaluate(q, targets, weights, body, pull, neutral, mean, prior, gradient, hessian):  # type: ignore[no-untyped-def]
    """Cost of `search` and |r|²; its halved gradient, and its halved second derivative without the prior."""
    offset, placements, axes, slides, coupling, joints, vectors, points = body
    gradient[:], hessian[:] = 0.0, 0.0
    positions, values, slopes = offset.copy(), np.empty((len(joints), 3)), np.empty((len(joints), 3, len(q)))
    for j in range(len(offset)):
        for k in range(len(q)):
            positions[j] += coupling[j, k] * q[k]
    place_points(positions, placements, axes, slides, coupling, joints, vectors, points, values, slopes)
    square = 0.0
    for n in range(len(targets)):
        if weights[n] == 0.0:
            continue
        if n < points - 1:  # from a point to the next
            unit, slope = values[n + 1] - values[n], slopes[n + 1] - slopes[n]
            length = np.sqrt(unit[0] * unit[0] + unit[1] * unit[1] + unit[2] * unit[2])
            unit /= length
            stretch = unit[0] * slope[0] + unit[1] * slope[1] + unit[2] * slope[2]
            for i in range(3):
                slope[i] = (slope[i] - unit[i] * stretch) / length
        else:
            unit, slope = values[n + 1], slopes[n + 1]
        weight = weights[n] * weights[n]
        for i in range(3):
            off = unit[i] - targets[n, i]
            square += weight * off * off
            for k in range(len(q)):
                gradient[k] += weight * off * slope[i, k]
                for m in range(len(q)):
                    hessian[k, m] += weight * slope[i, k] * slope[i, m]
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


@kernel
def follow(q, velocity, covariance, targets, dt, decay, noise, weights, body, held, information, gain):  # type: ignore[no-untyped-def]
    """Predict angles, velocities and covariance after dt, search with the frame, and update; also return |r|².

    Velocities decay by a factor; `noise` (dof,) is the variance of the accelerations, `information` that on each joint
    without any measurement.
    """
    lower, upper, _, _ = held
    n = len(q)
    transition = np.eye(2 * n)
    for j in range(n):
        transition[j, n + j], transition[n + j, n + j] = dt, decay
    predicted = transition @ covariance @ np.ascontiguousarray(transition.T)
    for j in range(n):
        predicted[j, j] += dt**4 * noise[j]
        predicted[j, n + j] += dt**3 * noise[j]
        predicted[n + j, j] += dt**3 * noise[j]
        predicted[n + j, n + j] += dt**2 * noise[j]
    mean = np.minimum(np.maximum(q + dt * velocity, lower), upper)
    prior = np.linalg.inv(np.ascontiguousarray(predicted[:n, :n]))
    seen, used = targets.copy(), weights.copy()
    for i in range(len(targets)):
        if np.isnan(targets[i, 0]):
            seen[i], used[i] = 0.0, 0.0
    posterior, measured = mean.copy(), np.empty((n, n))
    square = search(posterior, seen, used, body, held, mean, prior, 6, gain, measured)
    change = decay * velocity + np.ascontiguousarray(predicted[n:, :n]) @ (prior @ (posterior - mean))
    for j in range(n):
        if (posterior[j] <= lower[j] and change[j] < 0.0) or (posterior[j] >= upper[j] and change[j] > 0.0):
            change[j] = 0.0
    return posterior, change, updated(predicted, measured, information), square


@kernel
def updated(covariance, measured, information):  # type: ignore[no-untyped-def]
    """Covariance (2n, 2n) after a measured information (n, n) on the first n, and one on each of them."""
    n = len(measured)
    rows, total = covariance[:n].copy(), measured + information * np.eye(n)
    left = np.eye(n) + total @ np.ascontiguousarray(rows[:, :n])
    reduced = covariance - np.ascontiguousarray(rows.T) @ np.linalg.solve(left, total @ rows)
    return 0.5 * (reduced + reduced.T)
