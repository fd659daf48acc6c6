"""The application that the verbs belong to, and how it ends."""

import io
import signal
import sys
from typing import Annotated, Any

import typer

from maniport.errors import ManiportError
from maniport.version import __version__

REMINDER = 1.0
"""Seconds after which an interruption that went unnoticed is repeated."""

app = typer.Typer(
    name="maniport",
    help="Let a robot arm take over the way a person uses their arm.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"maniport {__version__}")
        raise typer.Exit


@app.callback()
def _root(
    version: Annotated[bool, typer.Option("--version", callback=_version, is_eager=True, help="Show version.")] = False,
) -> None:
    pass


class _Interrupted(BaseException):
    """Ctrl-C; not KeyboardInterrupt, which the command-line library would answer itself."""


def main() -> None:
    """Run the command line; errors end with exit code 2 and one sentence, Ctrl-C with 130."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # where there is no sign for ✓ a question mark does
    for number in (signal.SIGINT, signal.SIGALRM):
        signal.signal(number, _interrupt)
    try:
        app()
    except ManiportError as error:
        print(f"maniport: {error}", file=sys.stderr)
        sys.exit(2)
    except _Interrupted:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        print("maniport: interrupted; nothing was written", file=sys.stderr)
        sys.exit(130)


def _interrupt(signum: int, frame: Any) -> None:
    # an exception that strikes a callback of compiled code is lost: the alarm raises it again until it is noticed
    signal.setitimer(signal.ITIMER_REAL, REMINDER)
    raise _Interrupted
