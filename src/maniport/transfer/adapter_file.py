"""Files of fitted adapters: one ``.npz`` of plain arrays and one line of JSON, without pickled objects."""

import inspect
import json
import os
from collections.abc import Collection
from dataclasses import asdict, fields
from typing import Any

import numpy as np

from maniport.errors import FileFormatError, InvalidInputError
from maniport.files import array_names, load_arrays, save_arrays
from maniport.transfer.adapter_schema import require_fitted, require_knowledge, schema_of
from maniport.transfer.icp.correspondence.contract import Options, options_from
from maniport.transfer.identifiability import Identifiability, Optimum
from maniport.transfer.lengths.report import FieldReport

FILE_FORMAT = "maniport-adapter-2"

METHODS_BY_CLASS: dict[str, type] = {}
"""Every class of adapters by its name; each enters itself."""


def save_adapter(adapter: Any, path: str | os.PathLike[str]) -> None:
    """Write a fitted adapter."""
    parameters = adapter.get_params(deep=False)
    fitted = {key: value for key, value in vars(adapter).items() if key.endswith("_") and not key.startswith("_")}
    require_fitted(type(adapter), fitted)
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
    names = array_names(path, "adapter file")
    if "adapter" not in names:
        raise FileFormatError(f"{str(path)!r} is not an adapter file; it holds the arrays {names}")
    description = str(load_arrays(path, "adapter file", ("adapter",))["adapter"])
    try:
        plain = json.loads(description)
        found, method = plain["format"], str(plain["method"])
        fitted, stored = dict(plain["fitted"]), dict(plain["parameters"])
        parameters = {key: options_from(value) if isinstance(value, dict) else value for key, value in stored.items()}
    except (KeyError, TypeError, ValueError, RecursionError) as error:
        raise FileFormatError(f"{str(path)!r} is a damaged adapter file: {error}") from None
    if found != FILE_FORMAT:
        raise FileFormatError(f"{str(path)!r} has the format {found!r}; this version reads {FILE_FORMAT!r}")
    known = {name: kind for name, kind in METHODS_BY_CLASS.items() if not inspect.isabstract(kind)}
    if method not in known:
        raise FileFormatError(f"{str(path)!r} holds a {method!r}; this version knows {sorted(known)}")
    allowed = set(known[method]().get_params())
    groups: dict[str, dict[str, Any]] = {"parameters": parameters, "fitted": fitted, "identifiability": {}}
    wanted = [name for name in names if _is_known(name, allowed, known[method])]
    for key, value in load_arrays(path, "adapter file", wanted).items():
        group, _, name = key.partition(".")
        groups[group][name] = value
    knowledge = groups["identifiability"]
    if unknown := set(parameters) - allowed:
        raise FileFormatError(f"{str(path)!r} is a damaged adapter file: unknown parameters {sorted(unknown)}")
    try:
        require_fitted(known[method], fitted)
    except (InvalidInputError, TypeError, OverflowError) as error:
        raise FileFormatError(f"{str(path)!r} is a damaged adapter file: {error}") from None
    adapter = known[method](**parameters)
    for name, value in fitted.items():
        setattr(adapter, name, value)
    if "report_" in fitted:
        adapter.report_ = FieldReport.read(path, fitted["report_"])
    if knowledge:
        adapter.identifiability_ = _identifiability(path, knowledge)
    return adapter


def _is_known(key: str, parameters: Collection[str], method: type) -> bool:
    """Whether an array of a file is read; others are not even unpacked."""
    group, _, name = key.partition(".")
    if group == "fitted":
        schema = schema_of(method)
        return schema is None or name in schema
    if group == "identifiability":
        return name.removeprefix("optima.") in {
            field.name for kind in (Identifiability, Optimum) for field in fields(kind)
        }
    return group == "parameters" and name in parameters


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
        require_knowledge(arrays)
        columns = [arrays.pop(f"optima.{name}") for name in names]
        optima = tuple(
            Optimum(rotation, float(cost), float(distance), int(count))
            for rotation, cost, distance, count in zip(*columns, strict=True)
        )
        return Identifiability(optima=optima, **arrays)
    except (KeyError, TypeError, ValueError) as error:
        raise FileFormatError(f"{str(path)!r} is a damaged adapter file: {error}") from None
