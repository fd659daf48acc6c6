"""One file per format; `read_recording` picks the reader by the file's suffix."""

import importlib
import os
from pathlib import Path

from maniport.demonstrations.conventions import as_up, unit_in_metres
from maniport.demonstrations.recording import Recording
from maniport.demonstrations.shipped import SHIPPED, shipped_recording
from maniport.errors import FileFormatError, nearest_first

READERS = {".bvh": "maniport.demonstrations.readers.bvh", ".c3d": "maniport.demonstrations.readers.c3d"}
"""The reader's module for each suffix; imported on first use, for the libraries behind them take a while to load."""


def read_recording(path: str | os.PathLike[str], unit: str | None = None, up: str | None = None) -> Recording:
    """Read a motion-capture file.

    Parameters
    ----------
    path : str or path
        A ``.bvh`` or ``.c3d`` file, or the name of a shipped recording (``"ladder"``, ``"freeform"``).
    unit : {"m", "dm", "cm", "mm", "inch", "CMU"}, optional
        The file's unit of length, over what the file says (C3D) or what is recognised from the upper arm (BVH).
    up : {"x", "y", "z", "-x", "-y", "-z"}, optional
        The file's axis that points up; recognised when not given.

    Returns
    -------
    Recording
        Positions in metres; its notes say what was recognised and repaired.

    Raises
    ------
    FileFormatError
        When the file is missing, unreadable, empty, truncated, of unknown suffix or not what its suffix says.
    InvalidInputError
        When `unit` or `up` is none of the names above.
    """
    scale = None if unit is None else unit_in_metres(unit)
    direction = None if up is None else as_up(up)
    file = _existing(path)
    content = importlib.import_module(READERS[file.suffix.lower()])
    recording: Recording = content.read(file, scale, direction)
    return recording


def _existing(path: str | os.PathLike[str]) -> Path:
    """Find the file and check what can be checked before it is read."""
    file = Path(path)
    if not file.exists() and str(path) in SHIPPED:
        file = shipped_recording(str(path))
    if not file.exists():
        raise FileFormatError(
            f"{file}: there is no such file{_similar(file)}; shipped are {', '.join(map(repr, SHIPPED))}"
        )
    if file.is_dir():
        raise FileFormatError(f"{file}: this is a folder; give a file with suffix {' or '.join(READERS)}")
    if file.suffix.lower() not in READERS:
        raise FileFormatError(f"{file}: suffix {file.suffix!r} is not known; allowed are {', '.join(READERS)}")
    try:
        with open(file, "rb") as stream:
            first = stream.read(1)
    except OSError as error:
        raise FileFormatError(f"{file}: cannot be read: {error.strerror}") from None
    if not first:
        raise FileFormatError(f"{file}: the file is empty")
    return file


def _similar(file: Path) -> str:
    """Name the recordings that lie where the missing file was looked for."""
    if not file.parent.is_dir():
        return f", nor a folder {str(file.parent)!r}"
    others = [other.name for other in file.parent.iterdir() if other.suffix.lower() in READERS]
    return f"; there are {', '.join(map(repr, nearest_first(file.name, others)[:5]))}" if others else ""
