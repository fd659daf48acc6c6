"""Points that may play a role that no marker set assigns: by anatomical words in their names, and by geometry."""

import re
from collections.abc import Collection, Mapping, Sequence
from difflib import SequenceMatcher

import numpy as np

from maniport.arms.chain import LEFT, RIGHT
from maniport.mocap.point_names import END, key_of, side_of
from maniport.mocap.recording import Recording
from maniport.util.validation import Array

WORDS = {
    "shoulder": (
        r"shoulder|shldr|acrom|glenohum|humer|saj|sjc|upperarm|uparm|uarm|肩",
        r"(?<!fore)(?<!low)(?<!lower)arm(?!ature)|sho$|^[rl]?gh|upper(?!.*(leg|chest|body))|腕",
        r"clavic|collar|scap",
    ),
    "elbow": (
        r"elbow|elb|epicond|ejc|hle|hme|ひじ|肘",
        r"forearm|lowerarm|lowarm|farm|olecran|lower(?!.*(leg|back|body))",
    ),
    "wrist": (r"wrist|wri|wjc|styloid|rsp$|usp$|手首", r"hand(?!.*[a-z0-9]{3})|palm|radius|ulna"),
    "hand": (r"palm|knuckle|metacarp|hand|hm\d", r"middle|mid\d|index|finger|指"),
    "low": (
        r"pelvis|hips?(?!.*\d)|sacr|psis|asis|ias|ips",
        r"lumbar|lowerback|abdomen|waist|spine",
    ),
    "high": (r"neck|c7|cv7|首", r"shoulder|acromi|clavic|collar|thorax|chest|stern|jugular|sjn"),
    "across": (r"shoulder|acromi|saj|clavic|collar|shldr", r"(?<!fore)(?<!lower)arm|hip|thigh"),
    "front": (r"stern|clav|jugular|chest|sjn|sxs|px|ij",),
    "back": (r"c7|cv7|t8|t10|tv\d|spine|back|sacr|psis",),
    "medial": (r"medial|med(?!i)|inner|hme|ulna|usp",),
    "lateral": (r"lateral|lat|outer|hle|radi|rsp",),
}
"""Parts of names of points for each role or end of a direction, from likely to less likely."""

ENDS = {
    "trunk_up": ("low", "high"),
    "trunk_front": ("back", "front"),
    "trunk_left": ("across", "across"),
    "elbow_axis": ("medial", "lateral"),
    "wrist_axis": ("medial", "lateral"),
}
"""Keys of `WORDS` for both ends of a direction."""

_OF_JOINTS = {
    "elbow_axis": WORDS["elbow"][0],
    "wrist_axis": WORDS["wrist"][0] + "|rsp|usp|ulna|radi",
}

ELSEWHERE = re.compile(
    r"eye|brow|jaw|tongue|nose|cheek|teeth|chin|lips?(?![a-z])|mouth|oris|oculi|risorius|levator|temporalis|orbicular"
    r"|nasal|head|face|hair|thigh|leg|knee|shin|calf|shank|foot|feet|ankle|toe|heel|femur|tibia|fibula|足|目|ひざ"
)
"""Parts of names of the face and the legs, where no role of an arm is."""

BONES = {
    ("shoulder", "elbow"): (0.99, 1.01),
    ("elbow", "wrist"): (0.6, 1.3),
    ("wrist", "hand"): (0.1, 0.7),
}
"""Roles at the ends of each bone, and its usual lengths in lengths of the upper arm."""

POINT_ROLES = ("shoulder", "elbow", "wrist", "hand")

LARGEST_CHANGE = 0.15  # Relative standard deviation of the length of a bone, with noise

NO_WORD = 9  # Rank of a name without an anatomical word
OTHER_WORD = 10  # Rank of a name with a word of another role


