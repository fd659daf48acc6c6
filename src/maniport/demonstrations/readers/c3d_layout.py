"""The outer layout of a C3D file, checked before the library sees it.

A C3D file is a row of 512-byte blocks: a header, the parameters (groups and parameters in one chain, each entry with
the distance to the next) and the data.
"""

import struct
from pathlib import Path

from maniport.errors import FileFormatError

BLOCK = 512
MARK = 0x50
BIG_ENDIAN = 86
PROCESSORS = (84, 85, BIG_ENDIAN)
"""Intel, DEC, MIPS."""

TEXT, SHORT, REAL = -1, 2, 4
NEEDED = {"USED": SHORT, "SCALE": REAL, "RATE": REAL, "DATA_START": SHORT, "LABELS": TEXT}
"""Parameters of the group POINT and their types, without which points cannot be read."""


def require_whole(file: Path) -> int:
    """Check header and parameters.

    Returns
    -------
    int
        The number of frames that the header announces.

    Raises
    ------
    FileFormatError
        When the file is no C3D file, or its header or parameters are cut off or damaged.
    """
    with open(file, "rb") as stream:
        head = stream.read(BLOCK)
        if len(head) < BLOCK:
            raise FileFormatError(f"{file}: the file is cut off in its header: {len(head)} of {BLOCK} bytes")
        if head[1] != MARK:
            raise FileFormatError(
                f"{file}: this is no C3D file: its second byte is {head[1]:#04x} instead of {MARK:#04x}"
            )
        start = BLOCK * (max(head[0], 1) - 1)
        stream.seek(start)
        first = stream.read(4)
        if len(first) < 4 or first[3] not in PROCESSORS:
            raise FileFormatError(f"{file}: its parameters are missing or damaged at byte {start}")
        section = first + stream.read(BLOCK * first[2] - 4)
    order = ">" if first[3] == BIG_ENDIAN else "<"
    if len(section) < BLOCK * first[2]:
        raise FileFormatError(
            f"{file}: the file is cut off in its parameters: {len(section)} of {BLOCK * first[2]} bytes"
        )
    entries = _entries(file, section, start, order)
    groups = {number for number, _ in entries if number < 0}
    orphan = next((name for number, (name, _) in entries if number > 0 and -number not in groups), None)
    if orphan is not None:
        raise FileFormatError(f"{file}: its parameters are damaged: {orphan} belongs to no group")
    group = next((number for number, (name, _) in entries if number < 0 and name == "POINT"), 0)
    there = dict(entry for number, entry in entries if number == -group)
    for name, kind in NEEDED.items():
        if group == 0 or there.get(name) != kind:
            raise FileFormatError(f"{file}: its parameters are damaged: POINT:{name} is missing or of the wrong type")
    points, channels, begin, end = (int(word) for word in struct.unpack_from(f"{order}HHHH", head, 2))
    frames = end - begin + 1
    # two-byte numbers, four to a point: the least a file can need; without this the library allocates what is announced
    needed, found = frames * (8 * points + 2 * channels), file.stat().st_size
    if needed > found:
        raise FileFormatError(
            f"{file}: the file is cut off: its header announces {frames} frames of {points} points, that is at least "
            f"{needed} bytes; it ends after {found}"
        )
    return frames


def _entries(file: Path, section: bytes, start: int, order: str) -> list[tuple[int, tuple[str, int]]]:
    """Follow the chain of groups and parameters, each of which must lie inside the section and hold its own data.

    Returns
    -------
    list of (number, (name, type))
        The number of a group is negative, that of its parameters the same without the sign.
    """
    found: list[tuple[int, tuple[str, int]]] = []
    at = 4
    while at + 2 <= len(section):
        length, group = struct.unpack_from("bb", section, at)
        if length == 0:
            return found
        body = at + 2 + abs(length)
        if body + 4 > len(section) or group == 0:
            break
        (step,) = struct.unpack_from(f"{order}h", section, body)
        following = body + step if step else len(section)
        if step < 0 or following > len(section) or not _fits(section, body + 2, following, group < 0):
            break
        name = section[at + 2 : body].decode("latin-1").strip().upper()
        found.append((group, (name, struct.unpack_from("b", section, body + 2)[0])))
        if step == 0:
            return found
        at = following
    raise FileFormatError(f"{file}: its parameters are damaged at byte {start + at}")


def _fits(section: bytes, at: int, end: int, group: bool) -> bool:
    """Whether a group's description, or a parameter's type, dimensions, values and description, lie before `end`."""
    if group:
        return at < end and at + 1 + section[at] <= end
    if at + 2 > end:
        return False
    kind, dimensions = struct.unpack_from("bB", section, at)
    if kind not in (-1, 1, 2, 4) or dimensions > 7 or at + 2 + dimensions > end:
        return False
    size = abs(kind)
    for extent in section[at + 2 : at + 2 + dimensions]:
        size *= extent
    description = at + 2 + dimensions + size
    return bool(description < end and description + 1 + section[description] <= end)
