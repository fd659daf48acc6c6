"""A motion as files that controllers, players and simulators take."""

import json
import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import yaml

from maniport.errors import InvalidInputError
from maniport.files import save_arrays, written_whole
from maniport.optional import mcap_writer
from maniport.tracking.follow.track_result import TrackResult
from maniport.validation import Array, as_choice

POINTS_PER_SECOND = 100.0
"""Of files for ROS 2 and MCAP: controllers lay splines between their points."""

MESSAGE = {
    "type": "object",
    "properties": {
        "timestamp": {
            "type": "object",
            "title": "time",
            "properties": {"sec": {"type": "integer"}, "nsec": {"type": "integer"}},
        },
        "name": {"type": "array", "items": {"type": "string"}},
        **{key: {"type": "array", "items": {"type": "number"}} for key in ("position", "velocity", "acceleration")},
    },
}
"""JSON schema of the messages of an MCAP file."""


def export_motion(path: str | os.PathLike[str], motion: TrackResult, format: str) -> None:
    """Write the control steps of a motion, with time from 0, in a format of `FORMATS`.

    - ``"ros2"``, suffix ``.yaml``: one ``trajectory_msgs/msg/JointTrajectory`` of about 100 points a second with
      positions, velocities and accelerations, as ``ros2 topic pub`` and ``rosidl`` take it.
    - ``"mcap"``, suffix ``.mcap``: about 100 messages a second on the topic ``/joint_states``, named as in
      ``sensor_msgs/msg/JointState`` with accelerations beside, as JSON with its schema, for Foxglove and Rerun.
    - ``"mujoco"``, suffix ``.npz``: ``qpos`` and ``qvel``, shape (m, dof), at every control step, ``joint_names`` and
      ``timestep`` [s].

    The first and the last control step are always there.

    Parameters
    ----------
    path : str or path
    motion : TrackResult
    format : {"ros2", "mcap", "mujoco"}

    Raises
    ------
    UnknownNameError
        When there is no such format.
    InvalidInputError
        When the file has another suffix than the format.
    MissingPackageError
        When ``"mcap"`` is asked for without its package.
    OutputError
        When the file cannot be written.
    """
    name, write = FORMATS[as_choice(format, "format", FORMATS)]
    suffix = Path(name).suffix
    if Path(path).suffix != suffix:
        raise InvalidInputError(f"path must end with {suffix!r} for the format {format!r}; found {str(path)!r}")
    write(path, motion)


def export_file(format: str) -> str:
    """Name of the file of a format, which is there and can be written.

    Raises
    ------
    UnknownNameError, MissingPackageError
        As `export_motion`.
    """
    name = FORMATS[as_choice(format, "export", FORMATS)][0]
    if format == "mcap":
        mcap_writer()
    return name


def _ros2(path: str | os.PathLike[str], motion: TrackResult) -> None:
    rows, seconds = _thinned(motion)
    names = yaml.safe_dump(list(motion.joint_names), default_flow_style=True, width=float("inf")).strip()
    with written_whole(path) as temporary, open(temporary, "w", encoding="utf-8", newline="\n") as stream:
        stream.write("# trajectory_msgs/msg/JointTrajectory [rad or m, and those for each second and second squared]\n")
        stream.write("header:\n  stamp: {sec: 0, nanosec: 0}\n  frame_id: ''\n")
        stream.write(f"joint_names: {names}\npoints:\n")
        for row, time in zip(rows, seconds, strict=True):
            for key, (values, digits) in zip(
                ("- positions", "  velocities", "  accelerations"), _state(motion), strict=True
            ):
                stream.write(f"{key}: [{', '.join(f'{value:.{digits}f}' for value in values[row].tolist())}]\n")
            sec, nanosec = divmod(round(1e9 * time), 10**9)
            stream.write(f"  time_from_start: {{sec: {sec}, nanosec: {nanosec}}}\n")


def _mcap(path: str | os.PathLike[str], motion: TrackResult) -> None:
    package = mcap_writer()
    rows, seconds = _thinned(motion)
    with written_whole(path) as temporary, open(temporary, "wb") as stream:
        writer = package.Writer(stream)
        writer.start(library="maniport")
        schema = writer.register_schema("JointState", "jsonschema", json.dumps(MESSAGE).encode())
        channel = writer.register_channel("/joint_states", "json", schema)
        for number, (row, time) in enumerate(zip(rows, seconds, strict=True)):
            nanoseconds = round(1e9 * time)
            sec, nsec = divmod(nanoseconds, 10**9)
            state = (np.round(values[row], digits).tolist() for values, digits in _state(motion))
            message = {"timestamp": {"sec": sec, "nsec": nsec}, "name": list(motion.joint_names)}
            message |= dict(zip(("position", "velocity", "acceleration"), state, strict=True))
            writer.add_message(channel, nanoseconds, json.dumps(message).encode(), nanoseconds, number)
        writer.finish()


def _mujoco(path: str | os.PathLike[str], motion: TrackResult) -> None:
    save_arrays(path, {
        "qpos": motion.control_positions,
        "qvel": motion.control_velocities,
        "joint_names": np.array(motion.joint_names),
        "timestep": np.array(np.ptp(motion.control_time) / (len(motion.control_time) - 1)),
    })  # fmt: skip


def _state(motion: TrackResult) -> tuple[tuple[Array, int], ...]:
    """Positions, velocities and accelerations, each with the decimals that are written of it."""
    return (motion.control_positions, 9), (motion.control_velocities, 7), (motion.control_accelerations, 5)


def _thinned(motion: TrackResult) -> tuple[Array, Array]:
    """Indices of control steps, about `POINTS_PER_SECOND`, and their seconds since the first."""
    since = motion.control_time - motion.control_time[0]
    each = max(1, round((len(since) - 1) / (since[-1] * POINTS_PER_SECOND)))
    rows = np.unique(np.append(np.arange(0, len(since), each), len(since) - 1))
    return rows, since[rows]


FORMATS: dict[str, tuple[str, Callable[[str | os.PathLike[str], TrackResult], None]]] = {
    "ros2": ("joints.yaml", _ros2),
    "mcap": ("joints.mcap", _mcap),
    "mujoco": ("joints_mujoco.npz", _mujoco),
}
"""By name: what the file is called among a run's results, and who writes it."""
