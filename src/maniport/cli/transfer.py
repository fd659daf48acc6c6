"""Commands that transfer recordings to robots: one, many, and several that become one profile first."""

import sys
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer

from maniport.cli.application import NO_ROBOT, RECORDING, Output, Overwrite, command, optional_robot
from maniport.errors import InvalidInputError, unknown_name
from maniport.pipeline.config import BATCH, CONFIG, Config
from maniport.report.console import Console
from maniport.util.defaults import AUTO, BOTH

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


def _execution(help: str, *flags: str) -> Any:
    return typer.Option(*flags, help=help, rich_help_panel="Execution")


@command(
    "human", "robot", "transfer", "motion", "batch", "seed", defaults=BATCH,
    example="maniport batch 'recordings/**/*.bvh' --robot panda -o dataset",
)  # fmt: skip
def batch(
    config: Config,
    console: Console,
    output: Output,
    recordings: Annotated[
        list[str] | None, typer.Argument(help="Recordings, folders of them, and quoted patterns 'a/**/*.bvh'.")
    ] = None,
    processes: Annotated[int | None, _execution("Processes; default: number of cores.")] = None,
    dask: Annotated[str | None, _execution("HOST:PORT of a Dask scheduler.")] = None,
    ray: Annotated[bool, _execution("Use Ray.", "--ray")] = False,
    overwrite: Overwrite = False,
) -> None:
    """Process recordings on robots; resume an interrupted run."""
    from maniport.batch import transfer_batch
    from maniport.batch.table import PAGE, failures
    from maniport.util.signals import ending_in_order, interrupt

    config = config.changed(recording=recordings) if recordings else config
    options: dict[str, Any] = {"processes": processes, "dask": dask, "ray": ray, "overwrite": overwrite}
    try:
        with console.progress() as progress, ending_in_order(interrupt):
            result = transfer_batch(config.recording, config.robot.robot, output, config, progress=progress, **options)
    except KeyboardInterrupt as interrupted:
        print(f"maniport: interrupted{f'; {interrupted}' if str(interrupted) else ''}", file=sys.stderr)
        raise typer.Exit(130) from None
    config.save(output / CONFIG)
    failed, pairs = failures(result.failed), len(result.table)
    count = f"{pairs - len(result.failed)} of {pairs} pairs are done, {len(result.failed)} failed"
    lines = [f"  {row['recording']} → {', '.join(row['robots'])}: {row['reason']}" for row in failed]
    values = {"pairs": pairs, "done_before": result.kept, "failed": failed, "seconds": result.seconds}
    text = "\n".join([f"{count}{':' if lines else '.'}", *lines, f"Overview {output / PAGE}"])
    console.finish({**values, "output": str(output)}, text)
    if failed:
        raise typer.Exit(1)


@command(
    "human", "robot", "transfer", "motion", "learning", "seed", without=("move",), defaults=NO_ROBOT,
    example="maniport learn jumps.bvh --segments auto -o learned",
)  # fmt: skip
def learn(
    config: Config,
    console: Console,
    output: Output,
    recordings: Annotated[list[Path] | None, typer.Argument(help=RECORDING)] = None,
    overwrite: Overwrite = False,
) -> None:
    """Learn a profile from several demonstrations of a motion.

    With --robot, a robot follows the profile (folder OUTPUT-robot).
    """
    from maniport.pipeline import transfer_recording
    from maniport.report.renderings import as_numbers
    from maniport.report.write import LEARNED_FILES, write_results
    from maniport.util.atomic_io import require_free

    require_free(output, LEARNED_FILES, overwrite)
    config = config.changed(recording=recordings) if recordings else config
    folder, exports, followed = Path(f"{output}-robot"), config.motion.export, None
    settings = _settings_of_robot(config, folder, overwrite)
    with console.progress() as progress:
        learned = _learned(config, progress)
        report = write_results(learned, output, progress, overwrite=overwrite)
        if settings is not None:
            result = transfer_recording(learned, replace(settings, progress=progress))
            followed = write_results(result, folder, progress, exports, overwrite=overwrite)
    robot = {} if followed is None else {"robot": {**as_numbers(followed), "output": str(folder)}}
    console.print_report(report, output=str(output), **robot)
    if followed is not None and not console.as_json:
        console.print_report(followed, output=str(folder))


def _settings_of_robot(config: Config, folder: Path, overwrite: bool) -> Any:
    """Check the options of the robot that follows the profile before the long work; None where there is none."""
    from maniport.pipeline.transfer import settings_of
    from maniport.report.write import RUN_FILES, export_files
    from maniport.util.atomic_io import require_free

    if optional_robot(config, config.human.side == BOTH) is None:
        if config.motion.export:
            raise InvalidInputError("--export needs --robot")
        return None
    require_free(folder, RUN_FILES, overwrite)
    export_files(config.motion.export)
    return settings_of(config)


def _learned(config: Config, progress: Any) -> Any:
    """Learn the profile from the recordings and segments of a configuration."""
    from maniport.pipeline import learn

    texts, count = config.learning.segments, len(config.recording)
    texts = texts * count if texts == (AUTO,) else texts
    if len(texts) not in (0, count):
        raise InvalidInputError(f"--segments is needed for each of the {count} recordings; found {len(texts)}")
    segments = [AUTO if text == AUTO else [_interval(part) for part in text.split(",")] for text in texts]
    data = [config.human.read(file) for file in config.recording]
    return replace(learn(data, segments or None, config, progress=progress), config=config)


def _interval(text: str) -> tuple[float, float]:
    try:
        start, stop = map(float, text.split(":"))
    except ValueError:
        raise InvalidInputError(f"--segments must be {AUTO}, or times such as 2:4,4:5.6 [s]; found {text!r}") from None
    return start, stop
