"""Names of points by marker set: which of them show which part of the body. The names are data/marker_sets.yaml."""

import re
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import yaml

from maniport.errors import InvalidInputError, unknown_name

Group = tuple[str, ...]  # Names of points whose mean is taken

POINTS = ("shoulder", "elbow", "wrist", "hand")  # Roles of a point, or of the mean of several

DIRECTIONS = {
    "elbow_axis": "medial to lateral",
    "wrist_axis": "ulnar to radial",
    "trunk_up": "low to high",
    "trunk_front": "back to front",
    "trunk_left": "right to left",
}
"""Roles of a pair of such points, and from which to which."""

ROLES = (*POINTS, *DIRECTIONS)
ARM = ("shoulder", "elbow", "wrist")  # Roles that make an arm

TRUNK = ("trunk_up", "trunk_front", "trunk_left")

END = "EndSite"  # Prefix of the ends of chains in BVH files, before the name of the joint


@cache
def load_names(file: str) -> Any:
    """Read a YAML file of names from the folder ``data``."""
    text = (Path(__file__).parent / "data" / file).read_text(encoding="utf-8")
    return yaml.load(text, Loader=getattr(yaml, "CSafeLoader", yaml.SafeLoader))


_DATA = load_names("marker_sets.yaml")

DIALECTS: dict[str, Mapping[str, Sequence[Any]]] = _DATA["marker_sets"]
"""For each marker set and role the ways to play it, the first that is recorded counts.

Each way is written as in the argument ``markers`` of `fit_arm`, for the right arm: a name or a list of names whose mean
counts; for a direction a pair (from, to) of these. The marker set with most roles of the arm wins, the later one of
equals; the trunk may come from another one. Upper and lower case, spaces, ``_``, ``.``, ``-`` and what stands before a
colon (``Nick01:RELB``) make no difference. Entries that are added are used by `fit_arm` and `read_recording`.
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
    return before + colon + pattern.sub(lambda found: _OTHER_SIDE[found[0]], bare, count=1)


def body_of(name: str) -> str:
    """Return the prefix of a point's name that names the person; empty where there is none."""
    return name.rpartition(":")[0]


def find_roles(names: Iterable[str], side: str = "right", body: str | None = None) -> tuple[str, dict[str, Any]]:
    """Find the marker set of a recording, and the points that play each role."""
    points = list(names)
    bodies = whole_bodies(points, side)
    return _roles_among(bodies.get(body or "", next(iter(bodies.values()), points)), side)


def whole_bodies(names: Iterable[str], side: str, most: int = 20) -> dict[str, list[str]]:
    """Return the points of each person with a whole arm and a trunk, by prefix; `most` prefixes are tried."""
    bodies: dict[str, list[str]] = {}
    for name in names:
        bodies.setdefault(body_of(name), []).append(name)
    if len(bodies) == 1:
        return bodies
    needed = {*ARM, "trunk_up"}
    return {body: own for body, own in list(bodies.items())[:most] if needed <= _roles_among(own, side)[1].keys()}


def find_legs(names: Iterable[str]) -> list[tuple[str, str]]:
    """Return the lower and the upper end of each leg that is recorded."""
    by_key = {_key(name): name for name in names}
    pairs = [pair for right in _DATA["legs"] for pair in (right, [other_side(name) for name in right])]
    return [(by_key[_key(low)], by_key[_key(high)]) for low, high in pairs if {_key(low), _key(high)} <= by_key.keys()]


def ways(marker_set: str, role: str, side: str = "right") -> list[Any]:
    """Return the ways of a marker set to play a role on one side: groups of names, or pairs of groups."""
    where = f"DIALECTS[{marker_set!r}][{role!r}]"
    choices = DIALECTS[marker_set].get(role, ())
    if isinstance(choices, str):
        raise InvalidInputError(f"{where} must be a list of choices; found {choices!r}")
    mirrored = side == "left" and role not in TRUNK  # the trunk's left is its left for either arm
    return [as_choice_of_names(role, choice, where, mirrored) for choice in choices]


def as_choice_of_names(role: str, choice: Any, where: str, mirrored: bool = False) -> Any:
    """Check which points shall play a role; return a tuple of names, or for a direction a pair of these."""
    if role not in DIRECTIONS:
        nested = isinstance(choice, Sequence) and len(choice) == 1 and isinstance(choice[0], list | tuple)
        return _as_group(choice[0] if nested else choice, where, mirrored)  # groups are nested in pairs, and often here
    if isinstance(choice, str) or not isinstance(choice, Sequence) or len(choice) != 2:
        raise InvalidInputError(f"{where} must be a pair of points or of lists (from, to); found {choice!r}")
    return tuple(_as_group(part, where, mirrored) for part in choice)


def _as_group(choice: Any, where: str, mirrored: bool) -> Group:
    names = (choice,) if isinstance(choice, str) else tuple(choice) if isinstance(choice, Sequence) else ()
    if not names or not all(isinstance(name, str) for name in names):
        raise InvalidInputError(f"{where} must be one name or a list of names; found {choice!r}")
    return tuple(other_side(name) for name in names) if mirrored else names


def _key(name: str) -> str:
    """Return what is compared of a name."""
    return re.sub(r"[_ .\-]", "", name.rpartition(":")[2]).lower()


def _roles_among(names: Sequence[str], side: str) -> tuple[str, dict[str, Any]]:
    by_key = {_key(name): name for name in reversed(names)}
    sets = {marker_set: _roles_of_set(marker_set, by_key, side) for marker_set in reversed(DIALECTS)}
    best = max(sets, key=lambda name: (sum(role in sets[name] for role in ARM), len(sets[name].keys() - TRUNK)))
    found = dict(sets[best])
    for role in TRUNK:
        if role not in found:
            found |= next(({role: roles[role]} for roles in sets.values() if role in roles), {})
    collars = {"rightshoulder", "leftshoulder", "rshoulder", "lshoulder"}  # shoulders only where an arm follows
    if not found.keys() & set(ARM[1:]) and collars & set(map(_key, found.get("shoulder", ()))):
        del found["shoulder"]
        found.pop("trunk_left", None)
    return best, {role: found[role] for role in ROLES if role in found}


def _roles_of_set(marker_set: str, by_key: Mapping[str, str], side: str) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for role in DIALECTS[marker_set]:
        if role not in ROLES:
            raise unknown_name("role", role, ROLES, f"in DIALECTS[{marker_set!r}]")
        recorded = (_recorded(role, way, by_key) for way in ways(marker_set, role, side))
        found |= next(({role: names} for names in recorded if names), {})
    return found


def _recorded(role: str, way: Any, by_key: Mapping[str, str]) -> Any:
    """Return the recording's own names for one way to play a role; None unless all are recorded."""
    if role in DIRECTIONS:
        pair = tuple(_recorded("", group, by_key) for group in way)
        return pair if all(pair) else None
    own = tuple(by_key.get(_key(name), "") for name in way)
    return own if all(own) else None
