"""What the command line and long work show, in a terminal and a pipe."""

import io
import json
import threading
import warnings

import pytest
from rich.console import Console as RichConsole
from rich.text import Text

from maniport.errors import ConvergenceWarning
from maniport.report import console as consoles
from maniport.report.console import Console, progress


class Terminal(io.StringIO):
    """A stream that is a terminal by its own account, and signals every fourth text that it is given."""

    def __init__(self):
        super().__init__()
        self.moved, self._count = threading.Event(), 0

    def write(self, text):
        """Keep a text."""
        self._count += 1
        if self._count % 4 == 0:
            self.moved.set()
        return super().write(text)

    def isatty(self):
        """Answer as a terminal does."""
        return True


def stumble():
    """Fail on the way."""
    with progress() as tell:
        tell("walk", 0.25)
        raise RuntimeError("tired")


def test_json_has_no_nan(capsys):
    """What JSON has no word for becomes null, at any depth."""
    Console(as_json=True).finish({"a": float("nan"), "b": [1.0, (float("inf"),)], "c": {"d": -float("inf")}}, "")
    assert json.loads(capsys.readouterr().out) == {"a": None, "b": [1.0, [None]], "c": {"d": None}}


def test_progress_on_a_terminal_gives_the_cursor_back(monkeypatch):
    """The bar that an error interrupts is taken away, the cursor shown again, and the error goes on."""
    stream = Terminal()
    monkeypatch.setattr(consoles, "_standard_error", lambda: RichConsole(file=stream, force_terminal=True, width=80))
    with pytest.raises(RuntimeError, match="tired"):
        stumble()
    shown = stream.getvalue()
    assert "━" in shown
    assert shown.rindex("\x1b[?25h") > shown.rindex("\x1b[?25l")


@pytest.mark.parametrize("width", [24, 80])
def test_lines_on_a_terminal_are_wrapped_between_words(monkeypatch, width):
    """On a terminal no word is cut, and what goes on in the next line stands beside the mark; no line is wider."""
    stream = Terminal()
    monkeypatch.setattr(
        consoles, "_standard_error", lambda: RichConsole(file=stream, force_terminal=True, width=width, soft_wrap=True)
    )
    found = " ".join(f"[fact{i}]" for i in range(20))
    with progress() as tell:
        tell("walk", 1.0, found)
    lines = Text.from_ansi(stream.getvalue()).plain.splitlines()
    start = next(i for i, line in enumerate(lines) if line.startswith("✓ walk"))
    end = next(i for i, line in enumerate(lines) if "[fact19]" in line)
    told = lines[start : end + 1]
    assert " ".join(" ".join(told).split()) == f"✓ walk {found}"
    assert all(line.startswith("  ") for line in told[1:])
    assert all(len(line.rstrip()) <= width for line in told)


def test_warnings_of_a_verb_are_lines(capsys):
    """In a verb a warning is one line, each time it is given, and nothing with --quiet."""
    for quiet in (False, True):
        with Console(quiet=quiet).progress():
            for _ in range(2):
                warnings.warn("slow", ConvergenceWarning, stacklevel=1)
    assert capsys.readouterr().err == "! slow\n! slow\n"


def test_progress_without_a_terminal_is_a_line_for_each_step(capsys):
    """Each step that ends is a line, without a bar; results are not interpreted as markup."""
    with progress() as report:
        report("walk", 0.25)
        report("walk", 1.0, "[b]3 km[/b]")
    assert capsys.readouterr().err.split() == ["✓", "walk", "[b]3", "km[/b]"]
