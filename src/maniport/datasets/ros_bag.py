"""ROS 2 bags in MCAP: joint states, decoded from CDR without ROS; and the JSON of earlier exports of maniport."""

import json
import os
import struct
from typing import NamedTuple

import numpy as np

from maniport.datasets.joint_motion import RADIANS, JointMotion
from maniport.errors import FileFormatError, InvalidInputError, some_of
from maniport.util.input_limits import FRAMES, RECORDING_BYTES, existing_file, require_at_most
from maniport.util.optional import mcap_reader

JOINT_STATES = ("sensor_msgs/msg/JointState", "sensor_msgs/JointState", "JointState")
MOST_NAMES = 10_000  # joints of a message
NANOSECONDS = 1_000_000_000


class JointState(NamedTuple):
    """Content of a message."""

    time: int  # stamp of the header [ns]; 0 without one
    names: tuple[str, ...]
    positions: tuple[float, ...]


def read_ros_bag(path: str | os.PathLike[str], topic: str | None = None) -> JointMotion:
    """Read the joint states of a topic; positions are in rad or m, as ROS defines them.

    Parameters
    ----------
    path : str or path
        A bag in MCAP.
    topic : str, optional
        Default: the only one with joint states.

    Raises
    ------
    FileFormatError
        When the bag is damaged, has no such messages, or their joints change.
    InvalidInputError
        When several topics have joint states.
    """
    source = os.fspath(path)
    file = existing_file(path, (), RECORDING_BYTES)
    states: dict[str, list[tuple[int, JointState]]] = {}
    reader = mcap_reader()
    count = 0
    try:
        with open(file, "rb") as stream:
            for schema, channel, message in reader.make_reader(stream).iter_messages():
                if schema is None or schema.name not in JOINT_STATES:
                    continue
                count += 1
                require_at_most(count, FRAMES, "messages", path)
                if channel.message_encoding == "cdr":
                    state = _decoded(message.data)
                else:
                    state = _of_json(message.data)
                states.setdefault(channel.topic, []).append((message.log_time, state))
    except (FileFormatError, InvalidInputError):
        raise
    except Exception as error:  # noqa: BLE001 - the reader raises many types on damaged files
        raise FileFormatError(f"{source}: cannot be read as MCAP: {error!s:.200}") from None
    if not states:
        raise FileFormatError(f"{source}: has no messages of {JOINT_STATES[0]}")
    chosen = topic
    if chosen is None:
        if len(states) > 1:
            raise InvalidInputError(
                f"{source}: several topics have joint states: {some_of(states)}; name one as the feature"
            )
        chosen = next(iter(states))
    if chosen not in states:
        raise FileFormatError(
            f"{source}: the topic {chosen!r} has no joint states; those of {some_of(states)} have"
        )
    return _motion_of(source, states[chosen])


def _motion_of(source: str, states: list[tuple[int, JointState]]) -> JointMotion:
    """Return the motion of the messages of one topic."""
    names = states[0][1].names
    for number, (_, state) in enumerate(states):
        if state.names != names or len(state.positions) != len(names):
            raise FileFormatError(
                f"{source}: all messages must have the same joints and a position of each; message "
                f"{number} has {len(state.positions)} positions of {some_of(state.names)}"
            )
    stamps = [state.time or log_time for log_time, state in states]
    begin = min(stamps)
    time = np.array([stamp - begin for stamp in stamps]) / NANOSECONDS
    positions = np.array([state.positions for _, state in states]).reshape(len(states), len(names))
    return JointMotion.checked(source, positions, time, names, RADIANS)


def _of_json(content: bytes) -> JointState:
    values = json.loads(content)
    stamp = values.get("timestamp", {})
    time = NANOSECONDS * int(stamp.get("sec", 0)) + int(stamp.get("nsec", 0))
    return JointState(time, tuple(map(str, values["name"])), tuple(map(float, values["position"])))


def _decoded(content: bytes) -> JointState:
    """Decode a JointState: header, names and positions; the rest of the message is not needed."""
    if len(content) < 4 or content[1] not in (0, 1):
        raise ValueError("a message has no CDR of version 1")
    order = "<" if content[1] == 1 else ">"
    body = content[4:]
    seconds, nanoseconds = struct.unpack_from(f"{order}iI", body, 0)
    place = 8
    _, place = _text(body, place, order)  # frame of the header
    place = _aligned(place, 4)
    (count,) = struct.unpack_from(f"{order}I", body, place)
    require_at_most(count, MOST_NAMES, "joints in a message")
    place += 4
    names = []
    for _ in range(count):
        name, place = _text(body, place, order)
        names.append(name)
    place = _aligned(place, 4)
    (size,) = struct.unpack_from(f"{order}I", body, place)
    require_at_most(size, MOST_NAMES, "positions in a message")
    place = _aligned(place + 4, 8) if size else place + 4
    positions = struct.unpack_from(f"{order}{size}d", body, place)
    return JointState(NANOSECONDS * seconds + nanoseconds, tuple(names), positions)


def _text(body: bytes, place: int, order: str) -> tuple[str, int]:
    """Decode a text, which has its length with a zero byte before it; return it and the next place."""
    place = _aligned(place, 4)
    (length,) = struct.unpack_from(f"{order}I", body, place)
    place += 4
    if place + length > len(body):
        raise ValueError("a message is cut off")
    return body[place : place + length].rstrip(b"\0").decode("utf-8"), place + length


def _aligned(place: int, size: int) -> int:
    return -(-place // size) * size
