"""What the live view shows, without any page: wishes in, pictures out, a recording that plays, a robot that follows."""

import contextlib
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from maniport.bodies import Arm
from maniport.errors import NotSPDError
from maniport.spd.affine_invariant import distance_unchecked
from maniport.subsample import evenly_spaced
from maniport.tracking import Objective, PlacedPath, StartBank, nearest_feasible, place_path
from maniport.tracking.follow.follower import Follower
from maniport.tracking.objective import FOLLOWING_WEIGHT
from maniport.validation import Array, as_choice, as_finite, as_number, as_times, require_shape
from maniport.view.maps import LiveMap, Refitting
from maniport.view.picture import Asked, Picture, Wish, as_elapsed

POINTS = 32
"""Hand positions that decide the placement; people wait for the page."""
GAP_STARTS, GAP_STEPS = 4, 20
"""How short the search for feasibility gaps is: 4 ms a method, while the robot goes on."""
NEAR_LIMIT = 5e-3
"""A joint nearer to a limit than this share of its range is at it."""


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
    base : ndarray, shape (3,), optional
        Where the base frame of the person's arm lies in the frame of both arms [m]. Default: there is one arm.

    Attributes
    ----------
    joints : ndarray, shape (dof,)
        Where the robot is.
    objective : Objective
        Of what it follows.
    """

    def __init__(
        self,
        teacher: Arm,
        student: Arm,
        refitting: Refitting,
        place: PlacedPath | None,
        bank: StartBank,
        playback: Playback | None = None,
        base: Array | None = None,
    ):
        self.teacher, self.student, self.refitting, self.playback = teacher, student, refitting, playback
        self.place, self.bank, self.base = place, bank, np.zeros(3) if base is None else base
        self.objective = Objective.of(student, damping=bank.damping, position_weight=FOLLOWING_WEIGHT)
        self.joints = bank.joint_positions[0]
        self._target: Array | None = None
        self._leap = True

    @cached_property
    def _follower(self) -> Follower:
        return Follower(self.objective)

    @property
    def methods(self) -> tuple[str, ...]:
        """Names of what there is to choose from."""
        return self.refitting.methods.names

    def leap(self) -> None:
        """Let the robot start from the best posture there is, with the next step, instead of moving on."""
        self._leap = True

    @property
    def each(self) -> "tuple[LiveState, ...]":
        """The state itself; of a pair there are two."""
        return (self,)

    @property
    def robot(self) -> Arm:
        """The student; of a pair both."""
        return self.student

    def pictures(self, wish: Wish, seconds: float) -> tuple[Picture, ...]:
        """What `advance` gives, as of a pair."""
        return (self.advance(wish, seconds),)

    def advance(self, wish: Wish, seconds: float) -> Picture:
        """Take the wishes, and let the robot follow for some time [s]."""
        asked = self.ask(wish)
        if wish.tip_follows:
            asked = self.reaching(asked, asked.turn)
        if self._leap:
            self.joints, self._leap = self.best(asked), False
        if (elapsed := as_elapsed(seconds)) > 0.0:
            self.joints = self._follower.follow(self.joints, asked.schedule(elapsed))[0][-1]
        return self.picture(asked, wish.mounting)

    def find_place(self, motion: Sequence[Array], method: str) -> None:
        """Place the hand along joints of the person's arm, [(n, dof)], where the robot makes the ellipsoids best."""
        chosen, bank = self.refitting.maps[method], self.bank
        some = motion[0][evenly_spaced(len(motion[0]), POINTS)]
        targets = np.array([chosen.transform(ellipsoid) for ellipsoid in self.teacher.manipulability(some)])
        hands = self.teacher.forward(some)[:, :3, 3]
        self.place = place_path(
            hands, targets, self.student, turn=chosen.turn, yaw=0.0, damping=bank.damping, bank=bank
        )

    def ask(self, wish: Wish) -> Asked:
        """What the wishes ask of the robot, whose tip is free."""
        joints = as_finite(wish.joints, "joints")
        require_shape(joints, "joints", (self.teacher.dof,))
        joints = np.clip(joints, self.teacher.lower, self.teacher.upper)
        as_choice(wish.method, "method", self.methods)
        self.refitting.want(wish.mounting, wish.method)
        chosen, note = self._chosen(wish.method)
        ellipsoid = self.teacher.manipulability(joints)
        target, stays = self._mapped(chosen, ellipsoid)
        return Asked(joints, ellipsoid, target, chosen.turn, None, stays or note)

    def reaching(self, asked: Asked, turn: Array) -> Asked:
        """The same with the tip where the hand is, whose path is turned so."""
        if self.place is None:
            wait = "a place for the path is searched for; until it is found the tip is free"
            return replace(asked, note=asked.note or wait)
        hand = self.teacher.forward(asked.joints)[:3, 3] + self.base
        return replace(asked, tip=replace(self.place, turn=turn).apply(hand))

    def best(self, asked: Asked) -> Array:
        """The best posture that is found for what is asked, shape (dof,)."""
        tips = None if asked.tip is None else asked.tip[None]
        found = nearest_feasible(
            self.student, asked.target[None], damping=self.bank.damping, positions=tips, bank=self.bank
        )
        return np.asarray(found.joint_positions[0])

    def picture(self, asked: Asked, mounting: Array) -> Picture:
        """What there is to see, with the robot where it is."""
        own = self.student.manipulability(self.joints)
        reached = self.student.forward(self.joints)[:3, 3]
        return Picture(
            teacher_joints=asked.joints,
            teacher_skeleton=self.teacher.skeleton(asked.joints),
            demonstrated_ellipsoid=asked.ellipsoid,
            target_ellipsoid=asked.target,
            target_tip=asked.tip,
            student_joints=self.joints,
            student_skeleton=self.student.skeleton(self.joints),
            student_links=self.student.link_poses(self.joints),
            achieved_ellipsoid=own,
            mounting=mounting,
            distance=float(distance_unchecked(*(self.objective.damped(one) for one in (asked.target, own)))),
            position_error=None if asked.tip is None else float(np.linalg.norm(reached - asked.tip)),
            note=asked.note,
            at_limit=self._at_limit(),
        )

    def gaps(self, ellipsoid: Array) -> dict[str, float | None]:
        """Feasibility gap of what each method makes of an ellipsoid, an upper bound by a short search."""
        images: dict[str, Array] = {}
        for name, chosen in self.refitting.maps.items():
            with contextlib.suppress(NotSPDError):
                images[name] = chosen.transform(ellipsoid)
        search = nearest_feasible(
            self.student, np.array(list(images.values())), damping=self.bank.damping, bank=self.bank,
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
        near = (self.joints <= arm.lower + trace) | (self.joints >= arm.upper - trace)
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
