"""Recordings from files; each format is one module and one line of a table."""

import importlib
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from maniport.errors import FileFormatError, spoken, unknown_name
from maniport.mocap.import_options import UNITS, ImportOptions, known_unit
from maniport.mocap.marker_sets import load_names
from maniport.mocap.readers.text import decoded
from maniport.mocap.recording import Recording
from maniport.util.defaults import RECORDINGS
from maniport.util.input_limits import RECORDING_BYTES, as_path, existing_file
from maniport.util.validation import as_choice, as_number

Reader = Callable[[Path, ImportOptions], Recording]

READERS: dict[str, Reader | str] = {ending: f"{__name__}.{module}" for ending, module in RECORDINGS.items()}
"""For each ending the reader, or the module with a function ``read``, imported on first use.

A reader takes the path and the `ImportOptions` of the caller, the method ``recording`` of which makes the result. Its
`ValueError` becomes a `FileFormatError` with the path. `read_recording` uses the entries that are added.
"""

SHIPPED = {"ladder": "ladder.bvh", "freeform": "freeform.c3d", "both-arms": "both_arms.c3d"}
"""``"ladder"``: a person climbs a ladder and hangs from it (BVH). ``"freeform"``: free motion of the right arm (C3D).
``"both-arms"``: the same motion with the left arm, which moves more."""


def read_recording(path: str | os.PathLike[str], unit: str | None = None, rate: float | None = None) -> Recording:
    """Read a recording of a person's motion.

    The format is recognized by the content of the file, else by its ending.

    Parameters
    ----------
    path : str or path
        A file of one of the formats in `READERS`, a folder with a keypoint file for each frame, or the name of a
        bundled recording (``"ladder"``, ``"freeform"``, ``"both-arms"``). See ``docs/recordings.md``.
    unit : {"m", "dm", "cm", "mm", "inch", "CMU"}, optional
        Unit of length; default: from the file, else recognized from the upper arm.
    rate : float, optional
        Frames per second; default: from the file.

    Returns
    -------
    Recording
        Positions in meters. Its notes report values that were recognized and repairs, its quality_warnings
        contradictions between the points and the unit.

    Raises
    ------
    FileFormatError
        When the file is missing, unreadable, empty, truncated, damaged or of another format, for which the message
        explains how to convert it, or the unit makes an impossible upper arm.
    InvalidInputError
        When an option has a wrong value.
    """
    options = ImportOptions(
        unit=None if unit is None else as_choice(known_unit(str(unit)) or unit, "unit", tuple(UNITS)),
        rate=None if rate is None else as_number(rate, f"{spoken('rate')} [Hz]", above=0.0, below=1e5),
    )
    file = as_path(path, other=" or the name of a recording")
    if str(path) in SHIPPED and not file.exists():
        file = shipped_recording(str(path))
    kind = _format_of(file)
    reader = READERS[kind]
    read: Reader = importlib.import_module(reader).read if isinstance(reader, str) else reader
    try:
        return replace(read(file, options), format=kind)
    except FileFormatError:
        raise
    except ValueError as error:
        raise FileFormatError(f"{file}: {error}") from (None if isinstance(reader, str) else error)
    except (LookupError, TypeError, OverflowError, RecursionError, SyntaxError) as error:  # also of XML and encodings
        raise FileFormatError(f"{file}: not readable as {kind}, perhaps cut off: {error}") from error


def shipped_recording(name: str) -> Path:
    """Return the path of a recording that comes with the package: "ladder", "freeform" or "both-arms".

    Returns
    -------
    Path

    Raises
    ------
    UnknownNameError
        When there is none of that name.
    """
    if name not in SHIPPED:
        raise unknown_name("bundled recording", name, SHIPPED)
    return Path(__file__).parents[1] / "data" / SHIPPED[name]


def _format_of(file: Path) -> str:
    """Return the key of `READERS` for a file: by its content, else by its ending."""
    if os.path.isdir(file) and any(file.glob("*.json")):
        return ".json"
    suffix, hint = file.suffix.lower(), f"; bundled recordings: {', '.join(map(repr, SHIPPED))}"
    kind = None
    # False of names that no file has; formats of the user go by their ending
    if os.path.exists(file) and isinstance(READERS.get(suffix, ""), str):
        existing_file(file, (), RECORDING_BYTES)
        with open(file, "rb") as stream:
            head = stream.read(4096)
        kind = _by_content(head)
        for name, foreign in load_names("foreign_formats.yaml").items():
            starts = tuple(start.encode("latin-1") for start in foreign.get("starts", ()))
            if head.startswith(starts) or (suffix in foreign["endings"] and kind in (None, ".npz", ".json")):
                raise FileFormatError(f"{file}: not supported ({name}): {foreign['advice']}")
    return kind or existing_file(file, tuple(READERS), RECORDING_BYTES, hint).suffix.lower()


def _by_content(head: bytes) -> str | None:
    """Return the ending that belongs to the first bytes of a file, or None."""
    if head.startswith((b"PK", b"\x93NUMPY")):
        return ".npz" if head.startswith(b"PK") else ".npy"
    if len(head) > 1 and head[1] == 0x50 and 0 < head[0] < 9:  # 9 and more may begin a text
        return ".c3d"
    text = decoded(head).lstrip()
    lines = [line.strip() for line in text.splitlines()]
    if "HIERARCHY" in lines[:20]:
        return ".bvh"
    if any(line.lower() == "endheader" or line.lower().startswith("indegrees") for line in lines):
        return ".mot"
    if text.startswith("<"):
        return ".mvnx" if "<mvnx" in text else None
    starts = {"PathFileType": ".trc", "Format Version": ".csv", "NO_OF_FRAMES": ".tsv", "Trajectories": ".csv"}
    starts |= {"{": ".json", "[": ".json"}
    return next((ending for start, ending in starts.items() if text.startswith(start)), None)
