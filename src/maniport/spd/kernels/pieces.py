"""The pieces of the compiled loops: linear algebra on a block of matrices at once.

A block has one row for each entry: row i·n + j holds entry (i, j) of all its matrices. A vector of eigenvalues has n
rows. The functions are stored in Numba's cache as parts of the loops that call them, see `loops.PARTS`.
"""

import numpy as np

from maniport.compiling import njit
from maniport.spd.kernels.words import (
    anywhere,
    everywhere,
    exponent,
    gather,
    load,
    magnitude,
    mantissa,
    nearest,
    power_of_two,
    put,
    root,
    scatter,
    spread,
    store,
    take,
    where,
    width,
)
from maniport.validation import SPD_TOLERANCE, SYMMETRY_TOLERANCE

MAX_SWEEPS = 40
EPS2 = float(np.finfo(np.float64).eps) ** 2
NEAR = 1e-3
"""Half the log ratio of two eigenvalues below which x coth x is taken from its series."""

LN2_HIGH, LN2_LOW = 6.93147180369123816490e-01, 1.90821492927058770002e-10

piece = njit(error_model="numpy", fastmath={"contract"}, no_cpython_wrapper=True, no_cfunc_wrapper=True)


@piece
def block(rows, like):  # type: ignore[no-untyped-def]  # Numba infers the types
    """Make a working block as wide as another."""
    return np.empty((rows, *like.shape[1:]))


@piece
def add_hessian(a, v, logs, weight, turned, total, n):  # type: ignore[no-untyped-def]  # Numba infers the types
    """Add w Σ_pq stretch_pq (Vᵀ E_k V)_pq (Vᵀ E_l V)_pq for all elements E_k, E_l, k ≤ l, of the Mandel basis."""
    m = n * (n + 1) // 2
    for p in range(n):
        for q in range(p, n):
            half_gap = 0.5 * (load(logs, p) - load(logs, q))
            one, other = load(a, p * n + p), load(a, q * n + q)
            near = magnitude(half_gap) < NEAR
            # coth of half the log ratio is the sum over the difference
            coth = (one + other) / where(near, 1.0, one - other)
            stretch = weight * where(near, 1.0 + half_gap * half_gap * (1.0 / 3.0), half_gap * coth)
            stretch = stretch if p == q else 2.0 * stretch
            row = n
            for i in range(n):
                store(turned, i, load(v, i * n + p) * load(v, i * n + q))
                for j in range(i + 1, n):
                    cross = load(v, i * n + p) * load(v, j * n + q) + load(v, j * n + p) * load(v, i * n + q)
                    store(turned, row, np.sqrt(0.5) * cross)
                    row += 1
            row = 2 + m
            for k in range(m):
                scaled = stretch * load(turned, k)
                for r in range(k, m):
                    store(total, row, load(total, row) + scaled * load(turned, r))
                    row += 1


@piece
def fill(rows, matrices, start, last, repeat):  # type: ignore[no-untyped-def]
    """Copy matrices into a block; those beyond the last repeat it."""
    count, n = len(matrices), matrices.shape[1]
    if width(rows) > 1 and repeat == 1 and start + width(rows) <= min(last, count):
        for entry in range(n * n):
            store(rows, entry, gather(matrices, start * n * n + entry, n * n, rows))
        return
    for lane in range(width(rows)):
        here = min(start + lane, last - 1) // repeat
        if here >= count:
            here %= count
        for i in range(n):
            for j in range(n):
                put(rows, i * n + j, lane, matrices[here, i, j])


@piece
def spill(rows, results, start, last):  # type: ignore[no-untyped-def]
    """Copy a block into matrices."""
    n = results.shape[1]
    if width(rows) > 1 and start + width(rows) <= last:
        for entry in range(n * n):
            scatter(results, start * n * n + entry, n * n, load(rows, entry))
        return
    for lane in range(min(width(rows), last - start)):
        for i in range(n):
            for j in range(n):
                results[start + lane, i, j] = take(rows, i * n + j, lane)


@piece
def mirror(a, n):  # type: ignore[no-untyped-def]
    """Fill the lower triangle from the upper one."""
    for i in range(n):
        for j in range(i):
            store(a, i * n + j, load(a, j * n + i))


