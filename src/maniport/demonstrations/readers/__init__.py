"""Recordings from files: one module a format; a further format is one line of a table."""

import importlib
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from maniport.defaults import RECORDINGS
from maniport.demonstrations.conventions import UNITS, known_unit
from maniport.demonstrations.doubts import require_believable
from maniport.demonstrations.given import Given
from maniport.demonstrations.readers.kinds import kind_of
from maniport.demonstrations.recording import UP_AXES, Recording
from maniport.errors import spoken, unknown_name
from maniport.input_limits import as_path
from maniport.validation import as_choice, as_number

Reader = Callable[[Path, Given], Recording]

READERS: dict[str, Reader | str] = {ending: f"{__name__}.{module}" for ending, module in RECORDINGS.items()}
"""For each ending what reads such a file, or the module whose ``read`` does, imported on first use. It is called with
the path and what the user said of the file, `maniport.demonstrations.given.Given`, whose ``recording`` makes the
result; it raises `FileFormatError` where the file is at fault. What is added here, `read_recording` takes."""

FASTEST = 1e5
"""No camera takes so many frames a second [Hz]."""

SHIPPED = {"ladder": "ladder.bvh", "freeform": "freeform.c3d", "both-arms": "both_arms.c3d"}
"""``"ladder"``: a person climbs a ladder and hangs from it (BVH). ``"freeform"``: free motion of the right arm (C3D).
``"both-arms"``: the same motion with the left arm, which moves more."""


def read_recording(
    path: str | os.PathLike[str], unit: str | None = None, up: str | None = None, rate: float | None = None
) -> Recording:
    """Read a recording of a person's motion.

    What a file is, its content tells, and its ending where that does not: a misnamed file is read.

    Parameters
    ----------
    path : str or path
        A file of one of the formats in `READERS`, a folder of keypoint files, one a frame, or the name of a shipped
        recording (``"ladder"``, ``"freeform"``, ``"both-arms"``). The page ``docs/recordings.md`` shows what is read of
        each.
    unit : {"m", "dm", "cm", "mm", "inch", "CMU"}, optional
        The file's unit of length, over what the file says or what is recognised from the upper arm.
    up : {"x", "y", "z", "-x", "-y", "-z"}, optional
        The file's axis that points up; recognised when not given.
    rate : float, optional
        Frames per second, over what the file says; needed where it says nothing.

    Returns
    -------
    Recording
        Positions in metres; its notes say what was recognised and repaired, its doubts where the points contradict
        the unit or the axis that was given.

    Raises
    ------
    FileFormatError
        When the file is missing, unreadable, empty, truncated, of a format that is not read or not what it seems; for
        other formats the message says how to convert them.
    InvalidInputError
        When `unit` or `up` is none of the names above, the unit makes an upper arm that nobody has, or `rate` is no
        positive number.

    See Also
    --------
    Recording : what is read.
    DIALECTS : the names of points that are known.
    """
    length = None if unit is None else as_choice(known_unit(str(unit)) or unit, "unit", tuple(UNITS))
    given = Given(
        scale=None if length is None else UNITS[length],
        up=None if up is None else as_choice(up, "up", UP_AXES),
        rate=None if rate is None else as_number(rate, f"{spoken('rate')} [Hz]", above=0.0, below=FASTEST),
    )
    file = as_path(path, other=" or the name of a recording")
    if str(path) in SHIPPED and not file.exists():
        file = shipped_recording(str(path))
    kind = _format_of(file)
    reader = READERS[kind]
    read: Reader = importlib.import_module(reader).read if isinstance(reader, str) else reader
    recording = replace(read(file, given), format=kind)
    return require_believable(recording, length, given.up)


def _format_of(file: Path) -> str:
    """The key of `READERS` for a file: by what stands in it, then by its ending."""
    if os.path.isdir(file) and any(file.glob("*.json")):
        return ".json"
    own = tuple(ending for ending, reader in READERS.items() if not isinstance(reader, str))
    return kind_of(file, tuple(READERS), own, f"; shipped are {', '.join(map(repr, SHIPPED))}")


def shipped_recording(name: str) -> Path:
    """Path of a recording that comes with the package.

    Parameters
    ----------
    name : {"ladder", "freeform", "both-arms"}
        Its name.

    Returns
    -------
    Path

    Raises
    ------
    UnknownNameError
        When there is none of that name; the message lists those there are.

    See Also
    --------
    read_recording : reads it.
    """
    if name not in SHIPPED:
        raise unknown_name("shipped recording", name, SHIPPED)
    return Path(__file__).parents[1] / "data" / SHIPPED[name]
