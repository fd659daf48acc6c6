"""Checks of files before they are read, and the largest sizes of input, in one table.

Everything that people bring is far below; a file beyond them is damaged, made to harm, or not what it is taken for.
"""

import os
import stat
from collections.abc import Collection
from pathlib import Path

from maniport.errors import FileFormatError, InvalidInputError, nearest_first

MEGABYTE = 2**20

ROBOT_BYTES = 16 * MEGABYTE  # Of a URDF, MJCF or SRDF
MESH_BYTES = 256 * MEGABYTE  # Of a mesh, and of the buffers that a glTF names
RECORDING_BYTES = 512 * MEGABYTE
KEYPOINTS_BYTES = 128 * MEGABYTE  # Of keypoints in JSON, which take ten times as much in memory
ARRAYS_BYTES = (
    1024 * MEGABYTE
)  # Of the arrays that are taken out of an ``.npz`` file, as they are in memory
SETTINGS_BYTES = MEGABYTE // 4  # Of what people write by hand

TAGS = 500_000  # Tags in a robot's XML
NESTING = 128  # Depth of nested elements; a native reader goes down into them with its stack
LINKS = 1000  # Links (bodies) of a robot, and links in a row
INCLUDES = 64  # Files that a robot's file includes
INSERTIONS = 1024  # Times that files are included
SHAPES = 5000  # Of a robot
NODES = 20_000  # Nodes of the scene in a mesh file; one that is drawn twice counts twice
TRIANGLES = 10_000_000  # Triangles and, by themselves, points of one mesh, and triangles of all that a robot shows

FRAMES = 2_000_000
POINTS = 5000  # Named points of a recording
PLACES = 50_000_000  # Frames × points of a recording
LINE = (
    2 * MEGABYTE
)  # Characters of a line of a table: `POINTS` places of 20 digits for each number fill half of it
FRAME_BYTES = (
    MEGABYTE // 64
)  # Of one live frame, a line or a datagram: 150 points with long names; parsed in 1 ms
NAME = 256  # Characters of the name of a column, a marker with those of its model


def require_at_most(
    count: int, most: int, what: str, path: str | os.PathLike[str] | None = None
) -> None:
    """Raise `FileFormatError` when a file holds too many of `what`; `InvalidInputError` without its path."""
    if count > most:
        text = f"has {count} {what}; at most {most} are read"
        raise InvalidInputError(text) if path is None else FileFormatError(f"{path}: {text}")


def as_path(value: object, name: str = "path", other: str = "") -> Path:
    """Require a path as text or `Path`; `other` names alternatives."""
    if not isinstance(value, (str, os.PathLike)) or isinstance(os.fspath(value), bytes):
        raise InvalidInputError(f"{name} must be a path{other}; found {type(value).__name__}")
    return Path(value)


def existing_file(
    path: str | os.PathLike[str], suffixes: Collection[str], most: int, hint: str = ""
) -> Path:
    """Check what can be checked of a file before it is read; what has no end is not even opened."""
    file = Path(path)
    try:
        status = file.stat()
    except (FileNotFoundError, NotADirectoryError):
        raise FileFormatError(
            f"{file}: there is no such file{_similar(file, suffixes)}{hint}"
        ) from None
    except (
        OSError,
        ValueError,
    ) as error:  # names that are too long or hold a zero byte, loops of links
        raise FileFormatError(
            f"{str(file)!r}: cannot be read: {getattr(error, 'strerror', error)}"
        ) from None
    if stat.S_ISDIR(status.st_mode):
        if suffixes:
            wanted = f"a file with suffix {', '.join(suffixes)}"
        else:
            wanted = "a file"
        raise FileFormatError(f"{file}: this is a folder; give {wanted}")
    if suffixes and file.suffix.lower() not in suffixes:
        raise FileFormatError(
            f"{file}: suffix {file.suffix!r} is not known; allowed are {', '.join(suffixes)}{hint}"
        )
    if not stat.S_ISREG(status.st_mode):
        raise FileFormatError(f"{file}: this is a pipe, a socket or a device; give a file")
    if status.st_size > most:
        size = f"has {status.st_size / MEGABYTE:.4g} MB; at most {most / MEGABYTE:.4g} MB are read"
        raise FileFormatError(f"{file}: {size}")
    if status.st_size == 0:
        raise FileFormatError(f"{file}: the file is empty")
    if not os.access(file, os.R_OK):
        raise FileFormatError(f"{file}: cannot be read: permission denied")
    return file


def read_whole(path: str | os.PathLike[str], suffixes: Collection[str], most: int) -> bytes:
    """Content of a file that passed `existing_file`, as far as it went then."""
    file = existing_file(path, suffixes, most)
    try:
        with open(file, "rb") as stream:
            return stream.read(min(os.fstat(stream.fileno()).st_size, most))
    except OSError as error:
        raise FileFormatError(f"{file}: cannot be read: {error.strerror}") from None


def _similar(file: Path, suffixes: Collection[str]) -> str:
    """Name the files that lie where the missing one was looked for."""
    if not file.parent.is_dir():
        return f", nor a folder {str(file.parent)!r}"
    others = [other.name for other in file.parent.iterdir() if other.suffix.lower() in suffixes]
    if others:
        return f"; there are {', '.join(map(repr, nearest_first(file.name, others)[:5]))}"
    return ""
