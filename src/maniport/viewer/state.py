"""The state of the live view, without a page: commands in, frames out, and a robot that follows.

One arm of person and robot, or both, which then move as one; the left one is first everywhere.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import Future
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from maniport.arms import VELOCITY, Arm, ArmGroup, as_group
from maniport.errors import NotSPDError, collected_warnings
from maniport.evaluation.comparison import with_feasible_set
from maniport.motion import Placement, SeedBank, nearest_feasible, place_path
from maniport.motion.controller import Controller
from maniport.motion.objective import FOLLOWING_WEIGHT, Objective
from maniport.motion.schedule import Schedule, speed_limits
from maniport.motion.tracker import follow
from maniport.spd.affine_invariant import distance_unchecked
from maniport.transfer import METHODS, DomainAdapter, method_of
from maniport.transfer.rotation_group import orthonormal
from maniport.util.process import in_background
from maniport.util.sampling import evenly_spaced
from maniport.util.validation import Array

LOADED = "adapter file"  # Name of an adapter that was given fitted


@dataclass(frozen=True, eq=False)
class LiveMap:
    """The map of a method at a base orientation, for one ellipsoid at a time."""

    method: str
    transform: Callable[[Array], Array]  # Maps one ellipsoid (3, 3); raises NotSPDError where it has no image
    map_rotation: Array  # rotation of ellipsoids and of the hand's path, shape (3, 3)
    notes: tuple[str, ...] = ()  # Warnings of the fit


class Maps:
    """The maps of one arm by method and base orientation, each fitted when it is first requested."""

    def __init__(
        self,
        teacher: Array,  # domain (n, 3, 3) of the person's arm
        student: Array,  # domain (m, 3, 3) of the robot
        damping: float | None = 0.01,
        loaded: DomainAdapter | None = None,
        robot: Arm | None = None,
        bank: SeedBank | None = None,
    ):
        self._domains, self._robot, self._loaded = (teacher, student), (robot, VELOCITY, bank), loaded
        self._options = {"damping": damping, "random_state": 0}
        self.names = (*([] if loaded is None else [LOADED]), *METHODS)
        self._fitted: dict[tuple[str, bytes], LiveMap] = {}
        self._last: LiveMap | None = None
        self._fit: tuple[tuple[str, bytes], Future[LiveMap]] | None = None

    def fit(self, name: str, base_rotation: Array) -> LiveMap:
        """Fit a method at a base orientation, shape (3, 3)."""
        if name == LOADED and self._loaded is not None:
            note = "it keeps the base orientation of its fit"
            return LiveMap(name, self._loaded.compiled(), self._loaded.map_rotation_, (note,))
        adapter = with_feasible_set(method_of(name, **self._options, base_rotation=base_rotation), *self._robot)
        with collected_warnings() as notes:
            adapter.fit(*self._domains)
        return LiveMap(name, adapter.compiled(), adapter.map_rotation_, tuple(notes))

    def get(self, name: str, base_rotation: Array) -> LiveMap:
        """Return the map of a method at a base orientation; the last map until a thread has fitted it.

        The first map is fitted at once.
        """
        key = name, base_rotation.tobytes()
        if self._last is None:
            self._fitted[key] = self._last = self.fit(name, base_rotation)
        if self._fit is not None and self._fit[1].done():
            self._fitted[self._fit[0]], self._fit = self._fit[1].result(), None
        if key not in self._fitted:
            self._fit = self._fit or (key, in_background(self.fit, name, base_rotation))
            return self._last
        self._last = self._fitted[key]
        return self._last


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
    method: str  # One of the names of `Maps`
    base_rotation: Array  # Rotation from the person's trunk frame to the robot's base frame, shape (3, 3)
    follow_hand: bool = False  # Whether the robot's end effector follows the person's hand, too


@dataclass(frozen=True, eq=False)
class Target:
    """The target of one arm of the robot."""

    joints: Array  # Of the person's arm, within its limits [rad]
    demonstrated: Array  # The person's ellipsoid, shape (3, 3)
    ellipsoid: Array
    map_rotation: Array  # Rotation of the hand's motion by the map, shape (3, 3)
    position: Array | None = None  # Position of the end effector [m]
    notes: tuple[str, ...] = ()  # Of the map, and why the target is not new, or another method's


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


class Side:
    """One arm of the person and one of the robot, and the maps between them."""

    def __init__(self, teacher: Arm, student: Arm, maps: Maps, bank: SeedBank, base: Array | None = None):
        self.teacher, self.student, self.maps, self.bank = teacher, student, maps, bank
        self.base = np.zeros(3) if base is None else base  # of the person's arm, in the frame of both [m]
        self.objective = Objective.of(student, damping=bank.damping, position_weight=FOLLOWING_WEIGHT)
        self._last: Array | None = None

    def target(self, joints: Array, method: str, base_rotation: Array) -> Target:
        """Map the person's arm; the end effector is free. Until a method is fitted another one's map is used."""
        joints = np.clip(joints, self.teacher.lower, self.teacher.upper)
        chosen = self.maps.get(method, base_rotation)
        notes = chosen.notes
        if chosen.method != method:
            notes = (f"{method} is being fitted; the target is that of {chosen.method} until then",)
        demonstrated = self.teacher.manipulability(joints)
        try:
            self._last = chosen.transform(demonstrated)
        except NotSPDError as error:
            if self._last is None:
                raise
            notes = (*notes, f"no image of this ellipsoid, the last one stays: {error}")
        return Target(joints, demonstrated, self._last, chosen.map_rotation, notes=notes)

    def best(self, target: Target) -> Array:
        """Return the best configuration that is found for a target, shape (dof,)."""
        end_positions = None if target.position is None else target.position[None]
        nearest = nearest_feasible(
            self.student, target.ellipsoid[None], damping=self.bank.damping, positions=end_positions, bank=self.bank
        )
        return np.asarray(nearest.joint_positions[0])

    def frame(self, target: Target, q: Array, base_rotation: Array, near_limit: float = 5e-3) -> Frame:
        """Show a target and a configuration (dof,); joints within a share of their range of a limit are at it."""
        arm = self.student
        achieved, end_position = arm.manipulability(q), arm.forward(q)[:3, 3]
        margin = near_limit * (arm.upper - arm.lower)
        at_limit = (q <= arm.lower + margin) | (q >= arm.upper - margin)
        damped = (self.objective.damped(ellipsoid) for ellipsoid in (target.ellipsoid, achieved))
        return Frame(
            self.teacher, arm, target, q, achieved, float(distance_unchecked(*damped)), base_rotation,
            position_error=None if target.position is None else float(np.linalg.norm(end_position - target.position)),
            at_limit=tuple(name for name, near in zip(arm.joint_names, at_limit, strict=True) if near),
        )  # fmt: skip


class ViewState:
    """A robot that follows a person's arms, each of which is a `Side`; `joints` is its configuration (dof,)."""

    def __init__(self, robot: Arm | ArmGroup, sides: Sequence[Side], playback: Playback | None = None):
        self.robot, self.sides, self.playback = robot, tuple(sides), playback
        self.methods = self.sides[0].maps.names
        self._columns = as_group(robot).columns
        self._controller = Controller(robot, speed_limits(robot, None), np.full(robot.dof, np.inf))
        self.joints = self._joined([side.bank.joint_positions[0] for side in sides])
        self.places: Future[list[Placement]] | None = None  # of the hands' paths, of each side
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
                end_positions = None if target.position is None else np.broadcast_to(target.position, (len(time), 3))
                schedules.append(Schedule(side.objective, time, shapes, end_positions))
            self.joints = follow(self._controller, self.joints, schedules)[0][-1]
        return tuple(side.frame(target, self.joints[columns], command.base_rotation)
                     for (side, target), columns in zip(pairs, self._columns, strict=True))  # fmt: skip

    def find_places(self, motion: Sequence[Array], maps: Sequence[LiveMap], points: int = 32) -> list[Placement]:
        """Find one placement for the hands' paths, along joints (n, dof) of each of the person's arms."""
        rows = evenly_spaced(len(motion[0]), points)
        hands, targets = [], []
        for side, chosen, joints in zip(self.sides, maps, motion, strict=True):
            ellipsoids = side.teacher.manipulability(joints[rows])
            targets.append(np.array([chosen.transform(ellipsoid) for ellipsoid in ellipsoids]))
            hands.append(side.teacher.forward(joints[rows])[:, :3, 3] + side.base)
        rotation, banks = _mean_rotation([chosen.map_rotation for chosen in maps]), [side.bank for side in self.sides]
        arms, damping = as_group(self.robot).arms, banks[0].damping
        return list(place_path(hands, targets, arms, map_rotation=rotation, yaw=0.0, damping=damping, bank=banks))

    def _targets(self, command: Command) -> list[Target]:
        """Return the target of each arm; the maps do not change the relation of the hands."""
        ends = np.cumsum([side.teacher.dof for side in self.sides])
        parts = zip(self.sides, np.split(command.joints, ends[:-1]), strict=True)
        targets = [side.target(own, command.method, command.base_rotation) for side, own in parts]
        if not command.follow_hand:
            return targets
        if self.places is None or not self.places.done():
            note = "a placement is searched for; the end effector is free until then"
            return [replace(target, notes=(*target.notes, note)) for target in targets]
        rotation = _mean_rotation([target.map_rotation for target in targets])
        for k, (side, target, place) in enumerate(zip(self.sides, targets, self.places.result(), strict=True)):
            hand = side.teacher.forward(target.joints)[:3, 3] + side.base  # whose path is turned
            targets[k] = replace(target, position=replace(place, map_rotation=rotation).apply(hand))
        return targets

    def _joined(self, configurations: Sequence[Array]) -> Array:
        """Return configuration of the robot; shared joints are at the mean of the arms'."""
        total, count = np.zeros(self.robot.dof), np.zeros(self.robot.dof)
        for own, columns in zip(configurations, self._columns, strict=True):
            total[columns] += own
            count[columns] += 1
        return np.asarray(total / count)


def _mean_rotation(turns: Sequence[Array]) -> Array:
    """Return the mean rotation of all arms, as `maniport.transfer_recording` rotates their paths."""
    return turns[0] if len(turns) == 1 else orthonormal(np.sum(turns, axis=0))
