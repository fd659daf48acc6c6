"""The lengths field compiled: for sixteen matrices at a time, and for a batch."""

from maniport.spd.kernels import MAX_EIGENVALUE, MIN_EIGENVALUE
from maniport.spd.kernels.loops import compiled
from maniport.spd.kernels.pieces import (
    block,
    compose,
    diagonalise,
    exp,
    fill,
    log,
    mirror,
    piece,
    spill,
)
from maniport.spd.kernels.words import anywhere, everywhere, load, root, spread, store, where, width
from maniport.validation import SPD_TOLERANCE

PARTS = "dd964c72f705"
"""Digest of `pieces.py` and `words.py` in `spd/kernels`. Numba's cache does not see the files of the functions called
from here: whenever one changes, so must this line. A test tells the digest."""

ROOT2 = 2.0**0.5
ROUNDED = 0.1 * SPD_TOLERANCE
"""Share of the trace up to which an eigenvalue may be a zero that was rounded up."""


@piece
def change_lengths(a, base, parts, centers, lengths, pivots, turns, release, b, v, x, u, n):  # type: ignore[no-untyped-def]
    """A ← the map of `LengthsMap` of A, whose terms are there; False: an eigenvalue or its image is out of range.

    `base` holds s, what is added to s log λ, ℓ̄, 1 / w² and δ²; `parts` (D or 0, D) the `harmonics` of an axis;
    `centers` (m, D + 1) φ(c) / w² and −|φ(c)|² / 2w², `pivots` (m or 0, D + 1) the same of c; `lengths` (m, 3) and
    `turns` (m or 0, D) the coefficients; `release` ε and κ, ε negative where nothing is released. The blocks B, V (n²
    rows), X (n rows) and U (2D rows) are overwritten.
    """
    size = n * (n + 1) // 2
    fine, square = logarithm(a, base, b, v, x, u, n)
    if not fine:
        return False
    for j in range(len(pivots)):
        exponent = square + pivots[j, size]
        for k in range(size):
            exponent = exponent + pivots[j, k] * load(u, k)
        near = exp(exponent)
        for k in range(size):
            store(u, size + k, load(u, size + k) + turns[j, k] * near)
    if len(parts) > 0:
        square = (-0.5 * base[3]) * unturned(u, parts, base[4])
    first, second, third = spread(0.0, a), spread(0.0, a), spread(0.0, a)
    for j in range(len(centers)):
        exponent = square + centers[j, size]
        for k in range(size):
            exponent = exponent + centers[j, k] * load(u, k)
        near = exp(exponent)
        first = first + lengths[j, 0] * near
        second = second + lengths[j, 1] * near
        third = third + lengths[j, 2] * near
    return image(a, base, first, second, third, len(turns) > 0, release, v, x, u, n)


@piece
def logarithm(a, base, b, v, x, u, n):  # type: ignore[no-untyped-def]
    """Fill V and X with the eigenvectors and -values of L, U with vec L and zeros; return also −|L|² / 2w².

    A and B are overwritten. False: an eigenvalue of A is out of range.
    """
    size = n * (n + 1) // 2
    diagonalise(a, v, n, n)
    trace, square = load(a, 0), spread(0.0, a)
    for i in range(1, n):
        trace = trace + load(a, i * n + i)
    for i in range(n):
        value = load(a, i * n + i)
        if not everywhere(value > ROUNDED * trace):
            return False, square
        store(x, i, base[0] * log(value) + base[1])
    compose(b, x, v, n)
    row = n
    for i in range(n):
        for j in range(i, n):
            value = load(b, i * n + j)
            if i == j:
                store(u, i, value)
            else:
                value = ROOT2 * value
                store(u, row, value)
                row += 1
            square = square + value * value
    for k in range(size):
        store(u, size + k, spread(0.0, a))
    return True, (-0.5 * base[3]) * square


@piece
def image(a, base, first, second, third, turned, release, v, x, u, n):  # type: ignore[no-untyped-def]
    """A ← the image, from the field's three numbers, X and V of `logarithm` and, where `turned`, U below vec L."""
    size = n * (n + 1) // 2
    for i in range(n):
        length = load(x, i)
        shrunk = exp(-length)
        t = (1.0 - shrunk) / (1.0 + shrunk)
        store(x, i, length + (first + t * (second + t * third)))
    if turned:
        compose(a, x, v, n)
        row = size + n
        for i in range(n):
            store(a, i * n + i, load(a, i * n + i) + load(u, size + i))
            for j in range(i + 1, n):
                store(a, i * n + j, load(a, i * n + j) + (1.0 / ROOT2) * load(u, row))
                row += 1
        diagonalise(a, v, n, n)
        for i in range(n):
            store(x, i, load(a, i * n + i))
    for i in range(n):
        value = exp(load(x, i) + base[2])
        if release[0] >= 0.0:
            value = released(value, release[0], release[1])
        if anywhere(value < MIN_EIGENVALUE) or anywhere(value > MAX_EIGENVALUE):
            return False
        store(x, i, value)
    compose(a, x, v, n)
    mirror(a, n)
    return True


@piece
def unturned(u, parts, soft):  # type: ignore[no-untyped-def]
    """Replace vec L in U by its `features` about an axis, whose `harmonics` are there, with δ²; return their square."""
    along, mean = part(u, parts, 0), part(u, parts, 1)
    a, b = part(u, parts, 2), part(u, parts, 3)
    c, e = part(u, parts, 4), part(u, parts, 5)
    once, twice = a * a + b * b, c * c + e * e
    both, squares, product = once + 4.0 * twice + soft, a * a - b * b, 2.0 * (a * b)
    once, twice = root(once + soft), root(twice + soft)
    scale = 1.0 / (once * root(both))
    together, against = (squares * c + product * e) * scale, (product * c - squares * e) * scale
    store(u, 0, along)
    store(u, 1, mean)
    store(u, 2, once)
    store(u, 3, twice)
    store(u, 4, together)
    store(u, 5, against)
    square = along * along + mean * mean + once * once + twice * twice
    return square + together * together + against * against


@piece
def part(u, parts, row):  # type: ignore[no-untyped-def]
    """A row of the harmonics, of vec L in U."""
    found = parts[row, 0] * load(u, 0)
    for k in range(1, 6):
        found = found + parts[row, k] * load(u, k)
    return found


@piece
def released(value, epsilon, kappa):  # type: ignore[no-untyped-def]
    """The y with y (y + ε) / (y + κ ε) = `value`."""
    gap = value - epsilon
    way = root(gap * gap + (4.0 * kappa * epsilon) * value)
    return where(gap > 0.0, 0.5 * (gap + way), ((2.0 * kappa * epsilon) * value) / where(gap > 0.0, 1.0, way - gap))


@compiled
def field_loop(matrices, base, parts, centers, lengths, pivots, turns, release, results, first, last, like):  # type: ignore[no-untyped-def]
    """Map matrices (count, n, n). False: an eigenvalue or its image is out of range."""
    n = matrices.shape[1]
    a, b, v = block(n * n, like), block(n * n, like), block(n * n, like)
    x, u = block(n, like), block(n * (n + 1), like)
    for start in range(first, last, width(like)):
        fill(a, matrices, start, last, 1)
        if not change_lengths(a, base, parts, centers, lengths, pivots, turns, release, b, v, x, u, n):
            return False
        spill(a, results, start, last)
    return True
