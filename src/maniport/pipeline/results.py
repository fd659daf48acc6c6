"""Results of the main job as data, and the files that they are saved as."""

import csv
import os
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from maniport.arms import VELOCITY, Arm, ArmGroup, EllipsoidSpec
from maniport.arms.collisions import Collisions, Lowest
from maniport.arms.collisions.hulls import lowest_point
from maniport.datasets.grippers import Grippers
from maniport.datasets.lerobot.layout import OWN_FILES as DATASET_FILES
from maniport.errors import InvalidInputError
from maniport.evaluation import Capability, Evaluation
from maniport.mocap import ArmFit, Recording
from maniport.motion import ArmMotion, Placement, RobotMotion
from maniport.motion.exports import FORMATS
from maniport.motion.placement.placement import DATA_FILES as PLACED_FILES
from maniport.pipeline.config import CONFIG, Config
from maniport.transfer import DomainAdapter
from maniport.util.atomic_io import folder_written_whole
from maniport.util.files import save_ellipsoids, save_path, spreadsheet_cell
from maniport.util.notebook import NotebookDisplay
from maniport.util.plotting import Plottable
from maniport.util.validation import Array

if TYPE_CHECKING:
    from maniport.pipeline.robot_teacher import Demonstration
    from maniport.pipeline.transfer import FittedTransfer

GRIPPERS = "grippers.csv"


def _result_files() -> frozenset[str]:
    """Return the names of all files that a result can have."""
    names = {
        "person.csv",
        "demonstrated_profile.npz",
        "target_profile.npz",
        "adapter.npz",
        "joints.csv",
        "joints.npz",
        GRIPPERS,
        "model.npz",
        "demonstrations.npz",
        "summary.md",
        "summary.json",
        "report.html",
        CONFIG,
        *PLACED_FILES,
        *DATASET_FILES,
    }
    for exporter in FORMATS.values():
        names.add(exporter.file)
    for content in ("profile", "path"):
        for side in ("", "-left", "-right"):
            names.add(f"{content}{side}.npz")
    for figure in ("arms", "ellipsoids", "curves", "motion", "learned"):
        for ending in ("png", "svg"):
            names.add(f"{figure}.{ending}")
    return frozenset(names)


RESULT_FILES = _result_files()
"""Files of results, their reports and figures. A folder with other files is not replaced."""


