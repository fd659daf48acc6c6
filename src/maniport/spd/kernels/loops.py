"""The compiled loops over a batch, each on blocks of matrices that lie side by side.

Every loop works on matrices `first` to `last` of a batch, so that threads can share it, and releases the GIL. How many
it takes at a time, sixteen or one, the type of its last argument says: `words.SIXTEEN` or `words.ONE`. The same in
NumPy is in `twins`.
"""

from maniport.compiling import njit
from maniport.spd.kernels.pieces import (
    add_hessian,
    block,
    compose,
    congruence,
    diagonalise,
    factorise,
    fill,
    log,
    mirror,
    power_between,
    sort,
    spill,
    whiten,
)
from maniport.spd.kernels.words import everywhere, load, put, root, spread, store, take, where, width

PARTS = "dd964c72f705"
"""Digest of `lanes.py`, `pieces.py` and `words.py`. Numba's cache recompiles these loops when this file changes, but
does not see the files of the functions called from here: whenever one changes, so must this line. A test tells it."""

NOTHING = float("nan")
APART = 1e-9
"""Least ratio of the eigenvalues of A⁻¹B up to which a distance is computed from them."""

compiled = njit(cache=True, error_model="numpy", fastmath={"contract"}, nogil=True)


@compiled
def eigh_loop(matrices, values, vectors, first, last, like):  # type: ignore[no-untyped-def]  # Numba infers the types
    """Diagonalise matrices (count, n, n) into ascending values (count, n) and columns vectors (count, n, n)."""
    n = matrices.shape[1]
    a, v = block(n * n, like), block(n * n, like)
    for start in range(first, last, width(like)):
        fill(a, matrices, start, last, 1)
        diagonalise(a, v, n, n)
        sort(a, v, n)
        for lane in range(min(width(like), last - start)):
            for i in range(n):
                values[start + lane, i] = take(a, i * n + i, lane)
        spill(v, vectors, start, last)


@compiled
def compose_loop(values, vectors, results, first, last, like):  # type: ignore[no-untyped-def]
    """Build V diag(values) Vᵀ."""
    n = vectors.shape[1]
    a, v, x = block(n * n, like), block(n * n, like), block(n, like)
    for start in range(first, last, width(like)):
        fill(v, vectors, start, last, 1)
        for lane in range(width(like)):
            for i in range(n):
                put(x, i, lane, values[min(start + lane, last - 1), i])
        compose(a, x, v, n)
        mirror(a, n)
        spill(a, results, start, last)


@compiled
def congruence_loop(left, each, matrices, repeat, results, first, last, like):  # type: ignore[no-untyped-def]
    """Build L M Lᵀ; each L serves `each` results in a row and each M `repeat`, before the next one's turn."""
    n = matrices.shape[1]
    a, b, c = block(n * n, like), block(n * n, like), block(n * n, like)
    for start in range(first, last, width(like)):
        if start == first or len(left) > 1:
            fill(a, left, start, last, each)
        fill(b, matrices, start, last, repeat)
        congruence(a, b, c, n)
        mirror(b, n)
        spill(b, results, start, last)


@compiled
def distance_loop(a, each, b, repeat, results, first, last, like):  # type: ignore[no-untyped-def]
    """Distances of pairs; each A serves `each` results in a row and each B `repeat`.

    Where the eigenvalues of A⁻¹B lie so far apart that rounding may have its say in the smallest, the result is nan.
    """
    n = a.shape[1]
    x, y, z, total = block(n * n, like), block(n * n, like), block(n * n, like), block(1, like)
    for start in range(first, last, width(like)):
        if start == first or len(a) > 1:
            fill(x, a, start, last, each)
            factorise(x, n)
        fill(y, b, start, last, repeat)
        whiten(x, y, n)
        diagonalise(y, z, n, 0)
        squares, smallest, largest = spread(0.0, like), load(y, 0), load(y, 0)
        for i in range(n):
            value = load(y, i * n + i)
            smallest = where(value < smallest, value, smallest)
            largest = where(value > largest, value, largest)
            logarithm = log(value)
            squares = squares + logarithm * logarithm
        store(total, 0, where(smallest > APART * largest, root(squares), NOTHING))
        for lane in range(min(width(like), last - start)):
            results[start + lane] = take(total, 0, lane)


@compiled
def power_loop(left, matrices, power, right, low, high, results, first, last, like):  # type: ignore[no-untyped-def]
    """Build R (L M Lᵀ)^s Rᵀ with one L and one R for all. False: an eigenvalue or its power is out of range."""
    n = matrices.shape[1]
    a, b, v = block(n * n, like), block(n * n, like), block(n * n, like)
    x, outer, inner = block(n, like), block(n * n, like), block(n * n, like)
    fill(inner, left, 0, 1, 1)
    fill(outer, right, 0, 1, 1)
    for start in range(first, last, width(like)):
        fill(a, matrices, start, last, 1)
        if not power_between(inner, a, power, outer, low, high, b, v, x, n):
            return False
        spill(a, results, start, last)
    return True


@compiled
def moments_loop(points, whitening, weights, sizes, sums, curved, first, last, like):  # type: ignore[no-untyped-def]
    """Add up what one step toward the Fréchet mean needs, over points whitened by one symmetric matrix.

    Fills `sums`: cost ½ Σ w d², rounding Σ w size / λ_min, upper triangle of the gradient Σ w log Y, and when `curved`
    upper triangle of the Hessian in the Mandel basis (diagonal first). False: rounding made a point indefinite.
    """
    n = points.shape[1]
    m = n * (n + 1) // 2
    a, b, v = block(n * n, like), block(n * n, like), block(n * n, like)
    inner, x, logs, turned = block(n * n, like), block(2, like), block(n, like), block(m, like)
    total = block(len(sums), like)
    total[:] = 0.0
    fill(inner, whitening, 0, 1, 1)
    for start in range(first, last, width(like)):
        fill(a, points, start, last, 1)
        for lane in range(width(like)):
            here = min(start + lane, last - 1)
            put(x, 0, lane, weights[here] if start + lane < last else 0.0)
            put(x, 1, lane, sizes[here])
        congruence(inner, a, b, n)
        diagonalise(a, v, n, n)
        weight, squares, smallest = load(x, 0), spread(0.0, like), load(a, 0)
        for i in range(n):
            value = load(a, i * n + i)
            if not everywhere(value > 0.0):
                return False
            smallest = where(value < smallest, value, smallest)
            logarithm = log(value)
            squares = squares + logarithm * logarithm
            store(logs, i, logarithm)
        store(total, 0, load(total, 0) + 0.5 * weight * squares)
        store(total, 1, load(total, 1) + weight * load(x, 1) / smallest)
        compose(b, logs, v, n)
        row = 2
        for i in range(n):
            for j in range(i, n):
                store(total, row, load(total, row) + weight * load(b, i * n + j))
                row += 1
        if curved:
            add_hessian(a, v, logs, weight, turned, total, n)
    for row in range(len(sums)):
        sums[row] = 0.0
        for lane in range(width(like)):
            sums[row] += take(total, row, lane)
    return True
