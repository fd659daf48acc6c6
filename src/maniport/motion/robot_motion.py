"""The motion of a group of arms."""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from maniport.arms import ArmGroup
from maniport.arms.collisions import Collisions
from maniport.motion.arm_motion import ArmMotion, rms_ratio
from maniport.motion.motion_limits import LimitUse, MotionLimits
from maniport.motion.schedule import Schedule
from maniport.motion.status import ENOUGH_METRES
from maniport.motion.trajectory import Clearance, Trajectory
from maniport.util.files import save_arrays
from maniport.util.notebook import NotebookDisplay
from maniport.util.validation import Array


@dataclass(frozen=True, eq=False, repr=False)
class RobotMotion(NotebookDisplay):
    """The motion of one or several arms; made by `plan_motion` and `track`.

    Attributes
    ----------
    group : ArmGroup
        The arms, with the margin of their limits.
    trajectory : Trajectory
        Of all joints of the group.
    arms : tuple of ArmMotion
        The same motion of each arm, and its errors.
    coupled : bool
        Whether several arms were optimized together, since they share joints or costs, or come near one another.
    relative, relative_error : ndarray, shapes (n, n_arms - 1, 3) and (n, n_arms - 1), or None
        Target vectors from the first end effector to the others in the base frame, and distances from them [m], where
        only these were kept (``hand_targets="relative"``).
    """

    group: ArmGroup
    trajectory: Trajectory
    arms: tuple[ArmMotion, ...]
    coupled: bool = False
    relative: Array | None = None
    relative_error: Array | None = None

    @classmethod
    def of(
        cls,
        group: ArmGroup,
        schedules: Sequence[Schedule],
        trajectory: Trajectory,
        collisions: Collisions | None,
        velocity_limits: Array,
        held: NDArray[np.bool_] | None = None,
        position_tolerance: float = ENOUGH_METRES,
        pointwise_bests: Sequence[Array] | None = None,
        **relative: Any,
    ) -> "RobotMotion":
        """Compare the trajectory of a group with the targets of its arms."""
        clearance, arms = Clearance.of(collisions, trajectory), []
        for i, (schedule, columns) in enumerate(zip(schedules, group.columns, strict=True)):
            own, plan = trajectory.of_arm(schedule.objective.arm, columns), dict[str, Any](clearance=clearance)
            if trajectory.limits is not None:
                plan["demonstrated_time"] = schedule.time
            if pointwise_bests is not None:
                plan["pointwise_best"] = pointwise_bests[i]
            arms.append(ArmMotion.of(schedule, own, velocity_limits[columns], held, position_tolerance, **plan))
        return cls(group, trajectory, tuple(arms), **relative)

    def __repr__(self) -> str:
        return f"RobotMotion({', '.join(map(repr, self.arms))})"

    @property
    def limits(self) -> MotionLimits | None:
        """Limits of all joints; None for a motion of the controller."""
        return self.trajectory.limits

    @property
    def limit_use(self) -> LimitUse | None:
        """Largest shares of these limits."""
        return self.trajectory.limit_use

    @property
    def clearance(self) -> Clearance:
        """Collisions and clearance of all arms, with each other and their surroundings."""
        return self.arms[0].clearance

    @property
    def pointwise_ratio(self) -> float:
        """Ratio of the root mean square distance of all arms to that of the best pointwise solutions found."""
        best = [arm.pointwise_best for arm in self.arms if arm.pointwise_best is not None]
        return rms_ratio(np.concatenate([arm.distance for arm in self.arms]), np.concatenate(best))

    def save_joints(self, path: str | os.PathLike[str]) -> None:
        """Write an ``.npz`` file without pickled objects.

        One arm: see `ArmMotion.save_joints`. Several: the arrays of the joints, ``manipulability``, ``distance``,
        ``status``, ``damping`` and ``position_error`` of each arm with its name as a prefix, such as ``left_distance``,
        and ``relative`` and ``relative_error`` where only these were kept.

        Raises
        ------
        OutputError
            When the file cannot be written.
        """
        if len(self.arms) == 1:
            self.arms[0].save_joints(path)
            return
        arrays = self.trajectory.joint_arrays()
        for name, arm in zip(self.group.names, self.arms, strict=True):
            arrays |= {f"{name}_{key}": array for key, array in arm.error_arrays().items()}
        if self.relative is not None and self.relative_error is not None:
            arrays |= {"relative": self.relative, "relative_error": self.relative_error}
        save_arrays(path, arrays)
