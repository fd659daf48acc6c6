"""A robot as teacher: the motion of one robot, from a dataset, is transferred to another."""

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from maniport.arms import Arm, ArmGroup, as_group, load_arm, load_arms
from maniport.datasets import JointMotion, ReadOptions, open_dataset
from maniport.datasets.columns import (
    given_names,
    is_gripper,
    matched_columns,
    unit_factors,
)
from maniport.datasets.grippers import Grippers
from maniport.datasets.lerobot import LeRobotDataset
from maniport.datasets.lerobot.layout import ACTION, INFO
from maniport.domain import sample_domain
from maniport.errors import InvalidInputError, argument
from maniport.evaluation.comparison import with_feasible_set
from maniport.motion import TargetTrajectory
from maniport.pipeline.config import Config
from maniport.pipeline.following import follow_profile, require_no_directions
from maniport.pipeline.options import HumanOptions, TransferOptions
from maniport.pipeline.results import MotionResult
from maniport.pipeline.robots import load_robot
from maniport.pipeline.settings import adapter_of
from maniport.pipeline.transfer import FittedMap, mean_rotation
from maniport.util.defaults import AUTO, BOTH
from maniport.util.progress import Progress, Step
from maniport.util.sampling import evenly_spaced
from maniport.util.validation import Array, as_times, require_shape

PROFILE_RATE = 50.0  # of the ellipsoids of a teacher [Hz]: data sets have 30 to 50 frames a second
METHOD = "length-field"  # where the method is to be chosen
OF_PERSONS = ("unit", "height", "markers", "person", "smooth")  # options without a meaning here
FEWEST_FRAMES = 3  # without which there is no motion


@dataclass(frozen=True, eq=False)
class Demonstration:
    """The motion of a robot with one or two arms as a demonstration; make it with `Demonstration.of_arm`.

    Attributes
    ----------
    arm : Arm or ArmGroup
    time : ndarray, shape (n,)
        [s].
    joint_positions : ndarray, shape (n, dof)
        [rad] or [m].
    name : str
        For reports, such as that of the dataset and the episode.
    grippers : Grippers or None
        Columns of grippers, which pass through by their time.
    ignored : tuple of str
        Columns of the dataset that are not used.
    """

    arm: Arm | ArmGroup
    time: Array
    joint_positions: Array
    name: str = ""
    grippers: Grippers | None = None
    ignored: tuple[str, ...] = ()

    @classmethod
    def of_arm(
        cls, arm: Arm | ArmGroup, q: ArrayLike, time: ArrayLike, name: str = ""
    ) -> "Demonstration":
        """Make a demonstration of the positions (n, dof) of an arm, or of a group, at increasing times (n,) [s].

        `InvalidInputError` for other shapes, and for numbers that are not finite.
        """
        times = as_times(time, fewest=FEWEST_FRAMES)
        positions = arm.configurations(q)
        require_shape(positions, "q", (len(times), arm.dof), ", one row for each time")
        return cls(arm, times, positions, name)

    def ellipsoids(self, config: TransferOptions) -> tuple[Array, ...]:
        """Compute the ellipsoids (n, d, d) of each arm that the options name."""
        group = as_group(self.arm)
        stacked = group.ellipsoids(self.joint_positions, config.spec)
        return tuple(np.moveaxis(stacked, -3, 0))

    @property
    def paths(self) -> tuple[Array, ...]:
        """Positions of each end effector in the base frame, shape (n, 3) [m]."""
        poses = as_group(self.arm).forward(self.joint_positions)
        return tuple(np.moveaxis(poses[..., :3, 3], -2, 0))

    def subsampled(self, rate: float) -> "Demonstration":
        """Keep at most so many frames a second [Hz], evenly spaced; grippers keep all of theirs."""
        count = max(FEWEST_FRAMES, int(np.ceil(np.ptp(self.time) * rate)) + 1)
        rows = evenly_spaced(len(self.time), count)
        return replace(self, time=self.time[rows], joint_positions=self.joint_positions[rows])

    def crop(self, start: float | None = None, stop: float | None = None) -> "Demonstration":
        """Return the part between two times [s]; `InvalidInputError` where it has fewer than 3 frames."""
        first = self.time[0] if start is None else start
        last = self.time[-1] if stop is None else stop
        rows = np.flatnonzero((self.time >= first - 1e-9) & (self.time <= last + 1e-9))
        if len(rows) < FEWEST_FRAMES:
            raise InvalidInputError(
                f"{argument('start')} and {argument('stop')} must contain at least {FEWEST_FRAMES} frames "
                f"of {self.time[0]:g} to {self.time[-1]:g} s; found {len(rows)}"
            )
        return replace(self, time=self.time[rows], joint_positions=self.joint_positions[rows])


