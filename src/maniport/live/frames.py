"""Frames as they come: arrays, mappings and lines of JSON."""

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, NoReturn

import numpy as np

from maniport.errors import InvalidInputError, unknown_name
from maniport.mocap.recording import MAX_POSITION
from maniport.util.input_limits import FRAME_BYTES
from maniport.util.validation import LATEST, Array, require_shape

EXAMPLE = '{"t": 0.02, "points": {"NAME": [0.1, 0.2, 0.3]}}'


class Frame(NamedTuple):
    """Positions of the points at a time."""

    t: float  # [s]
    points: Array  # Shape (n_points, 3); nan where a point is not seen


def as_frame(points: Any, names: Sequence[str]) -> Array | None:
    """Copy to positions (n, 3) in the order of the names, nan where a point is not seen; None stays None."""
    if points is None:
        return None
    if isinstance(points, Mapping):
        positions = np.full((len(names), 3), np.nan)
        for name, value in points.items():
            if name not in names:
                raise unknown_name("point", name[:80] if isinstance(name, str) else name, names, "in points")
            if value is not None:
                position = _as_numbers(value, f"points[{name!r}]")
                require_shape(position, f"points[{name!r}]", (3,))
                positions[names.index(name)] = position
    else:
        positions = _as_numbers(points, "points")
        require_shape(positions, "points", (len(names), 3), ", a row for each of live.points")
    if (np.abs(positions) > MAX_POSITION).any():
        largest = np.nanmax(np.abs(positions))
        raise InvalidInputError(
            f"points must be within ±{MAX_POSITION:g}, or nan where they are not seen; found {largest:g}"
        )
    return positions


def _as_numbers(value: Any, name: str) -> Array:
    """Convert to numbers; nan may be among them, and replaces masked entries."""
    try:
        if isinstance(value, np.ndarray) and value.dtype.kind == "c":
            raise TypeError
        if isinstance(value, np.ma.MaskedArray):
            value = np.ma.filled(value.astype(np.float64), np.nan)
        return np.array(value, dtype=np.float64, order="C")  # numba compiles anew for each order and read-only flag
    except (OverflowError, TypeError, ValueError):
        raise InvalidInputError(f"{name} must be numbers; found {value!r:.80}") from None


def read_frame(line: bytes | None, names: Sequence[str]) -> Frame | None:
    """Read a line of JSON, None where it was too long; None is returned for the empty object."""
    if line is None:
        raise InvalidInputError(f"a line has at most {FRAME_BYTES} bytes; this one has more")
    try:
        content = json.loads(line.decode(), parse_constant=_refuse_constant, object_pairs_hook=_unique)
    except InvalidInputError:
        raise
    except (ValueError, RecursionError) as error:  # also of numbers with thousands of digits, and of wrong UTF-8
        text = line[:80].decode(errors="replace")
        raise InvalidInputError(f"a line must be JSON such as {EXAMPLE}; found {text!r}: {error!s:.100}") from None
    if content == {}:
        return None
    if not isinstance(content, dict) or content.keys() != {"t", "points"}:
        keys = ", ".join(map(_short, content)) if isinstance(content, dict) else _short(content)
        raise InvalidInputError(f"a frame is an object of t and points, such as {EXAMPLE}; found {keys:.200}")
    t, points, latest = content["t"], content["points"], 0.5 * LATEST  # steps without a frame may come after it
    if type(t) not in (int, float) or not -latest <= t <= latest:
        raise InvalidInputError(f"t must be a number within ±{latest:g}; found {_short(t)}")
    if isinstance(points, list) and len(points) == len(names):
        points = dict(zip(names, points, strict=True))
    if not isinstance(points, dict):
        wanted = f"an object of positions by name, or a list of {len(names)} positions in the given order"
        raise InvalidInputError(f"points must be {wanted}; found {_short(points)}")
    for name, position in points.items():
        numbers = position if isinstance(position, list) and len(position) == 3 else ["none"]
        if position is not None and not all(type(number) in (int, float) for number in numbers):
            wanted = "three numbers such as [0.1, 0.2, 0.3], or null"
            raise InvalidInputError(f"points[{_short(name)}] must be {wanted}; found {_short(position)}")
    positions = as_frame(points, names)
    assert positions is not None
    return Frame(float(t), positions)


def encoded(**content: Any) -> bytes:
    """Encode an answer as a line of JSON."""
    return json.dumps(content, allow_nan=False).encode() + b"\n"


def _refuse_constant(name: str) -> NoReturn:
    raise InvalidInputError(f"JSON has no number {name}; a point that is not seen is null, or absent")


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    content = dict(pairs)
    if len(content) != len(pairs):
        (twice, _), *_ = Counter(name for name, _ in pairs).most_common(1)
        raise InvalidInputError(f"each name may occur once in an object; found {_short(twice)} more than once")
    return content


def _short(value: Any, length: int = 80) -> str:
    """Return a short form of a JSON value; for objects and lists their sizes."""
    if isinstance(value, dict | list):
        return f"{'an object' if isinstance(value, dict) else 'a list'} of {len(value)}"
    return json.dumps(value if not isinstance(value, str) else value[:length], ensure_ascii=False)[:length]
