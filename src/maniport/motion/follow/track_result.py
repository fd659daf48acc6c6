"""What became of a target motion: the joint trajectory, how near it comes, and where and why it does not."""

import os
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from maniport.arms import VELOCITY, Arm, EllipsoidSpec
from maniport.motion.follow.joint_motion import JointMotion
from maniport.motion.follow.status import ENOUGH_METRES, NEAR_SPEED, NEAR_STOP, statuses_of
from maniport.motion.objective import Damping, Objective
from maniport.motion.schedule import speed_limits
from maniport.spd.ellipsoid import axis_over_time, lengths, line_angles
from maniport.spd.regularization import Regularization
from maniport.util.defaults import DAMPING
from maniport.util.files import save_arrays
from maniport.util.validation import Array


@dataclass(frozen=True)
class TrackResult(JointMotion):
    """A joint trajectory and how well it follows target ellipsoids and a target path.

    Make one with `maniport.motion.track`, or `TrackResult.of_motion` for a trajectory from elsewhere.

    Attributes
    ----------
    joint_names, joint_units, time, joint_positions, control_*
        As in `JointMotion`; the times are those of the target ellipsoids.
    arm, frame : str
        Names of the arm and of its end effector.
    joint_velocities : ndarray, shape (n, dof)
        At the times of the target ellipsoids [rad/s] or [m/s].
    target, achieved : ndarray, shape (n, d, d)
        Target and achieved ellipsoids, both without damping.
    spec : EllipsoidSpec
        Which ellipsoids.
    damping : Regularization
        Its ε is added to the eigenvalues of both before they are compared.
    distance : ndarray, shape (n,)
        Affine-invariant distances with the damping; not comparable between different dampings.
    path : ndarray, shape (n, 3), or None
        Target positions of the end effector in the base frame [m].
    position_error : ndarray, shape (n,), or None
        Distances from them [m].
    orientation_error : ndarray, shape (n,), or None
        Largest angle between an axis of the end effector that counts and its target [rad].
    position_tolerance : float
        Position error up to which a point counts as on the path [m].
    status : tuple of str
        For each time the worst since the time before, one of `maniport.motion.follow.status.STATUSES`.
    held : ndarray, shape (m,)
        At which control steps the quadratic program failed and the arm was brought to rest, bool.
    velocity_limits : ndarray, shape (dof,)
        Infinite where none is known.
    position_limit_hits, velocity_limit_hits : dict of str to int
        Number of control steps at a limit, by joint; joints without hits are left out.
    """

    arm: str
    frame: str
    joint_velocities: Array
    target: Array
    achieved: Array
    spec: EllipsoidSpec
    damping: Regularization
    distance: Array
    path: Array | None
    position_error: Array | None
    orientation_error: Array | None
    position_tolerance: float
    status: tuple[str, ...]
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
        position_tolerance: float = ENOUGH_METRES,
    ) -> "TrackResult":
        """Evaluate a joint trajectory; arguments are those of the attributes and are not checked.

        Velocities and accelerations are differences of the positions by default, velocity limits those of the arm.
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
            position_tolerance=position_tolerance,
            status=statuses_of(time, distance, error, control_time, stopped, ends, fast, position_tolerance),
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
        """Angle between the longest axes of target and achieved ellipsoids, shape (n,) [rad], at most π/2.

        It is nan where the two longest semi-axes of either are nearly equal, so that their direction is arbitrary.
        """
        target, achieved = axis_over_time(self.target, -1), axis_over_time(self.achieved, -1)
        return line_angles(target, achieved)

    @property
    def semi_axis_ratio(self) -> Array:
        """Semi-axes achieved over those of the target, shape (n, d), shortest first; infinite where that is flat."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(lengths(self.achieved) / lengths(self.target))

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
            **self.joint_arrays(),
            "joint_velocities": self.joint_velocities,
            "manipulability": self.achieved,
            "distance": self.distance,
            "damping": np.array(self.damping.epsilon),
            "status": np.array(self.status),
        }
        if self.position_error is not None:
            arrays["position_error"] = self.position_error
        save_arrays(path, arrays, compress=False)  # numbers that hardly get smaller


def in_words(motion: TrackResult) -> str:
    """How near an arm came, in a line: the largest beside what most points have."""
    found = (
        f"distance of the ellipsoids {np.median(motion.distance):.2f} (median), {motion.distance.max():.2f} (largest)"
    )
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