class SavedResult(NotebookDisplay):
    """Base of results that are saved as a folder of data files."""

    def save(self, folder: str | os.PathLike[str], *, overwrite: bool = False) -> None:
        """Write the data to a folder, whole or not at all; `maniport.write_results` adds a report.

        Raises
        ------
        OutputError
            When the folder holds a result and `overwrite` is false, or other files, or cannot be written.
        """
        with folder_written_whole(folder, RESULT_FILES, overwrite) as staging:
            self.write_data(staging)

    def write_data(self, folder: Path) -> None:
        """Write the data files into an existing folder."""
        raise NotImplementedError


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class ArmResult(NotebookDisplay):
    """One arm of a robot and its motion along target ellipsoids.

    Attributes
    ----------
    name : str
        Unique within the result: the side of the arm, or the name of the robot. With several arms, the name of the
        folder of this one, too.
    robot : Arm
        With the limits of its description, without the margin of the plan.
    spec : EllipsoidSpec
        Which ellipsoids; `motion` has their inverses where the kind is "force".
    placement : Placement or None
        Of the path relative to the robot; None where it was not placed.
    motion : ArmMotion or None
        None where the robot was not moved; a warning has the reason.
    gap : ndarray, shape (n,), or None
        Feasibility gap: affine-invariant distances from target ellipsoids to the nearest feasible ones.
    collisions : Collisions or None
        Collision model of the arm.
    teacher : str or None
        Name of the robot whose motion was transferred; None for the motion of a person, and for targets alone.
    """

    name: str
    robot: Arm
    spec: EllipsoidSpec = VELOCITY
    placement: Placement | None = None
    motion: ArmMotion | None = None
    gap: Array | None = None
    collisions: Collisions | None = None
    teacher: str | None = None

    def __repr__(self) -> str:
        moved = (
            "not moved"
            if self.motion is None
            else f"d = {np.median(self.motion.distance):.2f} (median)"
        )
        return f"{type(self).__name__}({self.name!r}, {self.robot.name!r}, {moved})"

    @cached_property
    def lowest(self) -> Lowest | None:
        """Lowest point of all moving links over the motion; None where no shape is available."""
        motion = self.motion
        if motion is None:
            return None
        return lowest_point(self.robot, motion.control_time, motion.control_positions)

    @property
    def major_axis_angle(self) -> Array:
        """Angle between the longest axes of target and achieved ellipsoids, as `ArmMotion.major_axis_angle`."""
        assert self.motion is not None
        if self.spec.kind == "force":  # the longest axes are the shortest ones of the inverses
            return self.motion.axis_angle(0)
        return self.motion.major_axis_angle

    @property
    def mean_distance(self) -> dict[str, float]:
        """Parts of the mean distance of target and achieved ellipsoids; their sum is the mean.

        The feasibility gap; what the end-effector path adds, at the pointwise optimum found; and what limits,
        collisions and smoothness of the trajectory add.
        """
        assert self.motion is not None
        assert self.gap is not None
        assert self.motion.pointwise_best is not None
        values = self.motion.distance, self.motion.pointwise_best, self.gap
        mean, pointwise, gap = (float(np.mean(value)) for value in values)
        return {"infeasible": gap, "path": pointwise - gap, "motion": mean - pointwise}

    def write_data(self, folder: Path) -> None:
        """Write the files of the motion, if there is one, into an existing folder."""
        motion = self.motion
        if motion is None:
            return
        save_ellipsoids(folder / PLACED_FILES[0], self.spec.of_bounded(motion.target), motion.time)
        if motion.path is not None:
            save_path(folder / PLACED_FILES[1], motion.path, motion.time)
        motion.save_joints_csv(folder / "joints.csv")
        motion.save_joints(folder / "joints.npz", self.spec)


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class ArmTransfer(ArmResult):
    """Transfer from one arm of a person to one arm of a robot; the name is the side of the person's arm.

    Attributes
    ----------
    name, robot, spec, placement, motion, gap, collisions, teacher
        As in `ArmResult`.
    fit : ArmFit
        Human arm scaled to the person, and its joint angles.
    person_base : ndarray, shape (3,)
        Origin of that arm in the common frame of all arms [m], see `maniport.mocap.HumanMotion`.
    method : str
        Name of the transfer method.
    adapter : DomainAdapter
        Fitted, from the person's domain (teacher) to the robot's (student).
    evaluation : Evaluation or None
        Comparison with baselines; None where it was not requested, as in a batch.
    time : ndarray, shape (n,)
        Demonstrated times of the profiles [s].
    demonstrated_profile : ndarray, shape (n, d, d)
        Ellipsoids of the person in the trunk frame.
    target_profile : ndarray, shape (n, d, d)
        Mapped ellipsoids in the robot's base frame, before the rotation of the placement.
    teacher_domain, student_domain : ndarray, shapes (n_teacher, d, d) and (n_student, d, d)
        Sampled domains of the arms of person and robot.
    capabilities : tuple of Capability
        Force and speed of the motion along lines, where limits are known.
    """

    fit: ArmFit
    person_base: Array
    method: str
    adapter: DomainAdapter
    evaluation: Evaluation | None = None
    time: Array
    demonstrated_profile: Array
    target_profile: Array
    teacher_domain: Array
    student_domain: Array
    capabilities: tuple[Capability, ...] = ()

    def write_data(self, folder: Path) -> None:
        """Write the files of the transfer, and those of the motion if there is one, into an existing folder."""
        columns = [self.fit.time[:, None], np.degrees(self.fit.joint_angles)]
        names = ["time_s", *(f"{name}_deg" for name in self.fit.arm.joint_names)]
        formats = ["%.6f"] + ["%.4f"] * self.fit.arm.dof
        for capability in self.capabilities:
            what = "speed" if capability.kind == "velocity" else capability.kind
            columns.append(capability.lines)
            names += [f"direction_{what}_{axis}" for axis in "xyz"]
            formats += ["%.9f"] * 3
        np.savetxt(
            folder / "person.csv",
            np.column_stack(columns),
            formats,
            delimiter=",",
            header=",".join(names),
            comments="",
            encoding="utf-8",
        )
        save_ellipsoids(folder / "demonstrated_profile.npz", self.demonstrated_profile, self.time)
        save_ellipsoids(folder / "target_profile.npz", self.target_profile, self.time)
        self.adapter.save(folder / "adapter.npz")
        super().write_data(folder)


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class MotionResult(SavedResult, Plottable):
    """A motion of a robot along target ellipsoids, as ``maniport track`` plans it without a person.

    Attributes
    ----------
    robot : ArmGroup
        All arms of the result.
    arms : tuple of ArmResult
        Robot, placement, motion, feasibility gap and collision model of each arm.
    motion : RobotMotion or None
        Joint trajectory of all arms, with one time; None where the robot was not moved.
    config : Config
        Options of the run.
    demonstration : Demonstration or None
        The motion of a robot as teacher.
    grippers : Grippers or None
        Those of the teacher, over the times of the motion.
    """

    robot: ArmGroup
    arms: tuple[ArmResult, ...]
    config: Config
    motion: RobotMotion | None = None
    demonstration: "Demonstration | None" = None
    grippers: Grippers | None = None

    @property
    def arm(self) -> ArmResult:
        """Result of the only arm; raises `InvalidInputError` where there are several."""
        if len(self.arms) != 1:
            names = ", ".join(repr(arm.name) for arm in self.arms)
            raise InvalidInputError(
                f"arm is for results of one arm; found {len(self.arms)}: {names}; use arms"
            )
        return self.arms[0]

    def write_data(self, folder: Path) -> None:
        """Write the data files into an existing folder; with several arms a folder for each arm."""
        if self.grippers is not None and self.motion is not None:
            write_grippers(folder / GRIPPERS, self.grippers, self.motion.trajectory.control_time)
        if len(self.arms) == 1:
            self.arms[0].write_data(folder)
            return
        for arm in self.arms:
            (folder / arm.name).mkdir(exist_ok=True)
            arm.write_data(folder / arm.name)
        if self.motion is not None:
            self.motion.trajectory.save_joints_csv(folder / "joints.csv")
            self.motion.save_joints(folder / "joints.npz", self.config.spec)

    def __repr__(self) -> str:
        return f"{type(self).__name__}({', '.join(map(repr, self.arms))})"


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class TransferResult(MotionResult):
    """A recorded motion of one or both arms of a person, transferred to one or several arms of a robot.

    Attributes
    ----------
    robot, config, motion
        As in `MotionResult`.
    arms : tuple of ArmTransfer
        As in `MotionResult`, with arm fit, adapter, profiles and domains; for two arms of a person left first.
    recording : Recording
    fitted : FittedTransfer
        The maps and the robot, for further recordings of the person.
    warnings : tuple of str
        Warnings of all stages, each once.
    """

    arms: tuple[ArmTransfer, ...]
    recording: Recording
    fitted: "FittedTransfer"
    warnings: tuple[str, ...] = ()

    @property
    def arm(self) -> ArmTransfer:
        """Result of the only arm, as `MotionResult.arm`."""
        _ = super().arm  # raises where there are several
        return self.arms[0]

    @property
    def time(self) -> Array:
        """Demonstrated times, the same for all arms, shape (n,) [s]."""
        return self.arms[0].time


def write_grippers(path: Path, grippers: Grippers, control_time: Array) -> None:
    """Write a row for each of ``joints.csv``: the time from 0 [s], positions, and commands (``NAME_command``)."""
    sampled = grippers.at(control_time)
    names = [str(spreadsheet_cell(name)) for name in grippers.names]
    header = ["time_s", *names, *(f"{name}_command" for name in names)]
    table = np.column_stack([control_time - control_time[0], sampled.positions, sampled.commands])
    with open(path, "w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(header)
        for row in table.tolist():
            writer.writerow([f"{row[0]:.6f}", *(f"{value:.9g}" for value in row[1:])])
