"""What the live view shows, without any page: wishes in, pictures out, a recording that plays, a robot that follows."""

import contextlib
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from maniport.bodies import Arm
from maniport.errors import NotSPDError
from maniport.spd.affine_invariant import distance_unchecked
from maniport.thinning import evenly
from maniport.tracking import Objective, PlacedPath, StartBank, nearest_feasible, place_path
from maniport.tracking.follow.follower import Follower
from maniport.tracking.objective import FOLLOWING_WEIGHT
from maniport.tracking.schedule import Schedule
from maniport.validation import Array, as_choice, as_finite, as_number, as_times, require_shape
from maniport.view.maps import LiveMap, Refitting

CONTROL_STEP = 1.0 / 120.0
"""Longest step of the robot's inverse kinematics [s]."""
POINTS = 32
"""Hand positions that decide the placement; people wait for the page."""
GAP_STARTS, GAP_STEPS = 4, 20
"""How short the search for feasibility gaps is: 4 ms a method, while the robot goes on."""
NEAR_LIMIT = 5e-3
"""A joint nearer to a limit than this share of its range is at it."""
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


def place_tip(teacher: Arm, joints: Array, chosen: LiveMap, student: Arm, bank: StartBank) -> PlacedPath:
    """Place the hand positions of some joint positions (n, dof) where the robot makes the ellipsoids best.

    Without a further turn about the vertical; when the map changes, its turn takes the place of the one here.
    """
    some = joints[evenly(len(joints), POINTS)]
    targets = np.array([chosen.transform(ellipsoid) for ellipsoid in teacher.manipulability(some)])
    hands = teacher.forward(some)[:, :3, 3]
    return place_path(hands, targets, student, turn=chosen.turn, yaw=0.0, damping=bank.damping, bank=bank)


class Playback:
    """Plays joint positions over time, again and again.

    Parameters
    ----------
    time : array_like, shape (n,)
        Increasing [s]; n ≥ 2.
    joints : array_like, shape (n, dof)
        Joint positions [rad or m]; straight lines in between.

    Attributes
    ----------
    duration : float
        From the first to the last time [s].
    position : float
        Where it is, between zero and `duration` [s].
    """

    def __init__(self, time: ArrayLike, joints: ArrayLike):
        times, path = as_times(time, fewest=2), as_finite(joints, "joints")
        require_shape(path, "joints", (len(times), "dof"), ", as many as times")
        self._time, self._path = times - times[0], path
        self.duration = float(self._time[-1])
        self.position = 0.0

    def advance(self, seconds: float) -> None:
        """Move on, from the end to the start again; backwards where `seconds` is negative."""
        self.position = float((self.position + as_number(seconds, "seconds")) % self.duration)

    def seek(self, position: float) -> None:
        """Go to a time [s]; beyond the ends, to the end."""
        self.position = min(max(as_number(position, "position"), 0.0), self.duration)

    def joints(self) -> Array:
        """Joint positions at this time, shape (dof,)."""
        return np.array([np.interp(self.position, self._time, column) for column in self._path.T])


