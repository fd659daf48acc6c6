"""The live view without its page: fitted transfers, and a robot that follows a person's arms.

    Transfer(robot, options)          sampled once
      .read(recording)                the motion that is played, where there is a recording
      .with_method(method, rotation)  what the controls choose
        .fit_arm(person, arm)         in the background
    FittedTransfer
      .place(targets)                 in the background
    ViewState
      .frames(command, seconds)       map one ellipsoid of each arm, and follow it

One arm of person and robot, or both, which then move as one; the left one is first everywhere.
"""

import threading
import warnings
from collections.abc import Sequence
from concurrent.futures import Future
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline

from maniport.arms import VELOCITY, Arm, ArmGroup, as_group
from maniport.arms.arm_group import placing_options
from maniport.arms.chain import RIGHT
from maniport.arms.human import human_arm, middle_of
from maniport.errors import InvalidInputError, ManiportWarning, collected_warnings
from maniport.mocap.arm_ik import GROUP
from maniport.motion import Placement, PlacementOptions, SeedBank, nearest_feasible
from maniport.motion.arm_model import require_trackable
from maniport.motion.controller import Controller
from maniport.motion.problem import FOLLOWING_WEIGHT, ArmProblem, CostWeights
from maniport.motion.targets import TargetTrajectory, damping_of, speed_limits
from maniport.motion.tracker import follow
from maniport.pipeline.config import Config
from maniport.pipeline.transfer import FittedTransfer, Transfer, mean_rotation
from maniport.util.defaults import AUTO, BOTH
from maniport.util.process import in_background
from maniport.util.progress import Progress, no_progress
from maniport.util.sampling import evenly_spaced
from maniport.util.validation import Array

TEACHER_SAMPLES = 2048
STUDENT_SAMPLES = 4096
POSES = 32  # of the person, whose hand positions are placed
AT_ONCE = "parallel-transport"  # The method that is fitted before the page is there: it takes milliseconds

# warnings are caught for a whole process, and Numba compiles in one thread at a time
_alone = threading.Lock()


@dataclass(frozen=True, eq=False)
class Fit:
    """What the controls chose: the maps of a method at a base orientation."""

    method: str
    transfer: FittedTransfer
    rotation: Array  # of the hands' paths, the mean of those of the maps (3, 3)
    notes: tuple[str, ...] = ()  # warnings of the fit


class Fits:
    """Maps of all arms of a person by method and base orientation, each fitted when it is first requested."""

    def __init__(self, transfer: Transfer, persons: Sequence[Arm]):
        self._transfer = transfer
        self._persons = tuple(persons)
        self.fits: dict[tuple[str, bytes], Future[Fit]] = {}
        self._last: Fit | None = None

    def fit(self, method: str, base_rotation: Array) -> Fit:
        """Fit a method at a base orientation, shape (3, 3)."""
        transfer = self._transfer.with_method(method, base_rotation)
        with _alone, collected_warnings() as texts:
            maps = [transfer.fit_arm(person, i) for i, person in enumerate(self._persons)]
            rotation = mean_rotation(maps)
        notes = list(texts)
        for fitted in maps:
            notes += fitted.warnings
        return Fit(method, transfer.fitted(maps), rotation, tuple(dict.fromkeys(notes)))

    def get(self, method: str, base_rotation: Array) -> Fit:
        """Return the fit of a method at a base orientation; after the first one, the last fit until it is there."""
        key = method, base_rotation.tobytes()
        if key not in self.fits:
            self.fits[key] = in_background(self.fit, method, base_rotation)
        if self._last is None or self.fits[key].done():
            self._last = self.fits[key].result()
        return self._last


@dataclass(frozen=True, eq=False)
class Command:
    """The values of the controls."""

    joints: Array  # of all arms of the person [rad]; beyond a limit they are taken for the limit
    method: str
    base_rotation: Array  # from the person's trunk frame to the robot's base frame (3, 3)
    follow_hand: bool = False  # whether the robot's end effector follows the person's hand, too


@dataclass(frozen=True, eq=False)
class Target:
    """The target of one arm of the robot."""

    joints: Array  # of the person's arm, within its limits [rad]
    demonstrated: Array  # the person's ellipsoid (3, 3)
    ellipsoid: Array  # (3, 3)
    position: Array | None = None  # of the end effector (3,) [m]
    notes: tuple[str, ...] = ()  # of the fit, and its method while another one is fitted


