"""Joint trajectories, and how near they come to a collision."""

import csv
import os
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from maniport.arms import Arm
from maniport.arms.collisions import NO_SHAPES, CheckedShapes, Collisions
from maniport.arms.joint_space import JointSpace
from maniport.motion.motion_limits import MotionLimits
from maniport.util.atomic_io import written_whole
from maniport.util.files import spreadsheet_cell
from maniport.util.notebook import NotebookDisplay
from maniport.util.sampling import evenly_spaced
from maniport.util.validation import Array


@dataclass(frozen=True, eq=False)
class Trajectory(NotebookDisplay):
    """A joint trajectory, of one arm or of a group.

    Attributes
    ----------
    joint_names, joint_units : tuple of str
        Names of the degrees of freedom, and ``"rad"`` or ``"m"``.
    time : ndarray, shape (n,)
        Times at which the waypoints are passed [s].
    joint_positions : ndarray, shape (n, dof)
        Configurations at the waypoints [rad] or [m].
    control_time : ndarray, shape (m,)
        Times of the control steps [s].
    control_positions, control_velocities, control_accelerations : ndarray, shape (m, dof)
        At the control steps [rad] or [m], per second and per second².
    limits : MotionLimits or None
        Limits of a planned motion.
    """

    joint_names: tuple[str, ...]
    joint_units: tuple[str, ...]
    time: Array
    joint_positions: Array
    control_time: Array
    control_positions: Array
    control_velocities: Array
    control_accelerations: Array
    limits: MotionLimits | None = None

    @classmethod
    def of_positions(
        cls,
        joints: JointSpace,
        time: Array,
        control_time: Array,
        positions: Array,
        limits: MotionLimits | None = None,
    ) -> "Trajectory":
        """Make a trajectory of control steps, with central differences of the positions."""
        velocities = np.gradient(positions, control_time, axis=0)
        accelerations = np.zeros_like(positions)
        if len(control_time) > 2:  # at the ends those of the neighbors
            slopes = np.diff(positions, axis=0) / np.diff(control_time)[:, None]
            inside = (
                np.diff(slopes, axis=0) / (0.5 * (control_time[2:] - control_time[:-2]))[:, None]
            )
            accelerations = np.pad(inside, ((1, 1), (0, 0)), "edge")
        control = control_time, positions, velocities, accelerations
        waypoints = interpolated(control_time, positions, time)
        return Trajectory(joints.joint_names, joints.joint_units, time, waypoints, *control, limits)

    def of_arm(self, arm: Arm, columns: NDArray[np.integer]) -> "Trajectory":
        """Return the trajectory of one arm of a group, whose joints are some columns."""
        limits = None
        if self.limits is not None:
            limits = self.limits.of_joints(arm, columns)
        return replace(
            self,
            joint_names=arm.joint_names,
            joint_units=arm.joint_units,
            joint_positions=self.joint_positions[:, columns],
            control_positions=self.control_positions[:, columns],
            control_velocities=self.control_velocities[:, columns],
            control_accelerations=self.control_accelerations[:, columns],
            limits=limits,
        )

    @cached_property
    def limit_use(self) -> dict[str, tuple[str, float, float]] | None:
        """As `MotionLimits.use`; None without limits."""
        if self.limits is None:
            return None
        return self.limits.use(self.control_time, self.control_positions)

    @cached_property
    def control_torques(self) -> Array | None:
        """Torques [N m] or forces [N] at the control steps, shape (m, dof); None without limits or without masses."""
        if self.limits is None or self.limits.dynamics is None:
            return None
        states = self.control_positions, self.control_velocities, self.control_accelerations
        return self.limits.dynamics.torques(*states)

    @property
    def control_states(self) -> dict[str, tuple[Array, tuple[str, ...]]]:
        """Values (m, dof) and units at the control steps by name: position, velocity, acceleration, effort."""
        states = {
            "position": (self.control_positions, self.joint_units),
            "velocity": (self.control_velocities, tuple(f"{unit}/s" for unit in self.joint_units)),
            "acceleration": (
                self.control_accelerations,
                tuple(f"{unit}/s2" for unit in self.joint_units),
            ),
        }
        if self.control_torques is not None:
            states["effort"] = (
                self.control_torques,
                tuple({"rad": "Nm", "m": "N"}[unit] for unit in self.joint_units),
            )
        return states

    def save_joints_csv(self, path: str | os.PathLike[str]) -> None:
        """Write the control steps as a table with a header; the first column is the time from 0 [s].

        The other columns are positions of all joints (``NAME_rad`` or ``NAME_m``), their velocities (``NAME_rad/s``),
        accelerations (``NAME_rad/s2``) and, where masses are known, torques (``NAME_Nm``) or forces (``NAME_N``). An
        apostrophe precedes names that a spreadsheet would evaluate. `OutputError` when the file cannot be written.
        """
        states = self.control_states
        names = [*map(spreadsheet_cell, self.joint_names)]
        header = ["time_s"]
        for _, units in states.values():
            header += [f"{name}_{unit}" for name, unit in zip(names, units, strict=True)]
        positions = len(names) * ["%.12f"]
        others = (len(states) - 1) * len(names) * ["%.6f"]
        line = ",".join(["%.6f", *positions, *others]) + "\n"
        columns = [self.control_time - self.control_time[0]]
        for values, _ in states.values():
            columns.append(values)
        with (
            written_whole(path) as temporary,
            open(temporary, "w", encoding="utf-8", newline="") as stream,
        ):
            csv.writer(stream, lineterminator="\n").writerow(header)
            stream.write("".join([line % tuple(row) for row in np.column_stack(columns).tolist()]))

    def joint_arrays(self) -> dict[str, Array]:
        """Return the arrays that files contain, by name; times are from the first control step."""
        begin = self.control_time[0]
        arrays = {name: getattr(self, name) for name in ("joint_positions", *_CONTROL)}
        if self.control_torques is not None:
            arrays["control_torques"] = self.control_torques
        return arrays | {
            "joint_names": np.array(self.joint_names),
            "joint_units": np.array(self.joint_units),
            "began_at": begin,
            "time": self.time - begin,
            "control_time": self.control_time - begin,
        }


