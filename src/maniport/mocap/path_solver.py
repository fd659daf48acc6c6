"""Bounded least squares over a whole path of joint angles (Levenberg-Marquardt with an active set of limits).

`solve_each` treats every row on its own. `solve_path` couples neighboring frames by their joint acceleration:

    minimize  Σ_t |r_t(q_t)|² + Σ_t |p (q_t - q₀)|² + Σ_t |κ/Δt² (q_{t+1} - 2 q_t + q_{t-1})|²,   lower ≤ q_t ≤ upper

with κ = 1 / (2π f)². A motion that the residual sees with sensitivity σ (|∂r/∂q|) is followed up to the frequency
f √σ: what is measured well is hardly changed, and what a frame leaves open (a straight elbow leaves the rotation of the
upper arm open) is carried over from the frames before and after instead of drifting or jumping.

Coupling fades within seconds. So `solve_long` solves a long path in blocks, each to its own end, and then the frames
around each cut once more between fixed neighbors: memory does not grow, and no joint steps at a cut.
"""

from collections.abc import Callable, Iterator
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, solveh_banded

from maniport.mocap.recording import Bools
from maniport.util.validation import Array

Residual = Callable[[Array], tuple[Array, Array]]

BLOCK = 4096  # The most frames that are solved at once

LEAST_GAIN = 1e-5
"""A step that lowers the cost by a smaller share, and turns no joint by more than `smallest_step`, is the last."""

_MAX_DAMPING = 1e8


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
        trial = np.clip(q[open_rows] + step, lower, upper)
        new_values, new_slopes = residual(trial, open_rows)
        new_cost = np.sum(new_values**2, axis=-1)
        better = new_cost < cost[open_rows]
        moved = np.abs(trial - q[open_rows]).max(axis=-1)
        values[better], slopes[better] = new_values[better], new_slopes[better]
        q[open_rows[better]], cost[open_rows[better]] = trial[better], new_cost[better]
        damping[open_rows] *= np.where(better, 0.2, 8.0)
        unfinished = (moved > 1e-6) & (damping[open_rows] < _MAX_DAMPING)
        open_rows, values, slopes = open_rows[unfinished], values[unfinished], slopes[unfinished]
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
    fixed: int = 0,
    smallest_step: float = 1e-3,
) -> Array:
    """Fit all frames together; `fixed` frames at either end stay.

    Where the arm hangs straight, a joint rotates far for hardly any gain, which is a small part of the cost of a long
    path: hence `smallest_step` [rad].
    """
    n, dof = start.shape
    stiffness = smoothing[1:-1] ** 2
    smooth = np.zeros((3, n, dof))  # second derivatives of the smoothing term: of each frame, with the next two
    for offset, row in enumerate(([1.0, 4.0, 1.0], [-2.0, -2.0], [1.0])):
        for frame, factor in enumerate(row):
            smooth[offset, frame : max(n - 2, 0) + frame] += factor * stiffness

    def cost_of(q: Array, values: Array) -> float:
        bending = np.sum(stiffness * np.diff(q, 2, axis=0) ** 2)
        return float(np.sum(values**2) + np.sum((pull * (q - neutral)) ** 2) + bending)

    q, damping = start.copy(), 1e-6
    values, slopes = residual(q)
    cost = cost_of(q, values)
    for iteration in range(iterations):
        gradient = (values[:, None] @ slopes)[:, 0] + pull**2 * (q - neutral)
        force = stiffness * np.diff(q, 2, axis=0)
        gradient[:-2] += force
        gradient[1:-1] -= 2 * force
        gradient[2:] += force
        held = _held(q, gradient, lower, upper)
        held[:fixed] = held[n - fixed :] = True
        bands = np.zeros((2 * dof + 1, n, dof))  # of the lower half of the matrix of second derivatives
        hessian = np.swapaxes(slopes, 1, 2) @ slopes + np.diag(pull**2)
        for offset in range(dof):
            bands[offset, :, : dof - offset] = np.diagonal(hessian, -offset, axis1=1, axis2=2)
        bands[::dof] += smooth
        while True:
            step = _banded_step(bands.reshape(-1, n * dof), gradient.ravel(), held.ravel(), damping)
            trial = q if step is None else np.clip(q + step.reshape(n, dof), lower, upper)
            new_values, new_slopes = residual(trial)
            new_cost = cost_of(trial, new_values)
            if step is not None and new_cost < cost:
                damping = max(damping * 0.2, 1e-12)
                break
            damping *= 5.0
            if damping > _MAX_DAMPING or (step is not None and np.abs(trial - q).max() < 1e-10):
                return q
        moved, gained = float(np.abs(trial - q).max()), cost - new_cost
        q, values, slopes, cost = trial, new_values, new_slopes, new_cost
        if progress is not None:
            progress((iteration + 1) / iterations)
        if moved < 1e-9 or (gained < LEAST_GAIN * cost and moved < smallest_step):
            break
    return q


def solve_long(
    residual: Callable[[slice], Residual],
    start: Array,
    lower: Array,
    upper: Array,
    smoothing: Array,
    pull: Array,
    neutral: Array,
    progress: Callable[[float], None] | None = None,
    block: int = BLOCK,
    around: int = 512,
) -> Array:
    """Fit all frames together, in blocks where there are many; `around` frames on either side of a cut come again.

    At 240 Hz these are 2 s, at 30 Hz 17 s. A second difference reaches two frames far.
    """
    if len(start) <= block:
        return solve_path(residual(slice(None)), start, lower, upper, smoothing, pull, neutral, progress)
    q = start.copy()
    blocks = list(parts_of(len(q), block))
    parts = [(part, 0) for part in blocks]
    parts += [(slice(part.start - around, part.start + around), 2) for part in blocks[1:]]
    for done, (part, fixed) in enumerate(parts, start=1):
        q[part] = solve_path(residual(part), q[part], lower, upper, smoothing[part], pull, neutral, fixed=fixed)
        if progress is not None:
            progress(done / len(parts))
    return q


def parts_of(count: int, most: int) -> Iterator[slice]:
    """Share a number of rows evenly among as few parts as hold at most so many each."""
    edges = np.linspace(0, count, max(1, -(-count // most)) + 1).round().astype(int)
    for first, last in pairwise(edges.tolist()):
        yield slice(first, last)


def _held(q: Array, gradient: Array, lower: Array, upper: Array) -> Bools:
    """Mark the joints that lie at a limit and would leave it downhill."""
    return np.asarray(((q <= lower) & (gradient > 0)) | ((q >= upper) & (gradient < 0)))


def _banded_step(bands: Array, gradient: Array, held: Bools, damping: float) -> Array | None:
    """Return the Newton step of the free joints; None when the matrix is singular at this damping."""
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
