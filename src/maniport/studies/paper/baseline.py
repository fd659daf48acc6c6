"""The naive baseline as the authors' published program builds it; Table III measures errors against its answers."""

from typing import Self

import numpy as np
from scipy.spatial import cKDTree

from maniport.spd import exp, log, logm, to_vector, transport
from maniport.spd.regularization import Regularization
from maniport.validation import Array


class AuthorsBaseline:
    """Transfer ellipsoids by a lookup of volume-normalized samples and transported tangent vectors.

    All samples are scaled to determinant 1, and each teacher sample T is paired with the nearest student sample S in
    the log-Euclidean distance. An ellipsoid M is scaled to determinant 1; the tangent vector log_T(S) of the nearest
    teacher sample T is transported in parallel from T to M; exp_M of it gets the volume of M. Unlike
    `maniport.NearestNeighbor`, the answers are not among the student's ellipsoids, and they have the teacher's volume.

    Parameters
    ----------
    floor : float
        Smallest eigenvalue of all ellipsoids.

    Notes
    -----
    The program scales to volume 1 instead of determinant 1; the constant factor cancels. Its published version has a
    fault: the loop over the teacher samples compares the same sample each time, so that the first pair is always
    used. Here the nearest sample is used, as § V-B of the paper describes.

    References
    ----------
    Reithmeir, Figueredo and Haddadin, IROS 2022, § V-B, and the public repository with their program.
    """

    def __init__(self, floor: float) -> None:
        self._regularization = Regularization(floor=floor)

    def fit(self, teacher: Array, student: Array) -> Self:
        """Pair the samples of both domains, shapes (n, 3, 3) and (m, 3, 3)."""
        samples, _ = self._normalized(teacher)
        candidates, _ = self._normalized(student)
        _, nearest = cKDTree(_coordinates(candidates)).query(_coordinates(samples))
        self._samples, self._tangents = samples, log(samples, candidates[nearest])
        self._index = cKDTree(_coordinates(samples))
        return self

    def transform(self, points: Array) -> Array:
        """Return the student's ellipsoids for the teacher's, shapes (n, 3, 3)."""
        normalized, scale = self._normalized(points)
        _, nearest = self._index.query(_coordinates(normalized))
        tangents = transport(self._tangents[nearest], self._samples[nearest], normalized)
        return np.asarray(scale * exp(normalized, tangents))

    def _normalized(self, points: Array) -> tuple[Array, Array]:
        """Scale ellipsoids to determinant 1; also return the factors that restore them, shape (n, 1, 1)."""
        lifted = self._regularization.apply(points, "ellipsoids")
        scale = np.linalg.det(lifted)[:, None, None] ** (1.0 / points.shape[-1])
        return lifted / scale, scale


def _coordinates(points: Array) -> Array:
    """Vectors whose Euclidean distance is the log-Euclidean distance of the ellipsoids."""
    return to_vector(logm(points))