_CONTROL = ("control_positions", "control_velocities", "control_accelerations")


def interpolated(
    time: NDArray[np.floating | np.integer], values: Array, at: NDArray[np.floating | np.integer]
) -> Array:
    """Interpolate values (n, k) at times (n,) linearly, at other times (m,)."""
    return np.stack([np.interp(at, time, column) for column in values.T], axis=1)


@dataclass(frozen=True)
class Clearance:
    """Collisions of a motion, and its smallest distance from one.

    Attributes
    ----------
    checked, reason : bool and str
        Whether anything could be checked, and the reason where nothing was.
    share : float
        Share of the control steps that collide.
    distance, time : float
        Smallest distance [m], negative in a collision, and when [s].
    pair : tuple of two str
        The closest bodies.
    stand_ins : tuple of str
        Links drawn by their collision shapes, since visual meshes are missing.
    shapes : CheckedShapes
        Links by the kind of the shapes that are checked, and pairs that are not.
    """

    checked: bool = False
    reason: str = "collision checking was not requested"
    share: float = 0.0
    distance: float = np.inf
    time: float = 0.0
    pair: tuple[str, str] = ("", "")
    stand_ins: tuple[str, ...] = ()
    shapes: CheckedShapes = NO_SHAPES

    @classmethod
    def of(cls, collisions: Collisions | None, motion: Trajectory) -> "Clearance":
        """Check all control steps; measure distances at the waypoints and at control steps next to the closest."""
        if collisions is None or not collisions.checked:
            return cls(reason=cls.reason if collisions is None else collisions.reason)
        share = float(collisions.collides(motion.control_positions).mean())
        distance = collisions.clearance(motion.joint_positions)
        close = distance <= distance.min() + 0.01
        steps = np.flatnonzero(
            np.interp(motion.control_time, motion.time, close.astype(float)) > 0.0
        )
        steps = steps[evenly_spaced(len(steps), 1000)]
        configurations = np.concatenate(
            [motion.joint_positions[close], motion.control_positions[steps]]
        )
        time = np.append(motion.time[close], motion.control_time[steps])
        nearest = collisions.nearest(configurations)
        i = int(np.argmin(nearest.distance))
        pair = (str(nearest.first[i]), str(nearest.second[i]))
        return cls(
            True,
            "",
            share,
            float(nearest.distance[i]),
            float(time[i]),
            pair,
            collisions.stand_ins,
            collisions.shapes,
        )
