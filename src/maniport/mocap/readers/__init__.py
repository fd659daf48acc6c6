"""Recordings from files; each format is one module and one line of a table.

Unit and rate come from the caller, else from the file; else the unit is recognized from the points.
"""

import importlib
import os
import zipfile
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maniport.arms.chain import LEFT, RIGHT, SIDES
from maniport.arms.human import FRACTIONS
from maniport.errors import (
    FileFormatError,
    InvalidInputError,
    UnknownNameError,
    argument,
    printable,
    spoken,
    unknown_name,
)
from maniport.mocap.cleaning import in_order, without_rest_poses, without_zeros
from maniport.mocap.readers.text import decoded
from maniport.mocap.readers.times import FileTimes, FrameTimes, frame_times, gap_messages
from maniport.mocap.recording import (
    BLOCK,
    MAX_POSITION,
    Recording,
    all_axes,
    beyond_end,
    freeze,
    interval_rows,
    is_within,
    scaled,
)
from maniport.mocap.roles import (
    ARM,
    Markers,
    Roles,
    assigned_roles,
    direction,
    find_roles,
    load_names,
    missing_roles,
    missing_text,
    whole_bodies,
)
from maniport.util.defaults import AUTO, BOTH, RECORDINGS, SHIPPED
from maniport.util.input_limits import (
    FRAMES,
    PLACES,
    POINTS,
    RECORDING_BYTES,
    as_path,
    existing_file,
    require_at_most,
)
from maniport.util.validation import Array, as_choice, as_number

UNITS = {"m": 1.0, "dm": 0.1, "cm": 0.01, "mm": 0.001, "inch": 0.0254, "CMU": 0.0254 / 0.45}
"""Units of length [m]. ``"CMU"`` is that of the CMU motion capture database: 0.45 of it make an inch."""

# Usual lengths of an upper arm [m], from a child of ten to the tallest adults: no two units, but for "dm", fit one.
UPPER_ARM = (0.20, 0.42)
POSSIBLE_UPPER_ARM = (0.1, 0.6)  # [m]; a declared unit is wrong that makes other lengths


STARTS = {
    "PK": ".npz",
    "\ufffdNUMPY": ".npy",
    "{": ".json",
    "[": ".json",
    "PathFileType": ".trc",
    "Format Version": ".csv",
    "NO_OF_FRAMES": ".tsv",
    "Trajectories": ".csv",
}
"""Endings of formats by the beginning of a file."""

Coordinates = NDArray[np.floating | np.integer]
"""Positions as a file has them, in any type of numbers."""


