"""Files of fitted adapters: one ``.npz`` of plain arrays and one line of JSON, without pickled objects.

Every class declares the attributes that its files must hold as `DomainAdapter.schema`.
"""

import inspect
import json
import os
from collections.abc import Callable, Mapping
from dataclasses import asdict, is_dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from maniport.errors import FileFormatError, InvalidInputError, some_of
from maniport.spd.regularization import Regularization
from maniport.util.files import array_names, load_arrays, save_arrays
from maniport.util.validation import (
    as_choice,
    as_count,
    as_finite,
    as_flag,
    as_number,
    as_rotation,
    as_spd,
)

if TYPE_CHECKING:
    from maniport.transfer.adapter import DomainAdapter

FILE_FORMAT = "maniport-adapter-4"

METHODS_BY_CLASS: "dict[str, type[DomainAdapter]]" = {}  # All classes of adapters by name


class Attribute(NamedTuple):
    """Shape, with names of sizes that must agree, and check of a fitted attribute."""

    shape: tuple[str | int, ...]
    check: Callable[[Any, str], object]


Schema = dict[str, Attribute]


def _as_text(value: object, name: str) -> None:
    if not isinstance(value, str):
        raise InvalidInputError(f"{name} must be text; found {type(value).__name__}")


def _as_history(value: Any, name: str) -> None:
    as_count(np.size(as_finite(value, name)), name)


POSITIVE = partial(as_number, above=0.0)
NON_NEGATIVE = partial(as_number, minimum=0.0)
SCHEMA: Schema = {
    "student_mean_": Attribute(("d", "d"), as_spd),
    "teacher_mean_": Attribute(("d", "d"), as_spd),
    "base_rotation_": Attribute(("d", "d"), as_rotation),
    "rotation_": Attribute(("d", "d"), as_rotation),
    "dispersion_ratio_": Attribute((), POSITIVE),
    "history_": Attribute(("iterations",), _as_history),
    "cost_": Attribute((), as_number),
    "converged_": Attribute((), as_flag),
    "n_iter_": Attribute((), partial(as_count, minimum=0)),
    "stop_reason_": Attribute((), _as_text),
    "teacher_damping_": Attribute((), NON_NEGATIVE),
    "teacher_dispersion_": Attribute((), NON_NEGATIVE),
    "student_damping_": Attribute((), NON_NEGATIVE),
    "student_dispersion_": Attribute((), NON_NEGATIVE),
}
"""Attributes of every adapter."""


def save_adapter(adapter: "DomainAdapter", path: str | os.PathLike[str]) -> None:
    """Write a fitted adapter."""
    fitted = {key: value for key, value in vars(adapter).items() if _is_attribute(key)}
    _require_valid(fitted, adapter.schema)
    arrays: dict[str, ArrayLike] = {}
    plain: dict[str, object] = {"format": FILE_FORMAT, "method": type(adapter).__name__}
    for group, values in (("parameters", adapter.get_params()), ("fitted", fitted)):
        plain_values = dict[str, object]()
        for key, value in values.items():
            if isinstance(value, list | tuple | np.ndarray):
                arrays[f"{group}.{key}"] = np.asarray(value)
            elif isinstance(value, np.generic):
                plain_values[key] = value.item()
            elif isinstance(value, bool | int | float | str):
                plain_values[key] = value
            elif group == "fitted" and is_dataclass(value) and not isinstance(value, type):
                plain_values[key] = asdict(value)
            else:  # other objects, such as a projector, are not part of the fitted map
                plain_values[key] = None
        plain[group] = plain_values
    save_arrays(path, {"adapter": np.array(json.dumps(plain, sort_keys=True)), **arrays})


