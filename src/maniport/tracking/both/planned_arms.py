"""A motion of two arms that was planned, with what is known of how good it could be."""

import os
from dataclasses import dataclass

import numpy as np

from maniport.bodies import Arms
from maniport.files import save_arrays
from maniport.tracking.follow.joint_motion import JointMotion
from maniport.tracking.motion_limits import LimitUse, MotionLimits
from maniport.tracking.plan.planned_motion import PlannedMotion, Room, over_floor
from maniport.validation import Array


@dataclass(frozen=True, repr=False)
class PlannedArms(JointMotion):
    """A motion of both arms, from rest to rest within the robot's limits, as one joint trajectory.

    Attributes
    ----------
    arms : Arms
        With the margin of their limits; ``joint_names`` are theirs.
    left, right : PlannedMotion
        The same motion as each arm's own: its joints, ellipsoids, path and node floor. Its ``room`` is that of the
        arm alone.
    limits : MotionLimits
    limit_use : LimitUse
        How much of them is used at most, and when.
    room : Room
        How near the motion comes to a collision of an arm with itself, with the other one, or with what is around.
    together : bool
        Whether the postures were refined for both arms at once, since they share joints or come near one another; else
        they are those of each arm alone.
    way, beside_way : ndarray, shapes (n, 3) and (n,), or None
        Where the right tip shall be from the left one, along the common axes, and how far it is beside that [m], where
        that alone is kept of the paths.

    See Also
    --------
    plan_arms : makes it.
    PlannedMotion : what there is of each arm.
    """

    arms: Arms
    left: PlannedMotion
    right: PlannedMotion
    limits: MotionLimits
    limit_use: LimitUse
    room: Room
    together: bool
    way: Array | None = None
    beside_way: Array | None = None

    @property
    def each(self) -> tuple[PlannedMotion, PlannedMotion]:
        """Left and right."""
        return self.left, self.right

    @property
    def certificate(self) -> float:
        """Ratio to the best pointwise solutions found: root mean square of both distances over that of the floors."""
        return over_floor(
            np.concatenate([one.distance for one in self.each]), np.concatenate([one.node_floor for one in self.each])
        )

    def __repr__(self) -> str:
        return f"PlannedArms(left={self.left!r}, right={self.right!r})"

    def save_joints(self, path: str | os.PathLike[str]) -> None:
        """Write an ``.npz`` file without pickled objects.

        For the joints of both what `maniport.tracking.TrackResult.save_joints` writes for one arm; ``manipulability``,
        ``distance``, ``status`` and, where there are paths, ``position_error`` of each arm behind ``left_`` and
        ``right_``; ``way`` and ``beside_way`` where they are known.

        Raises
        ------
        OutputError
            When the file cannot be written.
        """
        arrays = self.joint_arrays()
        for side, one in zip(("left", "right"), self.each, strict=True):
            own = {
                "manipulability": one.achieved,
                "distance": one.distance,
                "status": np.array(one.status),
                "damping": np.array(one.damping.epsilon),
            }
            if one.position_error is not None:
                own["position_error"] = one.position_error
            arrays |= {f"{side}_{name}": array for name, array in own.items()}
        if self.way is not None and self.beside_way is not None:
            arrays |= {"way": self.way, "beside_way": self.beside_way}
        save_arrays(path, arrays)
