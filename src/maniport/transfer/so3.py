"""The rotation step for d = 3, compiled: cost, derivatives and descent without leaving machine code.

The formulas are those of `maniport.transfer.icp.rotation`, which is the twin in NumPy and serves every other size. With
S = L Lᵀ and the eigenvectors U of L⁻¹ X L⁻ᵀ, V = L⁻ᵀ U, so that K_a = (Uᵀ L⁻¹) Ω_a (L U). Every entry pair K_jk, K_kj
of the Hessian's sums is taken together. Pairs are taken as many at a time as `like`, the last argument, is wide.
"""

import numpy as np

from maniport.compiling import njit
from maniport.spd.kernels.pieces import block, diagonalise, diagonalise_one, fill, log
from maniport.spd.kernels.words import load, magnitude, put, spread, store, take, where, width

PARTS = "dd964c72f705"
"""Digest of `lanes.py`, `pieces.py` and `words.py` in `spd/kernels`. Numba's cache does not see the files of the
functions called from here: whenever one changes, so must this line. A test tells the digest."""

ARMIJO = 1e-4
"""Share of the gain that the slope promises which a step must bring."""

MAX_STEP = 1.0
"""Longest step [rad]."""

EPS = float(np.finfo(np.float64).eps)

NEAR = 1e-5
"""Relative gap of two eigenvalues up to which a divided difference is taken for the derivative between them."""

NOTHING = float("nan")

PAIR, INVERSE, LOWER, TEACHER, WEIGHT = 28, 0, 9, 18, 27
"""Rows of a block of pairs, and where there L⁻¹, L, T and the weight begin."""

COST, GRADIENT, HESSIAN, SUMS = 0, 1, 4, 10
"""Rows of the sums: the cost, the gradient, the upper triangle of the Hessian, row by row."""

OPTIONS = {"nogil": True, "error_model": "numpy"}
AROUND = {"contract", "nnan", "nsz"}
"""What may be assumed of numbers in the descent."""

INNER = OPTIONS | {"forceinline": True, "no_cpython_wrapper": True}
"""Of what Python never calls: what it would call it by takes a tenth of the time of compiling all."""
piece = njit(fastmath={"contract"}, **INNER)
around = njit(fastmath=AROUND, **INNER)


# Only what Python calls is stored. Parts that were stored by themselves would be linked with the rest otherwise than
# those that were just compiled, and round otherwise: the first process would not agree with the next to the last digit.
@njit(cache=True, fastmath={"contract"}, **OPTIONS)
def derivatives(lower, inverse, teacher, weights, rotation, gradient, hessian, second, like):  # type: ignore[no-untyped-def]
    """Return the cost; where `second` is true also fill gradient (3,) and Hessian (3, 3).

    `lower` and `inverse` hold L and L⁻¹ of the student's matrices, shape (n, 3, 3).
    """
    return _evaluate(_packed(lower, inverse, teacher, weights, like), rotation, gradient, hessian, second, like)


@piece
def _packed(lower, inverse, teacher, weights, like):  # type: ignore[no-untyped-def]
    """Lay pairs side by side, in blocks; those beyond the last repeat it and weigh nothing."""
    count = len(weights)
    blocks = (count + width(like) - 1) // width(like)
    pairs = np.empty((blocks, PAIR, *like.shape[1:]))
    for i in range(blocks):
        start, pair = i * width(like), pairs[i]
        fill(pair[INVERSE:LOWER], inverse, start, count, 1)
        fill(pair[LOWER:TEACHER], lower, start, count, 1)
        fill(pair[TEACHER:WEIGHT], teacher, start, count, 1)
        for lane in range(width(like)):
            put(pair, WEIGHT, lane, weights[start + lane] if start + lane < count else 0.0)
    return pairs