@dataclass(frozen=True)
class ImportOptions:
    """Options of the caller for reading a file; None for the values of the file."""

    unit: str | float | None = None  # one of `UNITS`, or meters per unit
    rate: float | None = None  # frames per second
    height: float | None = None  # of the person [m]; it determines the unit
    markers: Markers = None  # points of roles, as in `fit_arm` or `fit_arms`
    side: str = AUTO  # arm that is wanted
    start: float | None = None  # of the part that is used [s]
    stop: float | None = None  # end of that part [s]
    keep_rest_poses: bool = False

    @property
    def crops(self) -> bool:
        """Whether only a part of the recording is used."""
        return self.start is not None or self.stop is not None

    def frame_times(self, stated: FileTimes, count: int) -> FrameTimes:
        """Determine the times of `count` frames from what the file states; the caller's rate precedes it."""
        return frame_times(stated, count, self.rate)

    def recording(
        self,
        file: Path,
        names: Sequence[str],
        positions: ArrayLike,
        time: ArrayLike | FileTimes | FrameTimes | None = None,
        unit: str = "",
        notes: Sequence[str] = (),
        quality_warnings: Sequence[str] = (),
    ) -> Recording:
        """Make the recording in meters, with notes on the unit, the rate and missing points.

        Parameters
        ----------
        file : Path
            The file, for messages.
        names : sequence of str
            Names of the points; those that repeat are numbered.
        positions : array_like, shape (n_frames, n_points, 3)
            In the unit of the file; nan, and points farther than 1e12, are missing. An array of float64 is not copied:
            missing points are marked in it, and it becomes read-only.
        time : array_like, FileTimes or FrameTimes, optional
            Times of the frames [s], what the file states about them, or the result of `frame_times`, or its part with
            the frames that were read. Default: the file states neither times nor a rate.
        unit : str
            Unit of length; empty where neither the file nor its format states it.
        notes, quality_warnings : sequence of str
            As those of a `Recording`.

        Raises
        ------
        InvalidInputError
            When the values are no recording, unit or rate are unknown, or no frame lies in the part.
        """
        points = _as_points(positions, len(names))
        unique = _numbered(names)
        notes = list(notes)
        if unique != list(names):
            notes.append("names that occur more than once were numbered")
        notes += _mark_missing(points, unique)

        faults = []
        try:
            timing = self._timing(time, len(points))
        except InvalidInputError as error:  # reported with missing roles
            faults.append(str(error))
            timing = FrameTimes(np.arange(len(points), dtype=np.float64))
        times, points, ordered = in_order(timing.time, points)
        points = freeze(points)  # which recordings share, instead of copies of each
        raw = Recording(tuple(unique), points, times, printable(file.name))
        try:
            scale, unit_note = self._scale(raw, unit)
        except InvalidInputError as error:
            if not faults:
                raise
            faults.append(str(error))
        if faults:
            raise InvalidInputError("; ".join(faults))
        bodies = _bodies_warning(raw)
        del raw  # since its points are scaled
        points = scaled(points, scale)
        if self.rate is not None:
            notes = [*timing.notes, *notes]
        else:
            notes = [*notes, *timing.notes]
        gaps, long_gaps = gap_messages(times)
        warnings = [*quality_warnings, *timing.quality_warnings, *bodies, *long_gaps]
        recording = Recording(
            names=tuple(unique),
            positions=points,
            time=times,
            source=printable(file.name),
            notes=(unit_note, *notes, *ordered, *gaps),
            quality_warnings=tuple(warnings),
        )
        recording = without_zeros(recording)
        if not self.keep_rest_poses:
            recording = without_rest_poses(recording, timing.is_assumed, timing.is_cut)
        ends = recording.time[-2:] if timing.end is None else timing.end
        late = beyond_end(np.atleast_1d(ends), self.stop)
        if late:
            warnings = [*recording.quality_warnings, *late]
            recording = replace(recording, quality_warnings=tuple(warnings))
        return recording

    def _timing(self, time: ArrayLike | FileTimes | FrameTimes | None, count: int) -> FrameTimes:
        """Return the times of frames from what `recording` is given."""
        if isinstance(time, FrameTimes):
            return time
        if time is None:
            time = FileTimes()
        elif not isinstance(time, FileTimes):
            time = FileTimes({"time": time})
        return self.frame_times(time, count)

    def _scale(self, recording: Recording, declared: str) -> tuple[float, str]:
        """Return meters per unit, with a note on the origin."""
        arm = _recorded_arm(recording, self.markers)
        if self.height is not None:
            return _scale_by_height(self.height, arm)

        unit = self.unit or known_unit(declared)
        if unit is None:
            if not arm.ends:
                raise InvalidInputError(f"missing: {self._missing(recording)}")
            return _recognized_scale(arm)

        if isinstance(unit, str):
            scale = UNITS[unit]
            name = unit
        else:
            scale = unit
            name = f"of {unit:g} m"
        if self.unit:
            cause = argument("unit", unit)
            origin = "set by the caller"
        else:
            cause = f"the unit of the file, {unit},"
            origin = "of the file"
        _require_possible(arm, scale, cause)
        return scale, f"unit {name}, {origin}"

    def _missing(self, recording: Recording) -> str:
        """List the missing roles of the wanted arm, or of the one with more points, and how to assign them."""
        found = {}
        for side in SIDES:
            found[side] = assigned_roles(recording, _markers_of(self.markers, side), side)
        side = self.side
        if side not in SIDES:
            side = max((RIGHT, LEFT), key=lambda name: len(found[name][1].keys() & set(ARM)))
        marker_set, roles = found[side]
        return missing_text(recording, missing_roles(roles), roles, marker_set, side)


