"""Roles of points: marker sets, assignment of points, the trunk frame, and the choice of the arm.

Which names of points belong to which role in marker sets is in data/marker_sets.yaml.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from maniport.arms.chain import LEFT, RIGHT, SIDES
from maniport.errors import (
    InvalidInputError,
    RecordingError,
    argument,
    spoken,
    unknown_name,
)
from maniport.mocap.candidates import candidates
from maniport.mocap.point_names import END as END
from maniport.mocap.point_names import (
    keys_without_additions,
    names_by_key,
    names_by_person,
    person_of,
    spellings,
)
from maniport.mocap.point_names import load_names as load_names
from maniport.mocap.point_names import other_side as other_side
from maniport.mocap.recording import Recording
from maniport.mocap.rigid_bodies import with_hidden_points
from maniport.util.defaults import AUTO
from maniport.util.validation import Array, as_choice

Group = tuple[str, ...]  # Names of points that are averaged
Choice = Group | tuple[Group, ...]  # Points of a role: a group, of a direction two groups
Roles = dict[str, Any]  # The group of each role, or the pair of groups
Markers = Mapping[str, Any] | None  # Points that a user assigns to roles, which are checked

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
SEGMENT_ROLES = ((*TRUNK, "shoulder"), ("elbow", "elbow_axis"), ("wrist", "wrist_axis", "hand"))
"""Roles of points that move nearly as one body; the wrist turns against the elbow where the forearm twists."""
COLLARBONES = ("RightShoulder", "LeftShoulder")
"""Points that are the joint in some skeletons, and the clavicle in others."""

SHORTEST = 1e-4  # Shortest vector that has a direction [m]
_NAMES = load_names("marker_sets.yaml")
LANDMARKS: Mapping[str, Sequence[object]] = _NAMES["landmarks"]
MARKER_SETS: dict[str, Mapping[str, Sequence[object]]] = _NAMES["marker_sets"]
"""For each marker set and role the alternatives; the first whose points are recorded counts.

