"""What something is, as a number: two things with one digest give one result, whatever they are called."""

import hashlib
import inspect
import pickle
from collections.abc import Callable, Mapping, Set
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

from maniport.bodies import Arm
from maniport.demonstrations import Recording

LETTERS = 32
"""Of a digest: 128 bits."""

PIECE = 1 << 20
"""Bytes of a file that are read at a time."""

LONGEST = 200
"""Characters of a setting that is stored as text; longer ones are stored as a digest."""

NOT_CONTENT = {"source", "shapes", "notes"}
"""Fields that say where something came from. What links look like counts by the hulls of `Collisions`."""


def digest(*things: Any) -> str:
    """Return a digest of values, arrays, arms, settings, and, of a `Path`, of all that stands in the file or folder."""
    found = hashlib.sha256()
    for thing in things:
        _feed(found.update, thing)
    return found.hexdigest()[:LETTERS]


def as_setting(value: Any) -> str:
    """Return a setting as text, equal for equal settings only: its value, or a name and a digest where that is long."""
    value = value.tolist() if isinstance(value, np.ndarray | np.generic) else value
    text = repr(value) if _is_plain(value) else ""
    label = getattr(value, "name", None) or type(value).__name__
    return text if 0 < len(text) <= LONGEST else f"{label} {digest(value)}"


def _is_plain(value: Any) -> bool:
    if isinstance(value, dict):
        return all(map(_is_plain, (*value, *value.values())))
    if isinstance(value, list | tuple):
        return all(map(_is_plain, value))
    return value is None or isinstance(value, bool | int | float | str)


def _feed(update: Callable[[bytes], None], thing: Any) -> None:
    """Tell what a thing is, each piece with its kind and its length, so that no two things sound alike."""
    if isinstance(thing, Path):
        _feed_file(update, thing)
    elif isinstance(thing, np.ndarray):
        _said(update, "array", f"{thing.dtype.str} {thing.shape}".encode())
        _said(update, "data", np.ascontiguousarray(thing).tobytes())
    elif isinstance(thing, np.generic):
        _feed(update, thing.item())
    elif thing is None or isinstance(thing, bool | int | float | complex | str):
        _said(update, type(thing).__name__, repr(thing).encode())
    elif isinstance(thing, bytes):
        _said(update, "bytes", thing)
    elif isinstance(thing, Mapping):
        _said(update, "mapping", str(len(thing)).encode())
        for key in sorted(thing, key=repr):
            _feed(update, key)
            _feed(update, thing[key])
    elif isinstance(thing, list | tuple | Set):
        _said(update, "sequence", str(len(thing)).encode())
        for one in sorted(thing, key=repr) if isinstance(thing, Set) else thing:
            _feed(update, one)
    elif inspect.isroutine(thing) or inspect.isclass(thing):
        _said(update, "name", f"{thing.__module__}.{thing.__qualname__}".encode())
    else:
        _said(update, "object", f"{type(thing).__module__}.{type(thing).__qualname__}".encode())
        _feed(update, _state(thing))


def _state(thing: Any) -> Any:
    """What an object is made of."""
    if isinstance(thing, Arm):
        return thing.chain
    if is_dataclass(thing):
        told = {one.name: getattr(thing, one.name) for one in fields(thing)}
        return {name: value for name, value in told.items() if name not in NOT_CONTENT or isinstance(thing, Recording)}
    return vars(thing) if hasattr(thing, "__dict__") else pickle.dumps(thing)


def _feed_file(update: Callable[[bytes], None], path: Path) -> None:
    if path.is_dir():
        inside = sorted(one for one in path.iterdir() if not one.name.startswith("."))
        _feed(update, [one.name for one in inside])
        for one in inside:
            _feed_file(update, one)
        return
    if path.exists() and not path.is_file():
        raise OSError(f"{path} is no file")  # a pipe or a device has no end
    _said(update, "file", str(path.stat().st_size).encode())
    with open(path, "rb") as stream:
        while piece := stream.read(PIECE):
            update(piece)


def _said(update: Callable[[bytes], None], kind: str, content: bytes) -> None:
    update(f"{kind} {len(content)}:".encode())
    update(content)
