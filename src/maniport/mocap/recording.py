"""Recording: named points over time, in meters."""

import os
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import Akima1DInterpolator, make_interp_spline

from maniport.errors import InvalidInputError, RecordingError, argument, counted, unknown_name
from maniport.util.files import save_arrays
from maniport.util.notebook import NotebookDisplay
from maniport.util.plotting import Plottable
from maniport.util.validation import Array, as_number, as_times, require_shape

Bools = NDArray[np.bool_]

MAX_POSITION = 1e12  # Largest coordinate [m]: squares of distances stay finite
BLOCK = 100_000  # Numbers that are checked at once: their flags stay in the cache
LONGEST_GAP = (
    0.2  # Length of gaps that are interpolated [s]; within it a hand hardly changes its speed
)


@dataclass(frozen=True, eq=False)
class Recording(NotebookDisplay, Plottable):
    """Named points over time.

    Parameters
    ----------
    names : sequence of str
        One name for each point, all different.
    positions : array_like, shape (n_frames, n_points, 3)
        Positions [m] in the axes of the recording; nan where a point is missing.
    time : array_like, shape (n_frames,)
        Time [s], strictly increasing.
    source : str
        Name of the file.
    notes : sequence of str
        What was recognized or repaired while reading.
    quality_warnings : sequence of str
        Data-quality warnings: where the points contradict the options that were passed.
    format : str
        Key of `maniport.mocap.READERS`; empty without a file.

    Raises
    ------
    InvalidInputError
        When shapes disagree, time does not increase, a name occurs twice or a position is infinite.
    """

    names: tuple[str, ...]
    positions: Array
    time: Array
    source: str = ""
    notes: tuple[str, ...] = ()
    quality_warnings: tuple[str, ...] = ()
    format: str = ""

    def __post_init__(self) -> None:
        if isinstance(self.names, str) or not isinstance(self.names, Iterable):
            raise InvalidInputError(
                f"names must be a sequence of names of points; found {self.names!r}"
            )
        names = tuple(map(str, self.names))
        repeated = sorted(name for name, count in Counter(names).items() if count > 1)
        if repeated:
            raise InvalidInputError(
                f"names must differ; found more than once: {', '.join(map(repr, repeated))}"
            )
        if not names:
            raise RecordingError("the recording holds no points; at least one is needed")
        time = as_times(self.time).copy()
        positions = _as_positions(self.positions, (len(time), len(names), 3))
        for array in (time, positions):
            array.setflags(write=False)
        texts = {
            name: tuple(map(str, getattr(self, name))) for name in ("notes", "quality_warnings")
        }
        for name, value in {"names": names, "time": time, "positions": positions, **texts}.items():
            object.__setattr__(self, name, value)

    def __len__(self) -> int:
        """Return the number of frames."""
        return len(self.time)

    def __repr__(self) -> str:
        points = counted(len(self.names), "point")
        frames = counted(len(self), "frame")
        seconds = f"{self.duration:.2f} s at {self.rate:.4g} Hz"
        return f"Recording({self.source or 'unnamed'!r}: {points}, {frames}, {seconds})"

    @property
    def duration(self) -> float:
        """Time from the first frame to the last [s]."""
        return float(self.time[-1] - self.time[0])

    @property
    def rate(self) -> float:
        """Frames per second [Hz], from the median time step; nan for a single frame."""
        if len(self) > 1:
            return float(1.0 / np.median(np.diff(self.time)))
        return float("nan")

    @property
    def missing(self) -> Array:
        """Fraction of frames in which each point is missing, shape (n_points,)."""
        return np.asarray(np.isnan(self.positions[..., 0]).mean(axis=0))

    @property
    def observed(self) -> tuple[str, ...]:
        """Names of the points that are present in some frame."""
        present = ~np.isnan(self.positions[0, :, 0])
        for i in np.flatnonzero(~present):
            present[i] = not np.isnan(self.positions[:, i, 0]).all()
        return tuple(name for name, seen in zip(self.names, present, strict=True) if seen)

    def point(self, name: str) -> Array:
        """Return the positions of one point [m], shape (n_frames, 3), nan where it is missing."""
        return np.asarray(self.positions[:, self._column(name)])

    def _column(self, name: str) -> int:
        if name not in self.names:
            raise unknown_name(
                "point", name, self.names, f"in {self.source!r}" if self.source else ""
            )
        return self.names.index(name)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write an ``.npz`` file that `read_recording` reads: names, positions [m], time [s]."""
        fields = {"names": np.array(self.names), "positions": self.positions, "time": self.time}
        save_arrays(path, {**fields, "unit": np.array("m")})

    def select(self, names: Iterable[str]) -> "Recording":
        """Keep the named points, in this order."""
        columns = [self._column(name) for name in names]
        return replace(
            self, names=tuple(self.names[i] for i in columns), positions=self.positions[:, columns]
        )

    def crop(self, start: float | None = None, stop: float | None = None) -> "Recording":
        """Keep the frames with start ≤ time ≤ stop [s]; a stop beyond the end is reported in `quality_warnings`.

        Raises
        ------
        InvalidInputError
            When no frame lies in that interval.
        """
        rows = interval_rows(self.time, start, stop)
        return replace(
            self,
            positions=self.positions[rows],
            time=self.time[rows],
            quality_warnings=(*self.quality_warnings, *beyond_end(self.time, stop)),
        )

    def fill_gaps(self) -> "Recording":
        """Interpolate gaps up to `LONGEST_GAP` (Akima's spline); longer ones and both ends stay missing.

        A gap lasts from the last frame before it to the first frame after it.
        """
        positions = self.positions.copy()
        notes = list(self.notes)
        for i, name in enumerate(self.names):
            missing = np.isnan(positions[:, i, 0])
            short = self._short_gaps(missing)
            if short:
                times = self.time[~missing]
                values = positions[~missing, i]
                # Akima's spline needs more than two points.
                if len(times) > 2:
                    spline = Akima1DInterpolator(times, values)
                else:
                    spline = make_interp_spline(times, values, 1)
                for start, stop in short:
                    positions[start:stop, i] = spline(self.time[start:stop])
                frames = sum(stop - start for start, stop in short)
                notes.append(
                    f"{name}: gaps of up to {LONGEST_GAP:g} s interpolated ({counted(frames, 'frame')})"
                )
        return replace(self, positions=positions, notes=tuple(notes))

    def _short_gaps(self, missing: Bools) -> list[tuple[int, int]]:
        """Return starts and stops of the gaps up to `LONGEST_GAP` in frames (n,) that miss a point."""
        short = []
        for start, stop in runs_of(missing):
            is_inside = 0 < start < stop < len(self)
            if is_inside and self.time[stop] - self.time[start - 1] <= LONGEST_GAP * (1 + 1e-9):
                short.append((start, stop))
        return short


def interval_rows(time: Array, start: float | None, stop: float | None) -> slice:
    """Return the rows with start ≤ time ≤ stop [s], of times that increase.

    Raises
    ------
    InvalidInputError
        When there is none, or start or stop is no number.
    """
    low = float(time[0]) if start is None else as_number(start, "start")
    high = float(time[-1]) if stop is None else as_number(stop, "stop")
    rows = np.flatnonzero((time >= low) & (time <= high))
    if not len(rows):
        raise InvalidInputError(
            f"start, stop: no frame lies between {low:g} and {high:g} s; "
            f"the recording runs from {time[0]:g} to {time[-1]:g} s"
        )
    return slice(int(rows[0]), int(rows[-1]) + 1)


def beyond_end(time: Array, stop: float | None) -> list[str]:
    """Return a warning where `stop` [s] is beyond the last of the times."""
    if stop is None:
        return []
    # the end of the last frame, or its rounding
    if len(time) > 1:
        tolerance = 1.5 * float(np.median(np.diff(time)))
    else:
        tolerance = 0.0
    if stop <= time[-1] + tolerance:
        return []
    return [f"{argument('stop', stop)} is beyond the end of the recording, {time[-1]:.2f} s"]


def any_axis(flags: Bools) -> Bools:
    """Whether a flag of x, y or z is true, from shape (..., 3): faster than `any` over so short an axis."""
    return flags[..., 0] | flags[..., 1] | flags[..., 2]


def is_within(positions: Array, most: float = MAX_POSITION) -> bool:
    """Whether all coordinates are numbers within ±most; faster than flags for each."""
    return bool(positions.min() >= -most and positions.max() <= most)  # false for nan


def all_axes(flags: Bools) -> Bools:
    """Whether the flags of x, y and z are true, from shape (..., 3)."""
    return flags[..., 0] & flags[..., 1] & flags[..., 2]


def freeze(array: Array) -> Array:
    """Make an array and those whose memory it shares read-only, so that a `Recording` needs no copy."""
    part: object = array
    while isinstance(part, np.ndarray):
        part.setflags(write=False)
        part = part.base
    return array


def scaled(array: Array, factor: float) -> Array:
    """Multiply a frozen array in place, where it owns its memory, else return a product; the result is frozen."""
    if factor == 1.0:
        return array
    parts: list[np.ndarray] = []
    part: object = array
    while isinstance(part, np.ndarray):
        parts.append(part)
        part = part.base
    try:
        for owner in reversed(parts):  # the owner of the memory first
            owner.setflags(write=True)
    except ValueError:
        return freeze(array * factor)
    array *= factor
    return freeze(array)


def _is_frozen(array: Array) -> bool:
    """Whether nobody can change an array."""
    part: object = array
    while isinstance(part, np.ndarray):
        if part.flags.writeable:
            return False
        part = part.base
    return part is None


def runs_of(flags: Bools) -> list[tuple[int, int]]:
    """Return runs of true flags as (start, stop) indices."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(int), [0]])))
    return [(int(start), int(stop)) for start, stop in zip(edges[::2], edges[1::2], strict=True)]


def when(time: Array, flags: Bools) -> str:
    """Describe the times at which flags are true, the first few of them."""
    runs = []
    for a, b in runs_of(flags):
        runs.append(f"{time[a]:.2f} s" if b == a + 1 else f"{time[a]:.2f}–{time[b - 1]:.2f} s")
    return ", ".join(runs[:5]) + (f" and {len(runs) - 5} more" if len(runs) > 5 else "")


def _as_positions(value: ArrayLike, shape: tuple[int, int, int]) -> Array:
    if isinstance(value, np.ndarray) and value.dtype == np.float64 and _is_frozen(value):
        positions = value
    else:
        try:
            if np.iscomplexobj(value):  # NumPy would drop the imaginary part with a mere warning
                raise TypeError("its numbers are complex")
            positions = np.array(value, dtype=np.float64)
        except (TypeError, ValueError) as error:
            raise InvalidInputError(f"positions must be an array of numbers: {error}") from None
    require_shape(positions, "positions", shape, " = (n_frames, n_points, 3)")

    frames = max(1, BLOCK // (shape[1] * shape[2]))
    is_partly_missing = False
    for first in range(0, shape[0], frames):
        part = positions[first : first + frames]
        if is_within(part):
            continue
        far = (part > MAX_POSITION) | (part < -MAX_POSITION)
        if far.any():
            raise InvalidInputError(
                f"positions must be within ±{MAX_POSITION:g} m, or nan where missing; found "
                f"{np.abs(part[far]).max():g} m from the origin"
            )
        missing = np.isnan(part)
        is_partly_missing |= bool((any_axis(missing) & ~all_axes(missing)).any())
    if is_partly_missing:  # a point with one coordinate missing is missing
        if not positions.flags.writeable:
            positions = positions.copy()
        positions[any_axis(np.isnan(positions))] = np.nan
    return positions
