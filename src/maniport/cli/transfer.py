"""Commands that transfer a recording to a robot."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from maniport.cli.application import RECORDING, Output, Overwrite, command
from maniport.errors import InvalidInputError, unknown_name
from maniport.pipeline.config import Config
from maniport.report.console import Console
from maniport.util.defaults import BOTH

DEMOS = ("freeform", "ladder")  # bundled recordings: an easy and a hard one


@command("transfer", "motion", "seed", example="maniport demo;  maniport demo ladder -o on-the-ladder")
def demo(
    config: Config,
    console: Console,
    recording: Annotated[str, typer.Argument(help="freeform; or ladder, the hard case.")] = DEMOS[0],
    output: Output = Path("maniport-demo"),
    overwrite: Overwrite = False,
) -> None:
    """Transfer a bundled recording to the Franka Panda."""
    if recording not in DEMOS:
        raise unknown_name("recording", recording, DEMOS)
    transfer(replace(config.changed(recording=recording), verb="transfer"), console, output, overwrite=overwrite)


@command(
    "human", "robot", "transfer", "motion", "seed", example="maniport transfer walk.bvh --robot ur5.urdf -o results"
)
def transfer(
    config: Config,
    console: Console,
    output: Output,
    recording: Annotated[str | None, typer.Argument(help=RECORDING)] = None,
    overwrite: Overwrite = False,
) -> None:
    """Transfer a recorded arm motion to a robot."""
    from maniport.pipeline.transfer import settings_of, transfer_recording
    from maniport.report.write import export_files, require_free_results, write_results

    if recording is not None:
        config = config.changed(recording=recording)
    if len(config.recording) != 1:
        raise InvalidInputError(
            f"recording: exactly one file is required, as an argument or in --config; found {len(config.recording)}"
        )
    require_free_results(output, ("left", "right") if config.human.side == BOTH else (), overwrite)
    export_files(config.motion.export)  # raises where a package is missing
    with console.progress() as progress:
        settings, motion = settings_of(config, progress), config.human.read(config.recording[0])
        console.print(f"{Path(motion.source).stem.capitalize()} → {settings.robot.name}: {motion.duration:.1f} s")
        for text in motion.quality_warnings:  # before the long work, and in the result once more
            console.warn(text)
        result = transfer_recording(motion, settings)
        report = write_results(result, output, progress, config.motion.export, overwrite=overwrite)
    console.print_report(report, output=str(output))
