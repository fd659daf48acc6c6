"""Observation of one arm: cleaned points, and directions of segments and joint axes, to which an arm is fitted.

Only directions are compared, never positions: the position of the shoulder in the trunk is not measured, and the
recorded segment lengths change with the skin. The residual of a segment is ``u(q) - u``, a difference of unit vectors;
its length is the angle between them [rad] as long as that is small.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from maniport.arms import Arm
from maniport.arms.human import JOINTS, LONGEST_SEGMENT
from maniport.arms.kernels import place_points
from maniport.arms.kinematics import PointKinematics, axis_of
from maniport.errors import InvalidInputError, RecordingError
from maniport.mocap.cleaning import smoothed, unswapped, without_outliers, without_zeros
from maniport.mocap.marker_sets import DIRECTIONS
from maniport.mocap.path_solver import BLOCK, parts_of
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
from maniport.util.jit import kernel, part
from maniport.util.validation import Array

SEGMENTS = {"upper arm": ("shoulder", "elbow"), "forearm": ("elbow", "wrist"), "hand": ("wrist", "hand")}
"""Frames of the arm between which each segment runs; the roles of the recording have the same names."""

SHORTEST_SEGMENT = 0.005  # Lower bound of the length of an arm segment [m]

ELBOW = JOINTS.index("elbow_flexion")
TURN = JOINTS.index("pro_sup")
DEVIATION = JOINTS.index("deviation")
FLEXION = JOINTS.index("flexion")

AXES = {"elbow_axis": ELBOW, "wrist_axis": FLEXION}  # The joint with the axis of each pair of markers

AROUND = {"elbow_axis": "upper arm", "wrist_axis": "forearm"}
"""The segment that rotates about its own axis with each pair of markers."""

MARKED = {"right": 1.0, "left": -1.0}
"""Sign of the axes of elbow (medial to lateral) and wrist (ulnar to radial); a left arm is a mirror image."""

WEIGHTS = {"upper arm": 1.0, "forearm": 1.0, "hand": 0.2, "elbow_axis": 0.1, "wrist_axis": 0.1}
"""Weights of the residuals, inverse to the expected error of each direction.

