"""Facts: what there is to say of a result, said once.

`facts_of` turns a result, which is data and says nothing, into facts. Terminal, Markdown, JSON, notebook and page
(`maniport.telling.renderings`, `maniport.telling.page`) are renderings of the same ones.
"""

import importlib
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import singledispatch
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from maniport.errors import InvalidInputError
from maniport.telling.answer import Answer

INFO, NOTE, WARNING = "info", "note", "warning"
"""Severities: a figure or a setting; a sentence worth reading; a sentence to be read before all else."""

SUFFIXES = {"mm": "_mm", "m": "_m", "°": "_deg", "s": "_s", "Hz": "_hz"}
"""How the name of a number in JSON tells its unit."""

MOMENT = re.compile(r"\bat (-?\d+\.\d) s\b")
"""How a moment is told, `at_moment`; pages make links of these."""

ROOMS = {
    "bodies": "of_robot",
    "demonstrations": "of_recording of_people",
    "profiles": "of_people",
    "transfer": "of_transfer",
    "evaluation": "of_evaluation",
    "tracking": "of_motion of_placement",
    "pipeline": "of_run of_both of_learning",
}
"""Which modules here tell of the classes of a room; they are loaded when they are needed."""


@dataclass(frozen=True)
class Fact:
    """One thing to say.

    Attributes
    ----------
    name : str
        What it is about.
    text : str
        What people read: a value with its unit, or, in notes and warnings, whole sentences. Empty: nothing to say.
    meaning : str
        What the value tells, in a sentence.
    key, value, unit
        For machines: a name, without the unit; a number, a text, or lists and mappings of these; and the unit of all
        numbers in it. Without a key it stands in no JSON. The key of a warning names its kind.
    role : str
        Whose it is, as in `maniport.telling.roles`; empty where it is nobody's.
    severity : {"info", "note", "warning"}

    See Also
    --------
    Section : has some.
    """

    name: str
    text: str
    meaning: str = ""
    key: str = ""
    value: Any = None
    unit: str = ""
    role: str = ""
    severity: str = INFO


@dataclass(frozen=True)
class Table:
    """Rows of text under column names.

    Attributes
    ----------
    columns : tuple of str
    rows : tuple of tuple of str
        A cell for each column.
    caption : str
    key, value
        As in `Fact`, with the units in the names within.

    See Also
    --------
    Section : has some.
    """

    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    caption: str = ""
    key: str = ""
    value: Any = None

    def __post_init__(self) -> None:
        for row in self.rows:
            if len(row) != len(self.columns):
                raise InvalidInputError(
                    f"every row of a table must have {len(self.columns)} cells, one for each column; found {len(row)}"
                )


@dataclass(frozen=True)
class Section:
    """Facts that belong together.

    Attributes
    ----------
    title : str
    facts : tuple of Fact
    tables : tuple of Table
    key : str
        Its name in JSON; without one its facts stand at the top there.
    text : str
        Markdown below the title, a paragraph a line; names from files must be escaped.
    folded : bool
        Whether a page folds it: method and data, which few readers open.

    See Also
    --------
    Facts : have some.
    """

    title: str
    facts: tuple[Fact, ...] = ()
    tables: tuple[Table, ...] = ()
    key: str = ""
    text: str = ""
    folded: bool = False


