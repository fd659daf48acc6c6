"""The space of symmetric positive-definite (SPD) matrices, where manipulability ellipsoids live.

The metric is the affine-invariant one. Every function takes any batch shape (..., d, d) with d from 2 to 12 and checks
its input.
"""

from maniport.spd.affine_invariant import distance, exp, geodesic, inner, log, transport
from maniport.spd.ellipsoid import axes, condition, lengths, volume
from maniport.spd.matrix_functions import expm, from_vector, invsqrtm, logm, powm, sqrtm, to_vector
from maniport.spd.mean import dispersion, mean, unwhiten, whiten

power = powm

__all__ = [
    "axes",
    "condition",
    "dispersion",
    "distance",
    "exp",
    "expm",
    "from_vector",
    "geodesic",
    "inner",
    "invsqrtm",
    "lengths",
    "log",
    "logm",
    "mean",
    "power",
    "powm",
    "sqrtm",
    "to_vector",
    "transport",
    "unwhiten",
    "volume",
    "whiten",
]
