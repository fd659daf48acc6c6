"""Export of motions to files of controllers, players, simulators and tables."""

import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
import yaml

from maniport.arms import Arm, ArmGroup, as_group
from maniport.errors import InvalidInputError
from maniport.motion.robot_motion import RobotMotion
from maniport.motion.ros_messages import (
    JOINT_STATE,
    MARKERS,
    STRING,
    ellipsoid_markers,
    joint_state,
    string,
)
from maniport.motion.trajectory import Trajectory
from maniport.util.atomic_io import written_whole
from maniport.util.input_limits import as_path
from maniport.util.optional import (
    mcap_writer,
    parquet_of_datasets,
    parquet_writer,
    pyarrow,
    rerun,
)
from maniport.util.validation import Array, as_choice, as_number

LATCHED = """\
- history: 1
  depth: 1
  reliability: 1
  durability: 1
  deadline: {sec: 9223372036, nsec: 854775807}
  lifespan: {sec: 9223372036, nsec: 854775807}
  liveliness: 1
  liveliness_lease_duration: {sec: 9223372036, nsec: 854775807}
  avoid_ros_namespace_conventions: false
"""
"""Quality of service of a topic whose last message later subscribers get, as bags store it."""
MCAP = "mcap"
SCENE = "rerun"
DATASET = "lerobot"
LATEST = 2.0**31 - 1e6  # start of a bag [s], whose stamps have 32 bits
COMPLETE = (SCENE, DATASET)  # formats that contain a complete result
DECIMALS = 9, 7, 5, 4  # of positions, velocities, accelerations and torques in messages


def _samples(
    motion: Trajectory, rate: float = 100.0
) -> Iterator[tuple[int, int, list[list[float]]]]:
    """Iterate over about `rate` control steps a second from 0 s: seconds, nanoseconds, positions and derivatives."""
    time = motion.control_time - motion.control_time[0]
    stride = max(1, round((len(time) - 1) / (time[-1] * rate)))
    for row in np.unique(np.append(np.arange(0, len(time), stride), len(time) - 1)):
        states = zip(motion.control_states.values(), DECIMALS, strict=False)
        yield (
            *divmod(round(1e9 * time[row]), 10**9),
            [np.round(values[row], digits).tolist() for (values, _), digits in states],
        )


def _write_ros2(path: Path, motion: Trajectory, robot: Arm | ArmGroup | None) -> None:
    names = yaml.safe_dump(
        list(motion.joint_names), default_flow_style=True, width=float("inf")
    ).strip()
    # without effort: controllers of positions reject points that have it (ros2_controllers #699)
    keys = ("- positions", "  velocities", "  accelerations")
    with open(path, "w", encoding="utf-8", newline="\n") as stream:
        stream.write(
            "# trajectory_msgs/msg/JointTrajectory [rad or m, per second, per second squared]\n"
        )
        stream.write("header:\n  stamp: {sec: 0, nanosec: 0}\n  frame_id: ''\n")
        stream.write(f"joint_names: {names}\npoints:\n")
        for sec, nanosec, states in _samples(motion):
            for key, values, digits in zip(keys, states, DECIMALS, strict=False):
                stream.write(f"{key}: [{', '.join(f'{value:.{digits}f}' for value in values)}]\n")
            stream.write(f"  time_from_start: {{sec: {sec}, nanosec: {nanosec}}}\n")


def _write_mcap(
    path: Path, motion: Trajectory, robot: Arm | ArmGroup | None, start: float = 0.0
) -> None:
    begin = round(10**9 * start)
    with open(path, "wb") as stream:
        writer = mcap_writer().Writer(stream)
        writer.start(profile="ros2", library="maniport")

        def channel(topic: str, name: str, definition: str, latched: bool = False) -> int:
            schema = writer.register_schema(name, "ros2msg", definition.encode())
            metadata = {"offered_qos_profiles": LATCHED if latched else ""}
            return int(writer.register_channel(topic, "cdr", schema, metadata))

        description = "" if robot is None else _description(robot)
        if description:
            topic = channel("/robot_description", "std_msgs/msg/String", STRING, latched=True)
            writer.add_message(topic, begin, string(description), begin)
        states = channel("/joint_states", "sensor_msgs/msg/JointState", JOINT_STATE)
        markers = 0
        if robot is not None:
            markers = channel("/manipulability", "visualization_msgs/msg/MarkerArray", MARKERS)
        for number, (sec, nsec, values) in enumerate(_samples(motion)):
            time = begin + 10**9 * sec + nsec
            positions = values[0]
            velocities = values[1]
            if len(values) > 3:
                efforts = values[3]
            else:
                efforts = []
            message = joint_state(time, motion.joint_names, positions, velocities, efforts)
            writer.add_message(states, time, message, time, number)
            if robot is not None:
                group = as_group(robot)
                q = np.array(positions)
                places = group.forward(q)[:, :3, 3]
                frame = next(iter(group.arms[0].chain.frames))
                base = group.arms[0].base or frame
                message = ellipsoid_markers(time, base, group.names, places, group.ellipsoids(q))
                writer.add_message(markers, time, message, time, number)
        writer.finish()


def _description(robot: Arm | ArmGroup) -> str:
    """Return the URDF that a robot was loaded from; empty for other robots."""
    source = Path(as_group(robot).arms[0].chain.source)
    if source.suffix.lower() != ".urdf" or not source.is_file():
        return ""
    return source.read_text(encoding="utf-8", errors="replace")


