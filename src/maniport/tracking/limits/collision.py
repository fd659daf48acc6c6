"""A limit that keeps an arm away from itself and from what stands around it."""

import numpy as np
from pink.configuration import Configuration
from pink.limits import Limit

from maniport.bodies.collisions import Collisions
from maniport.errors import InvalidInputError
from maniport.validation import Array, as_number

MARGIN, REACH, GAIN = 0.02, 0.1, 0.3
WAY_OUT = 0.1
MOVED = 0.045
"""Distances are computed anew once joints have moved farther than this, all together (root of the sum of squares) [rad
or m]: the second derivatives of distances are about as large as an arm is long, so that they are wrong by 1 mm then."""


class CollisionLimit(Limit):  # type: ignore[misc]  # Pink is untyped
    """Keep the distances of hulls above a margin.

    A pair with the distance D, which changes by J Δq, may use up a share of its room in a step (Faverjon and
    Tournassoud, ICRA 1987):

        J Δq ≥ −gain (D − margin)

    What is nearer than the margin must get away, but no faster than with a tenth of the velocity limits, so that the
    programme stays solvable; where none is known only approaching is forbidden.

    Parameters
    ----------
    collisions : Collisions
        Of the arm whose `maniport.tracking.robot_model` the limit is for.
    margin : float
        [m].
    reach : float
        Only pairs nearer than this count [m].
    gain : float
        Share of the room used up in a step, in (0, 1].
    way_out : float
        The share of the velocity limits with which to get away, at most 1; with 0 only approaching is forbidden, and
        an arm may always rest.

    Raises
    ------
    InvalidInputError
        When an argument has a wrong value, or nothing is known of what collides.

    See Also
    --------
    BrakingLimit : another limit for ``pink.solve_ik``.
    maniport.Collisions : what it keeps apart.

    References
    ----------
    Faverjon and Tournassoud, A local based approach for path planning of manipulators with a high number of degrees of
    freedom, ICRA 1987.

    Examples
    --------
    >>> import maniport as mp
    >>> arm = mp.load_arm("panda", frame="panda_hand_tcp")
    >>> CollisionLimit(mp.Collisions.of(arm, table=0.0))
    CollisionLimit(Collisions('panda', 36 pairs, padding 0 m), margin=0.02, reach=0.1, gain=0.3)
    """

    def __init__(
        self, collisions: Collisions, margin: float = MARGIN, reach: float = REACH, gain: float = GAIN,
        way_out: float = WAY_OUT,
    ):  # fmt: skip
        if not isinstance(collisions, Collisions):
            raise InvalidInputError(f"collisions must be a Collisions object; found {type(collisions).__name__}")
        if not collisions.known:
            raise InvalidInputError(f"collisions: nothing is known that could collide: {collisions.why}")
        self.collisions = collisions
        self.margin = as_number(margin, "margin", minimum=0.0)
        self.reach = as_number(reach, "reach", above=self.margin)
        self.gain = as_number(gain, "gain", above=0.0, maximum=1.0)
        self.way_out = as_number(way_out, "way_out", minimum=0.0, maximum=1.0)
        self._watch = collisions.watch(self.reach)  # steps are small: what was far apart need not be looked at

    def __repr__(self) -> str:
        return f"CollisionLimit({self.collisions!r}, margin={self.margin}, reach={self.reach}, gain={self.gain})"

    def near(self, q: Array) -> tuple[Array, Array]:
        """Distances (k,) of the pairs within reach at q (dof,), and their derivatives (k, dof)."""
        return self._watch.gradient(q[None])[1:]

    def compute_qp_inequalities(self, configuration: Configuration, dt: float) -> tuple[Array, Array] | None:
        """Pair (G, h) of G Δq ≤ h, shapes (k, nv) and (k,), for the k pairs within reach; None where there are none."""
        distance, slope = self.near(configuration.q)
        if not len(distance):
            return None
        allowed = self.gain * (distance - self.margin)
        if self.way_out == 0.0:
            return -slope, np.maximum(allowed, 0.0)
        speeds = configuration.model.velocityLimit
        known = np.where(np.isfinite(speeds), speeds, 0.0)
        return -slope, np.maximum(allowed, -self.way_out * dt * np.abs(slope) @ known)


class RememberingLimit(CollisionLimit):
    """The same with distances that are computed where the arm has moved, and are linear in between."""

    def __init__(self, collisions: Collisions, way_out: float = WAY_OUT):
        super().__init__(collisions, way_out=way_out)
        self.forget()

    def forget(self) -> None:
        """Know nothing of distances."""
        self._watch = self.collisions.watch(self.reach)
        self._at: Array | None = None
        self._known = np.empty(0), np.empty((0, 0))

    def near(self, q: Array) -> tuple[Array, Array]:
        """As `CollisionLimit.near` gives them."""
        away = None if self._at is None else q - self._at
        if away is None or away @ away > MOVED**2:
            self._at, self._known = q.copy(), self._watch.gradient(q[None])[1:]
            return self._known
        distance, slope = self._known
        return distance + slope @ away, slope

    def free(self, q: Array) -> bool:
        """Whether none of the postures (n, dof) collides."""
        return self._watch.free(q, self.collisions.padding)