def candidates(
    recording: Recording,
    role: str,
    roles: Mapping[str, Sequence[str]],
    side: str,
    taken: Collection[str] = (),
    usual: str = "",
    most: int = 3,
) -> list[str]:
    """Return points that may play a role of an arm, likely ones first; for a direction those of both ends.

    Parameters
    ----------
    recording : Recording
    role : str
        A role without points.
    roles : mapping
        The points of the other roles of this arm.
    side : {"right", "left"}
        Side of the arm. Points with the other side in their names are left out, and so are points of face and legs.
    taken : collection of str
        Points of other roles, which are left out.
    usual : str
        Usual names of the role: of points without an anatomical word in their names similar ones come first.
    most : int
        Number of points, of a direction for each end.
    """
    if role in ENDS:
        return _of_direction(recording, role, side, max(most - 1, 1))
    ranked = []
    for place, name in enumerate(recording.observed):
        key = key_of(name)
        if name in taken or side_of(name) == _other(side) or ELSEWHERE.search(key):
            continue
        rank = _rank(key, WORDS[role])
        if rank == NO_WORD and any(re.search(words[0], key) for words in WORDS.values()):
            rank = OTHER_WORD
        is_no_bone = not _is_bone(recording, name, role, roles)
        similarity = SequenceMatcher(None, usual.lower(), name.lower()).ratio()
        ranked.append((rank, is_no_bone, name.startswith(END), -similarity, place, name))
    return [entry[-1] for entry in sorted(ranked)][:most]


def _of_direction(recording: Recording, role: str, side: str, most: int) -> list[str]:
    """Return points for both ends of a direction, by words in their names."""
    found = dict[str, None]()
    for end, side_of_end in zip(ENDS[role], (RIGHT, LEFT), strict=True):
        ranked = []
        for place, name in enumerate(recording.observed):
            rank = _rank(key_of(name), WORDS[end])
            if rank == NO_WORD or name.startswith(END):
                continue
            if role == "trunk_left" and side_of(name) != side_of_end:
                continue
            if role in _OF_JOINTS and not _is_of_joint(name, role, side):
                continue
            ranked.append((rank, place, name))
        names = [name for _, _, name in sorted(ranked)]
        if not names and role == "trunk_up":  # no words: points of the middle are the trunk's
            names = [name for name in recording.observed if not side_of(name)]
        found |= dict.fromkeys(names[:most])
    return list(found)


def _is_of_joint(name: str, role: str, side: str) -> bool:
    """Whether a point may be of the joint of an axis, and not of the other arm."""
    return side_of(name) != _other(side) and re.search(_OF_JOINTS[role], key_of(name)) is not None


def _other(side: str) -> str:
    if side == RIGHT:
        return LEFT
    return RIGHT


def _rank(key: str, patterns: tuple[str, ...]) -> int:
    for rank, pattern in enumerate(patterns):
        if re.search(pattern, key):
            return rank
    return NO_WORD


def _is_bone(
    recording: Recording, name: str, role: str, roles: Mapping[str, Sequence[str]]
) -> bool:
    """Whether a point in a role makes bones with its neighbors in the arm; not where none is assigned."""
    places = {role: recording.point(name)}
    for neighbor in POINT_ROLES:
        if neighbor != role and roles.get(neighbor):
            points = [recording.point(point) for point in roles[neighbor]]
            places[neighbor] = np.mean(points, axis=0)
    upper_arm = _median_length(places, "shoulder", "elbow")

    is_bone = False
    for (start, end), limits in BONES.items():
        if role not in (start, end) or not {start, end} <= places.keys():
            continue
        if not _has_bone_length(places[end] - places[start], upper_arm, limits):
            return False
        is_bone = True
    return is_bone


def _has_bone_length(vectors: Array, upper_arm: float, limits: tuple[float, float]) -> bool:
    """Whether vectors (n, 3) have one length, and it is within limits in lengths of the upper arm, if that is known."""
    lengths = np.linalg.norm(vectors, axis=-1)
    lengths = lengths[np.isfinite(lengths)]
    if not len(lengths):
        return False
    median = float(np.median(lengths))
    if median <= 0 or np.std(lengths) > LARGEST_CHANGE * median:
        return False
    low, high = limits
    return not upper_arm > 0 or low <= median / upper_arm <= high


def _median_length(places: Mapping[str, Array], start: str, end: str) -> float:
    """Return the median distance of two places; nan where one is not known."""
    if not {start, end} <= places.keys():
        return float("nan")
    lengths = np.linalg.norm(places[end] - places[start], axis=-1)
    if np.isfinite(lengths).any():
        return float(np.nanmedian(lengths))
    return float("nan")