class LiveState:
    """Two arms and the maps between them; the second follows the first.

    Parameters
    ----------
    teacher, student : Arm
        The person's arm and the robot's.
    refitting : Refitting
        Maps between their domains.
    place : PlacedPath or None
        Where the person's hand positions lie before the robot, but for the turn, which is that of the map in use. None
        while that is searched for: the tip does not follow then.
    bank : StartBank
        Of the student; its damping is added to ellipsoids before they are compared.
    playback : Playback, optional
        A recorded motion of the teacher.
    """

    def __init__(
        self,
        teacher: Arm,
        student: Arm,
        refitting: Refitting,
        place: PlacedPath | None,
        bank: StartBank,
        playback: Playback | None = None,
    ):
        self.teacher, self.student, self.refitting, self.playback = teacher, student, refitting, playback
        self.place, self._bank = place, bank
        self._follower = Follower(Objective.of(student, damping=bank.damping, position_weight=FOLLOWING_WEIGHT))
        self._joints = bank.joint_positions[0]
        self._target: Array | None = None
        self._leap = True

    @property
    def methods(self) -> tuple[str, ...]:
        """Names of what there is to choose from."""
        return self.refitting.methods.names

    def leap(self) -> None:
        """Let the robot start from the best posture there is, with the next step, instead of moving on."""
        self._leap = True

    def advance(self, wish: Wish, seconds: float) -> Picture:
        """Take the wishes, and let the robot follow for some time [s].

        Raises
        ------
        InvalidInputError
            When a wish cannot be understood.
        """
        joints = as_finite(wish.joints, "joints")
        require_shape(joints, "joints", (self.teacher.dof,))
        joints = np.clip(joints, self.teacher.lower, self.teacher.upper)
        elapsed = min(as_number(seconds, "seconds", minimum=0.0), LONGEST_FRAME)
        as_choice(wish.method, "method", self.methods)
        self.refitting.want(wish.mounting, wish.method)
        chosen, note = self._chosen(wish.method)

        ellipsoid = self.teacher.manipulability(joints)
        target, stays = self._mapped(chosen, ellipsoid)
        tip = None
        if wish.tip_follows and self.place is None:
            note = note or "a place for the path is searched for; until it is found the tip is free"
        elif wish.tip_follows and self.place is not None:
            tip = replace(self.place, turn=chosen.turn).apply(self.teacher.forward(joints)[:3, 3])
        self._follow(target, tip, elapsed)

        own = self.student.manipulability(self._joints)
        reached = self.student.forward(self._joints)[:3, 3]
        return Picture(
            teacher_joints=joints,
            teacher_skeleton=self.teacher.skeleton(joints),
            demonstrated_ellipsoid=ellipsoid,
            target_ellipsoid=target,
            target_tip=tip,
            student_joints=self._joints,
            student_skeleton=self.student.skeleton(self._joints),
            student_links=self.student.link_poses(self._joints),
            achieved_ellipsoid=own,
            mounting=wish.mounting,
            distance=float(distance_unchecked(*(self._follower.objective.damped(one) for one in (target, own)))),
            position_error=None if tip is None else float(np.linalg.norm(reached - tip)),
            note=stays or note,
            at_limit=self._at_limit(),
        )

    def gaps(self, ellipsoid: Array) -> dict[str, float | None]:
        """Feasibility gap of what each method makes of an ellipsoid, an upper bound by a short search.

        None where a method has no image for it.
        """
        images: dict[str, Array] = {}
        for name, chosen in self.refitting.maps.items():
            with contextlib.suppress(NotSPDError):
                images[name] = chosen.transform(ellipsoid)
        search = nearest_feasible(
            self.student, np.array(list(images.values())), damping=self._bank.damping, bank=self._bank,
            n_starts=GAP_STARTS, max_iter=GAP_STEPS,
        )  # fmt: skip
        found = dict(zip(images, search.distance.tolist(), strict=True))
        return {name: found.get(name) for name in self.refitting.maps}

    def _chosen(self, method: str) -> tuple[LiveMap, str]:
        """The map of a method; while it is being fitted for the first time that of another, and a word about it."""
        maps = self.refitting.maps
        if method in maps:
            return maps[method], ""
        name, other = next(iter(maps.items()))
        return other, f"{method} is being fitted; meanwhile the target is that of {name}"

    def _at_limit(self) -> tuple[str, ...]:
        """Names of the robot's joints that are within a trace of a limit."""
        arm = self.student
        trace = NEAR_LIMIT * (arm.upper - arm.lower)
        near = (self._joints <= arm.lower + trace) | (self._joints >= arm.upper - trace)
        return tuple(name for name, held in zip(arm.joint_names, near, strict=True) if held)

    def _mapped(self, chosen: LiveMap, ellipsoid: Array) -> tuple[Array, str]:
        """The image of an ellipsoid; the one before it, and why, where it has none."""
        try:
            self._target = chosen.transform(ellipsoid)
        except NotSPDError as error:
            if self._target is None:
                raise
            return self._target, f"no image of this ellipsoid, the last one stays: {error}"
        return self._target, ""

    def _follow(self, target: Array, tip: Array | None, seconds: float) -> None:
        """Move the robot towards what it is asked for, as far as it gets."""
        if self._leap:
            tips = None if tip is None else tip[None]
            best = nearest_feasible(
                self.student, target[None], damping=self._bank.damping, positions=tips, bank=self._bank
            )
            self._joints, self._leap = best.joint_positions[0], False
        if seconds == 0.0:
            return
        steps = int(np.ceil(seconds / CONTROL_STEP))
        schedule = Schedule(
            np.linspace(0.0, seconds, steps + 1),
            np.broadcast_to(target, (steps + 1, 3, 3)),
            None if tip is None else np.broadcast_to(tip, (steps + 1, 3)),
        )
        self._joints = self._follower.follow(self._joints, schedule)[0][-1]