@piece
def _evaluate(pairs, rotation, gradient, hessian, second, like):  # type: ignore[no-untyped-def]
    """Do what `derivatives` does with packed pairs."""
    a, b, c, u = block(9, like), block(9, like), block(9, like), block(9, like)
    moves, logs, sums = block(27, like), block(3, like), block(SUMS, like)
    for row in range(SUMS):
        store(sums, row, spread(0.0, like))
    for i in range(len(pairs)):
        pair = pairs[i]
        _whiten(pair, rotation, a, b, c)
        diagonalise(c, u, 3, 3 if second else 0)
        squares = spread(0.0, like)
        for j in range(3):
            value = load(c, 4 * j)
            logarithm = where(value > 0.0, log(value), NOTHING)
            squares = squares + logarithm * logarithm
            store(logs, j, logarithm)
        store(sums, COST, load(sums, COST) + load(pair, WEIGHT) * squares)
        if second:
            _fill_moves(pair, u, a, b, moves)
            _add_diagonal(logs, moves, load(pair, WEIGHT), sums)
            _add_others(c, logs, moves, load(pair, WEIGHT), sums)
    row = HESSIAN
    for x in range(3):
        gradient[x] = _total(sums, GRADIENT + x)
        for y in range(x, 3):
            hessian[x, y] = hessian[y, x] = _total(sums, row)
            row += 1
    return _total(sums, COST)


@piece
def _total(sums, row):  # type: ignore[no-untyped-def]
    total = 0.0
    for lane in range(width(sums)):
        total += take(sums, row, lane)
    return total


@piece
def _whiten(pair, rotation, a, b, c):  # type: ignore[no-untyped-def]
    """C = A T Aᵀ, its upper triangle, of A = L⁻¹ R; B is overwritten."""
    for j in range(3):
        for k in range(3):
            total = load(pair, INVERSE + 3 * j) * rotation[0, k]
            for m in range(1, j + 1):
                total = total + load(pair, INVERSE + 3 * j + m) * rotation[m, k]
            store(a, 3 * j + k, total)
    for j in range(3):
        for k in range(3):
            total = load(a, 3 * j) * load(pair, TEACHER + k)
            for m in range(1, 3):
                total = total + load(a, 3 * j + m) * load(pair, TEACHER + 3 * m + k)
            store(b, 3 * j + k, total)
        for k in range(j + 1):
            total = load(b, 3 * j) * load(a, 3 * k)
            for m in range(1, 3):
                total = total + load(b, 3 * j + m) * load(a, 3 * k + m)
            store(c, 3 * k + j, total)


@piece
def _fill_moves(pair, u, left, right, moves):  # type: ignore[no-untyped-def]
    """Fill K_a = (Uᵀ L⁻¹) Ω_a (L U) for the three axes; `left` and `right` are working space."""
    for j in range(3):
        for k in range(3):
            total = load(u, 6 + j) * load(pair, INVERSE + 6 + k)
            for m in range(k, 2):
                total = total + load(u, 3 * m + j) * load(pair, INVERSE + 3 * m + k)
            store(left, 3 * j + k, total)
            total = load(pair, LOWER + 3 * j) * load(u, k)
            for m in range(1, j + 1):
                total = total + load(pair, LOWER + 3 * j + m) * load(u, 3 * m + k)
            store(right, 3 * j + k, total)
    for axis in range(3):
        y, z = (axis + 1) % 3, (axis + 2) % 3
        for j in range(3):
            for k in range(3):
                turned = load(left, 3 * j + z) * load(right, 3 * y + k) - load(left, 3 * j + y) * load(right, 3 * z + k)
                store(moves, 9 * axis + 3 * j + k, turned)


