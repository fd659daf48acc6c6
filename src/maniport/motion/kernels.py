"""Compiled normal equations of searches, and their step within limits."""

import numpy as np
from numpy.typing import NDArray

from maniport.util.jit import kernel, part
from maniport.util.validation import Array


@kernel
def add_log_residual(
    values: Array,
    vectors: Array,
    whitening: Array,
    changes: Array,
    square: Array,
    gradient: Array,
    hessian: Array,
) -> None:
    """Add r², Jᵀr and JᵀJ of r = vec(log X), X = U Λ Uᵀ, to (n,), (n, dof) and (n, dof, dof).

    `changes` are the derivatives of M, and X is W (M + ε I) Wᵀ with the whitening W.
    """
    dof = changes.shape[1]
    d = changes.shape[2]
    slopes = np.empty((d, d))
    product = np.empty((d, d))
    frame = np.empty((d, d))
    logs = np.empty(d)
    rows = np.empty((d * (d + 1) // 2, dof))
    for n in range(len(values)):
        for i in range(d):
            logs[i] = np.log(values[n, i])
            square[n] += logs[i] * logs[i]
            for j in range(d):
                frame[i, j] = 0.0  # Uᵀ W
                for m in range(d):
                    frame[i, j] += vectors[n, m, i] * whitening[n, m, j]
            for j in range(i + 1):
                slopes[i, j] = _divided_difference(values[n, i], values[n, j]) * (
                    1.0 if i == j else np.sqrt(2.0)
                )
        for k in range(dof):
            for i in range(d):
                for j in range(d):
                    product[i, j] = 0.0
                    for m in range(d):
                        product[i, j] += frame[i, m] * changes[n, k, m, j]
            row = d
            for i in range(d):
                for j in range(i + 1):
                    total = 0.0
                    for m in range(d):
                        total += product[i, m] * frame[j, m]
                    if i == j:
                        rows[i, k] = slopes[i, i] * total
                    else:
                        rows[row, k] = slopes[i, j] * total
                        row += 1
        _accumulate(rows, logs, gradient[n], hessian[n])


@kernel
def add_residual(
    residuals: Array, rows: Array, square: Array, gradient: Array, hessian: Array
) -> None:
    """Add r², Jᵀr and JᵀJ of residuals r (n, m) and their derivatives J (n, m, dof) as `add_log_residual` does."""
    for n in range(len(residuals)):
        for i in range(len(residuals[n])):
            square[n] += residuals[n, i] * residuals[n, i]
        _accumulate(rows[n], residuals[n], gradient[n], hessian[n])


@part
def _divided_difference(a: float, b: float) -> float:
    ratio = a / b - 1.0
    if abs(ratio) < 1e-8:
        return (1.0 - 0.5 * ratio) / b
    quotient: float = np.log1p(ratio) / ratio / b
    return quotient


@part
def _accumulate(rows: Array, residual: Array, gradient: Array, hessian: Array) -> None:
    """Add Jᵀr and JᵀJ; residuals beyond those given are zero."""
    dof = len(gradient)
    for k in range(dof):
        for i in range(len(residual)):
            gradient[k] += rows[i, k] * residual[i]
        for m in range(k + 1):
            total = 0.0
            for i in range(len(rows)):
                total += rows[i, k] * rows[i, m]
            hessian[k, m] += total
            if m != k:
                hessian[m, k] += total


@kernel
def step_within_limits(
    q: Array,
    gradient: Array,
    hessian: Array,
    damping: Array,
    lower: Array,
    upper: Array,
    trial: Array,
    expected: Array,
) -> None:
    """Fill `trial` (n, dof) with q + s, s minimizing gᵀs + ½ sᵀ(H + damping I)s within the limits, nearly."""
    dof = q.shape[1]
    factor = np.empty((dof, dof + 1))
    step = np.empty(dof)
    moving = np.empty(dof, np.int64)
    free = np.empty(dof, np.bool_)
    for n in range(len(q)):
        for k in range(dof):
            low = q[n, k] <= lower[k] and gradient[n, k] > 0.0
            high = q[n, k] >= upper[k] and gradient[n, k] < 0.0
            free[k] = not (low or high)
            step[k] = 0.0
            trial[n, k] = q[n, k]
        stopped = True
        while stopped:
            stopped = False
            count = 0
            for k in range(dof):
                if free[k]:
                    moving[count] = k
                    count += 1
            _solve_moving(gradient[n], hessian[n], damping[n], moving[:count], free, factor, step)
            for k in moving[:count]:
                bounded = min(max(q[n, k] + step[k], lower[k]), upper[k])
                if bounded != q[n, k] + step[k]:
                    step[k] = bounded - q[n, k]
                    free[k] = False
                    stopped = True
                    trial[n, k] = bounded  # rounding could leave q + step just inside the limit
        expected[n] = 0.0
        for k in range(dof):
            if free[k]:
                trial[n, k] = q[n, k] + step[k]
        for k in range(dof):
            slope = gradient[n, k]
            for m in range(dof):
                slope += 0.5 * hessian[n, k, m] * step[m]
            expected[n] -= slope * step[k]


@part
def _solve_moving(
    gradient: Array,
    hessian: Array,
    damping: float,
    moving: NDArray[np.int64],
    free: NDArray[np.bool_],
    factor: Array,
    step: Array,
) -> None:
    """Solve for the steps of the moving joints, those of the others given; Cholesky."""
    count = len(moving)
    for a in range(count):
        k = moving[a]
        pull = -gradient[k]
        for m in range(len(gradient)):
            if not free[m]:
                pull -= hessian[k, m] * step[m]
        for b in range(a + 1):
            total = hessian[k, moving[b]] + (damping if a == b else 0.0)
            for c in range(b):
                total -= factor[a, c] * factor[b, c]
            if a == b:
                factor[a, b] = np.sqrt(total)
            else:
                factor[a, b] = total / factor[b, b]
        for c in range(a):
            pull -= factor[a, c] * factor[c, count]
        factor[a, count] = pull / factor[a, a]
    for a in range(count - 1, -1, -1):
        total = factor[a, count]
        for c in range(a + 1, count):
            total -= factor[c, a] * step[moving[c]]
        step[moving[a]] = total / factor[a, a]
