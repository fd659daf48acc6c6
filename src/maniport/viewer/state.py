"""The state of the live view, without a page: commands in, frames out, and a robot that follows.

One arm of person and robot, or both, which then move as one; the left one is first everywhere.
"""

import contextlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from maniport.arms import Arm, ArmGroup, as_group
from maniport.errors import NotSPDError
from maniport.motion import Objective, Placement, SeedBank, nearest_feasible, place_path
from maniport.motion.controller import Controller
from maniport.motion.limits import BrakingLimit
from maniport.motion.objective import FOLLOWING_WEIGHT
from maniport.motion.schedule import Schedule, speed_limits
from maniport.motion.tracker import follow
from maniport.spd.affine_invariant import distance_unchecked
from maniport.transfer.rotation_group import orthonormal
from maniport.util.sampling import evenly_spaced
from maniport.util.validation import Array
from maniport.viewer.maps import Maps


class Playback:
    """Joint positions (n, dof) at ascending times (n,) [s], played in a loop with straight lines in between."""

    def __init__(self, time: Array, joints: Array):
        self._time, self._path = time - time[0], joints
        self.duration = float(self._time[-1])
        self.position = 0.0

    def advance(self, seconds: float) -> None:
        """Move on, from the end to the start again."""
        self.position = float((self.position + seconds) % self.duration)

    def seek(self, position: float) -> None:
        """Go to a time [s]; beyond the ends, to the end."""
        self.position = min(max(position, 0.0), self.duration)

    def joints(self) -> Array:
        """Joint positions at this time, shape (dof,)."""
        return np.array([np.interp(self.position, self._time, column) for column in self._path.T])


@dataclass(frozen=True, eq=False)
class Command:
    """The values of the controls."""

    joints: Array  # Of all arms of the person [rad]; beyond a limit they are taken for the limit
    method: str  # One of the names of `maniport.viewer.maps.Maps`
    base_rotation: Array  # Rotation from the person's trunk frame to the robot's base frame, shape (3, 3)
    follow_hand: bool = False  # Whether the robot's end effector follows the person's hand, too


@dataclass(frozen=True, eq=False)
class Target:
    """The target of one arm of the robot."""

    joints: Array  # Of the person's arm, within its limits [rad]
    demonstrated: Array  # The person's ellipsoid, shape (3, 3)
    ellipsoid: Array
    turn: Array  # Rotation of the hand's motion by the map, shape (3, 3)
    position: Array | None = None  # Position of the end effector [m]
    note: str = ""  # Why the target is not new, or another method's


@dataclass(frozen=True, eq=False)
class Frame:
    """One arm of person and robot as the page shows them, each in its own base frame."""

    teacher: Arm
    student: Arm
    target: Target
    student_joints: Array
    achieved: Array  # Ellipsoid, shape (3, 3)
    distance: float  # Affine-invariant distance of target and achieved ellipsoid, both with the damping
    base_rotation: Array
    position_error: float | None = None  # Of the robot's end effector [m]
    at_limit: tuple[str, ...] = ()  # Names of the robot's joints that are at a limit

    @cached_property
    def teacher_skeleton(self) -> Array:
        """Polyline from base to hand, shape (k, 3) [m]."""
        return self.teacher.skeleton(self.target.joints)

    @cached_property
    def student_skeleton(self) -> Array:
        """Polyline from base to end effector, shape (k, 3) [m]."""
        return self.student.skeleton(self.student_joints)

    @cached_property
    def student_links(self) -> Array:
        """Poses of the robot's base and of what follows each joint, shape (joints + 1, 4, 4)."""
        return self.student.link_poses(self.student_joints)


class Side:
    """One arm of the person and one of the robot, and the maps between them."""

    def __init__(self, teacher: Arm, student: Arm, maps: Maps, bank: SeedBank, base: Array | None = None):
        self.teacher, self.student, self.maps, self.bank = teacher, student, maps, bank
        self.base = np.zeros(3) if base is None else base  # of the person's arm, in the frame of both [m]
        self.place: Placement | None = None
        self.objective = Objective.of(student, damping=bank.damping, position_weight=FOLLOWING_WEIGHT)
        self._last: Array | None = None

    def target(self, joints: Array, method: str, base_rotation: Array) -> Target:
        """Map the person's arm; the end effector is free. Until a method is fitted another one's map is used."""
        joints = np.clip(joints, self.teacher.lower, self.teacher.upper)
        self.maps.want(base_rotation, method)
        fitted, note = self.maps.fitted, ""
        chosen = fitted.get(method)
        if chosen is None:
            other, chosen = next(iter(fitted.items()))
            note = f"{method} is being fitted; the target is that of {other} until then"
        demonstrated = self.teacher.manipulability(joints)
        try:
            self._last = chosen.transform(demonstrated)
        except NotSPDError as error:
            if self._last is None:
                raise
            note = f"no image of this ellipsoid, the last one stays: {error}"
        return Target(joints, demonstrated, self._last, chosen.turn, note=note)

    def best(self, target: Target) -> Array:
        """Return the best configuration that is found for a target, shape (dof,)."""
        tips = None if target.position is None else target.position[None]
        nearest = nearest_feasible(
            self.student, target.ellipsoid[None], damping=self.bank.damping, positions=tips, bank=self.bank
        )
        return np.asarray(nearest.joint_positions[0])

    def frame(self, target: Target, q: Array, base_rotation: Array, near_limit: float = 5e-3) -> Frame:
        """Show a target and a configuration (dof,); joints within a share of their range of a limit are at it."""
        arm = self.student
        achieved, tip = arm.manipulability(q), arm.forward(q)[:3, 3]
        margin = near_limit * (arm.upper - arm.lower)
        at_limit = (q <= arm.lower + margin) | (q >= arm.upper - margin)
        damped = (self.objective.damped(ellipsoid) for ellipsoid in (target.ellipsoid, achieved))
        return Frame(
            self.teacher, arm, target, q, achieved, float(distance_unchecked(*damped)), base_rotation,
            position_error=None if target.position is None else float(np.linalg.norm(tip - target.position)),
            at_limit=tuple(name for name, near in zip(arm.joint_names, at_limit, strict=True) if near),
        )  # fmt: skip

    def gaps(self, ellipsoid: Array) -> dict[str, float]:
        """Return the feasibility gap of each method's image of an ellipsoid, as a search of 4 ms a method finds it."""
        images: dict[str, Array] = {}
        for name, chosen in self.maps.fitted.items():
            with contextlib.suppress(NotSPDError):
                images[name] = chosen.transform(ellipsoid)
        if not images:
            return {}
        search = nearest_feasible(
            self.student, np.array(list(images.values())), damping=self.bank.damping, bank=self.bank, n_starts=4
        )
        return dict(zip(images, search.distance.tolist(), strict=True))


