"""What the main job returns, as data."""

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from maniport.arms import Arm, EllipsoidSpec
from maniport.evaluation import Choice, Evaluation
from maniport.mocap import ArmFit, Recording
from maniport.pipeline.config import Config
from maniport.pipeline.execution import DATA_FILES as MOTION_FILES
from maniport.pipeline.execution import Execution, SavedResult
from maniport.transfer import DomainAdapter
from maniport.util.files import save_ellipsoids
from maniport.util.validation import Array

DATA_FILES = ("person.csv", "demonstrated_profile.npz", "target_profile.npz", "adapter.npz", *MOTION_FILES)
"""The files that `TransferResult.save` writes."""


@dataclass(frozen=True)
class TransferResult(SavedResult):
    """A person's motion as ellipsoids, and what a robot should make of them.

    Attributes
    ----------
    recording : Recording
    fit : ArmFit
        The person's arm and its joint angles.
    robot : Arm
    method : str
    adapter : DomainAdapter
        Fitted, teacher to student.
    time : ndarray, shape (n,)
        Of the profiles [s].
    demonstrated_profile, target_profile : ndarray, shape (n, d, d)
        The person's ellipsoids in the trunk frame, and the adapted ones in the robot's base frame.
    execution : Execution or None
        The robot's motion: where the hand path lies before it, its joint trajectory, and what that achieves. None
        where the robot cannot be tracked; a warning says why.
    teacher_domain, student_domain : ndarray, shape (N, d, d) and (M, d, d)
    evaluation : Evaluation or None
        The transfer beside simpler ways; None where it was not judged, as in a batch.
    seconds_to_fit : float
        Where the method was chosen, of all that were tried, with their measures.
    random_state : int
    spec : EllipsoidSpec
        Which ellipsoids were transferred.
    base_rotation : ndarray, shape (3, 3)
        Rotation from the person's trunk frame to the robot's base frame.
    warnings : tuple of str
        What the steps warned of.
    choice : Choice or None
        How the method was chosen, where none was named.
    config : Config or None
        How the transfer was requested.
    """

    data_files = DATA_FILES

    recording: Recording
    fit: ArmFit
    robot: Arm
    method: str
    adapter: DomainAdapter
    time: Array
    demonstrated_profile: Array
    target_profile: Array
    execution: Execution | None
    teacher_domain: Array
    student_domain: Array
    evaluation: Evaluation | None
    seconds_to_fit: float
    random_state: int
    spec: EllipsoidSpec
    base_rotation: Array
    warnings: tuple[str, ...]
    choice: Choice | None = None
    config: Config | None = None

    def __repr__(self) -> str:
        motion = None if self.execution is None else self.execution.motion
        moved = "not moved" if motion is None else f"moved at d = {np.median(motion.distance):.2f} (median)"
        return (
            f"TransferResult({self.fit.arm.name!r} to {self.robot.name!r} by {self.method}: "
            f"{len(self.time)} ellipsoids, {moved}, {len(self.warnings)} warnings)"
        )

    def write_data(self, folder: Path) -> None:
        """Write `DATA_FILES` into an existing folder, those of the motion if there is one."""
        _write_joint_angles(folder / "person.csv", self.fit)
        save_ellipsoids(folder / "demonstrated_profile.npz", self.demonstrated_profile, self.time)
        save_ellipsoids(folder / "target_profile.npz", self.target_profile, self.time)
        self.adapter.save(folder / "adapter.npz")
        if self.execution is not None:
            self.execution.write_data(folder)


def _write_joint_angles(path: Path, fit: ArmFit) -> None:
    with open(path, "w", newline="", encoding="utf-8") as stream:
        rows = csv.writer(stream)
        rows.writerow(["time_s", *(f"{name}_deg" for name in fit.arm.joint_names)])
        for t, angles in zip(fit.time, np.degrees(fit.joint_angles), strict=True):
            rows.writerow([f"{t:.6f}", *(f"{angle:.4f}" for angle in angles)])
