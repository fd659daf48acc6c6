"""Two transports of whole clouds, for the comparison of methods alone: between Gaussians, and with entropy.

Files do not hold what they have fitted.
"""

import numpy as np
from numpy.typing import ArrayLike

from maniport.spd.matrix_functions import roots
from maniport.transfer.adapter import DomainAdapter
from maniport.transfer.cloud_pair import thinned
from maniport.transfer.entropic_map import EntropicMap
from maniport.transfer.log_vector_adapter import LogVectorAdapter
from maniport.validation import Array, as_count, as_number


class GaussianTransport(LogVectorAdapter):
    """The linear transport between the Gaussians that have the clouds' means and covariances.

    Knott & Smith, On the Optimal Mapping of Distributions, J. Optim. Theory Appl. 43, 1984:
    A = C_t^-½ (C_t^½ C_s C_t^½)^½ C_t^-½.
    """

    def _fit_field(self, start: Array, goal: Array) -> None:
        own, other = (np.cov(vectors.T) + 1e-12 * np.eye(vectors.shape[1]) for vectors in (start, goal))
        root, inverse = roots(own)
        self.origin_, self.goal_ = start.mean(axis=0), goal.mean(axis=0)
        self.matrix_ = inverse @ roots(root @ other @ root)[0] @ inverse
        self._found_at_once("closed form")

    def _moved(self, vectors: Array) -> Array:
        return np.asarray(self.goal_ + (vectors - self.origin_) @ self.matrix_)


class EntropicTransport(LogVectorAdapter):
    """The debiased entropic transport of the whole clouds; see `maniport.transfer.entropic_map`.

    Parameters
    ----------
    damping, floor, mounting
        As in `ParallelTransport`.
    entropy : float
        ε over the mean squared distance of the student's vectors to their mean, times two.
    n_samples : int
        Ellipsoids of each domain that are transported.
    """

    def __init__(
        self,
        damping: float | None = None,
        floor: float | None = None,
        mounting: ArrayLike | None = None,
        entropy: float = 0.1,
        n_samples: int = 1024,
    ):
        super().__init__(damping, floor, mounting)
        self.entropy = entropy
        self.n_samples = n_samples

    def _fit_field(self, start: Array, goal: Array) -> None:
        limit = as_count(self.n_samples, "n_samples", minimum=2)
        share = as_number(self.entropy, "entropy", above=0.0)
        first, other = (thinned(vectors, limit)[:, None] for vectors in (start, goal))
        self._transport = EntropicMap.of(first, other, 2.0 * share * float(np.sum(np.var(goal, axis=0))))
        self._found_at_once(f"transport between {len(first)} and {len(other)} ellipsoids")

    def _moved(self, vectors: Array) -> Array:
        return self._transport(vectors)


TRANSPORTS: dict[str, type[DomainAdapter]] = {
    "gaussian-transport": GaussianTransport,
    "entropic-transport": EntropicTransport,
}
"""Both, by the names of their rows."""
