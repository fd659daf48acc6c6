"""Which points of a recording play which role for an arm, the trunk frame they span, and which arm is fitted."""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from maniport.arms.chain import LEFT, RIGHT, SIDES
from maniport.errors import InvalidInputError, RecordingError, argument, nearest_first, spoken, unknown_name
from maniport.mocap.marker_sets import (
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
from maniport.mocap.recording import Recording
from maniport.util.defaults import AUTO
from maniport.util.validation import Array, as_choice

SHORTEST = 1e-4  # Shortest vector that has a direction [m]


def assign_roles(recording: Recording, markers: Mapping[str, Any] | None = None, side: str = "right") -> dict[str, Any]:
    """Find the points that play each role of one arm and the trunk."""
    marker_set, roles = played(recording, markers, side)
    _require_roles(roles, recording, marker_set, side)
    _require_side(recording, roles, trunk_rotation(recording, roles), side)
    return roles


def played(
    recording: Recording, markers: Mapping[str, Any] | None = None, side: str = "right"
) -> tuple[str, dict[str, Any]]:
    """Return the marker set of a recording and the points of each role, whether they suffice or not."""
    as_choice(side, "side", SIDES)
    chosen: dict[str, Any] = {}
    if not isinstance(markers, Mapping | None):
        raise InvalidInputError(f"{spoken('markers')} must map roles to names of points; found {markers!r}")
    for role, choice in (markers or {}).items():
        if role not in ROLES:
            raise unknown_name("role", role, ROLES, "of a point")
        chosen[role] = None if choice is None else _own_choice(role, choice, recording)
    bodies = {body_of(name) for role, choice in chosen.items() if choice for name in _names(role, choice)}
    marker_set, found = find_roles(recording.seen, side, bodies.pop() if len(bodies) == 1 else None)
    found |= chosen
    if markers and "trunk_left" in markers and "trunk_front" not in markers:
        found["trunk_front"] = None  # otherwise a name that happens to fit would overrule the user's choice
    return marker_set, {role: found[role] for role in ROLES if found.get(role)}


def find_side(
    recording: Recording, markers: Mapping[str, Any] | None = None, side: str = AUTO
) -> tuple[str, str, dict[str, Any]]:
    """Choose the arm; return it with the reason and its roles."""
    if side != AUTO:
        return side, "as asked for", assign_roles(recording, markers, side)
    found, errors = {}, {}
    for name in SIDES:
        try:
            found[name] = assign_roles(recording, markers, name)
        except RecordingError as error:
            errors[name] = error
    if not found:  # the error of the arm with more known names
        raise errors[max(SIDES, key=lambda name: sum(role in played(recording, side=name)[1] for role in ARM))]
    if len(found) == 1:
        ((only, roles),) = found.items()
        return only, "the only one that the recording shows whole", roles
    if all(found[RIGHT][role] == found[LEFT][role] for role in ARM):
        reason = f"the names of the points have no side; {argument('side', LEFT)} takes them for a left arm"
        return RIGHT, reason, found[RIGHT]
    paths = {name: _wrist_path(recording, roles) for name, roles in found.items()}
    similar = 1.1  # ratio of paths up to which the right arm is taken
    moving = LEFT if paths[LEFT] > similar * paths[RIGHT] else RIGHT
    other = SIDES[moving == RIGHT]
    alike = moving == RIGHT and paths[RIGHT] <= similar * paths[LEFT]
    reason = (
        f"{'both move alike' if alike else 'it moves more'}: relative to the trunk its wrist moves "
        f"{paths[moving]:.2f} m, the {other} one {paths[other]:.2f} m; {argument('side', other)} takes that"
    )
    return moving, reason, found[moving]


def _wrist_path(recording: Recording, roles: dict[str, Any]) -> float:
    """Return how far the wrist moves relative to the trunk [m]; unseen frames count as the mean."""
    wrist = role_position(recording, roles["wrist"]) - role_position(recording, roles["trunk_up"][0])
    local = np.sum(trunk_rotation(recording, roles) * wrist[:, :, None], axis=1)
    steps = np.linalg.norm(np.diff(local, axis=0), axis=-1)
    return float(np.nanmean(steps) * len(steps)) if np.isfinite(steps).any() else 0.0


class Basis:
    """A recording of unknown points: expressions linear in them become their coefficients."""

    def __init__(self, names: tuple[str, ...]):
        self._rows = dict(zip(names, np.eye(len(names)), strict=True))

    def point(self, name: str) -> Array:
        """Return one for the point, zero for all others."""
        return self._rows[name]


def role_position(recording: Recording | Basis, names: Group) -> Array:
    """Return the mean of the named points [m], shape (n_frames, 3); nan where one of them is missing."""
    return np.asarray(np.mean([recording.point(name) for name in names], axis=0))


def direction(recording: Recording | Basis, pair: Any) -> Array:
    """Return the vector from one group of points to another [m]."""
    return role_position(recording, pair[1]) - role_position(recording, pair[0])


def trunk_rotation(recording: Recording, roles: dict[str, Any]) -> Array:
    """Return the rotation from the trunk frame to the axes of the recording, in every frame."""
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
    """Return the role that shows the trunk's second direction."""
    return "trunk_front" if "trunk_front" in roles else "trunk_left"


def trunk_axes(up: Array, across: Array, forward: bool) -> Array:
    """Return rotations (..., 3, 3) with z along `up` and x (`forward`) or y along the rest of `across`, (..., 3)."""
    z = unit(up, SHORTEST)
    second = unit(across - np.sum(across * z, axis=-1, keepdims=True) * z, SHORTEST)
    columns = (second, np.cross(z, second), z) if forward else (np.cross(second, z), second, z)
    return np.stack(columns, axis=-1)


def unit(vectors: Array, shortest: float = 0.0) -> Array:
    """Scale vectors (..., 3) to length one; nan where they are no longer than `shortest`."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(vectors / np.where(length > shortest, length, np.nan))


def points_of(roles: Mapping[str, Any]) -> list[str]:
    """Return all points that play a role, each once."""
    return list(dict.fromkeys(name for role, choice in roles.items() for name in _names(role, choice)))


def lacking(roles: Mapping[str, Any]) -> list[str]:
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
    sets = dict.fromkeys([marker_set, *reversed(DIALECTS)])
    usual = [way for name in sets for way in ways(name, role, side)[:1]]
    if role in DIRECTIONS:
        return " or ".join(f"{'+'.join(map(repr, a))} to {'+'.join(map(repr, b))}" for a, b in usual[:3])
    return " or ".join("+".join(map(repr, group)) for group in usual[:3])


def _own_choice(role: str, choice: Any, recording: Recording) -> Any:
    """Check the user's choice for one role."""
    own = as_choice_of_names(role, choice, f"markers[{role!r}]")
    for name in _names(role, own):
        recording.point(name)
        if name not in recording.seen:
            raise RecordingError(f"markers[{role!r}]: point {name!r} is missing in every frame of {recording.source!r}")
    return own


def _names(role: str, choice: Any) -> Group:
    return (*choice[0], *choice[1]) if role in DIRECTIONS else choice


def _require_roles(found: Mapping[str, Any], recording: Recording, marker_set: str, side: str) -> None:
    """Raise unless every required role is played."""
    missing = lacking(found)
    if not missing:
        return
    where = f" in {recording.source!r}" if recording.source else ""
    usual = {role: usual_names(role, marker_set, side) for role in missing}
    needed = "; ".join(f"{role} (usually {names})" for role, names in usual.items())
    names = nearest_first(" ".join(usual.values()).replace("'", ""), recording.seen)
    listed = ", ".join(map(repr, names[:20])) + (f", and {len(names) - 20} more" if len(names) > 20 else "")
    other = SIDES[side == "right"]
    has_other = set(missing) & set(ARM) and set(ARM) <= find_roles(recording.seen, other)[1].keys()
    hint = f" There is a {other} arm: {argument('side', other)} takes it." if has_other else ""
    raise RecordingError(
        f"missing{where}: {needed}.{hint} Points there are, nearest first: {listed or 'none'}. "
        f"Say which points play a role with {argument('markers', example_markers(missing))}"
    )


def _require_side(recording: Recording, roles: Mapping[str, Any], trunk: Array, side: str) -> None:
    """Raise unless the points of an arm are those of its side, by their names and by their positions."""
    other = SIDES[side == "right"]
    own, theirs = (
        {name for role in ARM for name in find_roles(recording.seen, name_of)[1].get(role, ())}
        for name_of in (side, other)
    )
    for role in ARM:
        strange = [name for name in roles[role] if name in theirs - own]
        if strange:
            raise RecordingError(
                f"{role} of the {side} arm: {', '.join(map(repr, strange))} is a point of the {other} one; "
                f"give {argument('side', other)} or other {argument('markers')}"
            )
    inward = trunk[:, :, 1] if side == "right" else -trunk[:, :, 1]
    middle = role_position(recording, tuple(name for group in roles["trunk_up"] for name in group))
    shoulder, elbow = (role_position(recording, roles[role]) for role in ("shoulder", "elbow"))
    # Largest median displacement toward the other arm [m]. An upper arm of 0.42 m, raised forward and inward as far as
    # possible, brings the elbow 0.27 m inward.
    for role, start, step, most in (
        ("shoulder", "trunk_up", shoulder - middle, 0.05),
        ("elbow", "shoulder", elbow - shoulder, 0.3),
    ):
        displacement = np.sum(step * inward, axis=-1)
        if np.isfinite(displacement).any() and (median := float(np.nanmedian(displacement))) > most:
            raise RecordingError(
                f"{role} of the {side} arm: {'+'.join(roles[role])} is {median:.2f} m to the {other} of {start} "
                f"(median); these may be points of the {other} arm ({argument('side', other)}), the ends of trunk_left "
                "or trunk_front may be exchanged, or the axes of the recording be left-handed"
            )
