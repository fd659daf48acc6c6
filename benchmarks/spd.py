"""Operations on SPD matrices, against NumPy and pyRiemann."""

import warnings
from collections.abc import Iterator

import numpy as np
from pyriemann.geometry.distance import distance_riemann
from pyriemann.geometry.mean import mean_riemann

import maniport as mp
from maniport.spd.kernels import eigh

from .inputs import Array, damped, domains, ill_conditioned, spd_matrices
from .measure import Row, compare, duration, faster

WANTED_GRADIENT = 1e-10


def rows(quick: bool) -> Iterator[Row]:
    """Yield eigendecompositions, distances and means."""
    seconds = 0.3 if quick else 3.0
    for n in (10_000, 100_000 if quick else 1_000_000):
        matrices = spd_matrices(n, 3, seed=0)
        times = compare(lambda a=matrices: eigh(a), lambda a=matrices: np.linalg.eigh(a), seconds)
        yield faster(f"eigendecomposition, 3×3, {n:,}", times, "numpy.linalg.eigh", 8)
    for d, wanted in ((3, 8), (6, 4)):
        a = spd_matrices(10_000, d, seed=1)
        b = spd_matrices(10_000, d, seed=2)
        error = float(np.abs(mp.spd.distance(a, b) - distance_riemann(a, b)).max())
        times = compare(
            lambda a=a, b=b: mp.spd.distance(a, b), lambda a=a, b=b: distance_riemann(a, b), seconds
        )
        yield faster(
            f"affine-invariant distance, {d}×{d}, 10,000 pairs",
            times,
            "pyRiemann",
            wanted,
            f"largest difference {error:.1g}",
            error < 1e-9,
        )
    yield _mean(damped(domains(10_000)[1]), "Fréchet mean, 3×3, 10,000 Panda ellipsoids", seconds)
    yield _hard_mean(500 if quick else 2000)


def gradient_norm(center: Array, points: Array) -> float:
    """‖mean log(P^-½ X P^-½)‖_F, computed with NumPy alone."""
    values, vectors = np.linalg.eigh(center)
    inverse_root = (vectors / np.sqrt(values)) @ vectors.T
    values, vectors = np.linalg.eigh(inverse_root @ points @ inverse_root)
    logs = (vectors * np.log(values)[:, None, :]) @ np.swapaxes(vectors, 1, 2)
    return float(np.linalg.norm(logs.mean(axis=0)))


def _pyriemann_mean(points: Array) -> Array:
    with warnings.catch_warnings():
        warnings.simplefilter(
            "ignore", UserWarning
        )  # that it did not converge; the gradient norm is reported
        return mean_riemann(points, tol=WANTED_GRADIENT, maxiter=500)


def _mean(points: Array, work: str, seconds: float) -> Row:
    ours = gradient_norm(mp.spd.mean(points, tol=WANTED_GRADIENT), points)
    peer = gradient_norm(_pyriemann_mean(points), points)
    times = compare(
        lambda: mp.spd.mean(points, tol=WANTED_GRADIENT), lambda: _pyriemann_mean(points), seconds
    )
    note = f"gradient norm {ours:.1g}, pyRiemann {peer:.1g}"
    return faster(
        work, times, "pyRiemann", 8, note, ours < WANTED_GRADIENT and peer < WANTED_GRADIENT
    )


def _hard_mean(n: int) -> Row:
    """Time a mean of ill-conditioned matrices, for which the peer's fixed-point iteration does not converge."""
    points = ill_conditioned(n, 6, seed=3, condition=7e5)
    reached = gradient_norm(mp.spd.mean(points, tol=WANTED_GRADIENT), points)
    peer = gradient_norm(_pyriemann_mean(points), points)
    times = compare(
        lambda: mp.spd.mean(points, tol=WANTED_GRADIENT),
        lambda: _pyriemann_mean(points),
        0.0,
        least=1,
    )
    return Row(
        f"Fréchet mean, 6×6, condition 7e5, {n:,} matrices",
        duration(times.ours),
        f"pyRiemann: {duration(times.peer)}, gradient norm {peer:.1g}",
        bound="gradient norm < 1e-10",
        met=reached < WANTED_GRADIENT,
        note=f"gradient norm {reached:.1g}",
    )
