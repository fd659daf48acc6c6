"""Repair of unmistakable faults of recordings; each is reported. A recording without faults stays bit-identical."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from maniport.errors import InvalidInputError, RecordingError
from maniport.mocap.marker_sets import other_side
from maniport.mocap.recording import LONGEST_GAP, Bools, Recording, runs_of, when
from maniport.mocap.roles import role_position
from maniport.util.validation import Array

LEAST_LEAP = 0.1  # Least displacement of a point that is taken for lost for a moment [m]


def repaired(recording: Recording, points: Sequence[str], roles: Mapping[str, Any]) -> Recording:
    """Return the points that are used, without the faults below; `notes` and `quality_warnings` report the repairs."""
    whole = exchanged_back(without_zeros(recording), points)
    return without_leaps(in_one_unit(whole.select(points), roles))


def in_order(
    time: Array, positions: Array, latest: float = 0.5, most_doubled: float = 0.1
) -> tuple[Array, Array, list[str]]:
    """Sort frames that are at most `latest` seconds late, and drop a small share with the time of another frame."""
    if not np.isfinite(time).all() or time.shape != positions.shape[:1] or (np.diff(time) > 0).all():
        return time, positions, []
    late = np.maximum.accumulate(time) - time
    if late.max() > latest:
        i = int(np.argmax(late > latest))
        raise InvalidInputError(
            f"time goes back by {late[i]:.3g} s at index {i}, to {time[i]:g} s: frames may be late by up to "
            f"{latest:g} s; are there several recordings in the file? Use one of them"
        )
    order = np.argsort(time, kind="stable")
    kept = order[np.concatenate([[True], np.diff(time[order]) > 0])]
    doubled = len(time) - len(kept)
    if doubled > most_doubled * len(time):
        raise InvalidInputError(
            f"{doubled} of {len(time)} frames bear the time of another one, the first at index "
            f"{int(np.argmax(np.diff(time) == 0)) + 1}; at most {most_doubled:.0%} may: are times rounded too far? "
            f"Give the frames per second"
        )
    notes = [f"{int((late > 0).sum())} frames were out of order in time and were sorted"] if (late > 0).any() else []
    notes += [f"{doubled} frames with the time of another one were left out"] if doubled else []
    return time[kept], positions[kept], notes


def without_zeros(recording: Recording) -> Recording:
    """Mark points at exactly (0, 0, 0) as missing where they jump there, or where several always are."""
    zero = (recording.positions == 0).all(axis=-1)
    if not zero.any():
        return recording
    always = zero.all(axis=0)
    lost = zero & (always.sum() > 1)
    for i in np.flatnonzero(zero.any(axis=0) & ~always):
        distance = np.linalg.norm(recording.positions[:, i], axis=-1)
        step = np.linalg.norm(np.diff(recording.positions[:, i], axis=0), axis=-1)
        usual = float(np.nanmedian(step)) if np.isfinite(step).any() else 0.0
        jump = max(0.05, 5.0 * usual)  # [m], and usual steps
        for start, stop in runs_of(zero[:, i]):
            neighbors = [distance[t] for t in (start - 1, stop) if 0 <= t < len(distance)]
            lost[start:stop, i] = np.nanmax([0.0, *neighbors]) > jump
    notes = [
        f"{name}: exactly at the origin in {gone.sum()} frames, taken as missing ({when(recording.time, gone)})"
        for name, gone in zip(recording.names, lost.T, strict=True)
        if gone.any()
    ]
    return _changed(recording, np.where(lost[..., None], np.nan, recording.positions), notes)


def exchanged_back(recording: Recording, points: Iterable[str]) -> Recording:
    """Exchange left and right points where they are exchanged for less than half of the frames."""
    positions, quality_warnings = recording.positions, []
    pairs = {tuple(sorted((name, other_side(name)))) for name in points}
    for first, second in sorted(pair for pair in pairs if pair[0] != pair[1] and set(pair) <= set(recording.names)):
        wrong = _exchanged(recording.point(first), recording.point(second), recording.time)
        if wrong.any():
            i, j = recording.names.index(first), recording.names.index(second)
            positions = positions.copy()
            positions[wrong, i], positions[wrong, j] = positions[wrong, j], positions[wrong, i]
            quality_warnings.append(
                f"{first} and {second} had each other's places in {wrong.sum()} frames and were given back "
                f"({when(recording.time, wrong)})"
            )
    return _changed(recording, positions, quality_warnings=quality_warnings)


def _exchanged(first: Array, second: Array, time: Array, least_step: float = 0.2) -> Bools:
    """Mark frames in which two points are exchanged: both step to where the other one was, by `least_step` [m]."""
    wrong = np.zeros(len(first), dtype=np.bool_)
    seen = np.flatnonzero(np.isfinite(first).all(axis=-1) & np.isfinite(second).all(axis=-1))
    for part in np.split(seen, np.flatnonzero(np.diff(time[seen]) > LONGEST_GAP) + 1):
        a, b = first[part], second[part]
        kept, crossed = (
            np.linalg.norm(x[1:] - a[:-1], axis=-1) + np.linalg.norm(y[1:] - b[:-1], axis=-1)
            for x, y in ((a, b), (b, a))
        )
        turns = (kept > 2 * least_step) & (crossed < 0.3 * kept)
        if turns.any():
            odd = np.concatenate([[False], np.cumsum(turns) % 2 == 1])
            wrong[part] = odd if odd.mean() < 0.5 else ~odd
    return wrong


def in_one_unit(recording: Recording, roles: Mapping[str, Any]) -> Recording:
    """Scale frames in which the whole body is 10, 100 or 1000 times as large or small as in most frames."""
    alike = 1.2  # factors that differ by less than this one are the same
    other_size = 1.6  # a smaller change of all lengths is left to the fit
    steady = 0.5  # a change of size for longer is another unit [s]; a shorter one is a fault of points
    lengths = _lengths(recording, roles)
    seen = np.flatnonzero((lengths > 0).all(axis=1))
    if not len(seen):
        return recording
    factors = lengths[seen] / np.quantile(lengths[seen], 0.5, axis=0, method="lower")  # of two sizes never the mean
    low, high = factors.min(axis=1), factors.max(axis=1)
    uniform, size = high < alike * low, np.log10(low * high) / 2
    metric = uniform & (np.abs(size - np.round(size)) < np.log10(alike))
    last = np.maximum(np.searchsorted(seen, np.arange(len(recording)), side="right") - 1, 0)  # where points are missing
    power = np.where(metric, np.round(size), 0.0)[last]
    changed = (uniform & ~metric & (np.abs(size) > np.log10(other_size)))[last]
    for start, stop in runs_of(changed):
        if recording.time[stop - 1] - recording.time[start] > steady:
            times = 10 ** np.median(size[last[start:stop]])
            raise RecordingError(
                f"{recording.source or 'the recording'}: {recording.time[start]:.2f} to "
                f"{recording.time[stop - 1]:.2f} s: the body is {times:.3g} times as large as in most frames; is there "
                "a second unit or a second person in the file? Use one part of it"
            )
    quality_warnings = [
        f"the body is {10.0**exponent:g} times as large as else in {(power == exponent).sum()} frames, which were "
        f"scaled back: their unit is another one ({when(recording.time, power == exponent)})"
        for exponent in np.unique(power[power != 0])
    ]
    return _changed(recording, recording.positions * (10.0**-power)[:, None, None], quality_warnings=quality_warnings)


def _lengths(recording: Recording, roles: Mapping[str, Any]) -> Array:
    """Return the lengths of upper arm, forearm and trunk, shape (n_frames, 3)."""
    shoulder, elbow, wrist = (role_position(recording, roles[name]) for name in ("shoulder", "elbow", "wrist"))
    low, high = (role_position(recording, names) for names in roles["trunk_up"])
    return np.asarray(np.linalg.norm(np.stack([elbow - shoulder, wrist - elbow, high - low], axis=1), axis=-1))


def without_leaps(recording: Recording) -> Recording:
    """Mark points as missing in frames in which they are elsewhere for a moment and come back."""
    positions, notes = recording.positions.copy(), []
    step = 1.0 / recording.rate if len(recording) > 2 else np.inf
    for i, name in enumerate(recording.names):
        lost = _elsewhere(positions[:, i], step)
        if lost.any():
            positions[lost, i] = np.nan
            frames = f"{lost.sum()} frames, taken as missing ({when(recording.time, lost)})"
            notes.append(f"{name}: elsewhere for a moment in {frames}")
    return _changed(recording, positions, notes)


def _elsewhere(track: Array, step: float, longest: float = 0.1, acceleration: float = 100.0) -> Bools:
    """Mark runs up to `longest` seconds that lie far from the line between the frames around them, track (n, 3).

    Far is farther than `LEAST_LEAP`, and than an `acceleration` [m/s²] would move it away and back; wrists that throw
    reach it. At most 100 frames are compared, however fast they follow one another.
    """
    track, lost = track.copy(), np.zeros(len(track), dtype=np.bool_)
    for count in range(1, min(int(longest / step + 1e-9), 100, len(track) - 2) + 1):
        far = np.linalg.norm(np.diff(track, axis=0), axis=-1) > 0.49 * LEAST_LEAP
        first = np.flatnonzero(far[: len(far) - count] & far[count:])  # by the rule below both steps are that large
        before, after = track[first, None], track[first + count + 1, None]
        k = np.arange(1, count + 1)
        offsets = track[first[:, None] + k] - (before + k[:, None] / (count + 1) * (after - before))
        away = np.linalg.norm(offsets, axis=-1).min(axis=1)
        least = max(LEAST_LEAP, acceleration * ((count + 1) * step) ** 2 / 8)
        with np.errstate(invalid="ignore"):
            found = first[(away > least) & (away > np.linalg.norm(after - before, axis=-1)[:, 0])]
        for i in k:
            lost[found + i] = True
            track[found + i] = np.nan
    return lost


def _changed(
    recording: Recording, positions: Array, notes: Sequence[str] = (), quality_warnings: Sequence[str] = ()
) -> Recording:
    """Return the recording with other positions and messages; the same object where there are no messages."""
    if not notes and not quality_warnings:
        return recording
    notes, quality_warnings = (*recording.notes, *notes), (*recording.quality_warnings, *quality_warnings)
    return replace(recording, positions=positions, notes=notes, quality_warnings=quality_warnings)
