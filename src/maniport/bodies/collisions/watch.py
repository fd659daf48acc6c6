"""The pairs that come near, asked again and again: what is far apart need not be looked at until it may have come near.

How far a pair is apart at least is known of earlier configurations; its distance changes by no more than the joints
between the two turn, times how far from their axes the two can be.
"""

import numpy as np
from numpy.typing import NDArray

from maniport.bodies.collisions.solids import Pairs, Solids
from maniport.validation import Array

AHEAD = 0.03
"""What is apart by so much more than the threshold is left alone for a while [m]."""

EXACT = 1e-5
"""By how much a measured distance may be too large [m]."""


class Watch:
    """Pairs nearer than a threshold [m], as `maniport.bodies.collisions.Collisions.gradient` returns them.

    Pairs need a `share` of the clearance: their distances are divided by it. With `ahead` each call for as many
    configurations as before remembers the last one, for the same configurations moved a little, with the same results.
    """

    def __init__(self, solids: Solids, pairs: Pairs, threshold: float, share: Array, ahead: bool = False):
        self._solids, self._pairs, self._threshold, self._share = solids, pairs, threshold * share, share
        self._enough = self._threshold + AHEAD if ahead else self._threshold
        self._leverage = solids.leverage(pairs) if ahead else None
        self._q, self._room = np.empty((0, 0)), np.empty((0, 0))

    def gradient(self, q: Array) -> tuple[NDArray[np.intp], Array, Array]:
        """Rows, distances and slopes for configurations (n, dof)."""
        near = self._near(q)
        distance, normals, points = self._solids.distances(q, self._pairs, near)
        slope = self._solids.slopes(q, self._pairs, near, normals, points)
        self._room[near] = np.maximum(self._room[near], distance - EXACT)
        rows, columns = np.nonzero(near)
        kept = distance < self._threshold[columns]
        share = self._share[columns[kept]]
        return rows[kept], distance[kept] / share, slope[kept] / share[:, None]

    def free(self, q: Array, padding: float) -> bool:
        """Whether configurations (n, dof) keep all pairs farther apart than `padding` [m]."""
        limit = padding * self._share
        if self._leverage is None or not len(self._q):
            left = np.ones((len(q), len(self._pairs)), dtype=np.bool_)
        else:
            left = self._room[0] - np.abs(q - self._q[0]) @ self._leverage <= limit
        if left.any():
            left &= self._solids.room(q, self._pairs, limit, left) <= limit
        if not left.any():
            return True
        distances = self._solids.distances(q, self._pairs, left, depths=False)[0]
        return bool((distances > limit[np.nonzero(left)[1]]).all())

    def _near(self, q: Array) -> NDArray[np.bool_]:
        """Which pairs are not certainly farther apart than the threshold, shape (n, pairs)."""
        if self._leverage is None or self._q.shape != q.shape:
            room = np.full((len(q), len(self._pairs)), -np.inf)
        else:
            room = self._room - np.abs(q - self._q) @ self._leverage
        left = room <= self._threshold
        rows = np.flatnonzero(left.any(axis=1))
        seen = self._solids.room(q[rows], self._pairs, self._enough, left[rows])
        room[rows] = np.where(left[rows], seen, room[rows])
        self._q, self._room = q.copy(), room
        return np.asarray(room <= self._threshold)
