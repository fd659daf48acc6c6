"""What a name or a file is."""

from typing import Annotated

import typer

from maniport.cli.application import app
from maniport.cli.options import AsJson, Frame, Quiet, Seed
from maniport.telling.console import Console
from maniport.telling.describe import as_lines, describe


@app.command(epilog="Example: maniport info panda;  maniport info adapter.npz;  maniport info walk.bvh")
def info(
    what: Annotated[str, typer.Argument(help="Name of an arm, or a file: recording, ellipsoids, adapter, URDF, MJCF.")],
    frame: Frame = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
    seed: Seed = 0,
) -> None:
    """Tell what an arm or a file is."""
    console = Console(as_json, quiet)
    facts = describe(what, frame)
    console.finish(facts, as_lines(facts))
