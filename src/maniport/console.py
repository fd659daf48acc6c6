"""What a command prints: steps with progress bars on the terminal, plain lines in a pipe, JSON or nothing on demand."""

import json
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Protocol

from rich.console import Console as RichConsole
from rich.markdown import Markdown
from rich.progress import BarColumn, Progress, SpinnerColumn, TaskID, TextColumn, TimeElapsedColumn

from maniport.errors import ManiportWarning


class Tell(Protocol):
    """Takes the name of a step, the fraction of it that is done, and at its end what was found."""

    def __call__(self, step: str, fraction: float, found: str = "") -> None:
        """Report progress."""


class Console:
    """Standard output for results, standard error for progress.

    Parameters
    ----------
    as_json : bool
        Print one JSON object at the end and nothing else.
    quiet : bool
        Print nothing.
    """

    def __init__(self, as_json: bool = False, quiet: bool = False):
        self.as_json, self.quiet = as_json, quiet
        self._out = RichConsole(highlight=False, soft_wrap=True)
        self._err = RichConsole(stderr=True, highlight=False, soft_wrap=True, quiet=quiet or as_json)

    def say(self, text: str) -> None:
        """Print a line on the way."""
        self._err.print(text, markup=False)

    def finish(self, facts: dict[str, Any], text: str, markdown: bool = False) -> None:
        """Print the result: `facts` as JSON, or `text`; Markdown is laid out when a terminal reads it."""
        if self.quiet:
            return
        if self.as_json:
            print(json.dumps(facts, ensure_ascii=False, default=str))
        elif markdown and self._out.is_terminal:
            self._out.print(Markdown(text), soft_wrap=False)  # a soft wrap would cut its lines at the edge
        else:
            self._out.print(text, markup=False)

    @contextmanager
    def progress(self) -> Iterator[Tell]:
        """Show steps as they go; each one that ends leaves a line with what was found, and warnings theirs."""
        columns = (SpinnerColumn(), TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
        with Progress(*columns, console=self._err, transient=True) as bars, warnings.catch_warnings():
            warnings.showwarning = self._show_warning
            warnings.simplefilter("always", ManiportWarning)
            tasks: dict[str, TaskID] = {}

            def tell(step: str, fraction: float, found: str = "") -> None:
                if step not in tasks:
                    tasks[step] = bars.add_task(step, total=1.0)
                bars.update(tasks[step], completed=fraction)
                if fraction >= 1.0:
                    bars.remove_task(tasks.pop(step))
                    self._err.print(f"✓ {step}" + (f": {found}" if found else ""), markup=False)

            yield tell

    def _show_warning(self, message: Warning | str, category: type[Warning], *args: Any, **kwargs: Any) -> None:
        self._err.print(f"! {message}", markup=False)
