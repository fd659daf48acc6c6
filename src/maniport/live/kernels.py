"""Compiled steps of the estimate of a person's arm in one frame."""

import numpy as np
from numpy.typing import NDArray

from maniport.arms.kernels import place_links, place_points
from maniport.motion.kernels import step_within_limits
from maniport.util.jit import kernel, part
from maniport.util.validation import Array

Indices = NDArray[np.int64]
Body = tuple[Array, Array, Array, Array, Array, Indices, Array, int]
"""Kinematics of an arm, as `maniport.arms.kinematics` gives them: offset, placements, axes, slides and coupling of the
joints; joints and vectors of the points, and their number."""

JointPriors = tuple[Array, Array, Array, Array]
"""Lower and upper limits, squared pulls p² and neutral angles q₀ of the joints, shape (dof,) each."""


@kernel
def unit_vectors(linear: Array, positions: Array, shortest: float) -> Array:
    """Return unit vectors (k, 3) along combinations (k, n) of points (n, 3); nan where not seen, or not longer."""
    vectors = np.zeros((len(linear), 3))
    for v in range(len(linear)):
        for n in range(len(positions)):
            if linear[v, n] != 0.0:  # other points may not be seen
                vectors[v] += linear[v, n] * positions[n]
        _normalize(vectors[v], shortest)
    return vectors


@kernel
def trunk_directions(vectors: Array, forward: bool, required: int) -> tuple[Array, bool]:
    """Return directions (k, 3) in the frame of the trunk, and whether the first ones, so many as required, are seen.

    The last two of the vectors (k + 2, 3) are those of the trunk: upward, and forward or else to the left.
    """
    up = vectors[-2]
    across = vectors[-1].copy()
    across -= (across[0] * up[0] + across[1] * up[1] + across[2] * up[2]) * up
    _normalize(across, 1e-3)  # within 0.06° of the vertical it does not determine the frame
    directions = np.empty((len(vectors) - 2, 3))
    seen = True
    for n in range(len(directions)):
        first = 0.0
        second = 0.0
        directions[n, 2] = 0.0
        for i in range(3):
            p = (i + 1) % 3
            q = (i + 2) % 3
            x = vectors[n, i]
            first += x * across[i]
            second += x * (up[p] * across[q] - up[q] * across[p])
            directions[n, 2] += x * up[i]
        if forward:
            directions[n, 0] = first
            directions[n, 1] = second
        else:
            directions[n, 0] = -second
            directions[n, 1] = first
        seen = seen and (n >= required or not np.isnan(first + second))
    return directions, seen


@kernel
def turned(before: Array, after: Array, least: Array) -> bool:
    """Return whether the angle between the first unit vectors (k, 3), not nan, exceeds `least` (n,) [rad] anywhere."""
    for n in range(len(least)):
        square = np.sum((after[n] - before[n]) ** 2)
        if not np.isnan(square) and 2.0 * np.arcsin(min(0.5 * np.sqrt(square), 1.0)) > least[n]:
            return True
    return False


@part
def _normalize(vector: Array, shortest: float) -> None:
    """Scale a vector (3,) to length one; nan where it is no longer than `shortest`."""
    length = np.sqrt(vector[0] * vector[0] + vector[1] * vector[1] + vector[2] * vector[2])
    vector /= length if length > shortest else np.nan


