"""The command line: a command for each step of the transfer; commands parse, call and print, nothing else."""

from maniport.cli import audit, files, live, transfer  # each adds its commands
from maniport.cli.application import app, main

__all__ = ["app", "audit", "files", "live", "main", "transfer"]

ORDER = [
    *("demo", "transfer", "batch", "learn", "domain", "fit", "apply", "place", "track"),
    *("evaluate", "audit", "figures", "reproduce", "live", "view", "info", "compile"),
]
"""The commands as `--help` lists them."""

app.registered_commands.sort(key=lambda command: ORDER.index(command.callback.__name__))  # type: ignore[union-attr]
