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
    transfer_to_folder(replace(config.changed(recording=recording), verb="transfer"), console, output, overwrite)


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
    if recording is not None:
        config = config.changed(recording=recording)
    if len(config.recording) != 1:
        raise InvalidInputError(
            f"recording: exactly one file is required, as an argument or in --config; found {len(config.recording)}"
        )
    transfer_to_folder(config, console, output, overwrite)


def transfer_to_folder(config: Config, console: Console, output: Path, overwrite: bool) -> None:
    """Transfer the recording of a configuration, write the results and print them."""
    from maniport.pipeline import transfer_recording
    from maniport.report.write import export_files, require_free_results, write_results

    both = config.human.side == BOTH
    with console.progress() as progress:
        require_free_results(output, ("left", "right") if both else (), overwrite)
        export_files(config.motion.export)  # raises where a package is missing
        recording = config.human.read(config.recording[0])
        arm = config.robot.load(both)
        console.print(f"{Path(recording.source).stem.capitalize()} → {arm.name}: {recording.duration:.1f} s")
        for text in recording.quality_warnings:  # before the long work, and in the result once more
            console.warn(text)
        result = transfer_recording(recording, config, progress=progress)
        report = write_results(result, output, progress, config.motion.export, overwrite=overwrite)
    console.print_report(report, output=str(output))
