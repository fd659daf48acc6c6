"""What became of a target motion: the joint trajectory, how near it comes, and where and why it does not."""

import csv
import os
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from maniport.bodies import VELOCITY, Arm, EllipsoidSpec
from maniport.defaults import DAMPING
from maniport.files import save_arrays, written_whole
from maniport.notebook import ShownInNotebooks
from maniport.spd.ellipsoid import axes, lengths, line_angles
from maniport.spd.regularization import Regularization
from maniport.tracking.follow.status import ENOUGH_METRES, NEAR_SPEED, NEAR_STOP, statuses_of
from maniport.tracking.objective import Damping, Objective
from maniport.tracking.schedule import speed_limits
from maniport.validation import Array

FORMULA = ("=", "+", "-", "@", "\t", "\r")
"""What a cell of a spreadsheet begins with that is calculated instead of shown."""


@dataclass(frozen=True)
class TrackResult(ShownInNotebooks):
    """A joint trajectory and how well it follows target ellipsoids and a target path.

    Make one with `maniport.tracking.track`, or `TrackResult.of_motion` for a trajectory from elsewhere.

    Attributes
    ----------
    arm : str
        Name of the arm.
    frame : str
        Name of its tip.
    joint_names, joint_units : tuple of str
        Names, and ``"rad"`` or ``"m"``, of the degrees of freedom.
    time : ndarray, shape (n,)
        Of the target ellipsoids [s].
    joint_positions, joint_velocities : ndarray, shape (n, dof)
        [rad] or [m], and those for each second.
    target, achieved : ndarray, shape (n, d, d)
        Ellipsoids that were asked for and those that the arm makes, both without damping.
    spec : EllipsoidSpec
        Which ellipsoids.
    damping : Regularization
        Its ε is added to the eigenvalues of both before they are compared.
    distance : ndarray, shape (n,)
        Affine-invariant distance of target and achieved ellipsoids with the damping. Distances with different damping
        are not comparable.
    path : ndarray, shape (n, 3), or None
        Target positions of the tip in the base frame [m].
    position_error : ndarray, shape (n,), or None
        Distance of the tip from them [m].
    orientation_error : ndarray, shape (n,), or None
        Largest angle between an axis of the tip that counts and where it was to point [rad]; None where none does.
    tip_tolerance : float
        How far beside its path the tip counts as on it [m].
    status : tuple of str
        For each time the worst since the time before, one of `maniport.tracking.follow.status.STATUSES`.
    control_time : ndarray, shape (m,)
        The times of the whole trajectory, as often as it was controlled [s].
    control_positions, control_velocities, control_accelerations : ndarray, shape (m, dof)
        The whole trajectory [rad] or [m], and those for each second and second².
    held : ndarray, shape (m,)
        At which control steps no answer was found and the arm was brought to rest, bool.
    velocity_limits : ndarray, shape (dof,)
        Those that were kept; infinite where none is known.
    position_limit_hits, velocity_limit_hits : dict of str to int
        Number of control steps at a limit, by joint; joints without hits are left out.
    """

    arm: str
    frame: str
    joint_names: tuple[str, ...]
    joint_units: tuple[str, ...]
    time: Array
    joint_positions: Array
    joint_velocities: Array
    target: Array
    achieved: Array
    spec: EllipsoidSpec
    damping: Regularization
    distance: Array
    path: Array | None
    position_error: Array | None
    orientation_error: Array | None
    tip_tolerance: float
    status: tuple[str, ...]
    control_time: Array
    control_positions: Array
    control_velocities: Array
    control_accelerations: Array
    held: NDArray[np.bool_]
    velocity_limits: Array
    position_limit_hits: dict[str, int]
    velocity_limit_hits: dict[str, int]

    @classmethod
    def of_motion(
        cls,
        arm: Arm,
        time: Array,
        target: Array,
        control_time: Array,
        control_positions: Array,
        *,
        spec: EllipsoidSpec = VELOCITY,
        damping: Damping = DAMPING,
        path: Array | None = None,
        velocity_limits: Array | None = None,
        held: NDArray[np.bool_] | None = None,
        control_velocities: Array | None = None,
        control_accelerations: Array | None = None,
        tip_tolerance: float = ENOUGH_METRES,
    ) -> "TrackResult":
        """Judge a joint trajectory; arguments are those of the attributes and are not checked.

        Parameters
        ----------
        damping : float, Regularization or None
            As in `maniport.tracking.track`.
        velocity_limits : ndarray, shape (dof,), optional
            Those of the arm by default.
        control_velocities, control_accelerations : ndarray, shape (m, dof), optional
            Differences of the positions by default.
        """
        speeds = speed_limits(arm, velocity_limits)
        stopped = np.zeros(len(control_time), bool) if held is None else held
        q = _at(time, control_time, control_positions)
        objective = Objective.of(arm, spec, damping)
        targets = objective.targets(target, path)
        distance, error = targets.distance(q), targets.tip_error(q)
        velocities, accelerations = control_velocities, control_accelerations
        if velocities is None:
            velocities = np.gradient(control_positions, control_time, axis=0)
        if accelerations is None:
            accelerations = _second_differences(control_time, control_positions)
        moves = np.diff(control_positions, axis=0)
        fast = np.abs(moves / np.diff(control_time)[:, None]) >= NEAR_SPEED * speeds
        ends = (control_positions <= arm.lower + NEAR_STOP) | (control_positions >= arm.upper - NEAR_STOP)
        return cls(
            arm=arm.name,
            frame=arm.frame,
            joint_names=arm.joint_names,
            joint_units=arm.joint_units,
            time=time,
            joint_positions=q,
            joint_velocities=_at(time, control_time, velocities),
            target=target,
            achieved=arm.ellipsoids(q, spec),
            spec=spec,
            damping=objective.damping,
            distance=distance,
            path=path,
            position_error=error,
            orientation_error=None,
            tip_tolerance=tip_tolerance,
            status=statuses_of(time, distance, error, control_time, stopped, ends, fast, tip_tolerance),
            control_time=control_time,
            control_positions=control_positions,
            control_velocities=velocities,
            control_accelerations=accelerations,
            held=stopped,
            velocity_limits=speeds,
            position_limit_hits=_hits(arm.joint_names, ends),
            velocity_limit_hits=_hits(arm.joint_names, fast),
        )

    def __repr__(self) -> str:
        error = self.position_error
        beside = "" if error is None else f", tip {1e3 * np.median(error):.2f} mm off"
        return (
            f"{type(self).__name__}({self.arm!r}, {len(self.time)} points in {self.time[-1] - self.time[0]:.2f} s at a "
            f"distance of {np.median(self.distance):.3f}{beside} (medians))"
        )

    @property
    def major_axis_angle(self) -> Array:
        """Angle between the major axes of target and achieved ellipsoids, shape (n,) [rad], at most π/2."""
        (_, target), (_, achieved) = axes(self.target), axes(self.achieved)
        return line_angles(target[..., -1], achieved[..., -1])

    @property
    def semi_axis_ratio(self) -> Array:
        """Semi-axes achieved over those of the target, shape (n, d), shortest first; infinite where that is flat."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(lengths(self.achieved) / lengths(self.target))

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

        After the time come the positions of all joints (``NAME_rad`` or ``NAME_m``), then their velocities
        (``NAME_rad/s``), then their accelerations (``NAME_rad/s2``). Positions have so many decimals that third
        differences at 1000 Hz are true to 0.01 rad/s³. A name that a spreadsheet would take for a formula is written
        behind an apostrophe.

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
            stream.writelines(line % tuple(row) for row in np.column_stack(columns).tolist())

    def save_joints(self, path: str | os.PathLike[str]) -> None:
        """Write an ``.npz`` file without pickled objects.

        For the control steps ``control_time``, ``control_positions``, ``control_velocities`` and
        ``control_accelerations``; for the times of the profile ``time``, ``joint_positions``, ``joint_velocities``,
        ``manipulability``, ``distance``, ``status`` and, where there was a path, ``position_error``; ``joint_names``,
        ``joint_units`` and ``damping``. Times are counted from the first control step, which was at ``began_at`` [s].
        The achieved ellipsoids are readable as an ellipsoid file.

        Raises
        ------
        OutputError
            When the file cannot be written.
        """
        arrays = {
            "joint_names": np.array(self.joint_names),
            "joint_units": np.array(self.joint_units),
            "began_at": self.control_time[0],
            "time": self.time - self.control_time[0],
            "joint_positions": self.joint_positions,
            "joint_velocities": self.joint_velocities,
            "manipulability": self.achieved,
            "distance": self.distance,
            "damping": np.array(self.damping.epsilon),
            "status": np.array(self.status),
            "control_time": self.control_time - self.control_time[0],
            "control_positions": self.control_positions,
            "control_velocities": self.control_velocities,
            "control_accelerations": self.control_accelerations,
        }
        if self.position_error is not None:
            arrays["position_error"] = self.position_error
        save_arrays(path, arrays)


def in_words(motion: TrackResult) -> str:
    """How near an arm came, in a line: the largest and when beside what most points have."""
    far = int(np.argmax(motion.distance))
    most = f"{motion.distance[far]:.2f} (largest, at {motion.time[far]:.1f} s)"
    found = f"distance of the ellipsoids {np.median(motion.distance):.2f} (median), {most}"
    if motion.position_error is None:
        return found
    error = 1e3 * motion.position_error
    return f"{found}, tip {np.percentile(error, 95):.2f} mm beside its path (95 %), {error.max():.2f} mm (largest)"


def _at(time: Array, control_time: Array, values: Array) -> Array:
    """Interpolate linearly, which keeps joint limits."""
    return np.stack([np.interp(time, control_time, column) for column in values.T], axis=1)


def _second_differences(time: Array, values: Array) -> Array:
    """Second derivative at each time, shape (m, dof); at the ends as beside them, zero for fewer than three times."""
    if len(time) < 3:
        return np.zeros_like(values)
    slopes = np.diff(values, axis=0) / np.diff(time)[:, None]
    inside = np.diff(slopes, axis=0) / (0.5 * (time[2:] - time[:-2]))[:, None]
    return np.concatenate([inside[:1], inside, inside[-1:]])


def _hits(names: tuple[str, ...], touched: NDArray[np.bool_]) -> dict[str, int]:
    return {name: int(count) for name, count in zip(names, touched.sum(axis=0), strict=True) if count}
