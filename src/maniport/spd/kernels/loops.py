"""Compiled loops over batches of small symmetric matrices: few operations, each compiled once.

Matrices are diagonalized in blocks of shape (n, n, width): the innermost loops run over the matrices of a block, which
lie side by side in memory, so that they become vector instructions. A matrix gets the same bits alone and in any batch.

All arrays are C-contiguous float64; results are written to the last arguments.
"""

import numpy as np

from maniport.util.jit import kernel, part

WIDTH = 64  # Matrices of a block: 32 take 15 % longer, and of more, 6×6 matrices leave the fastest cache
# Square of the relative size of off-diagonal entries that count as zero
EPS2 = float(np.finfo(np.float64).eps) ** 2
KAPPA = 1e-4  # κ: a transferred ellipsoid as flat as the damping keeps √κ of it, a round one loses all but κ of it
APART = 1e-9  # Least ratio of the eigenvalues of A⁻¹B up to which a distance is computed from them


@part
def diagonalize(a, v, turns):
    """Turn A (n, n, width) into diagonal matrices by cyclic Jacobi; V (n, n, width) gets the eigenvectors."""
    n = a.shape[0]
    for i in range(v.shape[0]):
        for j in range(n):
            for w in range(v.shape[2]):
                if i == j:
                    v[i, j, w] = 1.0
                else:
                    v[i, j, w] = 0.0
    for _ in range(40):
        turned = 0
        for p in range(n - 1):
            for q in range(p + 1, n):
                large = _annihilate(a, p, q, turns)
                turned += large
                if large > 0:
                    for k in range(p):
                        _rotate(a, k, p, k, q, turns)
                    for k in range(p + 1, q):
                        _rotate(a, p, k, k, q, turns)
                    for k in range(q + 1, n):
                        _rotate(a, p, k, q, k, turns)
                    for k in range(v.shape[0]):
                        _rotate(v, k, p, k, q, turns)
        if turned == 0:
            break


@part
def _annihilate(a, p, q, turns):
    """Set entries (p, q) to zero; fill cosines and sines; return how many matrices are rotated."""
    rotated = 0
    for w in range(a.shape[2]):
        app = a[p, p, w]
        aqq = a[q, q, w]
        apq = a[p, q, w]
        large = apq * apq > EPS2 * abs(app * aqq)
        rotated += large
        gap = aqq - app
        if large:
            twice = 2.0 * apq
        else:
            twice = 0.0
        if gap < 0.0:
            twice = -twice
        tangent = twice / (abs(gap) + np.sqrt(gap * gap + twice * twice) if large else 1.0)
        cosine = 1.0 / np.sqrt(1.0 + tangent * tangent)
        turns[0, w] = cosine
        turns[1, w] = tangent * cosine
        a[p, p, w] = app - tangent * apq
        a[q, q, w] = aqq + tangent * apq
        if large:
            a[p, q, w] = 0.0
        else:
            a[p, q, w] = apq
    return rotated


@part
def _rotate(a, i, j, k, m, turns):
    for w in range(a.shape[2]):
        x = a[i, j, w]
        y = a[k, m, w]
        a[i, j, w] = turns[0, w] * x - turns[1, w] * y
        a[k, m, w] = turns[1, w] * x + turns[0, w] * y


@part
def _fill(block, matrices, start):
    """Copy matrices from `start` on into a block; a single one, or the last, fills the rest."""
    n, width = block.shape[1:]
    last = len(matrices) - 1
    for i in range(n):
        for j in range(n):
            for w in range(width):
                block[i, j, w] = matrices[min(start + w, last), i, j]


@kernel
def eigh_loop(matrices, ascending, values, vectors):
    """Write eigenvalues (count, n) and eigenvectors (count, n, n) in columns; (count, 0, n) takes none.

    The order is ascending, or else that of the diagonals on which they are found.
    """
    count, n = values.shape
    width = min(WIDTH, count)
    a = np.empty((n, n, width))
    v = np.empty((vectors.shape[1], n, width))
    turns = np.empty((2, width))
    order = np.empty(n, np.intp)
    for start in range(0, count, width):
        _fill(a, matrices, start)
        diagonalize(a, v, turns)
        for w in range(min(width, count - start)):
            row = start + w
            for i in range(n):
                place = i
                while ascending and place > 0 and values[row, place - 1] > a[i, i, w]:
                    values[row, place] = values[row, place - 1]
                    order[place] = order[place - 1]
                    place -= 1
                values[row, place] = a[i, i, w]
                order[place] = i
            for k in range(len(v)):
                for i in range(n):
                    vectors[row, k, i] = v[k, order[i], w]


@kernel
def compose_loop(values, vectors, results):
    """Write V diag(values) Vᵀ of V (count, n, n) and values (count, 1, n); one V or one row of values serves all."""
    count, n = results.shape[:2]
    for row in range(count):
        v = vectors[min(row, len(vectors) - 1)]
        x = values[min(row, len(values) - 1), 0]
        for i in range(n):
            for j in range(i, n):
                total = 0.0
                for k in range(n):
                    total += v[i, k] * x[k] * v[j, k]
                results[row, i, j] = results[row, j, i] = total


