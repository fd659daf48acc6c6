"""The compiled length field: its values for many ellipsoids, and the whole map for one in a control loop."""

import numpy as np

from maniport.jit import kernel, part
from maniport.spd.kernels import MAX_EIGENVALUE, MIN_EIGENVALUE
from maniport.spd.kernels.loops import diagonalize_one
from maniport.spd.kernels.single import admit, compose, congruence
from maniport.validation import SPD_TOLERANCE

ROOT2 = 2.0**0.5
ROUNDED = 0.1 * SPD_TOLERANCE
"""Share of the trace up to which an eigenvalue may be a zero that was rounded up."""


@kernel
def fill_fields(x, parts, soft, centers, coefficients, inverse_square, fields):  # type: ignore[no-untyped-def]
    """Fill fields (n, k) at vectors x (n, D), of `features` where there are harmonics; see `map_one`."""
    count, size = x.shape
    u, field = np.empty(size), np.empty(fields.shape[1])
    for i in range(count):
        for k in range(size):
            u[k] = x[i, k]
        for k in range(len(field)):
            field[k] = 0.0
        if len(parts) > 0:
            _turn_features(u, parts, soft)
        _add_field(u, centers, coefficients, inverse_square, field)
        for k in range(len(field)):
            fields[i, k] = field[k]


@kernel
def map_one(point, mounting, numbers, parts, centers, lengths, pivots, turns, out):  # type: ignore[no-untyped-def]
    """Fill `out` with the map of R (X + ε I) Rᵀ, the eigenvalues of X first lifted to a floor."""
    n = len(mounting)
    size = n * (n + 1) // 2
    if point.shape != (n, n) or out.shape != (n, n):
        return 3
    a, b, v, x = np.empty((n, n)), np.empty((n, n)), np.empty((n, n)), np.empty(n)
    u, turning, field = np.empty(size), np.zeros(size), np.zeros(3)
    failed = admit(point, a, v, x, numbers[0], numbers[1])
    if failed != 0:
        return failed
    congruence(mounting, a, b)
    diagonalize_one(a, v)
    trace = 0.0
    for i in range(n):
        trace += a[i, i]
    for i in range(n):
        if not a[i, i] > ROUNDED * trace:
            return 2
        x[i] = numbers[4] * np.log(a[i, i]) + numbers[5]
    compose(x, v, a)
    _fill_mandel(a, u)
    _add_field(u, pivots, turns, numbers[7], turning)
    if len(parts) > 0:
        _turn_features(u, parts, numbers[8])
    _add_field(u, centers, lengths, numbers[7], field)
    for i in range(n):
        t = np.tanh(0.5 * x[i])
        x[i] += field[0] + t * (field[1] + t * field[2])
    if len(turns) > 0:
        compose(x, v, a)
        _add_mandel(a, turning)
        diagonalize_one(a, v)
        for i in range(n):
            x[i] = a[i, i]
    for i in range(n):
        x[i] = _released(np.exp(x[i] + numbers[6]), numbers[2], numbers[3])
        if not MIN_EIGENVALUE <= x[i] <= MAX_EIGENVALUE:
            return 2
    compose(x, v, a)
    for i in range(n):
        for j in range(n):
            out[i, j] = a[i, j]
    return 0


@part
def _add_field(u, centers, coefficients, inverse_square, field):  # type: ignore[no-untyped-def]
    """Add the sum of kernel values at u times coefficients (m, k) to the field (k,)."""
    square = 0.0
    for k in range(len(u)):
        square += u[k] * u[k]
    for j in range(len(centers)):
        exponent = centers[j, len(u)] - 0.5 * inverse_square * square
        for k in range(len(u)):
            exponent += centers[j, k] * u[k]
        near = np.exp(exponent)
        for k in range(len(field)):
            field[k] += coefficients[j, k] * near


@part
def _fill_mandel(a, u):  # type: ignore[no-untyped-def]
    row = len(a)
    for i in range(len(a)):
        u[i] = a[i, i]
        for j in range(i + 1, len(a)):
            u[row] = ROOT2 * a[i, j]
            row += 1


@part
def _add_mandel(a, u):  # type: ignore[no-untyped-def]
    """Add the matrix of a Mandel vector to the upper triangle of A."""
    row = len(a)
    for i in range(len(a)):
        a[i, i] += u[i]
        for j in range(i + 1, len(a)):
            a[i, j] += u[row] / ROOT2
            row += 1


@part
def _turn_features(u, parts, soft):  # type: ignore[no-untyped-def]
    """Replace u by its `features` about an axis, whose `harmonics` (6, 6) are `parts`, with δ²."""
    h = np.zeros(6)
    for i in range(6):
        for k in range(6):
            h[i] += parts[i, k] * u[k]
    along, mean, a, b, c, e = h[0], h[1], h[2], h[3], h[4], h[5]
    once, twice = a * a + b * b, c * c + e * e
    both, squares, product = once + 4.0 * twice + soft, a * a - b * b, 2.0 * (a * b)
    once, twice = np.sqrt(once + soft), np.sqrt(twice + soft)
    scale = 1.0 / (once * np.sqrt(both))
    u[0], u[1], u[2], u[3] = along, mean, once, twice
    u[4], u[5] = (squares * c + product * e) * scale, (product * c - squares * e) * scale


@part
def _released(value, epsilon, kappa):  # type: ignore[no-untyped-def]
    """The y with y (y + ε) / (y + κ ε) = `value`; the value itself where ε is negative."""
    if epsilon < 0.0:
        return value
    gap = value - epsilon
    way = np.sqrt(gap * gap + (4.0 * kappa * epsilon) * value)
    return 0.5 * (gap + way) if gap > 0.0 else 2.0 * kappa * epsilon * value / (way - gap)
