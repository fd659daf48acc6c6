"""Compiled operations on one small symmetric matrix, for kernels that treat matrices one after the other."""

import numpy as np

from maniport.spd.kernels.loops import EPS2
from maniport.util.jit import part


@part
def diagonalize(a, v):  # type: ignore[no-untyped-def]
    """Turn the upper triangle of one matrix into a diagonal by cyclic Jacobi; V gets the eigenvectors, unsorted."""
    n = len(a)
    for i in range(n):
        for j in range(n):
            v[i, j] = 1.0 if i == j else 0.0
    for _ in range(40):
        turned = False
        for p in range(n - 1):
            for q in range(p + 1, n):
                gap, entry = a[q, q] - a[p, p], a[p, q]
                if not entry * entry > EPS2 * abs(a[p, p] * a[q, q]):
                    continue
                turned = True
                twice = -2.0 * entry if gap < 0.0 else 2.0 * entry
                tangent = twice / (abs(gap) + np.sqrt(gap * gap + twice * twice))
                cosine = 1.0 / np.sqrt(1.0 + tangent * tangent)
                sine = tangent * cosine
                a[p, p] -= tangent * entry
                a[q, q] += tangent * entry
                a[p, q] = 0.0
                for k in range(n):
                    if k != p and k != q:
                        i, j, m, o = min(k, p), max(k, p), min(k, q), max(k, q)
                        x, y = a[i, j], a[m, o]
                        a[i, j], a[m, o] = cosine * x - sine * y, sine * x + cosine * y
                    x, y = v[k, p], v[k, q]
                    v[k, p], v[k, q] = cosine * x - sine * y, sine * x + cosine * y
        if not turned:
            break


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
    multiply(left, a, b)
    multiply(b, left.T, a)
