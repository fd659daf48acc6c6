"""Hard limits of a control step besides those of joints: collisions, and limits of users."""

import math
from collections.abc import Sequence
from typing import Protocol, runtime_checkable

import numpy as np

from maniport.arms import ArmGroup
from maniport.arms.collisions import Collisions
from maniport.errors import InvalidInputError
from maniport.util.validation import Array


@runtime_checkable
class Limit(Protocol):
    """A hard limit of a control step. Pass own limits as ``TrackOptions(limits=[...])``."""

    def inequalities(self, q: Array, dt: float) -> tuple[Array, Array]:
        """Return G, shape (k, dof), and h, shape (k,), of k ≥ 0 inequalities G Δq ≤ h.

        Parameters
        ----------
        q : ndarray, shape (dof,)
            Present configuration [rad or m].
        dt : float
            Duration of the step [s].
        """


def as_own_limits(limits: Sequence[Limit], group: ArmGroup) -> tuple[Limit, ...]:
    """Require limits that can be computed for the joints."""
    if not isinstance(limits, Sequence) or isinstance(limits, str):
        raise InvalidInputError(f"limits must be a sequence; found {limits!r}")
    for i, limit in enumerate(limits):
        if not isinstance(limit, Limit):
            raise InvalidInputError(
                f"limits[{i}] must have the method inequalities; found {limit!r}"
            )
        try:
            matrix, bound = map(np.asarray, limit.inequalities(group.sample(1, 0)[0], 0.01))
        except Exception as error:  # user code may raise anything
            raise InvalidInputError(
                f"limits[{i}] cannot be computed for {group.name!r}: {type(error).__name__}: {error}; found {limit!r}"
            ) from error
        if bound.ndim != 1 or matrix.shape != (len(bound), group.dof):
            raise InvalidInputError(
                f"limits[{i}].inequalities must have shapes (k, {group.dof}) and (k,), one column for each joint of "
                f"{group.name!r}; found {matrix.shape} and {bound.shape}"
            )
    return tuple(limits)


class CollisionLimit:
    """Keep the distances of collision pairs above a margin.

    A pair with the distance D, which changes by J Δq, may use up a share of it in a step (Faverjon and Tournassoud, A
    local based approach for path planning of manipulators with a high number of degrees of freedom, ICRA 1987):

        J Δq ≥ −(1 − exp(−dt / time_constant)) (D − margin)

    A pair within the margin comes no nearer.
    """

    # smallest distance of pairs, and largest distance of pairs that count [m]
    margin = 0.02
    reach = 0.1
    time_constant = 0.1  # with which the clearance is used up [s]
    linear_range = 0.09  # of joint motion, in which distances are nearly linear [rad or m]

    def __init__(self, collisions: Collisions):
        self._collisions = collisions
        self._q: Array | None = None
        self._distance = np.empty(0)
        self._rows = np.empty((0, 0))

    def inequalities(self, q: Array, dt: float) -> tuple[Array, Array]:
        """Return G and h of G Δq ≤ h, shapes (k, dof) and (k,), for the k pairs within reach."""
        renew = True
        if self._q is not None:
            moved = q - self._q
            renew = bool(np.vdot(moved, moved) > self.linear_range**2)
        if renew:
            self._q = q.copy()
            moved = np.zeros(len(q))
            _, self._distance, slope = self._collisions.gradient(q[None], self.reach, scaled=True)
            self._rows = -slope
        if not len(self._rows):
            return self._rows, self._distance
        distance = self._distance - self._rows @ moved
        allowed = -math.expm1(-dt / self.time_constant) * (distance - self.margin)
        return self._rows, np.maximum(allowed, 0.0)
