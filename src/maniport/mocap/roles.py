"""Roles of points: marker sets, assignment of points, the trunk frame, and the choice of the arm.

Which names of points belong to which role in marker sets is in data/marker_sets.yaml.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from maniport.arms.chain import LEFT, RIGHT, SIDES
from maniport.errors import (
    InvalidInputError,
    RecordingError,
    argument,
    nearest_first,
    spoken,
    unknown_name,
)
from maniport.mocap.recording import Recording
from maniport.mocap.rigid_bodies import with_hidden_points
from maniport.util.defaults import AUTO
from maniport.util.validation import Array, as_choice

Group = tuple[str, ...]  # Names of points that are averaged
Roles = dict[str, Any]  # The group of each role, or the pair of groups
Markers = Mapping[str, Any] | None  # Points that a user assigns to roles

POINTS = ("shoulder", "elbow", "wrist", "hand")  # Roles of a point, or of the mean of several

DIRECTIONS = {  # Roles of a pair of such points, and from which to which
    "elbow_axis": "medial to lateral",
    "wrist_axis": "ulnar to radial",
    "trunk_up": "low to high",
    "trunk_front": "back to front",
    "trunk_left": "right to left",
}
ROLES = (*POINTS, *DIRECTIONS)
ARM = POINTS[:3]  # Roles that make an arm
TRUNK = ("trunk_up", "trunk_front", "trunk_left")

SHORTEST = 1e-4  # Shortest vector that has a direction [m]
END = "EndSite"  # Prefix of the ends of chains in BVH files, before the name of the joint


@cache
def load_names(file: str) -> Any:
    """Read a YAML file of names from the folder ``data``."""
    text = (Path(__file__).parent / "data" / file).read_text(encoding="utf-8")
    return yaml.load(text, Loader=getattr(yaml, "CSafeLoader", yaml.SafeLoader))


MARKER_SETS: dict[str, Mapping[str, Sequence[Any]]] = load_names("marker_sets.yaml")["marker_sets"]
"""For each marker set and role the alternatives; the first whose points are recorded counts.

