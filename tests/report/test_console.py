"""What the command line and long work show, in a terminal, a pipe and a notebook."""

import io
import json
import sys
import threading
import types
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


@pytest.fixture
def notebook(monkeypatch):
    """Every state of the output of a made-up notebook, as HTML."""
    states = []

    class Handle:
        def update(self, shown):
            states.append(shown)

    module = types.ModuleType("IPython.display")
    module.HTML = str
    module.display = lambda shown, display_id: Handle()
    monkeypatch.setitem(sys.modules, "IPython", types.ModuleType("IPython"))
    monkeypatch.setitem(sys.modules, "IPython.display", module)
    monkeypatch.setattr(consoles, "_standard_error", lambda: RichConsole(file=io.StringIO(), force_jupyter=True))
    return states


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


def test_progress_in_a_notebook_moves_and_ends(notebook):
    """A bar without a value until a fraction is known, then with it, then a line; what was found is escaped."""
    with progress() as tell:
        tell("walk", 0.0)
        tell("walk", 0.25)
        tell("walk", 1.0, "<b>3 km</b>")
    started, moving, ended, closed = notebook
    assert "<progress" in started
    assert "value=" not in started
    assert 'value="0.250"' in moving
    assert "<progress" not in ended
    assert "✓ walk: &lt;b&gt;3 km&lt;/b&gt;" in ended
    assert closed == ended
