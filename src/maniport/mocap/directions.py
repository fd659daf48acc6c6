"""Directions of segments and joint axes, to which an arm is fitted: of a recording, and of a synthetic one.

Only directions are compared, never positions: the position of the shoulder in the trunk is not measured, and the
recorded segment lengths change with the skin. The residual of a segment is ``u(q) - u``, a difference of unit vectors;
its length is the angle between them [rad] as long as that is small.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maniport.arms import Arm
from maniport.arms.chain import RIGHT
from maniport.arms.human import JOINTS, LONGEST_SEGMENT, middle_of
from maniport.arms.kinematics import PointKinematics, axis_of
from maniport.errors import InvalidInputError, RecordingError, counted
from maniport.mocap.cleaning import smoothed, unswapped, without_outliers, without_zeros
from maniport.mocap.recording import Bools, Recording, runs_of
from maniport.mocap.rigid_bodies import with_hidden_points
from maniport.mocap.roles import (
    POINTS,
    Markers,
    Roles,
    direction,
    find_side,
    points_of,
    role_position,
    segments_of,
    trunk_rotation,
    unit,
)
from maniport.util.validation import Array, as_finite, as_times, require_shape

SEGMENTS = {
    "upper arm": ("shoulder", "elbow"),
    "forearm": ("elbow", "wrist"),
    "hand": ("wrist", "hand"),
}
"""Frames of the arm between which each segment runs; the roles of the recording have the same names."""

SHORTEST_SEGMENT = 0.005  # Lower bound of the length of an arm segment [m]
BLOCK = 4096  # The most frames that are computed at once
ELBOW, TURN, DEVIATION, FLEXION = map(
    JOINTS.index, ("elbow_flexion", "pro_sup", "deviation", "flexion")
)

AXES = {"elbow_axis": (ELBOW, "upper arm"), "wrist_axis": (FLEXION, "forearm")}
"""The joint with the axis of each pair of markers, and the segment that rotates about its own axis with them."""

MARKED = {"right": 1.0, "left": -1.0}
"""Sign of the axes of elbow (medial to lateral) and wrist (ulnar to radial); a left arm is a mirror image."""

WEIGHTS = {"upper arm": 1.0, "forearm": 1.0, "hand": 0.2, "elbow_axis": 0.1, "wrist_axis": 0.1}
"""Weights of the residuals, inverse to the expected error of each direction.

