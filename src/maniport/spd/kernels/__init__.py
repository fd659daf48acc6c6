"""The loops over many small matrices that everything else stands on; private to maniport.

- `batches`: the kernels as the other modules call them, on batches of any shape;
- `loops`, made of `pieces`: the compiled loops, sixteen matrices at a time by `lanes`;
- `twins`: the same in plain NumPy, for comparison and from 12×12 up, where LAPACK is as fast;
- `threads`: sharing a large batch.

Eigenvalues come from cyclic Jacobi (Golub & Van Loan, Matrix Computations, § 8.5). It is also the more accurate choice:
a rotation is skipped only when the off-diagonal entry is below machine precision relative to its two diagonal entries,
so that small eigenvalues of graded matrices keep their digits.
"""

from maniport.spd.kernels.batches import (
    ILL_CONDITIONED,
    LAPACK_FROM,
    MAX_EIGENVALUE,
    MIN_EIGENVALUE,
    compose,
    congruence,
    distances,
    eigh,
    moments,
    power_congruence,
    require_in_range,
)
from maniport.spd.kernels.lanes import LANES
from maniport.spd.kernels.twins import MAX_SWEEPS, Moments, eigh_numpy, mandel_basis, symmetrize

__all__ = [
    "ILL_CONDITIONED",
    "LANES",
    "LAPACK_FROM",
    "MAX_EIGENVALUE",
    "MAX_SWEEPS",
    "MIN_EIGENVALUE",
    "Moments",
    "compose",
    "congruence",
    "distances",
    "eigh",
    "eigh_numpy",
    "mandel_basis",
    "moments",
    "power_congruence",
    "require_in_range",
    "symmetrize",
]
