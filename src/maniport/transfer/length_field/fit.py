"""The fit of a length field: find the nearest feasible ellipsoids to the images, rescale toward them, repeat."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve
from scipy.spatial import cKDTree

from maniport.errors import InvalidInputError
from maniport.spd.affine_invariant import distance_unchecked
from maniport.spd.kernels import compose, congruence, symmetrize
from maniport.spd.matrix_functions import apply, logarithm, to_vector
from maniport.spd.neighbors import NeighborIndex
from maniport.transfer.length_field.field import LengthsMap, axiswise, powers
from maniport.util.validation import Array, as_finite, as_points, require_shape

Projector = Callable[[Array], Any]
"""Takes ellipsoids with the student's damping, shape (n, d, d), and returns the nearest feasible ones, damped alike.

An attribute `axis` is a direction (3,) in the student's frame about which every feasible ellipsoid may be turned. An
attribute `damping`, relative to the mean eigenvalue of a domain, is the field's default.
"""

TIE = 1e-6
"""Difference of logarithms, and of their squared distances, up to which samples are equally suited. It is far above
rounding (1e-13), so that rounding does not choose between the mirror images in a symmetric domain."""


class ProjectorSearch(Protocol):
    """A search that starts from its last results."""

    def nearest(self, points: Array, neighbors: NDArray[np.intp] | None = None) -> tuple[Array, Array]:
        """Return the nearest ellipsoids (n, d, d), and how the way there changes with each joint, (n, k, d, d)."""
        ...


@runtime_checkable
class SearchingProjector(Protocol):
    """A projector that is faster, and whose fit is better, since it returns where the student can move."""

    def search(self, damping: float) -> ProjectorSearch:
        """Begin a search among ellipsoids that carry this damping ε [unit of M]."""
        ...


class NearestSamples:
    """The projector without a model of the student: the nearest of its samples, damped, shape (m, d, d)."""

    def __init__(self, student: Array):
        self._index = NeighborIndex(student)

    def __call__(self, points: Array) -> Array:
        """Return the nearest sample to each point."""
        return np.asarray(self._index.points[self._index.query(points)[0]])


def as_projector(projector: Any) -> Any:
    """Check that a projector is callable or can search."""
    if not callable(projector) and not isinstance(projector, SearchingProjector):
        raise InvalidInputError(
            f"projector must be callable, such as maniport.FeasibleProjector(arm); found {projector!r}"
        )
    return projector


class Samples:
    """The teacher's samples (n, d, d) that a field is fitted to or measured at."""

    def __init__(self, field: LengthsMap, points: Array, projector: Any, damping: float, neighbors: int = 3):
        self.points = points
        self.values, self.vectors = field.base(points)
        self.x = to_vector(compose(self.values, self.vectors))
        self._neighbors = None
        if len(points) > neighbors:
            found = cKDTree(self.x).query(self.x, k=[*range(2, neighbors + 2)])[1]
            self._neighbors = np.asarray(found, dtype=np.intp)
        self._projector = projector
        self._search = projector.search(damping) if isinstance(projector, SearchingProjector) else None

    def projected(self, images: Array) -> tuple[Array, Array | None]:
        """Return the nearest ellipsoids (n, d, d) to the images, and the ways there (n, k, d, d) where known."""
        found: Any
        if self._search is None:
            found, ways = self._projector(images.copy()), None
        else:
            name = "the second of projector.search(damping).nearest(points)"
            found, ways = self._search.nearest(images, self._neighbors)
            ways = symmetrize(as_finite(ways, name))
            require_shape(ways, name, (len(images), "k", *images.shape[1:]))
        array = as_finite(found, "projector(points)")
        require_shape(array, "projector(points)", images.shape, ", as the points")
        nearest = as_points(array, "projector(points)", minimum=1)
        few = isinstance(self._projector, NearestSamples)  # one sample may be the nearest to all
        if not few and _all_equal(nearest) and not _all_equal(images):
            raise InvalidInputError(
                f"projector(points) is the same ellipsoid for all {len(images)} points; it must be the nearest to each"
            )
        return nearest, ways


def _all_equal(points: Array) -> bool:
    return bool(np.abs(points - points[0]).max() <= 1e-12 * np.abs(points[0]).max())


