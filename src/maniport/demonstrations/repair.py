"""What is wrong in real recordings, found and put right before an arm is fitted; each says what it did.

Only what is unmistakable is put right. A recording without these faults comes back as it is, to the last bit.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from maniport.demonstrations.dialects import other_side
from maniport.demonstrations.recording import LONGEST_GAP, Recording, runs_of, when
from maniport.demonstrations.roles import role_position
from maniport.errors import InvalidInputError, RecordingError
from maniport.validation import Array

Bools = NDArray[np.bool_]

SOMEWHERE, MANY = 0.05, 5.0
"""A point leaps to the origin where it comes from farther away than this [m], and than so many of its usual steps."""

LONGEST_LEAP = 0.1
"""A point that is elsewhere for this long at most [s] and comes back is taken for lost …"""
MOST_AWAY = 100
"""No more frames than these are compared, however fast they follow one another."""
LEAST_LEAP = 0.1
"""… if it is away by more than this [m] …"""
FASTEST_TURN = 100.0
"""… and by more than an acceleration of so much would bring it away and back [m/s²]; wrists that throw reach it."""

LATEST_FRAME = 0.5
"""Frames that are later in the file than in time by no more than this are sorted [s]."""
MOST_DOUBLED = 0.1
"""No more than this part of the frames may bear the time of another one: else motion would be lost with them."""

LEAST_EXCHANGE = 0.2
"""Left and right points exchange places only where both step at least this far together [m]."""

ALIKE = 1.2
"""Factors that differ by less than this one are the same."""
STEADY = 0.5
"""A body that is larger or smaller by this many seconds has another unit [s]; a shorter one is a fault of points."""
OTHER_SIZE = 1.6
"""A change of all lengths by less than this factor is left to the fit."""


def repaired(recording: Recording, points: Sequence[str], roles: Mapping[str, Any]) -> Recording:
    """The points that are used, without the faults below; what was done is said in `notes` and `doubts`."""
    whole = exchanged_back(without_zeros(recording), points)
    return without_leaps(in_one_unit(whole.select(points), roles))


def in_order(time: Array, positions: Array) -> tuple[Array, Array, list[str]]:
    """Sort frames that are a little late, and drop those that bear the time of another one."""
    if not np.isfinite(time).all() or time.shape != positions.shape[:1] or (np.diff(time) > 0).all():
        return time, positions, []
    late = np.maximum.accumulate(time) - time
    if late.max() > LATEST_FRAME:
        i = int(np.argmax(late > LATEST_FRAME))
        raise InvalidInputError(
            f"time goes back by {late[i]:.3g} s at index {i}, to {time[i]:g} s: frames may be late by up to "
            f"{LATEST_FRAME:g} s; are there several recordings in the file? Use one of them"
        )
    order = np.argsort(time, kind="stable")
    kept = order[np.concatenate([[True], np.diff(time[order]) > 0])]
    doubled = len(time) - len(kept)
    if doubled > MOST_DOUBLED * len(time):
        raise InvalidInputError(
            f"{doubled} of {len(time)} frames bear the time of another one, the first at index "
            f"{int(np.argmax(np.diff(time) == 0)) + 1}; at most {MOST_DOUBLED:.0%} may: are times rounded too far? "
            f"Give the frames per second"
        )
    notes = [f"{int((late > 0).sum())} frames were out of order in time and were sorted"] if (late > 0).any() else []
    notes += [f"{doubled} frames with the time of another one were left out"] if doubled else []
    return time[kept], positions[kept], notes


def without_zeros(recording: Recording) -> Recording:
    """Take points at exactly (0, 0, 0) for missing where they leap there, or where several always are."""
    zero = (recording.positions == 0).all(axis=-1)
    if not zero.any():
        return recording
    always = zero.all(axis=0)
    lost = zero & (always.sum() > 1)
    for i in np.flatnonzero(zero.any(axis=0) & ~always):
        distance = np.linalg.norm(recording.positions[:, i], axis=-1)
        step = np.linalg.norm(np.diff(recording.positions[:, i], axis=0), axis=-1)
        least = max(SOMEWHERE, MANY * float(np.nanmedian(step)) if np.isfinite(step).any() else 0.0)
        for start, stop in runs_of(zero[:, i]):
            beside = [distance[t] for t in (start - 1, stop) if 0 <= t < len(distance)]
            lost[start:stop, i] = np.nanmax([0.0, *beside]) > least
    notes = [
        f"{name}: exactly at the origin in {gone.sum()} frames, taken as missing ({when(recording.time, gone)})"
        for name, gone in zip(recording.names, lost.T, strict=True)
        if gone.any()
    ]
    return _changed(recording, np.where(lost[..., None], np.nan, recording.positions), notes)


def exchanged_back(recording: Recording, points: Iterable[str]) -> Recording:
    """Give points back to their side where left and right exchange places for less than half of the frames."""
    positions, doubts = recording.positions, []
    pairs = {tuple(sorted((name, other_side(name)))) for name in points}
    for one, other in sorted(pair for pair in pairs if pair[0] != pair[1] and set(pair) <= set(recording.names)):
        wrong = _exchanged(recording.point(one), recording.point(other), recording.time)
        if wrong.any():
            here, there = recording.names.index(one), recording.names.index(other)
            positions = positions.copy()
            positions[wrong, here], positions[wrong, there] = positions[wrong, there], positions[wrong, here]
            doubts.append(
                f"{one} and {other} had each other's places in {wrong.sum()} frames and were given back "
                f"({when(recording.time, wrong)})"
            )
    return _changed(recording, positions, doubts=doubts)


def _exchanged(one: Array, other: Array, time: Array) -> Bools:
    """The frames in which two points have each other's places: both step to where the other one was."""
    wrong = np.zeros(len(one), dtype=np.bool_)
    seen = np.flatnonzero(np.isfinite(one).all(axis=-1) & np.isfinite(other).all(axis=-1))
    for part in np.split(seen, np.flatnonzero(np.diff(time[seen]) > LONGEST_GAP) + 1):
        a, b = one[part], other[part]
        kept, crossed = (
            np.linalg.norm(x[1:] - a[:-1], axis=-1) + np.linalg.norm(y[1:] - b[:-1], axis=-1)
            for x, y in ((a, b), (b, a))
        )
        turns = (kept > 2 * LEAST_EXCHANGE) & (crossed < 0.3 * kept)
        if turns.any():
            odd = np.concatenate([[False], np.cumsum(turns) % 2 == 1])
            wrong[part] = odd if odd.mean() < 0.5 else ~odd
    return wrong