@kernel
def evaluate(
    q: Array,
    targets: Array,
    weights: Array,
    body: Body,
    pull: Array,
    neutral: Array,
    mean: Array,
    prior: Array,
    gradient: Array,
    hessian: Array,
) -> tuple[float, float]:
    """Cost of `search` and |r|²; its halved gradient, and its halved second derivative without the prior."""
    offset, placements, axes, slides, coupling, joints, vectors, points = body
    gradient[:] = 0.0
    hessian[:] = 0.0
    positions = offset + coupling @ q
    values = np.empty((len(joints), 3))
    slopes = np.empty((len(joints), 3, len(q)))
    rotations = np.empty((len(axes) + 1, 3, 3))
    origins = np.empty((len(axes) + 1, 3))
    place_links(positions, np.arange(len(axes)), placements, axes, slides, rotations, origins)
    place_points(
        rotations, origins, axes, slides, coupling, joints, vectors, points, values, slopes
    )
    square = 0.0
    for n in range(len(targets)):
        if weights[n] == 0.0:
            continue
        if n < points - 1:  # from a point to the next
            unit = values[n + 1] - values[n]
            slope = slopes[n + 1] - slopes[n]
            length = np.sqrt(unit[0] * unit[0] + unit[1] * unit[1] + unit[2] * unit[2])
            unit /= length
            for k in range(len(q)):
                stretch = unit[0] * slope[0, k] + unit[1] * slope[1, k] + unit[2] * slope[2, k]
                for i in range(3):
                    slope[i, k] = (slope[i, k] - unit[i] * stretch) / length
        else:
            unit = values[n + 1]
            slope = slopes[n + 1]
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
def search(
    q: Array,
    targets: Array,
    weights: Array,
    body: Body,
    priors: JointPriors,
    mean: Array,
    prior: Array,
    max_iterations: int,
    gain: float,
    hessian: Array,
) -> float:
    """Move q (dof,) to where |r(q)|² + |p (q − q₀)|² + (q − mean)ᵀ prior (q − mean) is least within the limits.

    Levenberg's method: little damping as long as each step lowers the cost. A step that moves no joint by 1e-7 rad is
    the last.
    """
    lower, upper, pull, neutral = priors
    dof = len(q)
    gradient = np.empty((1, dof))
    whole = np.empty((1, dof, dof))
    expected = np.empty(1)
    trial = np.empty((1, dof))
    damping = np.full(1, 1e-9)
    slopes = np.empty(dof)
    curves = np.empty((dof, dof))
    here = np.empty((1, dof))
    square: float
    cost, square = evaluate(
        q, targets, weights, body, pull, neutral, mean, prior, gradient[0], hessian
    )
    for _ in range(max_iterations):
        here[0] = q
        whole[0] = hessian + prior
        step_within_limits(here, gradient, whole, damping, lower, upper, trial, expected)
        moved = np.abs(trial[0] - q).max()
        new_cost, new_square = evaluate(
            trial[0], targets, weights, body, pull, neutral, mean, prior, slopes, curves
        )
        if new_cost < cost:
            gained = cost - new_cost
            q[:] = trial[0]
            gradient[0] = slopes
            hessian[:] = curves
            cost = new_cost
            square = new_square
            damping *= 0.2
            if moved < 1e-7 or gained < gain * cost:
                break
        elif moved < 1e-7:
            break
        else:
            damping[:] = max(1e-3, 8.0 * damping[0])
    return square


@kernel
def search_all(
    q: Array,
    targets: Array,
    weights: Array,
    body: Body,
    priors: JointPriors,
    no_prior: Array,
    max_iterations: int,
    gain: float,
    hessians: Array,
) -> Array:
    """Move each q (n, dof) as `search` does without a mean; return all |r|²."""
    squares = np.empty(len(q))
    for n in range(len(q)):
        squares[n] = search(
            q[n], targets, weights, body, priors, q[n], no_prior, max_iterations, gain, hessians[n]
        )
    return squares


