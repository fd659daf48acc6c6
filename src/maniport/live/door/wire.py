"""What goes over the wire: a frame as a line of JSON, and the lines that answer it."""

import json
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, NoReturn

import numpy as np

from maniport.demonstrations.recording import MAX_POSITION
from maniport.errors import InvalidInputError, unknown_name
from maniport.input_limits import FRAME_BYTES
from maniport.validation import LATEST, Array
from maniport.version import __version__

LATEST_FRAME = 0.5 * LATEST
"""Time of a frame; the robot may go on by itself after it [s]."""
EXAMPLE = '{"t": 0.02, "points": {"NAME": [0.1, 0.2, 0.3]}}'
SHOWN = 80
"""Characters that a message shows of what was found."""


class Frame(NamedTuple):
    """Where the points are at a time.

    Attributes
    ----------
    t : float
        [s].
    points : ndarray, shape (n_points, 3)
        In the order of the names; nan where a point is not seen.
    """

    t: float
    points: Array


def read_frame(line: bytes | None, names: Sequence[str]) -> Frame | None:
    """Understand a line."""
    if line is None:
        raise InvalidInputError(f"a line has at most {FRAME_BYTES} bytes; this one has more")
    found = _decoded(line)
    if not isinstance(found, dict):
        raise InvalidInputError(f"a line must be an object such as {EXAMPLE}; found {_shown(found)}")
    if not found:
        return None
    if found.keys() != {"t", "points"}:
        keys = ", ".join(map(_shown, found))
        raise InvalidInputError(f"a frame holds t and points, such as {EXAMPLE}, and nothing else; found {keys:.200}")
    return Frame(_number(found["t"], "t", LATEST_FRAME), _places(found["points"], names))


def hello(points: Sequence[str], joints: Mapping[str, float], units: Sequence[str], **more: Any) -> bytes:
    """Say what is expected and what will come: the first line, and the answer to the empty object."""
    about = {"maniport": __version__, "points": list(points), "units": dict(zip(joints, units, strict=True))}
    return _encoded({**about, "start": dict(joints), **more})


def answer(
    t: float,
    frame: float | None,
    state: str,
    joints: Mapping[str, float],
    distance: float | None,
    tip_error: float | None,
    skipped: int,
) -> bytes:
    """Encode the robot's state and how near it is to its target."""
    found = {"t": t, "frame": frame, "state": state, "joints": joints, "distance": distance, "tip_error": tip_error}
    return _encoded({**found, "skipped": skipped})


def refusal(error: Exception, line: int) -> bytes:
    """Say why a line was not understood, and which one, counted from 1."""
    return _encoded({"error": " ".join(str(error).split()), "line": line})


def _encoded(content: Mapping[str, Any]) -> bytes:
    return json.dumps(content, allow_nan=False).encode() + b"\n"


def _decoded(line: bytes) -> Any:
    try:
        return _DECODER.decode(line.decode())
    except (ValueError, RecursionError) as error:  # also of numbers with thousands of digits, and of wrong UTF-8
        if isinstance(error, InvalidInputError):
            raise
        found = line[:SHOWN].decode(errors="replace")
        raise InvalidInputError(f"a line must be JSON such as {EXAMPLE}; found {found!r}: {error!s:.100}") from None


def _no_constant(name: str) -> NoReturn:
    raise InvalidInputError(f"JSON has no number {name}; a point that is not seen is null, or absent")


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) != len(pairs):
        (twice, _), *_ = Counter(name for name, _ in pairs).most_common(1)
        raise InvalidInputError(f"each name may stand once in an object; found {_shown(twice)} more than once")
    return found


_DECODER = json.JSONDecoder(parse_constant=_no_constant, object_pairs_hook=_once)


def _places(found: Any, names: Sequence[str]) -> Array:
    """Places of points (n, 3), from an object or a list of them."""
    rows = np.full((len(names), 3), np.nan)
    if isinstance(found, dict):
        for name, place in found.items():
            if name not in names:
                raise unknown_name("point", name[:SHOWN], names, "in points")
            _put(rows, names.index(name), place, name)
    elif isinstance(found, list):
        if len(found) != len(names):
            raise InvalidInputError(f"points must be {len(names)} places, in the order told; found {len(found)}")
        for i, place in enumerate(found):
            _put(rows, i, place, i)
    else:
        raise InvalidInputError(f"points must be an object of places by name, or a list; found {_shown(found)}")
    return rows


def _put(rows: Array, row: int, place: Any, name: str | int) -> None:
    if place is None:
        return
    where = f"points[{json.dumps(name)}]"
    if not isinstance(place, list) or len(place) != 3:
        raise InvalidInputError(
            f"{where} must be three numbers such as [0.1, 0.2, 0.3], or null; found {_shown(place)}"
        )
    rows[row] = [_number(one, where, MAX_POSITION) for one in place]


def _number(found: Any, where: str, most: float) -> float:
    if type(found) is float and -most <= found <= most:
        return found
    try:
        number = float(found) if type(found) is int else math.nan
    except OverflowError:
        number = math.nan
    if abs(number) <= most:
        return number
    raise InvalidInputError(f"{where}: a number must be finite, within ±{most:g}; found {_shown(found)}")


def _shown(found: Any) -> str:
    """What was found, in few characters; of large things their beginning."""
    if isinstance(found, dict | list):
        return f"{'an object' if isinstance(found, dict) else 'a list'} of {len(found)}"
    return json.dumps(found if not isinstance(found, str) else found[:SHOWN], ensure_ascii=False)[:SHOWN]