@dataclass(frozen=True)
class Kernels:
    """Kernel values of a field that do not change during the fit."""

    near: Array  # (n, m): at the samples
    among: Array  # (m, m): between the centers


def fitted(base: LengthsMap, samples: Samples, ridge: float, rounds: int) -> tuple[LengthsMap, list[float]]:
    """Fit a field with centers in rounds; return it and the mean distance to the feasible set before and after each."""
    field, history = base, list[float]()
    kernels = Kernels(field.kernel(samples.x), field.kernel(field.centers))
    for number in range(rounds + 1):
        images = field.apply(samples.points)
        nearest, ways = samples.projected(images)
        history.append(float(np.mean(distance_unchecked(images, nearest))))
        if number < rounds:
            error = displacements(images, nearest, samples.vectors)
            lengths = _lengths(field.lengths, samples, kernels, error, None if number == 0 else ways, ridge)
            field = replace(field, lengths=lengths)
    return field, history


def displacements(images: Array, nearest: Array, vectors: Array) -> Array:
    """Vᵀ log(A^-½ M A^-½) V, shape (n, d, d), of images A, the nearest M and axes V."""
    whitening = apply(images, lambda values: 1.0 / np.sqrt(values))
    return congruence(np.swapaxes(vectors, -1, -2), logarithm(congruence(whitening, nearest)))


def _lengths(
    lengths: Array, samples: Samples, kernels: Kernels, error: Array, ways: Array | None, ridge: float
) -> Array:
    """Coefficients (m, 3) that rescale toward the nearest ellipsoids, by weighted ridge regression; (39) and (40)."""
    n, d = samples.values.shape
    near, t = kernels.near, powers(samples.values)
    m, rank = near.shape[1], t.shape[2]
    vector = to_vector(error)
    wanted = axiswise(near @ lengths, t) + vector[:, :d]
    if ways is None:
        weights, pull = np.broadcast_to(np.eye(d), (n, d, d)), wanted
    else:
        moves = np.swapaxes(to_vector(congruence(np.swapaxes(samples.vectors, -1, -2)[:, None], ways)), 1, 2)
        residual = _unreachable(moves)
        weights = residual[:, :d, :d] + 0.1 * np.eye(d)  # α, the cost of an error that motion of the joints removes
        pull = (weights @ wanted[..., None])[..., 0] + (residual[:, :d, d:] @ vector[:, d:, None])[..., 0]
    mixed = np.swapaxes(t, 1, 2) @ weights @ t  # (n, 3, 3)
    normal = np.empty((rank, m, rank, m))
    for r in range(rank):
        for s in range(r, rank):
            normal[r, :, s] = near.T @ (mixed[:, r, s, None] * near)
            normal[s, :, r] = normal[r, :, s]
        normal[r, :, r] += ridge * n * (kernels.among + 1e-8 * np.eye(m))
    right = np.einsum("nir,ni->rn", t, pull) @ near
    found = cho_solve(cho_factor(normal.reshape(rank * m, rank * m)), right.ravel())
    return np.ascontiguousarray(found.reshape(rank, m).T)


def _unreachable(moves: Array, gamma: float = 0.05) -> Array:
    """N = I − J (JᵀJ + γ I)⁻¹ Jᵀ, shape (n, D, D), of the changes along the joints J (n, D, k): the rest."""
    inner = np.swapaxes(moves, 1, 2) @ moves + gamma * np.eye(moves.shape[2])
    return np.asarray(np.eye(moves.shape[1]) - moves @ np.linalg.solve(inner, np.swapaxes(moves, 1, 2)))


def centers_among(x: Array, count: int) -> NDArray[np.intp]:
    """Indices of `count` of the vectors (n, D): the nearest to the mean, then always the farthest; ties: the first."""
    squares = np.sum((x - x.mean(axis=0)) ** 2, axis=1)
    chosen = [int(np.argmax(squares <= squares.min() + TIE))]
    apart = np.sum((x - x[chosen[0]]) ** 2, axis=1)
    while len(chosen) < count:
        chosen.append(int(np.argmax(apart >= apart.max() - TIE)))
        apart = np.minimum(apart, np.sum((x - x[chosen[-1]]) ** 2, axis=1))
    return np.array(chosen, dtype=np.intp)
