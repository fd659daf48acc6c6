"""What a fitted adapter holds: name, shape and law of every attribute, for writing and for reading."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from maniport.errors import InvalidInputError
from maniport.validation import (
    as_count,
    as_finite,
    as_flag,
    as_number,
    as_points,
    as_positive_semidefinite,
    as_rotation,
)


@dataclass(frozen=True)
class Attribute:
    """Shape, with names of sizes that must agree among all attributes, and law of one attribute."""

    shape: tuple[str | int, ...]
    law: Callable[[Any, str], Any]


def _non_negative(value: Any, name: str) -> float:
    return as_number(value, name, minimum=0.0)


def _positive(value: Any, name: str) -> float:
    return as_number(value, name, above=0.0)


def _indices(value: Any, name: str) -> None:
    if np.asarray(value).dtype.kind not in "iu" or np.min(value, initial=0) < -1:
        raise InvalidInputError(f"{name} must hold indices")


def _text(value: Any, name: str) -> None:
    if not isinstance(value, str):
        raise InvalidInputError(f"{name} must be text; found {type(value).__name__}")


def _several(value: Any, name: str) -> None:
    as_positive_semidefinite(value, name)


def _mean(value: Any, name: str) -> None:
    as_points(np.asarray(value)[None], name, minimum=1)


def _steps(value: Any, name: str) -> None:
    as_count(value, name, minimum=0)


def _axis(value: Any, name: str) -> None:
    if np.size(value) and (np.size(value) != 3 or abs(np.linalg.norm(as_finite(value, name)) - 1.0) > 1e-9):
        raise InvalidInputError(f"{name} must be a unit vector or empty")


COMMON = {
    "mounting_": Attribute(("d", "d"), as_rotation), "rotation_": Attribute(("d", "d"), as_rotation),
    "teacher_mean_": Attribute(("d", "d"), _mean), "student_mean_": Attribute(("d", "d"), _mean),
    "teacher_damping_": Attribute((), _non_negative), "student_damping_": Attribute((), _non_negative),
    "released_damping_": Attribute((), _non_negative), "dispersion_ratio_": Attribute((), _positive),
    "teacher_dispersion_": Attribute((), _non_negative), "student_dispersion_": Attribute((), _non_negative),
    "cost_": Attribute((), as_number), "history_": Attribute(("rounds",), as_finite),
    "converged_": Attribute((), as_flag), "n_iter_": Attribute((), _steps), "stop_reason_": Attribute((), _text),
}  # fmt: skip
"""Attributes of every method."""

BY_CLASS: dict[str, dict[str, Attribute]] = {
    "RawCopy": {}, "Recentring": {}, "ParallelTransport": {},
    "NearestNeighbor": {
        "keys_": Attribute(("n", "d", "d"), _several), "values_": Attribute(("n", "d", "d"), _several),
    },
    "RiemannianICP": {
        "found_rotation_": Attribute(("d", "d"), as_rotation), "start_rotation_": Attribute(("d", "d"), as_rotation),
        "start_kept_": Attribute((), as_flag), "correspondence_": Attribute(("matched",), _indices),
        "matched_teacher_": Attribute(("matched",), _indices),
    },
    "LengthsField": {
        "width_": Attribute((), _positive), "centers_": Attribute(("m", "D"), as_finite),
        "lengths_": Attribute(("m", 3), as_finite), "turns_": Attribute(("turns", "D"), as_finite),
        "axis_": Attribute(("axis",), _axis), "from_samples_": Attribute((), as_flag),
    },
}  # fmt: skip
"""Further attributes of maniport's methods by class; those of any other class are written and read as they are."""

REQUIRED = (
    "mounting_", "rotation_", "dispersion_ratio_", "teacher_mean_", "student_mean_", "teacher_damping_",
    "student_damping_", "released_damping_",
)  # fmt: skip
"""Attributes without which there is no fitted adapter."""

