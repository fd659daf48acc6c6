"""What a file may leave open: its unit of length and the axis that points up."""

from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np

from maniport.bodies.chain import SIDES
from maniport.demonstrations.dialects import find_roles
from maniport.demonstrations.recording import UP_AXES
from maniport.errors import FileFormatError, argument
from maniport.validation import Array

UNITS = {"m": 1.0, "dm": 0.1, "cm": 0.01, "mm": 0.001, "inch": 0.0254, "CMU": 0.0254 / 0.45}
"""Units of length [m]. ``"CMU"`` is that of the CMU motion capture database: 0.45 of it make an inch."""

RECOGNISED = ("m", "cm", "mm", "inch", "CMU")
"""The units that are recognised; the upper-arm range is narrow enough that no two of them fit one length."""

UPPER_ARM = (0.20, 0.42)
"""Plausible lengths of an upper arm [m], from a child of ten to the tallest adults."""

POSSIBLE_UPPER_ARM = (0.1, 0.6)
"""Lengths of an upper arm [m] outside of which the unit that a file declares cannot be right."""

_SPELLINGS = {"millimeter": "mm", "millimetre": "mm", "centimeter": "cm", "centimetre": "cm",
              "meter": "m", "metre": "m", "meters": "m", "metres": "m", "centimeters": "cm", "centimetres": "cm",
              "millimeters": "mm", "millimetres": "mm", "in": "inch", "inches": "inch", "cmu": "CMU"}  # fmt: skip


def known_unit(text: str) -> str | None:
    """Name of the unit that a file spells in its own way, or None."""
    name = text.strip().strip("\"'").lower()
    name = _SPELLINGS.get(name, name)
    return name if name in UNITS else None


def in_metres(
    points: Mapping[str, Array], scale: float | None, source: str, declared: str = "", by: str = "as the file says"
) -> tuple[float, str]:
    """Metres per unit, with a note on where that is from: the caller, else what the file declares, else recognised."""
    if scale is not None:
        return scale, f"unit given by the caller: 1 unit = {scale:.5g} m"
    unit, arm = known_unit(declared), upper_arm(points)
    if unit is None:
        return _recognised_unit(arm, source, list(points))
    if arm is not None and not POSSIBLE_UPPER_ARM[0] <= arm[1] * UNITS[unit] <= POSSIBLE_UPPER_ARM[1]:
        raise FileFormatError(
            f"{source}: the file says its unit is {unit}, but that makes the upper arm ({arm[0]}) "
            f"{arm[1] * UNITS[unit]:.4g} m long; {_give_unit(arm[1])}"
        )
    return UNITS[unit], f"unit {unit}, {by}"


def _recognised_unit(arm: tuple[str, float] | None, source: str, names: Sequence[str]) -> tuple[float, str]:
    if arm is None:
        raise FileFormatError(
            f"{source}: the unit of length cannot be recognised, for no upper arm was found among the points "
            f"({', '.join(names[:12])}{', …' if len(names) > 12 else ''}); {_give_unit()}"
        )
    name, length = arm
    plausible = fitting_units(length)
    if not plausible:
        raise FileFormatError(
            f"{source}: the unit of length cannot be recognised: the upper arm ({name}) is {length:.4g} units long, "
            f"and none of {', '.join(RECOGNISED)} makes that {UPPER_ARM[0]} to {UPPER_ARM[1]} m; "
            f"{_give_unit()}"
        )
    scale = UNITS[plausible[0]]
    note = (
        f"unit recognised as {plausible[0]} (1 unit = {scale:.5g} m): "
        f"the upper arm ({name}) is {length:.4g} units long, {length * scale:.3f} m"
    )
    return scale, note


def _give_unit(length: float = 0.0) -> str:
    """Ask for the unit; for the one that makes a length that of an upper arm, where there is one."""
    fitting = fitting_units(length)
    if fitting:
        return f"give {argument('unit', fitting[0])}, which makes it {length * UNITS[fitting[0]]:.3g} m"
    return f"give {argument('unit')} one of {', '.join(map(repr, UNITS))}"


def fitting_units(length: float) -> list[str]:
    """The units, of those that are recognised, with which a length is that of an upper arm."""
    return [unit for unit in RECOGNISED if UPPER_ARM[0] <= length * UNITS[unit] <= UPPER_ARM[1]]


def upper_arm(points: Mapping[str, Array]) -> tuple[str, float] | None:
    """Find an upper arm by the names of its ends and measure its median length in the file's unit."""
    for side in SIDES:
        roles = find_roles(_seen(points), side)[1]
        if "shoulder" in roles and "elbow" in roles:
            length = np.linalg.norm(_mean(points, roles["elbow"]) - _mean(points, roles["shoulder"]), axis=-1)
            length = length[np.isfinite(length)]
            if len(length):
                middle = float(np.quantile(length, 0.5, method="lower"))  # of two units never the mean
                return f"{'+'.join(roles['shoulder'])} to {'+'.join(roles['elbow'])}", middle
    return None


def upward(
    points: Mapping[str, Array], up: str | None, usual: str, declared: str = "", by: str = ""
) -> tuple[str, str]:
    """The axis that points up, with a note on where that is from: the caller, else the file (`by`), else recognised."""
    if up is not None:
        return up, f"up axis given by the caller: {up}"
    if declared in UP_AXES:
        return declared, f"up axis {declared}, {by}"
    pair = find_roles(_seen(points))[1].get("trunk_up")
    if pair is not None:
        low, high = pair
        step = _mean(points, high) - _mean(points, low)
        seen = np.isfinite(step).all(axis=-1)
        if seen.any():
            mean = step[seen].mean(axis=0)
            axis = int(np.argmax(np.abs(mean)))
            if np.abs(mean[axis]) > 0.75 * np.linalg.norm(mean):
                found = ("" if mean[axis] > 0 else "-") + "xyz"[axis]
                return found, f"up axis recognised as {found}: {'+'.join(high)} lies above {'+'.join(low)} along it"
    return usual, f"up axis taken as {usual}, the usual one: the points do not tell"


def numbered(names: Sequence[str]) -> list[str]:
    """Number the names that occur again."""
    seen: Counter[str] = Counter()
    result = []
    for name in names:
        seen[name] += 1
        result.append(name if seen[name] == 1 else f"{name}#{seen[name]}")
    return result


def _seen(points: Mapping[str, Array]) -> list[str]:
    return [name for name, track in points.items() if np.isfinite(track).any()]


def _mean(points: Mapping[str, Array], names: Sequence[str]) -> Array:
    return np.asarray(np.mean([points[name] for name in names], axis=0))