def read_demonstration(
    path: str | os.PathLike[str],
    teacher: Arm | ArmGroup,
    episode: int = 0,
    unit: str | None = None,
    columns: tuple[str, ...] = (),
    rate: float | None = None,
) -> Demonstration:
    """Read one motion of a dataset as the demonstration of a robot.

    Parameters
    ----------
    path : str or path
        As in `maniport.datasets.open_dataset`.
    teacher : Arm or ArmGroup
    episode : int
        Number of the motion.
    unit : str, optional
        Unit of revolute joints where the dataset states none, ``"rad"`` or ``"deg"``.
    columns : tuple of str
        Joint of each column in its order, ``"-"`` for one that is none, a name with ``gripper`` for a gripper. Default:
        by names.
    rate : float, optional
        Frames a second of files without times [Hz].

    Raises
    ------
    FileFormatError, InvalidInputError
        When the file cannot be read, has no such motion, or units or columns are unknown.
    """
    reading = ReadOptions(joint_names=given_names(columns, teacher.joint_names), rate=rate)
    motion = _motion_of(path, episode, reading)
    count = motion.positions.shape[1]
    chosen = matched_columns(motion.columns, count, teacher.joint_names, columns)
    factors = unit_factors(motion, teacher, chosen, unit, "joint_unit")
    q = motion.positions[:, chosen] * factors
    name = f"{os.path.basename(os.path.normpath(path))}, episode {episode}"
    demonstration = Demonstration.of_arm(teacher, q, motion.time, name)

    labelled = _labelled(motion, columns)
    grippers = Grippers.of(labelled, chosen)
    passed: tuple[str, ...] = ()
    if grippers is not None:
        passed = grippers.names
        commands = _commands(path, episode, reading)
        if commands is not None:
            grippers = grippers.with_commands(_labelled(commands, columns))
    ignored = []
    for place, label in enumerate(labelled.columns):
        if place not in chosen and label not in passed:
            ignored.append(label)
    return replace(demonstration, grippers=grippers, ignored=tuple(ignored))


def _motion_of(path: str | os.PathLike[str], episode: int, options: ReadOptions) -> JointMotion:
    """Read a motion of a dataset by its number."""
    source = open_dataset(path, options)
    for number, motion in source.motions():
        if number == episode:
            return motion
    raise InvalidInputError(
        f"{argument('episode')} must be one of {source.count} motions, from 0; found {episode}"
    )


def _labelled(motion: JointMotion, given: Sequence[str]) -> JointMotion:
    """Return a motion whose columns have names: of grippers those of the caller, of others those of the file."""
    count = motion.positions.shape[1]
    names = list(motion.columns)
    if not names:
        names = [f"column {place}" for place in range(count)]
    if len(given) == count:
        for place, name in enumerate(given):
            if is_gripper(name):
                names[place] = name
    return replace(motion, columns=tuple(names))


def _commands(
    path: str | os.PathLike[str], episode: int, options: ReadOptions
) -> JointMotion | None:
    """Read the actions of an episode of a LeRobot dataset; None for other files, and without actions."""
    if not os.path.isfile(os.path.join(path, INFO)):
        return None
    if ACTION not in LeRobotDataset(path).sizes:
        return None
    return _motion_of(path, episode, replace(options, feature=ACTION))


