"""The fit of a lengths field: ask what is nearest to the images, move the lengths there smoothly, ask again."""

from dataclasses import dataclass, replace
from math import ceil
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve
from scipy.spatial import cKDTree

from maniport.spd.affine_invariant import distance_unchecked
from maniport.spd.kernels import compose, congruence, mandel_basis
from maniport.spd.matrix_functions import apply, logarithm, to_vector
from maniport.spd.regularization import HINT
from maniport.transfer.lengths.field import LengthsMap, axiswise, powers
from maniport.transfer.lengths.projector import Asking
from maniport.validation import Array, as_spd

NEIGHBORS = 3
"""Samples beside each one whose postures a search tries, too."""
SOFT, LEAST = 0.05, 0.1
"""γ, what motion of the joints costs beside the error that it removes, and α, what such an error costs."""
TURN_ROUNDS, TURN_SHARE = 3, 2 / 3
"""Rounds of the field that turns, and the share of the centres that it has. It knows no axis, so that it needs more
samples than the lengths do."""
TURN_GAPS = 1e-3, 0.09
"""Where the lengths leave a mean gap g of 0.09 or more the field that turns has their ridge, else (0.09 / g)⁴ times as
much: what the student cannot follow is worth turns, what it nearly can is not. Smaller gaps count as the first."""
TURN_LEAST, TURNING = 0.5, 0.6
"""α of that field, and β: what turning the longest axis costs beside the error."""
NEVER_SINGULAR = 1e-8
TIE = 1e-6
"""Difference of logarithms, and of their squared distances, up to which samples are equally suited. It is far above
rounding (1e-13), so that rounding does not choose between the mirror images in a symmetric domain."""


@dataclass(frozen=True)
class Samples:
    """The teacher's samples that a field is fitted to, and what stays the same in all rounds.

    Attributes
    ----------
    plain : LengthsMap
        The map with its centres, but without a field.
    values, vectors : ndarray, shapes (n, d) and (n, d, d)
        Eigenvalues and -vectors of L.
    x : ndarray, shape (n, D)
        vec L.
    near, among : ndarray, shapes (n, m) and (m, m)
        Kernel values of the lengths at the samples and between the centres.
    neighbors : ndarray of int, shape (n, NEIGHBORS), or None
    asking : Asking
    """

    plain: LengthsMap
    values: Array
    vectors: Array
    x: Array
    near: Array
    among: Array
    neighbors: NDArray[np.intp] | None
    asking: Asking

    @classmethod
    def of(cls, plain: LengthsMap, points: Array, projector: Any, damping: float) -> "Samples":
        """Prepare samples (n, d, d) for a map that has its centres."""
        values, vectors = plain.base(points)
        x = to_vector(compose(values, vectors))
        neighbors = None
        if len(x) > NEIGHBORS:
            neighbors = np.asarray(cKDTree(x).query(x, k=[*range(2, NEIGHBORS + 2)])[1], dtype=np.intp)
        asking = Asking(projector, damping)
        return cls(plain, values, vectors, x, plain.kernel(x), plain.kernel(plain.centers), neighbors, asking)

    def beside(self, others: "Samples") -> "Samples":
        """The same, asked for from what was found for the nearest of others."""
        alike = np.asarray(cKDTree(others.x).query(self.x)[1], dtype=np.intp)
        return replace(self, asking=others.asking.beside(alike))

    def asked(self, field: LengthsMap, alone: bool = False) -> tuple[Array, Array, Array | None]:
        """Return the samples' images A, the nearest M to them, and the student's ways there, where they are known."""
        images = as_spd(field.image(self.values, self.vectors), "images of the teacher", hint=HINT, copy=False)
        return images, *self.asking.nearest(images, None if alone else self.neighbors)


def fitted(
    samples: Samples, more: Samples | None, ridge: float, rounds: int, turn: bool
) -> tuple[LengthsMap, list[float]]:
    """Fit the field in rounds; return it and the mean distance to the nearest ellipsoids, before and after each."""
    field, history = samples.plain, list[float]()
    for number in range(rounds):
        images, nearest, ways = samples.asked(field)
        history.append(float(np.mean(distance_unchecked(images, nearest))))
        error = displacements(images, nearest, samples.vectors)
        field = replace(field, lengths=_lengths(field, samples, error, None if number == 0 else ways, ridge))
    turning = [samples] if more is None else [samples, more.beside(samples)]
    for number in range(TURN_ROUNDS if turn else 0):
        pulls = [_turning(some, *some.asked(field, alone=number > 0)) for some in turning]
        far, error, weights, costs = (np.concatenate(each) for each in zip(*pulls, strict=True))
        history.append(float(far[: len(samples.x)].mean()))
        if number == 0:
            ridge *= (TURN_GAPS[1] / np.clip(far.mean(), *TURN_GAPS)) ** 4
        x = np.concatenate([some.x for some in turning])
        field = replace(field, turns=_turns(field, x, error, weights, costs, ridge))
    images, nearest, _ = samples.asked(field, alone=turn)
    history.append(float(np.mean(distance_unchecked(images, nearest))))
    return field, history


