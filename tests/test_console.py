"""What the command line shows in a terminal."""

import io

from rich.console import Console as RichConsole

from maniport.console import Console


def test_a_terminal_shows_every_word_of_a_page():
    """A page laid out for a narrow terminal is wrapped, not cut: no word of a long line is lost."""
    words = [f"word{i}" for i in range(60)]
    console = Console()
    stream = io.StringIO()
    console._out = RichConsole(file=stream, force_terminal=True, width=80, soft_wrap=True)
    console.finish({}, "# Title\n\n- " + " ".join(words) + "\n", markdown=True)
    shown = stream.getvalue()
    assert [word for word in words if word not in shown] == []
