"""What the live view is told, what it asks a robot for, and what there is to see."""

from dataclasses import dataclass

import numpy as np

from maniport.tracking.schedule import Schedule
from maniport.validation import Array, as_number

CONTROL_STEP = 1.0 / 120.0
"""Longest step of the robot's inverse kinematics [s]."""
LONGEST_FRAME = 0.1
"""The robot moves no more than it can in this time [s], however long the page stood still."""


@dataclass(frozen=True, eq=False)
class Wish:
    """What the controls say.

    Attributes
    ----------
    joints : ndarray, shape (dof,)
        Of the person's arm [rad]; beyond a limit they are taken for the limit.
    method : str
        One of the names of `maniport.view.maps.Methods`.
    mounting : ndarray, shape (3, 3)
        Rotation from the person's trunk frame to the robot's base frame.
    tip_follows : bool
        Whether the robot's tip shall also go where the person's hand goes.
    """

    joints: Array
    method: str
    mounting: Array
    tip_follows: bool = False


@dataclass(frozen=True, eq=False)
class Picture:
    """What there is to see, each body in its own base frame.

    Attributes
    ----------
    teacher_joints, student_joints : ndarray, shape (dof,)
    teacher_skeleton, student_skeleton : ndarray, shape (k, 3)
        Polylines from base to hand or tip [m].
    student_links : ndarray, shape (joints + 1, 4, 4)
        Poses of the robot's base and of what follows each of its joints.
    demonstrated_ellipsoid, target_ellipsoid, achieved_ellipsoid : ndarray, shape (3, 3)
        The person's own, what the map makes of it, and the robot's own.
    target_tip : ndarray, shape (3,), or None
        Where the robot's tip shall be [m].
    mounting : ndarray, shape (3, 3)
    distance : float
        Affine-invariant distance between the target and what the robot achieves, both with the damping.
    position_error : float or None
        Of the robot's tip [m].
    note : str
        Why the target is not new, where it is not, or another method's.
    at_limit : tuple of str
        Names of the robot's joints that are at a limit.
    """

    teacher_joints: Array
    teacher_skeleton: Array
    demonstrated_ellipsoid: Array
    target_ellipsoid: Array
    target_tip: Array | None
    student_joints: Array
    student_skeleton: Array
    student_links: Array
    achieved_ellipsoid: Array
    mounting: Array
    distance: float
    position_error: float | None
    note: str
    at_limit: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Asked:
    """What a robot's arm is asked for at a moment.

    Attributes
    ----------
    joints : ndarray, shape (dof,)
        Of the person's arm, within its limits [rad].
    ellipsoid, target : ndarray, shape (3, 3)
        The demonstrated one, and what the map makes of it.
    turn : ndarray, shape (3, 3)
        How the map turns the motion of the hand.
    tip : ndarray, shape (3,), or None
        Where the robot's tip shall be [m].
    note : str
        As of a `Picture`.
    """

    joints: Array
    ellipsoid: Array
    target: Array
    turn: Array
    tip: Array | None
    note: str

    def schedule(self, seconds: float) -> Schedule:
        """The same all the time, for so long [s]."""
        steps = int(np.ceil(seconds / CONTROL_STEP))
        return Schedule(
            np.linspace(0.0, seconds, steps + 1),
            np.broadcast_to(self.target, (steps + 1, 3, 3)),
            None if self.tip is None else np.broadcast_to(self.tip, (steps + 1, 3)),
        )


def as_elapsed(seconds: float) -> float:
    """Require a time that has passed [s]; of a long one the robot takes a part."""
    return min(as_number(seconds, "seconds", minimum=0.0), LONGEST_FRAME)