Reader = Callable[[Path, ImportOptions], Recording]

READERS: dict[str, Reader | str] = {
    ending: f"{__name__}.{module}" for ending, module in RECORDINGS.items()
}
"""For each ending the reader, or the module with a function ``read``, imported on first use.

A reader takes the path and the `ImportOptions` of the caller, the method ``recording`` of which makes the result. Its
`ValueError` becomes a `FileFormatError` with the path. `read_recording` uses the entries that are added.
"""


def read_recording(
    path: str | os.PathLike[str],
    unit: str | float | None = None,
    rate: float | None = None,
    *,
    height: float | None = None,
    markers: Markers = None,
    side: str = AUTO,
    start: float | None = None,
    stop: float | None = None,
) -> Recording:
    """Read a recording of a person's motion.

    The format is recognized by the content of the file, else by its ending.

    Parameters
    ----------
    path : str or path
        A file of one of the formats in `READERS`, a folder with a keypoint file for each frame, or the name of a
        bundled recording (``"ladder"``, ``"freeform"``, ``"both-arms"``). See ``docs/recordings.md``.
    unit : {"m", "dm", "cm", "mm", "inch", "CMU"} or float, optional
        Unit of length, or meters per unit; default: from the file, else recognized from the upper arm.
    rate : float, optional
        Frames per second; default: from the file.
    height : float, optional
        Height of the person [m], for files in any scale: upper arm and forearm get the lengths that people of this
        height have on average. It replaces the unit of the file, and excludes `unit`.
    markers : mapping, optional
        Points of roles, as in `maniport.fit_arm` or `maniport.fit_arms`; here they name the upper arm from which the
        unit is recognized.
    side : {"auto", "right", "left", "both"}
        Arm that is wanted; errors list its missing roles.
    start, stop : float, optional
        Part of the recording that is used [s], as in `Recording.crop`; tables of text and BVH are not parsed beyond it.

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
    if unit is not None and height is not None:
        raise InvalidInputError(
            f"{argument('unit')} and {argument('height')} exclude each other; found both"
        )
    options = ImportOptions(
        unit=None if unit is None else _as_unit(unit),
        rate=None
        if rate is None
        else as_number(rate, f"{spoken('rate')} [Hz]", above=0.0, below=1e5),
        height=None
        if height is None
        else as_number(height, f"{spoken('height')} [m]", minimum=0.5, maximum=2.5),
        markers=markers,
        side=as_choice(side, "side", (AUTO, *SIDES, BOTH)),
        start=None if start is None else as_number(start, "start"),
        stop=None if stop is None else as_number(stop, "stop"),
    )
    file = as_path(path, other=" or the name of a recording")
    if str(path) in SHIPPED and not file.is_file():
        file = shipped_recording(str(path))
    recording = read_with(file, options)
    if not options.crops:
        return recording
    rows = interval_rows(recording.time, options.start, options.stop)
    return replace(recording, positions=recording.positions[rows], time=recording.time[rows])


def read_with(file: Path, options: ImportOptions) -> Recording:
    """Read a file with checked options, at least the part that they select; see `read_recording`."""
    kind = _format_of(file)
    reader = READERS[kind]
    if isinstance(reader, str):
        read: Reader = importlib.import_module(reader).read
    else:
        read = reader
    try:
        recording = read(file, options)
        return replace(recording, format=recording.format or kind)
    except (FileFormatError, UnknownNameError):
        raise
    except ValueError as error:
        raise FileFormatError(f"{file}: {error}") from (None if isinstance(reader, str) else error)
    # XML and encodings raise some of these
    except (LookupError, TypeError, OverflowError, RecursionError, SyntaxError) as error:
        raise FileFormatError(
            f"{file}: not readable as {kind}, perhaps cut off: {error}"
        ) from error


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


def _as_points(positions: ArrayLike, count: int) -> Array:
    """Return positions (n_frames, count, 3) that can be changed; others are an error."""
    with np.errstate(over="ignore"):  # of wider floating-point types
        points = np.asarray(positions, dtype=np.float64)
    if points.ndim != 3 or points.shape[1:] != (count, 3) or not points.size:
        text = f"positions must have shape (n, k, 3) for {count} names, with n ≥ 1; found {points.shape}"
        raise InvalidInputError(text)
    require_size(*points.shape[:2])
    if points.flags.writeable:
        return points
    return points.copy()


def _numbered(names: Sequence[str]) -> list[str]:
    """Return the names, with a number at those that occurred before."""
    unique = []
    seen: Counter[str] = Counter()
    for name in names:
        seen[name] += 1
        unique.append(name if seen[name] == 1 else f"{name}#{seen[name]}")
    return unique


def _mark_missing(points: Array, names: Sequence[str]) -> list[str]:
    """Mark points without a usable position as nan, in place; return a note on them."""
    missing = np.zeros(points.shape[:2], dtype=np.bool_)
    frames = max(1, BLOCK // (3 * points.shape[1]))
    for first in range(0, len(points), frames):
        part = points[first : first + frames]
        if is_within(part):
            continue
        within = (part <= MAX_POSITION) & (part >= -MAX_POSITION)
        missing[first : first + frames] = ~all_axes(within)
    if not missing.any():
        return []
    points[missing] = np.nan
    if missing.all():
        raise InvalidInputError("every point is missing in every frame")
    never = [names[i] for i in np.flatnonzero(missing.all(axis=0)).tolist()]
    if never:
        always = f"; always: {_first(never, 20)}"
    else:
        always = ""
    return [f"{100 * missing.mean():.1f} % of all points are missing{always}"]


def known_unit(text: str) -> str | None:
    """Return the name of the unit that a file spells in its own way, or None."""
    name = text.strip().strip("\"'").lower()
    singular = name.removesuffix("s").replace("metre", "meter")
    spellings = {
        "millimeter": "mm",
        "centimeter": "cm",
        "meter": "m",
        "in": "inch",
        "inche": "inch",
        "cmu": "CMU",
    }
    name = spellings.get(singular, name)
    if name in UNITS:
        return name
    return None


def require_size(frames: int, points: int) -> None:
    """Raise `InvalidInputError` when a recording is too large."""
    require_at_most(points, POINTS, "points")
    require_at_most(frames, FRAMES, "frames")
    require_at_most(frames * points, PLACES, "places (frames × points)")


def drop_untrusted(positions: Array, confidence: Array, least: float = 0.5) -> list[str]:
    """Mark keypoints of low confidence as missing, in place; `least` is that of MediaPipe's own drawings."""
    low = confidence < least
    positions[low] = np.nan
    text = f"{100 * low.mean():.1f} % of all points have a confidence below {least} and count as missing"
    if low.any():
        return [text]
    return []


