"""Which points of a recording play which part, by known names or the user's own; and the trunk frame they span.

A role is played by the mean of one or more points, or, for a direction, by two such groups (from, to).
"""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from maniport.bodies.chain import SIDES
from maniport.demonstrations.dialects import (
    ARM,
    DIALECTS,
    DIRECTIONS,
    ROLES,
    Group,
    as_choice_of_names,
    body_of,
    find_roles,
    ways,
)
from maniport.demonstrations.doubts import require_side
from maniport.demonstrations.recording import Recording
from maniport.errors import InvalidInputError, RecordingError, argument, nearest_first, spoken, unknown_name
from maniport.validation import Array, as_choice

REQUIRED = (*ARM, "trunk_up")
NEXT, LAST = [1, 2, 0], [2, 0, 1]
"""Axes one and two after x, y, z."""
SHORTEST = 1e-4
"""What is no longer has no direction [m]."""


def assign_roles(recording: Recording, markers: Mapping[str, Any] | None = None, side: str = "right") -> dict[str, Any]:
    """Find the points that play each role of one arm and the trunk."""
    family, roles = played(recording, markers, side)
    _require(roles, recording, family, side)
    require_side(recording, roles, trunk_rotation(recording, roles), side)
    return roles


def played(
    recording: Recording, markers: Mapping[str, Any] | None = None, side: str = "right"
) -> tuple[str, dict[str, Any]]:
    """The family of names that a recording has most of, and who plays which role, whether that is enough or not."""
    as_choice(side, "side", SIDES)
    chosen: dict[str, Any] = {}
    if not isinstance(markers, Mapping | None):
        raise InvalidInputError(f"{spoken('markers')} must map roles to names of points; found {markers!r}")
    for role, choice in (markers or {}).items():
        if role not in ROLES:
            raise unknown_name("role", role, ROLES, "of a point")
        chosen[role] = None if choice is None else _own_choice(role, choice, recording)
    bodies = {body_of(name) for role, choice in chosen.items() if choice for name in _names(role, choice)}
    family, found = find_roles(recording.seen, side, bodies.pop() if len(bodies) == 1 else None)
    found |= chosen
    if markers and "trunk_left" in markers and "trunk_front" not in markers:
        found["trunk_front"] = None  # otherwise the user's choice would be overruled by a name that happens to fit
    return family, {role: found[role] for role in ROLES if found.get(role)}


class Basis:
    """Stands for a recording whose points are unknowns: what is linear in them comes out as its coefficients."""

    def __init__(self, names: tuple[str, ...]):
        self._rows = dict(zip(names, np.eye(len(names)), strict=True))

    def point(self, name: str) -> Array:
        """One for the point, zero for all others."""
        return self._rows[name]


def role_position(recording: "Recording | Basis", names: Group) -> Array:
    """Mean of the named points [m], shape (n_frames, 3); nan where one of them is missing."""
    return np.asarray(np.mean([recording.point(name) for name in names], axis=0))


def trunk_rotation(recording: Recording, roles: dict[str, Any]) -> Array:
    """Rotation from the trunk frame to the axes of the recording, in every frame."""
    second = across_role(roles)
    up, across = direction(recording, roles["trunk_up"]), direction(recording, roles[second])
    rotation = trunk_axes(up, across, second == "trunk_front")
    if np.isnan(rotation).any(axis=(1, 2)).all():
        raise RecordingError(
            f"no trunk frame in {recording.source!r}: in no frame are the points of trunk_up {roles['trunk_up']} and "
            f"{second} {roles[second]} all seen, apart from each other and not in one line"
        )
    return rotation


def across_role(roles: Mapping[str, Any]) -> str:
    """The role that shows the trunk's second direction."""
    return "trunk_front" if "trunk_front" in roles else "trunk_left"


def trunk_axes(up: Array, across: Array, forward: bool) -> Array:
    """Rotations (..., 3, 3) whose z is `up`, and x where `forward`, else y, what `across` has beside it, (..., 3)."""
    up = _unit(up)
    second = _unit(across - np.sum(across * up, axis=-1, keepdims=True) * up)
    columns = (second, _cross(up, second), up) if forward else (_cross(second, up), second, up)
    return np.stack(columns, axis=-1)


def _cross(a: Array, b: Array) -> Array:
    """Cross products of vectors (..., 3), as `numpy.cross` gives them, in a fifth of the time for a single one."""
    return np.asarray(a[..., NEXT] * b[..., LAST] - a[..., LAST] * b[..., NEXT])


def direction(recording: "Recording | Basis", pair: Any) -> Array:
    """The way from one group of points to another [m]."""
    return role_position(recording, pair[1]) - role_position(recording, pair[0])


def _unit(vector: Array) -> Array:
    """Scale to length one; nan where the length is no more than `SHORTEST`."""
    length = np.linalg.norm(vector, axis=-1, keepdims=True)
    return np.asarray(vector / np.where(length > SHORTEST, length, np.nan))


def _own_choice(role: str, choice: Any, recording: Recording) -> Any:
    """Check what the user chose for one role."""
    own = as_choice_of_names(role, choice, f"markers[{role!r}]")
    for name in _names(role, own):
        recording.point(name)
        if name not in recording.seen:
            raise RecordingError(f"markers[{role!r}]: point {name!r} is missing in every frame of {recording.source!r}")
    return own


def _names(role: str, choice: Any) -> Group:
    """All points that play a role."""
    return (*choice[0], *choice[1]) if role in DIRECTIONS else choice


def lacking(roles: Mapping[str, Any]) -> list[str]:
    """The roles that nobody plays and without which no arm can be fitted."""
    missing = [role for role in REQUIRED if not roles.get(role)]
    return missing if roles.get("trunk_front") or roles.get("trunk_left") else [*missing, "trunk_left"]


def example_markers(missing: Iterable[str]) -> dict[str, Any]:
    """What `markers` looks like for some roles, to be filled in: a list of names, or two from one end to the other."""
    return {
        role: [[end.upper()] for end in DIRECTIONS[role].split(" to ")] if role in DIRECTIONS else ["NAME"]
        for role in missing
    }


def _require(found: Mapping[str, Any], recording: Recording, family: str, side: str) -> None:
    """Raise unless every required role is played."""
    missing = lacking(found)
    if not missing:
        return
    where = f" in {recording.source!r}" if recording.source else ""
    usual = {role: usual_names(role, family, side) for role in missing}
    wanted = "; ".join(f"{role} (usually {names})" for role, names in usual.items())
    names = nearest_first(" ".join(usual.values()).replace("'", ""), recording.seen)
    shown = ", ".join(map(repr, names[:20])) + (f", and {len(names) - 20} more" if len(names) > 20 else "")
    other = SIDES[side == "right"]
    there = set(missing) & set(ARM) and set(ARM) <= find_roles(recording.seen, other)[1].keys()
    hint = f" There is a {other} arm: {argument('side', other)} takes it." if there else ""
    raise RecordingError(
        f"missing{where}: {wanted}.{hint} Points there are, nearest first: {shown or 'none'}. "
        f"Say which points play a role with {argument('markers', example_markers(missing))}"
    )


def usual_names(role: str, family: str, side: str) -> str:
    """The names under which a role is usually found, those of the recording's own family first."""
    families = [family, *reversed(DIALECTS)]
    usual = [way for one in dict.fromkeys(families) for way in ways(one, role, side)[:1]]
    if role in DIRECTIONS:
        return " or ".join(f"{'+'.join(map(repr, a))} to {'+'.join(map(repr, b))}" for a, b in usual[:3])
    return " or ".join("+".join(map(repr, group)) for group in usual[:3])
