"""Unit, vertical axis and rate of a file: from the caller, else from the file, else recognized from the points."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from maniport.arms.chain import SIDES
from maniport.errors import FileFormatError, InvalidInputError, argument, as_text
from maniport.mocap.cleaning import in_order, without_zeros
from maniport.mocap.marker_sets import find_legs, find_roles, whole_bodies
from maniport.mocap.recording import MAX_POSITION, UP_AXES, Recording
from maniport.util.input_limits import FRAMES, PLACES, POINTS, require_at_most
from maniport.util.validation import Array

UNITS = {"m": 1.0, "dm": 0.1, "cm": 0.01, "mm": 0.001, "inch": 0.0254, "CMU": 0.0254 / 0.45}
"""Units of length [m]. ``"CMU"`` is that of the CMU motion capture database: 0.45 of it make an inch."""

RECOGNIZED = ("m", "cm", "mm", "inch", "CMU")
"""Units that are recognized; `UPPER_ARM` is narrow enough that no two of them fit one length."""

UPPER_ARM = (0.20, 0.42)  # Usual lengths of an upper arm [m], from a child of ten to the tallest adults

POSSIBLE_UPPER_ARM = (0.1, 0.6)  # Lengths of an upper arm [m] outside of which a declared unit is wrong

LARGEST_ANGLE = 1e3  # Joint angles beyond this count as missing [rad]


@dataclass(frozen=True)
class ImportOptions:
    """Options of the caller for reading a file; None where not given."""

    scale: float | None = None  # unit of length [m]
    up: str | None = None  # vertical axis, one of `UP_AXES`
    rate: float | None = None  # frames per second

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
        """Make the recording in metres, with notes on what was given, read and recognized."""
        with np.errstate(over="ignore"):  # of numbers with more digits
            places = np.array(positions, dtype=np.float64)
        unique = _numbered(names)
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
        scale, unit_note = _in_metres(tracks, self.scale, str(file), unit, unit_by)
        axis, up_note = _vertical(tracks, self.up, usual, up, by)
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
            times, recognized = _in_seconds(times.astype(np.float64))
            times, places, ordered = in_order(times, places)
            notes = (unit_note, up_note, *found, *recognized, *ordered)
            return without_zeros(Recording(tuple(unique), places * scale, times, axis, as_text(file.name), notes))
        except InvalidInputError as error:
            raise FileFormatError(f"{file}: {error}") from None


def require_plausible(recording: Recording, unit: str | None, up: str | None) -> Recording:
    """Compare the caller's options with the points; add data-quality warnings."""
    quality_warnings = [*_several_bodies(recording)]
    quality_warnings += [] if unit is None else _implausible_unit(recording, unit)
    quality_warnings += [] if up is None else _implausible_axis(recording, up)
    return (
        replace(recording, quality_warnings=(*recording.quality_warnings, *quality_warnings))
        if quality_warnings
        else recording
    )


def known_unit(text: str) -> str | None:
    """Return the name of the unit that a file spells in its own way, or None."""
    name = text.strip().strip("\"'").lower()
    singular = name.removesuffix("s").replace("metre", "meter")
    spellings = {"millimeter": "mm", "centimeter": "cm", "meter": "m", "in": "inch", "inche": "inch", "cmu": "CMU"}
    name = spellings.get(singular, name)
    return name if name in UNITS else None


def drop_untrusted(positions: Array, trust: Array, least: float = 0.5) -> list[str]:
    """Mark keypoints of low confidence as missing, in place; `least` is that of MediaPipe's own drawings."""
    low = trust < least
    positions[low] = np.nan
    return [f"{low.mean():.1%} of all points are trusted less than {least} and count as missing"] if low.any() else []


def _in_seconds(time: Array) -> tuple[Array, list[str]]:
    """Convert times that cannot be seconds, as frames would be more than a second apart, with a note."""
    step = float(np.median(np.diff(time))) if len(time) > 1 else 0.0
    for name, scale in {"milliseconds": 1e-3, "microseconds": 1e-6, "nanoseconds": 1e-9}.items():
        if step * scale <= 1.0 < step:
            return time * scale, [f"times recognised as {name}: as seconds, frames would be {step:.4g} s apart"]
    return time, []


def _in_metres(
    points: Mapping[str, Array], scale: float | None, source: str, declared: str, by: str
) -> tuple[float, str]:
    """Return metres per unit, with a note on the origin."""
    if scale is not None:
        return scale, f"unit given by the caller: 1 unit = {scale:.5g} m"
    unit, arm = known_unit(declared), _upper_arm(points)
    if unit is not None:
        low, high = POSSIBLE_UPPER_ARM
        if arm is not None and not low <= arm[1] * UNITS[unit] <= high:
            raise FileFormatError(
                f"{source}: the file says its unit is {unit}, but that makes the upper arm ({arm[0]}) "
                f"{arm[1] * UNITS[unit]:.4g} m long; {_advise_unit(arm[1])}"
            )
        return UNITS[unit], f"unit {unit}, {by}"
    if arm is None:
        names = list(points)
        raise FileFormatError(
            f"{source}: the unit of length cannot be recognised, for no upper arm was found among the points "
            f"({', '.join(names[:12])}{', …' if len(names) > 12 else ''}); {_advise_unit()}"
        )
    name, length = arm
    plausible = _fitting_units(length)
    if not plausible:
        raise FileFormatError(
            f"{source}: the unit of length cannot be recognised: the upper arm ({name}) is {length:.4g} units long, "
            f"and none of {', '.join(RECOGNIZED)} makes that {UPPER_ARM[0]} to {UPPER_ARM[1]} m; {_advise_unit()}"
        )
    scale = UNITS[plausible[0]]
    return scale, (
        f"unit recognised as {plausible[0]} (1 unit = {scale:.5g} m): "
        f"the upper arm ({name}) is {length:.4g} units long, {length * scale:.3f} m"
    )


