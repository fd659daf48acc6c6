"""The row of a robot that keeps the person's elbow angle: why ellipsoids, and not the elbow, in figures."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from maniport.bodies import VELOCITY, Arm, EllipsoidSpec
from maniport.errors import InvalidInputError
from maniport.evaluation.elbow import elbow_angle, elbow_frames, turned_by
from maniport.evaluation.keep_elbow import keep_elbow
from maniport.evaluation.measures import moves, rmse, smoothness, structure
from maniport.evaluation.rows import ELBOW, Gaps, Row
from maniport.spd.affine_invariant import distance_unchecked
from maniport.tracking.placement.placed_path import PlacedPath
from maniport.transfer import DomainAdapter
from maniport.validation import Array, as_finite, as_points, require_shape
from maniport.wording import argument

STRETCH = 0.9
"""Of the ratio of the arms' lengths: robots with offsets at the elbow do not stretch as people do."""


class ElbowMotion(NamedTuple):
    """A robot's motion that keeps an elbow angle, and what was asked of it.

    Attributes
    ----------
    joint_positions : ndarray, shape (n, dof)
        [rad] or [m].
    path : ndarray, shape (n, 3)
        Of the tip, in the base frame [m].
    tip_error : ndarray, shape (n,)
        How far the tip is beside it [m].
    elbow_error : ndarray, shape (n,)
        How far the elbow is turned beside the person's angle [rad]; nan where one of them is not defined.
    """

    joint_positions: Array
    path: Array
    tip_error: Array
    elbow_error: Array


@dataclass(frozen=True, eq=False)
class ElbowBaseline:
    """The baseline that `evaluate` compares an adapter with: the robot turns its elbow as the person does.

    The angle is that of `maniport.evaluation.elbow`, the motion that of `maniport.evaluation.keep_elbow`.

    Parameters
    ----------
    person : Arm
        The person's arm.
    joint_angles : array_like, shape (n, dof)
        Its postures, one for each ellipsoid of the profile [rad].
    placement : PlacedPath, optional
        Where the hand path lies before the robot, so that the baseline has the path of a motion that was planned for
        ellipsoids (`Execution.placement`). Default: shoulder on shoulder, the hand's way from there scaled by nine
        tenths of the ratio of the arms' lengths.
    frames : sequence of three str, optional
        Of the robot, at shoulder, elbow and wrist. Default: those that are known of it
        (`maniport.evaluation.elbow.ELBOWS`).
    path : array_like, shape (n, 3), optional
        Of the robot's tip, in its base frame [m]. Default: where the person's hand is in these postures, placed.

    Raises
    ------
    InvalidInputError
        When the angles do not fit the arm, or the path the angles.

    See Also
    --------
    evaluate : takes it.
    """

    person: Arm
    joint_angles: ArrayLike
    placement: PlacedPath | None = None
    frames: Sequence[str] | None = None
    path: ArrayLike | None = None

    def __post_init__(self) -> None:
        q = as_finite(self.joint_angles, "joint_angles")
        require_shape(q, "joint_angles", ("n", self.person.dof))
        if self.path is not None:
            require_shape(as_finite(self.path, "path"), "path", (len(q), 3), ", a point for each posture")

    def require_fits(self, profile: ArrayLike, robot: Arm | None) -> None:
        """Raise InvalidInputError unless there are as many postures as ellipsoids, and a robot with such frames."""
        if robot is None:
            raise InvalidInputError(f"the row of the elbow needs the student's arm, {argument('robot')}")
        ellipsoids = as_finite(profile, "profile")
        require_shape(ellipsoids, "profile", ("n", "d", "d"))
        count, found = len(ellipsoids), len(as_finite(self.joint_angles, "joint_angles"))
        if count != found:
            raise InvalidInputError(f"the elbow's joint_angles must be those of the profile, {count}; found {found}")
        if self.frames is not None:
            elbow_frames(robot, self.frames)

    def motion(self, robot: Arm, turn: ArrayLike, random_state: int = 0) -> ElbowMotion:
        """Find what the robot does.

        Parameters
        ----------
        robot : Arm
        turn : array_like, shape (3, 3)
            Rotation from the person's trunk frame to the robot's base frame, but for that of the placement.
        random_state : int
            Seed of the postures that are drawn.

        Raises
        ------
        InvalidInputError
            When no elbow is known of an arm.
        """
        q, frames = as_finite(self.joint_angles, "joint_angles"), elbow_frames(robot, self.frames)
        hand, angles, facing = self.person.forward(q)[:, :3, 3], elbow_angle(self.person, q), np.asarray(turn)
        if self.placement is not None:
            facing = self.placement.rotation @ facing
        if self.path is not None:
            path = as_finite(self.path, "path")
        elif self.placement is not None:
            path = self.placement.apply(hand)
        else:
            path = self._shoulder_on_shoulder(hand, q, robot, frames, facing)
        found = keep_elbow(robot, path, angles, facing, frames, random_state)
        off = np.abs(turned_by(elbow_angle(robot, found, facing, frames), angles))
        return ElbowMotion(found, path, np.linalg.norm(robot.forward(found)[:, :3, 3] - path, axis=1), off)

    def _shoulder_on_shoulder(self, hand: Array, q: Array, robot: Arm, frames: Sequence[str], turn: Array) -> Array:
        """The hand path (n, 3) as it lies where the robot's shoulder is the person's, shape (n, 3)."""
        own = elbow_frames(self.person)
        ratio = _reach(robot, frames) / _reach(self.person, own)
        shoulder = robot.point_positions(_zero(robot), frames[:1])[0]
        return np.asarray(shoulder + STRETCH * ratio * (hand - self.person.point_positions(q, own[:1])[:, 0]) @ turn.T)


