"""Names of points: the side in a name, its spellings, and what programs add to all names of a file."""

import re
import unicodedata
from collections import Counter
from collections.abc import Sequence
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

import yaml

from maniport.arms.chain import LEFT, RIGHT

END = "EndSite"  # Prefix of the ends of chains in BVH files, before the name of the joint

_OTHER_SIDE = {"right": "left", "Right": "Left", "RIGHT": "LEFT", "r": "l", "R": "L", "右": "左"}
_OTHER_SIDE |= {left: right for right, left in _OTHER_SIDE.items()}
_SIDE_WORD = re.compile("|".join(word for word in _OTHER_SIDE if len(word) > 1 or word in "右左"))
_SIDE_LETTER = re.compile(r"(?<![A-Za-z])[RrLl](?![a-z0-9])|(?<=[a-z0-9])[RL]$")
_SMALL_LETTER = re.compile(
    r"^[rl](?=shoulder|shldr|collar|clavicle|(upper|fore|lower)?arm|elbow|wrist|hand|hip|thigh|knee|shin|foot|ankle|toe)"
)
_SEPARATORS = re.compile(r"[_ .\-()\[\]{}\"']")

_ADDED_BEFORE = re.compile(
    r"((mixamorig|armature|character|(valvebiped[._])?bip(ed)?)_?\d*[_ .\-]*"
    r"|(m_avg|f_avg|def|org|cc_base|j_bip(_c)?)[_ .\-]+)",
    re.IGNORECASE,
)
"""What programs add before a name, where not most of the names of a file share it."""

_ADDED_BEHIND = re.compile(r"[_.]\d+$")
"""Numbers that programs add behind a name, another one for each."""

_PERSON_BEFORE = re.compile(r"(?P<person>[^_ .\-/]+?(?:[_ .\-/]*\d+)?)[_ .\-/]+(?P<point>.+)")
_PERSON_BEHIND = re.compile(r"(?P<point>.+?)[_ .\-/]+(?P<person>[A-Za-z]+[_ ]?\d+)")
_SIDE_WORDS = ("r", "l", "right", "left", "rt", "lt", "upper", "lower")

MOST_SHARE = (
    0.6  # Share of the names that must have a prefix or suffix in common for it to be taken off
)


@cache
def load_names(file: str) -> Any:
    """Read a YAML file of names from the folder ``data``."""
    text = (Path(__file__).parent / "data" / file).read_text(encoding="utf-8")
    return yaml.load(text, Loader=getattr(yaml, "CSafeLoader", yaml.SafeLoader))


def parts_of(name: str) -> tuple[str, str, str]:
    """Split a name into its namespace (before the last ``:`` or ``|``), `END` or nothing, and the rest."""
    if name.startswith(END):
        end = END
    else:
        end = ""
    whole = name.removeprefix(END)
    cut = max(whole.rfind(":"), whole.rfind("|")) + 1
    namespace = whole[: max(cut - 1, 0)]
    bare = whole[cut:]
    if not end and bare.startswith(END):
        return namespace, END, bare.removeprefix(END)
    return namespace, end, bare


@lru_cache(maxsize=16)
def names_by_person(names: tuple[str, ...]) -> dict[str, tuple[str, ...]]:
    """Return names by the person before them: by their namespaces, or where all have one, by other starts and ends.

    ``P1_RELB`` and ``P2_RELB`` are those of two persons, since most of the names that follow ``P1_`` follow ``P2_``.
    """
    groups: dict[str, list[str]] = {}
    for name in names:
        groups.setdefault(parts_of(name)[0], []).append(name)
    if len(groups) == 1:
        for pattern in (_PERSON_BEFORE, _PERSON_BEHIND):
            found = _persons(names, pattern)
            if found:
                groups = found
                break
    return {person: tuple(group) for person, group in groups.items()}


def _persons(names: tuple[str, ...], pattern: re.Pattern[str]) -> dict[str, list[str]]:
    """Return names by the person that a pattern finds; empty where most names are not those of several persons."""
    groups: dict[str, list[str]] = {}
    points: dict[str, set[str]] = {}
    for name in names:
        match = pattern.fullmatch(parts_of(name)[2])
        if match is None or match["person"].lower() in _SIDE_WORDS:
            continue
        groups.setdefault(match["person"], []).append(name)
        points.setdefault(match["person"], set()).add(match["point"])
    most = max(map(len, points.values()), default=0)
    if most < 4:  # as many as an arm and a trunk have at least
        return {}
    common = set[str]()
    for of_person in points.values():
        if len(of_person) == most:
            common |= of_person
    persons = {}
    count = 0
    for person, of_person in points.items():
        if len(of_person & common) > 0.5 * most:
            persons[person] = groups[person]
            count += len(groups[person])
    if len(persons) < 2 or count < MOST_SHARE * len(names):
        return {}
    return persons


def person_of(name: str, names: tuple[str, ...]) -> str:
    """Return the person of a name among all names; empty where they are those of one person."""
    for person, names_of_person in names_by_person(names).items():
        if name in names_of_person:
            return person
    return ""


