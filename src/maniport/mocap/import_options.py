"""Unit and rate of a file: from the caller, else from the file, else recognized from the points."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from maniport.arms.chain import SIDES
from maniport.errors import FileFormatError, InvalidInputError, argument, as_text
from maniport.mocap.cleaning import in_order, without_zeros
from maniport.mocap.marker_sets import find_roles, whole_bodies
from maniport.mocap.recording import MAX_POSITION, Recording
from maniport.mocap.roles import direction
from maniport.util.input_limits import FRAMES, PLACES, POINTS, require_at_most
from maniport.util.validation import Array

UNITS = {"m": 1.0, "dm": 0.1, "cm": 0.01, "mm": 0.001, "inch": 0.0254, "CMU": 0.0254 / 0.45}
"""Units of length [m]. ``"CMU"`` is that of the CMU motion capture database: 0.45 of it make an inch."""

UPPER_ARM = (0.20, 0.42)
"""Usual lengths of an upper arm [m], from a child of ten to the tallest adults.

The range is narrow enough that no two of the recognized units, all but "dm", fit one length."""

POSSIBLE_UPPER_ARM = (0.1, 0.6)  # Lengths of an upper arm [m] outside of which a declared unit is wrong


@dataclass(frozen=True)
class ImportOptions:
    """Options of the caller for reading a file; None for the values of the file."""

    unit: str | None = None  # one of `UNITS`
    rate: float | None = None  # frames per second

    def recording(
        self,
        file: Path,
        names: Sequence[str],
        positions: ArrayLike,
        time: ArrayLike | None = None,
        unit: str = "",
        origin: str = "stated in the file",
        notes: Sequence[str] = (),
        quality_warnings: Sequence[str] = (),
        measured: bool = True,
    ) -> Recording:
        """Make the recording in meters, with notes on the unit, the rate and missing points.

        `names` that repeat are numbered. `positions` (n_frames, n_points, 3) are in the unit of the file; nan, and
        points farther than 1e12, are missing. `time` [s] is None where the file has neither times nor a rate. `unit`
        is empty where the file does not state it; `origin` describes why it is this one. The rest is as in `Recording`.

        Raises
        ------
        FileFormatError
            When the values are no recording, or unit or rate are unknown.
        """
        with np.errstate(over="ignore"):  # of wider floating-point types
            points = np.array(positions, dtype=np.float64)
        count: Counter[str] = Counter()
        unique: list[str] = []
        for name in names:
            count[name] += 1
            unique.append(name if count[name] == 1 else f"{name}#{count[name]}")
        notes = list(notes)
        if len(count) < len(unique):
            notes.append("names that occur more than once were numbered")
        require_at_most(len(unique), POINTS, "points", file)
        require_at_most(len(points), FRAMES, "frames", file)
        require_at_most(points.size // 3, PLACES, "places (frames × points)", file)
        if points.ndim != 3 or points.shape[1:] != (len(unique), 3) or not points.size:
            raise FileFormatError(
                f"{file}: positions must have shape (n, k, 3) for {len(unique)} names, with n ≥ 1; found {points.shape}"
            )
        missing = ~(np.abs(points) <= MAX_POSITION).all(axis=-1)
        points[missing] = np.nan
        if missing.all():
            raise FileFormatError(f"{file}: every point is missing in every frame")
        if missing.any():
            never = np.flatnonzero(missing.all(axis=0)).tolist()
            names = ", ".join(unique[i] for i in never[:20]) + (", …" if len(never) > 20 else "")
            notes.append(
                f"{100 * missing.mean():.1f} % of all points are missing{f'; always: {names}' if never else ''}"
            )
        if self.rate is not None:
            notes.insert(0, f"frames per second set by the caller: {self.rate:g}")
            time = np.arange(len(points)) / self.rate
        elif time is None:
            raise FileFormatError(
                f"{file}: the file states no frame rate; give {argument('rate')} in frames per second"
            )
        times = np.asarray(time)
        if times.ndim != 1 or times.dtype.kind not in "fiu":
            raise FileFormatError(
                f"{file}: time must be numbers [s] of shape (n,); found {times.dtype} of shape {times.shape}"
            )
        times = times.astype(np.float64)
        step = float(np.median(np.diff(times))) if len(times) > 1 else 0.0
        for unit_of_time, scale in {"milliseconds": 1e-3, "microseconds": 1e-6, "nanoseconds": 1e-9}.items():
            if step * scale <= 1.0 < step:
                times = times * scale
                text = f"as seconds, frames would be {step:.4g} s apart"
                notes.append(f"times recognized as {unit_of_time}: {text}")
                break
        try:
            times, points, ordered = in_order(times, points)
            source = as_text(file.name)
            raw = Recording(tuple(unique), points, times, source, (), tuple(quality_warnings), "", measured)
        except InvalidInputError as error:
            raise FileFormatError(f"{file}: {error}") from None
        scale, unit_note = self._scale(raw, file, unit, origin)
        notes = [unit_note, *notes, *ordered]
        return without_zeros(replace(raw, positions=raw.positions * scale, notes=tuple(notes)))

    def _scale(self, recording: Recording, file: Path, declared: str, origin: str) -> tuple[float, str]:
        """Return meters per unit, with a note on the origin."""
        if self.unit is not None:
            return UNITS[self.unit], f"unit set by the caller: {self.unit}"
        unit, arm = known_unit(declared), _upper_arm(recording)
        if unit is not None:
            if arm is not None and not POSSIBLE_UPPER_ARM[0] <= arm[1] * UNITS[unit] <= POSSIBLE_UPPER_ARM[1]:
                raise FileFormatError(f"{file}: {_implausible(arm, unit, f'the unit {unit}, {origin},')}")
            return UNITS[unit], f"unit {unit}, {origin}"
        fitting = [] if arm is None else _fitting_units(arm[1])
        if arm is None or not fitting:
            why = f"the upper arm ({arm[0]}) has {arm[1]:.4g} units" if arm else "no points are those of an upper arm"
            names = ", ".join(recording.names[:12]) + (", …" if len(recording.names) > 12 else "")
            raise FileFormatError(
                f"{file}: the unit of length cannot be recognized: {why}; give {argument('unit')} one of "
                f"{', '.join(map(repr, UNITS))}. Points: {names}"
            )
        scale = UNITS[fitting[0]]
        length = f"the upper arm ({arm[0]}) is {arm[1]:.4g} units long, {arm[1] * scale:.3f} m"
        return scale, f"unit recognized as {fitting[0]} (1 unit = {scale:.5g} m): {length}"

    def checked(self, recording: Recording) -> Recording:
        """Compare the options with the points; add data-quality warnings.

        Raises
        ------
        InvalidInputError
            When the unit makes an impossible upper arm.
        """
        warnings = list(recording.quality_warnings)
        for side in SIDES:
            first, *others = whole_bodies(recording.observed, side) or ("",)
            if others:
                shoulder = list(find_roles(recording.observed, side, others[0])[1]["shoulder"])
                warnings.append(
                    f"the points are those of several bodies: {', '.join((first, *others))}; the first that has a "
                    "whole arm is used. Assign a point of another one to use that: "
                    f"{argument('markers', {'shoulder': shoulder})}"
                )
                break
        arm = _upper_arm(recording) if self.unit else None
        if self.unit is not None and arm is not None and not UPPER_ARM[0] <= arm[1] <= UPPER_ARM[1]:
            text = _implausible((arm[0], arm[1] / UNITS[self.unit]), self.unit, argument("unit", self.unit))
            if not POSSIBLE_UPPER_ARM[0] <= arm[1] <= POSSIBLE_UPPER_ARM[1]:
                raise InvalidInputError(f"{recording.source}: {text}")
            warnings.append(text)
        return replace(recording, quality_warnings=tuple(warnings))


def known_unit(text: str) -> str | None:
    """Return the name of the unit that a file spells in its own way, or None."""
    name = text.strip().strip("\"'").lower()
    singular = name.removesuffix("s").replace("metre", "meter")
    spellings = {"millimeter": "mm", "centimeter": "cm", "meter": "m", "in": "inch", "inche": "inch", "cmu": "CMU"}
    name = spellings.get(singular, name)
    return name if name in UNITS else None


def drop_untrusted(positions: Array, confidence: Array, least: float = 0.5) -> list[str]:
    """Mark keypoints of low confidence as missing, in place; `least` is that of MediaPipe's own drawings."""
    low = confidence < least
    positions[low] = np.nan
    return (
        [f"{100 * low.mean():.1f} % of all points have a confidence below {least} and count as missing"]
        if low.any()
        else []
    )