def in_one_unit(recording: Recording, roles: Mapping[str, Any]) -> Recording:
    """Scale frames in which the whole body is 10, 100 or 1000 times as large or small as in most frames."""
    lengths = _lengths(recording, roles)
    seen = np.flatnonzero((lengths > 0).all(axis=1))
    if not len(seen):
        return recording
    factors = lengths[seen] / np.quantile(lengths[seen], 0.5, axis=0, method="lower")  # of two sizes never the mean
    low, high = factors.min(axis=1), factors.max(axis=1)
    alike, size = high < ALIKE * low, np.log10(low * high) / 2
    metric = alike & (np.abs(size - np.round(size)) < np.log10(ALIKE))
    last = np.maximum(np.searchsorted(seen, np.arange(len(recording)), side="right") - 1, 0)  # where points are missing
    power = np.where(metric, np.round(size), 0.0)[last]
    changed = (alike & ~metric & (np.abs(size) > np.log10(OTHER_SIZE)))[last]
    for start, stop in runs_of(changed):
        if recording.time[stop - 1] - recording.time[start] > STEADY:
            times = 10 ** np.median(size[last[start:stop]])
            raise RecordingError(
                f"{recording.source or 'the recording'}: {recording.time[start]:.2f} to "
                f"{recording.time[stop - 1]:.2f} s: the body is {times:.3g} times as large as in most frames; is there "
                "a second unit or a second person in the file? Use one part of it"
            )
    doubts = [
        f"the body is {10.0**one:g} times as large as else in {(power == one).sum()} frames, which were scaled back: "
        f"their unit is another one ({when(recording.time, power == one)})"
        for one in np.unique(power[power != 0])
    ]
    return _changed(recording, recording.positions * (10.0**-power)[:, None, None], doubts=doubts)


def _lengths(recording: Recording, roles: Mapping[str, Any]) -> Array:
    """Lengths of upper arm, forearm and trunk, shape (n_frames, 3)."""
    shoulder, elbow, wrist = (role_position(recording, roles[name]) for name in ("shoulder", "elbow", "wrist"))
    low, high = (role_position(recording, names) for names in roles["trunk_up"])
    return np.asarray(np.linalg.norm(np.stack([elbow - shoulder, wrist - elbow, high - low], axis=1), axis=-1))


def without_leaps(recording: Recording) -> Recording:
    """Take points for missing in frames in which they are elsewhere, for a moment, and come back."""
    positions, notes = recording.positions, []
    step = 1.0 / recording.rate if len(recording) > 2 else np.inf
    for i, name in enumerate(recording.names):
        lost = _elsewhere(positions[:, i], step)
        if lost.any():
            if positions is recording.positions:
                positions = positions.copy()
            positions[lost, i] = np.nan
            notes.append(f"{name}: elsewhere for a moment in {lost.sum()} frames, taken as missing "
                         f"({when(recording.time, lost)})")  # fmt: skip
    return _changed(recording, positions, notes)


def _elsewhere(track: Array, step: float) -> Bools:
    """Frames of short runs that lie far beside the line between the frames around them, for a track (n, 3)."""
    track, lost = track.copy(), np.zeros(len(track), dtype=np.bool_)
    for count in range(1, min(int(LONGEST_LEAP / step + 1e-9), MOST_AWAY, len(track) - 2) + 1):
        far = np.linalg.norm(np.diff(track, axis=0), axis=-1) > 0.49 * LEAST_LEAP
        first = np.flatnonzero(far[: len(far) - count] & far[count:])  # by the rule below both steps are that large
        before, after = track[first, None], track[first + count + 1, None]
        k = np.arange(1, count + 1)
        beside = track[first[:, None] + k] - (before + k[:, None] / (count + 1) * (after - before))
        away = np.linalg.norm(beside, axis=-1).min(axis=1)
        least = max(LEAST_LEAP, FASTEST_TURN * ((count + 1) * step) ** 2 / 8)
        with np.errstate(invalid="ignore"):
            found = first[(away > least) & (away > np.linalg.norm(after - before, axis=-1)[:, 0])]
        for i in k:
            lost[found + i] = True
            track[found + i] = np.nan
    return lost


def _changed(
    recording: Recording, positions: Array, notes: Sequence[str] = (), doubts: Sequence[str] = ()
) -> Recording:
    """The recording with other positions, and what is said of them; the same object where nothing is."""
    if not notes and not doubts:
        return recording
    notes, doubts = (*recording.notes, *notes), (*recording.doubts, *doubts)
    return replace(recording, positions=positions, notes=notes, doubts=doubts)