@piece
def _add_diagonal(logs, moves, weight, sums):  # type: ignore[no-untyped-def]
    """Add to gradient and Hessian what the diagonals of K_a give."""
    row = HESSIAN
    for x in range(3):
        total = load(logs, 0) * load(moves, 9 * x)
        for j in range(1, 3):
            total = total + load(logs, j) * load(moves, 9 * x + 4 * j)
        store(sums, GRADIENT + x, load(sums, GRADIENT + x) + 4.0 * weight * total)
        for y in range(x, 3):
            total = load(moves, 9 * x) * load(moves, 9 * y)
            for j in range(1, 3):
                total = total + load(moves, 9 * x + 4 * j) * load(moves, 9 * y + 4 * j)
            store(sums, row, load(sums, row) + 8.0 * weight * total)
            row += 1


@piece
def _add_others(values, logs, moves, weight, sums):  # type: ignore[no-untyped-def]
    """Add to the Hessian what the entries K_jk and K_kj beside the diagonals give."""
    for j in range(2):
        for k in range(j + 1, 3):
            low, high, log_low, log_high = load(values, 4 * j), load(values, 4 * k), load(logs, j), load(logs, k)
            gap, middle = low - high, 0.5 * (low + high)
            near, ratio = magnitude(gap) < NEAR * middle, high / low
            apart = (log_low * ratio - log_high) / (high * where(near, 1.0, gap))
            # the logarithm of the middle is the middle of the logarithms, for values as near as that
            slope = 4.0 * weight * where(near, (1.0 - 0.5 * (log_low + log_high)) / (middle * middle), apart)
            mixed = 2.0 * weight * (log_low + log_high)
            first, other = 4.0 * weight * log_low * ratio, 4.0 * weight * log_high / ratio
            row, upper, lower = HESSIAN, 3 * j + k, 3 * k + j
            for x in range(3):
                p, q = load(moves, 9 * x + upper), load(moves, 9 * x + lower)
                change = slope * (p * high + q * low)
                p, q = mixed * q + first * p, mixed * p + other * q
                for y in range(x, 3):
                    r, s = load(moves, 9 * y + upper), load(moves, 9 * y + lower)
                    store(sums, row, load(sums, row) + change * (r * high + s * low) + p * r + q * s)
                    row += 1


@around
def _length(vector):  # type: ignore[no-untyped-def]
    return np.sqrt(vector[0] * vector[0] + vector[1] * vector[1] + vector[2] * vector[2])


@around
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


@around
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


@njit(cache=True, fastmath=AROUND, **OPTIONS)
def minimize(lower, inverse, teacher, weights, rotation, tol, max_iter, like):  # type: ignore[no-untyped-def]
    """Descend in place from `rotation`; return the cost there and at the end, gradient norm and number of steps.

    The same rules as `RotationProblem.minimize`: a full step counts when it meets Armijo's rule or, where the cost no
    longer resolves it, when it halves the gradient; else it is halved.
    """
    gradient, hessian = np.empty(3), np.empty((3, 3))
    new_gradient, new_hessian = np.empty(3), np.empty((3, 3))
    frame, direction, moved = np.empty((3, 3)), np.empty(3), np.empty((3, 3))
    pairs = _packed(lower, inverse, teacher, weights, like)
    cost = _evaluate(pairs, rotation, gradient, hessian, True, like)
    first, norm = cost, _length(gradient)
    steps = 0
    while norm > tol and steps < max_iter:
        slope = _saddle_free_direction(gradient, hessian, frame, direction)
        _turn(rotation, direction, 1.0, moved)
        new_cost = _evaluate(pairs, moved, new_gradient, new_hessian, True, like)
        new_norm = _length(new_gradient)
        taken = new_cost < cost + ARMIJO * slope
        taken = taken or (new_cost <= cost * (1.0 + 1e-6) + 1e-14 and new_norm < 0.5 * norm)
        length = 0.5
        while not taken and length * -slope > EPS * cost and length > 1e-9:
            _turn(rotation, direction, length, moved)
            # with derivatives that may be of no use: without them it would be another function to compile, for seconds
            new_cost = _evaluate(pairs, moved, new_gradient, new_hessian, True, like)
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
