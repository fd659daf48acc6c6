"""What the live view shows, without any page: wishes in, pictures out, one robot that follows."""

from dataclasses import dataclass

import numpy as np

from maniport.bodies import Arm
from maniport.errors import InvalidInputError, NotSPDError
from maniport.live.hand_place import HandPlace
from maniport.live.maps import LiveMap
from maniport.live.playback import Playback
from maniport.live.refitting import Refitting
from maniport.spd.affine_invariant import distance_unchecked
from maniport.tracking import Objective, StartBank, nearest_feasible
from maniport.tracking.follow.follower import Follower
from maniport.tracking.objective import FOLLOWING_WEIGHT
from maniport.tracking.schedule import Schedule
from maniport.validation import Array, as_choice, as_finite, as_number

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
        One of the names of `maniport.live.maps.Methods`.
    mounting : ndarray, shape (3, 3)
        Rotation from the person's trunk frame to the robot's base frame.
    hand_follows : bool
        Whether the robot's hand shall also go where the person's goes.
    """

    joints: Array
    method: str
    mounting: Array
    hand_follows: bool = False


@dataclass(frozen=True, eq=False)
class Picture:
    """What there is to see, each body in its own base frame.

    Attributes
    ----------
    teacher_joints, student_joints : ndarray, shape (dof,)
    teacher_skeleton, student_skeleton : ndarray, shape (k, 3)
        Polylines from base to hand [m].
    student_links : ndarray, shape (joints + 1, 4, 4)
        Poses of the robot's base and of what follows each of its joints.
    teacher_ellipsoid, wanted_ellipsoid, student_ellipsoid : ndarray, shape (3, 3)
        The person's own, what the map makes of it, and the robot's own.
    wanted_hand : ndarray, shape (3,), or None
        Where the robot's hand shall be [m].
    mounting : ndarray, shape (3, 3)
    distance : float
        Affine-invariant distance between the wanted ellipsoid and the robot's, both with the damping.
    position_error : float or None
        Of the robot's hand [m].
    note : str
        Why the wanted ellipsoid is not new, where it is not.
    """

    teacher_joints: Array
    teacher_skeleton: Array
    teacher_ellipsoid: Array
    wanted_ellipsoid: Array
    wanted_hand: Array | None
    student_joints: Array
    student_skeleton: Array
    student_links: Array
    student_ellipsoid: Array
    mounting: Array
    distance: float
    position_error: float | None
    note: str


class LiveState:
    """Two arms and the maps between them; the second follows the first.

    Parameters
    ----------
    teacher, student : Arm
        The person's arm and the robot's.
    refitting : Refitting
        Maps between their domains.
    place : HandPlace
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
        place: HandPlace,
        bank: StartBank,
        playback: Playback | None = None,
    ):
        self.teacher, self.student, self.refitting, self.playback = teacher, student, refitting, playback
        self._place, self._bank = place, bank
        self._follower = Follower(Objective.of(student, damping=bank.damping, position_weight=FOLLOWING_WEIGHT))
        self._joints = bank.joint_positions[0]
        self._wanted: Array | None = None
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
        if joints.shape != (self.teacher.dof,):
            raise InvalidInputError(f"joints must have shape ({self.teacher.dof},); found {joints.shape}")
        joints = np.clip(joints, self.teacher.lower, self.teacher.upper)
        elapsed = min(as_number(seconds, "seconds", minimum=0.0), LONGEST_FRAME)
        as_choice(wish.method, "method", self.methods)
        self.refitting.want(wish.mounting, wish.method)
        chosen = self.refitting.maps[wish.method]

        ellipsoid = self.teacher.manipulability(joints)
        wanted, note = self._mapped(chosen, ellipsoid)
        hand = None
        if wish.hand_follows:
            hand = self._place.apply(self.teacher.forward(joints)[:3, 3], chosen.turn)
        self._follow(wanted, hand, elapsed)

        own = self.student.manipulability(self._joints)
        reached = self.student.forward(self._joints)[:3, 3]
        return Picture(
            teacher_joints=joints,
            teacher_skeleton=self.teacher.skeleton(joints),
            teacher_ellipsoid=ellipsoid,
            wanted_ellipsoid=wanted,
            wanted_hand=hand,
            student_joints=self._joints,
            student_skeleton=self.student.skeleton(self._joints),
            student_links=self.student.link_poses(self._joints),
            student_ellipsoid=own,
            mounting=wish.mounting,
            distance=float(distance_unchecked(*(self._follower.objective.damped(one) for one in (wanted, own)))),
            position_error=None if hand is None else float(np.linalg.norm(reached - hand)),
            note=note,
        )

    def gaps(self, ellipsoid: Array) -> dict[str, float | None]:
        """Distance from what each method makes of an ellipsoid to the nearest of the student's samples.

        None where a method has no image for it.
        """
        found: dict[str, float | None] = {}
        for name, chosen in self.refitting.maps.items():
            try:
                found[name] = float(self.refitting.methods.gaps(chosen.transform(ellipsoid)[None])[0])
            except NotSPDError:
                found[name] = None
        return found

    def _mapped(self, chosen: LiveMap, ellipsoid: Array) -> tuple[Array, str]:
        """The image of an ellipsoid; the one before it, and why, where it has none."""
        try:
            self._wanted = chosen.transform(ellipsoid)
        except NotSPDError as error:
            if self._wanted is None:
                raise
            return self._wanted, f"no image of this ellipsoid, the last one stays: {error}"
        return self._wanted, ""

    def _follow(self, wanted: Array, hand: Array | None, seconds: float) -> None:
        """Move the robot towards what is wanted, as far as it gets."""
        if self._leap:
            hands = None if hand is None else hand[None]
            best = nearest_feasible(
                self.student, wanted[None], damping=self._bank.damping, positions=hands, bank=self._bank
            )
            self._joints, self._leap = best.joint_positions[0], False
        if seconds == 0.0:
            return
        steps = int(np.ceil(seconds / CONTROL_STEP))
        schedule = Schedule(
            np.linspace(0.0, seconds, steps + 1),
            np.broadcast_to(wanted, (steps + 1, 3, 3)),
            None if hand is None else np.broadcast_to(hand, (steps + 1, 3)),
        )
        self._joints = self._follower.follow(self._joints, schedule)[0][-1]
