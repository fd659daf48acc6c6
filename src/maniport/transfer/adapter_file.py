"""Files of fitted adapters: one ``.npz`` of plain arrays and one line of JSON, without pickled objects.

Every class declares the attributes that its files hold as `DomainAdapter.schema`.
"""

import inspect
import json
import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import fields, is_dataclass
from typing import Any, NamedTuple

import numpy as np

from maniport.errors import FileFormatError, InvalidInputError
from maniport.util.files import array_names, load_arrays, save_arrays
from maniport.util.validation import as_count, as_finite, as_flag, as_number, as_rotation, as_spd

FILE_FORMAT = "maniport-adapter-3"

METHODS_BY_CLASS: dict[str, type] = {}  # All classes of adapters by name


def non_negative(value: Any, name: str) -> float:
    """Require a number of at least zero."""
    return as_number(value, name, minimum=0.0)


def positive(value: Any, name: str) -> float:
    """Require a number above zero."""
    return as_number(value, name, above=0.0)


def as_indices(value: Any, name: str) -> None:
    """Require whole numbers of at least −1."""
    if np.asarray(value).dtype.kind not in "iu" or np.min(value, initial=0) < -1:
        raise InvalidInputError(f"{name} must hold indices")


def as_text(value: Any, name: str) -> None:
    """Require a string."""
    if not isinstance(value, str):
        raise InvalidInputError(f"{name} must be text; found {type(value).__name__}")


class Attribute(NamedTuple):
    """Shape, with names of sizes that must agree, and check of a fitted attribute; `optional` ones may be missing."""

    shape: tuple[str | int, ...]
    check: Callable[[Any, str], Any]
    optional: bool = False


Schema = dict[str, Attribute]

SCHEMA: Schema = {
    "student_mean_": Attribute(("d", "d"), as_spd),
    "teacher_mean_": Attribute(("d", "d"), as_spd),
    "base_rotation_": Attribute(("d", "d"), as_rotation),
    "rotation_": Attribute(("d", "d"), as_rotation),
    "dispersion_ratio_": Attribute((), positive),
    "teacher_damping_": Attribute((), non_negative),
    "student_damping_": Attribute((), non_negative),
    "released_damping_": Attribute((), non_negative),
    "teacher_dispersion_": Attribute((), non_negative, optional=True),
    "student_dispersion_": Attribute((), non_negative, optional=True),
    "cost_": Attribute((), as_number, optional=True),
    "history_": Attribute(("iterations",), as_finite, optional=True),
    "converged_": Attribute((), as_flag, optional=True),
    "n_iter_": Attribute((), lambda value, name: as_count(value, name, minimum=0), optional=True),
    "stop_reason_": Attribute((), as_text, optional=True),
}
"""Attributes of every adapter."""


def save_adapter(adapter: Any, path: str | os.PathLike[str]) -> None:
    """Write a fitted adapter."""
    fitted = {key: value for key, value in vars(adapter).items() if key.endswith("_") and not key.startswith("_")}
    _require_complete(type(adapter), fitted)
    for key in adapter.value_objects.keys() & fitted.keys():  # one entry for each of their fields
        value = fitted.pop(key)
        fitted |= {f"{key}.{field.name}": getattr(value, field.name) for field in fields(value)}
    arrays: dict[str, Any] = {}
    plain: dict[str, Any] = {"format": FILE_FORMAT, "method": type(adapter).__name__, "parameters": {}, "fitted": {}}
    for group, values in (("parameters", adapter.get_params(deep=False)), ("fitted", fitted)):
        for key, value in values.items():
            if isinstance(value, list | tuple | np.ndarray):
                arrays[f"{group}.{key}"] = np.asarray(value)
            elif isinstance(value, adapter.option_classes):
                plain[group][key] = _plain_options(value)
            elif isinstance(value, np.random.Generator) or key == "projector":
                plain[group][key] = None  # not part of the fitted map
            else:
                plain[group][key] = value.item() if isinstance(value, np.generic) else value
    save_arrays(path, {"adapter": np.array(json.dumps(plain, sort_keys=True)), **arrays})


