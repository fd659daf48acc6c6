"""Recordings from files: one file per format, picked by the suffix; a further format is one line of a table."""

import importlib
import os
from collections.abc import Callable
from pathlib import Path

from maniport.bounds import RECORDING_BYTES, existing_file
from maniport.demonstrations.conventions import UNITS, known_unit
from maniport.demonstrations.doubts import require_believable
from maniport.demonstrations.recording import UP_AXES, Recording
from maniport.errors import unknown_name
from maniport.validation import as_choice

Reader = Callable[[Path, float | None, str | None], Recording]

READERS: dict[str, Reader | str] = {f".{name}": f"{__name__}.{name}" for name in ("bvh", "c3d", "npz")}
"""For each suffix what reads such a file, or the module whose ``read`` does, imported on first use. It is called with
the path, the metres per unit and the axis that points up, each None where the user did not give it, and returns the
recording, raising `FileFormatError` where the file is at fault. What is added here, `read_recording` takes."""

SHIPPED = {"ladder": "ladder.bvh", "freeform": "freeform.c3d"}
"""``"ladder"``: a person climbs a ladder and hangs from it (BVH). ``"freeform"``: free arm motion (C3D)."""


def read_recording(path: str | os.PathLike[str], unit: str | None = None, up: str | None = None) -> Recording:
    """Read a motion-capture file.

    Parameters
    ----------
    path : str or path
        A ``.bvh`` or ``.c3d`` file, an ``.npz`` file of named positions (see `Recording.save`), or the name of a
        shipped recording (``"ladder"``, ``"freeform"``).
    unit : {"m", "dm", "cm", "mm", "inch", "CMU"}, optional
        The file's unit of length, over what the file says (C3D) or what is recognised from the upper arm (BVH).
    up : {"x", "y", "z", "-x", "-y", "-z"}, optional
        The file's axis that points up; recognised when not given.

    Returns
    -------
    Recording
        Positions in metres; its notes say what was recognised and repaired, its doubts where the points contradict
        the unit or the axis that was given.

    Raises
    ------
    FileFormatError
        When the file is missing, unreadable, empty, truncated, of unknown suffix or not what its suffix says.
    InvalidInputError
        When `unit` or `up` is none of the names above, or the unit makes an upper arm that nobody has.
    """
    given = None if unit is None else as_choice(known_unit(str(unit)) or unit, "unit", tuple(UNITS))
    direction = None if up is None else as_choice(up, "up", UP_AXES)
    file = shipped_recording(str(path)) if str(path) in SHIPPED and not Path(path).exists() else Path(path)
    shipped = f"; shipped are {', '.join(map(repr, SHIPPED))}"
    reader = READERS[existing_file(file, READERS, RECORDING_BYTES, shipped).suffix.lower()]
    read: Reader = importlib.import_module(reader).read if isinstance(reader, str) else reader
    return require_believable(read(file, None if given is None else UNITS[given], direction), given, direction)


def shipped_recording(name: str) -> Path:
    """Path of a recording that comes with the package.

    Parameters
    ----------
    name : {"ladder", "freeform"}
        Its name.

    Raises
    ------
    UnknownNameError
        When there is none of that name; the message lists those there are.
    """
    if name not in SHIPPED:
        raise unknown_name("shipped recording", name, SHIPPED)
    return Path(__file__).parents[1] / "data" / SHIPPED[name]
