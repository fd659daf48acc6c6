"""What became of a target motion: the joint trajectory, how near it comes, and where and why it does not."""

import os
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from maniport.bodies import VELOCITY, Arm, EllipsoidSpec
from maniport.files import save_arrays, written_whole
from maniport.notebook import ShownInNotebooks
from maniport.spd.regularization import Regularization
from maniport.tracking.objective import DAMPING, Damping, Objective
from maniport.tracking.schedule import speed_limits
from maniport.validation import Array

FOLLOWED = "followed"
ELLIPSOID, PATH = "ellipsoid out of reach", "path out of reach"
JOINT_LIMIT, VELOCITY_LIMIT = "joint limit", "velocity limit"
HELD = "QP failed: held last safe configuration"
STATUSES = (FOLLOWED, ELLIPSOID, PATH, JOINT_LIMIT, VELOCITY_LIMIT, HELD)
"""All statuses, from good to bad.

A time is followed when d ≤ 0.1 and, with a path, the tip is within 1 mm. Where it is not and a joint has come to a
velocity or joint limit since the time before, that is the status; otherwise what is out of reach from there, with the
position going first. Ellipsoid and position together ask more of a 7-joint arm than it has: with a path, an
ellipsoid "out of reach" may well be one that the arm can make elsewhere.
"""

ENOUGH_DISTANCE = 0.1
ENOUGH_METRES = 1e-3
NEAR_STOP = 1e-3
"""How close to a position limit counts as there [rad or m]."""
NEAR_SPEED = 0.999
"""Share of a velocity limit that counts as there."""


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
    status : tuple of str
        For each time the worst since the time before, one of `STATUSES`.
    control_time, control_positions : ndarray, shapes (m,) and (m, dof)
        The whole trajectory, as often as it was controlled; it starts and ends with `time`.
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
    status: tuple[str, ...]
    control_time: Array
    control_positions: Array
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
    ) -> "TrackResult":
        """Judge a joint trajectory; arguments are those of the attributes and are not checked.

        Parameters
        ----------
        damping : float, Regularization or None
            As in `maniport.tracking.track`.
        velocity_limits : ndarray, shape (dof,), optional
            Those of the arm by default.
        """
        speeds = speed_limits(arm, velocity_limits)
        stopped = np.zeros(len(control_time), bool) if held is None else held
        q = _at(time, control_time, control_positions)
        objective = Objective.of(arm, spec, damping)
        targets = objective.targets(target, path)
        distance, error = targets.distance(q), targets.tip_error(q)
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
            joint_velocities=_at(time, control_time, np.gradient(control_positions, control_time, axis=0)),
            target=target,
            achieved=arm.ellipsoids(q, spec),
            spec=spec,
            damping=objective.damping,
            distance=distance,
            path=path,
            position_error=error,
            status=_status(time, distance, error, control_time, stopped, ends, fast),
            control_time=control_time,
            control_positions=control_positions,
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

    def save_joints_csv(self, path: str | os.PathLike[str], at_control_rate: bool = False) -> None:
        """Write the joint positions as text: a header, then a line for each time, in seconds and radians (or metres).

        Parameters
        ----------
        path : str or path
        at_control_rate : bool
            Write the control steps instead of the times of the profile.

        Raises
        ------
        OutputError
            When the file cannot be written.
        """
        header = ["time_s", *(f"{n}_{unit}" for n, unit in zip(self.joint_names, self.joint_units, strict=True))]
        times = self.control_time if at_control_rate else self.time
        rows = self.control_positions if at_control_rate else self.joint_positions
        with written_whole(path) as temporary, open(temporary, "w", encoding="utf-8") as stream:
            stream.write(",".join(header) + "\n")
            for t, row in zip(times, rows, strict=True):
                stream.write(",".join([f"{t:.6f}", *(f"{value:.9f}" for value in row)]) + "\n")

    def save_joints(self, path: str | os.PathLike[str]) -> None:
        """Write ``joint_names``, ``time``, ``joint_positions``, ``joint_velocities``, ``manipulability`` and more.

        An ``.npz`` file without pickled objects; also ``control_time`` and ``control_positions``, ``distance`` and,
        where there was a path, ``position_error``. The achieved ellipsoids are readable as an ellipsoid file.

        Raises
        ------
        OutputError
            When the file cannot be written.
        """
        arrays = {
            "joint_names": np.array(self.joint_names),
            "joint_units": np.array(self.joint_units),
            "time": self.time,
            "joint_positions": self.joint_positions,
            "joint_velocities": self.joint_velocities,
            "manipulability": self.achieved,
            "distance": self.distance,
            "damping": np.array(self.damping.epsilon),
            "status": np.array(self.status),
            "control_time": self.control_time,
            "control_positions": self.control_positions,
        }
        if self.position_error is not None:
            arrays["position_error"] = self.position_error
        save_arrays(path, arrays)


def _at(time: Array, control_time: Array, values: Array) -> Array:
    """Interpolate linearly, which keeps joint limits."""
    return np.stack([np.interp(time, control_time, column) for column in values.T], axis=1)


def _hits(names: tuple[str, ...], touched: NDArray[np.bool_]) -> dict[str, int]:
    return {name: int(count) for name, count in zip(names, touched.sum(axis=0), strict=True) if count}


def _status(
    time: Array,
    distance: Array,
    position_error: Array | None,
    control_time: Array,
    held: NDArray[np.bool_],
    stops: NDArray[np.bool_],
    speeding: NDArray[np.bool_],
) -> tuple[str, ...]:
    """One of `STATUSES` for each time; `stops` (m, dof) and `speeding` (m - 1, dof): joints at their limits."""
    off_path = np.zeros(len(time), bool) if position_error is None else np.asarray(position_error > ENOUGH_METRES)
    words = np.full(len(time), FOLLOWED, dtype=object)
    words[distance > ENOUGH_DISTANCE] = ELLIPSOID
    words[off_path] = PATH
    missed = np.asarray((distance > ENOUGH_DISTANCE) | off_path)
    words[missed & _since_last(np.asarray(stops.any(axis=1)), control_time, time)] = JOINT_LIMIT
    moving = np.concatenate([[False], speeding.any(axis=1)])
    words[missed & _since_last(moving, control_time, time)] = VELOCITY_LIMIT
    words[_since_last(held, control_time, time)] = HELD
    return tuple(words)


def _since_last(happened: NDArray[np.bool_], control_time: Array, time: Array) -> NDArray[np.bool_]:
    """Whether something happened at a control step after the time before and until each time, shape (n,)."""
    slack = 1e-9 * (control_time[-1] - control_time[0])
    ends = np.searchsorted(control_time, time + slack, side="right")
    ends[-1] = len(control_time)
    total = np.concatenate([[0], np.cumsum(happened)])
    before = np.concatenate([[0], total[ends][:-1]])
    return np.asarray(total[ends] > before)
