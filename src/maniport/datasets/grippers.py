"""Columns of grippers in datasets, which pass through a transfer by their time."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from maniport.datasets.columns import is_gripper
from maniport.datasets.joint_motion import JointMotion
from maniport.util.validation import Array


@dataclass(frozen=True, eq=False)
class Grippers:
    """Positions and commands of grippers over time, in the units of the dataset.

    Attributes
    ----------
    names : tuple of str
        Names of the k columns.
    units : tuple of str
        ``""`` where the dataset states none.
    time : ndarray, shape (n,)
        [s].
    positions, commands : ndarray, shape (n, k)
        Equal where the dataset has no commands.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    time: Array
    positions: Array
    commands: Array

    @classmethod
    def of(cls, motion: JointMotion, joints: Sequence[int] = ()) -> "Grippers | None":
        """Return the grippers among the columns of a motion, but for those of joints; None without any."""
        places = []
        for place, name in enumerate(motion.columns):
            if place not in joints and is_gripper(name):
                places.append(place)
        if not places:
            return None
        positions = motion.positions[:, places]
        names = tuple(motion.columns[place] for place in places)
        units = tuple(motion.units[place] for place in places)
        return cls(names, units, motion.time, positions, positions)

    def with_commands(self, motion: JointMotion) -> "Grippers":
        """Take the commands from a motion of the same times, where it has columns of the same names."""
        if motion.positions.shape[0] != len(self.time):
            return self
        commands = self.commands.copy()
        for column, name in enumerate(self.names):
            if name in motion.columns:
                commands[:, column] = motion.positions[:, motion.columns.index(name)]
        return replace(self, commands=commands)

    def retimed(self, before: Array, after: Array) -> "Grippers":
        """Move times along the increasing times before (m,) to those after (m,) [s]."""
        return replace(self, time=np.interp(self.time, before, after))

    def at(self, time: Array) -> "Grippers":
        """Return positions between those of the dataset, and the commands that hold, at times (m,) [s]."""
        positions = np.empty((len(time), len(self.names)))
        for column, values in enumerate(self.positions.T):
            positions[:, column] = np.interp(time, self.time, values)
        rows = np.searchsorted(self.time, time + 1e-9, side="right") - 1
        commands = self.commands[np.clip(rows, 0, len(self.time) - 1)]
        return replace(self, time=time, positions=positions, commands=commands)