def transfer_demonstration(
    demonstration: Demonstration,
    robot: Arm | ArmGroup | str,
    config: TransferOptions | None = None,
    *,
    progress: Progress | None = None,
    **options: Any,
) -> MotionResult:
    """Transfer the motion of a robot to another robot with as many arms.

    A map is fitted from the domain of each arm of the teacher to that of the arm of the student. The mapped ellipsoids
    and the paths of the teacher's end effectors are placed relative to the student, and a motion along them is planned.

    Parameters
    ----------
    demonstration : Demonstration
    robot : Arm, ArmGroup or str
        The student.
    config : TransferOptions, optional
    progress, **options
        As in `transfer_recording`; ``method="auto"`` is the length field, and ``base_rotation`` is from the base frame
        of the teacher to that of the student.

    Returns
    -------
    MotionResult
        With the demonstration, and its grippers over the times of the motion.

    Raises
    ------
    ManiportError
        When an option does not exist, an input cannot be used or the robots have other numbers of arms.
    """
    config = Config.of(config).changed(**options)
    require_no_directions(config)
    if config.method == AUTO:
        config = config.changed(method=METHOD)
    student = _student(config.changed(robot=robot))
    teachers = as_group(demonstration.arm).arms
    students = as_group(student)
    if len(teachers) != len(students):
        raise InvalidInputError(
            f"{argument('robot')} must have as many arms as the teacher, {len(teachers)}; found "
            f"{len(students)}. {argument('frame')} and {argument('teacher_frame')} choose one arm or two"
        )
    shown = demonstration.subsampled(PROFILE_RATE)
    step = Step(progress, "Fit transfer")
    domains = []
    sizes = (config.n_teacher, config.n_student)
    for number, (arms, size) in enumerate(zip((shown.arm, student), sizes, strict=True)):
        domain = sample_domain(arms, size, config.seed + number, spec=config.spec)
        if domain.ndim == 3:
            domain = domain[None]
        domains.append(domain)
    specs = students.specs(config.spec)
    maps = []
    for i, arm in enumerate(students.arms):
        adapter = adapter_of(config)
        adapter = with_feasible_set(adapter, arm, specs[i], random_state=config.seed)
        adapter.fit(domains[0][i], domains[1][i])
        maps.append(FittedMap(adapter, domains[0][i]))
    rotation = mean_rotation(maps)[:3, :3]
    step.end()

    targets = []
    parts = zip(students.arms, maps, shown.ellipsoids(config), shown.paths, specs, strict=True)
    for arm, fitted, ellipsoids, path, spec in parts:
        target = TargetTrajectory.checked(
            arm,
            shown.time,
            fitted.adapter.transform(ellipsoids),
            positions=path @ rotation.T,
            spec=spec,
            damping=config.damping,
        )
        targets.append(target)
    result = follow_profile(student, targets, replace(config, place=True), progress=progress)
    return _taught(result, demonstration, config)


def _student(config: Config) -> Arm | ArmGroup:
    """Load the robot of a configuration without its payload, which is added when its motion is planned."""
    light = config.changed(payload=(), payload_center=(0.0, 0.0, 0.0))
    return load_robot(light, both=config.side == BOTH)


def _taught(result: MotionResult, demonstration: Demonstration, config: Config) -> MotionResult:
    """Add the demonstration to a result, and its grippers at the times of the motion."""
    arms = tuple(replace(arm, teacher=demonstration.arm.name) for arm in result.arms)
    motion = result.arms[0].motion
    grippers = None
    if demonstration.grippers is not None and motion is not None:
        assert motion.demonstrated_time is not None
        grippers = demonstration.grippers.retimed(motion.demonstrated_time, motion.time)
    return replace(
        result,
        arms=arms,
        config=replace(result.config, method=config.method, verb="transfer"),
        demonstration=demonstration,
        grippers=grippers,
    )


def transfer_episode(config: Config, progress: Progress | None = None) -> MotionResult:
    """Transfer the motion of a dataset that a configuration names as its recording; see `transfer_demonstration`."""
    assert config.teacher is not None
    _require_robot_options(config)
    teacher = _teacher(config)
    demonstration = read_demonstration(
        config.recording[0],
        teacher,
        config.episode,
        config.joint_unit,
        config.columns,
        config.fps,
    )
    demonstration = demonstration.crop(config.start, config.stop)
    result = transfer_demonstration(demonstration, _student(config), config, progress=progress)
    chosen = replace(config, method=result.config.method, verb="transfer")
    return replace(result, config=chosen)


def _teacher(config: Config) -> Arm | ArmGroup:
    """Load the teacher of a configuration: one arm, or two where two frames or both sides are named."""
    assert config.teacher is not None
    frames = config.teacher_frame
    folders = config.mesh_folders
    if len(frames) > 1 or config.side == BOTH:
        return load_arms(config.teacher, frames or None, mesh_folders=folders)
    return load_arm(config.teacher, frames[0] if frames else None, mesh_folders=folders)


def _require_robot_options(config: Config) -> None:
    """Raise for options of a recorded person, which a robot does not have."""
    defaults = HumanOptions()
    for name in OF_PERSONS:
        value = getattr(config, name)
        if value != getattr(defaults, name):
            raise InvalidInputError(
                f"{argument(name)} is for a person; the teacher is the robot {config.teacher}. Leave it "
                f"out; found {value!r}"
            )
    if config.side not in (AUTO, BOTH):
        raise InvalidInputError(
            f"{argument('side')} of a robot as teacher must be {BOTH} for two arms, or be left out; "
            f"{argument('teacher_frame')} names one arm; found {config.side!r}"
        )
