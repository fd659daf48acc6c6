"""A robot as teacher: the motion of one robot, from a dataset, is transferred to another."""

import os
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from maniport.arms import Arm, load_arm
from maniport.datasets import ReadOptions, open_dataset
from maniport.datasets.columns import matched_columns, unit_factors
from maniport.domain import sample_domain
from maniport.errors import InvalidInputError, argument
from maniport.evaluation.comparison import with_feasible_set
from maniport.motion import TargetTrajectory
from maniport.pipeline.config import Config
from maniport.pipeline.following import follow_profile
from maniport.pipeline.options import TransferOptions
from maniport.pipeline.results import MotionResult
from maniport.pipeline.robots import load_single_arm
from maniport.pipeline.settings import adapter_of
from maniport.util.defaults import AUTO
from maniport.util.progress import Progress, Step
from maniport.util.sampling import evenly_spaced
from maniport.util.validation import Array, as_times, require_shape

PROFILE_RATE = 50.0  # of the ellipsoids of a teacher [Hz]: data sets have 30 to 50 frames a second
METHOD = "length-field"  # where the method is to be chosen


@dataclass(frozen=True, eq=False)
class RobotDemonstration:
    """The motion of a robot's arm as a demonstration; make it with `RobotDemonstration.of_arm`.

    Attributes
    ----------
    arm : Arm
    time : ndarray, shape (n,)
        [s].
    joint_positions : ndarray, shape (n, dof)
        [rad] or [m].
    """

    arm: Arm
    time: Array
    joint_positions: Array

    @classmethod
    def of_arm(cls, arm: Arm, q: ArrayLike, time: ArrayLike) -> "RobotDemonstration":
        """Make a demonstration of the positions (n, dof) of an arm at increasing times (n,) [s].

        `InvalidInputError` for other shapes, and for numbers that are not finite.
        """
        times = as_times(time, fewest=2)
        positions = arm.configurations(q)
        require_shape(positions, "q", (len(times), arm.dof), ", one row for each time")
        return cls(arm, times, positions)

    def ellipsoids(self, config: TransferOptions) -> Array:
        """Compute the ellipsoids (n, d, d) that the options name."""
        return self.arm.ellipsoids(self.joint_positions, config.spec)

    @property
    def path(self) -> Array:
        """Positions of the end effector in the base frame, shape (n, 3) [m]."""
        return self.arm.forward(self.joint_positions)[:, :3, 3]

    def subsampled(self, rate: float) -> "RobotDemonstration":
        """Keep at most so many frames a second [Hz], evenly spaced."""
        count = max(3, int(np.ceil(np.ptp(self.time) * rate)) + 1)
        rows = evenly_spaced(len(self.time), count)
        return replace(self, time=self.time[rows], joint_positions=self.joint_positions[rows])


def read_demonstration(
    path: str | os.PathLike[str],
    teacher: Arm,
    episode: int = 0,
    unit: str | None = None,
    columns: tuple[str, ...] = (),
) -> RobotDemonstration:
    """Read one motion of a dataset as the demonstration of a robot.

    Parameters
    ----------
    path : str or path
        As in `maniport.datasets.open_dataset`.
    teacher : Arm
    episode : int
        Number of the motion.
    unit : str, optional
        Unit of revolute joints where the dataset states none, ``"rad"`` or ``"deg"``.
    columns : tuple of str
        Joint of each column in its order, ``"-"`` for one that is none. Default: by names.

    Raises
    ------
    FileFormatError, InvalidInputError
        When the file cannot be read, has no such motion, or units or columns are unknown.
    """
    names = list(columns)
    for i, name in enumerate(names):
        if name not in teacher.joint_names:
            names[i] = f"column {i}"
    source = open_dataset(path, ReadOptions(joint_names=tuple(names)))
    for number, motion in source.motions():
        if number != episode:
            continue
        count = motion.positions.shape[1]
        chosen = matched_columns(motion.columns, count, teacher.joint_names, columns)
        factors = unit_factors(motion, teacher, chosen, unit, "joint_unit")
        q = motion.positions[:, chosen] * factors
        return RobotDemonstration.of_arm(teacher, q, motion.time)
    raise InvalidInputError(
        f"{argument('episode')} must be one of {source.count} motions, from 0; found {episode}"
    )


def transfer_demonstration(
    demonstration: RobotDemonstration,
    robot: Arm | str,
    config: TransferOptions | None = None,
    *,
    progress: Progress | None = None,
    **options: Any,
) -> MotionResult:
    """Transfer the motion of a robot to another robot.

    The map is fitted from the domain of the teacher to that of the student, the mapped ellipsoids and the path of the
    teacher's end effector are placed relative to the student, and a motion along them is planned.

    Parameters
    ----------
    demonstration : RobotDemonstration
    robot : Arm or str
        The student.
    config : TransferOptions, optional
    progress, **options
        As in `transfer_recording`; ``method="auto"`` is the length field.

    Raises
    ------
    ManiportError
        When an option does not exist or an input cannot be used.
    """
    config = Config.of(config).changed(**options)
    if config.method == AUTO:
        config = config.changed(method=METHOD)
    loaded = config.changed(robot=robot, payload=(), payload_center=(0.0, 0.0, 0.0))
    student = load_single_arm(loaded)
    shown = demonstration.subsampled(PROFILE_RATE)
    step = Step(progress, "Fit transfer")
    domains = []
    sizes = (config.n_teacher, config.n_student)
    for number, (arm, size) in enumerate(zip((shown.arm, student), sizes, strict=True)):
        domains.append(sample_domain(arm, size, config.seed + number, spec=config.spec))
    adapter = adapter_of(config)
    adapter = with_feasible_set(adapter, student, config.spec, random_state=config.seed)
    adapter.fit(*domains)
    mapped = adapter.transform(shown.ellipsoids(config))
    step.end()
    targets = TargetTrajectory.checked(
        student,
        shown.time,
        mapped,
        positions=shown.path,
        spec=config.spec,
        damping=config.damping,
    )
    return follow_profile(student, targets, replace(config, place=True), progress=progress)


def transfer_episode(config: Config, progress: Progress | None = None) -> MotionResult:
    """Transfer the motion of a dataset that a configuration names as its recording; see `transfer_demonstration`."""
    assert config.teacher is not None
    teacher = load_arm(config.teacher)
    demonstration = read_demonstration(
        config.recording[0], teacher, config.episode, config.joint_unit, config.columns
    )
    student = load_single_arm(config.changed(payload=(), payload_center=(0.0, 0.0, 0.0)))
    result = transfer_demonstration(demonstration, student, config, progress=progress)
    return replace(result, config=replace(config, verb="transfer"))