An alternative has the form of the argument ``markers`` of `fit_arm`, for the right arm: a name or names (their
mean counts); for a direction a pair (from, to) of these. The set with most roles of the arm counts, else the later;
the trunk may come from another one. Case, spaces, ``_``, ``.``, ``-``, prefixes before a colon (``Nick01:RELB``) and
what most names of a recording share are ignored, and the side may be written otherwise (``RightHand``, ``hand_r``).
`fit_arm` and `read_recording` use the entries that are added.
"""


def find_roles(names: Sequence[str], side: str = RIGHT, body: str = "") -> tuple[str, Roles]:
    """Return the marker set of a recording, and the points of each role."""
    bodies = whole_bodies(names, side)
    return _roles_among(bodies.get(body, next(iter(bodies.values()), names)), side)


def whole_bodies(names: Sequence[str], side: str, most: int = 20) -> dict[str, Sequence[str]]:
    """Return the points of each person with a whole arm and a trunk; `most` persons are tried."""
    bodies: dict[str, Sequence[str]] = dict(names_by_person(tuple(names)))
    if len(bodies) == 1:
        return bodies
    needed = {*ARM, "trunk_up"}
    whole = {}
    for body, points in list(bodies.items())[:most]:
        if needed <= _roles_among(points, side)[1].keys():
            whole[body] = points
    return whole


def alternatives(marker_set: str, role: str, side: str) -> list[Choice]:
    """Return the alternatives of a marker set for a role on one side: groups of names, or pairs of groups."""
    where = f"MARKER_SETS[{marker_set!r}][{role!r}]"
    choices = MARKER_SETS[marker_set].get(role, ())
    if isinstance(choices, str):
        raise InvalidInputError(f"{where} must be a list of alternatives; found {choices!r}")
    mirrored = side == "left" and role not in TRUNK  # the trunk's left is its left for either arm
    return [as_choice_of_names(role, choice, where, mirrored) for choice in choices]


def as_choice_of_names(role: str, choice: object, where: str, mirrored: bool = False) -> Choice:
    """Check the points of a role; return a tuple of names, or for a direction a pair of these."""
    if role not in DIRECTIONS:
        return _as_group(choice, where, mirrored)
    if isinstance(choice, str) or not isinstance(choice, Sequence) or len(choice) != 2:
        raise InvalidInputError(
            f"{where} must be a pair of points or of lists (from, to); found {choice!r}"
        )
    return _as_group(choice[0], where, mirrored), _as_group(choice[1], where, mirrored)


def _as_group(choice: object, where: str, mirrored: bool) -> Group:
    """Check one name or a list of names; `mirrored` returns those of the other side."""
    names: tuple[object, ...] = ()
    if isinstance(choice, str):
        names = (choice,)
    elif isinstance(choice, Sequence):
        names = tuple(choice)
    group = tuple(name for name in names if isinstance(name, str))
    if not names or len(group) < len(names):
        raise InvalidInputError(f"{where} must be one name or a list of names; found {choice!r}")
    if mirrored:
        return tuple(map(other_side, group))
    return group


def find_landmarks(names: Sequence[str], side: str = RIGHT, body: str = "") -> dict[str, Group]:
    """Return the points of the recorded parts of the body, those of `LANDMARKS`, of one side or of the middle."""
    bodies = whole_bodies(names, side)
    points = bodies.get(body, next(iter(bodies.values()), names))
    return _landmarks(_keys_of_best(points, side), side)


def _landmarks(by_key: Mapping[str, str], side: str) -> dict[str, Group]:
    found = {}
    for part, choices in LANDMARKS.items():
        for choice in choices:
            names = _as_group(choice, f"landmarks[{part!r}]", side == LEFT)
            recorded = _recorded_group(names, by_key)
            if recorded:
                found[part] = recorded
                break
    return found


def _recorded_group(names: Iterable[str], by_key: Mapping[str, str]) -> Group:
    """Return names as they are recorded; empty where one of them is not recorded."""
    recorded = []
    for name in names:
        key = next((key for key in spellings(name) if key in by_key), None)
        if key is None or not by_key[key]:
            return ()
        recorded.append(by_key[key])
    return tuple(recorded)


def _recorded(choice: Choice, by_key: Mapping[str, str]) -> Choice:
    """Return the recorded names of an alternative; empty where one of them is not recorded."""
    groups = []
    for group in groups_of(choice):
        recorded = _recorded_group(group, by_key)
        if not recorded:
            return ()
        groups.append(recorded)
    if isinstance(choice[0], str):
        return groups[0]
    return tuple(groups)


def _roles_among(names: Sequence[str], side: str) -> tuple[str, Roles]:
    return _roles_by_key(_keys_of_best(names, side), side)


def _keys_of_best(names: Sequence[str], side: str) -> Mapping[str, str]:
    """Return the names by key, without what a program added to them where more of an arm is recognized so."""
    best: Mapping[str, str] = names_by_key(names, names)
    most = len(_roles_by_key(best, side)[1].keys() & set(ARM))
    if most == len(ARM):
        return best
    for by_key in keys_without_additions(tuple(names)):
        count = len(_roles_by_key(by_key, side)[1].keys() & set(ARM))
        if count > most:
            best = by_key
            most = count
    return best


def _roles_by_key(by_key: Mapping[str, str], side: str) -> tuple[str, Roles]:
    """Return the marker set with most roles of the arm, and the points of each role."""
    sets: dict[str, Roles] = {}
    for marker_set in reversed(MARKER_SETS):
        sets[marker_set] = {}
        for role in MARKER_SETS[marker_set]:
            if role not in ROLES:
                raise unknown_name("role", role, ROLES, f"in MARKER_SETS[{marker_set!r}]")
            recorded = _first_recorded(marker_set, role, side, by_key)
            if recorded:
                sets[marker_set][role] = recorded

    def recognized(name: str) -> tuple[int, int]:
        return len(sets[name].keys() & set(ARM)), len(sets[name].keys() - TRUNK)

    best = max(sets, key=recognized)
    roles: Roles = {}
    for marker_set in reversed(sets):
        for role in TRUNK:
            if role in sets[marker_set]:
                roles[role] = sets[marker_set][role]
    shoulders = _both_shoulders(best, by_key)
    if shoulders:
        roles["trunk_left"] = shoulders
    roles |= sets[best]
    if _is_collarbone(roles, by_key):
        del roles["shoulder"]
        roles.pop("trunk_left", None)
        shoulders = ()
    _complete_trunk(roles, shoulders, by_key)
    return best, {role: roles[role] for role in ROLES if role in roles}


def _is_collarbone(roles: Roles, by_key: Mapping[str, str]) -> bool:
    """Whether the point of the shoulder may be the clavicle, as in many skeletons.

    It is the joint only where an elbow or a wrist is recorded with it.
    """
    if roles.keys() & set(ARM[1:]):
        return False
    collarbones = set[str | None]()
    for name in COLLARBONES:
        collarbones.update(map(by_key.get, spellings(name)))
    return not collarbones.isdisjoint(roles.get("shoulder", ()))


def _first_recorded(marker_set: str, role: str, side: str, by_key: Mapping[str, str]) -> Choice:
    """Return the first alternative of a marker set whose points are recorded; empty where there is none."""
    for choice in alternatives(marker_set, role, side):
        recorded = _recorded(choice, by_key)
        if recorded:
            return recorded
    return ()


def _both_shoulders(marker_set: str, by_key: Mapping[str, str]) -> tuple[Group, ...]:
    """Return the right shoulder and the left one of a marker set; empty where one of them is not recorded."""
    right = _first_recorded(marker_set, "shoulder", RIGHT, by_key)
    left = _first_recorded(marker_set, "shoulder", LEFT, by_key)
    if right and left and right != left:
        return (*groups_of(right), *groups_of(left))
    return ()


def _complete_trunk(roles: Roles, shoulders: tuple[Group, ...], by_key: Mapping[str, str]) -> None:
    """Add directions of the trunk that the marker sets lack, from any parts of pelvis, shoulders and neck."""
    parts = _landmarks(by_key, RIGHT)
    if "trunk_up" not in roles and "low" in parts:
        high = tuple(name for group in shoulders for name in group) or parts.get("high", ())
        if high and not set(high) & set(parts["low"]):
            roles["trunk_up"] = (parts["low"], high)
    if "trunk_left" not in roles and "hip" in parts:
        left = _landmarks(by_key, LEFT).get("hip", ())
        if left and left != parts["hip"]:
            roles["trunk_left"] = (parts["hip"], left)


def assign_roles(recording: Recording, markers: Markers = None, side: str = RIGHT) -> Roles:
    """Return the points of each role of one arm and the trunk.

    Raises `RecordingError` when roles lack points, or points are those of the other arm by their names or positions.
    """
    marker_set, roles = assigned_roles(recording, markers, side)
    other = SIDES[side == RIGHT]
    roles_of_other = find_roles(recording.observed, other)[1]
    missing = missing_roles(roles)
    if missing:
        where = ""
        if recording.source:
            where = f" in {recording.source!r}"
        advice = ""
        if set(missing) & set(ARM) and set(ARM) <= roles_of_other.keys():
            advice = f" The {other} arm is available: use {argument('side', other)}."
        text = missing_text(recording, missing, roles, marker_set, side)
        raise RecordingError(f"missing{where}: {text}{advice}")
    names_of_arm = _points_of_arm(find_roles(recording.observed, side)[1])
    only_of_other = _points_of_arm(roles_of_other) - names_of_arm
    for role in ARM:
        wrong = [name for name in roles[role] if name in only_of_other]
        if wrong:
            raise RecordingError(
                f"{role} of the {side} arm: {', '.join(map(repr, wrong))} is a point of the {other} one; "
                f"give {argument('side', other)} or other {argument('markers')}"
            )
    fault = _wrong_side(recording, roles, side)
    if fault and not _names_contradict_body(recording, side):
        raise RecordingError(fault)
    return roles


def _points_of_arm(roles: Roles) -> set[str]:
    """Return the points of shoulder, elbow and wrist."""
    names = set[str]()
    for role in ARM:
        names.update(roles.get(role, ()))
    return names


def _wrong_side(recording: Recording, roles: Roles, side: str) -> str:
    """Describe which point of an arm is on the other side of the trunk; empty where none is."""
    inward = trunk_rotation(recording, roles)[:, :, 1] * (1.0 if side == RIGHT else -1.0)
    if side == RIGHT:
        other = LEFT
    else:
        other = RIGHT
    low, high = roles["trunk_up"]
    middle = (*low, *high)
    # Largest median displacement toward the other arm [m]. An upper arm of 0.42 m, raised forward and inward as far as
    # possible, brings the elbow 0.27 m inward.
    cases = ("shoulder", "trunk_up", middle, 0.05), ("elbow", "shoulder", roles["shoulder"], 0.3)
    for role, start, group, most in cases:
        displacement = np.sum(direction(recording, (group, roles[role])) * inward, axis=-1)
        if not np.isfinite(displacement).any():
            continue
        median = float(np.nanmedian(displacement))
        if median > most:
            return (
                f"{role} of the {side} arm: {'+'.join(roles[role])} is {median:.2f} m to the {other} of {start} "
                f"(median): these are points of the {other} arm ({argument('side', other)}), or the ends of "
                "trunk_left or trunk_front are exchanged, or one axis is mirrored (left-handed axes): invert it "
                "(positions * [-1, 1, 1])"
            )
    return ""


def _names_contradict_body(recording: Recording, side: str) -> bool:
    """Whether left and right are exchanged by the names of the points alone, of which the fit of an arm warns."""
    from maniport.mocap.body_sides import body_sides  # which needs the roles

    named = find_roles(recording.observed, side)[1]
    return body_sides(recording, named, side).contradict


def assigned_roles(
    recording: Recording, markers: Markers = None, side: str = RIGHT
) -> tuple[str, Roles]:
    """Return the marker set of a recording and the points of each role, even if roles are missing."""
    as_choice(side, "side", SIDES)
    if not isinstance(markers, Mapping | None):
        raise InvalidInputError(
            f"{spoken('markers')} must map roles to names of points; found {markers!r}"
        )
    chosen: Roles = {}
    for role, choice in (markers or {}).items():
        if role not in ROLES:
            raise unknown_name("role", role, ROLES, "of a point")
        if choice is None:
            chosen[role] = None
        else:
            chosen[role] = as_choice_of_names(role, choice, f"markers[{role!r}]")
    body = _body_of(points_of(chosen), recording)
    marker_set, roles = find_roles(recording.observed, side, body)
    roles |= chosen
    if "trunk_left" in chosen and "trunk_front" not in chosen:
        # otherwise a name of the marker set would overrule the user's choice
        roles["trunk_front"] = None
    return marker_set, {role: roles[role] for role in ROLES if roles.get(role)}


def _body_of(names: Iterable[str], recording: Recording) -> str:
    """Return the person to whom all points that a user assigns belong; empty where there are several or none."""
    bodies = set()
    for name in names:
        recording.point(name)
        if name not in recording.observed:
            raise RecordingError(
                f"markers: point {name!r} is missing in every frame of {recording.source!r}"
            )
        bodies.add(person_of(name, recording.observed))
    if len(bodies) == 1:
        return bodies.pop()
    return ""


def find_side(
    recording: Recording, markers: Markers = None, side: str = AUTO
) -> tuple[str, str, Roles]:
    """Choose the arm; return it with the reason and its roles."""
    if side != AUTO:
        return side, "selected by the user", assign_roles(recording, markers, side)
    roles, errors = roles_by_side(recording, dict.fromkeys(SIDES, markers))
    if not roles:
        right = assigned_roles(recording, side=RIGHT)[1].keys() & set(ARM)
        left = assigned_roles(recording, side=LEFT)[1].keys() & set(ARM)
        raise errors[LEFT if len(left) > len(right) else RIGHT]
    if errors:
        ((only, roles_of_arm),) = roles.items()
        return only, "the only one that is fully recorded", roles_of_arm
    if all(roles[RIGHT][role] == roles[LEFT][role] for role in ARM):
        reason = f"the names of the points have no side; {argument('side', LEFT)} takes them for a left arm"
        return RIGHT, reason, roles[RIGHT]
    paths = {name: _wrist_path(recording, roles[name]) for name in roles}
    similar = 1.1  # ratio of paths up to which the right arm is taken
    if paths[LEFT] > similar * paths[RIGHT]:
        moving = LEFT
        other = RIGHT
    else:
        moving = RIGHT
        other = LEFT
    if paths[moving] > similar * paths[other]:
        cause = "larger motion"
    else:
        cause = "both arms move similarly"
    reason = (
        f"{cause}: wrist path relative to the trunk {paths[moving]:.2f} m, {other} wrist {paths[other]:.2f} m; "
        f"{argument('side', other)} selects the {other} arm"
    )
    return moving, reason, roles[moving]


def _wrist_path(recording: Recording, roles: Roles) -> float:
    """Return the length of the wrist's path relative to the trunk [m]; steps in missing frames count as the mean."""
    low, _ = roles["trunk_up"]
    wrist = direction(recording, (low, roles["wrist"]))
    local = np.sum(trunk_rotation(recording, roles) * wrist[:, :, None], axis=1)
    steps = np.linalg.norm(np.diff(local, axis=0), axis=-1)
    if not np.isfinite(steps).any():
        return 0.0
    return float(np.nanmean(steps) * len(steps))