def _implausible(arm: tuple[str, float], unit: str, cause: str) -> str:
    """Describe an upper arm, in the unit of the file, of implausible length, with the units that make it plausible."""
    name, length = arm[0], arm[1] * UNITS[unit]
    possible = POSSIBLE_UPPER_ARM[0] <= length <= POSSIBLE_UPPER_ARM[1]
    low, high = UPPER_ARM if possible else POSSIBLE_UPPER_ARM
    better = "".join(
        f"; {argument('unit', fit)} makes it {arm[1] * UNITS[fit]:.3g} m" for fit in _fitting_units(arm[1])
    )
    return (
        f"{cause} makes the upper arm ({name}) {length:.3g} m long; {'usual' if possible else 'possible'} are {low} to "
        f"{high} m{better}"
    )


def _fitting_units(length: float) -> list[str]:
    """Return the recognized units in which a length is that of an upper arm."""
    return [unit for unit in UNITS if unit != "dm" and UPPER_ARM[0] <= length * UNITS[unit] <= UPPER_ARM[1]]


def _upper_arm(recording: Recording) -> tuple[str, float] | None:
    """Find an upper arm by the names of its ends; return them and its median length in the unit of the points."""
    for side in SIDES:
        roles = find_roles(recording.observed, side)[1]
        if "shoulder" in roles and "elbow" in roles:
            length = np.linalg.norm(direction(recording, (roles["shoulder"], roles["elbow"])), axis=-1)
            length = length[np.isfinite(length)]
            if len(length):
                median = float(np.quantile(length, 0.5, method="lower"))  # not the mean of two units
                return f"{'+'.join(roles['shoulder'])} to {'+'.join(roles['elbow'])}", median
    return None
