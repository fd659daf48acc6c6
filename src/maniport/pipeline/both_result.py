"""What the main job returns where both arms of a person become those of a robot, as data."""

import os
from dataclasses import dataclass
from pathlib import Path

from maniport.arms import ArmGroup
from maniport.mocap import HumanMotion, Recording
from maniport.motion import RobotMotion
from maniport.pipeline.config import Config
from maniport.pipeline.execution import JOINT_FILES, SavedResult
from maniport.pipeline.result import TransferResult
from maniport.util.atomic_io import folder_written_whole

FOLDERS = "left", "right"  # Where the data of each arm are, as of a run of one
DATA_FILES = (*FOLDERS, *JOINT_FILES)  # What `BothResult.save` writes


@dataclass(frozen=True)
class BothResult(SavedResult):
    """Motions of both arms of a person as ellipsoids, and what the two arms of a robot should make of them.

    Attributes
    ----------
    fits : HumanMotion
        Both arms of the person, in the same frames.
    robot : ArmGroup
    left, right : TransferResult
        What became of each arm: its ellipsoids, adapter, evaluation, and its part of the motion.
    motion : RobotMotion or None
        The motion of both, with one time; None where the robot was not moved.
    warnings : tuple of str
        What the steps warned of that concern both.
    """

    data_files = DATA_FILES

    fits: HumanMotion
    robot: ArmGroup
    left: TransferResult
    right: TransferResult
    motion: RobotMotion | None
    warnings: tuple[str, ...]
    config: Config | None = None  # How the transfer was requested

    @property
    def each(self) -> tuple[TransferResult, TransferResult]:
        """Left and right."""
        return self.left, self.right

    @property
    def recording(self) -> Recording:
        """What was recorded of the person."""
        return self.left.recording

    def __repr__(self) -> str:
        moved = "not moved" if self.motion is None else "moved"
        return f"BothResult({self.robot.name!r}, {moved}, left={self.left!r}, right={self.right!r})"

    def save(self, folder: str | os.PathLike[str], *, overwrite: bool = False) -> None:
        """Write the joint positions of both arms to a folder, and the data of each to ``left`` and ``right`` in it."""
        with folder_written_whole(folder, DATA_FILES, overwrite) as staging:
            self.write_data(staging)
            for side, result in zip(FOLDERS, self.each, strict=True):
                (staging / side).mkdir()
                result.write_data(staging / side)

    def write_data(self, folder: Path) -> None:
        """Write the joint positions of both arms into an existing folder, if the robot was moved."""
        if self.motion is not None:
            self.motion.trajectory.save_joints_csv(folder / JOINT_FILES[0])
            self.motion.save_joints(folder / JOINT_FILES[1])
