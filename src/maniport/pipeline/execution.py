"""A robot's motion along a profile: what it is, where its distance comes from, and its files."""

import os
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from maniport.arms import Arm
from maniport.arms.collisions import Collisions, Lowest
from maniport.arms.collisions.carried import lowest_points
from maniport.motion import ArmMotion, Placement
from maniport.motion.placement.placed_path import DATA_FILES as PLACED_FILES
from maniport.motion.trajectory import Clearance
from maniport.pipeline.config import Config
from maniport.util.atomic_io import folder_written_whole
from maniport.util.files import save_ellipsoids, save_path
from maniport.util.notebook import ShownInNotebooks
from maniport.util.validation import Array

JOINT_FILES = "joints.csv", "joints.npz"
DATA_FILES = (*PLACED_FILES, *JOINT_FILES)  # The files that `Execution.save` writes


class SavedResult(ShownInNotebooks):
    """Base of results that are saved as a folder of data files."""

    data_files: ClassVar[tuple[str, ...]]

    def save(self, folder: str | os.PathLike[str], *, overwrite: bool = False) -> None:
        """Write the data to a folder, whole or not at all; `maniport.write_results` adds a report.

        Raises
        ------
        OutputError
            When the folder holds earlier data that must stay, or other files, or cannot be written.
        """
        with folder_written_whole(folder, self.data_files, overwrite) as staging:
            self.write_data(staging)

    def write_data(self, folder: Path) -> None:
        """Write the data files into an existing folder."""
        raise NotImplementedError


@dataclass(frozen=True)
class Execution(SavedResult):
    """A robot's motion along a profile."""

    data_files = DATA_FILES

    robot: Arm
    placement: Placement | None  # Where the hand path was placed
    plan: ArmMotion  # The motion as it was planned and timed
    motion: ArmMotion  # The joint trajectory and what it achieves: the plan, or what a tracker makes of it
    room: Clearance  # How near the motion comes to a collision
    gap: Array  # (n,)
    collisions: Collisions | None = None  # What the robot was kept apart from
    free: ArmMotion | None = None  # The same with the orientation of the tip free, where it is not
    random_state: int | None = 0  # Seed of the searches, where it is known
    sources: tuple[str, ...] = ()  # The files that profile and path came from, as far as they did
    config: Config | None = None  # How the motion was requested

    def __repr__(self) -> str:
        return f"Execution({self.robot.name!r}, {self.motion!r})"

    @property
    def placed_time(self) -> Array:
        """Times of the points that the place of the path was judged by, shape (m,) [s]."""
        assert self.placement is not None
        return np.asarray(self.motion.time[placed_rows(len(self.motion.time), len(self.placement.path))])

    @cached_property
    def lowest_of_links(self) -> tuple[Lowest, ...]:
        """Lowest point of each moving link over the motion, the lowest first; empty where no shape is known."""
        return lowest_points(self.robot, self.motion.control_time, self.motion.control_positions)

    @property
    def lowest(self) -> Lowest | None:
        """Lowest point of all moving links over the motion; None where no shape is known."""
        return self.lowest_of_links[0] if self.lowest_of_links else None

    @property
    def parts(self) -> "Parts":
        """Where the mean distance comes from."""
        assert self.plan.pointwise_best is not None
        mean, floor, gap = (float(np.mean(one)) for one in (self.motion.distance, self.plan.pointwise_best, self.gap))
        return Parts(gap, floor - gap, mean - floor)

    def write_data(self, folder: Path) -> None:
        """Write `DATA_FILES` into an existing folder, without the path if there is none."""
        save_ellipsoids(folder / PLACED_FILES[0], self.motion.target, self.motion.time)
        if self.motion.path is not None:
            save_path(folder / PLACED_FILES[1], self.motion.path, self.motion.time)
        self.motion.save_joints_csv(folder / JOINT_FILES[0])
        self.motion.save_joints(folder / JOINT_FILES[1])


class Parts(NamedTuple):
    """The mean distance of target and achieved ellipsoids as a sum."""

    no_posture: float
    path: float
    way: float


def placed_rows(count: int, most: int = 80) -> NDArray[np.intp]:
    """Rows of the waypoints that a path is placed by, evenly spaced; more of them change little."""
    return np.arange(0, count, 1 + (count - 1) // most)
