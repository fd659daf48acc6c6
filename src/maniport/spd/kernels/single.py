"""Parts of kernels that map one ellipsoid; all matrices have the shape (n, n)."""

from maniport.spd.kernels.loops import diagonalize_one
from maniport.util.jit import part
from maniport.util.validation import SPD_TOLERANCE, SYMMETRY_TOLERANCE


@part
def admit(point, a, v, x, added, floor):  # type: ignore[no-untyped-def]  # Numba infers the types
    """Set A ← P + added I, the eigenvalues of P first lifted to `eigenvalue_floor`; overwrite V and X."""
    n, largest = len(point), 0.0
    for i in range(n):
        for j in range(n):
            largest = max(largest, abs(point[i, j]))
    for i in range(n):
        for j in range(n):
            if not abs(point[i, j] - point[j, i]) <= SYMMETRY_TOLERANCE * largest:  # also true for nan
                return 1
            a[i, j] = 0.5 * (point[i, j] + point[j, i])
    if floor > 0.0:
        diagonalize_one(a, v)
        for i in range(n):
            if a[i, i] < -SPD_TOLERANCE * n * largest:
                return 2
            x[i] = max(a[i, i], floor)
        compose(x, v, a)
    for i in range(n):
        a[i, i] += added
    return 0


@part
def compose(x, v, a):  # type: ignore[no-untyped-def]
    """Set A ← V diag(x) Vᵀ."""
    n = len(x)
    for i in range(n):
        for j in range(i, n):
            total = 0.0
            for k in range(n):
                total += v[i, k] * x[k] * v[j, k]
            a[i, j] = a[j, i] = total


@part
def multiply(left, v, b):  # type: ignore[no-untyped-def]
    """B ← L V."""
    n = len(v)
    for i in range(n):
        for j in range(n):
            total = 0.0
            for k in range(n):
                total += left[i, k] * v[k, j]
            b[i, j] = total


@part
def congruence(left, a, b):  # type: ignore[no-untyped-def]
    """Set A ← L A Lᵀ; overwrite B."""
    n = len(a)
    multiply(left, a, b)
    for i in range(n):
        for j in range(i, n):
            total = 0.0
            for k in range(n):
                total += b[i, k] * left[j, k]
            a[i, j] = a[j, i] = total