def with_elbow(
    rows: Sequence[Row],
    baseline: ElbowBaseline,
    adapter: DomainAdapter,
    profile: ArrayLike,
    robot: Arm,
    spec: EllipsoidSpec = VELOCITY,
    truth: ArrayLike | None = None,
) -> tuple[Row, ...]:
    """Rows of an evaluation with that of the baseline as the last; the adapter's also says what it keeps of the person.

    Parameters
    ----------
    rows : sequence of Row
        That of the adapter first.
    baseline : ElbowBaseline
    adapter : DomainAdapter
        Fitted.
    profile : array_like, shape (n, d, d)
        The teacher's ellipsoids.
    robot : Arm
        The student. Where no elbow is known of it, the row says so and has no measures.
    spec, truth
        As in `maniport.evaluation.evaluate`.

    Raises
    ------
    InvalidInputError
        When there are not as many postures as ellipsoids, or the robot has not the frames that are named.
    """
    baseline.require_fits(profile, robot)
    original = as_points(adapter.teacher_side(profile, "profile"), "profile", minimum=3)
    target = adapter.student_side(adapter.transform(profile))
    first = replace(rows[0], to_demonstrated=Gaps.of(distance_unchecked(original, target)))
    try:
        elbow_frames(baseline.person), elbow_frames(robot, baseline.frames)
    except InvalidInputError as error:
        return first, *rows[1:], Row(ELBOW, f"left out: {error}")
    return first, *rows[1:], _row(baseline, adapter, original, target, robot, spec, truth)


def _row(
    baseline: ElbowBaseline,
    adapter: DomainAdapter,
    original: Array,
    target: Array,
    robot: Arm,
    spec: EllipsoidSpec,
    truth: ArrayLike | None,
) -> Row:
    motion, placed = baseline.motion(robot, adapter.turn_), baseline.placement
    mapped = as_points(made_by(motion.joint_positions, robot, adapter, placed, spec), "the elbow's ellipsoids")
    known = np.isfinite(motion.elbow_error)
    own_place = placed is None and baseline.path is None
    where = "on a path laid shoulder on shoulder" if own_place else "on the same path as the motion's"
    return Row(
        ELBOW,
        f"the robot with the person's elbow angle, its tip {where}: what it makes itself, so that it has no gap",
        rmse=None if truth is None else rmse(adapter.student_side(truth, "truth"), mapped),
        smoothness=smoothness(mapped, original) if moves(original) else None,
        structure=structure(mapped, original) if moves(original) else None,
        to_target=Gaps.of(distance_unchecked(target, mapped)),
        to_demonstrated=Gaps.of(distance_unchecked(original, mapped)),
        tip_error=Gaps.of(1e3 * motion.tip_error),
        elbow_error=Gaps.of(np.degrees(motion.elbow_error[known]), np.flatnonzero(known)) if known.any() else None,
    )


def made_by(
    q: Array, robot: Arm, adapter: DomainAdapter, placement: PlacedPath | None, spec: EllipsoidSpec = VELOCITY
) -> Array:
    """What a robot makes at q (n, dof) as it compares with the adapter's images, shape (n, d, d).

    Regularised as the student's ellipsoids are, and without the turn of the placement.
    """
    back = spec.rotation(np.eye(3) if placement is None else placement.rotation).T
    return adapter.student_side(back @ robot.ellipsoids(q, spec) @ back.T)


def _reach(arm: Arm, frames: Sequence[str]) -> float:
    """Lengths from shoulder to elbow, to wrist, to tip, together [m]."""
    q = _zero(arm)
    corners = np.vstack([arm.point_positions(q, frames), arm.forward(q)[:3, 3]])
    return float(np.linalg.norm(np.diff(corners, axis=0), axis=1).sum())


def _zero(arm: Arm) -> Array:
    """Joint positions next to zero, shape (dof,)."""
    return np.clip(np.zeros(arm.dof), arm.lower, arm.upper)
