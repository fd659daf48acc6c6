"""How ranges, places and arguments are said in messages, once."""

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any, TypedDict

import numpy as np

_ON_THE_COMMAND_LINE = ContextVar("on_the_command_line", default=False)
_OPTIONS = {"side": "--arm", "rate": "--fps"}
"""Options of the command line that are not named after the argument."""


def as_text(path: str) -> str:
    """A path, or what is said of one, that can be written: file systems take bytes that are no letters."""
    return path.encode("utf-8", "backslashreplace").decode("utf-8")


class Bounds(TypedDict, total=False):
    """The range of a number: `minimum` and `maximum` belong to it, `above` and `below` do not."""

    minimum: float
    above: float
    maximum: float
    below: float


def inside(values: Any, bounds: Bounds) -> Any:
    """Whether numbers lie in a range, one by one."""
    low, above = bounds.get("minimum", -np.inf), bounds.get("above", -np.inf)
    high, below = bounds.get("maximum", np.inf), bounds.get("below", np.inf)
    return (values >= low) & (values > above) & (values <= high) & (values < below)


def range_in_words(bounds: Bounds) -> str:
    """Say a range in words, with a space before them; empty where there are no bounds."""
    left = f"({bounds['above']:g}" if "above" in bounds else f"[{bounds['minimum']:g}" if "minimum" in bounds else ""
    right = f"{bounds['below']:g})" if "below" in bounds else f"{bounds['maximum']:g}]" if "maximum" in bounds else ""
    if left and right:
        return f" in {left}, {right}"
    words = {"above": "above", "minimum": "of at least", "below": "below", "maximum": "of at most"}
    return "".join(f" {words[key]} {value:g}" for key, value in bounds.items())


def first(mask: Any) -> tuple[int, ...]:
    """Index of the first entry that is true."""
    return tuple(int(i) for i in np.argwhere(mask)[0])


def show(index: tuple[int, ...]) -> str:
    """Say an index by itself."""
    return str(index[0]) if len(index) == 1 else str(tuple(int(i) for i in index))


def at(index: Any) -> str:
    """Say an index behind a name."""
    return f"[{', '.join(str(int(i)) for i in index)}]" if len(index) else ""


@contextmanager
def on_the_command_line() -> Iterator[None]:
    """Let `argument` speak to people who type commands, as long as it lasts."""
    before = _ON_THE_COMMAND_LINE.set(True)
    try:
        yield
    finally:
        _ON_THE_COMMAND_LINE.reset(before)


def typed() -> bool:
    """Whether somebody typed a command, rather than called a function."""
    return _ON_THE_COMMAND_LINE.get()


def spoken(name: str) -> str:
    """An argument's name in messages: the option's, on the command line, where that is another word."""
    return _OPTIONS.get(name, name) if typed() else name


def argument(name: str, value: Any = None, option: str | None = None) -> str:
    """Say how an argument is given, to who calls functions (``unit='mm'``) or types commands (``--unit mm``)."""
    if not typed():
        return f"{name}=" if value is None else f"{name}={value!r}"
    option = option or _OPTIONS.get(name, "--" + name.replace("_", "-"))
    if isinstance(value, Mapping):
        return f"{option} {name}.json, a file that holds {json.dumps(value, ensure_ascii=False)}"
    return option if value is None else f"{option} {value}"
