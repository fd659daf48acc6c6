"""A compiled product of small matrices, for kernels that treat matrices one after the other."""

from maniport.util.jit import part


@part
def multiply(left, v, b):
    """B ← L V."""
    n = len(v)
    for i in range(n):
        for j in range(n):
            total = 0.0
            for k in range(n):
                total += left[i, k] * v[k, j]
            b[i, j] = total
