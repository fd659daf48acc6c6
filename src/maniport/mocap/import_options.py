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
            raw = Recording(tuple(unique), points, times, source, (), tuple(quality_warnings))
        except InvalidInputError as error:
            raise FileFormatError(f"{file}: {error}") from None
        scale, unit_note = self._scale(raw, file, unit, origin)
        texts = (unit_note, *notes, *ordered), (*quality_warnings, *_bodies_warning(raw))
        return without_zeros(replace(raw, positions=raw.positions * scale, notes=texts[0], quality_warnings=texts[1]))

    def _scale(self, recording: Recording, file: Path, declared: str, origin: str) -> tuple[float, str]:
        """Return meters per unit, with a note on the origin."""
        unit, (ends, length) = self.unit or known_unit(declared), _upper_arm(recording)
        fitting = [name for name in UNITS if name != "dm" and UPPER_ARM[0] <= length * UNITS[name] <= UPPER_ARM[1]]
        if unit is not None:
            if ends and not POSSIBLE_UPPER_ARM[0] <= length * UNITS[unit] <= POSSIBLE_UPPER_ARM[1]:
                cause = argument("unit", unit) if self.unit else f"the unit {unit}, {origin},"
                better = (f"; {argument('unit', fit)} makes it {length * UNITS[fit]:.3g} m" for fit in fitting)
                raise FileFormatError(
                    f"{file}: {cause} makes the upper arm ({ends}) {length * UNITS[unit]:.3g} m long; possible are "
                    f"{POSSIBLE_UPPER_ARM[0]} to {POSSIBLE_UPPER_ARM[1]} m{''.join(better)}"
                )
            return UNITS[unit], f"unit set by the caller: {unit}" if self.unit else f"unit {unit}, {origin}"
        if not fitting:
            why = f"the upper arm ({ends}) has {length:.4g} units" if ends else "no points are those of an upper arm"
            names = ", ".join(recording.names[:12]) + (", …" if len(recording.names) > 12 else "")
            raise FileFormatError(
                f"{file}: the unit of length cannot be recognized: {why}; give {argument('unit')} one of "
                f"{', '.join(map(repr, UNITS))}. Points: {names}"
            )
        scale = UNITS[fitting[0]]
        text = f"the upper arm ({ends}) is {length:.4g} units long, {length * scale:.3f} m"
        return scale, f"unit recognized as {fitting[0]} (1 unit = {scale:.5g} m): {text}"


def _bodies_warning(recording: Recording) -> list[str]:
    """Report which of several bodies is used."""
    for side in SIDES:
        first, *others = whole_bodies(recording.observed, side) or ("",)
        if others:
            shoulder = list(find_roles(recording.observed, side, others[0])[1]["shoulder"])
            return [
                f"the points are those of several bodies: {', '.join((first, *others))}; the first that has a "
                "whole arm is used. Assign a point of another one to use that: "
                f"{argument('markers', {'shoulder': shoulder})}"
            ]
    return []


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


def _upper_arm(recording: Recording) -> tuple[str, float]:
    """Return the ends of an upper arm and its median length in the unit of the points; nan without one."""
    for side in SIDES:
        roles = find_roles(recording.observed, side)[1]
        if "shoulder" in roles and "elbow" in roles:
            length = np.linalg.norm(direction(recording, (roles["shoulder"], roles["elbow"])), axis=-1)
            if len(length := length[np.isfinite(length)]):
                median = float(np.quantile(length, 0.5, method="lower"))  # not the mean of two units
                return f"{'+'.join(roles['shoulder'])} to {'+'.join(roles['elbow'])}", median
    return "", np.nan
