"""Files of fitted adapters: one ``.npz`` of plain arrays and one line of JSON, without pickled objects."""

import inspect
import json
import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, fields, is_dataclass
from typing import Any

import numpy as np

from maniport.errors import FileFormatError, InvalidInputError
from maniport.transfer.icp.algorithm import Search
from maniport.transfer.icp.matches import Correspondence
from maniport.transfer.identifiability import Identifiability, Optimum
from maniport.transfer.length_field.report import FieldReport
from maniport.util.files import array_names, load_arrays, save_arrays
from maniport.util.validation import (
    as_count,
    as_finite,
    as_flag,
    as_number,
    as_positive_semidefinite,
    as_rotation,
    as_spd,
)

FILE_FORMAT = "maniport-adapter-2"

METHODS_BY_CLASS: dict[str, type] = {}  # Every class of adapters by its name; each enters itself

Law = Callable[[Any, str], Any]
Schema = dict[str, tuple[tuple[str | int, ...], Law]]


def _non_negative(value: Any, name: str) -> None:
    as_number(value, name, minimum=0.0)


def _positive(value: Any, name: str) -> None:
    as_number(value, name, above=0.0)


def _steps(value: Any, name: str) -> None:
    as_count(value, name, minimum=0)


def _indices(value: Any, name: str) -> None:
    if np.asarray(value).dtype.kind not in "iu" or np.min(value, initial=0) < -1:
        raise InvalidInputError(f"{name} must hold indices")


def _text(value: Any, name: str) -> None:
    if not isinstance(value, str):
        raise InvalidInputError(f"{name} must be text; found {type(value).__name__}")


def _axis(value: Any, name: str) -> None:
    if np.size(value) and (np.size(value) != 3 or abs(np.linalg.norm(as_finite(value, name)) - 1.0) > 1e-9):
        raise InvalidInputError(f"{name} must be a unit vector or empty")


REQUIRED: Schema = {
    "student_mean_": (("d", "d"), as_spd),
    "teacher_mean_": (("d", "d"), as_spd),
    "base_rotation_": (("d", "d"), as_rotation),
    "rotation_": (("d", "d"), as_rotation),
    "dispersion_ratio_": ((), _positive),
    "teacher_damping_": ((), _non_negative),
    "student_damping_": ((), _non_negative),
    "released_damping_": ((), _non_negative),
}
"""Shape, with names of sizes that must agree, and law of the attributes without which there is no fitted adapter."""

OPTIONAL: Schema = {
    "teacher_dispersion_": ((), _non_negative),
    "student_dispersion_": ((), _non_negative),
    "cost_": ((), as_number),
    "history_": (("rounds",), as_finite),
    "converged_": ((), as_flag),
    "n_iter_": ((), _steps),
    "stop_reason_": ((), _text),
    "found_rotation_": (("d", "d"), as_rotation),
    "start_rotation_": (("d", "d"), as_rotation),
    "start_kept_": ((), as_flag),
    "correspondence_": (("matched",), _indices),
    "matched_teacher_": (("matched",), _indices),
    "from_samples_": ((), as_flag),
}
"""Attributes of maniport's methods that are checked where a file has them."""

REQUIRED_BY: dict[str, Schema] = {
    "IdentityMap": {},
    "MeanTransport": {},
    "ParallelTransport": {},
    "RiemannianICP": {},
    "NearestNeighbor": {
        "keys_": (("n", "d", "d"), as_positive_semidefinite),
        "values_": (("n", "d", "d"), as_positive_semidefinite),
    },
    "LengthField": {
        "width_": ((), _positive),
        "centers_": (("m", "D"), as_finite),
        "lengths_": (("m", 3), as_finite),
        "axis_": (("axis",), _axis),
    },
}
"""Further required attributes of maniport's methods; those of any other class are written and read as they are."""

KNOWLEDGE = {
    "rotation": ("d", "d"),
    "curvature": ("k",),
    "standard_error": ("k",),
    "directions": ("k", "k"),
    "flat": ("k",),
    "axes": ("a", "b"),
    "resampled": ("r", "e", "e"),
    "optima.rotation": ("o", "d", "d"),
    "optima.cost": ("o",),
    "optima.cloud_distance": ("o",),
    "optima.n_starts": ("o",),
}
"""Shapes of the arrays of an `Identifiability` and of its optima."""


