"""Repair of unmistakable faults of recordings, and smoothing of noise; each change is reported.

A recording without faults stays bit-identical. Noise, as of video keypoints, is measured; large noise is smoothed by a
robust spline: each track x of a point minimizes

    Σ_t w_t |x_t - y_t|² + λ Σ_t |Δ³ x_t|²

(Eilers, Analytical Chemistry 75, 2003, with third differences). The weights w are those of Student's distribution, so
that outliers do not pull the track. λ has the least generalized cross-validation.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
from scipy.linalg import solveh_banded
from scipy.ndimage import median_filter
from scipy.special import comb

from maniport.errors import InvalidInputError, argument, counted, spoken
from maniport.mocap.recording import (
    LONGEST_GAP,
    Bools,
    Recording,
    all_axes,
    runs_of,
    when,
)
from maniport.mocap.roles import other_side
from maniport.util.defaults import AUTO
from maniport.util.validation import Array

MIN_JUMP = 0.1  # Least displacement of a point that is taken for an outlier [m]

REST_JUMP = 0.03  # Least displacement of a point from a rest pose to the motion [m]
JUMP_ACCELERATION = 50.0  # [m/s²]: of hands in fast reaching; at 30 Hz the jump exceeds 0.06 m


def in_order(time: Array, positions: Array, most: float = 0.1) -> tuple[Array, Array, list[str]]:
    """Omit frames, a share of at most `most`, whose time does not exceed that of every frame before."""
    if (
        not np.isfinite(time).all()
        or time.shape != positions.shape[:1]
        or (np.diff(time) > 0).all()
    ):
        return time, positions, []
    kept = np.concatenate([[True], time[1:] > np.maximum.accumulate(time)[:-1]])
    count = int((~kept).sum())
    first = int(np.argmin(kept))
    if count > most * len(time):
        raise InvalidInputError(
            f"the times of {count} of {len(time)} frames do not increase, the first at index {first}, "
            f"{time[first]:g} s; at most {100 * most:.0f} % may. If the file holds several recordings, split it; if "
            f"times are rounded, give the frames per second ({spoken('rate')})"
        )
    return (
        time[kept],
        positions[kept],
        [f"{counted(count, 'frame')} with times that do not increase omitted"],
    )


def without_zeros(recording: Recording) -> Recording:
    """Mark points at exactly (0, 0, 0) as missing where they jump there, or where several always are."""
    if recording.positions.all():  # faster than flags for each point
        return recording
    zero = all_axes(recording.positions == 0)
    if not zero.any():
        return recording
    always = zero.all(axis=0)
    lost = zero & (always.sum() > 1)
    for i in np.flatnonzero(zero.any(axis=0) & ~always):
        distance = np.linalg.norm(recording.positions[:, i], axis=-1)
        step = np.linalg.norm(np.diff(recording.positions[:, i], axis=0), axis=-1)
        if np.isfinite(step).any():
            usual = float(np.nanmedian(step))
        else:
            usual = 0.0
        for start, stop in runs_of(zero[:, i]):
            neighbors = [distance[t] for t in (start - 1, stop) if 0 <= t < len(distance)]
            lost[start:stop, i] = np.nanmax([0.0, *neighbors]) > max(0.05, 5.0 * usual)  # [m]
    return _marked_missing(recording, lost, "exactly at the origin")


def without_rest_poses(
    recording: Recording,
    restarts: bool = False,
    is_cut: tuple[bool, bool] = (False, False),
) -> Recording:
    """Omit rest poses, such as a T-pose, at either end: identical frames from which the motion jumps.

    Parameters
    ----------
    recording : Recording
        Positions [m].
    restarts : bool
        Whether times begin at zero after the rest pose, since the file states none.
    is_cut : (bool, bool)
        Whether frames are missing before the first and after the last, so that there is no rest pose.

    Returns
    -------
    Recording
        With a note for each rest pose.
    """
    positions = recording.positions
    if is_cut[0]:
        first = 0
    else:
        first = rest_frames(positions, recording.time)
    if is_cut[1]:
        last = 0
    else:
        last = rest_frames(positions[::-1], -recording.time[::-1])
    if first + last == 0 or first + last > len(recording) - 2:
        return recording
    notes = []
    if first:
        notes.append(rest_pose_note(first, "first"))
    if last:
        notes.append(rest_pose_note(last, "last"))
    kept = slice(first, len(recording) - last)
    time = recording.time[kept]
    if restarts and first and recording.time[0] == 0.0:
        time = recording.time[: len(time)]
    return replace(
        recording, positions=positions[kept], time=time, notes=(*recording.notes, *notes)
    )


def rest_pose_note(count: int, end: str) -> str:
    """Return the note on a rest pose of some frames at the end "first" or "last"."""
    if count == 1:
        frames = f"the {end} frame"
    else:
        frames = f"the {end} {count} frames"
    if count == 1:
        verb = "was"
    else:
        verb = "were"
    return f"{frames}, a rest pose from which the motion jumps, {verb} omitted"


def rest_frames(positions: Array, time: Array) -> int:
    """Return the number of frames of a rest pose at the start, from positions (n, k, 3) [m] and times [s].

    A rest pose is far from where the motion after it comes from: its distance to that place exceeds both the path of
    the points in one step and what an acceleration of `JUMP_ACCELERATION` makes possible. A person who stands still
    and then moves, and a frozen beginning that the motion continues, are near to it.
    """
    run = _identical_frames(positions)
    if run < len(positions) and _identical_frames(positions[run:]) > 1:
        # as a T-pose before the pose of a calibration
        following = _one_rest_pose(positions[run:], time[run:])
        distances = np.linalg.norm(positions[run] - positions[0], axis=-1)
        if following and np.nanmax(distances, initial=0.0) > REST_JUMP:
            return run + following
    return _one_rest_pose(positions, time)


def _one_rest_pose(positions: Array, time: Array) -> int:
    """Return the number of identical frames at the start from which the motion jumps."""
    run = _identical_frames(positions)
    after = _distinct_frames(positions, run)
    if len(after) < 4:
        return 0
    poses = positions[[0, *after]]
    observed = np.isfinite(poses).all(axis=(0, 2))
    if np.count_nonzero(observed) < 3:
        return 0

    poses = poses[:, observed]
    jump = poses[1] - poses[0]
    steps = np.diff(poses[1:], axis=0)
    surplus = jump - steps[0]
    distances = np.linalg.norm(surplus, axis=-1)
    seconds = float(np.median(np.diff(time[after])))
    least = max(REST_JUMP, JUMP_ACCELERATION * seconds**2)
    longest_step = np.sqrt((steps**2).sum(axis=-1).mean(axis=-1)).max()
    distance = np.sqrt((distances**2).mean())
    if run > 1:
        is_jump = distances.max() > least and distance > 1.5 * longest_step
        if is_jump:
            return run
        return 0

    # One frame may also be an outlier or the beginning of a fast motion: the evidence must be clearer.
    moved = np.count_nonzero(distances > least)
    is_jump = moved >= 3 and distance > 3.0 * longest_step
    if is_jump:
        return 1
    return 0


def _identical_frames(positions: Array) -> int:
    """Return the number of frames at the start in which all points are where they are in the first."""
    same_place = 1e-5  # [m]
    first = positions[0]
    lost = np.isnan(first[:, 0])
    size = 16
    count = 1
    while count < len(positions):
        block = positions[count : count + size]
        differences = np.abs(block - first)
        differences[:, lost] = np.where(np.isnan(block[:, lost]), 0.0, np.inf)
        same = (differences <= same_place).all(axis=(1, 2))
        if not same.all():
            return count + int(np.argmin(same))
        count += len(block)
        size *= 2
    return len(positions)


def _distinct_frames(positions: Array, start: int, most: int = 5) -> list[int]:
    """Return the first frames from `start` on that differ from the one before: some files repeat each frame."""
    frames: list[int] = []
    while start < len(positions) and len(frames) < most:
        frames.append(start)
        start += _identical_frames(positions[start:])
    return frames


def unswapped(recording: Recording, points: Iterable[str], least_step: float = 0.2) -> Recording:
    """Exchange left and right points in the frames, less than half, in which they are swapped.

    Swapped points both step, by at least `least_step` [m], to where the other one was.
    """
    positions = recording.positions.copy()
    texts = []
    recorded = set(recording.names)
    pairs = set[tuple[str, str]]()
    for name in points:
        other = other_side(name)
        if name != other and {name, other} <= recorded:
            pairs.add((min(name, other), max(name, other)))
    for pair in sorted(pairs):
        columns = [recording.names.index(name) for name in pair]
        tracks = positions[:, columns]
        swapped = np.zeros(len(recording), dtype=np.bool_)
        observed = np.flatnonzero(np.isfinite(tracks).all(axis=(1, 2)))
        for part in np.split(
            observed, np.flatnonzero(np.diff(recording.time[observed]) > LONGEST_GAP) + 1
        ):
            before = tracks[part[:-1]]
            after = tracks[part[1:]]
            kept = np.linalg.norm(after - before, axis=-1).sum(axis=1)
            crossed = np.linalg.norm(after[:, ::-1] - before, axis=-1).sum(axis=1)
            exchanges = (kept > 2 * least_step) & (crossed < 0.3 * kept)
            if exchanges.any():
                odd = np.concatenate([[False], np.cumsum(exchanges) % 2 == 1])
                if odd.mean() < 0.5:
                    swapped[part] = odd
                else:
                    swapped[part] = ~odd
        if swapped.any():
            positions[:, columns] = np.where(swapped[:, None, None], tracks[:, ::-1], tracks)
            texts.append(
                f"{pair[0]} and {pair[1]} were swapped in {counted(int(swapped.sum()), 'frame')} and were exchanged "
                f"({when(recording.time, swapped)})"
            )
    return _changed(recording, positions, [], texts)


def without_outliers(recording: Recording) -> Recording:
    """Mark points as missing in short runs of frames in which they are elsewhere and come back."""
    if len(recording) > 2:
        step = 1.0 / recording.rate
    else:
        step = np.inf
    lost = [_outliers(track, step) for track in np.moveaxis(recording.positions, 1, 0)]
    return _marked_missing(recording, np.stack(lost, axis=1), "outlier")


def _outliers(
    track: Array, step: float, longest: float = 0.1, acceleration: float = 100.0
) -> Bools:
    """Mark runs up to `longest` seconds that are far from the line between the frames around them, track (n, 3)."""
    track = track.copy()
    lost = np.zeros(len(track), dtype=np.bool_)
    for count in range(1, min(int(longest / step + 1e-9), 100, len(track) - 2) + 1):
        far = np.linalg.norm(np.diff(track, axis=0), axis=-1) > 0.49 * MIN_JUMP
        # by the rule below both steps are that large
        first = np.flatnonzero(far[: len(far) - count] & far[count:])
        before = track[first, None]
        after = track[first + count + 1, None]
        k = np.arange(1, count + 1)
        line = before + k[:, None] / (count + 1) * (after - before)
        away = np.linalg.norm(track[first[:, None] + k] - line, axis=-1).min(axis=1)
        length = np.linalg.norm(after - before, axis=-1)[:, 0]
        thrown = acceleration * ((count + 1) * step) ** 2 / 8  # as far as throws move it and back
        with np.errstate(invalid="ignore"):
            first = first[(away > max(MIN_JUMP, thrown)) & (away > length)]
        rows = first[:, None] + k
        lost[rows] = True
        track[rows] = np.nan
    return lost


def _marked_missing(recording: Recording, lost: Bools, cause: str) -> Recording:
    """Return the recording without the marked points, lost (n_frames, n_points), with a note for each point."""
    notes = []
    for name, frames in zip(recording.names, lost.T, strict=True):
        if frames.any():
            count = counted(int(frames.sum()), "frame")
            moments = when(recording.time, frames)
            notes.append(f"{name}: {cause} in {count}, taken as missing ({moments})")
    return _changed(recording, np.where(lost[..., None], np.nan, recording.positions), notes, [])


def _changed(
    recording: Recording, positions: Array, notes: list[str], warnings: list[str]
) -> Recording:
    """Return the recording with other positions and messages; the same object where there are no messages."""
    if not notes and not warnings:
        return recording
    texts = (*recording.notes, *notes), (*recording.quality_warnings, *warnings)
    return replace(recording, positions=positions, notes=texts[0], quality_warnings=texts[1])


def smoothed(recording: Recording, smooth: bool = True, large_noise: float = 0.004) -> Recording:
    """Smooth the noisy points, or only report them, in `quality_warnings`.

    Noise in one direction [m] of optical systems is 0.0001 to 0.001, of people who climb and jump 0.002, of video 0.005
    to 0.02. Below 20 frames per second motion is not distinct from noise.
    """
    rate = recording.rate
    positions = recording.positions.copy()
    cutoffs = []
    # Cutoff frequencies, at which half the amplitude is left [Hz]; of lower ones rounding moves points by millimeters.
    candidates = [f for f in np.geomspace(0.8, 12.0, 15) if 0.003 * rate <= f < 0.45 * rate]
    amounts = np.array([noise(track) for track in np.moveaxis(positions, 1, 0)])
    noisy = np.flatnonzero((amounts > large_noise) & (rate >= 20.0) & bool(candidates))
    for i in noisy if smooth else ():
        for start, stop in runs_of(np.isfinite(positions[:, i, 0])):
            if stop - start >= 12:
                positions[start:stop, i], cutoff = _robust_spline(
                    positions[start:stop, i], rate, candidates
                )
                cutoffs.append(cutoff)
    if not len(noisy) or (smooth and not cutoffs):
        return recording
    names = ", ".join(recording.names[i] for i in noisy)
    how = f"; {argument('smooth', AUTO)} smooths them"
    if smooth:
        how = f", smoothed up to {_span(cutoffs)} Hz; {argument('smooth', 'off')} keeps them"
    return _changed(
        recording, positions, [], [f"{names}: noise of {_span(1e3 * amounts[noisy])} mm{how}"]
    )


def noise(track: Array, order: int = 6) -> float:
    """Estimate the standard deviation of a track's noise in one direction [m], shape (n, 3); nan where it cannot.

    Motion up to a seventh of the frame rate hardly shows in differences of sixth order.
    """
    differences = np.abs(np.diff(track, order, axis=0))
    if not np.isfinite(differences).any():
        return float("nan")
    return float(np.nanmedian(differences) / 0.6745 / np.sqrt(comb(2 * order, order)))


def _span(values: Array | list[float]) -> str:
    """Describe a range of values to two digits."""
    low = f"{np.nanmin(values):.2g}"
    high = f"{np.nanmax(values):.2g}"
    if low == high:
        return low
    return f"{low} to {high}"


def _robust_spline(track: Array, rate: float, cutoffs: Sequence[float]) -> tuple[Array, float]:
    """Smooth one run of frames (n, 3); return it with the cutoff [Hz]."""
    # degrees of freedom of Student's distribution
    n = len(track)
    tails = 4.0
    median_chi_squared = 2.366  # with three degrees of freedom
    # third differences; DᵀD as lower bands
    pattern = np.array([-1.0, 3.0, -3.0, 1.0])
    penalty = np.zeros((4, n))
    for offset in range(4):
        for k in range(4 - offset):
            penalty[offset, k : n - 3 + k] += pattern[k] * pattern[k + offset]
    waves = (2 * np.sin(np.pi * (np.arange(n) + 0.5) / (2 * n))) ** 6
    weight = np.ones(n)
    least = max(noise(track) ** 2, 1e-18)
    for _ in range(6):
        fits = []  # score, cutoff and smooth track
        for frequency in cutoffs:
            # half the amplitude is left at the cutoff
            strength = (2 * np.sin(np.pi * min(frequency / rate, 0.5))) ** -6.0
            bands = strength * penalty
            bands[0] += weight
            smooth = solveh_banded(bands, weight[:, None] * track, lower=True)
            freedom = np.sum(1 / (1 + strength / weight.mean() * waves))
            error = np.sum(weight * np.sum((track - smooth) ** 2, axis=-1)) / weight.sum()
            fits.append((error / (1 - freedom / n) ** 2, float(frequency), smooth))
        _, cutoff, smooth = min(fits, key=lambda fit: fit[0])
        squares = np.sum((track - smooth) ** 2, axis=-1)
        # A short outlier counts less; frames where motion is too fast for the spline for longer do not.
        scale = median_filter(squares, 15, mode="nearest") / median_chi_squared
        weight = (tails + 3) / (tails + squares / np.maximum(scale, least))
    return smooth, cutoff
