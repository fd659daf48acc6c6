"""A result as an episode of a LeRobot dataset, and the episodes of a batch as one dataset for each robot."""

import warnings
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from maniport.datasets.lerobot import STATE, Episode, Feature, LeRobotWriter
from maniport.datasets.lerobot.layout import ACTION, ENVIRONMENT, OWN_FILES
from maniport.datasets.lerobot.reader import read_episodes
from maniport.errors import ManiportWarning
from maniport.motion import ArmMotion
from maniport.motion.trajectory import interpolated
from maniport.pipeline.results import ArmResult, MotionResult, TransferResult
from maniport.report.values import Report, listed
from maniport.spd import logm
from maniport.util.atomic_io import folder_written_whole
from maniport.util.validation import Array

FPS = 50  # of datasets [Hz]: usual rates of policies are 30 and 50 Hz
AXES = "xyz"
TURNS = ("wx", "wy", "wz")
RED = "red"


def write_dataset(folder: Path, result: MotionResult, report: Report) -> None:
    """Write the motion of a result as a dataset of one episode; a red result is left out, with a warning."""
    if report.status == RED:
        kinds = listed(report.warning_keys)
        text = f"no LeRobot dataset was written: the motion must not be executed ({kinds})"
        warnings.warn(text, ManiportWarning, stacklevel=3)
        return
    episode, features = episode_of(result, report)
    folder.mkdir(exist_ok=True)
    with LeRobotWriter(folder, features, FPS, result.robot.name) as writer:
        writer.add(episode)


@dataclass(frozen=True)
class Source:
    """A motion of a batch: its name and the folder of its dataset, or the reason why it has none."""

    name: str
    folder: Path | None
    reason: str = ""


def write_joint_dataset(folder: Path, sources: Iterable[Source]) -> int:
    """Write the episodes of a batch for one robot as one dataset, whole or not at all; return their number.

    An earlier dataset is replaced. Nothing is written without any episode.
    """
    listed_sources = list(sources)
    present = [source for source in listed_sources if source.folder is not None]
    if not present:
        return 0
    assert present[0].folder is not None
    first = read_episodes(present[0].folder)
    folder.parent.mkdir(parents=True, exist_ok=True)
    with (
        folder_written_whole(folder, OWN_FILES, True) as staging,
        LeRobotWriter(staging, first.features, first.fps, first.robot_type) as writer,
    ):
        for source in listed_sources:
            if source.folder is None:
                writer.leave_out(source.name, source.reason)
                continue
            for episode in read_episodes(source.folder).episodes:
                writer.add(episode)
    return len(present)


def episode_of(result: MotionResult, report: Report) -> tuple[Episode, tuple[Feature, ...]]:
    """Return the motion of a result at 50 Hz as an episode, and its features.

    The state is the joint positions, the action those of the next frame. The environment state is the target position
    of each end effector, its position where there is none, and the logarithm of the target ellipsoid with damping.
    Pose of the end effectors, velocities, torques, achieved ellipsoids and errors are further columns.
    """
    motion = result.motion
    assert motion is not None
    trajectory = motion.trajectory
    begin = trajectory.control_time[0]
    count = int(np.floor((trajectory.control_time[-1] - begin) * FPS + 1e-6)) + 1
    time = begin + np.arange(max(count, 2)) / FPS
    time = np.minimum(time, trajectory.control_time[-1])

    joints = trajectory.joint_names
    units = trajectory.joint_units
    positions = interpolated(trajectory.control_time, trajectory.control_positions, time)
    velocities = interpolated(trajectory.control_time, trajectory.control_velocities, time)
    following = np.concatenate([positions[1:], positions[-1:]])
    names = tuple(f"{name}.pos" for name in joints)
    state = positions
    action = following
    state_names = names
    state_units = units
    if result.grippers is not None:
        grippers = result.grippers.at(time)
        state = np.column_stack([positions, grippers.positions])
        action = np.column_stack([following, grippers.commands])
        state_names = (*names, *grippers.names)
        state_units = (*units, *grippers.units)
    columns = [
        (Feature(STATE, state_names, state_units), state),
        (Feature(ACTION, state_names, state_units), action),
    ]

    targets = []
    poses = []
    ellipsoids = []
    errors = []
    prefixes = _prefixes(result)
    of_arms = zip(result.arms, prefixes, result.robot.split(positions), strict=True)
    for arm, prefix, joint_positions in of_arms:
        assert arm.motion is not None
        hand_poses = arm.robot.forward(joint_positions)
        targets.append(_target(arm, arm.motion, prefix, time, hand_poses[:, :3, 3]))
        poses.append(_poses(hand_poses, prefix))
        bounded = arm.robot.ellipsoids(joint_positions, arm.spec.bounded)
        ellipsoids.append(_ellipsoids(arm.spec.of_bounded(bounded), prefix))
        errors.append(_errors(arm.motion, prefix, time))

    columns.append(_joined(ENVIRONMENT, targets))
    columns.append(_joined("ee_pose", poses))
    velocity_units = tuple(f"{unit}/s" for unit in units)
    velocity_names = tuple(f"{name}.vel" for name in joints)
    columns.append((Feature("velocity", velocity_names, velocity_units), velocities))
    if trajectory.control_torques is not None:
        torques = interpolated(trajectory.control_time, trajectory.control_torques, time)
        torque_units = tuple(EFFORT_UNITS[unit] for unit in units)
        torque_names = tuple(f"{name}.effort" for name in joints)
        columns.append((Feature("effort", torque_names, torque_units), torques))
    columns.append(_joined("manipulability", ellipsoids))
    columns.append(_joined("quality", errors))

    features = tuple(feature for feature, _ in columns)
    values = {feature.key: array for feature, array in columns}
    about = {"status": report.status, "warnings": list(report.warning_keys)}
    name = _name(result)
    return Episode(name, f"Follow the motion of {name}", values, about), features