def read_adapter(path: str | os.PathLike[str]) -> "DomainAdapter":
    """Read a fitted adapter, see `maniport.transfer.load_adapter`."""
    names = array_names(path, "adapter file")
    if "adapter" not in names:
        raise FileFormatError(f"{str(path)!r} is not an adapter file; it holds {some_of(names)}")
    wanted = ["adapter"]
    for key in names:
        if key.startswith("parameters.") or _is_attribute(key.partition("fitted.")[2]):
            wanted.append(key)
    arrays = load_arrays(path, "adapter file", wanted)
    try:
        plain = json.loads(str(arrays.pop("adapter")))
        written = plain["format"]
        if written != FILE_FORMAT:
            hint = f"this version reads {FILE_FORMAT!r}: fit the adapter again"
            raise FileFormatError(f"{str(path)!r} has the format {written!r}; {hint}")
        method = _method_named(plain["method"])
        groups = {group: dict(plain[group]) for group in ("parameters", "fitted")}
        for key, value in arrays.items():
            group, _, attribute = key.partition(".")
            groups[group][attribute] = value
        adapter = _restored(method, groups["parameters"], groups["fitted"])
    except FileFormatError:
        raise
    except (
        InvalidInputError,
        KeyError,
        TypeError,
        ValueError,
        OverflowError,
        RecursionError,
    ) as error:
        raise FileFormatError(f"{str(path)!r} is a damaged adapter file: {error}") from None
    return adapter


def _method_named(name: object) -> "type[DomainAdapter]":
    """Return the class of adapters of a name."""
    methods = {}
    for key, kind in METHODS_BY_CLASS.items():
        if not inspect.isabstract(kind):
            methods[key] = kind
    return methods[as_choice(name, "method", methods)]


def _restored(
    method: "type[DomainAdapter]", parameters: dict[str, Any], fitted: dict[str, Any]
) -> "DomainAdapter":
    """Make an adapter of checked parameters and fitted attributes."""
    unknown = set(parameters) - set(method().get_params())
    if unknown:
        raise InvalidInputError(f"unknown parameters {sorted(unknown)}")
    unknown = {key for key in fitted if not _is_attribute(key)}
    if unknown:
        raise InvalidInputError(f"unknown attributes {sorted(unknown)}")
    _require_valid(fitted, method.schema)
    adapter = method.class_of(fitted)(**parameters)
    Regularization(adapter.damping)  # raises where it is no number
    vars(adapter).update(fitted)
    adapter._settle()
    return adapter


def _is_attribute(name: str) -> bool:
    """Whether a name is that of a fitted attribute."""
    return name.endswith("_") and not name.startswith("_")


def _require_valid(fitted: Mapping[str, Any], schema: Schema) -> None:
    """Raise `InvalidInputError` unless the attributes of a schema are there, of the right shapes, finite and valid."""
    missing = [name for name in schema if name not in fitted]
    if missing:
        raise InvalidInputError(f"missing attributes {missing}")
    d = (np.shape(fitted["student_mean_"]) or (0,))[-1]
    sizes: dict[str | int, int] = {"d": d, "D": d * (d + 1) // 2}
    for name, (shape, check) in schema.items():
        value = fitted[name]
        if name == "base_rotation_" and value is None:  # the frames are equal
            continue
        _require_numbers(value, name)
        check(value, name)
        actual = np.shape(value)
        expected = tuple(sizes.get(size, size) for size in shape)
        if not _has_shape(actual, expected):
            raise InvalidInputError(
                f"{name} must have the shape {expected}; found {actual}".replace("'", "")
            )
        for size, length in zip(shape, actual, strict=True):
            if isinstance(size, str):
                sizes[size] = length


def _require_numbers(value: object, name: str) -> None:
    """Raise where an array does not hold numbers of double precision."""
    if isinstance(value, np.ndarray) and value.dtype != np.float64:
        raise InvalidInputError(f"{name} must hold numbers; found {value.dtype}")


def _has_shape(actual: tuple[int, ...], expected: tuple[str | int, ...]) -> bool:
    """Return whether a shape is the expected one, in which names are sizes that are not known yet."""
    if len(actual) != len(expected):
        return False
    pairs = zip(actual, expected, strict=True)
    return not any(isinstance(size, int) and size != length for length, size in pairs)
