"""Named joint positions as NumPy arrays: what other programs compute, and what `Recording.save` writes."""

from pathlib import Path
from typing import Any

import numpy as np

from maniport.demonstrations.conventions import in_metres, upward
from maniport.demonstrations.recording import Recording
from maniport.errors import FileFormatError, InvalidInputError
from maniport.files import array_names, load_arrays

NEEDED = ("names", "positions")


def read(file: Path, scale: float | None, up: str | None) -> Recording:
    """Read an ``.npz`` file; see `maniport.demonstrations.readers.read_recording`.

    It holds ``names`` (k,), ``positions`` (n, k, 3) and ``time`` (n,) [s] or ``rate`` [Hz]; ``unit`` and ``up`` where
    they are known.
    """
    arrays = load_arrays(file, "recording", (*NEEDED, "time", "rate", "unit", "up"))
    if missing := [name for name in NEEDED if name not in arrays]:
        raise FileFormatError(
            f"{file}: a recording needs the arrays names (k,), positions (n, k, 3), and time (n,) or rate; "
            f"missing: {', '.join(missing)}; found: {', '.join(array_names(file, 'recording')) or 'nothing'}"
        )
    names = np.atleast_1d(arrays["names"])
    positions = np.asarray(arrays["positions"])
    if names.dtype.kind not in "US" or positions.ndim != 3 or positions.dtype.kind not in "fiu":
        raise FileFormatError(
            f"{file}: names must be text and positions numbers of shape (n, k, 3); "
            f"found names of {names.dtype} and positions {positions.shape} of {positions.dtype}"
        )
    points = {str(name): positions[:, i] for i, name in enumerate(names.tolist()[: positions.shape[1]])}
    scale, unit_note = in_metres(points, scale, str(file), _text(arrays, "unit"))
    direction, up_note = upward(points, up, "z", _text(arrays, "up"), "as the file says")
    try:
        return Recording(
            names=tuple(map(str, names.tolist())),
            positions=np.asarray(positions, dtype=np.float64) * scale,
            time=_time(file, arrays, len(positions)),
            up=direction,
            source=file.name,
            notes=tuple(note for note in (unit_note, up_note) if note),
        )
    except InvalidInputError as error:
        raise FileFormatError(f"{file}: {error}") from None


def _time(file: Path, arrays: dict[str, Any], count: int) -> Any:
    if "time" in arrays:
        return arrays["time"]
    rate = np.asarray(arrays.get("rate", np.nan))
    if rate.size != 1 or rate.dtype.kind not in "fiu" or not (np.isfinite(rate).all() and rate.min() > 0):
        raise FileFormatError(f"{file}: a recording needs time (n,) [s], or rate, the frames per second")
    return np.arange(count) / float(rate.reshape(-1)[0])


def _text(arrays: dict[str, Any], name: str) -> str:
    value = np.asarray(arrays.get(name, ""))
    return str(value.reshape(-1)[0]) if value.size == 1 and value.dtype.kind in "US" else ""
