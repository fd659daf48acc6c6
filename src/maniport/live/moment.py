"""What one step of `maniport.Live` gives."""

from dataclasses import dataclass

from maniport.validation import Array

REACHING, FOLLOWING, LAGGING = "reaching", "following", "lagging"
HOLDING, RECOVERING = "holding", "recovering"
STATES = (REACHING, FOLLOWING, LAGGING, HOLDING, RECOVERING)
"""What the robot does: it goes from its start to where the person's arm is; it follows; it follows as it can, with its
tip far from its path, since the person is too fast for it or it does not reach there; it brakes and rests, since the
person is not seen or leaps; it goes back to where the person's arm is by now."""


@dataclass(frozen=True, slots=True, eq=False)
class Moment:
    """The robot at one time, and what it was asked for.

    Attributes
    ----------
    time : float
        Of the robot's state [s]. It begins with the time of the first frame and advances by the clock of `Live`, less
        what steps took longer than 2 ms, so that joint positions keep the limits over it. Simulated: the frame's time.
    state : str
        One of `STATES`.
    joint_positions, joint_velocities : ndarray, shape (dof,)
        Of the robot [rad or m, and for each second].
    achieved : ndarray, shape (d, d)
        Its velocity ellipsoid in its base frame.
    tip : ndarray, shape (3,)
        Where its tip is, in its base frame [m].
    person : ndarray, shape (7,), or None
        The person's joint angles, as they were last believed [rad]; None before the person is seen for the first time,
        as the rest.
    demonstrated, target : ndarray, shape (d, d), or None
        Ellipsoids: the person's in the trunk frame, and what the robot is asked for in its base frame; that of velocity
        also where forces were transferred.
    distance : float or None
        Affine-invariant distance of target and achieved ellipsoid, with the damping.
    tip_error : float or None
        How far the tip is from where the path has it [m]; None without a path.

    See Also
    --------
    Live : makes it.
    """

    time: float
    state: str
    joint_positions: Array
    joint_velocities: Array
    achieved: Array
    tip: Array
    person: Array | None
    demonstrated: Array | None
    target: Array | None
    distance: float | None
    tip_error: float | None
