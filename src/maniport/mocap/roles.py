"""Assignment of points to roles of an arm, the trunk frame, and the choice of the arm."""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from maniport.arms.chain import LEFT, RIGHT, SIDES
from maniport.errors import InvalidInputError, RecordingError, argument, nearest_first, spoken, unknown_name
from maniport.mocap.marker_sets import (
    ARM,
    DIRECTIONS,
    MARKER_SETS,
    ROLES,
    Group,
    alternatives,
    as_choice_of_names,
    find_roles,
)
from maniport.mocap.recording import Recording
from maniport.util.defaults import AUTO
from maniport.util.validation import Array, as_choice

SHORTEST = 1e-4  # Shortest vector that has a direction [m]


def assign_roles(recording: Recording, markers: Mapping[str, Any] | None = None, side: str = "right") -> dict[str, Any]:
    """Return the points that are assigned to each role of one arm and the trunk.

    Raises
    ------
    RecordingError
        When a role that an arm needs has no points, or the points of the arm are those of the other side, by their
        names or by their positions.
    """
    marker_set, roles = assigned_roles(recording, markers, side)
    other = SIDES[side == RIGHT]
    own, theirs = (find_roles(recording.observed, name)[1] for name in (side, other))
    if missing := missing_roles(roles):
        usual = {role: usual_names(role, marker_set, side) for role in missing}
        needed = "; ".join(f"{role} (usually {names})" for role, names in usual.items())
        names = nearest_first(" ".join(usual.values()).replace("'", ""), recording.observed)
        listed = ", ".join(map(repr, names[:20])) + (f", and {len(names) - 20} more" if len(names) > 20 else "")
        advice = f" The {other} arm is available: use {argument('side', other)}."
        raise RecordingError(
            f"missing{f' in {recording.source!r}' if recording.source else ''}: {needed}."
            f"{advice if set(missing) & set(ARM) and set(ARM) <= theirs.keys() else ''} "
            f"Points of the recording, nearest first: {listed or 'none'}. "
            f"Assign points to roles with {argument('markers', example_markers(missing))}"
        )
    of_other = {name for role in ARM for name in theirs.get(role, ())} - {
        name for role in ARM for name in own.get(role, ())
    }
    for role in ARM:
        if wrong := [name for name in roles[role] if name in of_other]:
            raise RecordingError(
                f"{role} of the {side} arm: {', '.join(map(repr, wrong))} is a point of the {other} one; "
                f"give {argument('side', other)} or other {argument('markers')}"
            )
    inward = trunk_rotation(recording, roles)[:, :, 1] * (1.0 if side == RIGHT else -1.0)
    middle = [name for group in roles["trunk_up"] for name in group]
    # Largest median displacement toward the other arm [m]. An upper arm of 0.42 m, raised forward and inward as far as
    # possible, brings the elbow 0.27 m inward.
    for role, start, names, most in (
        ("shoulder", "trunk_up", middle, 0.05),
        ("elbow", "shoulder", roles["shoulder"], 0.3),
    ):
        displacement = np.sum(direction(recording, (names, roles[role])) * inward, axis=-1)
        if np.isfinite(displacement).any() and (median := float(np.nanmedian(displacement))) > most:
            raise RecordingError(
                f"{role} of the {side} arm: {'+'.join(roles[role])} is {median:.2f} m to the {other} of {start} "
                f"(median); these may be points of the {other} arm ({argument('side', other)}), the ends of trunk_left "
                "or trunk_front may be exchanged, or the axes of the recording may be left-handed"
            )
    return roles


def assigned_roles(
    recording: Recording, markers: Mapping[str, Any] | None = None, side: str = "right"
) -> tuple[str, dict[str, Any]]:
    """Return the marker set of a recording and the points of each role, even if roles are missing."""
    as_choice(side, "side", SIDES)
    if not isinstance(markers, Mapping | None):
        raise InvalidInputError(f"{spoken('markers')} must map roles to names of points; found {markers!r}")
    chosen: dict[str, Any] = {}
    for role, choice in (markers or {}).items():
        if role not in ROLES:
            raise unknown_name("role", role, ROLES, "of a point")
        chosen[role] = None if choice is None else as_choice_of_names(role, choice, f"markers[{role!r}]")
    names = points_of({role: choice for role, choice in chosen.items() if choice})
    for name in names:
        recording.point(name)
        if name not in recording.observed:
            raise RecordingError(f"markers: point {name!r} is missing in every frame of {recording.source!r}")
    bodies = {name.rpartition(":")[0] for name in names}
    marker_set, roles = find_roles(recording.observed, side, bodies.pop() if len(bodies) == 1 else None)
    roles |= chosen
    if "trunk_left" in chosen and "trunk_front" not in chosen:
        roles["trunk_front"] = None  # otherwise a name of the marker set would overrule the user's choice
    return marker_set, {role: roles[role] for role in ROLES if roles.get(role)}


