"""The live view without its page: options and files become maps, fitted when needed, and a robot that follows.

One arm of person and robot, or both, which then move as one; the left one is first everywhere.
"""

import threading
import warnings
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline

from maniport.arms import VELOCITY, Arm, ArmGroup, as_group
from maniport.arms.arm_group import placing_options
from maniport.arms.chain import RIGHT
from maniport.arms.human import human_arm, middle_of
from maniport.errors import InvalidInputError, ManiportWarning, collected_warnings
from maniport.evaluation.comparison import with_feasible_set
from maniport.mocap.arm_ik import GROUP
from maniport.motion import (
    Placement,
    PlacementOptions,
    SeedBank,
    nearest_feasible,
    place_path,
)
from maniport.motion.arm_model import require_trackable
from maniport.motion.controller import Controller
from maniport.motion.problem import FOLLOWING_WEIGHT, ArmProblem, CostWeights
from maniport.motion.targets import TargetTrajectory, damping_of, speed_limits
from maniport.motion.tracker import follow
from maniport.pipeline.config import Config
from maniport.pipeline.transfer import Transfer, sample_teacher
from maniport.transfer import method_of
from maniport.transfer.rotation_group import orthonormal
from maniport.util.defaults import AUTO, BOTH, DAMPING
from maniport.util.process import in_background
from maniport.util.progress import Progress, no_progress
from maniport.util.sampling import evenly_spaced
from maniport.util.validation import Array

TEACHER_SAMPLES, STUDENT_SAMPLES, BANK_SIZE = 2048, 4096, 16_384
AT_ONCE = "parallel-transport"  # The method that is fitted before the page is there: it takes milliseconds

_alone = (
    threading.Lock()
)  # warnings are caught for a whole process, and Numba compiles in one thread at a time


@dataclass(frozen=True, eq=False)
class LiveMap:
    """The map of a method at a base orientation, for one ellipsoid at a time."""

    method: str
    transform: Callable[[Array], Array]  # Maps one ellipsoid (3, 3)
    rotation: Array  # of ellipsoids and of the hand's path, shape (3, 3)
    notes: tuple[str, ...] = ()  # Warnings of the fit


class Maps:
    """The maps of one arm by method and base orientation, each fitted when it is first requested."""

    def __init__(
        self,
        teacher: Array,  # domain (n, 3, 3) of the person's arm
        student: Array,  # domain (m, 3, 3) of the robot
        robot: Arm | None = None,
        bank: SeedBank | None = None,
    ):
        self._domains, self._robot = (teacher, student), (robot, VELOCITY, bank)
        self.fits: dict[tuple[str, bytes], Future[LiveMap]] = {}
        self._last: LiveMap | None = None

    def fit(self, name: str, base_rotation: Array) -> LiveMap:
        """Fit a method at a base orientation, shape (3, 3)."""
        unfitted = method_of(name, damping=DAMPING, random_state=0, base_rotation=base_rotation)
        adapter = with_feasible_set(unfitted, *self._robot)
        with _alone, collected_warnings() as notes:
            transform = adapter.fit(*self._domains).transform
        return LiveMap(name, transform, adapter.map_rotation_, tuple(notes))

    def get(self, name: str, base_rotation: Array) -> LiveMap:
        """Return the map of a method at a base orientation; after the first one, the last map until it is fitted."""
        key = name, base_rotation.tobytes()
        if key not in self.fits:
            self.fits[key] = in_background(self.fit, name, base_rotation)
        if self._last is None or self.fits[key].done():
            self._last = self.fits[key].result()
        return self._last


@dataclass(frozen=True, eq=False)
class Command:
    """The values of the controls."""

    joints: Array  # Of all arms of the person [rad]; beyond a limit they are taken for the limit
    method: str
    base_rotation: (
        Array  # Rotation from the person's trunk frame to the robot's base frame, shape (3, 3)
    )
    follow_hand: bool = False  # Whether the robot's end effector follows the person's hand, too


@dataclass(frozen=True, eq=False)
class Target:
    """The target of one arm of the robot."""

    joints: Array  # Of the person's arm, within its limits [rad]
    demonstrated: Array  # The person's ellipsoid, shape (3, 3)
    ellipsoid: Array
    position: Array | None = None  # Position of the end effector [m]
    notes: tuple[str, ...] = ()  # Of the map, and its method while another one is fitted


@dataclass(frozen=True, eq=False)
class Frame:
    """One arm of person and robot as the page shows them, each in its own base frame."""

    target: Target
    joints: Array  # Of the robot's arm
    achieved: Array  # Ellipsoid, shape (3, 3)
    distance: (
        float  # Affine-invariant distance of target and achieved ellipsoid, both with the damping
    )
    position_error: float | None = None  # Of the robot's end effector [m]


