"""The command line: a command for each step of the transfer; commands parse, call and print, nothing else."""

from typer.models import CommandInfo

from maniport.cli import audit, files, live, transfer  # each adds its commands
from maniport.cli.application import app, main

__all__ = ["app", "audit", "files", "live", "main", "transfer"]

ORDER = [
    *("demo", "transfer", "batch", "learn", "domain", "fit", "apply", "place", "track"),
    *("evaluate", "audit", "figures", "reproduce", "live", "view", "info", "compile"),
]
"""The commands as `--help` lists them."""


def _position(command: CommandInfo) -> int:
    """Return the position of a command in the list."""
    assert command.callback is not None
    return ORDER.index(command.callback.__name__)


app.registered_commands.sort(key=_position)