def save_adapter(adapter: Any, path: str | os.PathLike[str]) -> None:
    """Write a fitted adapter."""
    fitted = {key: value for key, value in vars(adapter).items() if key.endswith("_") and not key.startswith("_")}
    _require_fitted(type(adapter), fitted)
    arrays: dict[str, Any] = {}
    plain: dict[str, Any] = {"format": FILE_FORMAT, "method": type(adapter).__name__, "parameters": {}, "fitted": {}}
    for group, values in (("parameters", adapter.get_params(deep=False)), ("fitted", fitted)):
        for key, value in values.items():
            if isinstance(value, FieldReport):
                plain[group][key] = asdict(value)
            elif isinstance(value, Identifiability):
                arrays |= _knowledge_arrays(value)
            elif isinstance(value, (list, tuple, np.ndarray)):
                arrays[f"{group}.{key}"] = np.asarray(value)
            elif isinstance(value, (Search, Correspondence)):
                plain[group][key] = _plain_options(value)
            elif isinstance(value, np.random.Generator) or key == "projector":
                plain[group][key] = None  # it says nothing about the fitted map
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
        found, name = plain["format"], str(plain["method"])
        groups: dict[str, dict[str, Any]] = {
            "parameters": {key: _options_from(value) for key, value in dict(plain["parameters"]).items()},
            "fitted": dict(plain["fitted"]),
            "identifiability": {},
        }
    except (KeyError, TypeError, ValueError, RecursionError) as error:
        raise FileFormatError(f"{damaged}: {error}") from None
    if found != FILE_FORMAT:
        raise FileFormatError(f"{str(path)!r} has the format {found!r}; this version reads {FILE_FORMAT!r}")
    known = {key: kind for key, kind in METHODS_BY_CLASS.items() if not inspect.isabstract(kind)}
    if name not in known:
        raise FileFormatError(f"{str(path)!r} holds a {name!r}; this version knows {sorted(known)}")
    method = known[name]
    parameters, fitted = groups["parameters"], groups["fitted"]
    if unknown := set(parameters) - set(method().get_params()):
        raise FileFormatError(f"{damaged}: unknown parameters {sorted(unknown)}")
    wanted = [key for key in names if _is_known(key, method)]
    for key, value in load_arrays(path, "adapter file", wanted).items():
        group, _, attribute = key.partition(".")
        groups[group][attribute] = value
    try:
        _require_fitted(method, fitted)
        if groups["identifiability"]:
            fitted["identifiability_"] = _knowledge_from(groups["identifiability"])
        if "report_" in fitted:
            fitted["report_"] = FieldReport.read(fitted["report_"])
    except (InvalidInputError, KeyError, TypeError, ValueError, OverflowError) as error:
        raise FileFormatError(f"{damaged}: {error}") from None
    adapter = method(**parameters)
    for attribute, value in fitted.items():
        setattr(adapter, attribute, value)
    return adapter


def _is_shipped(method: type) -> bool:
    return method.__module__.startswith("maniport.") and method.__name__ in REQUIRED_BY


def _schema_of(method: type) -> Schema:
    """Required attributes of a class of adapters, and the optional ones of a method of maniport."""
    return REQUIRED | OPTIONAL | REQUIRED_BY[method.__name__] if _is_shipped(method) else REQUIRED


def _is_known(key: str, method: type) -> bool:
    """Whether an array of a file is read; others are not even unpacked."""
    group, _, name = key.partition(".")
    if group == "fitted":
        return name in _schema_of(method) or not _is_shipped(method)
    return name in KNOWLEDGE if group == "identifiability" else group == "parameters"


