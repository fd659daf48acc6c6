"""What a path may lead through."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from maniport.validation import Array


@dataclass(frozen=True)
class Nodes:
    """Postures of an arm at the stages of a path: those of one after those of the other.

    Attributes
    ----------
    q : ndarray, shape (n, dof)
    cost : ndarray, shape (n,)
        The objective there.
    first : ndarray, shape (stages + 1,)
        Those of stage s are ``first[s]`` to ``first[s + 1]``; no stage is without.
    """

    q: Array
    cost: Array
    first: NDArray[np.intp]

    def without(self, bad: NDArray[np.bool_]) -> "Nodes":
        """Those that are not bad; a stage that has bad ones only keeps them."""
        owner = np.repeat(np.arange(len(self.first) - 1), np.diff(self.first))
        kept = ~bad | ~np.isin(owner, owner[~bad])
        return Nodes(self.q[kept], self.cost[kept], np.searchsorted(owner[kept], np.arange(len(self.first))))

    def joined(self, q: Array, cost: Array) -> "Nodes":
        """These and one more at each stage, q (stages, dof) and cost (stages,)."""
        at = self.first[1:]
        first = self.first + np.arange(len(self.first))
        return Nodes(np.insert(self.q, at, q, axis=0), np.insert(self.cost, at, cost), first)
