"""Options of the planner, checked and resolved for an arm or a group."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from numpy.typing import ArrayLike

from maniport.arms import Arm, ArmGroup
from maniport.arms.collisions import Collisions, as_collisions
from maniport.errors import InvalidInputError
from maniport.motion.effort import FULL, Effort, as_effort
from maniport.motion.motion_limits import MotionLimits
from maniport.motion.objective import ORIENTATION_WEIGHT, POINTING, axis_weights
from maniport.motion.placement.arguments import as_workspace
from maniport.util.defaults import MARGIN, POSITION_TOLERANCE, RATE
from maniport.util.validation import Array, as_number


@dataclass(frozen=True)
class PlanControl:
    """Settings of `plan_motion`.

    Attributes
    ----------
    position_tolerance : float
        Position tolerance of the end effector, for the 95th percentile of the position error [m]. It is used, mostly
        for a shorter duration.
    speed_scale : float
        Largest speed relative to the demonstration. Where limits demand it, the motion is slower.
    rate : float
        Samples of the result per second [Hz].
    motion_limits : MotionLimits, path, mapping or None
        See `MotionLimits.of`.
    joint_limit_margin : float
        Share of each joint's range that is kept free at either end, unless `motion_limits` are `MotionLimits` already.
    collisions : Collisions or bool
        Collision model; True: self-collisions.
    orientation_axes : {"pointing", "whole"}
        Which axes of target orientations count: z, or all.
    orientation_weight : float
        Weight of the angle from them [1/rad].
    workspace : three pairs of floats, optional
        Bounds of the placed path, as in `maniport.motion.place_path`; nothing else uses it.
    home : array_like, shape (dof,), optional
        Configuration at which the motion begins and ends, at rest [rad or m].
    planning_effort : {"full", "quick"}
        Planning effort, see `maniport.motion.effort`.

    Raises
    ------
    InvalidInputError
        When a value is out of its range.
    """

    position_tolerance: float = POSITION_TOLERANCE
    speed_scale: float = 1.0
    rate: float = RATE
    motion_limits: MotionLimits | str | os.PathLike[str] | Mapping[str, Any] | None = None
    joint_limit_margin: float = MARGIN
    collisions: Collisions | bool = True
    orientation_axes: str = POINTING
    orientation_weight: float = ORIENTATION_WEIGHT
    workspace: Sequence[Sequence[float | None]] | None = None
    home: ArrayLike | None = None
    planning_effort: str = FULL

    def __post_init__(self) -> None:
        as_number(self.position_tolerance, "position_tolerance", above=0.0)
        as_number(self.speed_scale, "speed_scale", above=0.0)
        as_number(self.rate, "rate", minimum=10.0)
        as_workspace(self.workspace)
        as_effort(self.planning_effort)
        axis_weights(self.orientation_axes, as_number(self.orientation_weight, "orientation_weight", above=0.0))
        as_number(self.joint_limit_margin, "joint_limit_margin", minimum=0.0, maximum=0.4)

    def resolved(self, arm: Arm | ArmGroup, planner: Any = None) -> "PlanControl":
        """Look up limits and collisions of the arms, or take those of a planner; check the home configuration.

        Raises
        ------
        FileFormatError
            When a file of limits cannot be read or does not fit the arm.
        InvalidInputError
            When limits or collisions do not fit the arm, or the home configuration is beyond limits or collides.
        """
        given = self.motion_limits
        if planner is not None:
            limits, apart = planner.limits, planner.collisions
        else:
            limits = given if isinstance(given, MotionLimits) else MotionLimits.of(arm, given, self.joint_limit_margin)
            apart = as_collisions(self.collisions, limits.arm)
        if self.home is not None:
            require_free(self.home, "home", limits, apart)
        return replace(self, motion_limits=limits, collisions=apart or False)

    @property
    def budget(self) -> Effort:
        """Search budget of the planning effort."""
        return as_effort(self.planning_effort)


def require_free(configuration: ArrayLike, name: str, limits: MotionLimits, apart: Collisions | None) -> Array:
    """Require one configuration (dof,) within the limits and without collisions."""
    q: Array = limits.arm.require_within_limits(configuration, name)
    if q.ndim != 1:
        raise InvalidInputError(f"{name} must be one configuration, shape ({limits.arm.dof},); found shape {q.shape}")
    if apart is not None and apart.collides(q):
        nearest = apart.nearest(q)
        raise InvalidInputError(
            f"{name}: {nearest.first} and {nearest.second} of {limits.arm.name!r} collide, by "
            f"{-1e3 * float(nearest.distance):.0f} mm; give a collision-free configuration"
        )
    return q