def _require_fitted(method: type, fitted: Mapping[str, Any]) -> None:
    """Raise `InvalidInputError` unless the fitted attributes are complete, of the right shapes, finite and lawful."""
    schema = _schema_of(method)
    if missing := [name for name in schema if name not in OPTIONAL and name not in fitted]:
        raise InvalidInputError(f"missing attributes {missing}")
    d = (np.shape(fitted["student_mean_"]) or (0,))[-1]
    sizes: dict[str | int, int] = {"d": d, "D": d * (d + 1) // 2, 3: 3}
    for name, (shape, law) in schema.items():
        if name not in fitted or (name == "base_rotation_" and fitted[name] is None):
            continue
        value = np.asarray(fitted[name])
        agrees = len(value.shape) == len(shape) and all(
            sizes.get(size, found) == found for size, found in zip(shape, value.shape, strict=True)
        )
        numeric = (
            law in (_text, as_flag, _indices) or value.dtype == np.float64 or (not shape and value.dtype.kind in "iu")
        )
        if not agrees or not numeric:
            wanted = str(tuple(sizes.get(size, size) for size in shape)).replace("'", "")
            raise InvalidInputError(
                f"{name} must be finite, of shape {wanted}; found {value.dtype} values of shape {value.shape}"
            )
        sizes |= dict(zip(shape, value.shape, strict=True))
        law(fitted[name], name)


def _option_classes(base: type) -> Iterator[type]:
    kind: type
    for kind in base.__subclasses__():
        yield kind
        yield from _option_classes(kind)


def _option_name(kind: type) -> str:
    """Name of a class of options in files; those from outside of maniport with their module."""
    return kind.__name__ if kind.__module__.startswith("maniport.") else f"{kind.__module__}.{kind.__qualname__}"


def _plain_options(value: Search | Correspondence) -> dict[str, Any]:
    """Class and options of an object where these are numbers and words; else no options."""
    options: dict[str, Any] = {f.name: getattr(value, f.name) for f in fields(value)} if is_dataclass(value) else {}
    options = {name: one.item() if isinstance(one, np.generic) else one for name, one in options.items()}
    held = is_dataclass(value) and all(isinstance(one, (bool, int, float, str, type(None))) for one in options.values())
    return {"class": _option_name(type(value)), "options": options if held else None}


def _options_from(value: Any) -> Any:
    """Return the object of `_plain_options`; its name where the class is unknown or its options were not held."""
    if not isinstance(value, dict):
        return value
    known: dict[str, type] = {_option_name(one): one for one in (Search, *_option_classes(Correspondence))}
    kind, options = known.get(value["class"]), value["options"]
    if kind is None or options is None:
        return str(value["class"])
    return kind(**options)


def _knowledge_arrays(knowledge: Identifiability) -> dict[str, Any]:
    """Arrays of an `Identifiability`; the optima become one array for each of their attributes."""
    found = {}
    for key in KNOWLEDGE:
        group, _, name = key.rpartition(".")
        found[key] = np.array([getattr(one, name) for one in knowledge.optima]) if group else getattr(knowledge, name)
    return {f"identifiability.{key}": value for key, value in found.items()}


def _knowledge_from(arrays: dict[str, Any]) -> Identifiability:
    """Check the arrays of an `Identifiability` and return it."""
    sizes: dict[str, int] = {}
    if set(arrays) != set(KNOWLEDGE):
        raise InvalidInputError(f"identifiability holds {sorted(arrays)}; needed are {sorted(KNOWLEDGE)}")
    for name, shape in KNOWLEDGE.items():
        value = np.asarray(arrays[name])
        if len(value.shape) != len(shape) or any(
            sizes.setdefault(size, found) != found for size, found in zip(shape, value.shape, strict=True)
        ):
            raise InvalidInputError(
                f"identifiability.{name} has shape {value.shape}; the others need {shape} of {sizes}"
            )
        kind: Any = bool if name == "flat" else value.dtype if name == "optima.n_starts" else np.float64
        if value.dtype != kind:
            raise InvalidInputError(f"identifiability.{name} holds {value.dtype} values")
        if value.size and name != "flat":
            as_finite(value, f"identifiability.{name}")
    columns = [arrays[f"optima.{field.name}"] for field in fields(Optimum)]
    optima = tuple(
        Optimum(rotation, float(cost), float(distance), int(count))
        for rotation, cost, distance, count in zip(*columns, strict=True)
    )
    return Identifiability(optima=optima, **{key: value for key, value in arrays.items() if "." not in key})