A hand is measured over a fifth of a forearm's length. Markers of a joint are near its axis, not on it. Both
decide what upper arm and forearm leave open, and do not pull those two aside when the hand exceeds the model's limits.
"""

HALF_WIDTH = 0.03  # Distance of the markers of elbow and wrist from the center of the joint [m]

TRUNK = {
    "trunk_low": (0.0, 0.0, -0.3),
    "trunk_high": (0.0, 0.0, 0.1),
    "trunk_back": (-0.1, 0.0, 0.0),
    "trunk_front": (0.1, 0.0, 0.0),
}
"""Points of a trunk at rest [m], from the middle of the neck."""


def require_human(arm: Arm) -> None:
    """Raise `InvalidInputError` unless an arm has the joints of a human arm, in their order, and its frames."""
    missing = sorted(set(POINTS) - set(arm.frames))
    if arm.joint_names != JOINTS or missing:
        raise InvalidInputError(
            f"a human arm needs the joints {', '.join(JOINTS)}, in this order, and the frames {', '.join(POINTS)}; "
            f"{arm.name!r} has the joints {', '.join(arm.joint_names)}, without the frames {missing}"
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

    @cached_property
    def kinematics(self) -> PointKinematics:
        """The ends of the segments, then joint axes fixed to the segment above them."""
        joints = [AXES[name][0] for name in self.names if name in AXES]
        axes = []
        for joint in joints:
            axes.append(axis_of(self.arm.chain, joint, TURN + 1 if joint == FLEXION else joint))
        return PointKinematics(self.arm.chain, POINTS[: len(self.names) - len(axes) + 1], axes)

    @property
    def weights(self) -> Array:
        """Weights of the directions, shape (len(names),)."""
        return np.array([WEIGHTS[name] for name in self.names])

    def model(self, q: Array) -> tuple[Array, Array]:
        """Return the directions of the arm, shape (n, k, 3), and their derivatives, shape (n, k, 3, dof)."""
        count = sum(name in SEGMENTS for name in self.names)
        points, changes = self.kinematics(q)
        vectors = np.diff(points[:, : count + 1], axis=1)
        slopes = np.diff(changes[:, : count + 1], axis=1)
        length = np.linalg.norm(vectors, axis=-1)[..., None]
        values = vectors / length
        slopes = (slopes - values[..., None] * (values[..., None, :] @ slopes)) / length[..., None]
        values = np.concatenate([values, points[:, count + 1 :]], 1)
        slopes = np.concatenate([slopes, changes[:, count + 1 :]], 1)
        return values, slopes

    def residual(self, q: Array) -> tuple[Array, Array]:
        """Return weighted residuals (n, 3k) and derivatives (n, 3k, dof); zero where targets are missing."""
        values, slopes = self.model(q)
        weight = (self.weights * ~np.isnan(self.targets[..., 0]))[..., None]
        difference = (values - np.nan_to_num(self.targets)) * weight
        return difference.reshape(len(q), -1), (slopes * weight[..., None]).reshape(
            len(q), -1, self.arm.dof
        )

    def errors(self, q: Array) -> dict[str, Array]:
        """Return the errors of joint angles (n, dof), each (n,) [rad].

        Angles between the arm's segments and the recorded ones, and rotations of segments about their own axis that
        bring joint axes to their markers.
        """
        values = np.concatenate(
            [self.model(part)[0] for part in np.array_split(q, -(-len(q) // BLOCK))]
        )
        errors = {}
        for i, name in enumerate(self.names):
            model = values[:, i]
            target = self.targets[:, i]
            if name in SEGMENTS:  # arccos is inaccurate below 1e-8
                errors[name] = 2 * np.arcsin(
                    np.minimum(np.linalg.norm(model - target, axis=-1) / 2, 1.0)
                )
            else:
                along = values[:, self.names.index(AXES[name][1])]
                model, target = (
                    part - np.sum(part * along, axis=1)[:, None] * along for part in (model, target)
                )
                sine = np.sum(np.cross(model, target) * along, axis=1)
                cosine = np.sum(model * target, axis=1)
                errors[f"{AXES[name][1]} about its axis"] = np.arctan2(sine, cosine)
        return errors


@dataclass(frozen=True)
class Observation:
    """Cleaned points of one arm and the trunk, to which an arm is fitted."""

    side: str
    reason: str  # why that arm
    roles: Roles
    used: (
        Recording  # these points, cleaned and filled, with notes and quality warnings on that only
    )
    trunk: Array  # rotation of the trunk frame, shape (n_frames, 3, 3)
    frames: NDArray[np.intp]  # the frames in which trunk and arm are fully observed, shape (n,)
    smoothed: bool  # whether points were noisy and are smoothed

    def directions(self, arm: Arm) -> Directions:
        """Return the directions of segments and joint axes in the trunk frame, in those frames."""
        vectors = vectors_of(self.used, self.roles, str(arm.side))
        world = np.stack(list(vectors.values()), axis=1)[self.frames]
        return Directions(
            arm, tuple(vectors), unit(np.einsum("nij,nki->nkj", self.trunk[self.frames], world))
        )


def observe(recording: Recording, markers: Markers, side: str, smooth: bool) -> Observation:
    """Choose the arm, clean its points and find the frames in which it is fully observed."""
    chosen, reason, roles = find_side(recording, markers, side)
    names = points_of(roles)
    whole = unswapped(without_zeros(replace(recording, notes=(), quality_warnings=())), names)
    filled = without_outliers(whole.select(names)).fill_gaps()
    repaired = with_hidden_points(filled, whole, segments_of(roles))
    used = smoothed(repaired, smooth)
    notes = list(used.notes)
    # ends of chains may coincide with the wrist
    if "hand" in roles and "hand" not in (markers or {}):
        length = np.linalg.norm(direction(used, (roles["wrist"], roles["hand"])), axis=-1)
        if np.nanmedian(length) < SHORTEST_SEGMENT:
            notes.append(
                f"hand: {', '.join(roles.pop('hand'))} coincides with the wrist and was not used"
            )
    trunk = trunk_rotation(used, roles)
    lost: dict[str, Bools] = {}
    for role in POINTS:
        if role in roles:
            lost[role] = np.isnan(role_position(used, roles[role])[:, 0])
    lost["trunk"] = np.asarray(np.isnan(trunk).any(axis=(1, 2)))
    out = np.any(list(lost.values()), axis=0)
    if out.all():
        shares = []
        for role, gone in lost.items():
            if gone.any():
                shares.append(f"{role} in {100 * gone.mean():.0f} %")
        raise RecordingError(
            f"no frame of {used.source!r} has all required points; missing are: {', '.join(shares)} "
            "of the frames"
        )
    for start, stop in runs_of(out):
        missing = ", ".join(role for role, gone in lost.items() if gone[start:stop].any())
        times = f"{used.time[start]:.2f}–{used.time[stop - 1]:.2f} s"
        notes.append(f"{counted(stop - start, 'frame')} omitted, {times}: {missing} missing")
    is_smoothed = smooth and used is not repaired
    used = replace(used, notes=tuple(notes))
    return Observation(chosen, reason, roles, used, trunk, np.flatnonzero(~out), is_smoothed)


def vectors_of(points: Recording, roles: Roles, side: str) -> dict[str, Array]:
    """Return vectors along segments and joint axes, by the keys of `Directions`, in the axes of the points."""
    ends = {}
    for name, pair in SEGMENTS.items():
        if all(end in roles for end in pair):
            ends[name] = pair
    vectors = {name: direction(points, (roles[a], roles[b])) for name, (a, b) in ends.items()}
    return vectors | {
        name: MARKED[side] * direction(points, roles[name]) for name in AXES if name in roles
    }


def segment_lengths(used: Recording, roles: Roles) -> dict[str, float]:
    """Return the lengths of recorded segments (median)."""
    lengths = {}
    for name, (start, end) in SEGMENTS.items():
        if start in roles and end in roles:
            vectors = direction(used, (roles[start], roles[end]))
            lengths[name] = float(np.nanmedian(np.linalg.norm(vectors, axis=-1)))
            if not SHORTEST_SEGMENT < lengths[name] < LONGEST_SEGMENT:
                raise RecordingError(
                    f"the {name} in {used.source!r} is {lengths[name]:.4g} m long, from {start} to {end}; allowed are "
                    f"{SHORTEST_SEGMENT} to {LONGEST_SEGMENT:g} m: check the unit, and that the points differ"
                )
    return lengths


def synthetic_recording(
    arm: Arm, joint_angles: ArrayLike, time: ArrayLike, source: str = "synthetic"
) -> Recording:
    """Record points named after their roles on a moving human arm, in the trunk frame; `fit_arm` inverts this.

    Parameters
    ----------
    arm : Arm
        A human arm, right or left.
    joint_angles : array_like, shape (n, 7)
        [rad].
    time : array_like, shape (n,)
        Increasing [s].
    source : str
        Name of the recording.

    Raises
    ------
    InvalidInputError
        When the arm is not a human one, or shapes do not agree.
    """
    require_human(arm)
    times = as_times(time)
    q = as_finite(joint_angles, "joint_angles")
    require_shape(q, "joint_angles", (len(times), arm.dof), ", as many as times")
    points: dict[str, Array] = dict(
        zip(POINTS, np.moveaxis(arm.point_positions(q, POINTS), 1, 0), strict=True)
    )
    straight = q.copy()
    # markers of the wrist are on the forearm: deviation does not move them
    straight[:, TURN + 1 : FLEXION] = 0.0
    for joints, index, middle, low, high in (
        (q, ELBOW, "elbow", "elbow_medial", "elbow_lateral"),
        (straight, FLEXION, "wrist", "wrist_ulnar", "wrist_radial"),
    ):
        axis = (
            MARKED[arm.side or RIGHT]
            * HALF_WIDTH
            * arm.axis_direction(joints, arm.joint_names[index])
        )
        points[low] = points[middle] - axis
        points[high] = points[middle] + axis
    neck = np.array([0.0, middle_of(arm), 0.0])
    for name, point in TRUNK.items():
        points[name] = np.tile(neck + point, (len(q), 1))
    return Recording(tuple(points), np.stack(list(points.values()), axis=1), times, source)