@lru_cache(maxsize=8192)
def other_side(name: str) -> str:
    """Return the name of the same point on the other side; the same name where it has no side."""
    bare = parts_of(name)[2]
    before = name[: len(name) - len(bare)]
    found = _side_mark(bare)
    if found is None:
        return name
    other = _OTHER_SIDE[found[0]]
    return before + bare[: found.start()] + other + bare[found.end() :]


def side_of(name: str) -> str:
    """Return the side in a name, "right" or "left"; empty where there is none."""
    found = _side_mark(parts_of(name)[2])
    if found is None:
        return ""
    if found[0][0] in "Rr右":
        return RIGHT
    return LEFT


def _side_mark(bare: str) -> re.Match[str] | None:
    """Find the word or the letter of the side in a name without its namespace."""
    for pattern in (_SIDE_WORD, _SIDE_LETTER, _SMALL_LETTER):
        found = pattern.search(bare)
        if found is not None:
            return found
    return None


def key_of(name: str) -> str:
    """Return a name as names are compared: without namespace and separators, in small letters."""
    _, end, bare = parts_of(unicodedata.normalize("NFKC", name))
    return _plain(end + bare)


def _plain(text: str) -> str:
    return _SEPARATORS.sub("", text).lower()


@cache
def spellings(name: str) -> tuple[str, ...]:
    """Return the keys of all spellings of a name of a marker set, its own first.

    The side is a word or a letter, before or behind: ``RightForeArm``, ``forearm_r``. Abbreviations (``RSHO``) have it
    before only, since ``SHOR`` would be another name.
    """
    first = key_of(name)
    _, end, bare = parts_of(name)
    found = _side_mark(bare)
    if found is None:
        return (first,)

    base = bare[: found.start()] + bare[found.end() :]
    key = _plain(unicodedata.normalize("NFKC", base))
    if not key:
        return (first,)
    if side_of(name) == RIGHT:
        marks = ("r", "right")
    else:
        marks = ("l", "left")
    keys = [first]
    for mark in marks:
        keys.append(_plain(end) + mark + key)
        if not base.isupper():
            keys.append(_plain(end) + key + mark)
    return tuple(dict.fromkeys(keys))


@lru_cache(maxsize=16)
def keys_without_additions(names: tuple[str, ...]) -> tuple[dict[str, str], ...]:
    """Return names by key, in several ways: without what a program may have added before or behind them.

    Starts and ends that most of the names share are taken off, then those of known programs. The first of equal keys
    counts.
    """
    bare = [unicodedata.normalize("NFKC", parts_of(name)[2]) for name in names]
    ends = [parts_of(name)[1] for name in names]
    before: list[re.Pattern[str] | None] = [None]
    before += [re.compile(re.escape(start)) for start in _shared_starts(bare)]
    before.append(_ADDED_BEFORE)
    behind: list[re.Pattern[str] | None] = [None]
    backward = [name[::-1] for name in bare]
    behind += [re.compile(re.escape(start[::-1]) + "$") for start in _shared_starts(backward)]
    behind.append(_ADDED_BEHIND)

    ways = []
    tried = {tuple(bare)}
    for start in before:
        for stop in behind:
            shortened = tuple(_without(name, start, stop) for name in bare)
            if shortened in tried:
                continue
            tried.add(shortened)
            shown = []
            for end, name in zip(ends, shortened, strict=True):
                shown.append(end + name)
            ways.append(names_by_key(shown, names))
    return tuple(ways)


def names_by_key(shown: Sequence[str], names: Sequence[str]) -> dict[str, str]:
    """Return names by the keys of how they are shown; the first of equal keys counts."""
    pairs = zip(reversed(shown), reversed(names), strict=True)
    return {key_of(text): name for text, name in pairs}


def _without(name: str, start: re.Pattern[str] | None, stop: re.Pattern[str] | None) -> str:
    """Take a start and an end off a name; what has nothing else keeps them."""
    shortened = name
    found = None if start is None else start.match(name)
    if found is not None:
        shortened = name[found.end() :]
    if stop is not None:
        shortened = stop.sub("", shortened, count=1)
    return shortened or name


def _shared_starts(names: Sequence[str]) -> list[str]:
    """Return the starts that most of the names share, from short to long, without those that end in a side."""
    group = list(names)
    least = max(3.0, MOST_SHARE * len(group))
    starts = []
    length = 0
    while True:
        following = Counter(name[length] for name in group if len(name) > length)
        if following:
            letter, count = following.most_common(1)[0]
        else:
            letter = ""
            count = 0
        if count < len(group) and length:
            starts.append(group[0][:length])
        if count < least:
            break
        group = [name for name in group if name[length : length + 1] == letter]
        length += 1
    ends_in_side = re.compile(
        r"(^|[^a-z])(r|l|right|left|thgir|tfel|右|左)[_ .\-]*$", re.IGNORECASE
    )
    return [start for start in starts if not ends_in_side.search(start)][-4:]
