"""Messages of ROS 2 in CDR, the binary encoding of bags, with their definitions; no ROS is needed."""

import struct
from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from maniport.util.validation import Array

HEADER = """\
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
JOINT_STATE = f"""\
std_msgs/Header header
string[] name
float64[] position
float64[] velocity
float64[] effort
{HEADER}"""
STRING = "string data\n"
MARKERS = f"""\
visualization_msgs/Marker[] markers
================================================================================
MSG: visualization_msgs/Marker
int32 ARROW=0
int32 CUBE=1
int32 SPHERE=2
int32 CYLINDER=3
int32 LINE_STRIP=4
int32 LINE_LIST=5
int32 CUBE_LIST=6
int32 SPHERE_LIST=7
int32 POINTS=8
int32 TEXT_VIEW_FACING=9
int32 MESH_RESOURCE=10
int32 TRIANGLE_LIST=11
int32 ADD=0
int32 MODIFY=0
int32 DELETE=2
int32 DELETEALL=3
std_msgs/Header header
string ns
int32 id
int32 type
int32 action
geometry_msgs/Pose pose
geometry_msgs/Vector3 scale
std_msgs/ColorRGBA color
builtin_interfaces/Duration lifetime
bool frame_locked
geometry_msgs/Point[] points
std_msgs/ColorRGBA[] colors
string texture_resource
sensor_msgs/CompressedImage texture
visualization_msgs/UVCoordinate[] uv_coordinates
string text
string mesh_resource
visualization_msgs/MeshFile mesh_file
bool mesh_use_embedded_materials
{HEADER}\
================================================================================
MSG: geometry_msgs/Pose
geometry_msgs/Point position
geometry_msgs/Quaternion orientation
================================================================================
MSG: geometry_msgs/Point
float64 x
float64 y
float64 z
================================================================================
MSG: geometry_msgs/Quaternion
float64 x
float64 y
float64 z
float64 w
================================================================================
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
================================================================================
MSG: std_msgs/ColorRGBA
float32 r
float32 g
float32 b
float32 a
================================================================================
MSG: builtin_interfaces/Duration
int32 sec
uint32 nanosec
================================================================================
MSG: sensor_msgs/CompressedImage
std_msgs/Header header
string format
uint8[] data
================================================================================
MSG: visualization_msgs/UVCoordinate
float32 u
float32 v
================================================================================
MSG: visualization_msgs/MeshFile
string filename
uint8[] data
"""
"""Definitions as ROS 2 has them since Humble."""

SPHERE = 2
MARKER_SCALE = 0.2  # of semi-axes [m], as in the report
COLOR = (0.1, 0.45, 0.7, 0.5)


class _Writer:
    """Bytes of a message in little-endian CDR; numbers are aligned to their size."""

    def __init__(self) -> None:
        self._body = bytearray()

    def numbers(self, code: str, *values: float) -> None:
        """Append numbers of one type, by its code of `struct`."""
        size = struct.calcsize(code)
        self._body.extend(b"\0" * (-len(self._body) % size))
        self._body.extend(struct.pack(f"<{len(values)}{code}", *values))

    def text(self, text: str) -> None:
        """Append a text, with its length and a zero byte."""
        content = text.encode("utf-8") + b"\0"
        self.numbers("I", len(content))
        self._body.extend(content)

    def header(self, time: int, frame: str) -> None:
        """Append a header with its time [ns]."""
        seconds, nanoseconds = divmod(time, 10**9)
        self.numbers("i", seconds)
        self.numbers("I", nanoseconds)
        self.text(frame)

    def sequence(self, values: Sequence[float]) -> None:
        """Append a sequence of float64."""
        self.numbers("I", len(values))
        if len(values):
            self.numbers("d", *values)

    def message(self) -> bytes:
        """Return the message with the head that names its encoding."""
        return b"\0\1\0\0" + bytes(self._body)


def joint_state(
    time: int,
    names: Sequence[str],
    positions: Sequence[float],
    velocities: Sequence[float],
    efforts: Sequence[float],
) -> bytes:
    """Return a ``sensor_msgs/msg/JointState`` at a time [ns]."""
    writer = _Writer()
    writer.header(time, "")
    writer.numbers("I", len(names))
    for name in names:
        writer.text(name)
    for values in (positions, velocities, efforts):
        writer.sequence(values)
    return writer.message()


def string(text: str) -> bytes:
    """Return a ``std_msgs/msg/String``."""
    writer = _Writer()
    writer.text(text)
    return writer.message()


def ellipsoid_markers(
    time: int, frame: str, names: Sequence[str], positions: Array, ellipsoids: Array
) -> bytes:
    """Return a ``visualization_msgs/msg/MarkerArray`` of ellipsoids (k, 3, 3) at positions (k, 3) [m]."""
    writer = _Writer()
    writer.numbers("I", len(names))
    for number, name in enumerate(names):
        values, vectors = np.linalg.eigh(ellipsoids[number])
        if np.linalg.det(vectors) < 0.0:
            vectors[:, 0] = -vectors[:, 0]
        writer.header(time, frame)
        writer.text(name)
        writer.numbers("i", number, SPHERE, 0)
        writer.numbers("d", *positions[number].tolist())
        writer.numbers("d", *pin.Quaternion(vectors).coeffs().tolist())  # x, y, z, w
        diameters = 2.0 * MARKER_SCALE * np.sqrt(np.maximum(values, 1e-12))
        writer.numbers("d", *diameters.tolist())
        writer.numbers("f", *COLOR)
        writer.numbers("i", 0)  # lifetime
        writer.numbers("I", 0)
        writer.numbers("?", False)
        writer.numbers("I", 0)  # points
        writer.numbers("I", 0)  # colors
        writer.text("")  # texture
        writer.header(0, "")
        writer.text("")
        writer.numbers("I", 0)
        writer.numbers("I", 0)  # coordinates of a texture
        writer.text("")  # text
        writer.text("")  # mesh
        writer.text("")
        writer.numbers("I", 0)
        writer.numbers("?", False)
    return writer.message()
