"""A motion of two arms that was planned, with what is known of how good it could be."""

import os
from dataclasses import dataclass

import numpy as np

from maniport.arms import ArmGroup
from maniport.motion.follow.joint_motion import JointMotion
from maniport.motion.motion_limits import LimitUse, MotionLimits
from maniport.motion.plan.planned_motion import PlannedMotion, Room, over_floor
from maniport.util.files import save_arrays
from maniport.util.validation import Array


@dataclass(frozen=True, repr=False)
class PlannedArms(JointMotion):
    """A planned motion of both arms, from rest to rest within the limits, as one joint trajectory.

    Attributes
    ----------
    arms : ArmGroup
        With the margin of their limits; ``joint_names`` are theirs.
    left, right : PlannedMotion
        The same motion of each arm; its ``room`` is that of the arm alone.
    limits : MotionLimits
    limit_use : LimitUse
        Largest shares of the limits.
    room : Room
        Collisions and clearance of the pair.
    together : bool
        Whether both arms were optimized at once, since they share joints or come near one another.
    way, beside_way : ndarray, shapes (n, 3) and (n,), or None
        Target vector from the left to the right end effector in the common axes, and the distance from it [m], with
        ``tips="relative"``.
    """

    arms: ArmGroup
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
    def pointwise_ratio(self) -> float:
        """Ratio to the best pointwise solutions found: root mean square of both distances over that of the floors."""
        return over_floor(
            np.concatenate([one.distance for one in self.each]),
            np.concatenate([one.pointwise_best for one in self.each]),
        )

    def __repr__(self) -> str:
        return f"PlannedArms(left={self.left!r}, right={self.right!r})"

    def save_joints(self, path: str | os.PathLike[str]) -> None:
        """Write an ``.npz`` file without pickled objects.

        For the joints of both the arrays of `maniport.motion.TrackResult.save_joints`; ``manipulability``,
        ``distance``, ``status`` and ``position_error`` of each arm with the prefix ``left_`` or ``right_``; ``way`` and
        ``beside_way`` where they are known.

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