@np.errstate(over="ignore", invalid="ignore")  # of points out of reach
def arm_error(names: Sequence[str], positions: Coordinates) -> float:
    """Measure how unlike arms the points (n, k, 3) with these names in order are; below 1 they are arms.

    Of arms the bones keep their lengths (standard deviation below 5 %) and differ by less than 15 % between the sides.
    """
    lengths = []
    for side in ("left", "right"):
        roles = find_roles(names, side)[1]
        points = positions[:, [names.index(roles[role][0]) for role in ARM]].astype(np.float64)
        bones = np.linalg.norm(np.diff(points, axis=1), axis=-1)
        lengths.append(bones[np.isfinite(bones).all(axis=1) & (bones > 0).all(axis=1)])
    if not all(map(len, lengths)):
        return np.inf
    left, right = lengths
    median_left = np.median(left, axis=0)
    median_right = np.median(right, axis=0)
    change_left = np.std(left, axis=0) / median_left / 0.05
    change_right = np.std(right, axis=0) / median_right / 0.05
    difference = np.abs(median_left - median_right) / np.maximum(median_left, median_right) / 0.15
    return float(np.max([change_left, change_right, difference]))


def _format_of(file: Path) -> str:
    """Return the key of `READERS` for a file: by its content, else by its ending."""
    if os.path.isdir(file) and any(file.glob("*.json")):
        return ".json"
    suffix = file.suffix.lower()
    kind = None
    hint = f"; bundled recordings: {', '.join(map(repr, SHIPPED))}"
    # no file has a name that cannot exist; formats of the user go by their ending
    if os.path.exists(file) and isinstance(READERS.get(suffix, ""), str):
        existing_file(file, (), RECORDING_BYTES)
        with open(file, "rb") as stream:
            head = stream.read(4096)
        kind = _by_content(head)
        if kind == ".npz" and suffix not in (".npz", ".npy") and not _holds_arrays(file):
            kind = ".zip"
        _require_readable(file, head, suffix, kind)
    return kind or existing_file(file, tuple(READERS), RECORDING_BYTES, hint).suffix.lower()