@dataclass(frozen=True, eq=False)
class Frame:
    """One arm of person and robot as the page shows them, each in its own base frame."""

    target: Target
    joints: Array  # of the robot's arm
    achieved: Array  # ellipsoid (3, 3)
    distance: float  # of target and achieved ellipsoid, both with the damping
    position_error: float | None = None  # of the robot's end effector [m]


class Side:
    """One arm of the person and one of the robot; `base` is that of the person's arm, in the frame of both [m]."""

    def __init__(self, teacher: Arm, student: Arm, bank: SeedBank, base: Array):
        self.teacher = teacher
        self.student = student
        self.bank = bank
        self.base = base
        self.damping = damping_of(student, VELOCITY, bank.damping)

    def hand(self, joints: Array) -> Array:
        """Return positions of the person's hand (n, 3) in the frame of both arms [m]."""
        return self.teacher.forward(joints)[:, :3, 3] + self.base

    def best(self, target: Target) -> Array:
        """Return the best configuration that is found for a target, shape (dof,)."""
        positions = None
        if target.position is not None:
            positions = target.position[None]
        nearest = nearest_feasible(
            self.student,
            target.ellipsoid[None],
            damping=self.bank.damping,
            positions=positions,
            bank=self.bank,
        )
        return np.asarray(nearest.joint_positions[0])

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
        self,
        robot: Arm | ArmGroup,
        sides: Sequence[Side],
        fits: Fits,
        playback: BSpline | None = None,
    ):
        self.robot = as_group(robot)
        self.sides = tuple(sides)
        self.fits = fits
        self.playback = playback
        self._controller = Controller(robot, speed_limits(robot, None), np.full(robot.dof, np.inf))
        self.joints = self._joined([side.bank.joint_positions[0] for side in sides])
        self.places: Future[tuple[Placement, ...]] | None = None  # of the hands' paths
        self.jump = True  # whether the next step starts from the best configuration found

    def frames(
        self, command: Command, seconds: float, longest: float = 0.1, rate: float = 120.0
    ) -> list[Frame]:
        """Let the robot follow a command for some time, at most `longest` [s], in steps at a rate [Hz]."""
        elapsed = min(seconds, longest)
        targets = self._targets(command)
        pairs = list(zip(self.sides, targets, strict=True))
        if self.jump:
            self.joints = self._joined([side.best(target) for side, target in pairs])
            self.jump = False
        if elapsed > 0.0:
            time = np.linspace(0.0, elapsed, int(np.ceil(elapsed * rate)) + 1)
            problems = [side.problem(target, time) for side, target in pairs]
            self.joints = follow(self._controller, self.joints, problems)[0][-1]

        frames = []
        for (side, target), columns in zip(pairs, self.robot.columns, strict=True):
            frames.append(side.frame(target, self.joints[columns]))
        return frames

    def find_places(self, time: Array, motion: Sequence[Array], fit: Fit) -> tuple[Placement, ...]:
        """Find one placement for the hands' paths, along joints (n, dof) of each of the person's arms."""
        rows = evenly_spaced(len(time), POSES)
        targets = []
        for side, adapter, joints in zip(self.sides, fit.transfer.adapters, motion, strict=True):
            target = TargetTrajectory.checked(
                side.student,
                time[rows],
                adapter.transform(side.teacher.manipulability(joints[rows])),
                positions=side.hand(joints[rows]),
                damping=self.sides[0].bank.damping,
            )
            targets.append(target)
        # the ellipsoids are not turned with the path
        return fit.transfer.place(targets, PlacementOptions(yaw=0.0))[0]

    def _targets(self, command: Command) -> list[Target]:
        """Return the target of each arm; the maps do not change the relation of the hands."""
        fit = self.fits.get(command.method, command.base_rotation)
        notes = fit.notes
        if fit.method != command.method:
            notes = (
                f"{command.method} is being fitted; the target is that of {fit.method} until then",
            )
        places = None
        if command.follow_hand:
            if self.places is not None and self.places.done():
                places = self.places.result()
            else:
                text = "a placement is searched for; the end effector is free until then"
                notes = (*notes, text)

        ends = np.cumsum([side.teacher.dof for side in self.sides])
        joints_of_sides = np.split(command.joints, ends[:-1])
        targets = []
        for i, side in enumerate(self.sides):
            joints = np.clip(joints_of_sides[i], side.teacher.lower, side.teacher.upper)
            demonstrated = side.teacher.manipulability(joints)
            position = None
            if places is not None:  # the path is turned as the ellipsoids are now
                turned = replace(places[i], map_rotation=fit.rotation)
                position = turned.apply(side.hand(joints[None])[0])
            ellipsoid = fit.transfer.adapters[i].transform(demonstrated)
            targets.append(Target(joints, demonstrated, ellipsoid, position, notes))
        return targets

    def _joined(self, configurations: Sequence[Array]) -> Array:
        """Return the configuration of the robot; shared joints are those of the last arm."""
        joined = np.empty(self.robot.dof)
        for q, columns in zip(configurations, self.robot.columns, strict=True):
            joined[columns] = q
        return joined


