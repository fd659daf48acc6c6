"""Output of commands: steps with progress bars on a terminal, plain lines in a pipe, JSON or nothing on request."""

import json
import sys
import textwrap
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from rich.console import Console as RichConsole

from maniport.errors import ManiportWarning, printable
from maniport.report.render import as_markdown, as_numbers, as_terminal, plain
from maniport.report.values import Report
from maniport.util.compiling import watched
from maniport.util.progress import Progress

DONE = "✓ "
COMPILING = "Compiling (first run only)"
NAME_WIDTH = 26  # column of the results of steps


@contextmanager
def progress() -> Iterator[Progress]:
    """Print the steps of long work: a bar while a step runs, and a line when it ends.

    In a notebook, a pipe, a file or the log of a job only the lines are written, to standard error.

    Yields
    ------
    callable
        For the argument ``progress`` of maniport's functions.

    Examples
    --------
    >>> import maniport as mp
    >>> with mp.progress() as progress:  # doctest: +SKIP
    ...     result = mp.transfer_recording("walk.bvh", progress=progress)
    """
    with _steps(_standard_error()) as report:
        yield report


class Console:
    """Results on standard output: as JSON, as a table if `quiet`, complete if `verbose`; progress on standard error."""

    def __init__(self, as_json: bool = False, quiet: bool = False, verbose: bool = False):
        self.as_json = as_json
        self.quiet = quiet
        self.verbose = verbose
        self._out = RichConsole(highlight=False, soft_wrap=True)
        self._err = _standard_error(quiet=quiet or as_json)

    def print(self, text: str) -> None:
        """Print a line during the work."""
        _print_line(self._err, "", text)

    def warn(self, text: str) -> None:
        """Print a warning during the work."""
        _print_line(self._err, "! ", text)

    def name_folder(self, folder: Path, chosen: bool) -> None:
        """Print the folder of the results on standard error if it was chosen here, also if `quiet`; JSON has it."""
        if chosen and not self.as_json:
            print(f"Results are in {printable(str(folder))}", file=sys.stderr)

    def print_report(self, report: Report, output: str = "", **more: object) -> None:
        """Print a report: as JSON, with `more` entries, as the summary of a result in `output`, or completely."""
        if output:
            more["output"] = output
        short = bool(report.outcome and output)
        complete = ""
        if self.verbose or not short:
            complete = as_markdown(report, details=True, folder=output)
        self.finish({**as_numbers(report, output), **more}, complete, markdown=True)
        if short and not self.as_json:
            width = min(self._out.width, 80) if self._out.is_terminal else 80
            self._out.print(as_terminal(report, output, width, table_only=self.quiet), markup=False)

    def finish(
        self, values: Mapping[str, object], text: str, markdown: bool = False, always: bool = False
    ) -> None:
        """Print the result: `values` as JSON, or `text`, if `quiet` only with `always`; a terminal renders Markdown."""
        if self.as_json:
            utf8 = (sys.stdout.encoding or "").lower().replace("-", "") == "utf8"
            print(json.dumps(plain(values), ensure_ascii=not utf8, allow_nan=False, default=str))
        elif (self.quiet and not always) or not text:
            return
        elif markdown and self._out.is_terminal:
            from rich.markdown import Markdown  # slow to load

            self._out.print(
                Markdown(text), soft_wrap=False
            )  # a soft wrap would cut its lines at the edge
        else:
            self._out.print(text, markup=False)

    @contextmanager
    def progress(self) -> Iterator[Progress]:
        """Print the steps of the work; each step that ends and each warning is a line."""
        with _steps(self._err) as report, warnings.catch_warnings():
            warnings.showwarning = lambda message, *rest, **more: self.warn(str(message))
            warnings.simplefilter("always", ManiportWarning)
            yield report


def _standard_error(quiet: bool = False) -> RichConsole:
    return RichConsole(
        stderr=True, highlight=False, soft_wrap=True, quiet=quiet, force_jupyter=False
    )


@contextmanager
def _steps(console: RichConsole, first: str = "Load modules") -> Iterator[Progress]:
    """Print steps with a result on a terminal, or in a pipe, where FORCE_COLOR enables colors but no bar."""
    from rich.progress import (
        BarColumn,
        SpinnerColumn,
        TextColumn,
        TimeElapsedColumn,
    )  # slow to load
    from rich.progress import Progress as Bars

    columns = (
        SpinnerColumn(),
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TimeElapsedColumn(),
    )
    with Bars(*columns, console=console, transient=True, disable=not console.file.isatty()) as bars:
        tasks = {first: bars.add_task(first, total=None)}  # until the first step begins

        def report(step: str, fraction: float, result: str = "") -> None:
            if first in tasks:
                bars.remove_task(tasks.pop(first))
            if step not in tasks:
                tasks[step] = bars.add_task(step, total=None)
            if fraction > 0.0:  # until then the total is unknown, and the bar pulses
                bars.update(tasks[step], total=1.0, completed=fraction)
            if fraction >= 1.0:
                bars.remove_task(tasks.pop(step))
                if result:
                    _print_line(console, DONE, result, step)

        def show(compiling: bool) -> None:
            if COMPILING in tasks:
                bars.remove_task(tasks.pop(COMPILING))
            if compiling:
                tasks[COMPILING] = bars.add_task(COMPILING, total=None)

        with watched(show):
            yield report


def _print_line(console: RichConsole, mark: str, text: str, name: str = "") -> None:
    """Print a line, in one piece in a pipe; on a terminal words are wrapped."""
    name = f"{printable(name):<{NAME_WIDTH - 1}} " if name and text else printable(name)
    line = f"{mark}{name}{printable(text)}"
    if console.file.isatty():
        line = "\n".join(
            textwrap.wrap(
                line, console.width, subsequent_indent=" " * len(mark), break_on_hyphens=False
            )
        )
    console.print(line, markup=False)
