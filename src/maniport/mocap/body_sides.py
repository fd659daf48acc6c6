"""Sides of a body from its points: which side is which, apart from the names.

A direction from right to left (by the names) and one upward make a direction to the front. The body shows its front,
too: toes, knees, elbows, face and trunk. Where the two are opposite, names of left and right are exchanged, or the axes
are left-handed; points alone do not tell these two apart.

Elbows and knees bend to one side only, but that side turns with the shoulder and the hip. A hanging segment bends
toward the front f. From there, the shortest rotation that brings the segment to its direction u brings f to c(u), about
which the segment rotates by some 90° in either direction at most. The cosine of the angle between c(u) and the
direction in which the joint bends changes its sign, and nothing else, when left and right are exchanged. The exception
are hands behind the back, where the angle reaches 140°; mirrored, they are hands at the chest. Neither counts.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from maniport.arms.chain import LEFT, RIGHT
from maniport.mocap.recording import Bools, Recording
from maniport.mocap.roles import ARM, Group, Roles, find_landmarks, find_roles, role_position, unit
from maniport.util.validation import Array

MOST_FRAMES = 1000  # Frames of a recording that are looked at

LEAST_BEND = np.radians(20.0)
"""A joint that is less flexed shows no side: arms and legs at rest, and markers beside the joint."""

LEAST_FORWARD = 0.3
"""A vector with less of its length along the horizontal plane of the trunk shows no front: toes that point down."""

CONTRADICTION = 0.5
"""Sum of cosines from which sides are told: one clear sign of the body, or several."""

SIDEWARD = 0.7
"""Part of a shank to the side, in its length, from which the knee shows no front: legs that are crossed in sitting."""

AT_THE_TRUNK = (0.2, 0.9)
"""A hand is at the trunk where it is farther inward than the shoulder by the first, and in front of or behind it by
less than the second, in lengths of the upper arm. Such frames do not count."""


@dataclass(frozen=True)
class BodySides:
    """Signs of the body for the sides in the names of its points.

    Parameters
    ----------
    cosines : mapping of str to float
        For each part of the body that shows its front (``"toes"``, ``"knees"``, ``"elbows"``, ``"face"``,
        ``"trunk"``, ``"pelvis"``) the mean cosine of the angle to the front by the names, from -1 to 1.
    """

    cosines: Mapping[str, float]

    @property
    def total(self) -> float:
        """Sum of the cosines; positive where names and body agree."""
        return float(sum(self.cosines.values()))

    @property
    def contradict(self) -> bool:
        """Whether the body contradicts the names."""
        return self.total <= -CONTRADICTION

    @property
    def agree(self) -> bool:
        """Whether the body confirms the names."""
        return self.total >= CONTRADICTION

    def warnings(self) -> list[str]:
        """Return the warning about a contradiction; empty where there is none."""
        if not self.contradict:
            return []
        parts = ", ".join(name for name, value in self.cosines.items() if value < -0.25)
        return [
            f"left and right are exchanged, or one axis is mirrored (left-handed axes): by the names of the points, "
            f"the front of the body is where its back is ({parts}). Exchange left and right in the names, or invert "
            "one axis (positions * [-1, 1, 1]); until then neither arm is that of the person"
        ]


def body_sides(recording: Recording, roles: Roles, side: str) -> BodySides:
    """Compare the sides in the names of points with the body.

    Parameters
    ----------
    recording : Recording
        In any unit of length.
    roles : mapping
        The points of the roles of one arm and the trunk; those of the other arm are found by their names.
    side : {"right", "left"}
        The side of that arm.

    Returns
    -------
    BodySides
        Without signs where the trunk or its sides are not recorded.
    """
    if side == RIGHT:
        other = LEFT
    else:
        other = RIGHT
    body = {name: find_landmarks(recording.observed, name) for name in (RIGHT, LEFT)}
    arms = {side: roles, other: find_roles(recording.observed, other)[1]}
    every = -(-len(recording) // MOST_FRAMES)
    points = _Points(recording, every)
    frame = _named_frame(points, arms)
    if frame is None:
        return BodySides({})

    signs = {
        "toes": _mean([_toes(points, parts, frame) for parts in body.values()]),
        "knees": _mean([_knees(points, parts, frame) for parts in body.values()]),
        "elbows": _mean([_elbows(points, arm, frame, name) for name, arm in arms.items()]),
    }
    middle = body[RIGHT]
    for name, back, front in (
        ("face", "skull", "face"),
        ("trunk", "back", "chest"),
        ("pelvis", "sacrum", "belly"),
    ):
        if back in middle and front in middle and not set(middle[back]) & set(middle[front]):
            vectors = points.mean(middle[front]) - points.mean(middle[back])
            signs[name] = _forward(vectors, frame)
    return BodySides({name: sign for name, sign in signs.items() if np.isfinite(sign)})


@dataclass(frozen=True)
class _Points:
    """Positions in evenly spaced frames of a recording."""

    recording: Recording
    every: int

    def mean(self, names: Group) -> Array:
        """Return the mean of points, shape (n, 3)."""
        return role_position(self.recording, names)[:: self.every]


@dataclass(frozen=True)
class _Frame:
    """Directions of the trunk by the names of its points, each of shape (n, 3)."""

    up: Array
    front: Array


def _named_frame(points: _Points, arms: Mapping[str, Roles]) -> _Frame | None:
    """Return the directions of the trunk, its left from the shoulders; None where they are not recorded."""
    trunk = next((arm for arm in arms.values() if "trunk_up" in arm), None)
    if trunk is None:
        return None
    low, high = map(points.mean, trunk["trunk_up"])
    shoulders = {}
    for side, arm in arms.items():
        if "shoulder" in arm:
            shoulders[side] = points.mean(arm["shoulder"])
    if len(shoulders) == 2:
        left = shoulders[LEFT] - shoulders[RIGHT]
    elif "trunk_left" in trunk:
        start, end = map(points.mean, trunk["trunk_left"])
        left = end - start
    elif shoulders:
        ((side, shoulder),) = shoulders.items()
        if side == LEFT:
            left = shoulder - high
        else:
            left = high - shoulder
    else:
        return None
    up = unit(high - low)
    return _Frame(up, unit(np.cross(left, up)))


def _mean(values: list[float]) -> float:
    finite = [value for value in values if np.isfinite(value)]
    if finite:
        return float(np.mean(finite))
    return float("nan")


def _weighted(cosines: Array, weights: Array) -> float:
    """Return the weighted mean of the cosines; nan where less than 5 % of the frames count."""
    valid = np.isfinite(cosines) & np.isfinite(weights) & (weights > 0)
    if not valid.any() or valid.sum() < 0.05 * len(cosines):
        return float("nan")
    return float(np.average(cosines[valid], weights=weights[valid]))


def _forward(vectors: Array, frame: _Frame) -> float:
    """Return the mean cosine between vectors, without their part along the trunk, and the front."""
    flat = vectors - np.sum(vectors * frame.up, axis=-1, keepdims=True) * frame.up
    share = np.linalg.norm(flat, axis=-1) / np.linalg.norm(vectors, axis=-1)
    cosines = np.sum(unit(flat) * frame.front, axis=-1)
    return _weighted(cosines, np.where(share > LEAST_FORWARD, 1.0, 0.0))


def _bend(
    upper: Array, lower: Array, frame: _Frame, least: float, ignored: Bools | None = None
) -> float:
    """Return the mean cosine between the direction in which a joint bends and its middle c(u), for two segments."""
    along = unit(upper)
    lower = unit(lower)
    bend = lower - np.sum(lower * along, axis=-1, keepdims=True) * along
    sine = np.linalg.norm(bend, axis=-1)

    # The shortest rotation from d to u: R f = f - (d + u) ((d + u) · f) / (1 + d · u) + 2 u (d · f), with d · f = 0.
    down = -frame.up
    cosine = np.sum(down * along, axis=-1)
    middle = down + along
    with np.errstate(divide="ignore", invalid="ignore"):
        factor = np.sum(middle * frame.front, axis=-1) / (1.0 + cosine)
    turned = frame.front - middle * factor[:, None]

    # Above the shoulder the shortest rotation is no longer that of the joint.
    weights = sine * np.maximum(cosine + 0.5, 0.0)
    weights[sine < np.sin(least)] = 0.0
    if ignored is not None:
        weights[ignored] = 0.0
    return _weighted(np.sum(unit(bend) * turned, axis=-1), weights)


def _elbows(points: _Points, arm: Roles, frame: _Frame, side: str) -> float:
    if not set(ARM) <= arm.keys():
        return float("nan")
    shoulder = points.mean(arm["shoulder"])
    elbow = points.mean(arm["elbow"])
    wrist = points.mean(arm["wrist"])
    left = np.cross(frame.up, frame.front)
    if side == RIGHT:
        inward = left
    else:
        inward = -left
    reach = (wrist - shoulder) / np.linalg.norm(elbow - shoulder, axis=-1, keepdims=True)
    inside, farthest = AT_THE_TRUNK
    at_the_trunk = np.abs(np.sum(reach * frame.front, axis=-1)) < farthest
    at_the_trunk &= np.sum(reach * inward, axis=-1) > inside
    return _bend(elbow - shoulder, wrist - elbow, frame, LEAST_BEND, at_the_trunk)


def _knees(points: _Points, parts: Mapping[str, Group], frame: _Frame) -> float:
    if not {"hip", "knee", "ankle"} <= parts.keys():
        return float("nan")
    hip = points.mean(parts["hip"])
    knee = points.mean(parts["knee"])
    ankle = points.mean(parts["ankle"])
    left = np.cross(frame.up, frame.front)
    is_sideward = np.abs(np.sum(unit(ankle - knee) * left, axis=-1)) > SIDEWARD
    return -_bend(knee - hip, ankle - knee, frame, LEAST_BEND, is_sideward)


def _toes(points: _Points, parts: Mapping[str, Group], frame: _Frame) -> float:
    """Return the cosine of the foot, which points to the front of the shank as an elbow does."""
    behind = parts.get("heel") or parts.get("ankle")
    toe = parts.get("toe")
    if behind is None or toe is None or behind == toe:
        return float("nan")
    foot = points.mean(toe) - points.mean(behind)
    if {"knee", "ankle"} <= parts.keys():
        shank = points.mean(parts["ankle"]) - points.mean(parts["knee"])
        return _bend(shank, foot, frame, np.arcsin(LEAST_FORWARD))
    return _forward(foot, frame)