def displacements(images: Array, nearest: Array, vectors: Array) -> Array:
    """Vᵀ log(A^-½ M A^-½) V, shape (n, d, d), of images A, the nearest M and axes V."""
    return congruence(np.swapaxes(vectors, -1, -2), logarithm(congruence(apply(images, _inverse_root), nearest)))


def _inverse_root(values: Array) -> Array:
    return np.asarray(1.0 / np.sqrt(values))


def _lengths(field: LengthsMap, samples: Samples, error: Array, ways: Array | None, ridge: float) -> Array:
    """Coefficients (m, 3) that move the lengths where the nearest ellipsoids are, by weighted ridge regression."""
    n, d = samples.values.shape
    t, m = powers(samples.values), samples.near.shape[1]
    done = axiswise(samples.near @ field.lengths, t)
    vector = to_vector(error)
    wanted = done + vector[:, :d]
    if ways is None:
        weights, pull = np.broadcast_to(np.eye(d), (n, d, d)), wanted
    else:
        moves = np.swapaxes(to_vector(congruence(np.swapaxes(samples.vectors, -1, -2)[:, None], ways)), 1, 2)
        beside = _beside(moves)
        weights = beside[:, :d, :d] + LEAST * np.eye(d)
        pull = (weights @ wanted[..., None])[..., 0] + (beside[:, :d, d:] @ vector[:, d:, None])[..., 0]
    rank = t.shape[2]
    mixed = np.swapaxes(t, 1, 2) @ weights @ t  # (n, 3, 3)
    normal = np.empty((rank, m, rank, m))
    for r in range(rank):
        for s in range(r, rank):
            normal[r, :, s] = samples.near.T @ (mixed[:, r, s, None] * samples.near)
            normal[s, :, r] = normal[r, :, s]
        normal[r, :, r] += ridge * n * (samples.among + NEVER_SINGULAR * np.eye(m))
    right = np.einsum("nir,ni->rn", t, pull) @ samples.near
    found = cho_solve(cho_factor(normal.reshape(rank * m, rank * m)), right.ravel())
    return np.ascontiguousarray(found.reshape(rank, m).T)


def _beside(moves: Array) -> Array:
    """N = I − J (JᵀJ + γ I)⁻¹ Jᵀ, shape (n, D, D), of what joints change, J (n, D, k): what they cannot reach."""
    inner = np.swapaxes(moves, 1, 2) @ moves + SOFT * np.eye(moves.shape[2])
    return np.asarray(np.eye(moves.shape[1]) - moves @ np.linalg.solve(inner, np.swapaxes(moves, 1, 2)))


def _turning(samples: Samples, images: Array, nearest: Array, ways: Array | None) -> tuple[Array, Array, Array, Array]:
    """How far images are from the nearest ellipsoids (n,), what is missing there (n, D), and with ways W = N + α I."""
    error = to_vector(apply(nearest, np.log) - apply(images, np.log))
    size, d = error.shape[1], samples.values.shape[1]
    weights = np.broadcast_to(np.eye(size), (len(error), size, size))
    if ways is not None:
        weights = _beside(np.swapaxes(to_vector(ways), 1, 2)) + TURN_LEAST * np.eye(size)
    entries = d + np.flatnonzero(np.triu_indices(d, 1)[1] == d - 1)  # of vec, beside the longest axis
    off = to_vector(congruence(np.swapaxes(samples.vectors, -1, -2)[:, None], mandel_basis(d)))[:, :, entries]
    return distance_unchecked(images, nearest), error, weights, TURNING * off @ np.swapaxes(off, 1, 2)


def _turns(field: LengthsMap, x: Array, error: Array, weights: Array, costs: Array, ridge: float) -> Array:
    """Coefficients (m', D) of the field that turns: Σ (u − e)ᵀ W (u − e) + β uᵀ P u is least."""
    m, size = ceil(TURN_SHARE * len(field.centers)), x.shape[1]
    turns = field.turns if len(field.turns) else np.zeros((m, size))
    near, among = (replace(field, turns=turns).turning_kernel(each) for each in (x, field.centers[:m]))
    normal, both = np.empty((size, m, size, m)), weights + costs
    for r in range(size):
        for s in range(r, size):
            normal[r, :, s] = near.T @ (both[:, r, s, None] * near)
            normal[s, :, r] = normal[r, :, s]
        normal[r, :, r] += ridge * len(near) * (among + NEVER_SINGULAR * np.eye(m))
    right = (weights @ (near @ turns + error)[..., None])[..., 0].T @ near
    found = cho_solve(cho_factor(normal.reshape(size * m, size * m)), right.ravel())
    return np.ascontiguousarray(found.reshape(size, m).T)


def centers_among(x: Array, count: int) -> NDArray[np.intp]:
    """Indices of `count` of the vectors (n, D): the nearest to the mean, then always the farthest; ties: the first."""
    squares = np.sum((x - x.mean(axis=0)) ** 2, axis=1)
    chosen = [int(np.argmax(squares <= squares.min() + TIE))]
    apart = np.sum((x - x[chosen[0]]) ** 2, axis=1)
    while len(chosen) < count:
        chosen.append(int(np.argmax(apart >= apart.max() - TIE)))
        apart = np.minimum(apart, np.sum((x - x[chosen[-1]]) ** 2, axis=1))
    return np.array(chosen, dtype=np.intp)
