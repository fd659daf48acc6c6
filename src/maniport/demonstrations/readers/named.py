"""Positions of joints in an array, with the names that belong to them."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from maniport.demonstrations.given import Given
from maniport.demonstrations.readers.skeletons import SKELETONS, UP, recognised
from maniport.demonstrations.readers.text import decoded
from maniport.demonstrations.recording import Recording
from maniport.errors import FileFormatError
from maniport.input_limits import PLACES, SETTINGS_BYTES, read_whole, require_at_most

BESIDE = (".names.txt", ".names.json")
"""Endings of a file of names, in the place of the recording's own."""


def named_positions(
    file: Path, given: Given, names: Any, positions: Any, time: Any, unit: str = "", up: str = ""
) -> Recording:
    """A recording of positions (n, k, 3), whose names are given, stand beside the file or are recognised."""
    places = np.asarray(positions)
    if places.ndim != 3 or places.shape[-1] != 3 or places.dtype.kind not in "fiu":
        raise FileFormatError(
            f"{file}: positions must be numbers of shape (n, k, 3); found {places.shape} of {places.dtype}"
        )
    require_at_most(places.size // 3, PLACES, "places (frames × points)", file)
    if places.dtype.kind != "f" or places.dtype.itemsize < 4:
        places = places.astype(np.float64)
    notes: list[str] = []
    if names is None:
        names = _beside(file)
    by = "as the file says"
    if names is None:
        skeleton = recognised(file, places)
        names, up, by = SKELETONS[skeleton], up or UP.get(skeleton, ""), f"as in {skeleton}"
        notes.append(f"{len(names)} joints without names: taken as {skeleton}, whose arms these are")
    array = np.atleast_1d(np.asarray(names))
    if array.dtype.kind == "S":
        array = np.char.decode(array, "utf-8", "replace")
    if array.dtype.kind not in "US" or array.ndim != 1:
        raise FileFormatError(f"{file}: names must be text; found names of {array.dtype}, shape {array.shape}")
    if len(array) != places.shape[1]:
        raise FileFormatError(
            f"{file}: {len(array)} names do not fit positions of shape {places.shape}: one for each of the "
            f"{places.shape[1]} joints is needed"
        )
    return given.recording(file, [str(name) for name in array.tolist()], places, time, unit, up, by, notes=notes)


def _beside(file: Path) -> Sequence[str] | None:
    """Names from a file beside the recording: one a line, or a JSON list."""
    for ending in BESIDE:
        beside = file.with_suffix(ending)
        if not beside.exists():
            continue
        text = decoded(read_whole(beside, (), SETTINGS_BYTES))
        if ending == ".names.txt":
            return [line.strip() for line in text.splitlines() if line.strip()]
        try:
            names = json.loads(text)
        except (ValueError, RecursionError) as error:
            raise FileFormatError(f"{beside}: not readable as JSON: {error}") from None
        if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
            raise FileFormatError(f"{beside}: must hold a list of names")
        return names
    return None
