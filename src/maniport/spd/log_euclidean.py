"""The log-Euclidean metric on SPD matrices: the Euclidean metric between matrix logarithms.

Arsigny, Fillard, Pennec & Ayache, Geometric Means in a Novel Vector Space Structure on SPD Matrices, SIMAX 2007.
Flat, so that geodesics, means and transport are straight lines in log space; invariant under rotation and scaling,
not under every congruence. Same names and signatures as `maniport.spd.affine_invariant`.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from maniport.spd.kernels import eigh, symmetrize
from maniport.spd.matrix_functions import apply, bounded
from maniport.util.validation import Array, as_finite, as_spd, as_symmetric, require_broadcast


def distance(a: ArrayLike, b: ArrayLike) -> Array:
    """Distance ‖log A − log B‖_F; shape (...)."""
    points_a = as_spd(a, "a", copy=False)
    points_b = as_spd(b, "b", points_a.shape[-1], copy=False)
    require_broadcast(a=points_a, b=points_b)
    return np.asarray(np.linalg.norm(apply(points_a, np.log) - apply(points_b, np.log), axis=(-2, -1)))


def inner(base: ArrayLike, first: ArrayLike, second: ArrayLike) -> Array:
    """Inner product ⟨D_P log L₁, D_P log L₂⟩_F of two tangents at `base`; shape (...)."""
    point = as_spd(base, "base")
    d = point.shape[-1]
    left, right = as_symmetric(first, "first", d), as_symmetric(second, "second", d)
    require_broadcast(base=point, first=left, second=right)
    return np.asarray(np.sum(_to_log_space(point, left) * _to_log_space(point, right), axis=(-2, -1)))


def log(base: ArrayLike, point: ArrayLike) -> Array:
    """Tangent at `base` that points to `point`: the derivative of exp at log P applied to log M − log P."""
    center = as_spd(base, "base")
    other = as_spd(point, "point", center.shape[-1])
    require_broadcast(base=center, point=other)
    return _from_log_space(center, apply(other, np.log) - apply(center, np.log))


def exp(base: ArrayLike, tangent: ArrayLike) -> Array:
    """Point reached from `base` along `tangent`: exp(log P + D_P log L); the inverse of `log`."""
    center = as_spd(base, "base")
    step = as_symmetric(tangent, "tangent", center.shape[-1])
    require_broadcast(base=center, tangent=step)
    return apply(apply(center, np.log) + _to_log_space(center, step), bounded(np.exp, "tangent"))


def geodesic(a: ArrayLike, b: ArrayLike, t: ArrayLike) -> Array:
    """Point at parameter t on the geodesic from A to B: exp((1 − t) log A + t log B)."""
    start = as_spd(a, "a")
    end = as_spd(b, "b", start.shape[-1])
    parameter = as_finite(t, "t")[..., None, None]
    require_broadcast(a=start, b=end, t=parameter)
    along = (1.0 - parameter) * apply(start, np.log) + parameter * apply(end, np.log)
    return apply(along, bounded(np.exp, "t"))


def transport(tangent: ArrayLike, start: ArrayLike, end: ArrayLike) -> Array:
    """Parallel transport of a tangent from `start` to `end`: the same vector in log space."""
    origin = as_spd(start, "start")
    target = as_spd(end, "end", origin.shape[-1])
    vector = as_symmetric(tangent, "tangent", origin.shape[-1])
    require_broadcast(tangent=vector, start=origin, end=target)
    return _from_log_space(target, _to_log_space(origin, vector))


def _to_log_space(base: Array, tangent: Array) -> Array:
    """Apply the derivative of the matrix logarithm at `base` to a tangent."""
    return _differential(base, tangent, lambda slopes: slopes)


def _from_log_space(base: Array, vector: Array) -> Array:
    """Apply the derivative of the matrix exponential at log `base` to a symmetric matrix."""
    return _differential(base, vector, lambda slopes: 1.0 / slopes)


def _differential(base: Array, symmetric: Array, use: Callable[[Array], Array]) -> Array:
    """Multiply by divided differences of log in the eigenbasis of `base` (Daleckii-Krein)."""
    values, vectors = eigh(base)
    # ordered, for the quotient is exact only when the larger value is measured by the smaller one
    low = np.minimum(values[..., :, None], values[..., None, :])
    high = np.maximum(values[..., :, None], values[..., None, :])
    gap = (high - low) / low
    near = gap < 1e-4
    safe = np.where(near, 1.0, gap)
    # log(1 + x) / x, by its series where the quotient would lose digits
    ratio = np.where(near, 1.0 - gap / 2 + gap**2 / 3 - gap**3 / 4, np.log1p(safe) / safe)
    transposed = np.swapaxes(vectors, -1, -2)
    return symmetrize(vectors @ (use(ratio / low) * (transposed @ symmetric @ vectors)) @ transposed)
