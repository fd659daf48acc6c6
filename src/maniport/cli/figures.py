"""Figures of a saved result."""

from pathlib import Path
from typing import Annotated

import typer

from maniport.cli.application import app, prints
from maniport.report.console import Console


@app.command(epilog="Example: maniport figures maniport-demo -o paper/figures")
@prints
def figures(
    console: Console,
    result: Annotated[Path, typer.Argument(help="Folder that transfer, demo, track or learn has written.")],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Folder for the figures; by default that of the result.")
    ] = None,
) -> None:
    """Draw the figures of a saved result as PNG and SVG files."""
    from maniport.report.figures import write_figures

    with console.progress() as progress:
        progress("draw the figures", 0.0)
        files = write_figures(result, output)
        progress("draw the figures", 1.0, f"{len(files)} files")
    console.finish({"files": [str(file) for file in files]}, "\n".join(map(str, files)))
