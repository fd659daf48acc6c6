"""Many recordings on many robots."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from maniport.cli.application import RECORDING, Overwrite, app, prints
from maniport.cli.motion import Motion, moves_many
from maniport.cli.recorded import Recorded, takes_recording, transfers_many
from maniport.cli.robots import Chain, takes_chain
from maniport.report.console import Console
from maniport.util.defaults import BATCH_PROFILE_RATE, ROBOT

if TYPE_CHECKING:
    from maniport.batch import Batch


def _where(help: str, **more: Any) -> Any:
    return typer.Option(help=help, rich_help_panel="Where the work is done", **more)


@app.command(epilog="Example: maniport batch 'recordings/**/*.bvh' --robot panda --robot ur5.urdf -o dataset")
@moves_many
@takes_chain
@takes_recording
@transfers_many
@prints
def batch(
    motion: Motion,
    chain: Chain,
    recorded: Recorded,
    job: dict[str, Any],
    console: Console,
    recordings: Annotated[
        list[str],
        typer.Argument(
            help=f"{RECORDING} Several, folders that hold some, or patterns in quotes such as 'a/**/*.bvh'."
        ),
    ],
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder for the results: a new one, or to go on in.")],
    robot: Annotated[
        list[str] | None,
        typer.Option("--robot", help="Name of an arm, or its URDF, MJCF or xacro file; may be given several times."),
    ] = None,
    profile_rate: Annotated[
        float, typer.Option("--profile-rate", help="Ellipsoids of a recording a second, at most [Hz].")
    ] = BATCH_PROFILE_RATE,
    pages: Annotated[
        bool, typer.Option("--pages/--no-pages", help="Write figures and a report for each pair; takes longer.")
    ] = False,
    processes: Annotated[int | None, _where("Processes; by default as many as there are cores.")] = None,
    dask: Annotated[
        str | None, _where("Address of a Dask scheduler, which does the work instead.", metavar="HOST:PORT")
    ] = None,
    ray: Annotated[bool, _where("Let Ray do the work instead.")] = False,
    move: Annotated[bool, typer.Option(help="Let the robots follow; otherwise end with target ellipsoids.")] = True,
    overwrite: Overwrite = False,
) -> None:
    """Let each robot have each recording; go on where an earlier call was ended. Exits with 1 where a pair failed."""
    from maniport.batch import transfer_batch
    from maniport.util.signals import raising

    arms = [chain.load(name) for name in robot or [ROBOT]]
    try:
        with console.progress() as tell, raising():
            found = transfer_batch(
                recordings,
                [(arm, motion.control(arm)) for arm in arms],
                output,
                reading=recorded.reading(),
                profile_rate=profile_rate,
                exports=motion.export,
                pages=pages,
                processes=processes,
                dask=dask,
                ray=ray,
                overwrite=overwrite,
                progress=tell,
                markers=recorded.roles(),
                orientation=motion.orientation,
                move=move,
                **job,
            )
    except KeyboardInterrupt as interrupted:
        print(f"maniport: interrupted{f'; {interrupted}' if str(interrupted) else ''}", file=sys.stderr)
        raise typer.Exit(130) from None
    _tell(console, found, output)


def _tell(console: Console, found: "Batch", output: Path) -> None:
    """Print the result; exit with 1 where a pair failed."""
    from maniport.batch.table import failures

    failed = failures(found.failed)
    count = f"{len(found.table) - len(found.failed)} of {len(found.table)} pairs are done, {len(found.failed)} failed"
    lines = [f"  {one['recording']} → {', '.join(one['robots'])}: {one['reason']}" for one in failed]
    console.finish(
        {"pairs": len(found.table), "done_before": found.kept, "failed": failed, "seconds": found.seconds,
         "output": str(output)},
        "\n".join([f"{count}{':' if lines else '.'}", *lines, f"open {output / 'index.html'}"]),
    )  # fmt: skip
    if failed:
        raise typer.Exit(1)