class Side:
    """One arm of the person and one of the robot, and the maps between them."""

    def __init__(
        self, teacher: Arm, student: Arm, maps: Maps, bank: SeedBank, base: Array | None = None
    ):
        self.teacher, self.student, self.maps, self.bank = teacher, student, maps, bank
        self.base = (
            np.zeros(3) if base is None else base
        )  # of the person's arm, in the frame of both [m]
        self.damping = damping_of(student, VELOCITY, bank.damping)

    def target(self, joints: Array, method: str, chosen: LiveMap) -> Target:
        """Map the person's arm; the end effector is free. Until a method is fitted another one's map is used."""
        joints, notes = np.clip(joints, self.teacher.lower, self.teacher.upper), chosen.notes
        if chosen.method != method:
            notes = (f"{method} is being fitted; the target is that of {chosen.method} until then",)
        demonstrated = self.teacher.manipulability(joints)
        return Target(joints, demonstrated, chosen.transform(demonstrated), notes=notes)

    def best(self, target: Target) -> Array:
        """Return the best configuration that is found for a target, shape (dof,)."""
        positions = None if target.position is None else target.position[None]
        options: dict[str, Any] = {
            "damping": self.bank.damping,
            "positions": positions,
            "bank": self.bank,
        }
        return np.asarray(
            nearest_feasible(self.student, target.ellipsoid[None], **options).joint_positions[0]
        )

    def problem(self, target: Target, time: Array) -> ArmProblem:
        """Keep a target at times (n,)."""
        count = len(time)
        positions = None
        if target.position is not None:
            positions = np.broadcast_to(target.position, (count, 3))
        constant = TargetTrajectory(
            time=time,
            ellipsoids=np.broadcast_to(target.ellipsoid, (count, 3, 3)),
            spec=VELOCITY,
            damping=self.damping,
            positions=positions,
        )
        return ArmProblem.of(self.student, constant, CostWeights(FOLLOWING_WEIGHT))

    def frame(self, target: Target, q: Array) -> Frame:
        """Compare a configuration (dof,) with a target."""
        problem = self.problem(target, np.zeros(1))
        distance = problem.distance(q[None])
        error = problem.position_error(q[None])
        position_error = None if error is None else error[0]
        return Frame(target, q, self.student.manipulability(q), float(distance[0]), position_error)


class ViewState:
    """A robot that follows a person's arms, each of which is a `Side`; `joints` is its configuration (dof,).

    `playback` is a recorded motion: joint positions of all arms of the person as a spline over time from 0 [s].
    """

    def __init__(
        self, robot: Arm | ArmGroup, sides: Sequence[Side], playback: BSpline | None = None
    ):
        self.robot, self.sides, self.playback = as_group(robot), tuple(sides), playback
        self._controller = Controller(robot, speed_limits(robot, None), np.full(robot.dof, np.inf))
        self.joints = self._joined([side.bank.joint_positions[0] for side in sides])
        self.places: Future[tuple[Placement, ...]] | None = (
            None  # of the hands' paths, of each side
        )
        self.jump = True  # whether the next step starts from the best configuration found

    def frames(
        self, command: Command, seconds: float, longest: float = 0.1, rate: float = 120.0
    ) -> list[Frame]:
        """Let the robot follow a command for some time, at most `longest` [s], in steps at a rate [Hz]."""
        elapsed, targets = min(seconds, longest), self._targets(command)
        pairs = list(zip(self.sides, targets, strict=True))
        if self.jump:
            self.joints, self.jump = (
                self._joined([side.best(target) for side, target in pairs]),
                False,
            )
        if elapsed > 0.0:
            time = np.linspace(0.0, elapsed, int(np.ceil(elapsed * rate)) + 1)
            problems = [side.problem(target, time) for side, target in pairs]
            self.joints = follow(self._controller, self.joints, problems)[0][-1]
        joints = (self.joints[columns] for columns in self.robot.columns)
        return [side.frame(target, own) for (side, target), own in zip(pairs, joints, strict=True)]

    def find_places(
        self,
        time: Array,
        motion: Sequence[Array],
        maps: Sequence[LiveMap],
        points: int = 32,
    ) -> tuple[Placement, ...]:
        """Find one placement for the hands' paths, along joints (n, dof) of each of the person's arms."""
        rows = evenly_spaced(len(motion[0]), points)
        targets = []
        for side, chosen, joints in zip(self.sides, maps, motion, strict=True):
            ellipsoids = side.teacher.manipulability(joints[rows])
            mapped = np.array([chosen.transform(ellipsoid) for ellipsoid in ellipsoids])
            target = TargetTrajectory.checked(
                side.student,
                time[rows],
                mapped,
                positions=side.teacher.forward(joints[rows])[:, :3, 3] + side.base,
                damping=self.sides[0].bank.damping,
            )
            targets.append(target)
        placements = place_path(
            self.robot, targets, PlacementOptions(yaw=0.0), map_rotation=_mean_rotation(maps)
        )
        return placements[0]

    def _targets(self, command: Command) -> list[Target]:
        """Return the target of each arm; the maps do not change the relation of the hands."""
        ends = np.cumsum([side.teacher.dof for side in self.sides])
        maps = [side.maps.get(command.method, command.base_rotation) for side in self.sides]
        parts = zip(self.sides, np.split(command.joints, ends[:-1]), maps, strict=True)
        targets = [side.target(own, command.method, chosen) for side, own, chosen in parts]
        if not command.follow_hand:
            return targets
        if self.places is None or not self.places.done():
            note = "a placement is searched for; the end effector is free until then"
            return [replace(target, notes=(*target.notes, note)) for target in targets]
        rotation = _mean_rotation(maps)
        for k, (side, target, place) in enumerate(
            zip(self.sides, targets, self.places.result(), strict=True)
        ):
            hand = side.teacher.forward(target.joints)[:3, 3] + side.base  # whose path is turned
            targets[k] = replace(target, position=replace(place, map_rotation=rotation).apply(hand))
        return targets

    def _joined(self, configurations: Sequence[Array]) -> Array:
        """Return the configuration of the robot; shared joints are those of the last arm."""
        q = np.empty(self.robot.dof)
        for own, columns in zip(configurations, self.robot.columns, strict=True):
            q[columns] = own
        return q


