"""The rotation step for d = 3, compiled: cost, derivatives and descent without leaving machine code.

The formulas are those of `maniport.transfer.icp.rotation`, which is the twin in NumPy and serves every other size. With
S = L Lᵀ and the eigenvectors U of L⁻¹ X L⁻ᵀ, V = L⁻ᵀ U, so that K_a = (Uᵀ L⁻¹) Ω_a (L U). Every entry pair K_jk, K_kj
of the Hessian's sums is taken together.
"""

import numpy as np

from maniport.compiling import njit
from maniport.spd.kernels.pieces import diagonalise_one

PARTS = "0b7b0df068b1"
"""Digest of `pieces.py` and `words.py` in `spd/kernels`. Numba's cache does not see the files of the functions called
from here: whenever one changes, so must this line. A test tells the digest."""

ARMIJO = 1e-4
"""Share of the gain that the slope promises which a step must bring."""

MAX_STEP = 1.0
"""Longest step [rad]."""

EPS = float(np.finfo(np.float64).eps)


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract", "nnan", "nsz"})
def derivatives(lower, inverse, teacher, weights, rotation, gradient, hessian, second):  # type: ignore[no-untyped-def]
    """Return the cost; where `second` is true also fill gradient (3,) and Hessian (3, 3).

    `lower` and `inverse` hold L and L⁻¹ of the student's matrices, shape (n, 3, 3).
    """
    a, b, c, u = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    moves, values, logs = np.empty((3, 3, 3)), np.empty(3), np.empty(3)
    cost = 0.0
    gradient[:] = 0.0
    hessian[:] = 0.0
    for i in range(len(weights)):
        for j in range(3):
            for k in range(3):
                a[j, k] = 0.0
                for m in range(j + 1):
                    a[j, k] += inverse[i, j, m] * rotation[m, k]
        for j in range(3):
            for k in range(3):
                b[j, k] = a[j, 0] * teacher[i, 0, k] + a[j, 1] * teacher[i, 1, k] + a[j, 2] * teacher[i, 2, k]
        for j in range(3):
            for k in range(j, 3):
                c[j, k] = b[j, 0] * a[k, 0] + b[j, 1] * a[k, 1] + b[j, 2] * a[k, 2]
        diagonalise_one(c, u)
        for j in range(3):
            values[j] = c[j, j]
            logs[j] = np.log(values[j])
            cost += weights[i] * logs[j] * logs[j]
        if second:
            _moves(lower[i], inverse[i], u, a, b, moves)
            _add_derivatives(values, logs, moves, weights[i], gradient, hessian)
    for x in range(3):
        for y in range(x):
            hessian[x, y] = hessian[y, x]
    return cost


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract", "nnan", "nsz"})
def _moves(lower, inverse, u, left, right, moves):  # type: ignore[no-untyped-def]
    """Fill K_a = (Uᵀ L⁻¹) Ω_a (L U) for the three axes; `left` and `right` are working space."""
    for j in range(3):
        for k in range(3):
            left[j, k], right[j, k] = 0.0, 0.0
            for m in range(k, 3):
                left[j, k] += u[m, j] * inverse[m, k]
            for m in range(j + 1):
                right[j, k] += lower[j, m] * u[m, k]
    for j in range(3):
        for k in range(3):
            moves[0, j, k] = left[j, 2] * right[1, k] - left[j, 1] * right[2, k]
            moves[1, j, k] = left[j, 0] * right[2, k] - left[j, 2] * right[0, k]
            moves[2, j, k] = left[j, 1] * right[0, k] - left[j, 0] * right[1, k]


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract", "nnan", "nsz"})
def _add_derivatives(values, logs, moves, weight, gradient, hessian):  # type: ignore[no-untyped-def]
    """Add one pair's share to the gradient and to the upper triangle of the Hessian."""
    for j in range(3):
        for x in range(3):
            gradient[x] += 4.0 * weight * logs[j] * moves[x, j, j]
            for y in range(x, 3):
                hessian[x, y] += 8.0 * weight * moves[x, j, j] * moves[y, j, j]
    for j in range(2):
        for k in range(j + 1, 3):
            low, high = values[j], values[k]
            middle = 0.5 * (low + high)
            if abs(low - high) < 1e-5 * middle:
                slope = 2.0 * (1.0 - np.log(middle)) / (middle * middle)
            else:
                slope = 2.0 * (logs[j] / low - logs[k] / high) / (low - high)
            mixed = 2.0 * (logs[j] + logs[k])
            first, other = 4.0 * logs[j] * high / low, 4.0 * logs[k] * low / high
            for x in range(3):
                p, q = moves[x, j, k], moves[x, k, j]
                change = p * high + q * low
                for y in range(x, 3):
                    r, s = moves[y, j, k], moves[y, k, j]
                    total = 2.0 * slope * change * (r * high + s * low) + mixed * (p * s + q * r)
                    hessian[x, y] += weight * (total + first * p * r + other * q * s)


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract", "nnan", "nsz"})
def _length(vector):  # type: ignore[no-untyped-def]
    return np.sqrt(vector[0] * vector[0] + vector[1] * vector[1] + vector[2] * vector[2])


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract", "nnan", "nsz"})
def _saddle_free_direction(gradient, hessian, frame, direction):  # type: ignore[no-untyped-def]
    """Fill −|H|⁻¹ g, at most `MAX_STEP` long; `hessian` is overwritten. Returns the slope along it."""
    diagonalise_one(hessian, frame)
    largest = max(abs(hessian[0, 0]), abs(hessian[1, 1]), abs(hessian[2, 2]), 1e-300)
    direction[:] = 0.0
    for j in range(3):
        along = gradient[0] * frame[0, j] + gradient[1] * frame[1, j] + gradient[2] * frame[2, j]
        along /= max(abs(hessian[j, j]), 1e-8 * largest)
        for k in range(3):
            direction[k] -= along * frame[k, j]
    length = _length(direction)
    if length > MAX_STEP:
        for k in range(3):
            direction[k] *= MAX_STEP / length
    return gradient[0] * direction[0] + gradient[1] * direction[1] + gradient[2] * direction[2]


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract", "nnan", "nsz"})
def _turn(rotation, direction, length, turned):  # type: ignore[no-untyped-def]
    """Fill exp([length · direction]) R (Rodrigues), brought back to orthonormality by one step of Newton."""
    x, y, z = length * direction[0], length * direction[1], length * direction[2]
    square = x * x + y * y + z * z
    angle = np.sqrt(square)
    if angle < 1e-4:  # series, where the quotients would lose digits
        s, c = 1.0 - square / 6.0, 0.5 - square / 24.0
    else:
        s, c = np.sin(angle) / angle, (1.0 - np.cos(angle)) / square
    step = np.empty((3, 3))
    step[0, 0], step[0, 1], step[0, 2] = 1.0 - c * (y * y + z * z), c * x * y - s * z, c * x * z + s * y
    step[1, 0], step[1, 1], step[1, 2] = c * x * y + s * z, 1.0 - c * (x * x + z * z), c * y * z - s * x
    step[2, 0], step[2, 1], step[2, 2] = c * x * z - s * y, c * y * z + s * x, 1.0 - c * (x * x + y * y)
    raw = np.empty((3, 3))
    for j in range(3):
        for k in range(3):
            raw[j, k] = step[j, 0] * rotation[0, k] + step[j, 1] * rotation[1, k] + step[j, 2] * rotation[2, k]
    for j in range(3):
        for k in range(3):
            step[j, k] = raw[0, j] * raw[0, k] + raw[1, j] * raw[1, k] + raw[2, j] * raw[2, k]
    for j in range(3):
        for k in range(3):
            drift = raw[j, 0] * step[0, k] + raw[j, 1] * step[1, k] + raw[j, 2] * step[2, k]
            turned[j, k] = 1.5 * raw[j, k] - 0.5 * drift


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract", "nnan", "nsz"})
def minimize(lower, inverse, teacher, weights, rotation, tol, max_iter):  # type: ignore[no-untyped-def]
    """Descend in place from `rotation`; return the cost there and at the end, gradient norm and number of steps.

    The same rules as `RotationProblem.minimize`: a full step counts when it meets Armijo's rule or, where the cost no
    longer resolves it, when it halves the gradient; else it is halved.
    """
    gradient, hessian = np.empty(3), np.empty((3, 3))
    new_gradient, new_hessian = np.empty(3), np.empty((3, 3))
    frame, direction, moved = np.empty((3, 3)), np.empty(3), np.empty((3, 3))
    cost = derivatives(lower, inverse, teacher, weights, rotation, gradient, hessian, True)
    first, norm = cost, _length(gradient)
    steps = 0
    while norm > tol and steps < max_iter:
        slope = _saddle_free_direction(gradient, hessian, frame, direction)
        _turn(rotation, direction, 1.0, moved)
        new_cost = derivatives(lower, inverse, teacher, weights, moved, new_gradient, new_hessian, True)
        new_norm = _length(new_gradient)
        taken = new_cost < cost + ARMIJO * slope
        taken = taken or (new_cost <= cost * (1.0 + 1e-6) + 1e-14 and new_norm < 0.5 * norm)
        length = 0.5
        while not taken and length * -slope > EPS * cost and length > 1e-9:
            _turn(rotation, direction, length, moved)
            # with derivatives that may be of no use: without them it would be another function to compile, for seconds
            new_cost = derivatives(lower, inverse, teacher, weights, moved, new_gradient, new_hessian, True)
            new_norm = _length(new_gradient)
            taken = new_cost < cost + ARMIJO * length * slope
            length /= 2.0
        if not taken:
            break
        for x in range(3):  # by entry: assigning arrays costs Numba 4 s of compiling, for its messages on shapes
            gradient[x] = new_gradient[x]
            for y in range(3):
                rotation[x, y], hessian[x, y] = moved[x, y], new_hessian[x, y]
        cost, norm = new_cost, new_norm
        steps += 1
    return first, cost, norm, steps
