"""Marker sets: which names of points belong to which role. The names are in data/marker_sets.yaml."""

import re
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from maniport.errors import InvalidInputError, unknown_name
from maniport.util.validation import Array

Group = tuple[str, ...]  # Names of points that are averaged

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

MARKER_SETS: dict[str, Mapping[str, Sequence[Any]]] = _DATA["marker_sets"]
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


def find_roles(names: Iterable[str], side: str = "right", body: str | None = None) -> tuple[str, dict[str, Any]]:
    """Return the marker set of a recording, and the points of each role."""
    points = list(names)
    bodies = whole_bodies(points, side)
    return _roles_among(bodies.get(body or "", next(iter(bodies.values()), points)), side)


def whole_bodies(names: Iterable[str], side: str, most: int = 20) -> dict[str, list[str]]:
    """Return the points of each person with a whole arm and a trunk, by prefix; `most` prefixes are tried."""
    bodies: dict[str, list[str]] = {}
    for name in names:
        bodies.setdefault(name.rpartition(":")[0], []).append(name)
    if len(bodies) == 1:
        return bodies
    needed = {*ARM, "trunk_up"}
    return {body: own for body, own in list(bodies.items())[:most] if needed <= _roles_among(own, side)[1].keys()}


def alternatives(marker_set: str, role: str, side: str = "right") -> list[Any]:
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
            raise InvalidInputError(f"{where} must be a pair of points or of lists (from, to); found {choice!r}")
        groups = list(choice)
    else:
        nested = isinstance(choice, Sequence) and len(choice) == 1 and isinstance(choice[0], list | tuple)
        groups = [choice[0] if nested else choice]  # groups are nested in pairs, and often here
    for i, group in enumerate(groups):
        names = (group,) if isinstance(group, str) else tuple(group) if isinstance(group, Sequence) else ()
        if not names or not all(isinstance(name, str) for name in names):
            raise InvalidInputError(f"{where} must be one name or a list of names; found {group!r}")
        groups[i] = tuple(map(other_side, names)) if mirrored else names
    return tuple(groups) if role in DIRECTIONS else groups[0]


def _key(name: str) -> str:
    """Return what is compared of a name."""
    return re.sub(r"[_ .\-]", "", name.rpartition(":")[2]).lower()


def _roles_among(names: Sequence[str], side: str) -> tuple[str, dict[str, Any]]:
    by_key = {_key(name): name for name in reversed(names)}

    def recorded(choice: Any) -> Any:
        """Return the recording's own names for an alternative; empty unless all are recorded."""
        own = tuple(by_key.get(_key(part), "") if isinstance(part, str) else recorded(part) for part in choice)
        return own if all(own) else ()

    sets: dict[str, dict[str, Any]] = {}
    for marker_set in reversed(MARKER_SETS):
        sets[marker_set] = {}
        for role in MARKER_SETS[marker_set]:
            if role not in ROLES:
                raise unknown_name("role", role, ROLES, f"in MARKER_SETS[{marker_set!r}]")
            if own := next(filter(None, map(recorded, alternatives(marker_set, role, side))), None):
                sets[marker_set][role] = own
    best = max(sets, key=lambda name: (sum(role in sets[name] for role in ARM), len(sets[name].keys() - TRUNK)))
    roles = {role: names for roles in reversed(sets.values()) for role, names in roles.items() if role in TRUNK}
    roles |= sets[best]
    collarbones = {"rightshoulder", "leftshoulder", "rshoulder", "lshoulder"}  # shoulders only above an elbow or wrist
    if not roles.keys() & set(ARM[1:]) and collarbones & set(map(_key, roles.get("shoulder", ()))):
        del roles["shoulder"]
        roles.pop("trunk_left", None)
    return best, {role: roles[role] for role in ROLES if role in roles}


@np.errstate(over="ignore", invalid="ignore")  # of points out of reach
def arm_error(names: Sequence[str], positions: Array) -> float:
    """Measure how unlike arms the points (n, k, 3) with these names in order are; below 1 they are arms.

    Of arms the bones keep their lengths (standard deviation below 5 %) and differ by less than 15 % between the sides.
    """
    lengths = []
    for side in ("left", "right"):
        roles = find_roles(names, side)[1]
        points = positions[:, [names.index(roles[role][0]) for role in ARM]].astype(np.float64)
        bones = np.linalg.norm(np.diff(points, axis=1), axis=-1)
        lengths.append(bones[np.isfinite(bones).all(axis=1) & (bones > 0).all(axis=1)])
    if not all(map(len, lengths)):
        return np.inf
    left, right = (np.median(bones, axis=0) for bones in lengths)
    changes = [np.std(bones, axis=0) / np.median(bones, axis=0) / 0.05 for bones in lengths]
    return float(np.max([*changes, np.abs(left - right) / np.maximum(left, right) / 0.15]))
