"""Times of frames, from the clocks, frame numbers and rates that a file states.

A clock in the file precedes an even rate, which may be assumed by the program that wrote it. Contradictions are
reported with both values.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maniport.errors import InvalidInputError, argument
from maniport.mocap.recording import LONGEST_GAP
from maniport.util.validation import Array

RATE_TOLERANCE = 0.005  # Relative difference of rates that is reported: 29.97 and 30 Hz are one
MOST_BACKWARD = 0.1  # Share of the steps of a clock that may not increase
JITTER = 0.05  # Difference of two clocks [s] that is no contradiction: that of a computer's clock
FRAME_NUMBERS = "frame numbers"
MULTIPLES = {"seconds": 1.0, "milliseconds": 1e3, "microseconds": 1e6, "nanoseconds": 1e9}
LOWEST_RATE = 1e-6  # [Hz]; lower ones are placeholders, whose frames would last for days
HIGHEST_RATE = 1e12  # [Hz]; also of integers that no float holds
_RATE_TEXT = re.compile(
    r"\s*(\d+(?:\.\d*)?)\s*(?:hz|fps|frames\s*(?:/|per)\s*(?:s|sec|second))?\s*", re.IGNORECASE
)


@dataclass(frozen=True)
class FileTimes:
    """What a file states about the times of its frames; the names appear in messages.

    Parameters
    ----------
    clocks : mapping of str to array_like, shape (n_frames,)
        Times of the frames [s], in order of precedence; nan where unknown. Milliseconds, microseconds and nanoseconds
        are recognized.
    frame_numbers : ndarray, shape (n_frames,), optional
        Numbers of the frames, which skip those that were lost.
    rates : mapping of str to float
        Frames per second, in order of precedence; those that are not positive and finite are ignored.
    wrong_rates : mapping of str to str
        What the file has in place of a frame rate, for the error where it states no time otherwise.
    """

    clocks: Mapping[str, ArrayLike] = field(default_factory=dict)
    frame_numbers: Array | None = None
    rates: Mapping[str, float] = field(default_factory=dict)
    wrong_rates: Mapping[str, str] = field(default_factory=dict)


def rates_of(values: Mapping[str, object]) -> tuple[dict[str, float], dict[str, str]]:
    """Return the frame rates [Hz] among the values of a file, and the others as texts."""
    rates = {}
    wrong = {}
    for key, value in values.items():
        single = value
        if isinstance(value, np.ndarray) and value.size == 1:
            single = value.flat[0]
        rate = _stated_rate(single)
        if rate is None:
            wrong[key] = str(single)[:80]
        else:
            rates[key] = rate
    return rates, wrong


def _stated_rate(value: object) -> float | None:
    """Return the frame rate [Hz] that one value states, a number or a text such as 30 Hz; None for others."""
    if isinstance(value, bytes):
        value = value.decode("utf-8", "replace")
    if isinstance(value, str):
        found = _RATE_TEXT.fullmatch(value)
        value = None if found is None else float(found[1])
    if isinstance(value, bool) or not isinstance(value, int | float | np.integer | np.floating):
        return None
    return float(value) if LOWEST_RATE <= value <= HIGHEST_RATE else None


@dataclass(frozen=True)
class FrameTimes:
    """Times of frames [s], shape (n_frames,), with messages.

    Parameters
    ----------
    time : ndarray, shape (n_frames,)
        Time of each frame [s]; need not increase.
    is_assumed : bool
        Whether the times follow from a rate alone, so that they begin at zero.
    notes, quality_warnings : tuple of str
        As those of a `Recording`.
    end : ndarray, shape (2,), optional
        Times of the last two frames of the file [s], where these are times of a part.
    is_cut : (bool, bool)
        Whether frames before the first and after the last were left out.
    """

    time: Array
    is_assumed: bool = False
    notes: tuple[str, ...] = ()
    quality_warnings: tuple[str, ...] = ()
    end: Array | None = None
    is_cut: tuple[bool, bool] = (False, False)

    def rows_between(self, start: float | None, stop: float | None) -> slice:
        """Return the rows from the first to the last frame with start ≤ time ≤ stop; all where there is none."""
        inside = np.ones(len(self.time), dtype=np.bool_)
        if start is not None:
            inside &= self.time >= start
        if stop is not None:
            inside &= self.time <= stop
        rows = np.flatnonzero(inside)
        if not len(rows):
            return slice(0, len(self.time))  # and the error is that of the whole recording
        return slice(int(rows[0]), int(rows[-1]) + 1)

    def part(self, rows: slice) -> "FrameTimes":
        """Return the times of some rows, start and stop of which are given."""
        count = len(self.time)
        return replace(
            self,
            time=self.time[rows],
            end=self.time[-2:],
            is_cut=(rows.start > 0, rows.stop < count),
        )


def frame_times(stated: FileTimes, count: int, rate: float | None = None) -> FrameTimes:
    """Determine the times of `count` frames; a rate of the caller [Hz] precedes all that the file states.

    Raises
    ------
    InvalidInputError
        When there are neither times nor a rate, or times are not numbers of shape (n_frames,).
    """
    rates = _valid_rates(stated)
    numbers = _frame_numbers(stated.frame_numbers, count)
    if rate is not None:
        return _times_of_the_caller(stated, rates, numbers, rate)

    warnings = _contradicting_rates(rates)
    notes: list[str] = []
    declared = next(iter(rates.values()), None)
    clocks = _usable_clocks(stated, count, declared, notes, warnings)
    has_lost_frames = bool((np.diff(numbers) != 1).any())
    is_needed = stated.frame_numbers is not None and (has_lost_frames or not clocks)
    if declared is not None and is_needed:
        clocks[FRAME_NUMBERS] = numbers / declared
    if not clocks:
        if declared is None:
            found = ", ".join(f"{key} is {value!r}" for key, value in stated.wrong_rates.items())
            raise InvalidInputError(
                f"the file states no frame rate{f' ({found})' if found else ''}; give {argument('rate')} in frames "
                "per second"
            )
        time = np.arange(count) / declared
        return FrameTimes(time, True, tuple(notes), tuple(warnings))

    name = _preferred(clocks, declared, warnings)
    time = clocks[name]
    if declared is None:
        time = _at_whole_rate(time)
    elif name != FRAME_NUMBERS:
        rate_name = next(iter(rates))
        time = _compared(name, time, rate_name, declared, numbers, notes, warnings)
    return FrameTimes(time, False, tuple(notes), tuple(warnings))


def gap_messages(time: Array) -> tuple[list[str], list[str]]:
    """Return notes and warnings about gaps between frames; time must increase."""
    if len(time) < 3:
        return [], []
    steps = np.diff(time)
    usual = float(np.median(steps))
    late = steps > 1.5 * usual * (1 + 1e-9)
    if not late.any():
        return [], []
    worst = int(np.argmax(steps))
    count = int(late.sum())
    if count == 1:
        gaps = "1 gap"
    else:
        gaps = f"{count} gaps"
    text = (
        f"the times have {gaps} between frames: steps are {usual:.4g} s (median), the longest is "
        f"{steps[worst]:.4g} s, from {time[worst]:.2f} to {time[worst + 1]:.2f} s"
    )
    if steps[worst] > max(LONGEST_GAP, 2.5 * usual):
        return [], [text]
    return [text], []


def _valid_rates(stated: FileTimes) -> dict[str, float]:
    return {name: rate for name, rate in stated.rates.items() if 1e-6 <= rate < np.inf}


def _frame_numbers(numbers: Array | None, count: int) -> Array:
    """Return numbers of frames from zero, in steps of one; their order where the file numbers none."""
    order = np.arange(count, dtype=np.float64)
    if numbers is None or len(numbers) != count or count < 2 or not np.isfinite(numbers).all():
        return order
    steps = np.diff(numbers)
    usual = np.median(steps)
    if steps.min() <= 0 or usual < 1:
        return order
    return np.asarray((numbers - numbers[0]) / usual)


def _times_of_the_caller(
    stated: FileTimes, rates: Mapping[str, float], numbers: Array, rate: float
) -> FrameTimes:
    notes = [f"frames per second set by the caller: {rate:g}"]
    others = [f"{value:.5g} ({name})" for name, value in rates.items() if _differ(value, rate)]
    for name, clock in stated.clocks.items():
        times = np.asarray(clock)
        if times.ndim != 1 or times.dtype.kind not in "fiu" or len(times) < 2:
            continue
        measured = _rate_of(_in_seconds(times.astype(np.float64), rate)[0])
        if measured is not None and _differ(measured, rate):
            others.append(f"{measured:.5g} ({name})")
    if others:
        notes.append(f"frames per second of the file, which were not used: {', '.join(others)}")
    return FrameTimes(numbers / rate, (np.diff(numbers) == 1).all(), tuple(notes))


def _contradicting_rates(rates: Mapping[str, float]) -> list[str]:
    values = list(rates.values())
    if not any(_differ(value, values[0]) for value in values[1:]):
        return []
    stated = ", ".join(f"{value:.5g} ({name})" for name, value in rates.items())
    return [
        f"the file states different frame rates [Hz]: {stated}; without times the first is used; "
        f"{argument('rate')} sets another"
    ]


def _differ(first: float, second: float) -> bool:
    return abs(first - second) > RATE_TOLERANCE * max(first, second)


def _usable_clocks(
    stated: FileTimes, count: int, declared: float | None, notes: list[str], warnings: list[str]
) -> dict[str, Array]:
    """Return the clocks that can be used [s], without missing times, and add to the messages."""
    clocks: dict[str, Array] = {}
    for name, values in stated.clocks.items():
        raw = _as_clock(values, count)
        times, unit = _in_seconds(raw.astype(np.float64), declared)
        known = np.isfinite(times)
        if not known.any():
            continue
        if not known.all():
            complete = _completed(times, known)
            if complete is None:
                continue
            times = complete
            notes.append(f"{name}: {int((~known).sum())} of {count} are missing and interpolated")
        backward = np.diff(times) <= 0
        can_replace = declared is not None or len(stated.clocks) > 1
        is_constant = count > 1 and np.ptp(times) == 0
        is_backward = backward.sum() > MOST_BACKWARD * max(len(backward), 1)
        is_rounded = _is_rounded(times, declared) and not is_constant
        if can_replace and is_backward and not is_rounded:
            warnings.append(
                f"{name}: {int(backward.sum())} of {len(backward)} steps do not increase, from "
                f"{times[0]:g} to {times[-1]:g} s; these times were not used"
            )
            continue
        if unit != "seconds":
            step = float(np.nanmedian(np.diff(raw.astype(np.float64))))
            notes.append(
                f"times recognized as {unit}: as seconds, frames would be {step:.4g} s apart"
            )
        clocks[name] = times
    return clocks


def _as_clock(values: ArrayLike, count: int) -> NDArray[np.floating | np.integer]:
    """Require a number for each frame, shape (count,)."""
    raw = np.asarray(values)
    if raw.ndim != 1 or raw.dtype.kind not in "fiu" or len(raw) != count:
        raise InvalidInputError(
            f"time must be numbers [s], shape ({count},); found {raw.dtype}, shape {raw.shape}"
        )
    return raw


def _in_seconds(times: Array, declared: float | None) -> tuple[Array, str]:
    """Return times in seconds, and the unit that was recognized from their steps."""
    steps = np.diff(times)
    steps = steps[np.isfinite(steps)]
    if len(steps):
        step = float(np.median(steps))
    else:
        step = 0.0
    if declared is not None and step > 0:
        for unit, multiple in MULTIPLES.items():
            if abs(step * declared / multiple - 1) < 0.25:
                return times / multiple, unit
    if not 1.0 < step <= 1e9:
        return times, "seconds"
    power = int(np.ceil(np.log10(step) / 3))
    unit = list(MULTIPLES)[power]
    return times * 1e-3**power, unit


def _completed(times: Array, known: Array) -> Array | None:
    """Interpolate missing times, and extrapolate at both ends; None where fewer than two are known."""
    index = np.flatnonzero(known)
    if len(index) < 2:
        return None
    frames = np.arange(len(times), dtype=np.float64)
    step = float(np.median(np.diff(times[index]) / np.diff(index)))
    complete = np.interp(frames, index, times[index])
    before = frames < index[0]
    after = frames > index[-1]
    complete[before] = times[index[0]] + step * (frames[before] - index[0])
    complete[after] = times[index[-1]] + step * (frames[after] - index[-1])
    return complete


def _rate_of(time: Array) -> float | None:
    """Return the frames per second of a clock, by its median step, or its mean step where it is rounded."""
    steps = np.diff(time[np.isfinite(time)])
    if not len(steps):
        return None
    step = float(np.median(steps))
    if step <= 0 or _resolution(time) > 0.1 * step:
        step = float(np.mean(steps))
    if step > 0:
        return 1.0 / step
    return None


def _resolution(time: Array) -> float:
    """Return the power of ten [s], from 1 to 1e-6, to which times are rounded; zero where they are not."""
    part = time[np.isfinite(time)][:2000]
    for digits in range(7):
        scaled = part * 10.0**digits
        if (np.abs(scaled - np.round(scaled)) < 1e-4).all():
            return float(10.0**-digits)
    return 0.0


def _is_rounded(times: Array, declared: float | None) -> bool:
    """Whether times are those of the declared rate, up to their rounding."""
    return declared is not None and _follows(
        times, np.arange(len(times), dtype=np.float64), declared
    )


def _follows(times: Array, frames: Array, rate: float) -> bool:
    """Whether a clock differs from the times of numbered frames by a constant and its rounding."""
    tolerance = 1e-9 + 4 * np.spacing(np.abs(times).max())
    resolution = _resolution(times)
    if resolution > 0:
        multiple = 1 / rate / resolution  # where it is whole, times need no rounding
        if multiple < 0.999 or abs(multiple - round(multiple)) > 1e-3:
            tolerance += 1.01 * resolution
    return bool(np.ptp(times - frames / rate) <= tolerance)


def _at_whole_rate(time: Array) -> Array:
    """Return times without their rounding where they are those of a whole number of frames per second."""
    measured = _rate_of(time)
    if measured is None or measured < 1.5:
        return time
    steps = len(time) - 1
    mean = steps / np.ptp(time)
    order = np.arange(len(time), dtype=np.float64)
    for whole in {round(measured), max(round(mean), 1)}:
        if _follows(time, order, float(whole)):
            return _unrounded(time, order, float(whole))
    return time


def _unrounded(time: Array, frames: Array, rate: float) -> Array:
    """Return the times of frames at a rate that a clock follows; the clock itself where it is not rounded."""
    even = time[0] + frames / rate
    if np.abs(even - time).max() <= 1e-9:
        return time
    return np.asarray(even)


def _preferred(clocks: dict[str, Array], declared: float | None, warnings: list[str]) -> str:
    """Return the name of the clock to use, and report those that contradict it.

    It is the first one; but where it is no more than the declared rate, one that differs is used.
    """
    names = list(clocks)
    chosen = names[0]
    for name in names[1:]:
        if FRAME_NUMBERS in (chosen, name):
            jitter = 0.0
        else:
            jitter = JITTER
        if not _contradict(clocks[chosen], clocks[name], jitter):
            continue
        used = chosen
        if declared is not None and _is_rounded(clocks[chosen], declared):
            used = name
        lasts = ", ".join(f"{np.ptp(clocks[key]):.3f} s ({key})" for key in (chosen, name))
        warnings.append(
            f"the clocks of the file contradict each other: they last {lasts}; {used} used"
        )
        chosen = used
    return chosen


def _contradict(first: Array, second: Array, jitter: float) -> bool:
    """Whether two clocks of the same frames differ by more than jitter [s], rounding and most of a frame."""
    if len(first) < 2:
        return False
    difference = (first - first[0]) - (second - second[0])
    step = float(np.median(np.diff(second)))
    tolerance = jitter + 0.75 * step + 2 * max(_resolution(first), _resolution(second))
    return bool(np.abs(difference).max() > tolerance)


def _compared(
    name: str,
    time: Array,
    rate_name: str,
    declared: float,
    numbers: Array,
    notes: list[str],
    warnings: list[str],
) -> Array:
    """Compare a clock with the declared rate; return its times, without their rounding where both agree."""
    for frames in (numbers, np.arange(len(time), dtype=np.float64)):
        if _follows(time, frames, declared):
            return _unrounded(time, frames, declared)

    resolution = _resolution(time)
    time = _at_whole_rate(time)
    measured = _rate_of(time)
    if measured is None:
        return time
    # The mean suits irregular times, and the median times with lost frames.
    mean = (len(time) - 1) / np.ptp(time)
    differs = _differ(measured, declared) and _differ(mean, declared)
    # Some programs add up a rounded step: 0.033 s for 30 Hz.
    adds_rounded = abs(1 / measured - 1 / declared) < min(1.01 * resolution, 0.1 / declared)
    if differs and not adds_rounded:
        warnings.append(
            f"the frame rate of the file, {declared:.5g} Hz ({rate_name}), contradicts its times, {measured:.5g} Hz "
            f"({name}): the times were used; {argument('rate', round(declared, 3))} uses the rate"
        )
    elif abs(measured - declared) * np.ptp(time) > 1.0:  # frames over the whole recording
        notes.append(
            f"the times of the frames ({name}, {measured:.5g} Hz) were used, not the rate {declared:.5g} Hz "
            f"({rate_name})"
        )
    return time