@piece
def diagonalise(a, v, n, rows):  # type: ignore[no-untyped-def]
    """Turn A into its eigenvalues by cyclic Jacobi, reading its upper triangle, and V, `rows` rows of it, along."""
    for i in range(rows):
        for j in range(n):
            store(v, i * n + j, spread(1.0 if i == j else 0.0, v))
    for _ in range(MAX_SWEEPS):
        rotated = False
        for p in range(n - 1):
            for q in range(p + 1, n):
                app, aqq, apq = load(a, p * n + p), load(a, q * n + q), load(a, p * n + q)
                turn = apq * apq > EPS2 * magnitude(app * aqq)
                if not anywhere(turn):
                    continue
                rotated = True
                gap, twice = aqq - app, where(turn, 2.0 * apq, 0.0)
                twice = where(gap < 0.0, -twice, twice)
                near = where(turn, magnitude(gap) + root(gap * gap + twice * twice), 1.0)
                tangent = twice / near
                cosine, shift = 1.0 / root(1.0 + tangent * tangent), tangent * apq
                sine = tangent * cosine
                store(a, p * n + p, app - shift)
                store(a, q * n + q, aqq + shift)
                store(a, p * n + q, where(turn, 0.0, apq))
                for k in range(n):
                    if k != p and k != q:  # only the upper triangle is kept up to date
                        ip, iq = min(k, p) * n + max(k, p), min(k, q) * n + max(k, q)
                        x, y = load(a, ip), load(a, iq)
                        store(a, ip, cosine * x - sine * y)
                        store(a, iq, sine * x + cosine * y)
                for k in range(rows):
                    x, y = load(v, k * n + p), load(v, k * n + q)
                    store(v, k * n + p, cosine * x - sine * y)
                    store(v, k * n + q, sine * x + cosine * y)
        if not rotated:
            break


@piece
def diagonalise_one(a, v):  # type: ignore[no-untyped-def]
    """Turn one matrix (n, n), of which the upper triangle is read, into diag(A) and eigenvectors V, unsorted."""
    diagonalise(a.reshape(-1), v.reshape(-1), len(a), len(a))


@piece
def admit(point, a, v, x, added, floor, n):  # type: ignore[no-untyped-def]
    """A ← P + added I for one matrix P (n, n), the eigenvalues of P first lifted to `floor`; V and X are overwritten.

    Returns 0, or the number of the check that failed: 1 when P is not symmetric and finite, 2 when it is indefinite.
    """
    largest = 0.0
    for i in range(n):
        for j in range(n):
            largest = max(largest, abs(point[i, j]))
    for i in range(n):
        for j in range(n):
            if not abs(point[i, j] - point[j, i]) <= SYMMETRY_TOLERANCE * largest:  # also true for nan
                return 1
            a[i * n + j] = 0.5 * (point[i, j] + point[j, i])
    if floor > 0.0:
        diagonalise(a, v, n, n)
        for i in range(n):
            if a[i * n + i] < -SPD_TOLERANCE * n * largest:
                return 2
            x[i] = max(a[i * n + i], floor)
        compose(a, x, v, n)
        mirror(a, n)
    for i in range(n):
        a[i * n + i] += added
    return 0


@piece
def sort(a, v, n):  # type: ignore[no-untyped-def]
    """Put the eigenvalues in ascending order, and the columns of V with them; equal ones stay as they are."""
    for end in range(n - 1, 0, -1):
        for j in range(end):
            x, y = load(a, j * n + j), load(a, (j + 1) * n + j + 1)
            swap = x > y
            if anywhere(swap):
                store(a, j * n + j, where(swap, y, x))
                store(a, (j + 1) * n + j + 1, where(swap, x, y))
                for k in range(n):
                    x, y = load(v, k * n + j), load(v, k * n + j + 1)
                    store(v, k * n + j, where(swap, y, x))
                    store(v, k * n + j + 1, where(swap, x, y))


@piece
def compose(a, x, v, n):  # type: ignore[no-untyped-def]
    """A = V diag(x) Vᵀ, its upper triangle."""
    for i in range(n):
        for j in range(i, n):
            total = spread(0.0, a)
            for k in range(n):
                total = total + load(v, i * n + k) * load(x, k) * load(v, j * n + k)
            store(a, i * n + j, total)


