"""Digests of contents and settings: two things with one digest give one result, whatever they are called."""

import hashlib
import inspect
import pickle
from collections.abc import Mapping, Set
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

from maniport.arms import Arm, ArmGroup
from maniport.mocap import Recording


def digest(*things: Any) -> str:
    """Return 128 bits of SHA-256 of values, arrays, arms and settings, and, of a `Path`, of the file's content."""
    return hashlib.sha256(repr([_described(thing) for thing in things]).encode()).hexdigest()[:32]


def as_setting(value: Any, longest: int = 200) -> str:
    """Return a setting as text, equal for equal settings only: its value, or a name and a digest where that is long."""
    value = value.tolist() if isinstance(value, np.ndarray | np.generic) else value
    text = repr(value) if _is_plain(value) else ""
    label = getattr(value, "name", None) or type(value).__name__
    return text if 0 < len(text) <= longest else f"{label} {digest(value)}"


def _is_plain(value: Any) -> bool:
    if isinstance(value, dict):
        return all(map(_is_plain, (*value, *value.values())))
    if isinstance(value, list | tuple):
        return all(map(_is_plain, value))
    return value is None or isinstance(value, bool | int | float | str)


def _described(thing: Any) -> Any:
    """Return nested tuples and lists of texts and numbers that are equal for equal contents only."""
    if isinstance(thing, Path):
        return "file", _of_file(thing)
    if isinstance(thing, np.ndarray):
        data = np.ascontiguousarray(thing)
        return "array", thing.dtype.str, thing.shape, hashlib.sha256(data.tobytes()).hexdigest()
    if isinstance(thing, np.generic):
        return _described(thing.item())
    if thing is None or isinstance(thing, bool | int | float | complex | str | bytes):
        return type(thing).__name__, thing
    if isinstance(thing, Mapping):
        return "mapping", sorted(((_described(key), _described(value)) for key, value in thing.items()), key=repr)
    if isinstance(thing, Set):
        return "set", sorted(map(_described, thing), key=repr)
    if isinstance(thing, list | tuple):
        return "sequence", [_described(item) for item in thing]
    if inspect.isroutine(thing) or inspect.isclass(thing):
        return "name", f"{thing.__module__}.{thing.__qualname__}"
    return "object", f"{type(thing).__module__}.{type(thing).__qualname__}", _described(_state(thing))


def _state(thing: Any) -> Any:
    """Return the content of an object; its origin counts only for recordings."""
    if isinstance(thing, Arm):
        return thing.chain
    if isinstance(thing, ArmGroup):
        return thing.arms, thing.joint_names
    if is_dataclass(thing):
        names = {field.name for field in fields(thing)}
        if not isinstance(thing, Recording):
            names -= {"source", "shapes", "notes"}  # shapes count by the hulls of `Collisions`
        return {name: getattr(thing, name) for name in names}
    return vars(thing) if hasattr(thing, "__dict__") else pickle.dumps(thing)


def _of_file(path: Path) -> Any:
    """Digest of a file's bytes; of a folder, names and digests of all visible files in it."""
    if path.is_dir():
        inside = sorted(entry for entry in path.iterdir() if not entry.name.startswith("."))
        return [(entry.name, _of_file(entry)) for entry in inside]
    if path.exists() and not path.is_file():
        raise OSError(f"{path} is no file")  # a pipe or a device has no end
    with open(path, "rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