def _write_mujoco(path: Path, motion: Trajectory, robot: Arm | ArmGroup | None) -> None:
    held = {} if robot is None else robot.locked
    with open(path, "wb") as stream:
        np.savez_compressed(
            stream,
            qpos=motion.control_positions,
            qvel=motion.control_velocities,
            joint_names=np.array(motion.joint_names),
            timestep=np.array(np.ptp(motion.control_time) / (len(motion.control_time) - 1)),
            held_names=np.array(list(held), dtype=str),
            held_positions=np.array(list(held.values()), dtype=float),
        )


def _write_parquet(path: Path, motion: Trajectory, robot: Arm | ArmGroup | None) -> None:
    arrow = pyarrow()
    parquet = parquet_writer()
    columns: dict[str, tuple[Array, str]] = {
        "time": (motion.control_time - motion.control_time[0], "s")
    }
    for quantity, (values, units) in motion.control_states.items():
        for name, unit, column in zip(motion.joint_names, units, values.T, strict=True):
            columns[f"{name}_{quantity}"] = column, unit
    if robot is not None:
        group = as_group(robot)
        end_positions = group.forward(motion.control_positions)[:, :, :3, 3]
        for arm, name in enumerate(group.names):
            if len(group) > 1:
                prefix = f"{name}_"
            else:
                prefix = ""
            columns |= {
                f"{prefix}end_effector_{axis}": (end_positions[:, arm, i], "m")
                for i, axis in enumerate("xyz")
            }
    fields = [
        arrow.field(name, arrow.float64(), metadata={"unit": unit})
        for name, (_, unit) in columns.items()
    ]
    table = arrow.table([values for values, _ in columns.values()], schema=arrow.schema(fields))
    parquet.write_table(table, path, compression="zstd")


def _nothing() -> None:
    """Require no package."""


class Format(NamedTuple):
    """A file format of motions."""

    file: str  # name among a run's results
    # None where a complete result is needed
    write: Callable[[Path, Trajectory, Arm | ArmGroup | None], None] | None
    # imports the required package, or raises `MissingPackageError`
    package: Callable[[], object] = _nothing


FORMATS = {
    "ros2": Format("joints.yaml", _write_ros2),
    "mcap": Format("joints.mcap", _write_mcap, mcap_writer),
    "mujoco": Format("joints_mujoco.npz", _write_mujoco),
    "parquet": Format("joints.parquet", _write_parquet, parquet_writer),
    SCENE: Format("motion.rrd", None, rerun),
    DATASET: Format("lerobot", None, parquet_of_datasets),  # a folder
}
"""All formats of exports by name, on the command line and in Python."""


def export_motion(
    path: str | os.PathLike[str],
    motion: Trajectory | RobotMotion,
    format: str,
    robot: Arm | ArmGroup | None = None,
    start: float = 0.0,
) -> None:
    """Write the control steps of a motion, the first and the last included, with time from 0.

    - ``"ros2"``, ``.yaml``: one ``trajectory_msgs/msg/JointTrajectory`` of about 100 points a second.
    - ``"mcap"``, ``.mcap``: a bag of ROS 2 with about 100 messages a second of
      ``sensor_msgs/msg/JointState`` on ``/joint_states``; with the robot also its velocity ellipsoids as
      ``visualization_msgs/msg/MarkerArray`` on ``/manipulability`` and, of a URDF, ``/robot_description``.
    - ``"mujoco"``, ``.npz``: ``qpos`` and ``qvel``, shape (m, dof), ``joint_names`` and ``timestep`` [s]; with the
      robot also its locked joints, ``held_names`` and ``held_positions``.
    - ``"parquet"``, ``.parquet``: a row for every control step with the joints and, with the robot, the positions of
      the end effectors; units are in the metadata of the columns.

    Parameters
    ----------
    path : str or path
    motion : Trajectory, ArmMotion or RobotMotion
    format : {"ros2", "mcap", "mujoco", "parquet"}
        ``"rerun"`` and ``"lerobot"`` take a complete result: see `maniport.write_results`.
    robot : Arm or ArmGroup, optional
        Used for ``"mcap"``, ``"mujoco"`` and ``"parquet"``.
    start : float
        Time of the first message of a bag [s since 1970].

    Raises
    ------
    UnknownNameError, InvalidInputError
        When the format is unknown, the suffix is not that of the format, or the robot has other joints.
    MissingPackageError, OutputError
        When a package that the format requires is not installed, or the file cannot be written.
    """
    file, write, _ = FORMATS[as_choice(format, "format", FORMATS)]
    if write is None:
        raise InvalidInputError(
            f"export_motion takes only the motion; the format {format!r} contains a complete result: "
            f"maniport.write_results(result, folder, exports={format!r}) writes it"
        )
    suffix = Path(file).suffix
    if as_path(path).suffix != suffix:
        raise InvalidInputError(
            f"path must end with {suffix!r} for the format {format!r}; found {str(path)!r}"
        )
    if isinstance(motion, RobotMotion):
        motion = motion.trajectory
    if not isinstance(motion, Trajectory):
        raise InvalidInputError(
            f"motion must be a motion, such as result.motion; found {type(motion).__name__}"
        )
    if robot is not None and getattr(robot, "joint_names", None) != motion.joint_names:
        raise InvalidInputError(
            f"robot must be the one that moves, with the joints {list(motion.joint_names)}; found {robot!r}"
        )
    seconds = as_number(start, "start", minimum=0.0, maximum=LATEST)
    with written_whole(path) as temporary:
        if format == MCAP:
            _write_mcap(temporary, motion, robot, seconds)
        else:
            write(temporary, motion, robot)
