"""The command that transfers many recordings to many robots."""

import sys
from typing import Annotated, Any

import typer

from maniport.cli.application import Output, Overwrite, command
from maniport.pipeline.config import BATCH, CONFIG, Config
from maniport.report.console import Console


def _execution(help: str, *flags: str) -> Any:
    return typer.Option(*flags, help=help, rich_help_panel="Execution")


@command(
    "human", "robot", "transfer", "motion", "batch", "seed", defaults=BATCH,
    example="maniport batch 'recordings/**/*.bvh' --robot panda --robot ur5.urdf -o dataset",
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
    from maniport.util.signals import raising

    config = config.changed(recording=recordings) if recordings else config
    options: dict[str, Any] = {"processes": processes, "dask": dask, "ray": ray, "overwrite": overwrite}
    try:
        with console.progress() as progress, raising():
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