Column = tuple[tuple[str, ...], tuple[str, ...], Array]
"""Names, units and values (n, k)."""


EFFORT_UNITS = {"rad": "N m", "m": "N"}
"""Units of efforts by those of joints."""


def _joined(key: str, columns_of_arms: Sequence[Column]) -> tuple[Feature, Array]:
    """Return one feature of the columns of all arms."""
    names: list[str] = []
    units: list[str] = []
    values = []
    for arm_names, arm_units, arm_values in columns_of_arms:
        names += arm_names
        units += arm_units
        values.append(arm_values)
    return Feature(key, tuple(names), tuple(units)), np.concatenate(values, axis=1)


def _prefixes(result: MotionResult) -> tuple[str, ...]:
    """Return the prefix of the columns of each arm; none for a single arm."""
    if len(result.arms) == 1:
        return ("",)
    return tuple(f"{name}_" for name in result.robot.names)


def _name(result: MotionResult) -> str:
    """Return the name of the recording, or of the profile, that the robot follows."""
    if isinstance(result, TransferResult):
        return result.recording.source
    if result.demonstration is not None:
        return result.demonstration.name
    return Path(result.config.profile or "profile").name


def _poses(poses: Array, prefix: str) -> Column:
    """Return positions and rotation vectors of poses (n, 4, 4)."""
    names = []
    for coordinate in (*AXES, *TURNS):
        names.append(f"{prefix}ee.{coordinate}")
    vectors = Rotation.from_matrix(poses[:, :3, :3]).as_rotvec()
    values = np.column_stack([poses[:, :3, 3], vectors])
    return tuple(names), ("m",) * 3 + ("rad",) * 3, values


def _ellipsoids(ellipsoids: Array, prefix: str) -> Column:
    """Return the entries of ellipsoids (n, d, d)."""
    names = []
    for entry in _upper_names(ellipsoids.shape[-1]):
        names.append(f"{prefix}ellipsoid.{entry}")
    return tuple(names), ("",) * len(names), _upper(ellipsoids)


def _target(arm: ArmResult, motion: ArmMotion, prefix: str, time: Array, places: Array) -> Column:
    """Return target positions and logarithms of target ellipsoids at times (n,)."""
    positions = places
    if motion.path is not None:
        positions = interpolated(motion.time, motion.path, time)
    damped = motion.target + motion.damping.epsilon * np.eye(arm.spec.size)
    logarithms = logm(damped)
    if arm.spec.kind == "force":  # the motion has the inverses
        logarithms = -logarithms
    flat = interpolated(motion.time, _upper(logarithms), time)
    names = []
    for axis in AXES:
        names.append(f"{prefix}target.{axis}")
    for entry in _upper_names(arm.spec.size):
        names.append(f"{prefix}target.log_{entry}")
    units = ("m",) * 3 + ("",) * flat.shape[1]
    return tuple(names), units, np.column_stack([positions, flat])


def _errors(motion: ArmMotion, prefix: str, time: Array) -> Column:
    """Return distances to the target ellipsoids and position errors [m] at times (n,)."""
    names = [f"{prefix}distance"]
    units = [""]
    columns = [motion.distance]
    if motion.position_error is not None:
        names.append(f"{prefix}position_error")
        units.append("m")
        columns.append(motion.position_error)
    values = interpolated(motion.time, np.column_stack(columns), time)
    return tuple(names), tuple(units), values


def _upper(matrices: Array) -> Array:
    """Return the entries of symmetric matrices (n, d, d) on and above the diagonal, row by row."""
    rows, columns = np.triu_indices(matrices.shape[-1])
    return matrices[:, rows, columns]


def _upper_names(size: int) -> tuple[str, ...]:
    """Return the names of these entries, such as xx, xy, xz; of larger ones their indices."""
    labels = AXES if size == 3 else [*AXES, *TURNS]
    rows, columns = np.triu_indices(size)
    names = []
    for row, column in zip(rows, columns, strict=True):
        names.append(f"{labels[row]}{labels[column]}")
    return tuple(names)