def roles_by_side(
    recording: Recording, markers: Mapping[str, Markers]
) -> tuple[Roles, dict[str, RecordingError]]:
    """Return the roles of each arm with its markers, and the errors of the arms that are not recorded."""
    roles = {}
    errors = {}
    for side in SIDES:
        try:
            roles[side] = assign_roles(recording, markers.get(side), side)
        except RecordingError as error:
            errors[side] = error
    return roles, errors


def role_position(recording: Recording, names: Group) -> Array:
    """Return the mean of the named points [m], shape (n_frames, 3); nan where one of them is missing."""
    return np.asarray(np.mean([recording.point(name) for name in names], axis=0))


def direction(recording: Recording, pair: Sequence[Group]) -> Array:
    """Return the vector from one group of points to another [m]."""
    return role_position(recording, pair[1]) - role_position(recording, pair[0])


def trunk_rotation(recording: Recording, roles: Roles) -> Array:
    """Return the rotation from the trunk frame to the axes of the recording, in every frame."""
    second = across_role(roles)
    points = recording.select(points_of({role: roles[role] for role in ("trunk_up", second)}))
    if np.isnan(points.positions).any(axis=(1, 2)).all():
        # one or another is always hidden
        recording = with_hidden_points(points, recording, segments_of(roles))
    z = unit(direction(recording, roles["trunk_up"]), SHORTEST)
    across = direction(recording, roles[second])
    across = unit(across - np.sum(across * z, axis=-1, keepdims=True) * z, SHORTEST)
    if second == "trunk_front":
        axes = [across, np.cross(z, across), z]
    else:
        axes = [np.cross(across, z), across, z]
    rotation = np.stack(axes, axis=-1)
    if np.isnan(rotation).any(axis=(1, 2)).all():
        raise RecordingError(
            f"no trunk frame in {recording.source!r}: in no frame are the points of trunk_up {roles['trunk_up']} and "
            f"{second} {roles[second]} all present, distinct and not collinear"
        )
    return rotation