@dataclass(frozen=True, eq=False)
class Person:
    """The person's arms, and joint angles of each."""

    arms: tuple[Arm, ...]
    bases: Array  # of each arm, in the frame of all (n_arms, 3) [m]
    time: Array  # (n,) [s]
    motion: tuple[Array, ...]  # (n, dof) of each arm [rad]
    playback: BSpline | None = None  # joint angles of all arms over time from 0 [s]


def prepare(
    config: Config, recording: str | Path | None = None, progress: Progress = no_progress
) -> ViewState:
    """Load arms of person and robot, sample their domains, and fit the first method."""
    options = config.changed(
        method=AT_ONCE,
        n_teacher=TEACHER_SAMPLES,
        n_student=STUDENT_SAMPLES,
    )
    transfer = Transfer.of(options, progress)
    _require_sides(transfer)
    if recording is None:
        person = _still_person(transfer)
    else:
        person = _recorded_person(transfer, recording)

    progress("Prepare page", 0.0)
    sides = []
    arms = zip(person.arms, as_group(transfer.settings.robot).arms, person.bases, strict=True)
    for i, (teacher, student, base) in enumerate(arms):
        bank = transfer.robot.bank(i, VELOCITY)
        assert bank is not None  # of robots that can be moved
        sides.append(Side(teacher, student, bank, base))
    fits = Fits(transfer, person.arms)
    state = ViewState(transfer.settings.robot, sides, fits, person.playback)
    first = fits.get(AT_ONCE, config.rotation)
    state.places = in_background(state.find_places, person.time, person.motion, first)
    progress("Prepare page", 1.0, f"{AT_ONCE}; the placement follows")
    return state


def _require_sides(transfer: Transfer) -> None:
    """Raise unless the robot has an arm for each of the person."""
    robot = transfer.settings.robot
    side = transfer.settings.config.side
    if isinstance(robot, ArmGroup):
        if len(robot.arms) != 2:
            raise InvalidInputError(
                f"the view of both arms needs two robot arms; place them with {placing_options()}"
            )
        if side != BOTH:
            raise InvalidInputError(
                f"--side: the robot has two arms, for both of the person; found {side!r}"
            )
    for student in as_group(robot).arms:
        require_trackable(student)


def _still_person(transfer: Transfer) -> Person:
    """Return a person whom sliders move, with samples of the joint angles."""
    config = transfer.settings.config
    names: Sequence[str] = (config.side,)
    if isinstance(transfer.settings.robot, ArmGroup):
        names = GROUP
    elif config.side == AUTO:
        names = (RIGHT,)
    arms = tuple(human_arm(config.person, name) for name in names)
    bases = np.zeros((len(arms), 3))
    if len(arms) > 1:
        bases[:, 1] = [-middle_of(arm) for arm in arms]
    motion = tuple(arm.sample(POSES, config.seed) for arm in arms)
    return Person(arms, bases, np.arange(float(POSES)), motion)


def _recorded_person(transfer: Transfer, recording: str | Path) -> Person:
    """Return the person of a recording, whose motion is played."""
    human = transfer.read(recording)
    for text in human.warnings:
        warnings.warn(text, ManiportWarning, stacklevel=3)
    fits = human.motion
    time = fits.time - fits.time[0]
    motion = tuple(fit.joint_angles for fit in fits.arms)
    playback = make_interp_spline(time, np.concatenate(motion, axis=1), k=1)
    return Person(tuple(fit.arm for fit in fits.arms), fits.bases, time, motion, playback)