def find_side(
    recording: Recording, markers: Mapping[str, Any] | None = None, side: str = AUTO
) -> tuple[str, str, dict[str, Any]]:
    """Choose the arm; return it with the reason and its roles."""
    if side != AUTO:
        return side, "selected by the user", assign_roles(recording, markers, side)
    roles, errors = roles_by_side(recording, dict.fromkeys(SIDES, markers))
    if not roles:  # the error of the arm with more of its points
        raise errors[max(SIDES, key=lambda name: sum(role in assigned_roles(recording, side=name)[1] for role in ARM))]
    if errors:
        ((only, own),) = roles.items()
        return only, "the only one that is fully recorded", own
    if all(roles[RIGHT][role] == roles[LEFT][role] for role in ARM):
        reason = f"the names of the points have no side; {argument('side', LEFT)} takes them for a left arm"
        return RIGHT, reason, roles[RIGHT]
    paths = {}  # lengths of the wrists' paths relative to the trunk [m]; missing frames count as the mean
    for name, own in roles.items():
        wrist = direction(recording, (own["trunk_up"][0], own["wrist"]))
        local = np.sum(trunk_rotation(recording, own) * wrist[:, :, None], axis=1)
        steps = np.linalg.norm(np.diff(local, axis=0), axis=-1)
        paths[name] = float(np.nanmean(steps) * len(steps)) if np.isfinite(steps).any() else 0.0
    similar = 1.1  # ratio of paths up to which the right arm is taken
    moving, other = (LEFT, RIGHT) if paths[LEFT] > similar * paths[RIGHT] else (RIGHT, LEFT)
    cause = "larger motion" if paths[moving] > similar * paths[other] else "both arms move similarly"
    reason = (
        f"{cause}: wrist path relative to the trunk {paths[moving]:.2f} m, {other} wrist {paths[other]:.2f} m; "
        f"{argument('side', other)} selects the {other} arm"
    )
    return moving, reason, roles[moving]


def roles_by_side(
    recording: Recording, markers: Mapping[str, Any]
) -> tuple[dict[str, dict[str, Any]], dict[str, RecordingError]]:
    """Return the roles of each arm with its markers, and the errors of the arms that are not recorded."""
    roles, errors = {}, {}
    for side in SIDES:
        try:
            roles[side] = assign_roles(recording, markers.get(side), side)
        except RecordingError as error:
            errors[side] = error
    return roles, errors


def role_position(recording: Recording, names: Group) -> Array:
    """Return the mean of the named points [m], shape (n_frames, 3); nan where one of them is missing."""
    return np.asarray(np.mean([recording.point(name) for name in names], axis=0))


def direction(recording: Recording, pair: Any) -> Array:
    """Return the vector from one group of points to another [m]."""
    return role_position(recording, pair[1]) - role_position(recording, pair[0])


def trunk_rotation(recording: Recording, roles: dict[str, Any]) -> Array:
    """Return the rotation from the trunk frame to the axes of the recording, in every frame."""
    second = across_role(roles)
    z = unit(direction(recording, roles["trunk_up"]), SHORTEST)
    across = direction(recording, roles[second])
    across = unit(across - np.sum(across * z, axis=-1, keepdims=True) * z, SHORTEST)
    front = second == "trunk_front"
    rotation = np.stack([across, np.cross(z, across), z] if front else [np.cross(across, z), across, z], axis=-1)
    if np.isnan(rotation).any(axis=(1, 2)).all():
        raise RecordingError(
            f"no trunk frame in {recording.source!r}: in no frame are the points of trunk_up {roles['trunk_up']} and "
            f"{second} {roles[second]} all present, distinct and not collinear"
        )
    return rotation


def across_role(roles: Mapping[str, Any]) -> str:
    """Return the role of the trunk's second direction."""
    return "trunk_front" if "trunk_front" in roles else "trunk_left"


def unit(vectors: Array, shortest: float = 0.0) -> Array:
    """Scale vectors (..., 3) to length one; nan where they are no longer than `shortest`."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(vectors / np.where(length > shortest, length, np.nan))


def points_of(roles: Mapping[str, Any]) -> list[str]:
    """Return all points that are assigned to a role, without repetition."""
    groups = [group for role, choice in roles.items() for group in (choice if role in DIRECTIONS else (choice,))]
    return list(dict.fromkeys(name for group in groups for name in group))


def missing_roles(roles: Mapping[str, Any]) -> list[str]:
    """Return the roles without points that an arm fit needs."""
    missing = [role for role in (*ARM, "trunk_up") if not roles.get(role)]
    return missing if roles.get("trunk_front") or roles.get("trunk_left") else [*missing, "trunk_left"]


def example_markers(missing: Iterable[str]) -> dict[str, Any]:
    """Return a template of `markers` for some roles: a list of names, or two from one end to the other."""
    return {
        role: [[end.upper()] for end in DIRECTIONS[role].split(" to ")] if role in DIRECTIONS else ["NAME"]
        for role in missing
    }


def usual_names(role: str, marker_set: str, side: str) -> str:
    """Return the usual names of a role, those of the recording's own marker set first."""
    sets = dict.fromkeys([marker_set, *reversed(MARKER_SETS)])
    usual = [names for name in sets for names in alternatives(name, role, side)[:1]][:3]
    pairs = usual if role in DIRECTIONS else [(group,) for group in usual]
    return " or ".join(" to ".join("+".join(map(repr, group)) for group in pair) for pair in pairs)