def _require_readable(file: Path, head: bytes, suffix: str, kind: str | None) -> None:
    """Raise for a file of a format that is not read, by its first bytes, or by its ending where they decide nothing."""
    is_undecided = kind in (None, ".npz", ".json")
    for name, foreign in load_names("foreign_formats.yaml").items():
        starts = tuple(start.encode("latin-1") for start in foreign.get("starts", ()))
        if head.startswith(starts) or (is_undecided and suffix in foreign["endings"]):
            raise FileFormatError(f"{file}: not supported ({name}): {foreign['advice']}")


def _holds_arrays(file: Path) -> bool:
    """Whether a zip archive, or one that is damaged, may be an ``.npz`` file."""
    try:
        with zipfile.ZipFile(file) as archive:
            return any(info.filename.endswith(".npy") for info in archive.infolist())
    except Exception:  # noqa: BLE001 - zipfile raises errors of many types on damaged files
        return file.suffix.lower() != ".zip"


def _by_content(head: bytes) -> str | None:
    """Return the ending that belongs to the first bytes of a file, or None."""
    if len(head) > 1 and head[1] == 0x50 and 0 < head[0] < 9:  # 9 and more may begin a text
        return ".c3d"
    text = decoded(head).lstrip()
    lines = [line.strip().lower() for line in text.splitlines()]
    if "hierarchy" in lines[:20]:
        return ".bvh"
    for line in lines:
        if line == "endheader" or line.startswith("indegrees"):
            return ".mot"
    if text.startswith("<"):
        if "<mvnx" in text:
            return ".mvnx"
        return None
    for start, ending in STARTS.items():
        if text.startswith(start):
            return ending
    return None


def _bodies_warning(recording: Recording) -> list[str]:
    """Report which of several bodies is used."""
    right = whole_bodies(recording.observed, RIGHT)
    left = whole_bodies(recording.observed, LEFT)
    bodies = left if len(left) > len(right) else right
    advice = f"the first is used; a point of another one in {argument('markers')} selects that one"
    if len(bodies) > 1:
        return [f"the points are those of several bodies: {', '.join(bodies)}; {advice}"]
    return []


def _first(names: Sequence[str], most: int) -> str:
    return ", ".join(names[:most]) + (", …" if len(names) > most else "")


class _Arm(NamedTuple):
    """Lengths of an arm in the unit of the file."""

    ends: str = ""  # names of the points of the upper arm; empty where it is not recorded
    upper_arm: float = np.nan
    forearm: float = np.nan  # nan where it is not recorded


def _markers_of(markers: Markers, side: str) -> Markers:
    """Return the markers of one arm, from those of one or of both."""
    if isinstance(markers, Mapping) and markers and set(markers) <= set(SIDES):
        return markers.get(side)
    return markers


