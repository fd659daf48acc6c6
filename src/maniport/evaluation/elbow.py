"""Where the elbow is: the angle of the plane through shoulder, elbow and wrist about the line from shoulder to wrist.

The shoulder-elbow-wrist angle describes the posture of an arm with seven joints by one number beside the hand's pose;
to keep it is what many who retarget arm motion do instead of keeping ellipsoids (arXiv 2602.01632, for one). Angles are
stereographic: with e the unit vector from shoulder to wrist, they are counted about e from the direction
x = ((e − t) × r) × e, which is defined unless the hand is exactly behind the shoulder. Counted from a fixed direction
alone they would not be defined wherever the arm hangs, or wherever it reaches straight up, as on a ladder.

References
----------
Elias and Wen, *Redundancy parameterization and inverse kinematics of 7-DOF revolute manipulators*, 2024.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from maniport.bodies import Arm
from maniport.errors import InvalidInputError
from maniport.validation import Array, as_finite, as_rotation, require_shape
from maniport.wording import argument

ELBOWS = {
    "myoarm": ("shoulder", "elbow", "wrist"),
    "rhuman": ("shoulder", "elbow", "wrist"),
    "panda": ("panda_link2", "panda_link4", "panda_link6"),
    "xarm7": ("link2", "link4", "link6"),
    "UF_ROBOT": ("link2", "link4", "link6"),
}
"""Frames at shoulder, elbow and wrist of arms with seven joints, by the arm's name (UF_ROBOT is the xArm7 in its URDF).
Of the robots they are where the axes of joints 1 to 3 meet, on that of joint 4, and where those of joints 5 and 6 meet.
"""

BEHIND = np.array([-1.0, 0.0, 0.0])
"""T: the one direction of the hand in which the angle is not defined; x points forward."""
UP = np.array([0.0, 0.0, 1.0])
"""R: an angle of 0 is an elbow that is turned this way, as far as that can be said."""

STRAIGHT = 1e-6
"""An elbow that is nearer to the line than this share of its length has no angle."""


def elbow_frames(arm: Arm, frames: Sequence[str] | None = None) -> tuple[str, ...]:
    """Names of the frames at shoulder, elbow and wrist: those that are given, else those that are known.

    Raises
    ------
    InvalidInputError
        When none are known: the arm has no elbow, or nobody has said where; or those given are not three of its own.
    """
    if frames is not None:
        names = arm.chain.known_frames(frames)
        if len(names) != 3:
            raise InvalidInputError(
                f"{argument('frames', option='--elbow')} must name those of shoulder, elbow and wrist; "
                f"found {list(names)}"
            )
        return names
    found = ELBOWS.get(arm.name.removesuffix("_left"))
    if arm.dof != 7 or found is None or not set(found) <= set(arm.frames):
        raise InvalidInputError(
            f"the elbow angle of {arm.name!r} with {arm.dof} joints is not defined: no elbow is known of it. Known are "
            f"those of {', '.join(map(repr, ELBOWS))} with 7 joints; for others name the frames at shoulder, elbow and "
            f"wrist by {argument('frames', option='--elbow')}"
        )
    return found


def elbow_angle(arm: Arm, q: ArrayLike, turn: ArrayLike | None = None, frames: Sequence[str] | None = None) -> Array:
    """Stereographic shoulder-elbow-wrist angles of an arm.

    Parameters
    ----------
    arm : Arm
    q : array_like, shape (..., dof)
        Joint positions [rad] or [m].
    turn : array_like, shape (3, 3), optional
        Rotation from a frame with x forward and z up to the arm's base; the identity by default. Arms that are compared
        are looked at in one frame.
    frames : sequence of three str, optional
        At shoulder, elbow and wrist; default: `elbow_frames`.

    Returns
    -------
    ndarray, shape (...)
        Within ±π [rad]; nan where the arm is straight or the hand exactly behind the shoulder.

    Raises
    ------
    InvalidInputError
        When no elbow is known of the arm, or an argument has a wrong shape or value.
    """
    names = elbow_frames(arm, frames)
    back = np.eye(3) if turn is None else as_rotation(turn, "turn", 3)
    return angle_of(arm.point_positions(q, names) @ back)


def angle_of(points: ArrayLike) -> Array:
    """The same of the places of shoulder, elbow and wrist (..., 3, 3) [m], x forward and z up."""
    places = as_finite(points, "points")
    require_shape(places, "points", (..., 3, 3))
    elbow, wrist = places[..., 1, :] - places[..., 0, :], places[..., 2, :] - places[..., 0, :]
    length = np.linalg.norm(wrist, axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        along = wrist / length[..., None]
        start = np.cross(np.cross(along - BEHIND, UP), along)
        start /= np.linalg.norm(start, axis=-1)[..., None]
    ahead, beside = np.sum(elbow * start, axis=-1), np.sum(elbow * np.cross(along, start), axis=-1)
    return np.where(np.hypot(ahead, beside) > STRAIGHT * length, np.arctan2(beside, ahead), np.nan)


def turned_by(first: Array, other: Array) -> Array:
    """How far angles are apart, within ±π [rad]."""
    return np.asarray((first - other + np.pi) % (2.0 * np.pi) - np.pi)
