"""What the user says of a file goes before what the file says, and that before what is recognised."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from maniport.demonstrations.conventions import in_metres, numbered, upward
from maniport.demonstrations.recording import MAX_POSITION, Recording
from maniport.demonstrations.repair import in_order, without_zeros
from maniport.errors import FileFormatError, InvalidInputError, argument, as_text
from maniport.input_limits import FRAMES, PLACES, POINTS, require_at_most
from maniport.validation import Array

SLOWEST = 1.0
"""Who records motion takes no fewer frames a second [Hz]: times that say so are not seconds."""
PARTS = {"milliseconds": 1e-3, "microseconds": 1e-6, "nanoseconds": 1e-9}
"""What they are then: the first that makes them no fewer."""

LARGEST_ANGLE = 1e3
"""No joint is turned so far [rad]; what is beyond counts as missing."""
LEAST_RATE = 1e-6
"""What a file calls its rate and is below it is none [Hz]."""
SEEN = 0.5
"""A point that is trusted less is missing, as in MediaPipe's own drawings."""


@dataclass(frozen=True)
class Given:
    """What the user said of a file; None where nothing.

    Attributes
    ----------
    scale : float, optional
        Metres per unit of length.
    up : str, optional
        The axis that points up, one of `maniport.demonstrations.recording.UP_AXES`.
    rate : float, optional
        Frames per second.
    """

    scale: float | None = None
    up: str | None = None
    rate: float | None = None

    def recording(
        self,
        file: Path,
        names: Sequence[str],
        positions: ArrayLike,
        time: ArrayLike | None = None,
        unit: str = "",
        up: str = "",
        by: str = "as the file says",
        usual: str = "z",
        notes: Sequence[str] = (),
        unit_by: str = "as the file says",
    ) -> Recording:
        """The recording in metres, with notes on what was given, read and recognised."""
        with np.errstate(over="ignore"):  # of numbers with more digits
            places = np.array(positions, dtype=np.float64)
        unique = numbered(names)
        found = [*notes, *(["names that occur more than once were numbered"] if unique != list(names) else [])]
        require_at_most(len(names), POINTS, "points", file)
        require_at_most(len(places), FRAMES, "frames", file)
        require_at_most(places.size // 3, PLACES, "places (frames × points)", file)
        if places.ndim != 3 or places.shape[1:] != (len(unique), 3) or not places.size:
            raise FileFormatError(
                f"{file}: positions must have shape (n, k, 3) for {len(unique)} names, with n ≥ 1; found {places.shape}"
            )
        places[~(np.abs(places) <= MAX_POSITION).all(axis=-1)] = np.nan
        if np.isnan(places).all():
            raise FileFormatError(f"{file}: every point is missing in every frame")
        tracks = {name: places[:, i] for i, name in enumerate(unique)}
        scale, unit_note = in_metres(tracks, self.scale, str(file), unit, unit_by)
        direction, up_note = upward(tracks, self.up, usual, up, by)
        if self.rate is not None:
            found.insert(0, f"frames per second given by the caller: {self.rate:g}")
            time = np.arange(len(places)) / self.rate
        elif time is None:
            raise FileFormatError(
                f"{file}: the file does not say how fast its frames follow one another; "
                f"give {argument('rate')} the frames per second"
            )
        times = np.asarray(time)
        if times.ndim != 1 or times.dtype.kind not in "fiu":
            raise FileFormatError(
                f"{file}: time must be numbers [s] of shape (n,); found {times.dtype} of shape {times.shape}"
            )
        try:
            times, recognised = _in_seconds(times.astype(np.float64))
            times, places, ordered = in_order(times, places)
            notes = (unit_note, up_note, *found, *recognised, *ordered)
            return without_zeros(Recording(tuple(unique), places * scale, times, direction, as_text(file.name), notes))
        except InvalidInputError as error:
            raise FileFormatError(f"{file}: {error}") from None


def _in_seconds(time: Array) -> tuple[Array, list[str]]:
    """Times that cannot be seconds, in seconds, with a note on what they were taken for."""
    step = float(np.median(np.diff(time))) if len(time) > 1 else 0.0
    part = next((part for part, scale in PARTS.items() if step * scale * SLOWEST <= 1.0 < step * SLOWEST), None)
    if part is None:
        return time, []
    return time * PARTS[part], [f"times recognised as {part}: as seconds, frames would be {step:.4g} s apart"]


def drop_unsure(positions: Array, trust: Array) -> list[str]:
    """Make missing, in place, what is trusted too little; a note on how much that is."""
    low = trust < SEEN
    positions[low] = np.nan
    return [f"{low.mean():.1%} of all points are trusted less than {SEEN} and count as missing"] if low.any() else []
