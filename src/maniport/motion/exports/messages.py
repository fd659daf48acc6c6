"""Motions as messages of robots: points over time for ROS 2, and a log that players open."""

import json
import os

import numpy as np
import yaml

from maniport.motion.trajectory import Trajectory
from maniport.util.atomic_io import written_whole
from maniport.util.optional import mcap_writer
from maniport.util.validation import Array

POINTS_PER_SECOND = 100.0  # Of files for ROS 2 and MCAP: controllers lay splines between their points

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


def write_ros2(path: str | os.PathLike[str], motion: Trajectory) -> None:
    """Write a trajectory_msgs/msg/JointTrajectory as YAML."""
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


def write_mcap(path: str | os.PathLike[str], motion: Trajectory) -> None:
    """Write messages named as in sensor_msgs/msg/JointState, as JSON."""
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


def _state(motion: Trajectory) -> tuple[tuple[Array, int], ...]:
    """Positions, velocities and accelerations, each with the decimals that are written of it."""
    return (motion.control_positions, 9), (motion.control_velocities, 7), (motion.control_accelerations, 5)


def _thinned(motion: Trajectory) -> tuple[Array, Array]:
    """Indices of control steps, about `POINTS_PER_SECOND`, and their seconds since the first."""
    since = motion.control_time - motion.control_time[0]
    each = max(1, round((len(since) - 1) / (since[-1] * POINTS_PER_SECOND)))
    rows = np.unique(np.append(np.arange(0, len(since), each), len(since) - 1))
    return rows, since[rows]
