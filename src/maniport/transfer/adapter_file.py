"""Files of fitted adapters: one ``.npz`` of plain arrays and one line of JSON, without pickled objects.

Every class declares the attributes that its files must hold as `DomainAdapter.schema`.
"""

import inspect
import json
import os
from collections.abc import Callable, Mapping
from dataclasses import asdict, is_dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np

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

FILE_FORMAT = "maniport-adapter-4"

METHODS_BY_CLASS: dict[str, type] = {}  # All classes of adapters by name


class Attribute(NamedTuple):
    """Shape, with names of sizes that must agree, and check of a fitted attribute."""

    shape: tuple[str | int, ...]
    check: Callable[[Any, str], Any]


Schema = dict[str, Attribute]


def _as_text(value: Any, name: str) -> None:
    if not isinstance(value, str):
        raise InvalidInputError(f"{name} must be text; found {type(value).__name__}")


POSITIVE = partial(as_number, above=0.0)
NON_NEGATIVE = partial(as_number, minimum=0.0)
SCHEMA: Schema = {
    "student_mean_": Attribute(("d", "d"), as_spd),
    "teacher_mean_": Attribute(("d", "d"), as_spd),
    "base_rotation_": Attribute(("d", "d"), as_rotation),
    "rotation_": Attribute(("d", "d"), as_rotation),
    "dispersion_ratio_": Attribute((), POSITIVE),
    "history_": Attribute(
        ("iterations",), lambda value, name: as_count(np.size(as_finite(value, name)), name)
    ),
    "cost_": Attribute((), as_number),
    "converged_": Attribute((), as_flag),
    "n_iter_": Attribute((), partial(as_count, minimum=0)),
    "stop_reason_": Attribute((), _as_text),
    **{
        f"{domain}_{name}_": Attribute((), NON_NEGATIVE)
        for domain in ("teacher", "student")
        for name in ("damping", "dispersion")
    },
}
"""Attributes of every adapter."""


def save_adapter(adapter: Any, path: str | os.PathLike[str]) -> None:
    """Write a fitted adapter."""
    fitted = {key: value for key, value in vars(adapter).items() if _is_attribute(key)}
    _require_valid(fitted, adapter.schema)
    arrays: dict[str, Any] = {}
    plain: dict[str, Any] = {
        "format": FILE_FORMAT,
        "method": type(adapter).__name__,
        "parameters": {},
        "fitted": {},
    }
    for group, values in (("parameters", adapter.get_params()), ("fitted", fitted)):
        for key, value in values.items():
            if isinstance(value, list | tuple | np.ndarray):
                arrays[f"{group}.{key}"] = np.asarray(value)
            elif isinstance(value, np.generic):
                plain[group][key] = value.item()
            elif isinstance(value, bool | int | float | str):
                plain[group][key] = value
            elif group == "fitted" and is_dataclass(value) and not isinstance(value, type):
                plain[group][key] = asdict(value)
            else:  # other objects, such as a projector, are no part of the fitted map
                plain[group][key] = None
    save_arrays(path, {"adapter": np.array(json.dumps(plain, sort_keys=True)), **arrays})


def read_adapter(path: str | os.PathLike[str]) -> Any:
    """Read a fitted adapter, see `maniport.transfer.load_adapter`."""
    names = array_names(path, "adapter file")
    if "adapter" not in names:
        raise FileFormatError(f"{str(path)!r} is not an adapter file; it holds {some_of(names)}")
    wanted = [
        key
        for key in names
        if key.startswith("parameters.") or _is_attribute(key.partition("fitted.")[2])
    ]
    arrays = load_arrays(path, "adapter file", ["adapter", *wanted])
    try:
        plain = json.loads(str(arrays.pop("adapter")))
        if (written := plain["format"]) != FILE_FORMAT:
            hint = f"this version reads {FILE_FORMAT!r}: fit the adapter again"
            raise FileFormatError(f"{str(path)!r} has the format {written!r}; {hint}")
        methods: dict[str, Any] = {
            key: kind for key, kind in METHODS_BY_CLASS.items() if not inspect.isabstract(kind)
        }
        method = methods[as_choice(plain["method"], "method", methods)]
        groups = {group: dict(plain[group]) for group in ("parameters", "fitted")}
        for key, value in arrays.items():
            group, _, attribute = key.partition(".")
            groups[group][attribute] = value
        if unknown := set(groups["parameters"]) - set(method().get_params()):
            raise InvalidInputError(f"unknown parameters {sorted(unknown)}")
        if unknown := {key for key in groups["fitted"] if not _is_attribute(key)}:
            raise InvalidInputError(f"unknown attributes {sorted(unknown)}")
        _require_valid(groups["fitted"], method.schema)
        method = method.class_of(groups["fitted"])
        adapter = method(**groups["parameters"])
        Regularization(adapter.damping)  # raises where it is no number
        vars(adapter).update(groups["fitted"])
        adapter._settle()
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


def _is_attribute(name: str) -> bool:
    """Whether a name is that of a fitted attribute."""
    return name.endswith("_") and not name.startswith("_")


def _require_valid(fitted: Mapping[str, Any], schema: Schema) -> None:
    """Raise `InvalidInputError` unless the attributes of a schema are there, of the right shapes, finite and valid."""
    if missing := [name for name in schema if name not in fitted]:
        raise InvalidInputError(f"missing attributes {missing}")
    d = (np.shape(fitted["student_mean_"]) or (0,))[-1]
    sizes = {"d": d, "D": d * (d + 1) // 2}
    for name, (shape, check) in schema.items():
        value = fitted[name]
        if name == "base_rotation_" and value is None:  # the frames are equal
            continue
        if isinstance(value, np.ndarray) and value.dtype != np.float64:
            raise InvalidInputError(f"{name} must hold numbers; found {value.dtype}")
        check(value, name)
        actual = np.shape(value)
        expected = tuple(sizes.get(size, size) if isinstance(size, str) else size for size in shape)
        if len(actual) != len(shape) or any(
            size != length
            for size, length in zip(expected, actual, strict=True)
            if isinstance(size, int)
        ):
            raise InvalidInputError(
                f"{name} must have the shape {expected}; found {actual}".replace("'", "")
            )
        sizes |= {
            size: length
            for size, length in zip(shape, actual, strict=True)
            if isinstance(size, str)
        }