An alternative has the form of the argument ``markers`` of `fit_arm`, for the right arm: a name or names (their
mean counts); for a direction a pair (from, to) of these. The set with most roles of the arm counts, else the later;
the trunk may come from another one. Case, spaces, ``_``, ``.``, ``-`` and prefixes before a colon (``Nick01:RELB``) are
ignored. `fit_arm` and `read_recording` use the entries that are added.
"""

_OTHER_SIDE = {"right": "left", "Right": "Left", "RIGHT": "LEFT", "r": "l", "R": "L"}
_OTHER_SIDE |= {left: right for right, left in _OTHER_SIDE.items()}
_SIDE_WORD = re.compile("|".join(word for word in _OTHER_SIDE if len(word) > 1))
_SIDE_LETTER = re.compile(r"(?<![A-Za-z])[RrLl](?![a-z0-9])")


def other_side(name: str) -> str:
    """Return the name of the same point on the other side; the same name where it has no side."""
    before, colon, bare = name.rpartition(":")
    if bare.startswith(END):
        return before + colon + END + other_side(bare.removeprefix(END))
    pattern = _SIDE_WORD if _SIDE_WORD.search(bare) else _SIDE_LETTER
    return before + colon + pattern.sub(lambda match: _OTHER_SIDE[match[0]], bare, count=1)


def find_roles(names: Sequence[str], side: str = RIGHT, body: str = "") -> tuple[str, Roles]:
    """Return the marker set of a recording, and the points of each role."""
    bodies = whole_bodies(names, side)
    return _roles_among(bodies.get(body, next(iter(bodies.values()), names)), side)


def whole_bodies(names: Sequence[str], side: str, most: int = 20) -> dict[str, Sequence[str]]:
    """Return the points of each person with a whole arm and a trunk, by prefix; `most` prefixes are tried."""
    bodies: dict[str, Any] = {}
    for name in names:
        bodies.setdefault(name.rpartition(":")[0], []).append(name)
    if len(bodies) == 1:
        return bodies
    needed = {*ARM, "trunk_up"}
    return {
        body: own
        for body, own in list(bodies.items())[:most]
        if needed <= _roles_among(own, side)[1].keys()
    }


def alternatives(marker_set: str, role: str, side: str) -> list[Any]:
    """Return the alternatives of a marker set for a role on one side: groups of names, or pairs of groups."""
    where = f"MARKER_SETS[{marker_set!r}][{role!r}]"
    choices = MARKER_SETS[marker_set].get(role, ())
    if isinstance(choices, str):
        raise InvalidInputError(f"{where} must be a list of alternatives; found {choices!r}")
    mirrored = side == "left" and role not in TRUNK  # the trunk's left is its left for either arm
    return [as_choice_of_names(role, choice, where, mirrored) for choice in choices]


def as_choice_of_names(role: str, choice: Any, where: str, mirrored: bool = False) -> Any:
    """Check the points of a role; return a tuple of names, or for a direction a pair of these."""
    if role in DIRECTIONS:
        if isinstance(choice, str) or not isinstance(choice, Sequence) or len(choice) != 2:
            raise InvalidInputError(
                f"{where} must be a pair of points or of lists (from, to); found {choice!r}"
            )
        return tuple(as_choice_of_names("", group, where, mirrored) for group in choice)
    names = (
        (choice,)
        if isinstance(choice, str)
        else tuple(choice)
        if isinstance(choice, Sequence)
        else ()
    )
    if not names or not all(isinstance(name, str) for name in names):
        raise InvalidInputError(f"{where} must be one name or a list of names; found {choice!r}")
    return tuple(map(other_side, names)) if mirrored else names


def _key(name: str) -> str:
    return re.sub(r"[_ .\-]", "", name.rpartition(":")[2]).lower()


def _roles_among(names: Sequence[str], side: str) -> tuple[str, Roles]:
    by_key = {_key(name): name for name in reversed(names)}

    def recorded(choice: Any) -> Any:
        own = tuple(
            by_key.get(_key(part), "") if isinstance(part, str) else recorded(part)
            for part in choice
        )
        return own if all(own) else ()

    sets: dict[str, dict[str, Any]] = {marker_set: {} for marker_set in reversed(MARKER_SETS)}
    for marker_set in sets:
        for role in MARKER_SETS[marker_set]:
            if role not in ROLES:
                raise unknown_name("role", role, ROLES, f"in MARKER_SETS[{marker_set!r}]")
            if own := next(filter(None, map(recorded, alternatives(marker_set, role, side))), None):
                sets[marker_set][role] = own
    best = max(
        sets,
        key=lambda name: (sum(role in sets[name] for role in ARM), len(sets[name].keys() - TRUNK)),
    )
    roles = {
        role: names
        for roles in reversed(sets.values())
        for role, names in roles.items()
        if role in TRUNK
    }
    roles |= sets[best]
    collarbones = {
        "rightshoulder",
        "leftshoulder",
        "rshoulder",
        "lshoulder",
    }  # shoulders only above an elbow or wrist
    if not roles.keys() & set(ARM[1:]) and collarbones & set(map(_key, roles.get("shoulder", ()))):
        del roles["shoulder"]
        roles.pop("trunk_left", None)
    return best, {role: roles[role] for role in ROLES if role in roles}


def assign_roles(recording: Recording, markers: Markers = None, side: str = RIGHT) -> Roles:
    """Return the points of each role of one arm and the trunk.

    Raises `RecordingError` when roles lack points, or points are those of the other arm by their names or positions.
    """
    marker_set, roles = assigned_roles(recording, markers, side)
    other = SIDES[side == RIGHT]
    own, theirs = (find_roles(recording.observed, name)[1] for name in (side, other))
    if missing := missing_roles(roles):
        usual = {role: usual_names(role, marker_set, side) for role in missing}
        names = nearest_first(" ".join(usual.values()).replace("'", ""), recording.observed)
        listed = ", ".join(map(repr, names[:20])) + (
            f", and {len(names) - 20} more" if len(names) > 20 else ""
        )
        has_other = set(missing) & set(ARM) and set(ARM) <= theirs.keys()
        advice = (
            f" The {other} arm is available: use {argument('side', other)}." if has_other else ""
        )
        raise RecordingError(
            f"missing{f' in {recording.source!r}' if recording.source else ''}: "
            f"{'; '.join(f'{role} (usually {names})' for role, names in usual.items())}.{advice} Points of the "
            f"recording, nearest first: {listed or 'none'}. "
            f"Assign points to roles with {argument('markers', example_markers(missing))}"
        )
    names_of_arm, names_of_other = (
        {name for role in ARM for name in named.get(role, ())} for named in (own, theirs)
    )
    for role in ARM:
        if wrong := [name for name in roles[role] if name in names_of_other - names_of_arm]:
            raise RecordingError(
                f"{role} of the {side} arm: {', '.join(map(repr, wrong))} is a point of the {other} one; "
                f"give {argument('side', other)} or other {argument('markers')}"
            )
    inward = trunk_rotation(recording, roles)[:, :, 1] * (1.0 if side == RIGHT else -1.0)
    middle = [name for group in roles["trunk_up"] for name in group]
    # Largest median displacement toward the other arm [m]. An upper arm of 0.42 m, raised forward and inward as far as
    # possible, brings the elbow 0.27 m inward.
    cases = ("shoulder", "trunk_up", middle, 0.05), ("elbow", "shoulder", roles["shoulder"], 0.3)
    for role, start, group, most in cases:
        displacement = np.sum(direction(recording, (group, roles[role])) * inward, axis=-1)
        if np.isfinite(displacement).any() and (median := float(np.nanmedian(displacement))) > most:
            raise RecordingError(
                f"{role} of the {side} arm: {'+'.join(roles[role])} is {median:.2f} m to the {other} of {start} "
                f"(median); these may be points of the {other} arm ({argument('side', other)}), the ends of trunk_left "
                "or trunk_front may be exchanged, or the axes of the recording may be left-handed"
            )
    return roles


def assigned_roles(
    recording: Recording, markers: Markers = None, side: str = RIGHT
) -> tuple[str, Roles]:
    """Return the marker set of a recording and the points of each role, even if roles are missing."""
    as_choice(side, "side", SIDES)
    if not isinstance(markers, Mapping | None):
        raise InvalidInputError(
            f"{spoken('markers')} must map roles to names of points; found {markers!r}"
        )
    chosen: dict[str, Any] = {}
    for role, choice in (markers or {}).items():
        if role not in ROLES:
            raise unknown_name("role", role, ROLES, "of a point")
        chosen[role] = (
            None if choice is None else as_choice_of_names(role, choice, f"markers[{role!r}]")
        )
    names = points_of({role: choice for role, choice in chosen.items() if choice})
    for name in names:
        recording.point(name)
        if name not in recording.observed:
            raise RecordingError(
                f"markers: point {name!r} is missing in every frame of {recording.source!r}"
            )
    bodies = {name.rpartition(":")[0] for name in names}
    marker_set, roles = find_roles(
        recording.observed, side, bodies.pop() if len(bodies) == 1 else ""
    )
    roles |= chosen
    if "trunk_left" in chosen and "trunk_front" not in chosen:
        roles["trunk_front"] = (
            None  # otherwise a name of the marker set would overrule the user's choice
        )
    return marker_set, {role: roles[role] for role in ROLES if roles.get(role)}


def find_side(
    recording: Recording, markers: Markers = None, side: str = AUTO
) -> tuple[str, str, Roles]:
    """Choose the arm; return it with the reason and its roles."""
    if side != AUTO:
        return side, "selected by the user", assign_roles(recording, markers, side)
    roles, errors = roles_by_side(recording, dict.fromkeys(SIDES, markers))
    if not roles:  # the error of the arm with more of its points
        raise errors[
            max(
                SIDES,
                key=lambda name: sum(
                    role in assigned_roles(recording, side=name)[1] for role in ARM
                ),
            )
        ]
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
    cause = (
        "larger motion" if paths[moving] > similar * paths[other] else "both arms move similarly"
    )
    reason = (
        f"{cause}: wrist path relative to the trunk {paths[moving]:.2f} m, {other} wrist {paths[other]:.2f} m; "
        f"{argument('side', other)} selects the {other} arm"
    )
    return moving, reason, roles[moving]


def roles_by_side(
    recording: Recording, markers: Mapping[str, Any]
) -> tuple[Roles, dict[str, RecordingError]]:
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
    points = recording.select(points_of({role: roles[role] for role in ("trunk_up", second)}))
    if np.isnan(points.positions).any(axis=(1, 2)).all():
        recording = with_hidden_points(points, recording)  # one or another is always hidden
    z = unit(direction(recording, roles["trunk_up"]), SHORTEST)
    across = direction(recording, roles[second])
    across = unit(across - np.sum(across * z, axis=-1, keepdims=True) * z, SHORTEST)
    front = second == "trunk_front"
    rotation = np.stack(
        [across, np.cross(z, across), z] if front else [np.cross(across, z), across, z], axis=-1
    )
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
    groups = [
        group
        for role, choice in roles.items()
        for group in (choice if role in DIRECTIONS else (choice,))
    ]
    return list(dict.fromkeys(name for group in groups for name in group))


def missing_roles(roles: Mapping[str, Any]) -> list[str]:
    """Return the roles without points that an arm fit needs."""
    missing = [role for role in (*ARM, "trunk_up") if not roles.get(role)]
    return (
        missing if roles.get("trunk_front") or roles.get("trunk_left") else [*missing, "trunk_left"]
    )


def example_markers(missing: Iterable[str]) -> dict[str, Any]:
    """Return a template of `markers` for some roles: a list of names, or two from one end to the other."""
    return {
        role: [[end.upper()] for end in DIRECTIONS[role].split(" to ")]
        if role in DIRECTIONS
        else ["NAME"]
        for role in missing
    }


def usual_names(role: str, marker_set: str, side: str) -> str:
    """Return the usual names of a role, those of the recording's own marker set first."""
    sets = dict.fromkeys([marker_set, *reversed(MARKER_SETS)])
    usual = [names for name in sets for names in alternatives(name, role, side)[:1]][:3]
    pairs = usual if role in DIRECTIONS else [(group,) for group in usual]
    return " or ".join(" to ".join("+".join(map(repr, group)) for group in pair) for pair in pairs)
