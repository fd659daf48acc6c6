"""Which points of a recording play which part, by known names or the user's own; and the trunk frame they span.

A role is played by the mean of one or more points, or, for a direction, by two such groups (from, to).
Names are compared without case, spaces, ``_`` and what stands before a colon (``Nick01:RELB``, ``mixamorig:RightArm``).
Only the right arm is known: the arms of `maniport.bodies` are right arms.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from maniport.demonstrations.recording import Recording
from maniport.errors import InvalidInputError, RecordingError, nearest_first, unknown_name
from maniport.validation import Array

Group = tuple[str, ...]

POINTS: dict[str, tuple[Group, ...]] = {
    "shoulder": (
        ("RightArm",), ("RightUpArm",), ("RightUpperArm",), ("RFSH", "RBSH"), ("RSHO",), ("RAC",), ("RSHLDR",),
        ("RightShoulder",), ("shoulder",),
    ),
    "elbow": (
        ("RightForeArm",), ("RightLowArm",), ("RightLowerArm",), ("RELB", "RIEL"), ("RELB", "RELBM"), ("RLEL", "RMEL"),
        ("RELB",), ("RightElbow",), ("RFOREARM",), ("elbow",),
    ),
    "wrist": (
        ("RightHand",), ("ROWR", "RIWR"), ("RWRA", "RWRB"), ("RRS", "RUS"), ("RightWrist",), ("RHAND",), ("wrist",),
    ),
    "hand": (
        ("RFingers",), ("RightHandMiddle1",), ("RightMiddleProximal",), ("RIHAND", "ROHAND"), ("RFIN",), ("RMID1",),
        ("EndSiteRightHand",), ("EndSiteRightWrist",), ("hand",),
    ),
}  # fmt: skip
"""For each role the groups of points that may play it; the first group that is there does."""

DIRECTIONS: dict[str, tuple[tuple[Group, Group], ...]] = {
    "elbow_axis": ((("RIEL",), ("RELB",)), (("RELBM",), ("RELB",)), (("RMEL",), ("RLEL",)),
                   (("elbow_medial",), ("elbow_lateral",))),
    "wrist_axis": ((("RWRB",), ("RWRA",)), (("ROWR",), ("RIWR",)), (("RUS",), ("RRS",)),
                   (("wrist_ulnar",), ("wrist_radial",))),
    "trunk_up": (
        (("T10", "STRN"), ("C7", "CLAV")), (("T8", "PX"), ("C7", "IJ")), (("T10",), ("C7",)), (("STRN",), ("CLAV",)),
        (("Spine",), ("Neck",)), (("LowerBack",), ("Neck",)), (("Hips",), ("Neck",)), (("Chest",), ("Neck",)),
        (("trunk_low",), ("trunk_high",)),
    ),
    "trunk_front": (
        (("C7", "T10"), ("CLAV", "STRN")), (("C7", "T8"), ("IJ", "PX")), (("C7", "T10"), ("STRN",)),
        (("C7", "T10"), ("CLAV",)), (("C7",), ("CLAV",)), (("trunk_back",), ("trunk_front",)),
    ),
    "trunk_left": (
        (("RightArm",), ("LeftArm",)), (("RightUpperArm",), ("LeftUpperArm",)), (("RightUpArm",), ("LeftUpArm",)),
        (("RFSH", "RBSH"), ("LFSH", "LBSH")), (("RSHO",), ("LSHO",)), (("RAC",), ("LAC",)), (("RSHLDR",), ("LSHLDR",)),
        (("RightShoulder",), ("LeftShoulder",)), (("trunk_right",), ("trunk_left",)),
    ),
}  # fmt: skip
"""For each direction the pairs (from, to): medial to lateral, ulnar to radial, low to high, back to front, right to
left."""

ROLES = (*POINTS, *DIRECTIONS)
REQUIRED = ("shoulder", "elbow", "wrist", "trunk_up")


def assign_roles(recording: Recording, markers: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """Find the points that play each role.

    Parameters
    ----------
    recording : Recording
        A point that is missing in every frame counts as not there.
    markers : mapping, optional
        The user's own choice for some roles: ``{"shoulder": ["RFSH", "RBSH"], "elbow_axis": (["RIEL"], ["RELB"])}``.
        One name may stand for a list of one; None drops an optional role.

    Returns
    -------
    dict
        For a point role a tuple of names, for a direction role a pair of tuples; optional roles that nobody plays
        are absent.

    Raises
    ------
    UnknownNameError
        When `markers` names a role or a point that does not exist.
    RecordingError
        When a required role has no points; the message lists those missing and the points there are, nearest first.
    """
    seen = [name for name, missing in zip(recording.names, recording.missing, strict=True) if missing < 1]
    by_key = {_key(name): name for name in reversed(seen)}
    found: dict[str, Any] = {}
    for role, groups in POINTS.items():
        found[role] = next((names for group in groups if (names := _named(group, by_key))), None)
    for role, pairs in DIRECTIONS.items():
        both = ((_named(start, by_key), _named(end, by_key)) for start, end in pairs)
        found[role] = next((pair for pair in both if all(pair)), None)
    for role, choice in (markers or {}).items():
        if role not in ROLES:
            raise unknown_name("role", role, ROLES, "of a point")
        found[role] = None if choice is None else _own_choice(role, choice, recording, seen)
    if markers and "trunk_left" in markers and "trunk_front" not in markers:
        found["trunk_front"] = None  # otherwise the user's choice would be overruled by a name that happens to fit
    _require(found, recording, seen)
    return {role: names for role, names in found.items() if names}


def role_position(recording: Recording, names: Group) -> Array:
    """Mean of the named points [m], shape (n_frames, 3); nan where one of them is missing.

    A mean over whatever happens to be seen would jump by centimetres when one marker of a pair drops out.
    """
    return np.asarray(np.mean([recording.point(name) for name in names], axis=0))


def trunk_rotation(recording: Recording, roles: dict[str, Any]) -> Array:
    """Rotation from the trunk frame to the axes of the recording, in every frame.

    z is ``trunk_up`` (from low to high on the spine). Where points at the front are there, x is ``trunk_front`` (from
    the back to the front) made orthogonal to z, so that the plane of symmetry is that of spine and breastbone and
    shrugging one shoulder does not turn it. Otherwise y is ``trunk_left`` (from right to left shoulder) made orthogonal
    to z. The third axis is the cross product.

    Returns
    -------
    ndarray, shape (n_frames, 3, 3)
        Columns x, y, z; nan where one of the points is missing.

    Raises
    ------
    RecordingError
        When the two directions are parallel in every frame.
    """
    up = _unit(_direction(recording, roles["trunk_up"]))
    second = "trunk_front" if "trunk_front" in roles else "trunk_left"
    across = _direction(recording, roles[second])
    across = across - np.sum(across * up, axis=-1, keepdims=True) * up
    across = _unit(across)
    columns = (across, np.cross(up, across), up) if second == "trunk_front" else (np.cross(across, up), across, up)
    rotation = np.stack(columns, axis=-1)
    if np.isnan(rotation).any(axis=(1, 2)).all():
        raise RecordingError(
            f"no trunk frame in {recording.source!r}: in no frame are the points of trunk_up {roles['trunk_up']} and "
            f"{second} {roles[second]} all seen, apart from each other and not in one line"
        )
    return rotation


def _direction(recording: Recording, pair: Any) -> Array:
    return role_position(recording, pair[1]) - role_position(recording, pair[0])


def _unit(vector: Array) -> Array:
    """Scale to length one; nan where the length is below a tenth of a millimetre."""
    length = np.linalg.norm(vector, axis=-1, keepdims=True)
    return np.asarray(vector / np.where(length > 1e-4, length, np.nan))


def _named(group: Group, by_key: Mapping[str, str]) -> Group | None:
    names = tuple(by_key.get(_key(name), "") for name in group)
    return names if all(names) else None


def _key(name: str) -> str:
    return name.rsplit(":", 1)[-1].replace("_", "").replace(" ", "").lower()


def _own_choice(role: str, choice: Any, recording: Recording, seen: Sequence[str]) -> Any:
    """Check what the user chose for one role."""
    if role in DIRECTIONS:
        if isinstance(choice, str) or len(choice) != 2:
            raise InvalidInputError(
                f"markers[{role!r}] must be a pair of points or of lists (from, to); found {choice!r}"
            )
        return tuple(_own_group(role, part, recording, seen) for part in choice)
    return _own_group(role, choice, recording, seen)


def _own_group(role: str, choice: Any, recording: Recording, seen: Sequence[str]) -> Group:
    names = (choice,) if isinstance(choice, str) else tuple(choice)
    if not names or not all(isinstance(name, str) for name in names):
        raise InvalidInputError(f"markers[{role!r}] must be one name or a list of names; found {choice!r}")
    for name in names:
        recording.point(name)
        if name not in seen:
            raise RecordingError(f"markers[{role!r}]: point {name!r} is missing in every frame of {recording.source!r}")
    return names


def _require(found: Mapping[str, Any], recording: Recording, seen: Sequence[str]) -> None:
    """Raise unless every required role is played."""
    missing = [role for role in REQUIRED if not found[role]]
    if not (found["trunk_front"] or found["trunk_left"]):
        missing.append("trunk_front or trunk_left")
    if not missing:
        return
    where = f" in {recording.source!r}" if recording.source else ""
    wanted = "; ".join(f"{role} (usually {_usual(role)})" for role in missing)
    names = nearest_first(" ".join(_usual(role) for role in missing).replace("'", ""), seen)
    shown = ", ".join(map(repr, names[:20])) + (f", and {len(names) - 20} more" if len(names) > 20 else "")
    left = "" if not _left_arm_only(seen, missing) else " There is a left arm, but only right arms can be fitted."
    raise RecordingError(
        f"missing{where}: {wanted}.{left} Points there are, nearest first: {shown or 'none'}. "
        "Say which points play a role with markers={'shoulder': ['NAME'], ...}"
    )


def _usual(role: str) -> str:
    """The names under which a role is usually found."""
    if role in POINTS:
        return " or ".join("+".join(map(repr, group)) for group in POINTS[role][:4])
    if role in DIRECTIONS:
        chosen = DIRECTIONS[role][2:5] if role == "trunk_up" else DIRECTIONS[role][:2]
        return " or ".join(f"{'+'.join(map(repr, a))} to {'+'.join(map(repr, b))}" for a, b in chosen)
    return _usual("trunk_left")


def _left_arm_only(seen: Sequence[str], missing: Sequence[str]) -> bool:
    mirrored = {_key(name.replace("Right", "Left") if "Right" in name else "L" + name[1:])
                for role in ("elbow", "wrist") for group in POINTS[role] for name in group}  # fmt: skip
    return bool({"elbow", "wrist"} & set(missing)) and bool(mirrored & {_key(name) for name in seen})
