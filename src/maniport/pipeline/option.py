"""Description of an option, once for Python, the command line and configuration files."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from math import isfinite, pi
from types import NoneType, UnionType
from typing import Any, get_args

import numpy as np

from maniport.errors import InvalidInputError, shown
from maniport.util.validation import (
    Bounds,
    as_choice,
    as_count,
    as_flag,
    as_number,
    as_numbers,
    inside,
)

COMMAND_LINE_UNITS = {"mm": ("m", 1e-3), "deg": ("rad", pi / 180.0), "%": ("", 0.01)}
"""Units of the command line, with the SI unit of Python and files, and the factor to it."""
NAMES = tuple[str, ...]
ASSIGNED = ":="  # between name and value of an argument of a xacro file


@dataclass(frozen=True)
class Option:
    """A field of a dataclass, made with `option`."""

    section: str  # of configuration files and help pages; "" for none
    help: str  # a noun phrase
    unit: str = ""  # on the command line, see `COMMAND_LINE_UNITS`; of a vector also of each element, "m,m,m,deg"
    choices: tuple[str, ...] = ()  # allowed words, or words that are allowed besides numbers
    count: int | None = None  # numbers of a vector
    bounds: Bounds = field(default_factory=Bounds)  # in SI units
    metavar: str = ""
    common: bool = False  # shown by --help; others by --help-all
    repeated: bool = False  # typed once for each element, which may contain commas
    is_file: bool = False
    unchecked: bool = False  # also takes objects in Python; checked where it is used
    typed: bool = True  # available on the command line and in files
    default: Any = None
    name: str = ""
    kind: Any = str  # type of the field without None; of several the last
    required: bool = False  # None: the default

    @property
    def flag(self) -> str:
        """Name on the command line."""
        return f"--{self.name.replace('_', '-')}"

    @property
    def factors(self) -> list[float]:
        """SI units in a unit of the command line, one for all numbers or one for each."""
        return [COMMAND_LINE_UNITS.get(unit, ("", 1.0))[1] for unit in self.unit.split(",")]

    def check(self, value: Any, typed: bool = False) -> Any:
        """Return a valid value of plain type, or raise `InvalidInputError`; `typed`: on the command line."""
        if value is None:
            return self.default if self.required else None
        value = os.fspath(value) if isinstance(value, os.PathLike) else value
        if self.kind == NAMES:
            parts = value if isinstance(value, list | tuple) else (value,)
            return tuple(
                os.fspath(part) if isinstance(part, os.PathLike) else part for part in parts
            )
        if self.unchecked and not typed:
            return _as_tuple(value)
        if self.choices and (self.kind is str or (isinstance(value, str) and not _numbers(value))):
            return as_choice(value, self.flag if typed else self.name, self.choices)
        unit = self.unit if typed else COMMAND_LINE_UNITS.get(self.unit, (self.unit,))[0]
        label = (self.flag if typed else self.name) + (f" [{unit}]" if unit else "")
        if self.kind is bool:
            return as_flag(value, label)
        if self.kind is int:
            if typed:
                value = _integer(value)
            maximum = self.bounds.get("maximum")
            return as_count(
                value,
                label,
                int(self.bounds.get("minimum", 0)),
                None if maximum is None else int(maximum),
            )
        if self.kind is float:
            factor = self.factors[0] if typed else 1.0
            bounds = {key: float(limit) / factor for key, limit in self.bounds.items()}  # type: ignore[arg-type]
            if typed and isinstance(value, str):
                value = _number(value, Bounds(**bounds))  # type: ignore[typeddict-item]
            return as_number(value, label, **Bounds(**bounds)) * factor  # type: ignore[typeddict-item]
        if self.kind is not str:
            numbers = as_numbers(
                value, label, self.count, broadcast=self.count is None, **self.bounds
            )
            return tuple(np.atleast_1d(numbers).tolist())
        if not isinstance(value, str):
            raise InvalidInputError(f"{label} must be text; found {shown(value)}")
        return value

    def check_setting(self, value: Any) -> None:
        """Raise unless a value that was read from a file is valid: names are texts, files too."""
        self.check(value)
        if self.kind != NAMES or self.name == "segments":  # these may be numbers
            return
        parts = [] if value is None else value if isinstance(value, list) else [value]
        for part in parts:
            if not isinstance(part, str) or not part:
                raise InvalidInputError(
                    f"{self.name} must be text, or a list of texts; found {shown(part)}"
                )

    def parse(self, typed: Any) -> Any:
        """Convert what was typed on the command line: text, texts, a number or a flag."""
        if self.kind == Mapping[str, float]:
            return self._assignments(typed)
        if self.kind == Mapping[str, str]:
            return self._texts(typed)
        if self.kind == NAMES:
            words = (
                typed
                if self.repeated
                else [word.strip() for text in typed for word in text.split(",")]
            )
            if not all(words):
                raise InvalidInputError(
                    f"{self.flag} must be names, none of them empty; found {','.join(typed)!r}"
                )
            return tuple(words)
        if self.repeated:
            return tuple(map(self._vector, typed))
        if self.kind in (bool, int, float, str) or (
            self.choices and "," not in typed and not _numbers(typed)
        ):
            return self.check(typed, typed=True)
        return self._vector(typed)

    def _vector(self, text: str) -> tuple[float, ...]:
        numbers = _numbers(text)
        if not numbers or self.count not in (None, len(numbers)):
            words = [*self.choices, f"{self.count or ''} numbers separated by commas".strip()]
            raise InvalidInputError(f"{self.flag} must be {' or '.join(words)}; found {text!r}")
        factors = self.factors if len(self.factors) > 1 else self.factors * len(numbers)
        return tuple(number * factor for number, factor in zip(numbers, factors, strict=True))

    def _assignments(self, texts: Sequence[str]) -> dict[str, float]:
        """Convert texts such as lift=0.2 to numbers by name."""
        numbers: dict[str, float] = {}
        for text in texts:
            name, _, number = (part.strip() for part in text.rpartition("="))
            if len(_numbers(number)) != 1:
                raise InvalidInputError(
                    f"{self.flag} must be NAME=NUMBER, such as lift=0.2; found {text!r}"
                )
            if name in numbers:
                raise InvalidInputError(
                    f"{self.flag}: {name} is set twice; found {numbers[name]:g} and {number}"
                )
            numbers[name] = float(number)
        return numbers

    def _texts(self, typed: Sequence[str]) -> dict[str, str]:
        """Convert texts such as arm_name:=left to values by name."""
        values: dict[str, str] = {}
        for text in typed:
            name, separator, value = text.partition(ASSIGNED)
            name = name.strip()
            if not name or not separator:
                raise InvalidInputError(
                    f"{self.flag} must be NAME:=VALUE, such as arm_name:=left; found {text!r}"
                )
            if name in values:
                raise InvalidInputError(
                    f"{self.flag}: {name} is set twice; found {values[name]!r} and {value!r}"
                )
            values[name] = value
        return values

    def text(self, value: Any) -> str:
        """Write a value as it is typed on the command line."""
        if isinstance(value, bool):
            return "on" if value else "off"
        if isinstance(value, int | float):
            return f"{value / self.factors[0]:.12g}"
        return ",".join(map(self.text, value)) if isinstance(value, list | tuple) else str(value)

    def words(self, value: Any) -> list[str]:
        """Return the arguments of the command line that set a value."""
        if self.kind is bool:
            return [self.flag if value else f"--no-{self.flag[2:]}"]
        return [self.flag, self.text(value)]


def option(
    section: str, default: Any, help: str, unit: str = "", choices: Sequence[str] = (), **more: Any
) -> Any:
    """Make a dataclass field with a description; `Bounds` and attributes of `Option` by name."""
    bounds = Bounds()
    for name in Bounds.__annotations__:
        if name in more:
            bounds[name] = more.pop(name)  # type: ignore[literal-required]
    described = Option(section, help, unit, tuple(choices), bounds=bounds, default=default, **more)
    return field(default=default, metadata={"option": described})


def options_of(kind: Any) -> dict[str, Option]:
    """Return the options of a dataclass by name, completed from its type annotations."""
    described = {}
    for item in fields(kind):
        if "option" in item.metadata:
            types = get_args(item.type) if isinstance(item.type, UnionType) else (item.type,)
            (*_, last), required = (
                [part for part in types if part is not NoneType],
                NoneType not in types,
            )
            described[item.name] = replace(
                item.metadata["option"], name=item.name, kind=last, required=required
            )
    return described


def plain(value: Any, is_file: bool = False) -> Any:
    """Return a value as YAML holds it: absolute paths of existing files, and names of objects."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item, is_file) for item in value]
    if hasattr(value, "tolist"):
        return value.tolist()
    if is_file and isinstance(value, str) and os.path.exists(value):
        return os.path.abspath(value)
    return (
        value
        if value is None or isinstance(value, bool | int | float | str)
        else type(value).__name__
    )


def _as_tuple(value: Any) -> Any:
    value = value.tolist() if hasattr(value, "tolist") else value  # arrays have no truth value
    return tuple(map(_as_tuple, value)) if isinstance(value, list | tuple) else value


def _integer(text: Any) -> Any:
    """Convert what was typed to an integer; what is none, or has too many digits, stays as it is."""
    if not str(text).removeprefix("-").isdecimal():
        return text
    try:
        return int(text)
    except ValueError:  # more digits than Python converts
        return text


def _number(text: str, bounds: Bounds) -> float | str:
    """Convert what was typed to a number; what is none, or out of bounds, stays as it is for the message."""
    numbers = _numbers(text)
    if len(numbers) == 1 and isfinite(numbers[0]) and inside(numbers[0], bounds):
        return numbers[0]
    return text


def _numbers(text: str) -> tuple[float, ...]:
    """Split text at commas; empty where a part is no number."""
    try:
        return tuple(float(word) for word in text.split(","))
    except ValueError:
        return ()
