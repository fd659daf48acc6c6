"""What a file may leave open: its unit of length and the axis that points up."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from maniport.demonstrations.recording import UP_AXES
from maniport.errors import FileFormatError

Array = NDArray[np.float64]

UNITS = {"m": 1.0, "dm": 0.1, "cm": 0.01, "mm": 0.001, "inch": 0.0254, "CMU": 0.0254 / 0.45}
"""Units of length [m]. ``"CMU"`` is that of the CMU motion capture database: 0.45 of it make an inch."""

RECOGNISED = ("m", "cm", "mm", "inch", "CMU")
"""The units that are recognised; the upper-arm range is narrow enough that no two of them fit one length."""

UPPER_ARM = (0.20, 0.42)
"""Plausible lengths of an upper arm [m], from a child of ten to the tallest adults."""

POSSIBLE_UPPER_ARM = (0.1, 0.6)
"""Lengths of an upper arm [m] outside of which the unit that a file declares cannot be right."""

_SPELLINGS = {"meter": "m", "metre": "m", "meters": "m", "metres": "m", "centimeters": "cm", "centimetres": "cm",
              "millimeters": "mm", "millimetres": "mm", "in": "inch", "inches": "inch", "cmu": "CMU"}  # fmt: skip

_ARMS = (
    ("RightArm", "RightForeArm"), ("RightUpperArm", "RightLowerArm"), ("RightUpArm", "RightLowArm"),
    ("RightShoulder", "RightElbow"), ("LeftArm", "LeftForeArm"), ("RFSH", "RELB"), ("RSHO", "RELB"), ("LSHO", "LELB"),
    ("RShldr", "RForeArm"), ("shoulder", "elbow"),
)  # fmt: skip
_HIGH = ("Head", "Neck", "ARIEL", "LFHD", "RFHD", "C7", "CLAV", "trunk_high")
_LOW = ("Hips", "Spine", "LowerBack", "LFWT", "RFWT", "LASI", "RASI", "SACR", "T10", "STRN", "trunk_low")


def known_unit(text: str) -> str | None:
    """Name of the unit that a file spells in its own way, or None."""
    name = text.strip().strip("\"'").lower()
    name = _SPELLINGS.get(name, name)
    return name if name in UNITS else None


def in_metres(points: Mapping[str, Array], scale: float | None, source: str, declared: str = "") -> tuple[float, str]:
    """Metres per unit, with a note on where that is from: the caller, else what the file declares, else recognised.

    Raises
    ------
    FileFormatError
        When what the file declares makes no upper arm, or nothing is declared or recognised.
    """
    if scale is not None:
        return scale, f"unit given by the caller: 1 unit = {scale:.5g} m"
    unit = known_unit(declared)
    if unit is None:
        return recognise_unit(points, source)
    arm = upper_arm_length(points)
    if arm is not None and not POSSIBLE_UPPER_ARM[0] <= arm[1] * UNITS[unit] <= POSSIBLE_UPPER_ARM[1]:
        raise FileFormatError(
            f"{source}: the file says its unit is {unit}, but that makes the upper arm ({arm[0]}) "
            f"{arm[1] * UNITS[unit]:.4g} m long; give unit= one of {', '.join(map(repr, UNITS))}"
        )
    return UNITS[unit], f"unit {unit}, as the file says"


def recognise_unit(points: Mapping[str, Array], source: str) -> tuple[float, str]:
    """Recognise the unit by the one that makes the upper arm as long as an upper arm is.

    Parameters
    ----------
    points : mapping of str to array, shape (n_frames, 3)
        Positions in the file's unit.
    source : str
        The file, for the messages.

    Returns
    -------
    scale : float
        Metres per unit.
    note : str
        What was recognised, and by what.

    Raises
    ------
    FileFormatError
        When no upper arm is found or no unit makes it plausible; the message asks for ``unit=``.
    """
    arm = upper_arm_length(points)
    choices = ", ".join(map(repr, UNITS))
    if arm is None:
        raise FileFormatError(
            f"{source}: the unit of length cannot be recognised, for no upper arm was found among the points; "
            f"give unit= one of {choices}"
        )
    name, length = arm
    plausible = [unit for unit in RECOGNISED if UPPER_ARM[0] <= length * UNITS[unit] <= UPPER_ARM[1]]
    if not plausible:
        raise FileFormatError(
            f"{source}: the unit of length cannot be recognised: the upper arm ({name}) is {length:.4g} units long, "
            f"and none of {', '.join(RECOGNISED)} makes that {UPPER_ARM[0]} to {UPPER_ARM[1]} m; "
            f"give unit= one of {choices}"
        )
    scale = UNITS[plausible[0]]
    note = (
        f"unit recognised as {plausible[0]} (1 unit = {scale:.5g} m): "
        f"the upper arm ({name}) is {length:.4g} units long, {length * scale:.3f} m"
    )
    return scale, note


def upper_arm_length(points: Mapping[str, Array]) -> tuple[str, float] | None:
    """Find an upper arm by its names and measure its median length in the file's unit."""
    by_key = {name.rsplit(":", 1)[-1].lower(): name for name in reversed(list(points))}
    for shoulder, elbow in _ARMS:
        names = by_key.get(shoulder.lower()), by_key.get(elbow.lower())
        if names[0] is not None and names[1] is not None:
            lengths = np.linalg.norm(points[names[0]] - points[names[1]], axis=-1)
            if np.isfinite(lengths).any():
                return f"{names[0]} to {names[1]}", float(np.nanmedian(lengths))
    return None


def upward(
    points: Mapping[str, Array], up: str | None, usual: str, declared: str = "", by: str = ""
) -> tuple[str, str]:
    """The axis that points up, with a note on where that is from: the caller, else the file (`by`), else recognised."""
    if up is not None:
        return up, f"up axis given by the caller: {up}"
    if declared in UP_AXES:
        return declared, f"up axis {declared}, {by}"
    return recognise_up(points, usual)


def recognise_up(points: Mapping[str, Array], default: str) -> tuple[str, str]:
    """Recognise the axis that points up: the one along which head or neck lie above the hips or the lower trunk.

    Returns
    -------
    up : str
        One of `UP_AXES`; `default` when no such points are there or the body lies aslant.
    note : str
        What was recognised, and by what.
    """
    high, low = _first(points, _HIGH), _first(points, _LOW)
    if high and low:
        step = points[high] - points[low]
        seen = np.isfinite(step).all(axis=-1)
        if seen.any():
            mean = step[seen].mean(axis=0)
            axis = int(np.argmax(np.abs(mean)))
            if np.abs(mean[axis]) > 0.75 * np.linalg.norm(mean):
                up = ("" if mean[axis] > 0 else "-") + "xyz"[axis]
                return up, f"up axis recognised as {up}: {high} lies above {low} along it"
    return default, f"up axis taken as {default}, the usual one: the points do not tell"


def numbered(names: Sequence[str]) -> list[str]:
    """Number the names that occur again."""
    return [name if name not in names[:i] else f"{name}#{names[:i].count(name) + 1}" for i, name in enumerate(names)]


def _first(points: Mapping[str, Array], names: tuple[str, ...]) -> str | None:
    by_key = {name.rsplit(":", 1)[-1].lower(): name for name in reversed(list(points))}
    there = (by_key.get(name.lower()) for name in names)
    return next((name for name in there if name is not None and np.isfinite(points[name]).any()), None)