def _mean_rotation(maps: Sequence[LiveMap]) -> Array:
    """Return the mean rotation of the maps of all arms, as `maniport.transfer_recording` rotates their paths."""
    return orthonormal(np.sum([chosen.rotation for chosen in maps], axis=0))


def prepare(
    config: Config, recording: str | Path | None = None, progress: Progress = no_progress
) -> ViewState:
    """Load arms of person and robot, sample their domains, and fit the first method."""
    options = config.changed(
        method=AT_ONCE,
        move=False,
        n_teacher=TEACHER_SAMPLES,
        n_student=STUDENT_SAMPLES,
    )
    transfer = Transfer.of(options, progress)
    settings = transfer.settings
    robot = as_group(settings.robot)
    both = isinstance(settings.robot, ArmGroup)
    if both and len(robot.arms) != 2:
        raise InvalidInputError(
            f"the view of both arms needs two robot arms; place them with {placing_options()}"
        )
    side = settings.config.side
    if both and side != BOTH:
        raise InvalidInputError(
            f"--side: the robot has two arms, for both of the person; found {side!r}"
        )
    for student in robot.arms:
        require_trackable(student)

    playback = None
    if recording is None:
        names: Sequence[str] = (RIGHT if side == AUTO else side,)
        if both:
            names = GROUP
        persons = [human_arm(config.person, name) for name in names]
        bases = np.array([[0.0, -middle_of(arm) if both else 0.0, 0.0] for arm in persons])
        motion = [arm.sample(32, config.seed) for arm in persons]
        time = np.arange(32.0)
    else:
        human = transfer.read(recording)
        for text in human.warnings:
            warnings.warn(text, ManiportWarning, stacklevel=2)
        fits = human.motion
        persons = [fit.arm for fit in fits.arms]
        bases = fits.bases
        motion = [fit.joint_angles for fit in fits.arms]
        time = fits.time - fits.time[0]
        playback = make_interp_spline(time, np.concatenate(motion, axis=1), k=1)

    progress("Prepare page", 0.0)
    sides = []
    arms = zip(persons, robot.arms, bases, transfer.robot.domains, strict=True)
    for person, student, base, domain in arms:
        bank = SeedBank(student, BANK_SIZE, config.seed)
        maps = Maps(sample_teacher(person, settings), domain, student, bank)
        sides.append(Side(person, student, maps, bank, base))
    state = ViewState(robot, sides, playback)
    first_maps = [side.maps.get(AT_ONCE, config.rotation) for side in sides]
    state.places = in_background(state.find_places, time, motion, first_maps)
    progress("Prepare page", 1.0, f"{AT_ONCE}; the placement follows")
    return state
