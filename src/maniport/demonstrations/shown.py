"""What a recording shows of a person, repaired: who plays which role, where, and in which frames all of it is seen."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from maniport.bodies import Arm
from maniport.demonstrations.dialects import DIRECTIONS
from maniport.demonstrations.directions import AXES, MARKED, SEGMENTS, Directions
from maniport.demonstrations.jitter import smoothed
from maniport.demonstrations.recording import Recording, runs_of
from maniport.demonstrations.repair import repaired
from maniport.demonstrations.roles import Basis, direction, role_position, trunk_rotation
from maniport.demonstrations.segments import SHORTEST_SEGMENT
from maniport.demonstrations.sides import find_side
from maniport.errors import RecordingError
from maniport.validation import Array

Bools = NDArray[np.bool_]


@dataclass(frozen=True)
class Shown:
    """What an arm is fitted to.

    Attributes
    ----------
    side, reason : str
        Which arm, and why that one.
    roles : dict
        Which points play which part.
    used : Recording
        These points, repaired and filled.
    points : dict of str to ndarray, shape (n_frames, 3)
        Positions of the roles that are points [m].
    trunk : ndarray, shape (n_frames, 3, 3)
        The trunk frame.
    frames : ndarray, shape (n,)
        The frames in which trunk and arm are all seen.
    notes, doubts : tuple of str
        What was done, and what of it changes the outcome, but for frames that are left out.
    """

    side: str
    reason: str
    roles: dict[str, Any]
    used: Recording
    points: dict[str, Array]
    trunk: Array
    frames: NDArray[np.intp]
    notes: tuple[str, ...]
    doubts: tuple[str, ...]

    @property
    def time(self) -> Array:
        """Times of those frames [s]."""
        return self.used.time[self.frames]

    def directions(self, arm: Arm) -> Directions:
        """Unit vectors of segments and joint axes in the trunk frame, in those frames, for an arm to take."""
        vectors = vectors_of(self.used, self.roles, str(arm.side))
        world = np.stack(list(vectors.values()), axis=1)[self.frames]
        local = np.einsum("nij,nki->nkj", self.trunk[self.frames], world)
        return Directions(arm, tuple(vectors), unit(local))


def vectors_of(points: Recording | Basis, roles: Mapping[str, Any], side: str) -> dict[str, Array]:
    """What goes along segments and joint axes, by the keys of `Directions`, in the axes of the points."""
    ends = {name: pair for name, pair in SEGMENTS.items() if all(end in roles for end in pair)}
    vectors = {name: direction(points, (roles[a], roles[b])) for name, (a, b) in ends.items()}
    return vectors | {name: MARKED[side] * direction(points, roles[name]) for name in AXES if name in roles}


def unit(vectors: Array) -> Array:
    """Scale vectors (..., 3) to length one; nan where they have none."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(vectors / np.where(length > 0, length, np.nan))


def shown_by(
    recording: Recording, markers: Mapping[str, Any] | None, side: str, fill: float, cutoff: float | None
) -> Shown:
    """Find what a recording shows of one arm and the trunk, its faults mended."""
    chosen, reason, roles = find_side(recording, markers, side)
    used = smoothed(repaired(recording, points_of(roles), roles).fill_gaps(fill), cutoff)
    notes = list(used.notes[len(recording.notes) :])
    points = {role: role_position(used, names) for role, names in roles.items() if role not in DIRECTIONS}
    if "hand" not in (markers or {}):
        _drop_hand_on_wrist(roles, points, notes)
    trunk = trunk_rotation(used, roles)
    frames = _complete_frames(used, points, trunk, notes)
    doubts = used.doubts[len(recording.doubts) :]
    return Shown(chosen, reason, roles, used, points, trunk, frames, tuple(notes), doubts)


def points_of(roles: Mapping[str, Any]) -> list[str]:
    """All points that play a role, each once."""
    groups = [group for role, names in roles.items() for group in (names if role in DIRECTIONS else (names,))]
    return list(dict.fromkeys(name for group in groups for name in group))


def _drop_hand_on_wrist(roles: dict[str, Any], points: dict[str, Array], notes: list[str]) -> None:
    """Do without a hand point that coincides with the wrist, as end sites of skeletons often do."""
    if "hand" in points and np.nanmedian(np.linalg.norm(points["hand"] - points["wrist"], axis=-1)) < SHORTEST_SEGMENT:
        notes.append(f"hand: {', '.join(roles['hand'])} coincides with the wrist and was not used")
        del roles["hand"], points["hand"]


def _complete_frames(used: Recording, points: dict[str, Array], trunk: Array, notes: list[str]) -> NDArray[np.intp]:
    """The frames in which trunk and arm are all seen; says in `notes` which are left out, and for want of what."""
    lost: dict[str, Bools] = {role: np.isnan(position[:, 0]) for role, position in points.items()}
    lost["trunk"] = np.asarray(np.isnan(trunk).any(axis=(1, 2)))
    out = np.any(list(lost.values()), axis=0)
    if out.all():
        worst = ", ".join(f"{role} in {gone.mean():.0%}" for role, gone in lost.items() if gone.any())
        raise RecordingError(
            f"no frame of {used.source!r} shows all that is needed; missing are: {worst} of the frames"
        )
    for start, stop in runs_of(out):
        missing = ", ".join(role for role, gone in lost.items() if gone[start:stop].any())
        notes.append(
            f"{stop - start} frames left out, {used.time[start]:.2f}–{used.time[stop - 1]:.2f} s: {missing} missing"
        )
    return np.flatnonzero(~out)
