"""A motion of joints, of one arm or of several: where they are at the points of a path and at every control step."""

import csv
import os
from dataclasses import dataclass

import numpy as np

from maniport.util.atomic_io import written_whole
from maniport.util.notebook import ShownInNotebooks
from maniport.util.validation import Array

FORMULA = ("=", "+", "-", "@", "\t", "\r")
"""What a cell of a spreadsheet begins with that is calculated instead of shown."""


@dataclass(frozen=True)
class JointMotion(ShownInNotebooks):
    """A joint trajectory.

    Attributes
    ----------
    joint_names, joint_units : tuple of str
        Names, and ``"rad"`` or ``"m"``, of the degrees of freedom.
    time : ndarray, shape (n,)
        When the points of a path are passed [s].
    joint_positions : ndarray, shape (n, dof)
        [rad] or [m].
    control_time : ndarray, shape (m,)
        The times of the whole trajectory, as often as it was controlled [s].
    control_positions, control_velocities, control_accelerations : ndarray, shape (m, dof)
        The whole trajectory [rad] or [m], and those for each second and second².
    """

    joint_names: tuple[str, ...]
    joint_units: tuple[str, ...]
    time: Array
    joint_positions: Array
    control_time: Array
    control_positions: Array
    control_velocities: Array
    control_accelerations: Array

    @property
    def jerk(self) -> Array:
        """Third derivative of the joint positions over the control steps [rad/s³ or m/s³], shape (m - 3, dof)."""
        times, values = self.control_time, self.control_positions
        for _ in range(3):
            values = np.diff(values, axis=0) / np.diff(times)[:, None]
            times = 0.5 * (times[1:] + times[:-1])
        return np.asarray(values)

    @property
    def rms_jerk(self) -> float:
        """Root mean square of the jerk over time and joints; 0 for fewer than four control steps."""
        return float(np.sqrt(np.mean(self.jerk**2))) if len(self.control_time) > 3 else 0.0

    @property
    def peak_jerk(self) -> float:
        """Largest jerk of any joint at any time; 0 for fewer than four control steps."""
        return float(np.abs(self.jerk).max()) if len(self.control_time) > 3 else 0.0

    def save_joints_csv(self, path: str | os.PathLike[str]) -> None:
        """Write the control steps as text: a header, then a line for each, with seconds from 0.

        After the time come the positions of all joints (``NAME_rad`` or ``NAME_m``), their velocities (``NAME_rad/s``)
        and their accelerations (``NAME_rad/s2``). Names that a spreadsheet would take for a formula get an apostrophe.

        Raises
        ------
        OutputError
            When the file cannot be written.
        """
        units = [unit + per for per in ("", "/s", "/s2") for unit in self.joint_units]
        names = ["'" + name if name.startswith(FORMULA) else name for name in self.joint_names]
        header = ["time_s", *(f"{name}_{unit}" for name, unit in zip(3 * names, units, strict=True))]
        line = ",".join(["%.6f", *len(names) * ["%.12f"], *2 * len(names) * ["%.6f"]]) + "\n"
        times = self.control_time - self.control_time[0]
        columns = times, self.control_positions, self.control_velocities, self.control_accelerations
        with written_whole(path) as temporary, open(temporary, "w", encoding="utf-8", newline="") as stream:
            csv.writer(stream, lineterminator="\n").writerow(header)
            stream.write("".join([line % tuple(row) for row in np.column_stack(columns).tolist()]))

    def joint_arrays(self) -> dict[str, Array]:
        """What files hold of the joints, by name; times are counted from the first control step."""
        return {
            "joint_names": np.array(self.joint_names),
            "joint_units": np.array(self.joint_units),
            "began_at": self.control_time[0],
            "time": self.time - self.control_time[0],
            "joint_positions": self.joint_positions,
            "control_time": self.control_time - self.control_time[0],
            "control_positions": self.control_positions,
            "control_velocities": self.control_velocities,
            "control_accelerations": self.control_accelerations,
        }