REQUIRED_BY = {
    "NearestNeighbor": ("keys_", "values_"),
    "LengthsField": ("centers_", "lengths_", "turns_", "width_"),
}
"""Attributes without which the map of a method is not whole."""


def require_fitted(method: type, fitted: Mapping[str, Any]) -> None:
    """Raise `InvalidInputError` unless what a method has fitted is whole, of the right shapes, finite and lawful."""
    schema = schema_of(method)
    needed = REQUIRED if schema is None else (*REQUIRED, *REQUIRED_BY.get(method.__name__, ()))
    missing = [name for name in needed if name not in fitted]
    if missing:
        raise InvalidInputError(f"missing attributes {missing}")
    d = (np.shape(fitted["student_mean_"]) or (0,))[-1]
    sizes: dict[str | int, int] = {"d": d, "D": d * (d + 1) // 2}
    for name, attribute in ({name: COMMON[name] for name in REQUIRED} if schema is None else schema).items():
        if name not in fitted or (name == "mounting_" and fitted[name] is None):
            continue
        value = fitted[name]
        shape = np.shape(value)
        wanted = tuple(size if isinstance(size, int) else sizes.get(size) for size in attribute.shape)
        if len(shape) != len(wanted) or any(
            size not in (None, found) for size, found in zip(wanted, shape, strict=True)
        ):
            raise InvalidInputError(
                f"{name} must be finite, of shape {_in_words(attribute, sizes)}; found shape {shape}"
            )
        kind = np.asarray(value).dtype
        if attribute.law not in (_text, as_flag, _indices) and (
            kind.kind not in "iuf" or (shape and kind != np.float64)
        ):
            raise InvalidInputError(
                f"{name} must be finite, of shape {_in_words(attribute, sizes)}; found {kind} numbers"
            )
        sizes |= dict(zip(attribute.shape, shape, strict=True))
        attribute.law(value, name)


KNOWLEDGE = {
    "rotation": ("d", "d"), "curvature": ("k",), "standard_error": ("k",), "directions": ("k", "k"), "flat": ("k",),
    "axes": ("a", "b"), "resampled": ("r", "e", "e"), "optima.rotation": ("o", "d", "d"), "optima.cost": ("o",),
    "optima.cloud_distance": ("o",), "optima.n_starts": ("o",),
}  # fmt: skip
"""Arrays of an `Identifiability` and of its optima."""


def require_knowledge(arrays: Mapping[str, Any]) -> None:
    """Raise `InvalidInputError` unless these are the arrays of an `Identifiability`, of the right shapes and finite."""
    sizes: dict[str, int] = {}
    if set(arrays) != set(KNOWLEDGE):
        raise InvalidInputError(f"identifiability holds {sorted(arrays)}; needed are {sorted(KNOWLEDGE)}")
    for name, shape in KNOWLEDGE.items():
        found = np.shape(arrays[name])
        if len(found) != len(shape) or any(
            sizes.setdefault(*pair) != pair[1] for pair in zip(shape, found, strict=True)
        ):
            raise InvalidInputError(
                f"identifiability.{name} has shape {found}; the others make that {shape} of {sizes}"
            )
        if name == "flat":
            if np.asarray(arrays[name]).dtype != bool:
                raise InvalidInputError("identifiability.flat must hold True or False")
        elif arrays[name].dtype != np.float64 and name != "optima.n_starts":
            raise InvalidInputError(f"identifiability.{name} must be finite; found {arrays[name].dtype}")
        elif arrays[name].size:
            as_finite(arrays[name], f"identifiability.{name}")


def schema_of(method: type) -> dict[str, Attribute] | None:
    """Return the attributes of a class of maniport's methods; None for any other class."""
    own = BY_CLASS.get(method.__name__) if method.__module__.startswith("maniport.") else None
    return None if own is None else COMMON | own


def _in_words(attribute: Attribute, sizes: Mapping[str | int, int]) -> str:
    """A shape with the sizes that are known."""
    return str(tuple(sizes.get(size, size) for size in attribute.shape)).replace("'", "")
