import io
import json
import warnings

import pytest
from rich.console import Console as RichConsole
from rich.text import Text

from maniport.errors import ConvergenceWarning
from maniport.report import console as consoles
from maniport.report.console import COMPILING, Console, progress
from maniport.util.compiling import announce


@pytest.fixture
def terminal(monkeypatch):
    class Terminal(io.StringIO):
        def isatty(self):
            return True

    def make(width):
        stream = Terminal()
        rich = RichConsole(file=stream, force_terminal=True, width=width, soft_wrap=True)
        monkeypatch.setattr(consoles, "_standard_error", lambda: rich)
        return stream

    return make


def test_json_has_no_nan(capsys):
    Console(as_json=True).finish(
        {"a": float("nan"), "b": [1.0, (float("inf"),)], "c": {"d": -float("inf")}}, ""
    )
    assert json.loads(capsys.readouterr().out) == {"a": None, "b": [1.0, [None]], "c": {"d": None}}


def test_an_error_ends_the_progress_on_a_terminal(terminal):
    stream = terminal(80)
    with pytest.raises(RuntimeError), progress() as report:  # noqa: PT012 - the context must end with the error
        report("walk", 0.25)
        raise RuntimeError
    text = stream.getvalue()
    assert "━" in text
    assert text.rindex("\x1b[?25h") > text.rindex("\x1b[?25l")


def test_compiling_is_a_line_of_the_progress(terminal):
    stream = terminal(80)
    with progress() as report:
        report("walk", 0.25)
        assert COMPILING not in stream.getvalue()
        announce(True)
        announce(False)
    announce(True)  # of nobody's interest
    assert COMPILING in stream.getvalue()


@pytest.mark.parametrize("width", [24, 80])
def test_lines_on_a_terminal_are_wrapped_between_words(terminal, width):
    stream = terminal(width)
    result = " ".join(f"[fact{i}]" for i in range(20))
    with progress() as report:
        report("walk", 1.0, result)
    lines = Text.from_ansi(stream.getvalue()).plain.splitlines()
    start = next(i for i, line in enumerate(lines) if line.startswith("✓ walk"))
    end = next(i for i, line in enumerate(lines) if "[fact19]" in line)
    written = lines[start : end + 1]
    assert " ".join(" ".join(written).split()) == f"✓ walk {result}"
    assert all(line.startswith("  ") for line in written[1:])
    assert all(len(line.rstrip()) <= width for line in written)


def test_lines_in_a_pipe(capsys):
    for quiet in (False, True):
        with Console(quiet=quiet).progress() as report:
            for _ in range(2):
                warnings.warn("slow", ConvergenceWarning, stacklevel=1)
            report("walk", 0.25)
            report("walk", 1.0, "[b]3 km[/b]")
            report(far := "walk/from/here/to/there", 1.0, "done")
            report(f"{far} → again", 1.0, "done")
    words = ["!", "slow", "!", "slow", "✓", "walk", "[b]3", "km[/b]"]
    assert capsys.readouterr().err.split() == [
        *words,
        "✓",
        far,
        "done",
        "✓",
        far,
        "→",
        "again",
        "done",
    ]
