"""The answer that stands before all facts: how it came out, in plain words, with the figures that say so."""

import shlex
from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Card:
    """One figure of a verdict.

    Attributes
    ----------
    name : str
        What it is about, in a word or two.
    value : str
        The figure, with its unit.
    about : str
        What of it the figure is, such as the median, or a sentence where there is none.
    details : tuple of str
        What stands beside it: the 95th percentile, the largest with its moment.
    alarm : str
        One of the details that is to be warned of; empty where none is.
    parts : tuple of (str, float)
        What the figure is the sum of.

    See Also
    --------
    Answer : has some.
    """

    name: str
    value: str
    about: str = ""
    details: tuple[str, ...] = ()
    alarm: str = ""
    parts: tuple[tuple[str, float], ...] = ()

    @property
    def text(self) -> str:
        """All of it in a line."""
        return ", ".join([f"{self.value} ({self.about})" if self.about else self.value, *self.details])


@dataclass(frozen=True)
class Answer:
    """What a reader wants to know before all else.

    Attributes
    ----------
    title : str
        One sentence: how it came out.
    text : str
        What stands in the way.
    doubts : str
        What of the data speaks against it.
    advice : str
        What to try next, a sentence; empty where nothing is known to help.
    command : str
        The command that does so; ``{folder}`` stands for the folder of the results.
    status : {"green", "amber", "red", ""}
        As in `maniport.telling.status`; empty where there is no outcome yet.
    reasons : tuple of str
        Keys of the warnings that the status follows from.
    cards : tuple of Card
        The figures, what matters most first.

    See Also
    --------
    Facts : begin with it.
    """

    title: str
    text: str = ""
    doubts: str = ""
    advice: str = ""
    command: str = ""
    status: str = ""
    reasons: tuple[str, ...] = ()
    cards: tuple[Card, ...] = ()

    @property
    def status_text(self) -> str:
        """The status and its reasons, in words; empty without a status."""
        reasons = ", ".join(key.replace("-", " ") for key in self.reasons) or "no warnings"
        return f"Status: {self.status} ({reasons})." if self.status else ""

    def typed(self, folder: str = "results") -> str:
        """The command as it is typed, with the results in a folder."""
        return self.command.replace("{folder}", shlex.quote(folder))


def rounded_sum(parts: Sequence[float], decimals: int = 3) -> tuple[str, tuple[str, ...]]:
    """Write a sum and its parts so that the printed parts add up: the largest part takes what rounding leaves."""
    unit = 10**decimals
    whole, counts = round(sum(parts) * unit), [round(part * unit) for part in parts]
    counts[max(range(len(parts)), key=lambda k: parts[k])] += whole - sum(counts)
    total, *each = (f"{count / unit:.{decimals}f}" for count in (whole, *counts))
    return total, tuple(each)