A hand is measured over a fifth of a forearm's length. Markers of a joint are near its axis, not on it. Both
decide what upper arm and forearm leave open, and do not pull those two aside when the hand exceeds the model's limits.
"""


def require_human(arm: Arm) -> None:
    """Raise `InvalidInputError` unless an arm has the joints of a human arm, in their order, and its frames."""
    if arm.joint_names != JOINTS:
        raise InvalidInputError(
            f"fit_arm needs a person with the joints {', '.join(JOINTS)}, in this order; found of {arm.name!r}: "
            f"{', '.join(arm.joint_names)}"
        )
    missing = {frame for ends in SEGMENTS.values() for frame in ends} - set(arm.frames)
    if missing:
        raise InvalidInputError(
            f"fit_arm needs a person with the frames shoulder, elbow, wrist and hand; {arm.name!r} has no "
            f"{', '.join(sorted(missing))}"
        )


@dataclass(frozen=True)
class Directions:
    """Directions in the trunk frame, and the arm that shall have them."""

    arm: Arm
    names: tuple[str, ...]  # keys of `SEGMENTS`, then of `AXES`
    targets: Array  # unit vectors, shape (n, len(names), 3); nan where missing

    def take(self, frames: NDArray[np.intp] | slice) -> "Directions":
        """Keep some frames, in any order and repeated or not."""
        return Directions(self.arm, self.names, self.targets[frames])

    def model(self, q: Array) -> tuple[Array, Array]:
        """Return the directions of the arm, shape (n, k, 3), and their derivatives, shape (n, k, 3, dof)."""
        kinematics, (start, end) = self._kinematics[0], self._kinematics[1].T
        points, slopes = kinematics(q)
        vector, slope = points[:, end] - points[:, start], slopes[:, end] - slopes[:, start]
        length = np.linalg.norm(vector, axis=-1)[..., None]
        value = vector / length
        slope = (slope - value[..., None] * (value[..., None, :] @ slope)) / length[..., None]
        axes = slice(len(self._kinematics[2]), None)
        return np.concatenate([value, points[:, axes]], axis=1), np.concatenate([slope, slopes[:, axes]], axis=1)

    @cached_property
    def _kinematics(self) -> tuple[PointKinematics, NDArray[np.int64], list[str]]:
        """Return frames at the ends of segments, then joint axes fixed to the segment above them.

        The indices (n_segments, 2) are those of both ends of each segment among the frames.
        """
        segments = [SEGMENTS[name] for name in self.names if name in SEGMENTS]
        frames = list(dict.fromkeys(frame for ends in segments for frame in ends))
        joints = [AXES[name] for name in self.names if name in AXES]
        axes = [axis_of(self.arm.chain, joint, TURN + 1 if joint == FLEXION else joint) for joint in joints]
        indices = np.array([[frames.index(end) for end in ends] for ends in segments], dtype=np.int64)
        return PointKinematics(self.arm.chain, frames, axes), indices, frames

    def arrays(self) -> tuple[tuple[Any, ...], Array]:
        """Return the arguments of `frame_terms` from `offset` to `ends`, and the weights."""
        kinematics, ends, _ = self._kinematics
        return (*kinematics.arrays(), ends), np.array([WEIGHTS[name] for name in self.names])

    def residual(self, q: Array) -> tuple[Array, Array]:
        """Return weighted residuals (n, 3k) and derivatives (n, 3k, dof); zero where targets are missing."""
        values, slopes = self.model(q)
        weight = np.array([WEIGHTS[name] for name in self.names]) * ~np.isnan(self.targets[..., 0])
        difference = (values - np.nan_to_num(self.targets)) * weight[..., None]
        slopes = slopes * weight[..., None, None]
        return difference.reshape(len(q), -1), slopes.reshape(len(q), -1, self.arm.dof)

    def errors(self, q: Array) -> tuple[dict[str, Array], dict[str, Array]]:
        """Return the errors of the directions of joint angles (n, dof), by segment, each (n,) [rad].

        Angles between the arm's segments and the recorded ones, and rotations of segments about their own axis that
        bring joint axes to their markers.
        """
        values = np.concatenate([self.model(q[part])[0] for part in parts_of(len(q), BLOCK)])
        half = np.linalg.norm(values - self.targets, axis=-1) / 2  # arccos is inaccurate below 1e-8
        angles, twists = 2 * np.arcsin(np.minimum(half, 1.0)), {}
        for axis, segment in AROUND.items():
            if axis in self.names:
                i, along = self.names.index(axis), values[:, self.names.index(segment)]
                model, target = (
                    vectors - np.sum(vectors * along, axis=1)[:, None] * along
                    for vectors in (values[:, i], self.targets[:, i])
                )
                sine, cosine = np.sum(np.cross(model, target) * along, axis=1), np.sum(model * target, axis=1)
                twists[segment] = np.arctan2(sine, cosine)
        return {name: angles[:, i] for i, name in enumerate(self.names) if name in SEGMENTS}, twists


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
    smoothed: bool  # whether points were noisy and are smoothed

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
    repaired = without_outliers(whole.select(points_used)).fill_gaps()
    used = smoothed(repaired, smooth)
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
    is_smoothed = used.positions is not repaired.positions and smooth
    return Observation(chosen, reason, roles, used, points, trunk, frames, tuple(notes), quality_warnings, is_smoothed)


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


@kernel
def frame_terms(  # type: ignore[no-untyped-def]
    q, offset, placements, axes, slides, coupling, joints, vectors, points, ends, targets, weights, gradient, hessian
):
    """Add Jᵀr and JᵀJ of the residuals of one frame, for the live view, to gradient and hessian; return |r|²."""
    positions, values, slopes = offset.copy(), np.empty((len(joints), 3)), np.empty((len(joints), 3, len(q)))
    for j in range(len(offset)):
        for k in range(len(q)):
            positions[j] += coupling[j, k] * q[k]
    place_points(positions, placements, axes, slides, coupling, joints, vectors, points, values, slopes)
    return add_residuals(values, slopes, points, ends, targets, weights, gradient, hessian)


@part
def add_residuals(values, slopes, points, ends, targets, weights, gradient, hessian):  # type: ignore[no-untyped-def]
    """Add the terms for points (the first of the values) and directions with their derivatives."""
    dof = len(gradient)
    cost, slope = 0.0, np.empty((3, dof))
    for n in range(len(targets)):
        if weights[n] == 0.0:
            continue
        if n < len(ends):
            a, b = ends[n]
            unit = values[b] - values[a]
            length = np.sqrt(unit[0] * unit[0] + unit[1] * unit[1] + unit[2] * unit[2])
            unit /= length
            for k in range(dof):
                stretch = 0.0
                for i in range(3):
                    slope[i, k] = slopes[b, i, k] - slopes[a, i, k]
                    stretch += unit[i] * slope[i, k]
                for i in range(3):
                    slope[i, k] = (slope[i, k] - unit[i] * stretch) / length
        else:
            unit = values[points + n - len(ends)]
            slope[:] = slopes[points + n - len(ends)]
        square = weights[n] * weights[n]
        for i in range(3):
            off = unit[i] - targets[n, i]
            cost += square * off * off
            for k in range(dof):
                gradient[k] += square * off * slope[i, k]
                for m in range(dof):
                    hessian[k, m] += square * slope[i, k] * slope[i, m]
    return cost
