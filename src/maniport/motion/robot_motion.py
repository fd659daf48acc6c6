"""Motions of robots, and how well their arms follow the targets."""

import os
from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace

import numpy as np
from numpy.typing import NDArray

from maniport.arms import VELOCITY, Arm, ArmGroup, EllipsoidSpec
from maniport.arms.collisions import Collisions
from maniport.motion.problem import ArmProblem
from maniport.motion.status import ENOUGH_METRES, statuses_of
from maniport.motion.targets import Damping, TargetTrajectory, damping_of, speed_limits
from maniport.motion.trajectory import Clearance, Trajectory, interpolated
from maniport.spd.ellipsoid import axis_over_time, line_angles
from maniport.spd.regularization import Regularization
from maniport.util.defaults import DAMPING
from maniport.util.files import save_arrays
from maniport.util.notebook import NotebookDisplay
from maniport.util.plotting import Plottable
from maniport.util.validation import Array


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class ArmMotion(Trajectory, Plottable):
    """The trajectory of one arm, and how well it follows target ellipsoids and a path.

    `plan_motion` and `track` make it; `ArmMotion.of_motion` evaluates a trajectory from elsewhere.

    Attributes
    ----------
    joint_names, joint_units, time, joint_positions, control_*, limits
        As in `Trajectory`, of this arm's joints; the waypoints are those of the target ellipsoids.
    arm, frame : str
        Names of the arm and of its end effector.
    joint_velocities : ndarray, shape (n, dof)
        At the waypoints [rad/s] or [m/s].
    target, achieved : ndarray, shape (n, d, d)
        Ellipsoids, both without damping.
    spec : EllipsoidSpec
    damping : Regularization
        Its ε is added to the eigenvalues of both before they are compared.
    distance : ndarray, shape (n,)
        Affine-invariant distances with the damping; not comparable between different dampings.
    path : ndarray, shape (n, 3), or None
        Target positions of the end effector in the base frame [m].
    position_error, orientation_error : ndarray, shape (n,), or None
        Distances from them [m], and largest angles between a constrained axis of the end effector and its target [rad].
    position_tolerance : float
        Largest position error of a waypoint that counts as on the path [m].
    status : tuple of str
        The worst since the previous waypoint, one of `maniport.motion.status.Status`.
    held : ndarray of bool, shape (m,)
        Control steps at which not all limits could be satisfied, or the arm braked before a collision.
    velocity_limits : ndarray, shape (dof,)
        Infinite where none is available.
    demonstrated_time : ndarray, shape (n,), or None
        Demonstrated times of the waypoints of a planned motion [s].
    pointwise_best : ndarray, shape (n,), or None
        Distances of the pointwise optimum of a planned motion: the smallest found for each waypoint by itself, with the
        end effector on the path (at most 250 waypoints; its square is linear between them), or achieved by the motion.
    local_minimum : ndarray of bool, shape (n,), or None
        Waypoints at which a tracked motion without path and orientation is in a local minimum of the distance, more
        than 0.05 above the least one that is found; see `maniport.motion.track`. At most 16 waypoints are searched.
    clearance : Clearance
        Of a planned motion, together with all other arms.
    directed : bool
        Whether the motion shall be strong or fast along lines. The distance to ellipsoids then has no part in the
        status.
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
    demonstrated_time: Array | None = None
    pointwise_best: Array | None = None
    local_minimum: NDArray[np.bool_] | None = None
    clearance: Clearance = field(default_factory=Clearance)
    directed: bool = False

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
    ) -> "ArmMotion":
        """Evaluate a joint trajectory; arguments are those of the attributes and are not checked."""
        targets = TargetTrajectory(
            time=time,
            ellipsoids=target,
            spec=spec,
            damping=damping_of(arm, spec, damping),
            positions=path,
        )
        trajectory = Trajectory.of_positions(arm, time, control_time, control_positions)
        return cls.of(ArmProblem.of(arm, targets), trajectory, speed_limits(arm, None))

    @classmethod
    def of(
        cls,
        problem: ArmProblem,
        trajectory: Trajectory,
        velocity_limits: Array,
        held: NDArray[np.bool_] | None = None,
        position_tolerance: float = ENOUGH_METRES,
        demonstrated_time: Array | None = None,
        clearance: Clearance | None = None,
    ) -> "ArmMotion":
        """Compare the trajectory of an arm with its targets.

        `demonstrated_time` and `clearance` are attributes of a planned motion.
        """
        arm = problem.arm
        target = problem.target
        q = trajectory.joint_positions
        error = problem.position_error(q)
        distance = problem.distance(q)
        time = trajectory.control_time
        positions = trajectory.control_positions
        near_stop = 1e-3  # [rad or m]
        near_speed = 0.999 * velocity_limits
        stopped = np.zeros(len(time), bool) if held is None else held
        ends = (positions <= arm.lower + near_stop) | (positions >= arm.upper - near_stop)
        fast = np.abs(np.diff(positions, axis=0) / np.diff(time)[:, None]) >= near_speed
        if error is None:
            off_path = np.zeros(len(q), bool)
        else:
            off_path = np.asarray(error > position_tolerance)
        judged = distance
        if target.directions:
            judged = np.zeros(len(distance))
        if clearance is None:
            clearance = Clearance()
        at_limit = np.asarray(ends.any(axis=1))
        at_speed = np.append(False, fast.any(axis=1))
        return cls(
            **{item.name: getattr(trajectory, item.name) for item in fields(Trajectory)},
            arm=arm.name,
            frame=arm.frame,
            joint_velocities=interpolated(time, trajectory.control_velocities, trajectory.time),
            target=target.ellipsoids,
            achieved=arm.ellipsoids(q, target.spec),
            spec=target.spec,
            damping=target.damping,
            distance=distance,
            path=target.positions,
            position_error=error,
            orientation_error=problem.orientation_error(q),
            position_tolerance=position_tolerance,
            status=statuses_of(
                trajectory.time, judged, off_path, time, stopped, at_limit, at_speed
            ),
            held=stopped,
            velocity_limits=velocity_limits,
            directed=bool(target.directions),
            demonstrated_time=demonstrated_time,
            clearance=clearance,
        )

    def __repr__(self) -> str:
        error = self.position_error
        if error is None:
            position = ""
        else:
            position = f", position error {1e3 * np.median(error):.2f} mm"
        return (
            f"{type(self).__name__}({self.arm!r}, {len(self.time)} waypoints in {self.time[-1] - self.time[0]:.2f} s, "
            f"distance {np.median(self.distance):.3f}{position} (medians))"
        )

    @property
    def major_axis_angle(self) -> Array:
        """Angle between the longest axes of target and achieved ellipsoids, shape (n,) [rad], at most π/2.

        It is nan where the two longest semi-axes of either are nearly equal, so that their direction is arbitrary.
        """
        return self.axis_angle(-1)

    def axis_angle(self, which: int) -> Array:
        """Angle between the longest (-1) or shortest (0) axes, as `major_axis_angle`."""
        target = axis_over_time(self.target, which)
        achieved = axis_over_time(self.achieved, which)
        return line_angles(target, achieved)

    @property
    def pointwise_ratio(self) -> float:
        """Ratio of the root mean square distance to that of the best pointwise solutions found, at least 1."""
        assert self.pointwise_best is not None
        return rms_ratio(self.distance, self.pointwise_best)

    def save_joints(self, path: str | os.PathLike[str], spec: EllipsoidSpec | None = None) -> None:
        """Write an ``.npz`` file without pickled objects.

        For the control steps ``control_time``, ``control_positions``, ``control_velocities``, ``control_accelerations``
        and, where masses are known, ``control_torques``; for the waypoints ``time``, ``joint_positions``,
        ``joint_velocities``, ``manipulability``, ``distance``, ``status`` and, where there was a path,
        ``position_error``; ``joint_names``, ``joint_units`` and ``damping``. Times are counted from the first control
        step, which was at ``began_at`` [s]. The achieved ellipsoids are readable as an ellipsoid file. They are those
        of `spec`, by default of the motion's. A plan for force ellipsoids has their inverses: ``damping`` is added to
        the ellipsoids of the plan. `OutputError` when the file cannot be written.
        """
        arrays = self.joint_arrays()
        arrays["joint_velocities"] = self.joint_velocities
        arrays |= self.error_arrays(spec)
        save_arrays(path, arrays, compress=False)  # numbers that hardly get smaller

    def error_arrays(self, spec: EllipsoidSpec | None = None) -> dict[str, Array]:
        """Return the arrays of the ellipsoids and errors that files contain, by name; `spec` as in `save_joints`."""
        achieved = self.achieved if spec is None else spec.of_bounded(self.achieved)
        arrays = {
            "manipulability": achieved,
            "distance": self.distance,
            "damping": np.array(self.damping.epsilon),
            "status": np.array(self.status),
        }
        if self.position_error is None:
            return arrays
        return arrays | {"position_error": self.position_error}


def rms_ratio(distance: Array, best: Array) -> float:
    """Return the ratio of two root mean squares; infinite where only the second is zero."""
    norm = float(np.linalg.norm(best))
    if np.array_equal(distance, best):
        return 1.0
    if norm > 0.0:
        return float(np.linalg.norm(distance)) / norm
    return np.inf


@dataclass(frozen=True, eq=False, repr=False)
class RobotMotion(NotebookDisplay, Plottable):
    """The motion of one or several arms; made by `plan_motion` and `track`.

    Attributes
    ----------
    group : ArmGroup
        With the margin of the limits.
    trajectory : Trajectory
        Of all joints.
    arms : tuple of ArmMotion
        The same motion of each arm, and its errors.
    coupled : bool
        Whether several arms were optimized together, since they share joints or costs, or come near one another.
    relative, relative_error : ndarray, shapes (n, n_arms - 1, 3) and (n, n_arms - 1), or None
        Target vectors from the first end effector to the others in the base frame, and distances from them [m], where
        only these were kept (``hand_targets="relative"``).
    """

    group: ArmGroup
    trajectory: Trajectory
    arms: tuple[ArmMotion, ...]
    coupled: bool = False
    relative: Array | None = None
    relative_error: Array | None = None

    @classmethod
    def of(
        cls,
        group: ArmGroup,
        problems: Sequence[ArmProblem],
        trajectory: Trajectory,
        collisions: Collisions | None,
        velocity_limits: Array,
        held: NDArray[np.bool_] | None = None,
        position_tolerance: float = ENOUGH_METRES,
        pointwise_bests: Sequence[Array] | None = None,
        coupled: bool = False,
    ) -> "RobotMotion":
        """Compare the trajectory of a group with the targets of its arms."""
        clearance = Clearance.of(collisions, trajectory)
        arms = []
        for i, (problem, columns) in enumerate(zip(problems, group.columns, strict=True)):
            demonstrated_time = None
            if trajectory.limits is not None:
                demonstrated_time = problem.target.time
            motion = ArmMotion.of(
                problem,
                trajectory.of_arm(problem.arm, columns),
                velocity_limits[columns],
                held,
                position_tolerance,
                demonstrated_time,
                clearance,
            )
            if pointwise_bests is not None:  # the achieved configuration is a candidate
                best = np.minimum(pointwise_bests[i], motion.distance)
                motion = replace(motion, pointwise_best=best)
            arms.append(motion)
        return cls(group, trajectory, tuple(arms), coupled=coupled)

    def __repr__(self) -> str:
        return f"RobotMotion({', '.join(map(repr, self.arms))})"

    @property
    def clearance(self) -> Clearance:
        """Collisions and clearance of all arms, with each other and their surroundings."""
        return self.arms[0].clearance

    @property
    def pointwise_ratio(self) -> float:
        """Ratio of the root mean square distance of all arms to that of the best pointwise solutions, at least 1."""
        best = [arm.pointwise_best for arm in self.arms if arm.pointwise_best is not None]
        return rms_ratio(np.concatenate([arm.distance for arm in self.arms]), np.concatenate(best))

    def save_joints(self, path: str | os.PathLike[str], spec: EllipsoidSpec | None = None) -> None:
        """Write an ``.npz`` file without pickled objects; `spec` as in `ArmMotion.save_joints`.

        One arm: see `ArmMotion.save_joints`. Several: the arrays of the joints, ``manipulability``, ``distance``,
        ``status``, ``damping`` and ``position_error`` of each arm with its name as a prefix, such as ``left_distance``,
        and ``relative`` and ``relative_error`` where only these were kept.
        """
        if len(self.arms) == 1:
            self.arms[0].save_joints(path, spec)
            return
        arrays = self.trajectory.joint_arrays()
        for name, arm in zip(self.group.names, self.arms, strict=True):
            for key, array in arm.error_arrays(spec).items():
                arrays[f"{name}_{key}"] = array
        if self.relative is not None and self.relative_error is not None:
            arrays |= {"relative": self.relative, "relative_error": self.relative_error}
        save_arrays(path, arrays)