def read_adapter(path: str | os.PathLike[str]) -> Any:
    """Read a fitted adapter; see `maniport.load_adapter`."""
    names = array_names(path, "adapter file")
    if "adapter" not in names:
        raise FileFormatError(f"{str(path)!r} is not an adapter file; it holds the arrays {names}")
    damaged = f"{str(path)!r} is a damaged adapter file"
    description = str(load_arrays(path, "adapter file", ("adapter",))["adapter"])
    try:
        plain = json.loads(description)
        file_format, name = plain["format"], str(plain["method"])
        groups = {group: dict(plain[group]) for group in ("parameters", "fitted")}
    except (KeyError, TypeError, ValueError, RecursionError) as error:
        raise FileFormatError(f"{damaged}: {error}") from None
    if file_format != FILE_FORMAT:
        raise FileFormatError(f"{str(path)!r} has the format {file_format!r}; this version reads {FILE_FORMAT!r}")
    methods = {key: kind for key, kind in METHODS_BY_CLASS.items() if not inspect.isabstract(kind)}
    if name not in methods:
        raise FileFormatError(f"{str(path)!r} holds a {name!r}; allowed are {sorted(methods)}")
    method: Any = methods[name]
    if unknown := set(groups["parameters"]) - set(method().get_params()):
        raise FileFormatError(f"{damaged}: unknown parameters {sorted(unknown)}")
    for key, value in load_arrays(path, "adapter file", [key for key in names if _is_declared(key, method)]).items():
        group, _, attribute = key.partition(".")
        groups[group][attribute] = value
    parameters, fitted = groups["parameters"], groups["fitted"]
    try:
        parameters = {key: _options(value, method.option_classes) for key, value in parameters.items()}
        for key, kind in method.value_objects.items():
            parts = {entry: fitted.pop(entry) for entry in list(fitted) if entry.startswith(f"{key}.")}
            if parts:
                fitted[key] = kind.read({entry.removeprefix(f"{key}."): value for entry, value in parts.items()})
        if undeclared := sorted(key for key in fitted if not _is_declared(f"fitted.{key}", method)):
            raise InvalidInputError(f"unknown attributes {undeclared}")
        _require_complete(method, fitted)
    except (InvalidInputError, KeyError, TypeError, ValueError, OverflowError) as error:
        raise FileFormatError(f"{damaged}: {error}") from None
    adapter = method(**parameters)
    for attribute, value in fitted.items():
        setattr(adapter, attribute, value)
    return adapter


def _is_declared(key: str, method: Any) -> bool:
    """Whether an entry is read; a method outside of maniport may have undeclared attributes, which end in ``_``."""
    group, _, name = key.partition(".")
    attribute = name.partition(".")[0]
    if group != "fitted":
        return group == "parameters"
    if method.__module__.startswith("maniport."):
        return name in method.schema or attribute in method.value_objects
    return attribute.endswith("_") and not attribute.startswith("_")


def _require_complete(method: Any, fitted: Mapping[str, Any]) -> None:
    """Raise `InvalidInputError` unless the declared attributes are there, of the right shapes, finite and valid."""
    if missing := [name for name, entry in method.schema.items() if not entry.optional and name not in fitted]:
        raise InvalidInputError(f"missing attributes {missing}")
    d = (np.shape(fitted["student_mean_"]) or (0,))[-1]
    declared = {name: fitted[name] for name in method.schema if name in fitted}
    if declared["base_rotation_"] is None:  # the frames are equal
        del declared["base_rotation_"]
    require_arrays(declared, method.schema, {"d": d, "D": d * (d + 1) // 2})


def require_arrays(values: Mapping[str, Any], schema: Schema, sizes: dict[str | int, int] | None = None) -> None:
    """Raise `InvalidInputError` unless values have the shapes and types of a schema and pass its checks."""
    known_sizes: dict[str | int, int] = dict(sizes or {})
    for name, value in values.items():
        shape, check, _ = schema[name]
        array = np.asarray(value)
        agrees = array.ndim == len(shape) and all(
            known_sizes.get(size, size if isinstance(size, int) else length) == length
            for size, length in zip(shape, array.shape, strict=True)
        )
        numeric = array.dtype == np.float64 or (not shape and array.dtype.kind in "iu")
        if not agrees or not (numeric or check in (as_text, as_flag, as_flags, as_indices)):
            expected = str(tuple(known_sizes.get(size, size) for size in shape)).replace("'", "")
            raise InvalidInputError(
                f"{name} must be finite, of shape {expected}; found {array.dtype} values of shape {array.shape}"
            )
        known_sizes |= dict(zip(shape, array.shape, strict=True))
        check(value, name)


def as_flags(value: Any, name: str) -> None:
    """Require an array of truth values."""
    if np.asarray(value).dtype != np.bool_:
        raise InvalidInputError(f"{name} must hold truth values; found {np.asarray(value).dtype}")


def _subclasses(base: type) -> Iterator[type]:
    kind: type
    yield base
    for kind in base.__subclasses__():
        yield from _subclasses(kind)


def _option_name(kind: type) -> str:
    """Name of a class of options in files; those from outside of maniport with their module."""
    return kind.__name__ if kind.__module__.startswith("maniport.") else f"{kind.__module__}.{kind.__qualname__}"


def _plain_options(value: Any) -> dict[str, Any]:
    """Class and options of an object; no options where these are not only numbers and text."""
    options = {field.name: getattr(value, field.name) for field in fields(value)} if is_dataclass(value) else {}
    options = {name: option.item() if isinstance(option, np.generic) else option for name, option in options.items()}
    plain = is_dataclass(value) and all(
        isinstance(option, bool | int | float | str | None) for option in options.values()
    )
    return {"class": _option_name(type(value)), "options": options if plain else None}


def _options(value: Any, bases: tuple[type, ...]) -> Any:
    """Return the object of `_plain_options`; its name where the class or the options are unknown."""
    if not isinstance(value, dict):
        return value
    kinds: dict[str, Any] = {_option_name(kind): kind for base in bases for kind in _subclasses(base)}
    kind: Any = kinds.get(value["class"])
    options = value["options"]
    return str(value["class"]) if kind is None or options is None else kind(**options)
