"""Points that are hidden for long, placed by the rigid body that they form with visible points.

The body of a point are the points whose distances to it and to one another hardly change. At least three of them that
are visible and keep the shape of the body give its pose in a frame (W. Kabsch, Acta Crystallographica A32, 1976). How
well they place the point is measured in the frames in which it is visible: a point is placed only where the expected
error is small, so that a hand is not placed by a forearm, nor a wrist by a forearm that twists.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from maniport.mocap.recording import Bools, Recording, runs_of
from maniport.util.sampling import evenly_spaced
from maniport.util.validation import Array

# Limit of the change of a distance in a body, and of the distance of a visible point from its place [m]. The skin of
# trunks moves by 0.005 to 0.015.
RIGID = 0.02
LARGEST_ERROR = 0.015  # Limit of the expected error of a placed point [m]; 3° over a forearm
LEAST_ERROR = 0.001  # Error of a visible point that is assumed at least [m]
SHARE = 90.0  # Share of the frames in which changes and errors are below these limits [%]

# The most points of a body besides the hidden one. A hand is placed best by the few points on it, a trunk, whose skin
# moves, by many; of the bodies of these sizes the one counts that places the point in more frames, else better.
SIZES = (4, 8)
MOST_CANDIDATES = 24  # The most points that are compared with one another
FEWEST_POINTS = 3  # that are visible and give a pose
FEWEST_FRAMES = 10  # in which a point is visible, so that its error is known
SHAPE_FRAMES = 1000  # The most frames from which the shape of a body is taken …
ERROR_FRAMES = 2000  # … and in which places of a point are compared with its measurement
AROUND_GAP = 0.1  # Time before and after a gap in which the place of a point is compared with its measurement [s]


class Poses(NamedTuple):
    """Poses of a body in each frame; nan where fewer than three points are visible."""

    rotation: Array  # shape (n, 3, 3)
    translation: Array  # [m], shape (n, 3)
    distances: Array  # of the points from their places [m], shape (n, k)


class Placed(NamedTuple):
    """A point placed by the other points of its body in each frame."""

    positions: Array  # [m], shape (n, 3)
    rotation: Array  # of the body, shape (n, 3, 3)
    errors: Array  # expected [m], shape (n,); infinite where the visible points do not give a pose


def with_hidden_points(
    recording: Recording, whole: Recording, segments: Sequence[Sequence[str]] = ()
) -> Recording:
    """Place the hidden points of a recording, as far as points of the whole recording allow.

    Parameters
    ----------
    recording : Recording
        The points that are needed.
    whole : Recording
        All points in the same frames.
    segments : sequence of sequences of str, optional
        Names of points that move nearly as one body. A body has points of one of them, and others that are in none.

    Returns
    -------
    Recording
        With placed points and a note for each; the same object if there are none.
    """
    if not np.isnan(recording.positions).any():
        return recording
    observed = set(whole.observed)
    positions = recording.positions.copy()
    notes = []
    tracks = whole.positions.copy()
    for i, name in enumerate(recording.names):
        tracks[:, whole.names.index(name)] = positions[:, i]
    for i, name in enumerate(recording.names):
        hidden = np.isnan(recording.positions[:, i, 0])
        if name not in observed or not hidden.any():
            continue
        rows = _needed_rows(recording.time, hidden)
        allowed = _allowed_points(whole.names, name, segments)
        found = _best_body(tracks, whole.names.index(name), allowed, rows, hidden[rows])
        if found is None:
            continue
        columns, placed = found
        known = hidden[rows] & (placed.errors <= LARGEST_ERROR)
        offset = _offsets(recording.time[rows], recording.positions[rows, i], placed)
        shifted = placed.positions + np.einsum("nij,nj->ni", placed.rotation, offset)
        positions[rows[known], i] = shifted[known]
        others = ", ".join(whole.names[column] for column in columns[1:])
        error = 1e3 * float(np.max(placed.errors[known]))
        notes.append(
            f"{name}: hidden in {hidden.sum()} frames, in {known.sum()} of them placed by the rigid body "
            f"with {others} (expected error up to {error:.0f} mm)"
        )
    if not notes:
        return recording
    return replace(recording, positions=positions, notes=(*recording.notes, *notes))


def _needed_rows(time: Array, hidden: Bools) -> NDArray[np.intp]:
    """Return the frames in which a point is hidden, those around them and some in which it is visible."""
    seen = np.flatnonzero(~hidden)
    needed = hidden.copy()
    needed[seen[evenly_spaced(len(seen), ERROR_FRAMES)]] = True
    for start, stop in runs_of(hidden):
        first = np.searchsorted(time, time[start] - AROUND_GAP)
        last = np.searchsorted(time, time[stop - 1] + AROUND_GAP, side="right")
        needed[min(first, max(start - 1, 0)) : max(last, stop + 1)] = True
    return np.flatnonzero(needed)


def _allowed_points(
    names: Sequence[str], name: str, segments: Sequence[Sequence[str]]
) -> list[int]:
    """Return the points that may form a body with a point: those of its segment, and of none."""
    of_others = set[str]()
    for segment in segments:
        if name not in segment:
            of_others |= set(segment)
    return [i for i, other in enumerate(names) if other not in of_others]


def _best_body(
    tracks: Array,
    point: int,
    allowed: Sequence[int],
    rows: NDArray[np.intp],
    hidden: Bools,
) -> tuple[list[int], Placed] | None:
    """Return the points of the body that places a point in most rows in which it is hidden, and its places there."""
    best = None
    best_score = (0, 0.0)
    candidates = _companions(tracks, point, allowed)
    for size in SIZES:
        columns = [point, *candidates[:size]]
        if len(columns) <= FEWEST_POINTS:
            return None
        shape = _shape(tracks[evenly_spaced(len(tracks), SHAPE_FRAMES)][:, columns])
        if shape is None:
            continue
        placed = _placed(shape, tracks[rows][:, columns])
        errors = placed.errors[hidden & (placed.errors <= LARGEST_ERROR)]
        if not len(errors):
            continue
        score = (len(errors), -float(np.median(errors)))
        if score > best_score:
            best = columns, placed
            best_score = score
    return best


def _companions(tracks: Array, point: int, allowed: Sequence[int]) -> list[int]:
    """Return the allowed points of tracks (n, m, 3) that form a body with a point, the nearest to rigid first."""
    seen = np.flatnonzero(np.isfinite(tracks[:, point, 0]))
    sample = tracks[seen[evenly_spaced(len(seen), SHAPE_FRAMES)]]
    changes = np.full(tracks.shape[1], np.inf)
    for column in allowed:
        if column != point:
            changes[column] = _distance(sample, point, column)[1]

    # Distances between the others are taken from all frames, as one of two may be hidden where the point is seen.
    sample = tracks[evenly_spaced(len(tracks), SHAPE_FRAMES)]
    candidates = np.argsort(changes)[: np.sum(changes <= RIGID)][:MOST_CANDIDATES].tolist()
    is_rigid = np.eye(len(candidates), dtype=np.bool_)
    for i, first in enumerate(candidates):
        for j, second in enumerate(candidates[:i]):
            rigid = _distance(sample, first, second)[1] <= RIGID
            is_rigid[i, j] = is_rigid[j, i] = rigid

    # A point that is rigid with few others is out of place in many frames, or of another body.
    partners = is_rigid.sum(axis=1)
    chosen: list[int] = []
    for i in range(len(candidates)):
        has_partners = 2 * partners[i] >= partners.max()
        if has_partners and is_rigid[i, chosen].all() and len(chosen) < max(SIZES):
            chosen.append(i)
    return [candidates[i] for i in chosen]


def _distance(tracks: Array, first: int, second: int) -> tuple[float, float]:
    """Return the median distance of two points [m], and its change; nan and infinity if they are never both seen."""
    distances = np.linalg.norm(tracks[:, first] - tracks[:, second], axis=-1)
    distances = distances[np.isfinite(distances)]
    if len(distances) < FEWEST_FRAMES:
        return np.nan, np.inf
    median = float(np.median(distances))
    return median, float(np.percentile(np.abs(distances - median), SHARE))


def _shape(tracks: Array) -> Array | None:
    """Return the shape (k, 3) of a body with tracks (n, k, 3): from its distances, then as the median in its frame."""
    count = tracks.shape[1]
    squares = np.zeros((count, count))
    for first in range(count):
        for second in range(first):
            distance, _ = _distance(tracks, first, second)
            squares[first, second] = squares[second, first] = distance**2
    if not np.isfinite(squares).all():
        return None

    # Classical multidimensional scaling (W. Torgerson, Psychometrika 17, 1952) up to the handedness
    centering = np.eye(count) - 1.0 / count
    values, vectors = np.linalg.eigh(-0.5 * centering @ squares @ centering)
    shape: Array = vectors[:, -3:] * np.sqrt(np.maximum(values[-3:], 0.0))
    mirrored = shape * np.array([-1.0, 1.0, 1.0])
    visible = np.isfinite(tracks[..., 0])
    misfits = []
    for candidate in (shape, mirrored):
        distances = _poses(candidate, tracks, visible).distances
        misfits.append(np.inf if np.isnan(distances).all() else float(np.nanmedian(distances)))
    if not np.isfinite(misfits).any():
        return None
    if misfits[1] < misfits[0]:
        shape = mirrored

    for _ in range(3):
        poses = _poses(shape, tracks, visible)
        local = np.einsum("nji,nkj->nki", poses.rotation, tracks - poses.translation[:, None])
        seen = np.isfinite(local[..., 0])
        if seen.sum(axis=0).min() < FEWEST_FRAMES:
            return None
        shape = np.asarray(np.nanmedian(local, axis=0))
    return shape


def _poses(shape: Array, tracks: Array, visible: Bools) -> Poses:
    """Return the poses that bring a shape (k, 3) nearest to the visible points of tracks (n, k, 3)."""
    weights = visible.astype(float)
    count = weights.sum(axis=1)
    enough = count >= FEWEST_POINTS
    total = np.where(enough, count, np.nan)[:, None]
    points = np.where(visible[..., None], tracks, 0.0)
    center = points.sum(axis=1) / total
    shape_center = weights @ shape / total

    modeled = (shape - shape_center[:, None]) * weights[..., None]
    measured = (points - center[:, None]) * weights[..., None]
    covariance = np.einsum("nki,nkj->nij", np.nan_to_num(measured), np.nan_to_num(modeled))
    left, _, right = np.linalg.svd(covariance)
    left[..., 2] *= np.sign(np.linalg.det(left @ right))[:, None]
    rotation = left @ right
    rotation[~enough] = np.nan
    translation = center - np.einsum("nij,nj->ni", rotation, shape_center)

    places = np.einsum("nij,kj->nki", rotation, shape) + translation[:, None]
    distances = np.linalg.norm(tracks - places, axis=-1)
    return Poses(rotation, translation, np.where(visible, distances, np.nan))


def _placed(shape: Array, tracks: Array) -> Placed:
    """Place the first point of a body with a shape (k, 3) and tracks (n, k, 3) by the others."""
    visible = _consistent(shape, tracks)
    poses = _poses(shape, tracks, visible)
    rotation = poses.rotation
    places = np.einsum("nij,j->ni", rotation, shape[0]) + poses.translation
    dilution = _dilution(shape, visible)

    # Of three points none can be left out. So all must be in place.
    misfits = np.max(np.where(visible, poses.distances, 0.0), axis=1)
    is_placed = np.isfinite(places[:, 0]) & (misfits <= RIGID)
    measured = is_placed & np.isfinite(tracks[:, 0, 0])
    errors = np.full(len(tracks), np.inf)
    if measured.sum() >= FEWEST_FRAMES:
        found = np.linalg.norm(places - tracks[:, 0], axis=-1)[measured]
        scale = max(float(np.percentile(found / dilution[measured], SHARE)), LEAST_ERROR)
        errors[is_placed] = scale * dilution[is_placed]
    return Placed(places, rotation, errors)


def _consistent(shape: Array, tracks: Array) -> Bools:
    """Return which points of tracks (n, k, 3) besides the first are visible and keep the shape.

    Of four or more points the one is left out without which the others are nearest to the shape, until all are near.
    """
    visible = np.isfinite(tracks[..., 0])
    visible[:, 0] = False
    for _ in range(tracks.shape[1]):
        distances = _poses(shape, tracks, visible).distances
        farthest = np.max(np.where(visible, np.nan_to_num(distances), 0.0), axis=1)
        rows = np.flatnonzero((farthest > RIGID) & (visible.sum(axis=1) > FEWEST_POINTS))
        if not len(rows):
            break
        misfits = np.full((len(rows), tracks.shape[1]), np.inf)
        for point in range(1, tracks.shape[1]):
            without = visible[rows]
            without[:, point] = False
            left = _poses(shape, tracks[rows], without).distances
            worst = np.max(np.where(without, np.nan_to_num(left), 0.0), axis=1)
            misfits[:, point] = np.where(visible[rows, point], worst, np.inf)
        visible[rows, np.argmin(misfits, axis=1)] = False
    return visible


def _dilution(shape: Array, visible: Bools) -> Array:
    """Return the error of the first point's place for unit errors of the visible ones, shape (n,).

    The error grows with the distance from the visible points, and beyond bounds if they are on one line.
    """
    weights = visible.astype(float)
    count = np.maximum(weights.sum(axis=1), 1.0)
    center = weights @ shape / count[:, None]
    arms = (shape - center[:, None]) * weights[..., None]
    scatter = np.einsum("nki,nkj->nij", arms, arms)
    identity = np.eye(3)
    regular = 1e-9  # [m²], of points nearer to a line than 0.03 mm
    inertia = np.trace(scatter, axis1=1, axis2=2)[:, None, None] * identity - scatter
    lever = shape[0] - center
    spread = np.sum(lever**2, axis=1)[:, None, None] * identity - np.einsum(
        "ni,nj->nij", lever, lever
    )
    turning = np.trace(np.linalg.inv(inertia + regular * identity) @ spread, axis1=1, axis2=2)
    return np.asarray(np.sqrt(1.0 / count + turning / 3.0))


def _offsets(time: Array, track: Array, placed: Placed) -> Array:
    """Return the offsets (n, 3) of a track from its places in the frame of the body [m], interpolated over gaps.

    Skin moves slowly. So a placed point joins the measured ones at either end of a gap.
    """
    offsets = np.zeros((len(track), 3))
    measured = np.isfinite(track[:, 0]) & (placed.errors <= LARGEST_ERROR)
    local = np.einsum("nji,nj->ni", placed.rotation, track - placed.positions)
    for start, stop in runs_of(np.isnan(track[:, 0])):
        ends = []
        values = []
        before = measured & (time < time[start]) & (time >= time[start] - AROUND_GAP)
        after = measured & (time > time[stop - 1]) & (time <= time[stop - 1] + AROUND_GAP)
        for end, rows in ((time[start], before), (time[stop - 1], after)):
            if not rows.any():
                continue
            value = np.median(local[rows], axis=0)
            if np.linalg.norm(value) <= RIGID:
                ends.append(end)
                values.append(value)
        if ends:
            gap = time[start:stop]
            for axis, column in enumerate(np.transpose(values)):
                offsets[start:stop, axis] = np.interp(gap, ends, column)
    return offsets
