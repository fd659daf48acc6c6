"""Coherent point drift: the teacher's cloud moves onto the student's as a smooth whole."""

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.distance import cdist

from maniport.transfer.cloud_pair import thinned
from maniport.transfer.log_vector_adapter import LogVectorAdapter
from maniport.validation import Array, as_count, as_number

TINY = 1e-8
"""Share of the first variance below which the clouds count as matched."""


class CoherentPointDrift(LogVectorAdapter):
    """Move the image of parallel transport by a smooth field that drifts the teacher's cloud onto the student's.

    Myronenko & Song, Point Set Registration: Coherent Point Drift, IEEE TPAMI 32, 2010, fig. 4 (non-rigid), in the
    log-vectors about the student's mean; what Reithmeir et al. 2022 (§ VI) wish for. The field turns axes and lengths
    wherever that brings clouds closer: it knows where the student's ellipsoids lie, not which belongs to which. A row
    of the comparison.

    Parameters
    ----------
    damping, floor, mounting
        As in `ParallelTransport`.
    width : float
        β, width of the field's kernel over the standard deviation of a coordinate of the student's cloud.
    stiffness : float
        λ, what the roughness of the field counts for.
    outliers : float
        w, share of the student's cloud that belongs to nothing, in (0, 1).
    n_samples : int
        Ellipsoids of each domain that are registered.
    tol, max_iter : float, int
        The fit ends where the variance changes by less than `tol` of itself.

    Attributes
    ----------
    cost_ : float
        Standard deviation σ of the student's ellipsoids about the teacher's.

    See Also
    --------
    LengthsField : a field that keeps axes, fitted to what the student can make.
    DomainAdapter : the other fitted attributes.

    References
    ----------
    Myronenko and Song, Point set registration: coherent point drift, IEEE TPAMI 32, 2010.
    """

    def __init__(
        self,
        damping: float | None = None,
        floor: float | None = None,
        mounting: ArrayLike | None = None,
        width: float = 4.0,
        stiffness: float = 3.0,
        outliers: float = 0.1,
        n_samples: int = 512,
        tol: float = 1e-5,
        max_iter: int = 150,
    ):
        super().__init__(damping, floor, mounting)
        self.width, self.stiffness, self.outliers = width, stiffness, outliers
        self.n_samples, self.tol, self.max_iter = n_samples, tol, max_iter

    def _fit_field(self, start: Array, goal: Array) -> None:
        limit, steps = as_count(self.n_samples, "n_samples", minimum=2), as_count(self.max_iter, "max_iter")
        width, tol = as_number(self.width, "width", above=0.0), as_number(self.tol, "tol", minimum=0.0)
        stiffness = as_number(self.stiffness, "stiffness", above=0.0)
        outliers = as_number(self.outliers, "outliers", above=0.0, below=1.0)
        start, goal = thinned(start, limit), thinned(goal, limit)
        (n, k), m = start.shape, len(goal)
        self.centers_, self.width_ = start, width * float(np.sqrt(np.mean(np.var(goal, axis=0))))
        kernel, moved, field = self._kernel(start), start, np.zeros_like(start)
        squares = cdist(moved, goal, "sqeuclidean")
        first = variance = float(squares.mean()) / k
        history, reason = [variance], f"{steps} iterations"
        for _ in range(steps):
            with np.errstate(under="ignore"):
                shares = np.exp(-squares / (2.0 * variance))
                noise = (2.0 * np.pi * variance) ** (k / 2.0) * outliers / (1.0 - outliers) * n / m
            shares /= shares.sum(axis=0) + noise + np.finfo(float).tiny
            masses = shares.sum(axis=1)
            system = masses[:, None] * kernel
            system[np.diag_indices(n)] += stiffness * variance
            field = np.linalg.solve(system, shares @ goal - masses[:, None] * start)
            moved = start + kernel @ field
            squares = cdist(moved, goal, "sqeuclidean")
            before, variance = variance, float(np.sum(shares * squares)) / (k * max(masses.sum(), TINY))
            history.append(variance)
            if variance <= TINY * first or abs(before - variance) <= tol * before:
                reason = "the clouds drift no more"
                break
        self.weights_, self.history_ = field, np.sqrt(history)
        self.cost_, self.n_iter_ = float(self.history_[-1]), len(history) - 1
        self.converged_, self.stop_reason_ = self.n_iter_ < steps, reason

    def _kernel(self, vectors: Array) -> Array:
        return np.asarray(np.exp(-cdist(vectors, self.centers_, "sqeuclidean") / (2.0 * self.width_**2)))

    def _moved(self, vectors: Array) -> Array:
        return np.asarray(vectors + self._kernel(vectors) @ self.weights_)
