"""A motion that was planned, with what is known of how good it could be."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from maniport.arms.collisions import Collisions
from maniport.motion.follow.joint_motion import JointMotion
from maniport.motion.follow.track_result import TrackResult
from maniport.motion.motion_limits import LimitUse, MotionLimits
from maniport.spd.affine_invariant import distance
from maniport.util.subsample import evenly_spaced
from maniport.util.validation import Array


@dataclass(frozen=True)
class Room:
    """Collisions and clearance of a motion."""

    known: bool = False  # whether anything could be checked
    why: str = "it was not asked for"  # why not; empty when something was
    share: float = 0.0  # of the control steps that collide
    clearance: float = np.inf  # smallest distance at and around the closest waypoints [m]; negative in a collision
    time: float = 0.0  # of the smallest distance [s]
    pair: tuple[str, str] = ("", "")  # names of the closest pair
    stand_ins: tuple[str, ...] = ()  # links checked by their collision shapes, since visual ones are missing

    @classmethod
    def of(cls, collisions: Collisions | None, motion: JointMotion) -> "Room":
        """Check all control steps, and measure distances at waypoints and at control steps next to the closest."""
        if collisions is None or not collisions.known:
            return cls(why=cls.why if collisions is None else collisions.why)
        share = float(collisions.collides(motion.control_positions).mean())
        distance = collisions.clearance(motion.joint_positions)
        close = distance <= distance.min() + 0.01
        steps = np.flatnonzero(np.interp(motion.control_time, motion.time, close.astype(float)) > 0.0)
        steps = steps[evenly_spaced(len(steps), 1000)]
        every = np.concatenate([motion.joint_positions[close], motion.control_positions[steps]])
        clock = np.append(motion.time[close], motion.control_time[steps])
        nearest = collisions.nearest(every)
        i = int(np.argmin(nearest.distance))
        pair = (str(nearest.first[i]), str(nearest.second[i]))
        return cls(True, "", share, float(nearest.distance[i]), float(clock[i]), pair, collisions.stand_ins)


@dataclass(frozen=True, repr=False)
class PlannedMotion(TrackResult):
    """A `TrackResult` that starts and ends at rest, within the robot's limits; made by `plan_motion`.

    Attributes
    ----------
    demonstrated_time : ndarray, shape (n,)
        Demonstrated times of the points [s]; ``time`` are those of the robot.
    limits : MotionLimits
    limit_use : LimitUse
        Largest shares of the limits.
    room : Room
        Collisions and clearance.
    pointwise_best : ndarray, shape (n,)
        Distances of the pointwise optimum: the smallest that was found for each point by itself, with the end effector
        on the path (at most 250 points; between them its square is linear).
    """

    demonstrated_time: Array
    limits: MotionLimits
    limit_use: LimitUse
    room: Room
    pointwise_best: Array

    @property
    def pointwise_ratio(self) -> float:
        """Ratio to the best pointwise solution found: root mean square of the distance over that of the pointwise optimum."""
        return over_floor(self.distance, self.pointwise_best)

    @property
    def jumps(self) -> NDArray[np.bool_]:
        """Whether what was demonstrated leaps to or from each point, in its path or its ellipsoids, shape (n,).

        A leap is a step of more than 0.02 m or a distance of 0.2 that is also so quick as four times the median of the
        steps around it: most are errors of the recording or of its fit.
        """
        pace = 1.0 / np.diff(self.demonstrated_time)
        damped = self.target + self.damping.epsilon * np.eye(self.target.shape[-1])
        steps = [(distance(damped[1:], damped[:-1]), 0.2)]
        if self.path is not None:
            steps.append((np.linalg.norm(np.diff(self.path, axis=0), axis=1), 0.02))
        found = np.zeros(len(pace) + 2, bool)
        for size, least in steps:
            usual = median_filter(size * pace, min(9, len(pace)), mode="nearest")
            found[1:-1] |= (size > least) & (size * pace > 4.0 * usual)
        return np.asarray(found[1:] | found[:-1])


def over_floor(distance: Array, floor: Array) -> float:
    """Root mean square of distances (n,) over that of their floor (n,); infinite where that is zero."""
    ground = float(np.linalg.norm(floor))
    return float(np.linalg.norm(distance)) / ground if ground > 0.0 else np.inf