def across_role(roles: Roles) -> str:
    """Return the role of the trunk's second direction."""
    if "trunk_front" in roles:
        return "trunk_front"
    return "trunk_left"


def unit(vectors: Array, shortest: float = 0.0) -> Array:
    """Scale vectors (..., 3) to length one; nan where they are no longer than `shortest`."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(vectors / np.where(length > shortest, length, np.nan))


def groups_of(choice: Choice) -> tuple[Group, ...]:
    """Return the groups of points of a role: two of a direction, else one."""
    names = tuple(item for item in choice if isinstance(item, str))
    if names:
        return (names,)
    return tuple(item for item in choice if not isinstance(item, str))


def points_of(roles: Roles) -> list[str]:
    """Return all points that are assigned to a role, without repetition."""
    names = dict[str, None]()
    for choice in roles.values():
        for group in groups_of(choice or ()):
            names |= dict.fromkeys(group)
    return list(names)


def segments_of(roles: Roles) -> list[list[str]]:
    """Return the points of the trunk, of the elbow, and of wrist and hand."""
    segments = []
    for members in SEGMENT_ROLES:
        segment = {role: roles[role] for role in members if role in roles}
        segments.append(points_of(segment))
    return segments


def missing_roles(roles: Roles) -> list[str]:
    """Return the roles without points that an arm fit needs."""
    missing = [role for role in (*ARM, "trunk_up") if not roles.get(role)]
    if roles.get("trunk_front") or roles.get("trunk_left"):
        return missing
    return [*missing, "trunk_left"]


def missing_text(
    recording: Recording, missing: Sequence[str], roles: Roles, marker_set: str, side: str
) -> str:
    """List missing roles with their usual names and candidates, and how to assign them."""
    texts = []
    for role in missing:
        likely = ", ".join(map(repr, likely_points(recording, role, roles, marker_set, side)))
        usual = usual_names(role, marker_set, side)
        texts.append(f"{role} (usually {usual}; here perhaps {likely or 'none'})")
    names = [repr(name) for name in recording.observed[:20]]
    if len(recording.observed) > len(names):
        names.append(f"and {len(recording.observed) - len(names)} more")
    assign = argument("markers", example_markers(missing))
    return f"{'; '.join(texts)}. Assign points to roles with {assign}. Points: {', '.join(names)}."


def likely_points(
    recording: Recording, role: str, roles: Roles, marker_set: str, side: str
) -> list[str]:
    """Return the points of a recording that may play a missing role of an arm, likely ones first."""
    roles_of_other = find_roles(recording.observed, LEFT if side == RIGHT else RIGHT)[1]
    taken = set[str]()
    for point_role in POINTS:
        taken.update(roles.get(point_role) or ())
        taken.update(roles_of_other.get(point_role) or ())
    usual = usual_names(role, marker_set, side)
    return candidates(recording, role, roles, side, taken, usual)


def example_markers(missing: Iterable[str]) -> dict[str, list[str] | list[list[str]]]:
    """Return a template of `markers` for some roles: a list of names, or two from one end to the other."""
    template: dict[str, list[str] | list[list[str]]] = {}
    for role in missing:
        template[role] = ["NAME"]
        if role in DIRECTIONS:
            start, end = DIRECTIONS[role].upper().split(" TO ")
            template[role] = [[start], [end]]
    return template


def usual_names(role: str, marker_set: str, side: str) -> str:
    """Return the usual names of a role, those of the recording's own marker set first."""
    sets = dict.fromkeys([marker_set, *reversed(MARKER_SETS)])
    usual = []
    for name in sets:
        for choice in alternatives(name, role, side)[:1]:
            ends = ["+".join(map(repr, group)) for group in groups_of(choice)]
            usual.append(" to ".join(ends))
    return " or ".join(usual[:3])