@kernel
def follow(
    q: Array,
    velocity: Array,
    covariance: Array,
    targets: Array,
    dt: float,
    decay: float,
    noise: Array,
    weights: Array,
    body: Body,
    priors: JointPriors,
    information: float,
    gain: float,
) -> tuple[Array, Array, Array, float, float]:
    """Predict angles, velocities and covariance after dt, search with the frame, and update.

    Also return |r|² and the largest change of an angle. Velocities decay by a factor; `noise` (dof,) is the variance of
    the accelerations, `information` that on each joint without any measurement.
    """
    lower, upper, _, _ = priors
    n = len(q)
    predicted = np.empty((2 * n, 2 * n))
    for i in range(n):
        for j in range(n):
            of_both = covariance[i, n + j]
            of_velocities = covariance[n + i, n + j]
            if i == j:
                added = noise[i]
            else:
                added = 0.0
            predicted[i, j] = (
                covariance[i, j] + dt * (of_both + covariance[j, n + i]) + dt**2 * of_velocities
            )
            predicted[i, j] += dt**4 * added
            predicted[i, n + j] = predicted[n + j, i] = (
                decay * (of_both + dt * of_velocities) + dt**3 * added
            )
            predicted[n + i, n + j] = decay**2 * of_velocities + dt**2 * added
    mean = np.minimum(np.maximum(q + dt * velocity, lower), upper)
    prior = np.linalg.inv(np.ascontiguousarray(predicted[:n, :n]))
    used = np.where(np.isnan(targets[:, 0]), 0.0, weights)
    posterior = mean.copy()
    measured = np.empty((n, n))
    square = search(posterior, targets, used, body, priors, mean, prior, 6, gain, measured)
    change = decay * velocity + np.ascontiguousarray(predicted[n:, :n]) @ (
        prior @ (posterior - mean)
    )
    for j in range(n):
        if (posterior[j] <= lower[j] and change[j] < 0.0) or (
            posterior[j] >= upper[j] and change[j] > 0.0
        ):
            change[j] = 0.0
    return (
        posterior,
        change,
        updated(predicted, measured, information),
        square,
        np.abs(posterior - q).max(),
    )


@kernel
def updated(covariance: Array, measured: Array, information: float) -> Array:
    """Covariance (2n, 2n) after a measured information (n, n) on the first n, and one on each of them."""
    n = len(measured)
    rows = covariance[:n].copy()
    total = measured + information * np.eye(n)
    left = np.eye(n) + total @ np.ascontiguousarray(rows[:, :n])
    reduced = covariance - np.ascontiguousarray(rows.T) @ np.linalg.solve(left, total @ rows)
    return 0.5 * (reduced + reduced.T)


@kernel
def averaged(times: Array, rows: Array, start: float, later: Array, longest: float) -> Array:
    """Average a path around times (k,) after a start: rows (n, m) of increasing times (n,), linear in between.

    The interval reaches as far to both sides, at most `longest` and to the last row; before the first one is the first.
    """
    result = np.empty((len(later), rows.shape[1]))
    for k in range(len(later)):
        center = start + later[k]
        half = min(longest, times[-1] - center)
        duration = max(min(center + half, times[0]) - (center - half), 0.0)
        total = duration * rows[0]
        for i in range(len(times) - 1):
            begin = max(times[i], center - half)
            end = min(times[i + 1], center + half)
            if end > begin:
                share = (0.5 * (begin + end) - times[i]) / (times[i + 1] - times[i])
                total += (end - begin) * ((1.0 - share) * rows[i] + share * rows[i + 1])
                duration += end - begin
        if duration > 0.0:
            result[k] = total / duration
        else:
            result[k] = rows[-1]
    return result


@kernel
def queued(times: Array, rows: Array, row: Array, now: float, delay: float) -> tuple[Array, Array]:
    """Append a time and a row to those (n,) and (n, m) that are followed after a delay; drop old ones.

    Where the last row is already followed, the way to the new one begins now.
    """
    count = len(times)
    late = now - delay
    ended = count > 0 and times[-1] < late
    if ended:
        first = count - 1
    else:
        first = max(int(np.searchsorted(times, late - delay)) - 1, 0)
    kept = np.empty(count - first + 1)
    kept_rows = np.empty((count - first + 1, len(row)))
    for i in range(first, count):
        if ended:
            kept[i - first] = late
        else:
            kept[i - first] = times[i]
        kept_rows[i - first] = rows[i]
    kept[-1] = now
    kept_rows[-1] = row
    return kept, kept_rows
