"""How long the segments of a person's arm are: as recorded or, where that cannot be, by the body height."""

from collections.abc import Mapping

import numpy as np

from maniport.bodies.human import FRACTIONS, LONGEST_SEGMENT, adult_range, segment_length
from maniport.demonstrations.directions import SEGMENTS
from maniport.errors import RecordingError
from maniport.validation import Array

SHORTEST_SEGMENT = 0.005
"""No segment of a human arm is that short [m]."""


def segment_lengths(
    points: Mapping[str, Array], source: str, height: float | None, notes: list[str], measured: bool = True
) -> dict[str, float]:
    """Lengths of the segments that are known [m]."""
    lengths = {name: _measured(points, *ends) for name, ends in SEGMENTS.items() if all(end in points for end in ends)}
    for name, length in lengths.items():
        if length <= SHORTEST_SEGMENT or (height is None and length >= LONGEST_SEGMENT):
            start, end = SEGMENTS[name]
            raise RecordingError(
                f"the {name} in {source!r} is {length:.4g} m long, from {start} to {end}; "
                f"allowed is {SHORTEST_SEGMENT} to {LONGEST_SEGMENT:g} m; is the unit right, do the points differ?"
            )
    if height is None:
        return lengths
    if not measured:
        lengths = {}
    for name in FRACTIONS:
        own, (low, high) = segment_length(name, height), adult_range(name)
        taken = f"{name}: {own:.3f} m by the body height of {height:g} m"
        if name not in lengths:
            notes.append(f"{taken}, as the recording does not show it")
        elif not low <= lengths[name] <= high:
            notes.append(
                f"{taken}, as {lengths[name]:.3g} m in the recording is not between {low:.3f} and {high:.3f} m, those "
                "of adults"
            )
        else:
            continue
        lengths[name] = own
    return lengths


def _measured(points: Mapping[str, Array], start: str, end: str) -> float:
    return float(np.nanmedian(np.linalg.norm(points[end] - points[start], axis=-1)))
