"""Kinds of options: how a value is checked in Python and files, and typed on the command line."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import isfinite, pi
from typing import ClassVar

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
ASSIGNED = ":="  # between name and value of an argument of a xacro file


@dataclass(frozen=True, kw_only=True)
class Option:
    """An option of any value, which is checked where it is used."""

    name: str = field(kw_only=False)
    section: str = field(kw_only=False)  # of configuration files and help pages; "" for none
    help: str = field(kw_only=False)  # a noun phrase
    unit: str = field(default="", kw_only=False)  # typed, see `COMMAND_LINE_UNITS`
    choices: tuple[str, ...] = ()  # allowed words, or words that are allowed besides numbers
    metavar: str = ""
    common: bool = False  # shown by --help; others by --help-all
    is_file: bool = False
    unchecked: bool = False  # also takes objects in Python; checked where it is used
    typed: bool = True  # available on the command line and in files

    placeholder: ClassVar[str] = "NAME"  # for the value, on help pages
    listed: ClassVar[bool] = False  # typed several times

    @property
    def flag(self) -> str:
        """Name on the command line."""
        return f"--{self.name.replace('_', '-')}"

    @property
    def factors(self) -> list[float]:
        """SI units in a unit of the command line, one for all numbers or one for each."""
        return [COMMAND_LINE_UNITS.get(unit, ("", 1.0))[1] for unit in self.unit.split(",")]

    @property
    def label(self) -> str:
        """Name and SI unit, for messages."""
        unit, _ = COMMAND_LINE_UNITS.get(self.unit, (self.unit, 1.0))
        if unit:
            return f"{self.name} [{unit}]"
        return self.name

    @property
    def flag_label(self) -> str:
        """Name and unit on the command line, for messages."""
        if self.unit:
            return f"{self.flag} [{self.unit}]"
        return self.flag

    def check(self, value: object) -> object:
        """Return a valid value of plain type, in SI units, or raise `InvalidInputError`."""
        value = _without_path(value)
        if self.unchecked:
            return _as_tuple(value)
        if self._is_word(value):
            return as_choice(value, self.name, self.choices)
        return self._checked(value)

    def check_setting(self, value: object) -> None:
        """Raise unless a value that was read from a file is valid."""
        if value is not None:
            self.check(value)

    def parse(self, typed: object) -> object:
        """Convert what was typed on the command line: text, texts or a flag."""
        if self._is_word(typed):
            return as_choice(typed, self.flag, self.choices)
        return self._parsed(str(typed))

    def text(self, value: object) -> str:
        """Write a value as it is typed on the command line."""
        if isinstance(value, bool):
            if value:
                return "on"
            return "off"
        if isinstance(value, int | float):
            return f"{value / self.factors[0]:.12g}"
        if isinstance(value, list | tuple):
            return ",".join(map(self.text, value))
        return str(value)

    def words(self, value: object) -> list[str]:
        """Return the arguments of the command line that set a value."""
        return [self.flag, self.text(value)]

    def _is_word(self, value: object) -> bool:
        """Whether a value has to be one of the words that are allowed besides numbers."""
        return bool(self.choices) and isinstance(value, str) and not _numbers(value)

    def _checked(self, value: object) -> object:
        return value

    def _parsed(self, text: str) -> object:
        return text


class Word(Option):
    """Text, or one of `choices`."""

    def _is_word(self, value: object) -> bool:
        return bool(self.choices)

    def _checked(self, value: object) -> object:
        if not isinstance(value, str):
            raise InvalidInputError(f"{self.label} must be text; found {shown(value)}")
        return value


class Flag(Option):
    """True or false."""

    def parse(self, typed: object) -> object:
        """Convert a flag."""
        return as_flag(typed, self.flag_label)

    def words(self, value: object) -> list[str]:
        """Return the flag, or its opposite."""
        return [self.flag if value else f"--no-{self.flag[2:]}"]

    def _checked(self, value: object) -> object:
        return as_flag(value, self.label)


@dataclass(frozen=True, kw_only=True)
class Integer(Option):
    """A whole number."""

    minimum: int = 0
    maximum: int | None = None

    placeholder: ClassVar[str] = "N"

    def _checked(self, value: object) -> object:
        return as_count(value, self.label, self.minimum, self.maximum)

    def _parsed(self, text: str) -> object:
        return as_count(_integer(text), self.flag_label, self.minimum, self.maximum)


@dataclass(frozen=True, kw_only=True)
class Number(Option):
    """A number."""

    bounds: Bounds = field(default_factory=Bounds)  # in SI units

    placeholder: ClassVar[str] = "X"

    def _checked(self, value: object) -> object:
        return as_number(value, self.label, **self.bounds)

    def _parsed(self, text: str) -> object:
        factor = self.factors[0]
        bounds = _divided(self.bounds, factor)
        return as_number(_number(text, bounds), self.flag_label, **bounds) * factor


@dataclass(frozen=True, kw_only=True)
class Vector(Option):
    """Several numbers, typed with commas; each may have a unit of its own, "m,m,m,deg"."""

    count: int | None = None  # None: any
    bounds: Bounds = field(default_factory=Bounds)  # in SI units

    def parse(self, typed: object) -> object:
        """Convert numbers with commas, or a word."""
        text = str(typed)
        if "," in text:
            return self._parsed(text)
        return super().parse(text)

    def _checked(self, value: object) -> object:
        numbers = as_numbers(
            value,  # type: ignore[arg-type]  # `as_numbers` refuses what is no array
            self.label,
            self.count,
            broadcast=self.count is None,
            **self.bounds,
        )
        return tuple(np.atleast_1d(numbers).tolist())

    def _parsed(self, text: str) -> tuple[float, ...]:
        numbers = _numbers(text)
        if not numbers or self.count not in (None, len(numbers)):
            words = [*self.choices, f"{self.count or ''} numbers separated by commas".strip()]
            raise InvalidInputError(f"{self.flag} must be {' or '.join(words)}; found {text!r}")
        factors = self.factors
        if len(factors) == 1:
            factors = factors * len(numbers)
        values = []
        for number, factor in zip(numbers, factors, strict=True):
            values.append(number * factor)
        return tuple(values)


class Vectors(Vector):
    """Vectors, each of which is typed once."""

    listed: ClassVar[bool] = True

    def parse(self, typed: object) -> object:
        """Convert texts of numbers."""
        return tuple(self._parsed(text) for text in _texts(typed))


@dataclass(frozen=True, kw_only=True)
class Names(Option):
    """Names, files or objects; typed with commas, or once for each where they may contain commas."""

    repeated: bool = False
    numbers: bool = False  # whether files may have numbers for names

    listed: ClassVar[bool] = True

    def check(self, value: object) -> object:
        """Return a tuple of names; a single one may stand for itself."""
        parts = value if isinstance(value, list | tuple) else (value,)
        return tuple(_without_path(part) for part in parts)

    def check_setting(self, value: object) -> None:
        """Raise unless names that were read from a file are texts."""
        if value is None or self.numbers:
            return
        parts = value if isinstance(value, list) else [value]
        for part in parts:
            if not isinstance(part, str) or not part:
                raise InvalidInputError(
                    f"{self.name} must be text, or a list of texts; found {shown(part)}"
                )

    def parse(self, typed: object) -> object:
        """Convert texts to names."""
        texts = _texts(typed)
        words = texts
        if not self.repeated:
            words = [word.strip() for word in ",".join(texts).split(",")]
        if not all(words):
            raise InvalidInputError(
                f"{self.flag} must be names, none of them empty; found {','.join(texts)!r}"
            )
        return tuple(words)


class NumbersByName(Option):
    """Numbers by name, typed as lift=0.2."""

    listed: ClassVar[bool] = True

    def parse(self, typed: object) -> object:
        """Convert texts to numbers by name."""
        numbers: dict[str, float] = {}
        for text in _texts(typed):
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


class TextsByName(Option):
    """Texts by name, typed as arm_name:=left."""

    listed: ClassVar[bool] = True

    def parse(self, typed: object) -> object:
        """Convert texts to values by name."""
        values: dict[str, str] = {}
        for text in _texts(typed):
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


def plain(value: object, is_file: bool = False) -> object:
    """Return a value as YAML holds it: absolute paths of existing files, and names of objects."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item, is_file) for item in value]
    if hasattr(value, "tolist"):
        return value.tolist()
    if is_file and isinstance(value, str) and os.path.exists(value):
        return os.path.abspath(value)
    if value is None or isinstance(value, bool | int | float | str):
        return value
    return type(value).__name__


def _as_tuple(value: object) -> object:
    """Convert lists and arrays to tuples, which can be compared."""
    if hasattr(value, "tolist"):  # arrays have no truth value
        value = value.tolist()
    if isinstance(value, list | tuple):
        return tuple(_as_tuple(item) for item in value)
    return value


def _without_path(value: object) -> object:
    """Return the text of a path; other values stay."""
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    return value


def _texts(typed: object) -> list[str]:
    """Return what was typed several times as a list."""
    if isinstance(typed, Sequence) and not isinstance(typed, str):
        return list(typed)
    return [str(typed)]


def _divided(bounds: Bounds, factor: float) -> Bounds:
    """Return bounds in another unit."""
    converted = Bounds()
    if "minimum" in bounds:
        converted["minimum"] = bounds["minimum"] / factor
    if "above" in bounds:
        converted["above"] = bounds["above"] / factor
    if "maximum" in bounds:
        converted["maximum"] = bounds["maximum"] / factor
    if "below" in bounds:
        converted["below"] = bounds["below"] / factor
    return converted


def _integer(text: str) -> int | str:
    """Convert what was typed to an integer; what is none, or has too many digits, stays as it is."""
    if not text.removeprefix("-").isdecimal():
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
