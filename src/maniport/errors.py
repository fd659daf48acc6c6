"""The errors and warnings of maniport.

Every error derives from `ManiportError` and from the builtin that callers of scientific Python expect
(`ValueError`, `LookupError`, `OSError`), so that both ``except ManiportError`` and ``except ValueError`` work.
A message states what is wrong, where (argument or file, index), what was found and what is allowed.
"""

import json
import re
import warnings
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from difflib import SequenceMatcher
from typing import Any

LONGEST_MESSAGE = 2000
"""Characters of a message: the longest of maniport's own, with names of usual length, have about 1500."""
_ON_THE_COMMAND_LINE = ContextVar("on_the_command_line", default=False)
_OPTIONS = {"rate": "--fps", "bases": "--pose", "frames": "--frame"}
"""Options of the command line that are not named after the argument."""
_LINE_ENDS = re.compile(r"[\t-\r\x1c-\x1e\x85\u2028\u2029]+")


def printable(text: str, longest: int | None = None) -> str:
    """Return text, which may be from files, in one line of printable characters; the middle is left out if too long."""
    if not text.isprintable():
        line = _LINE_ENDS.sub(" ", text)
        text = "".join(
            char if char.isprintable() else char.encode("unicode_escape").decode() for char in line
        )
    if longest is None or len(text) <= longest:
        return text
    half = longest // 2 - 4
    return f"{text[:half]} [...] {text[-half:]}"


def counted(count: int, noun: str) -> str:
    """Return a number with its noun, such as "1 frame" or "3 frames"."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


class _Message:
    """Base of errors and warnings: makes their text printable, since it may quote files."""

    def __init__(self, *args: Any):
        super().__init__(
            *(
                printable(value, LONGEST_MESSAGE) if isinstance(value, str) else value
                for value in args
            )
        )


def some_of(names: Iterable[str], most: int = 8) -> str:
    """List names from a file for a message: a few of them, shortened, and the number of the others."""
    listed = list(names)
    texts = [printable(str(name), 60) for name in listed[:most]]
    if len(listed) > most:
        texts.append(f"and {len(listed) - most} more")
    return ", ".join(texts) or "nothing"


def shown(value: object, longest: int = 200) -> str:
    """Return the `repr` of a value for a message, short, also of integers that Python does not write."""
    try:
        text = repr(value)
    except ValueError:  # an integer of more digits than `sys.get_int_max_str_digits`
        return "a too large integer"
    return printable(text, longest)


class ManiportError(_Message, Exception):
    """Base of all errors that maniport raises on purpose."""


class InvalidInputError(ManiportError, ValueError):
    """An argument has a value that cannot be used."""


class NotSPDError(InvalidInputError):
    """A matrix is not symmetric positive-definite."""


class UnknownNameError(InvalidInputError, LookupError):
    """A robot, person, frame, joint, marker or option of that name does not exist."""


class NotFittedError(ManiportError, ValueError, AttributeError):
    """An adapter or model is used before `fit`."""


class NotInvertibleError(ManiportError, TypeError):
    """The inverse of a map without an inverse was requested."""


class FileFormatError(ManiportError, ValueError):
    """A file cannot be read as what it claims to be."""


class RecordingError(ManiportError, ValueError):
    """A recording does not hold what is needed."""


class OutputError(ManiportError, OSError):
    """Results cannot be written to the requested path."""


class MissingPackageError(ManiportError, ImportError):
    """An optional package is needed and cannot be imported."""


class ManiportWarning(_Message, UserWarning):
    """Base of all warnings of maniport."""


class ConvergenceWarning(ManiportWarning):
    """An iteration stopped before its stopping rule was met."""


class IdentifiabilityWarning(ManiportWarning):
    """The data do not determine what was fitted to them."""


@contextmanager
def collected_warnings() -> Iterator[list[str]]:
    """Collect the texts of warnings in the block, each once; the list has them at its end."""
    texts: list[str] = []
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", ManiportWarning)
        yield texts
    own = (
        str(warning.message) for warning in caught if issubclass(warning.category, ManiportWarning)
    )
    texts += dict.fromkeys(own)


def nearest_first(name: object, available: Iterable[str]) -> list[str]:
    """Sort existing names by their similarity to the requested name."""
    lowered = name.lower() if isinstance(name, str) else shown(name).lower()
    return sorted(
        available, key=lambda other: (-SequenceMatcher(None, lowered, other.lower()).ratio(), other)
    )


def unknown_name(
    what: str, name: object, available: Iterable[str], where: str = "", most: int = 20
) -> UnknownNameError:
    """Build the error for a name that does not exist.

    `what` it names, and `where`, such as ``"in 'arm.urdf'"``; at most `most` of the names that exist are listed.
    """
    names = nearest_first(name, available)
    listed = ", ".join(map(repr, names[:most]))
    if len(names) > most:
        listed += f", and {len(names) - most} more"
    return UnknownNameError(
        f"unknown {what} {shown(name)} {where}".rstrip()
        + f"; available, nearest first: {listed or 'none'}"
    )


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
    """Return the name of an argument in messages: on the command line, that of the option."""
    return _OPTIONS.get(name, name) if typed() else name


def argument(name: str, value: Any = None, option: str | None = None) -> str:
    """Format an argument as in calls of functions (``unit='mm'``) or as in commands (``--unit mm``)."""
    if not typed():
        return f"{name}=" if value is None else f"{name}={value!r}"
    option = option or _OPTIONS.get(name, "--" + name.replace("_", "-"))
    if isinstance(value, Mapping):
        return f"{option} {name}.json, a file that holds {json.dumps(value, ensure_ascii=False)}"
    return option if value is None else f"{option} {value}"
