"""Files of fitted adapters: one ``.npz`` of plain arrays and one line of JSON, without pickled objects."""

import inspect
import json
import os
from collections.abc import Mapping
from dataclasses import asdict, fields
from typing import Any

import numpy as np

from maniport.errors import FileFormatError
from maniport.files import load_arrays, save_arrays
from maniport.transfer.icp.correspondence.contract import Options, options_from
from maniport.transfer.identifiability import Identifiability, Optimum
from maniport.transfer.lengths.report import FieldReport

FILE_FORMAT = "maniport-adapter-2"

REQUIRED = (
    "mounting_",
    "rotation_",
    "dispersion_ratio_",
    "teacher_mean_",
    "student_mean_",
    "teacher_damping_",
    "student_damping_",
    "released_damping_",
)
"""Attributes without which a file holds no fitted adapter."""

METHODS_BY_CLASS: dict[str, type] = {}
"""Every class of adapters by its name; each enters itself."""


def save_adapter(adapter: Any, path: str | os.PathLike[str]) -> None:
    """Write a fitted adapter."""
    parameters = adapter.get_params(deep=False)
    fitted = {key: value for key, value in vars(adapter).items() if key.endswith("_") and not key.startswith("_")}
    arrays: dict[str, Any] = {}
    plain: dict[str, Any] = {"format": FILE_FORMAT, "method": type(adapter).__name__, "parameters": {}, "fitted": {}}
    for group, values in (("parameters", parameters), ("fitted", fitted)):
        for key, value in values.items():
            if isinstance(value, FieldReport):
                plain[group][key] = asdict(value)
            elif isinstance(value, Identifiability):
                arrays |= _arrays(value)
            elif isinstance(value, (list, tuple, np.ndarray)):
                arrays[f"{group}.{key}"] = np.asarray(value)
            elif isinstance(value, Options):
                plain[group][key] = value.plain()
            elif isinstance(value, np.random.Generator) or key == "projector":
                plain[group][key] = None  # it says nothing about the fitted map
            else:
                plain[group][key] = value.item() if isinstance(value, np.generic) else value
    save_arrays(path, {"adapter": np.array(json.dumps(plain, sort_keys=True)), **arrays})


def read_adapter(path: str | os.PathLike[str]) -> Any:
    """Read a fitted adapter; see `maniport.load_adapter`."""
    arrays = load_arrays(path, "adapter file")
    if "adapter" not in arrays:
        raise FileFormatError(f"{str(path)!r} is not an adapter file; it holds the arrays {sorted(arrays)}")
    try:
        plain = json.loads(str(arrays.pop("adapter")))
        found, method = plain["format"], str(plain["method"])
        fitted, stored = dict(plain["fitted"]), dict(plain["parameters"])
        parameters = {key: options_from(value) if isinstance(value, dict) else value for key, value in stored.items()}
    except (KeyError, TypeError, ValueError) as error:
        raise FileFormatError(f"{str(path)!r} is a damaged adapter file: {error}") from None
    if found != FILE_FORMAT:
        raise FileFormatError(f"{str(path)!r} has the format {found!r}; this version reads {FILE_FORMAT!r}")
    known = {name: kind for name, kind in METHODS_BY_CLASS.items() if not inspect.isabstract(kind)}
    if method not in known:
        raise FileFormatError(f"{str(path)!r} holds a {method!r}; this version knows {sorted(known)}")
    groups: dict[str, dict[str, Any]] = {"parameters": parameters, "fitted": fitted, "identifiability": {}}
    for key, value in arrays.items():
        group, _, name = key.partition(".")
        groups.get(group, fitted)[name] = value
    knowledge = groups["identifiability"]
    unknown, missing = set(parameters) - set(known[method]().get_params()), set(REQUIRED) - set(fitted)
    if unknown or missing:
        raise FileFormatError(
            f"{str(path)!r} is a damaged adapter file: unknown parameters {sorted(unknown)}, "
            f"missing attributes {sorted(missing)}"
        )
    _require_shapes(path, fitted)
    adapter = known[method](**parameters)
    for name, value in fitted.items():
        setattr(adapter, name, value)
    if "report_" in fitted:
        adapter.report_ = FieldReport.read(path, fitted["report_"])
    if knowledge:
        adapter.identifiability_ = _identifiability(path, knowledge)
    return adapter


def _require_shapes(path: str | os.PathLike[str], fitted: Mapping[str, Any]) -> None:
    """Raise unless every matrix of the contract is d×d and every number one, all finite."""
    d = (np.shape(fitted["student_mean_"]) or (0,))[-1]
    for name in REQUIRED:
        wanted = () if name.endswith(("ratio_", "damping_")) else (d, d)
        value = np.asarray(fitted[name])
        if name == "mounting_" and fitted[name] is None:
            continue
        if value.dtype.kind not in "iuf" or value.shape != wanted or not np.all(np.isfinite(value)):
            raise FileFormatError(f"{str(path)!r} is a damaged adapter file: {name} must be finite, of shape {wanted}")


def _arrays(knowledge: Identifiability) -> dict[str, Any]:
    """What is known about the rotation, as arrays; the optima become one array for each of their attributes."""
    values = {field.name: getattr(knowledge, field.name) for field in fields(knowledge) if field.name != "optima"}
    values |= {
        f"optima.{field.name}": np.array([getattr(one, field.name) for one in knowledge.optima])
        for field in fields(Optimum)
    }
    return {f"identifiability.{name}": value for name, value in values.items()}


def _identifiability(path: str | os.PathLike[str], arrays: dict[str, Any]) -> Identifiability:
    names = [field.name for field in fields(Optimum)]
    try:
        columns = [arrays.pop(f"optima.{name}") for name in names]
        optima = tuple(
            Optimum(rotation, float(cost), float(distance), int(count))
            for rotation, cost, distance, count in zip(*columns, strict=True)
        )
        return Identifiability(optima=optima, **arrays)
    except (KeyError, TypeError, ValueError) as error:
        raise FileFormatError(f"{str(path)!r} is a damaged adapter file: {error}") from None