@kernel
def congruence_loop(left, matrices, results):
    """Write L M Lᵀ; one L or one M serves all results."""
    count, n = results.shape[:2]
    width = min(WIDTH, count)
    factor = np.empty((n, n, width))
    a = np.empty((n, n, width))
    b = np.empty((n, n, width))
    for start in range(0, count, width):
        if start == 0 or len(left) > 1:
            _fill(factor, left, start)
        _fill(a, matrices, start)
        _transform(factor, a, b)
        for i in range(n):
            for j in range(i, n):
                for w in range(min(width, count - start)):
                    results[start + w, i, j] = results[start + w, j, i] = a[i, j, w]


@part
def _multiply(left, a, b):
    """B ← L A."""
    n, width = a.shape[1:]
    for i in range(n):
        for j in range(n):
            for w in range(width):
                b[i, j, w] = left[i, 0, w] * a[0, j, w]
            for k in range(1, n):
                for w in range(width):
                    b[i, j, w] += left[i, k, w] * a[k, j, w]


@part
def _transform(left, a, b):
    """Set A ← L A Lᵀ, its upper triangle; overwrite B."""
    n, width = a.shape[1:]
    _multiply(left, a, b)
    for i in range(n):
        for j in range(i, n):
            for w in range(width):
                a[i, j, w] = b[i, 0, w] * left[j, 0, w]
            for k in range(1, n):
                for w in range(width):
                    a[i, j, w] += b[i, k, w] * left[j, k, w]


@kernel
def raise_loop(values, exponent, low, high):
    """Raise eigenvalues (count, n) to a power; return the first one out of bounds, -1 for a negative, else nan."""
    for row in range(len(values)):
        for i in range(values.shape[1]):
            value = values[row, i]
            if value > 0.0:
                power = value**exponent
            else:
                power = 0.0
            if not low <= power <= high:
                if value > 0.0:
                    return power
                return -1.0
            values[row, i] = power
    return np.nan


@kernel
def release_loop(values, epsilon):
    """Release eigenvalues (count, n) from damping."""
    for row in range(len(values)):
        for i in range(values.shape[1]):
            values[row, i] = release(values[row, i], epsilon)


@kernel
def log_norm_loop(values, results):
    """Write the norms of the logarithms of eigenvalues (count, n); nan where their ratio is too large."""
    for row in range(len(results)):
        smallest = values[row, 0]
        largest = values[row, 0]
        squares = 0.0
        for i in range(values.shape[1]):
            value = values[row, i]
            smallest = min(smallest, value)
            largest = max(largest, value)
            logarithm = np.log(value)
            squares += logarithm * logarithm
        if smallest > APART * largest:
            results[row] = np.sqrt(squares)
        else:
            results[row] = np.nan


@kernel
def whiten_loop(a, b, results):
    """Write the upper triangles of L⁻¹ B L⁻ᵀ with A = L Lᵀ; one A or one B serves all."""
    count, n = results.shape[:2]
    width = min(WIDTH, count)
    factor = np.empty((n, n, width))
    white = np.empty((n, n, width))
    for start in range(0, count, width):
        if start == 0 or len(a) > 1:
            _fill(factor, a, start)
            _factorize(factor)
        _fill(white, b, start)
        _whiten(factor, white)
        for i in range(n):
            for j in range(i, n):
                for w in range(min(width, count - start)):
                    results[start + w, i, j] = white[i, j, w]


@part
def _factorize(a):
    """Replace the lower triangle of A by its Cholesky factor L, with 1 / L_ii on the diagonal."""
    n, width = a.shape[1:]
    for j in range(n):
        for w in range(width):
            a[j, j, w] = 1.0 / np.sqrt(a[j, j, w] if a[j, j, w] > 0.0 else np.nan)
        for i in range(j + 1, n):
            for w in range(width):
                a[i, j, w] *= a[j, j, w]
            for k in range(j + 1, i + 1):
                for w in range(width):
                    a[i, k, w] -= a[i, j, w] * a[k, j, w]


@part
def _whiten(factor, b):
    """B ← L⁻¹ B L⁻ᵀ, its upper triangle, by substitution."""
    n, width = b.shape[1:]
    for j in range(n):
        for i in range(n):
            for k in range(i):
                for w in range(width):
                    b[i, j, w] -= factor[i, k, w] * b[k, j, w]
            for w in range(width):
                b[i, j, w] *= factor[i, i, w]
    for i in range(n):
        for j in range(i, n):
            for k in range(j):
                for w in range(width):
                    b[i, j, w] -= b[min(i, k), max(i, k), w] * factor[j, k, w]
            for w in range(width):
                b[i, j, w] *= factor[j, j, w]


@part
def release(value, epsilon):
    """Return the y with y (y + ε) / (y + κ ε) = `value`."""
    gap = value - epsilon
    root = np.sqrt(gap * gap + (4.0 * KAPPA * epsilon) * value)
    if gap > 0.0:
        return 0.5 * (gap + root)
    return 2.0 * KAPPA * epsilon * value / (root - gap)
