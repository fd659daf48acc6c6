"""The command line: one verb for each arrow of the main job. Verbs parse, call, print; nothing else."""

# each module adds its verbs
from maniport.cli import batch, domains, evaluate, figures, info, learn, live, place, transfer, view
from maniport.cli.application import app, main

__all__ = [
    "app",
    "batch",
    "domains",
    "evaluate",
    "figures",
    "info",
    "learn",
    "live",
    "main",
    "place",
    "transfer",
    "view",
]

ORDER = (
    "demo",
    "transfer",
    "batch",
    "learn",
    "domain",
    "fit",
    "apply",
    "place",
    "track",
    "evaluate",
    "figures",
    "reproduce",
    "live",
    "view",
    "info",
)
"""The verbs as `--help` lists them."""

app.registered_commands.sort(key=lambda command: ORDER.index(command.callback.__name__))  # type: ignore[union-attr]
