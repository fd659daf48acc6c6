"""The space of symmetric positive-definite (SPD) matrices, where manipulability ellipsoids live.

The metric is the affine-invariant one. Every function takes any batch shape (..., d, d) with d from 2 to 12 and checks
its input.
"""

from maniport.spd.affine_invariant import distance, exp, geodesic, inner, log, transport
from maniport.spd.ellipsoid import axes, lengths, volume
from maniport.spd.matrix_functions import expm, from_vector, logm, powm, to_vector
from maniport.spd.mean import dispersion, mean

__all__ = [
    "axes",
    "dispersion",
    "distance",
    "exp",
    "expm",
    "from_vector",
    "geodesic",
    "inner",
    "lengths",
    "log",
    "logm",
    "mean",
    "powm",
    "to_vector",
    "transport",
    "volume",
]