@piece
def congruence(left, a, b, n):  # type: ignore[no-untyped-def]
    """A ← L A Lᵀ, its upper triangle; B is overwritten."""
    for i in range(n):
        for j in range(n):
            total = spread(0.0, a)
            for k in range(n):
                total = total + load(left, i * n + k) * load(a, k * n + j)
            store(b, i * n + j, total)
    for i in range(n):
        for j in range(i, n):
            total = spread(0.0, a)
            for k in range(n):
                total = total + load(b, i * n + k) * load(left, j * n + k)
            store(a, i * n + j, total)


@piece
def power_between(left, a, power, right, low, high, b, v, x, n):  # type: ignore[no-untyped-def]
    """A ← R (L A Lᵀ)^s Rᵀ; B, V and X are overwritten. False: an eigenvalue or its power is out of range."""
    congruence(left, a, b, n)
    diagonalise(a, v, n, n)
    for i in range(n):
        value = load(a, i * n + i)
        if not everywhere(value > 0.0):
            return False
        raised = exp(power * log(value))
        if anywhere(raised < low) or anywhere(raised > high):
            return False
        store(x, i, raised)
    for i in range(n):  # R V, so that one product is enough
        for j in range(n):
            total = spread(0.0, a)
            for k in range(n):
                total = total + load(right, i * n + k) * load(v, k * n + j)
            store(b, i * n + j, total)
    compose(a, x, b, n)
    mirror(a, n)
    return True


@piece
def factorise(a, n):  # type: ignore[no-untyped-def]
    """Cholesky factor L of A in its lower triangle, with 1 / L_ii on the diagonal; nan where A is not SPD."""
    for j in range(n):
        pivot = load(a, j * n + j)
        for k in range(j):
            pivot = pivot - load(a, j * n + k) * load(a, j * n + k)
        inverse = 1.0 / root(where(pivot > 0.0, pivot, np.nan))
        store(a, j * n + j, inverse)
        for i in range(j + 1, n):
            total = load(a, i * n + j)
            for k in range(j):
                total = total - load(a, i * n + k) * load(a, j * n + k)
            store(a, i * n + j, total * inverse)


@piece
def whiten(factor, b, n):  # type: ignore[no-untyped-def]
    """B ← L⁻¹ B L⁻ᵀ, its upper triangle, by substitution."""
    for j in range(n):
        for i in range(n):
            total = load(b, i * n + j)
            for k in range(i):
                total = total - load(factor, i * n + k) * load(b, k * n + j)
            store(b, i * n + j, total * load(factor, i * n + i))
    for i in range(n):
        for j in range(i, n):
            total = load(b, i * n + j)
            for k in range(j):
                total = total - load(b, min(i, k) * n + max(i, k)) * load(factor, j * n + k)
            store(b, i * n + j, total * load(factor, j * n + j))


@piece
def log(x):  # type: ignore[no-untyped-def]
    """Natural logarithm of positive normal numbers, to one unit in the last place (after Sun's fdlibm)."""
    k, f = exponent(x), mantissa(x) - 1.0
    s = f / (2.0 + f)
    z = s * s
    tail = 1.818357216161805012e-01 + z * (1.531383769920937332e-01 + z * 1.479819860511658591e-01)
    tail = 2.857142874366239149e-01 + z * (2.222219843214978396e-01 + z * tail)
    tail = z * (6.666666666666735130e-01 + z * (3.999999999940941908e-01 + z * tail))
    half = 0.5 * f * f
    return k * LN2_HIGH - ((half - (s * (half + tail) + k * LN2_LOW)) - f)


@piece
def exp(x):  # type: ignore[no-untyped-def]
    """Exponential to one unit in the last place (after Sun's fdlibm); beyond ±700 that of ±700."""
    x = where(x > 700.0, 700.0, where(x < -700.0, -700.0, x))
    k = nearest(x * (1.0 / np.log(2.0)))
    high, low = x - k * LN2_HIGH, k * LN2_LOW
    r = high - low
    z = r * r
    tail = 6.61375632143793436117e-05 + z * (-1.65339022054652515390e-06 + z * 4.13813679705723846039e-08)
    c = r - z * (1.66666666666666019037e-01 + z * (-2.77777777770155933842e-03 + z * tail))
    return (1.0 - ((low - (r * c) / (2.0 - c)) - high)) * power_of_two(k)
