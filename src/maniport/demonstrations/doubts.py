"""Where the points of a recording contradict what was said of it: its unit, its axis up, which arm it is."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from maniport.bodies.chain import SIDES
from maniport.demonstrations.conventions import POSSIBLE_UPPER_ARM, UNITS, UPPER_ARM, fitting_units, upper_arm
from maniport.demonstrations.dialects import ARM, find_legs, find_roles, whole_bodies
from maniport.demonstrations.recording import UP_AXES, Recording
from maniport.errors import InvalidInputError, RecordingError, argument
from maniport.validation import Array

LEAST_UPRIGHT = 0.5
"""Cosine between trunk or legs and the axis that points up, below which (median) that axis is doubted: of people who
stand, sit, climb, hang or crawl the one or the other is nearer to upright than 60°."""

INWARD = {"shoulder": ("trunk_up", 0.05), "elbow": ("shoulder", 0.3)}
"""From where, and how far towards the other arm [m], a point of an arm is never in the middle of a motion (median).
An upper arm of 0.42 m, raised forward and inward as far as it can be, brings the elbow 0.27 m inward."""


def require_believable(recording: Recording, unit: str | None, up: str | None) -> Recording:
    """Compare what the user said of a file with its points."""
    found = _doubts_of_bodies(recording)
    found += [] if unit is None else _doubts_of_unit(recording, unit)
    found += [] if up is None else _doubts_of_up(recording, up)
    return replace(recording, doubts=(*recording.doubts, *found)) if found else recording


def _doubts_of_bodies(recording: Recording) -> list[str]:
    for side in SIDES:
        first, *others = whole_bodies(recording.seen, side) or ("",)
        if others:
            shoulder = find_roles(recording.seen, side, others[0])[1]["shoulder"]
            return [
                f"the points are those of several bodies: {', '.join((first, *others))}; the first that has a whole "
                f"arm is taken, unless you give a point of another: {argument('markers', {'shoulder': list(shoulder)})}"
            ]
    return []


def _doubts_of_unit(recording: Recording, unit: str) -> list[str]:
    arm = upper_arm({name: recording.point(name) for name in recording.seen})
    if arm is None or UPPER_ARM[0] <= arm[1] <= UPPER_ARM[1]:
        return []
    name, length = arm
    own = length / UNITS[unit]
    better = "".join(f"; {argument('unit', one)} makes it {own * UNITS[one]:.3g} m" for one in fitting_units(own)[:1])
    possible = POSSIBLE_UPPER_ARM[0] <= length <= POSSIBLE_UPPER_ARM[1]
    low, high = UPPER_ARM if possible else POSSIBLE_UPPER_ARM
    text = (
        f"{argument('unit', unit)} makes the upper arm ({name}) {length:.3g} m long; "
        f"those of {'most ' if possible else ''}people have {low} to {high} m{better}"
    )
    if not possible:
        raise InvalidInputError(f"{recording.source}: {text}")
    return [text]


def _doubts_of_up(recording: Recording, up: str) -> list[str]:
    pair = find_roles(recording.seen)[1].get("trunk_up")
    if pair is None:
        return []
    trunk = _upright(_middle(recording, pair[1]) - _middle(recording, pair[0]))
    legs = (_upright(recording.point(high) - recording.point(low)) for low, high in find_legs(recording.seen))
    if not trunk or trunk[up] >= LEAST_UPRIGHT or any(leg.get(up, 0.0) >= LEAST_UPRIGHT for leg in legs):
        return []
    likely = max(trunk, key=trunk.__getitem__)
    off, less = (f"{np.degrees(np.arccos(np.clip(trunk[axis], -1.0, 1.0))):.0f}°" for axis in (up, likely))
    return [
        f"{argument('up', up)} lets the trunk ({'+'.join(pair[0])} to {'+'.join(pair[1])}) stand {off} off upright "
        f"(median); {argument('up', likely)} lets it stand {less} off"
    ]


def _upright(step: Array) -> dict[str, float]:
    """Cosine (median) between a part of the body and each axis; nothing where it is not seen."""
    along = step[np.linalg.norm(step, axis=-1) > 0]  # without frames in which it is missing
    along = along / np.linalg.norm(along, axis=-1, keepdims=True)
    return {axis: float(np.median(_along(along, axis))) for axis in UP_AXES} if len(along) else {}


def require_side(recording: Recording, roles: Mapping[str, Any], trunk: Array, side: str) -> None:
    """Raise unless the points of an arm are those of its side, by the names that are known and by where they are."""
    other = SIDES[side == "right"]
    own, theirs = (
        {name for role in ARM for name in find_roles(recording.seen, one)[1].get(role, ())} for one in (side, other)
    )
    for role in ARM:
        strange = [name for name in roles[role] if name in theirs - own]
        if strange:
            raise RecordingError(
                f"{role} of the {side} arm: {', '.join(map(repr, strange))} is a point of the {other} one; "
                f"give {argument('side', other)} or other {argument('markers')}"
            )
    inward = trunk[:, :, 1] if side == "right" else -trunk[:, :, 1]
    for role, (start, most) in INWARD.items():
        beside = np.sum((_middle(recording, roles[role]) - _middle(recording, roles[start])) * inward, axis=-1)
        if np.isfinite(beside).any() and (far := float(np.nanmedian(beside))) > most:
            raise RecordingError(
                f"{role} of the {side} arm: {'+'.join(roles[role])} is {far:.2f} m to the {other} of {start} (median); "
                f"these may be points of the {other} arm ({argument('side', other)}), the ends of trunk_left or "
                "trunk_front may be exchanged, or the axes of the recording be left-handed"
            )


def _middle(recording: Recording, names: Any) -> Array:
    """Mean of points, or of both ends of a direction."""
    every = [one for name in names for one in ((name,) if isinstance(name, str) else name)]
    return np.asarray(np.mean([recording.point(name) for name in every], axis=0))


def _along(direction: Array, axis: str) -> Array:
    return np.asarray((-1.0 if axis[0] == "-" else 1.0) * direction[:, "xyz".index(axis[-1])])
