"""Options that are described once: for Python, the command line and configuration files."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cache
from math import pi
from types import NoneType
from typing import Any, get_args, get_origin

from maniport.errors import InvalidInputError
from maniport.util.validation import Bounds, as_choice, as_count, as_flag, as_number, as_numbers

COMMAND_LINE_UNITS = {"mm": ("m", 1e-3), "deg": ("rad", pi / 180.0), "%": ("", 0.01)}
"""Units of the command line, with the SI unit of Python and files, and the factor to it."""


@dataclass(frozen=True)
class Option:
    """Description of an option: a field of a dataclass made with `option`."""

    help: str  # a noun phrase
    unit: str = ""  # on the command line, see `COMMAND_LINE_UNITS`
    choices: tuple[str, ...] = ()  # allowed words, or words that are allowed besides numbers
    count: int | None = None  # numbers of a vector
    bounds: Bounds = field(default_factory=Bounds)  # in SI units
    metavar: str = ""
    common: bool = False  # shown by --help; others by --help-all
    repeated: bool = False  # typed once for each element, which may contain commas
    is_file: bool = False
    unchecked: bool = False  # also takes objects in Python; checked where it is used
    typed: bool = True  # available on the command line and in files
    name: str = ""
    kind: Any = str  # bool, int, float, str, tuple or Mapping
    element: type = str  # of a tuple
    required: bool = False  # None stands for the default
    default: Any = None

    @property
    def flag(self) -> str:
        """Name on the command line."""
        return f"--{self.name.replace('_', '-')}"

    @property
    def si_unit(self) -> str:
        """Unit in Python and files."""
        return COMMAND_LINE_UNITS.get(self.unit, (self.unit, 1.0))[0]

    @property
    def factor(self) -> float:
        """SI units in a unit of the command line."""
        return COMMAND_LINE_UNITS.get(self.unit, ("", 1.0))[1]

    def check(self, value: Any, label: str = "", bounds: Bounds | None = None) -> Any:
        """Return a valid value of plain type, or raise `InvalidInputError`."""
        label = label or self.name + (f" [{self.si_unit}]" if self.si_unit else "")
        bounds = self.bounds if bounds is None else bounds
        if value is None:
            return self.default if self.required else None
        if isinstance(value, os.PathLike):
            value = os.fspath(value)
        if self.choices and (isinstance(value, str) or self.kind is str) and not self.unchecked:
            return as_choice(value, self.name, self.choices)
        if self.kind is tuple and self.element is str:
            parts = (value,) if isinstance(value, str) or not isinstance(value, Sequence) else value
            return tuple(os.fspath(part) if isinstance(part, os.PathLike) else part for part in parts)
        if self.unchecked:
            return _as_tuple(value)
        if self.kind is bool:
            return as_flag(value, label)
        if self.kind is int:
            return as_count(value, label, int(bounds.get("minimum", 0)))
        if self.kind is float:
            return as_number(value, label, **bounds)
        if self.kind is tuple:
            return tuple(as_numbers(value, label, self.count, **bounds).tolist())
        if not isinstance(value, str):
            raise InvalidInputError(f"{label} must be text; found {value!r}")
        return value

    def parse(self, typed: Any) -> Any:
        """Convert what was typed on the command line: text, texts, a number or a flag."""
        label = self.flag + (f" [{self.unit}]" if self.unit else "")
        if self.kind is Mapping:
            return _assignments(label, typed)
        if self.kind is tuple and self.element is str:
            words = typed if self.repeated else [word.strip() for text in typed for word in text.split(",")]
            if not all(words):
                raise InvalidInputError(f"{label} must be names separated by commas; found {','.join(typed)!r}")
            return tuple(words)
        if self.repeated:
            return tuple(self._numbers(label, text) for text in typed)
        if self.kind not in (float, tuple) or (self.choices and _is_word(typed)):
            return self.check(typed, label)
        if self.kind is tuple:
            return self._numbers(label, typed)
        bounds = {key: float(value) / self.factor for key, value in self.bounds.items()}  # type: ignore[arg-type]
        return float(self.check(typed, label, Bounds(**bounds))) * self.factor  # type: ignore[typeddict-item]

    def _numbers(self, label: str, text: str) -> tuple[float, ...]:
        try:
            numbers = tuple(float(word) for word in text.split(","))
        except ValueError:
            numbers = ()
        if not numbers or self.count not in (None, len(numbers)):
            words = f"{' or '.join(self.choices)}, or " if self.choices else ""
            count = "" if self.count is None else f"{self.count} "
            raise InvalidInputError(f"{label} must be {words}{count}numbers separated by commas; found {text!r}")
        return tuple(number * self.factor for number in numbers)

    def text(self, value: Any) -> str:
        """Write a value as it is typed on the command line."""
        if isinstance(value, bool):
            return "on" if value else "off"
        if isinstance(value, int | float):
            return f"{value / self.factor:.12g}"
        if isinstance(value, list | tuple):
            return ",".join(map(self.text, value))
        return str(value)

    @property
    def placeholder(self) -> str:
        """Placeholder of the value in help pages: the words that are allowed if they are short, else the unit."""
        words = "|".join(self.choices)
        if self.metavar or (words and len(words) <= 24):
            return self.metavar or words
        return self.unit or ("FILE" if self.is_file else {int: "N", float: "X"}.get(self.kind, "NAME"))

    def description(self, default: Any) -> str:
        """Return the help text of the command line, with words and default."""
        words = f": {', '.join(self.choices)}" if self.choices and self.placeholder == "NAME" else ""
        usual = "" if default is None or default == () or isinstance(default, bool) else self.text(default)
        return f"{self.help}{words}{f' (default {usual})' if usual else ''}"

    def words(self, value: Any) -> list[str]:
        """Return the arguments of the command line that set a value."""
        if self.kind is bool:
            return [self.flag if value else f"--no-{self.flag[2:]}"]
        return [self.flag, self.text(value)]


def option(default: Any, help: str, unit: str = "", choices: Sequence[str] = (), **more: Any) -> Any:
    """Make a dataclass field with a description; `Bounds` and attributes of `Option` by name."""
    bounds = Bounds(**{name: more.pop(name) for name in tuple(more) if name in Bounds.__annotations__})  # type: ignore[typeddict-item]
    description = Option(help, unit, tuple(choices), bounds=bounds, default=default, **more)
    return field(default=default, metadata={"option": description})


@cache
def options_of(kind: Any) -> dict[str, Option]:
    """Return the options of a dataclass by name, completed from its type annotations."""
    described = {}
    for item in fields(kind):
        if "option" in item.metadata:
            types = (
                [item.type] if get_origin(item.type) in (tuple, Mapping) else list(get_args(item.type)) or [item.type]
            )
            last = [part for part in types if part is not NoneType][-1]
            described[item.name] = replace(
                item.metadata["option"],
                name=item.name,
                kind=get_origin(last) or last,
                element=(get_args(last) or (str,))[0],
                required=NoneType not in types,
            )
    return described


class Options:
    """Base of dataclasses of options: checks each value."""

    def __post_init__(self) -> None:
        kind: Any = type(self)
        for name, described in options_of(kind).items():
            object.__setattr__(self, name, described.check(getattr(self, name)))


def _as_tuple(value: Any) -> Any:
    value = value.tolist() if hasattr(value, "tolist") else value  # arrays have no truth value
    return tuple(map(_as_tuple, value)) if isinstance(value, list | tuple) else value


def _is_word(text: str) -> bool:
    """Return whether text is neither a number nor several."""
    try:
        float(text.split(",")[0])
    except ValueError:
        return "," not in text
    return False


def _assignments(label: str, texts: Sequence[str]) -> dict[str, float]:
    """Convert texts such as lift=0.2 to numbers by name."""
    numbers: dict[str, float] = {}
    for text in texts:
        name, _, number = (part.strip() for part in text.rpartition("="))
        try:
            value = float(number)
        except ValueError:
            raise InvalidInputError(f"{label} must be NAME=NUMBER, such as lift=0.2; found {text!r}") from None
        if name in numbers:
            raise InvalidInputError(f"{label}: {name} is set twice; found {numbers[name]:g} and {value:g}")
        numbers[name] = value
    return numbers


def plain(value: Any) -> Any:
    """Return a value as YAML holds it, or its name where it is an object of Python."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if hasattr(value, "tolist"):
        return value.tolist()
    return value if value is None or isinstance(value, bool | int | float | str) else type(value).__name__


def absolute(value: Any) -> Any:
    """Make paths of existing files absolute; names, as of robots, stay."""
    if isinstance(value, tuple):
        return tuple(map(absolute, value))
    return os.path.abspath(value) if isinstance(value, str) and os.path.exists(value) else value