class ViewState:
    """A robot that follows a person's arms, each of which is a `Side`; `joints` is its configuration (dof,)."""

    def __init__(self, robot: Arm | ArmGroup, sides: Sequence[Side], playback: Playback | None = None):
        self.robot, self.sides, self.playback = robot, tuple(sides), playback
        self.methods = self.sides[0].maps.names
        self._columns = as_group(robot).columns
        limits = robot.lower, robot.upper, speed_limits(robot, None), np.full(robot.dof, np.inf)
        self._controller = Controller(robot, BrakingLimit(*limits))
        self.joints = self._joined([side.bank.joint_positions[0] for side in sides])
        self._jump = True

    def jump(self) -> None:
        """Let the robot start from the best configuration found, with the next step, instead of moving on."""
        self._jump = True

    def frames(
        self, command: Command, seconds: float, longest: float = 0.1, control_step: float = 1.0 / 120.0
    ) -> tuple[Frame, ...]:
        """Let the robot follow a command for some time [s], though no longer than `longest`; return its frames."""
        elapsed, targets = min(seconds, longest), self._targets(command)
        pairs = list(zip(self.sides, targets, strict=True))
        if self._jump:
            self.joints = self._joined([side.best(target) for side, target in pairs])
            self._jump = False
        if elapsed > 0.0:
            time, schedules = np.linspace(0.0, elapsed, int(np.ceil(elapsed / control_step)) + 1), []
            for side, target in pairs:
                shapes = np.broadcast_to(target.ellipsoid, (len(time), 3, 3))
                tips = None if target.position is None else np.broadcast_to(target.position, (len(time), 3))
                schedules.append(Schedule(side.objective, time, shapes, tips))
            self.joints = follow(self._controller, self.joints, schedules)[0][-1]
        return tuple(side.frame(target, self.joints[columns], command.base_rotation)
                     for (side, target), columns in zip(pairs, self._columns, strict=True))  # fmt: skip

    def find_place(self, motion: Sequence[Array], method: str, points: int = 32) -> None:
        """Find one placement for the hands' paths, along joints (n, dof) of each of the person's arms."""
        rows = evenly_spaced(len(motion[0]), points)
        maps, hands, targets = [side.maps.fitted[method] for side in self.sides], [], []
        for side, chosen, joints in zip(self.sides, maps, motion, strict=True):
            ellipsoids = side.teacher.manipulability(joints[rows])
            targets.append(np.array([chosen.transform(ellipsoid) for ellipsoid in ellipsoids]))
            hands.append(side.teacher.forward(joints[rows])[:, :3, 3] + side.base)
        turn, banks = _mean_turn([chosen.turn for chosen in maps]), [side.bank for side in self.sides]
        arms, damping = as_group(self.robot).arms, banks[0].damping
        places = place_path(hands, targets, arms, turn=turn, yaw=0.0, damping=damping, bank=banks)
        for side, place in zip(self.sides, places, strict=True):
            side.place = place

    def _targets(self, command: Command) -> list[Target]:
        """Return the target of each arm; the maps do not change the relation of the hands."""
        ends = np.cumsum([side.teacher.dof for side in self.sides])
        parts = zip(self.sides, np.split(command.joints, ends[:-1]), strict=True)
        targets = [side.target(own, command.method, command.base_rotation) for side, own in parts]
        if not command.follow_hand:
            return targets
        turn = _mean_turn([target.turn for target in targets])
        for k, (side, target) in enumerate(zip(self.sides, targets, strict=True)):
            if side.place is None:
                note = "a placement is searched for; the end effector is free until then"
                targets[k] = replace(target, note=target.note or note)
            else:  # the position of the hand, whose path is turned
                hand = side.teacher.forward(target.joints)[:3, 3] + side.base
                targets[k] = replace(target, position=replace(side.place, turn=turn).apply(hand))
        return targets

    def _joined(self, configurations: Sequence[Array]) -> Array:
        """Return configuration of the robot; shared joints are at the mean of the arms'."""
        total, count = np.zeros(self.robot.dof), np.zeros(self.robot.dof)
        for own, columns in zip(configurations, self._columns, strict=True):
            total[columns] += own
            count[columns] += 1
        return np.asarray(total / count)


def _mean_turn(turns: Sequence[Array]) -> Array:
    """Return the mean rotation of all arms, as `maniport.transfer_recording` rotates their paths."""
    return turns[0] if len(turns) == 1 else orthonormal(np.sum(turns, axis=0))