@dataclass(frozen=True)
class Facts:
    """All that there is to say of something.

    Attributes
    ----------
    title, lead : str
        A heading, and a sentence or two below it.
    sections : tuple of Section
        What matters most comes first; so the worst warnings do.
    verdict : Answer or None
        How it came out; None where there is nothing to come out.
    doubts : tuple of Fact
        Warnings about the data, before those of the sections: everything else depends on the data.

    See Also
    --------
    facts_of : tells them of an object.
    as_markdown, as_html, as_numbers
    """

    title: str
    lead: str = ""
    sections: tuple[Section, ...] = ()
    verdict: Answer | None = None
    doubts: tuple[Fact, ...] = ()

    @property
    def warning_facts(self) -> tuple[Fact, ...]:
        """The warnings, each sentence once, the worst first."""
        each = dict[str, Fact]()
        for fact in (*self.doubts, *self._of(WARNING)):
            each.setdefault(fact.text, fact)
        return tuple(each.values())

    @property
    def warnings(self) -> tuple[str, ...]:
        """Sentences of the warnings."""
        return tuple(fact.text for fact in self.warning_facts)

    @property
    def warning_keys(self) -> tuple[str, ...]:
        """Keys of the warnings, each once."""
        return tuple(dict.fromkeys(fact.key for fact in self.warning_facts))

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences worth reading, each once."""
        return tuple(dict.fromkeys(fact.text for fact in self._of(NOTE)))

    def fact(self, key: str) -> Fact:
        """Return the first fact with this key; KeyError where there is none."""
        found = {fact.key: fact for section in reversed(self.sections) for fact in reversed(section.facts)}
        return found[key]

    def _of(self, severity: str) -> list[Fact]:
        return [fact for part in self.sections for fact in part.facts if fact.severity == severity and fact.text]


def facts_of(thing: Any) -> Facts:
    """Tell of a result, an arm, a recording, an adapter or another object of maniport.

    Parameters
    ----------
    thing : any object of maniport

    Returns
    -------
    Facts
        Of an object that nothing is known of, its prompt alone.

    See Also
    --------
    as_markdown, as_html, as_numbers
    """
    for kind in type(thing).__mro__:
        top, room, *_ = [*kind.__module__.split("."), ""]
        if top == "maniport" and room in ROOMS:
            for module in ROOMS[room].split():
                importlib.import_module(f"maniport.telling.{module}")
    return told(thing)


@singledispatch
def told(thing: Any) -> Facts:
    """Tell of an object whose module is loaded; `told.register` is how a module adds a class."""
    return Facts(type(thing).__name__, repr(thing))


def warning(key: str, text: str) -> Fact:
    """Make a warning: a stable key for programs and a sentence for people."""
    return Fact("", sentence(text), key=key, severity=WARNING)


def warnings_of(key: str, texts: Iterable[str]) -> tuple[Fact, ...]:
    """Make warnings of one kind."""
    return tuple(warning(key, text) for text in texts)


def notes(texts: Iterable[str]) -> list[Fact]:
    """Make sentences that are worth reading."""
    return [Fact("", sentence(text), severity=NOTE) for text in texts]


def numbers(**values: Any) -> list[Fact]:
    """Make what machines alone read; the names have the units."""
    return [Fact("", "", key=key, value=value) for key, value in values.items()]


def sentence(text: str) -> str:
    """Let a text begin with a capital letter and end with a full stop."""
    return text[:1].upper() + text[1:] + ("" if text.endswith((".", ":", "!", "?")) else ".")


def spread(
    name: str,
    key: str,
    values: ArrayLike,
    time: ArrayLike | None = None,
    unit: str = "",
    meaning: str = "",
    role: str = "",
) -> Fact:
    """Tell values over time by their median, their 95th percentile, and the largest with its moment."""
    found = np.asarray(values, dtype=float)
    at = int(np.argmax(found))
    where = {"max_at": at} if time is None else {"max_at_s": float(np.asarray(time)[at])}
    value = {
        "median": float(np.median(found)),
        "p95": float(np.percentile(found, 95)),
        "max": float(found[at]),
        **where,
    }
    after = f" {unit}" if unit and unit != "°" else unit
    place = f"at number {at}" if time is None else at_moment(where["max_at_s"])
    low, high, most = (f"{value[one]:.2f}{after}" for one in ("median", "p95", "max"))
    return Fact(name, f"{low} (median), {high} (95 %), {most} (largest, {place})", meaning, key, value, unit, role)


def at_moment(time: float) -> str:
    """Tell when something is [s]."""
    return f"at {time:.1f} s"


def in_axes(distance: float) -> str:
    """A distance as the length of one axis: 0.1 is one that is 5 % too long."""
    ratio = float(np.exp(0.5 * distance))
    return (
        f"one axis {ratio:.1f} times as long" if ratio >= 1.95 else f"one axis {100.0 * (ratio - 1.0):.0f} % too long"
    )


def listed(values: Sequence[object]) -> str:
    """Write values beside one another."""
    return ", ".join(map(str, values))
