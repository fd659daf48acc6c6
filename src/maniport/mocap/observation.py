"""Observation of one arm and the trunk: roles, cleaned points, fully observed frames, segment lengths."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from maniport.arms import Arm
from maniport.arms.human import LONGEST_SEGMENT
from maniport.errors import RecordingError
from maniport.mocap.cleaning import smoothed, unswapped, without_outliers, without_zeros
from maniport.mocap.directions import AXES, MARKED, SEGMENTS, Directions
from maniport.mocap.marker_sets import DIRECTIONS
from maniport.mocap.recording import Bools, Recording, runs_of
from maniport.mocap.roles import (
    Basis,
    direction,
    find_side,
    points_of,
    role_position,
    trunk_rotation,
    unit,
)
from maniport.util.validation import Array

SHORTEST_SEGMENT = 0.005  # Lower bound of the length of an arm segment [m]


@dataclass(frozen=True)
class Observation:
    """Cleaned points of one arm and the trunk, to which an arm is fitted."""

    side: str
    reason: str  # why that arm
    roles: dict[str, Any]  # the points of each role
    used: Recording  # these points, cleaned and filled
    points: dict[str, Array]  # positions of the roles that are points [m], shape (n_frames, 3)
    trunk: Array  # rotation of the trunk frame, shape (n_frames, 3, 3)
    frames: NDArray[np.intp]  # the frames in which trunk and arm are fully observed, shape (n,)
    notes: tuple[str, ...]  # on repairs
    quality_warnings: tuple[str, ...]  # on repairs that change the result, except omitted frames

    @property
    def time(self) -> Array:
        """Times of those frames [s]."""
        return self.used.time[self.frames]

    def directions(self, arm: Arm) -> Directions:
        """Return the directions of segments and joint axes in the trunk frame, in those frames."""
        vectors = vectors_of(self.used, self.roles, str(arm.side))
        world = np.stack(list(vectors.values()), axis=1)[self.frames]
        local = np.einsum("nij,nki->nkj", self.trunk[self.frames], world)
        return Directions(arm, tuple(vectors), unit(local))


def observe(recording: Recording, markers: Mapping[str, Any] | None, side: str, smooth: bool) -> Observation:
    """Choose the arm, clean its points and find the frames in which it is fully observed."""
    chosen, reason, roles = find_side(recording, markers, side)
    points_used = points_of(roles)
    whole = unswapped(without_zeros(recording), points_used)
    used = smoothed(without_outliers(whole.select(points_used)).fill_gaps(), smooth)
    notes = list(used.notes[len(recording.notes) :])
    points = {role: role_position(used, names) for role, names in roles.items() if role not in DIRECTIONS}
    hand = points["hand"] - points["wrist"] if "hand" in points and "hand" not in (markers or {}) else None
    if hand is not None and np.nanmedian(np.linalg.norm(hand, axis=-1)) < SHORTEST_SEGMENT:
        notes.append(f"hand: {', '.join(roles['hand'])} coincides with the wrist and was not used")  # end sites may
        del roles["hand"], points["hand"]
    trunk = trunk_rotation(used, roles)
    lost: dict[str, Bools] = {role: np.isnan(position[:, 0]) for role, position in points.items()}
    lost["trunk"] = np.asarray(np.isnan(trunk).any(axis=(1, 2)))
    out = np.any(list(lost.values()), axis=0)
    if out.all():
        worst = ", ".join(f"{role} in {100 * gone.mean():.0f} %" for role, gone in lost.items() if gone.any())
        raise RecordingError(f"no frame of {used.source!r} has all required points; missing are: {worst} of the frames")
    for start, stop in runs_of(out):
        missing = ", ".join(role for role, gone in lost.items() if gone[start:stop].any())
        notes.append(
            f"{stop - start} frames omitted, {used.time[start]:.2f}–{used.time[stop - 1]:.2f} s: {missing} missing"
        )
    frames = np.flatnonzero(~out)
    quality_warnings = used.quality_warnings[len(recording.quality_warnings) :]
    return Observation(chosen, reason, roles, used, points, trunk, frames, tuple(notes), quality_warnings)


def vectors_of(points: Recording | Basis, roles: Mapping[str, Any], side: str) -> dict[str, Array]:
    """Return vectors along segments and joint axes, by the keys of `Directions`, in the axes of the points."""
    ends = {name: pair for name, pair in SEGMENTS.items() if all(end in roles for end in pair)}
    vectors = {name: direction(points, (roles[a], roles[b])) for name, (a, b) in ends.items()}
    return vectors | {name: MARKED[side] * direction(points, roles[name]) for name in AXES if name in roles}


def segment_lengths(points: Mapping[str, Array], source: str) -> dict[str, float]:
    """Return the lengths of recorded segments (median)."""
    lengths = {}
    for name, (start, end) in SEGMENTS.items():
        if start in points and end in points:
            lengths[name] = float(np.nanmedian(np.linalg.norm(points[end] - points[start], axis=-1)))
            if not SHORTEST_SEGMENT < lengths[name] < LONGEST_SEGMENT:
                raise RecordingError(
                    f"the {name} in {source!r} is {lengths[name]:.4g} m long, from {start} to {end}; allowed are "
                    f"{SHORTEST_SEGMENT} to {LONGEST_SEGMENT:g} m: check the unit, and that the points differ"
                )
    return lengths
