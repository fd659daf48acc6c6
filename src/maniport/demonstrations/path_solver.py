"""Bounded least squares over a whole path of joint angles (Levenberg-Marquardt with an active set of limits).

`solve_each` treats every row on its own. `solve_path` couples neighbouring frames by their joint acceleration:

    minimise  Σ_t |r_t(q_t)|² + Σ_t |p (q_t - q₀)|² + Σ_t |κ/Δt² (q_{t+1} - 2 q_t + q_{t-1})|²,   lower ≤ q_t ≤ upper

with κ = 1 / (2π f)². A motion that the residual sees with sensitivity σ (|∂r/∂q|) is followed up to the frequency
f √σ: what is measured well is hardly touched, and what a frame leaves open (a straight elbow says nothing about the
turn of the upper arm) is carried over from the frames before and after instead of drifting or jumping.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, solveh_banded

from maniport.validation import Array

Bools = NDArray[np.bool_]
Residual = Callable[[Array], tuple[Array, Array]]

MAX_DAMPING = 1e8
LEAST_GAIN, STILL = 1e-5, 1e-3
"""A step that lowers the cost by a smaller part of it, and turns no joint farther [rad], is the last. Where the arm
hangs straight, a joint turns far for next to no gain, and of a long path such a place is a small part of the cost."""


def solve_each(
    residual: Callable[[Array, NDArray[np.intp]], tuple[Array, Array]],
    start: Array,
    lower: Array,
    upper: Array,
    iterations: int = 30,
) -> tuple[Array, Array]:
    """Fit every row on its own."""
    q, damping = start.copy(), np.full(len(start), 1e-3)
    rows = np.arange(len(q))
    values, slopes = residual(q, rows)
    cost = np.sum(values**2, axis=-1)
    open_rows = rows
    for _ in range(iterations):
        gradient = (values[:, None] @ slopes)[:, 0]
        hessian = np.swapaxes(slopes, 1, 2) @ slopes
        held = _held(q[open_rows], gradient, lower, upper)
        free = ~held
        hessian = hessian * (free[:, :, None] & free[:, None, :])
        hessian += np.einsum("ni,ij->nij", damping[open_rows][:, None] + held, np.eye(len(lower)))
        step = -np.linalg.solve(hessian, (gradient * free)[..., None])[..., 0]
        tried = np.clip(q[open_rows] + step, lower, upper)
        new_values, new_slopes = residual(tried, open_rows)
        new_cost = np.sum(new_values**2, axis=-1)
        better = new_cost < cost[open_rows]
        moved = np.abs(tried - q[open_rows]).max(axis=-1)
        values[better], slopes[better] = new_values[better], new_slopes[better]
        q[open_rows[better]], cost[open_rows[better]] = tried[better], new_cost[better]
        damping[open_rows] *= np.where(better, 0.2, 8.0)
        going = (moved > 1e-6) & (damping[open_rows] < MAX_DAMPING)
        open_rows, values, slopes = open_rows[going], values[going], slopes[going]
        if not len(open_rows):
            break
    return q, cost


def solve_path(
    residual: Residual,
    start: Array,
    lower: Array,
    upper: Array,
    smoothing: Array,
    pull: Array,
    neutral: Array,
    progress: Callable[[float], None] | None = None,
    iterations: int = 100,
    still: int = 0,
) -> Array:
    """Fit all frames together."""

    def cost_of(q: Array, values: Array) -> float:
        bend = _second_difference(q) * smoothing[1:-1] if len(q) > 2 else np.zeros(1)
        return float(np.sum(values**2) + np.sum((pull * (q - neutral)) ** 2) + np.sum(bend**2))

    n, dof = start.shape
    q, damping = start.copy(), 1e-6
    values, slopes = residual(q)
    cost = cost_of(q, values)
    smooth = _smoothing_bands(smoothing)
    for iteration in range(iterations):
        gradient = (values[:, None] @ slopes)[:, 0] + pull**2 * (q - neutral) + _smoothing_gradient(q, smoothing)
        held = _held(q, gradient, lower, upper)
        held[:still] = held[n - still :] = True
        bands = smooth + _block_bands(np.swapaxes(slopes, 1, 2) @ slopes + np.diag(pull**2), len(smooth))
        while True:
            step = _banded_step(bands, gradient.ravel(), held.ravel(), damping)
            tried = q if step is None else np.clip(q + step.reshape(n, dof), lower, upper)
            new_values, new_slopes = residual(tried)
            new_cost = cost_of(tried, new_values)
            if step is not None and new_cost < cost:
                damping = max(damping * 0.2, 1e-12)
                break
            damping *= 5.0
            if damping > MAX_DAMPING or (step is not None and np.abs(tried - q).max() < 1e-10):
                return q
        moved, gained = float(np.abs(tried - q).max()), cost - new_cost
        q, values, slopes, cost = tried, new_values, new_slopes, new_cost
        if progress is not None:
            progress((iteration + 1) / iterations)
        if moved < 1e-9 or (gained < LEAST_GAIN * cost and moved < STILL):
            break
    return q


def _held(q: Array, gradient: Array, lower: Array, upper: Array) -> Bools:
    """The joints that lie at a limit and would leave it downhill."""
    return np.asarray(((q <= lower) & (gradient > 0)) | ((q >= upper) & (gradient < 0)))


def _second_difference(q: Array) -> Array:
    return np.asarray(q[2:] - 2 * q[1:-1] + q[:-2])


def _smoothing_gradient(q: Array, smoothing: Array) -> Array:
    """Half the derivative of Σ smoothing² |second difference|²."""
    gradient = np.zeros_like(q)
    if len(q) > 2:
        bend = _second_difference(q) * smoothing[1:-1] ** 2
        gradient[:-2] += bend
        gradient[1:-1] -= 2 * bend
        gradient[2:] += bend
    return gradient


def _smoothing_bands(smoothing: Array) -> Array:
    """Second derivative of the smoothing term as lower bands, shape (2 dof + 1, n dof): joints do not mix."""
    n, dof = smoothing.shape
    bands = np.zeros((2 * dof + 1, n, dof))
    if n > 2:
        square = smoothing[1:-1] ** 2
        bands[0, :-2] += square
        bands[0, 1:-1] += 4 * square
        bands[0, 2:] += square
        bands[dof, :-2] -= 2 * square
        bands[dof, 1:-1] -= 2 * square
        bands[2 * dof, :-2] += square
    return bands.reshape(2 * dof + 1, n * dof)


def _block_bands(blocks: Array, height: int) -> Array:
    """Block-diagonal matrix, blocks (n, dof, dof), as lower bands, shape (height, n dof)."""
    n, dof, _ = blocks.shape
    bands = np.zeros((height, n, dof))
    for offset in range(dof):
        bands[offset, :, : dof - offset] = np.diagonal(blocks, -offset, axis1=1, axis2=2)
    return bands.reshape(height, n * dof)


def _banded_step(bands: Array, gradient: Array, held: Bools, damping: float) -> Array | None:
    """Newton step of the free joints; None when the matrix is singular at this damping."""
    size = bands.shape[1]
    matrix = bands[:size].copy()  # a path of one or two frames is shorter than the bands are wide
    matrix[0] += damping
    for offset in range(len(matrix)):
        matrix[offset, : size - offset][held[: size - offset] | held[offset:]] = 0.0
    matrix[0, held] = 1.0
    try:
        return np.asarray(-solveh_banded(matrix, np.where(held, 0.0, gradient), lower=True, overwrite_ab=True))
    except LinAlgError:
        return None
