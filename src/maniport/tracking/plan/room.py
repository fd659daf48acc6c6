"""How near a motion comes to a collision."""

from dataclasses import dataclass

import numpy as np

from maniport.bodies.collisions import Collisions
from maniport.subsample import evenly_spaced
from maniport.tracking.follow.joint_motion import JointMotion

CLOSE, CLOSE_STEPS = 0.01, 1000
"""Next to points that are so much farther from a collision than the nearest [m] control steps are looked at, at most
so many."""


@dataclass(frozen=True)
class Room:
    """How near a motion comes to a collision.

    Attributes
    ----------
    known : bool
        Whether anything could be checked.
    why : str
        Why not; empty when something was.
    share : float
        Share of the control steps that collide.
    clearance : float
        Smallest distance at the points of the path and between the closest of them [m]; negative in a collision,
        infinite where nothing is checked.
    time : float
        When [s].
    pair : tuple of str
        Between what.
    stand_ins : tuple of str
        Links of which collision shapes were checked, since what is drawn of them is missing.
    """

    known: bool = False
    why: str = "it was not asked for"
    share: float = 0.0
    clearance: float = np.inf
    time: float = 0.0
    pair: tuple[str, str] = ("", "")
    stand_ins: tuple[str, ...] = ()

    @classmethod
    def of(cls, collisions: Collisions | None, motion: JointMotion) -> "Room":
        """Measure a motion at points and, next to the closest of them, at control steps; ask at all of these."""
        if collisions is None or not collisions.known:
            return cls(why=cls.why if collisions is None else collisions.why)
        share = float(collisions.collides(motion.control_positions).mean())
        distance = collisions.clearance(motion.joint_positions)
        close = distance <= distance.min() + CLOSE
        steps = np.flatnonzero(np.interp(motion.control_time, motion.time, close.astype(float)) > 0.0)
        steps = steps[evenly_spaced(len(steps), CLOSE_STEPS)]
        every = np.concatenate([motion.joint_positions[close], motion.control_positions[steps]])
        clock = np.append(motion.time[close], motion.control_time[steps])
        nearest = collisions.nearest(every)
        i = int(np.argmin(nearest.distance))
        pair = (str(nearest.first[i]), str(nearest.second[i]))
        return cls(True, "", share, float(nearest.distance[i]), float(clock[i]), pair, collisions.stand_ins)