def _recorded_arm(recording: Recording, markers: Markers) -> _Arm:
    """Measure the first arm of which the upper arm is recorded."""
    for side in SIDES:
        roles = assigned_roles(recording, _markers_of(markers, side), side)[1]
        if {"shoulder", "elbow"} <= roles.keys():
            upper_arm = _median_length(recording, roles, "shoulder", "elbow")
            if np.isfinite(upper_arm):
                ends = f"{'+'.join(roles['shoulder'])} to {'+'.join(roles['elbow'])}"
                return _Arm(ends, upper_arm, _median_length(recording, roles, "elbow", "wrist"))
    return _Arm()


def _median_length(recording: Recording, roles: Roles, start: str, end: str) -> float:
    """Return the median distance of two roles; nan where they are not recorded together."""
    if not {start, end} <= roles.keys():
        return float("nan")
    length = np.linalg.norm(direction(recording, (roles[start], roles[end])), axis=-1)
    if not np.isfinite(length).any():
        return float("nan")
    return float(np.nanquantile(length, 0.5, method="lower"))  # not the mean of two units


def _fitting_units(arm: _Arm) -> list[str]:
    """Return the units in which the upper arm has a usual length."""
    low, high = UPPER_ARM
    return [name for name in UNITS if name != "dm" and low <= arm.upper_arm * UNITS[name] <= high]


def _require_possible(arm: _Arm, scale: float, cause: str) -> None:
    """Raise where the meters per unit make an impossible upper arm."""
    low, high = POSSIBLE_UPPER_ARM
    if not arm.ends or low <= arm.upper_arm * scale <= high:
        return
    better = ""
    for fit in _fitting_units(arm):
        better += f"; {argument('unit', fit)} makes it {arm.upper_arm * UNITS[fit]:.3g} m"
    if not better:
        better = f"; or give the height of the person in meters ({argument('height', 1.75)})"
    raise InvalidInputError(
        f"{cause} makes the upper arm ({arm.ends}) {arm.upper_arm * scale:.3g} m long; possible are {low} to "
        f"{high} m{better}"
    )


def _recognized_scale(arm: _Arm) -> tuple[float, str]:
    """Return meters per unit from the length of the upper arm, with a note."""
    fitting = _fitting_units(arm)
    if not fitting:
        example = argument("height", 1.75)
        raise InvalidInputError(
            f"the unit of length cannot be recognized: the upper arm ({arm.ends}) has {arm.upper_arm:.4g} units; give "
            f"{argument('unit')} one of {', '.join(map(repr, UNITS))} or the meters per unit, or the height of the "
            f"person in meters ({example})"
        )
    scale = UNITS[fitting[0]]
    text = f"the upper arm ({arm.ends}) is {arm.upper_arm:.4g} units long, {arm.upper_arm * scale:.3f} m"
    return scale, f"unit recognized as {fitting[0]} (1 unit = {scale:.5g} m): {text}"


def _scale_by_height(height: float, arm: _Arm) -> tuple[float, str]:
    """Return meters per unit that give an arm the lengths of people of a height [m], with a note."""
    if not arm.upper_arm > 0:
        raise InvalidInputError(
            f"{argument('height')} needs the points of an upper arm, which are not recorded or not recognized; assign "
            f"them with {argument('markers')}, or give {argument('unit')}"
        )
    share = FRACTIONS["upper arm"]
    length = arm.upper_arm
    if np.isfinite(arm.forearm):
        share += FRACTIONS["forearm"]
        length += arm.forearm
    scale = height * share / length
    note = f"1 unit = {scale:.5g} m, from the height of {height:g} m: upper arm {arm.upper_arm * scale:.3f} m"
    return scale, note


def _as_unit(unit: str | float) -> str | float:
    """Check a unit of length: one of `UNITS`, in any spelling, or meters per unit."""
    if isinstance(unit, str):
        return as_choice(known_unit(unit) or unit, "unit", tuple(UNITS))
    return as_number(unit, f"{spoken('unit')} [m]", above=0.0)
