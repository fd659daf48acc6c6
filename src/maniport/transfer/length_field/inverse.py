"""The inverse of the map that rescales eigenvalues, where it has one: Newton's method from several starts."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.distance import cdist

from maniport.spd.kernels import compose, eigh
from maniport.spd.matrix_functions import apply, from_vector, to_vector
from maniport.transfer.length_field.field import LengthsMap, least_singular
from maniport.util.validation import Array

NEAR_SINGULAR = 0.02
MAX_NEAR_SINGULAR = 0.02
"""Smallest singular value of the derivative below which no inverse is returned, and the share of the centers where it
may be as small; above, whole regions have several origins, and a search may miss a second one."""


@dataclass(frozen=True)
class Inverse:
    """Finds the origins of images."""

    field: LengthsMap
    near_singular: float  # share of the centers where the map folds, or nearly so
    starts: Array  # (k, D): vectors where it nearly folds
    images: Array  # (k, D): vec log f there

    @classmethod
    def of(cls, field: LengthsMap, scattered: int = 1200, nearly: float = 0.15) -> "Inverse":
        """Prepare the inverse; starts are centers and `scattered` others with a singular value below `nearly`."""
        centers = field.centers
        often = -(-scattered // len(centers))
        around = field.width * np.random.default_rng(0).standard_normal((often, *centers.shape))
        places = np.concatenate([centers, (centers + around).reshape(-1, centers.shape[1])])
        values, vectors = eigh(from_vector(places))
        singular = least_singular(field.slopes(values, vectors))
        near = singular < nearly
        images = to_vector(field.logarithms(values[near], vectors[near]))
        return cls(field, float(np.mean(singular[: len(centers)] < NEAR_SINGULAR)), places[near], images)

    def __call__(self, points: Array) -> Array:
        """Find the SPD matrices (n, d, d) whose images are `points`; nan for what is not found, or where it folds."""
        blocks = [self._inverted(points[first : first + 64]) for first in range(0, len(points), 64)]
        return np.concatenate([points[:0], *blocks])

    def _inverted(self, points: Array, starts: int = 24, same: float = 1e-6) -> Array:
        field = self.field
        wanted = to_vector(apply(points, np.log) - field.level * np.eye(points.shape[-1]))
        x = self._newton(wanted, wanted)
        order = np.argsort(cdist(wanted, self.images), axis=1)[:, :starts]
        rows = np.repeat(np.arange(len(x)), order.shape[1])
        other = self._newton(wanted[rows], self.starts[order.ravel()])
        apart = np.linalg.norm(other - x[rows], axis=1) > same * (1.0 + np.linalg.norm(other, axis=1))
        x[rows[apart]] = np.nan
        found = np.flatnonzero(np.isfinite(x[:, 0]))
        values, vectors = eigh(from_vector(x[found]))
        fair = least_singular(field.slopes(values, vectors)) > NEAR_SINGULAR
        back = np.full(points.shape, np.nan)
        back[found[fair]] = compose(np.exp((values[fair] - field.shift) / field.power), vectors[fair])
        return back

    def _newton(self, wanted: Array, start: Array, steps: int = 40, halvings: int = 12) -> Array:
        """Solve for the vec L (n, D) whose image is `wanted`, with steps halved until it is nearer; else nan."""
        x, scale = start.copy(), 1.0 + np.linalg.norm(wanted, axis=1)
        off, rows = self._off(x, wanted), np.arange(len(x))
        for _ in range(steps):
            rows = rows[np.linalg.norm(off[rows], axis=1) > 1e-13 * scale[rows]]
            if not len(rows):
                break
            step, share, pending = self._step(x[rows], off[rows]), 1.0, np.arange(len(rows))
            for _ in range(halvings):
                here = rows[pending]
                trial = x[here] + share * step[pending]
                left = self._off(trial, wanted[here])
                nearer = np.linalg.norm(left, axis=1) < np.linalg.norm(off[here], axis=1)
                x[here[nearer]], off[here[nearer]] = trial[nearer], left[nearer]
                pending, share = pending[~nearer], 0.5 * share
                if not len(pending):
                    break
            rows = np.delete(rows, pending)  # no step leads nearer
        x[np.linalg.norm(off, axis=1) > 1e-10 * scale] = np.nan
        return x

    def _off(self, x: Array, wanted: Array) -> Array:
        return wanted - to_vector(self.field.logarithms(*eigh(from_vector(x))))

    def _step(self, x: Array, off: Array) -> Array:
        left, singular, right = np.linalg.svd(self.field.slopes(*eigh(from_vector(x))))
        inner = (off[:, None] @ left)[:, 0] / np.maximum(singular, 1e-3 * singular[:, :1])
        return np.asarray((inner[:, None] @ right)[:, 0])
