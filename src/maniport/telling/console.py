"""What a command prints: steps with progress bars on the terminal, plain lines in a pipe, JSON or nothing on demand."""

import json
import sys
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from html import escape
from typing import Any, Protocol

from rich.console import Console as RichConsole
from rich.markdown import Markdown
from rich.progress import BarColumn, Progress, SpinnerColumn, TaskID, TextColumn, TimeElapsedColumn
from rich.table import Table
from rich.text import Text

from maniport.errors import ManiportWarning, printable
from maniport.telling.facts import Facts
from maniport.telling.renderings import as_answer, as_markdown, as_numbers, narrowed, plain

DONE = "✓ "
STEP = "padding-left:1.3em;text-indent:-1.3em"
"""What does not fit into one line of a notebook goes on beside the mark."""
LEAST_MOVE = 0.01
"""A bar in a notebook is drawn again when it has grown by this much: each drawing is a message to the browser."""


class Tell(Protocol):
    """Takes the name of a step, the fraction of it that is done, and at its end what was found."""

    def __call__(self, step: str, fraction: float, found: str = "") -> None:
        """Report progress."""


@contextmanager
def progress() -> Iterator[Tell]:
    """Show the steps of long work, in a terminal or a notebook: a bar while one goes on, a line when it ends.

    Where nobody looks on (a pipe, a file, a job's log) there are the lines alone. They go to standard error.

    Yields
    ------
    callable
        For the argument ``progress`` of maniport's functions.

    See Also
    --------
    maniport.pipeline.transfer_recording : its argument `progress` tells the steps of one call.

    Examples
    --------
    >>> import maniport as mp
    >>> with mp.progress() as tell:  # doctest: +SKIP
    ...     result = mp.transfer_recording("walk.bvh", progress=tell)
    """
    console = _standard_error()
    with _notebook_steps() if console.is_jupyter else _steps(console) as tell:
        yield tell


class Console:
    """Standard output for results, standard error for progress.

    Parameters
    ----------
    as_json : bool
        Print one JSON object at the end and nothing else.
    quiet : bool
        Print nothing, but for the JSON object where that is asked for too.
    """

    def __init__(self, as_json: bool = False, quiet: bool = False):
        self.as_json, self.quiet = as_json, quiet
        self._out = RichConsole(highlight=False, soft_wrap=True)
        self._err = _standard_error(quiet=quiet or as_json)

    def say(self, text: str) -> None:
        """Print a line on the way."""
        _print_line(self._err, "", text)

    def tell(self, facts: Facts, output: str = "", **more: Any) -> None:
        """Print facts: as JSON, with `more` numbers, or as a page to read, whose last lines are the verdict."""
        more |= {"output": output} if output else {}
        verdict = facts.verdict if output else None
        shown = narrowed(facts, self._out.width) if self._out.is_terminal else facts
        page = as_markdown(shown if verdict is None else replace(shown, verdict=None))
        self.finish({**as_numbers(facts), **more}, page, markdown=True)
        if verdict is not None and not (self.as_json or self.quiet):
            self._out.print(f"\n{as_answer(verdict, output)}", markup=False)

    def finish(self, facts: dict[str, Any], text: str, markdown: bool = False) -> None:
        """Print the result: `facts` as JSON, or `text`; Markdown is laid out when a terminal reads it."""
        if self.as_json:
            utf8 = (sys.stdout.encoding or "").lower().replace("-", "") == "utf8"
            print(json.dumps(plain(facts), ensure_ascii=not utf8, allow_nan=False, default=str))
        elif self.quiet:
            return
        elif markdown and self._out.is_terminal:
            self._out.print(Markdown(text), soft_wrap=False)  # a soft wrap would cut its lines at the edge
        else:
            self._out.print(text, markup=False)

    @contextmanager
    def progress(self) -> Iterator[Tell]:
        """Show steps as they go; each one that ends leaves a line with what was found, and warnings theirs."""
        with _steps(self._err) as tell, warnings.catch_warnings():
            warnings.showwarning = self._show_warning
            warnings.simplefilter("always", ManiportWarning)
            yield tell

    def _show_warning(self, message: Warning | str, category: type[Warning], *args: Any, **kwargs: Any) -> None:
        _print_line(self._err, "! ", str(message))


def _standard_error(quiet: bool = False) -> RichConsole:
    return RichConsole(stderr=True, highlight=False, soft_wrap=True, quiet=quiet)


@contextmanager
def _steps(console: RichConsole) -> Iterator[Tell]:
    """Show steps on a terminal, or in a pipe, where FORCE_COLOR brings colours but no bar."""
    columns = (SpinnerColumn(), TextColumn("{task.description}", markup=False), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=console, transient=True, disable=not console.file.isatty()) as bars:
        tasks: dict[str, TaskID] = {}

        def tell(step: str, fraction: float, found: str = "") -> None:
            if step not in tasks:
                tasks[step] = bars.add_task(step, total=None)
            if fraction > 0.0:  # until then nobody knows how far it is, and the bar pulses
                bars.update(tasks[step], total=1.0, completed=fraction)
            if fraction >= 1.0:
                bars.remove_task(tasks.pop(step))
                _print_line(console, DONE, _told(step, found))

        yield tell


@contextmanager
def _notebook_steps() -> Iterator[Tell]:
    """Show steps in a notebook. Rich would need ipywidgets there, and every front end to support them."""
    from IPython.display import HTML, display  # type: ignore[import-not-found,unused-ignore]  # there in a notebook

    done: list[str] = []
    running: dict[str, float] = {}
    drawn: dict[str, float] = {}
    shown = display(HTML(""), display_id=True)

    def tell(step: str, fraction: float, found: str = "") -> None:
        running[step] = fraction
        if step in drawn and fraction < min(drawn[step] + LEAST_MOVE, 1.0):
            return
        drawn[step] = fraction
        if fraction >= 1.0:
            del running[step], drawn[step]
            done.append(DONE + _told(step, found))
        shown.update(HTML(_as_steps(done, running)))

    try:
        yield tell
    finally:
        shown.update(HTML(_as_steps(done, {})))  # after an error no bar shall go on


def _told(step: str, found: str) -> str:
    return f"{step}: {found}" if found else step


def _print_line(console: RichConsole, mark: str, text: str) -> None:
    """Print one line, whole in a pipe; on a terminal its words are wrapped beside the mark."""
    text = printable(text)
    if not console.file.isatty():
        console.print(mark + text, markup=False)
        return
    beside = Table.grid(padding=0)
    beside.add_row(mark, Text(text))
    console.print(beside if mark else Text(text), soft_wrap=False)


def _as_steps(done: Sequence[str], running: Mapping[str, float]) -> str:
    """Write the steps of long work for a notebook: a line for each that has ended, a bar for each that goes on."""
    lines = [escape(line) for line in done]
    for step, fraction in running.items():
        value = f' value="{fraction:.3f}"' if fraction > 0.0 else ""
        lines.append(f'<progress max="1"{value} style="width:12em"></progress> {escape(step)}')
    shown = "".join(f'<div style="{STEP}">{line}</div>' for line in lines)
    return f'<div style="margin:.3em 0">{shown}</div>'