def _advise_unit(length: float = 0.0) -> str:
    """Advise the unit that makes a length that of an upper arm, else any unit."""
    fitting = _fitting_units(length)
    if fitting:
        return f"give {argument('unit', fitting[0])}, which makes it {length * UNITS[fitting[0]]:.3g} m"
    return f"give {argument('unit')} one of {', '.join(map(repr, UNITS))}"


def _fitting_units(length: float) -> list[str]:
    """Return the recognized units in which a length is that of an upper arm."""
    return [unit for unit in RECOGNIZED if UPPER_ARM[0] <= length * UNITS[unit] <= UPPER_ARM[1]]


def _upper_arm(points: Mapping[str, Array]) -> tuple[str, float] | None:
    """Find an upper arm by the names of its ends; return them and its median length in the unit of the points."""
    for side in SIDES:
        roles = find_roles(_seen(points), side)[1]
        if "shoulder" in roles and "elbow" in roles:
            length = np.linalg.norm(_mean(points, roles["elbow"]) - _mean(points, roles["shoulder"]), axis=-1)
            length = length[np.isfinite(length)]
            if len(length):
                median = float(np.quantile(length, 0.5, method="lower"))  # of two units never the mean
                return f"{'+'.join(roles['shoulder'])} to {'+'.join(roles['elbow'])}", median
    return None


def _vertical(points: Mapping[str, Array], up: str | None, usual: str, declared: str, by: str) -> tuple[str, str]:
    """Return the vertical axis, with a note on the origin."""
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


def _several_bodies(recording: Recording) -> list[str]:
    for side in SIDES:
        first, *others = whole_bodies(recording.seen, side) or ("",)
        if others:
            shoulder = find_roles(recording.seen, side, others[0])[1]["shoulder"]
            return [
                f"the points are those of several bodies: {', '.join((first, *others))}; the first that has a whole "
                f"arm is taken, unless you give a point of another: {argument('markers', {'shoulder': list(shoulder)})}"
            ]
    return []


def _implausible_unit(recording: Recording, unit: str) -> list[str]:
    arm = _upper_arm({name: recording.point(name) for name in recording.seen})
    if arm is None or UPPER_ARM[0] <= arm[1] <= UPPER_ARM[1]:
        return []
    name, length = arm
    own = length / UNITS[unit]
    better = "".join(f"; {argument('unit', fit)} makes it {own * UNITS[fit]:.3g} m" for fit in _fitting_units(own)[:1])
    possible = POSSIBLE_UPPER_ARM[0] <= length <= POSSIBLE_UPPER_ARM[1]
    low, high = UPPER_ARM if possible else POSSIBLE_UPPER_ARM
    text = (
        f"{argument('unit', unit)} makes the upper arm ({name}) {length:.3g} m long; "
        f"those of {'most ' if possible else ''}people have {low} to {high} m{better}"
    )
    if not possible:
        raise InvalidInputError(f"{recording.source}: {text}")
    return [text]


def _implausible_axis(recording: Recording, up: str, least: float = 0.5) -> list[str]:
    """Warn when trunk and legs are far from the vertical axis: the cosine to one of them (median) is below `least`.

    Of people who stand, sit, climb, hang or crawl the one or the other is nearer to upright than 60°.
    """
    pair = find_roles(recording.seen)[1].get("trunk_up")
    if pair is None:
        return []
    low, high = ([recording.point(name) for name in names] for names in pair)
    trunk = _upright(np.mean(high, axis=0) - np.mean(low, axis=0))
    legs = (_upright(recording.point(high) - recording.point(low)) for low, high in find_legs(recording.seen))
    if not trunk or trunk[up] >= least or any(leg.get(up, 0.0) >= least for leg in legs):
        return []
    likely = max(trunk, key=trunk.__getitem__)
    off, less = (f"{np.degrees(np.arccos(np.clip(trunk[axis], -1.0, 1.0))):.0f}°" for axis in (up, likely))
    return [
        f"{argument('up', up)} lets the trunk ({'+'.join(pair[0])} to {'+'.join(pair[1])}) stand {off} off upright "
        f"(median); {argument('up', likely)} lets it stand {less} off"
    ]


def _upright(step: Array) -> dict[str, float]:
    """Return the cosine (median) between a body part and each axis; nothing where it is not seen."""
    along = step[np.linalg.norm(step, axis=-1) > 0]  # without frames in which it is missing
    if not len(along):
        return {}
    along = along / np.linalg.norm(along, axis=-1, keepdims=True)
    signs = {axis: -1.0 if axis[0] == "-" else 1.0 for axis in UP_AXES}
    return {axis: float(np.median(sign * along[:, "xyz".index(axis[-1])])) for axis, sign in signs.items()}


def _numbered(names: Sequence[str]) -> list[str]:
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
