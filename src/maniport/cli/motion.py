"""Commands that place a path and plan a robot motion, without a person."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from maniport.cli.application import Output, Overwrite, command
from maniport.pipeline.config import Config
from maniport.pipeline.options import FREE
from maniport.report.console import Console
from maniport.util.options import Option

Profile = Annotated[Path, typer.Argument(help="Target velocity ellipsoids, .npz.")]


@command(
    "robot", "workspace", "table", "planning_effort", "part", "damping", "seed", without=("tips", "pose"),
    common=("workspace",),
    example="maniport place target_profile.npz --path hand.npz --robot panda --tilt free -o placed",
)  # fmt: skip
def place(
    config: Config,
    console: Console,
    profile: Profile,
    path: Annotated[Path, typer.Option("--path", help="Positions of the hand, one for each ellipsoid, .npz.")],
    output: Output,
    tilt: Annotated[
        str | None, typer.Option("--tilt", help="Tilt of the base [deg], or free to search it.", metavar="TILT")
    ] = None,
    rank: Annotated[int, typer.Option("--rank", help="Rank of the placement that is written, from 1.")] = 1,
    overwrite: Overwrite = False,
) -> None:
    """Find the best placements of a path relative to a robot."""
    from maniport.motion import place_path
    from maniport.motion.placement.placement import DATA_FILES
    from maniport.report.metrics import report_of
    from maniport.util.atomic_io import require_free
    from maniport.util.files import load_ellipsoids, load_path

    require_free(output, DATA_FILES, overwrite)
    arm = config.robot.load()
    leaning = None if tilt is None else Option("", "deg", (FREE,), name="tilt", kind=float).parse(tilt)
    (target, time), (positions, path_time) = load_ellipsoids(profile), load_path(path)
    time = time if time is not None else path_time
    settings = config.motion.control(arm)
    with console.progress() as progress:
        placed = place_path(
            positions, target, arm, time=time, tilt=leaning, workspace=settings.workspace, spec=config.transfer.spec,
            damping=config.transfer.damping or 0.0, collisions=settings.collisions,
            planning_effort=settings.planning_effort,
            rank=rank, random_state=config.seed, progress=progress,
        )  # fmt: skip
    placed.save(output, time, overwrite=overwrite)
    console.tell(report_of(placed), output=str(output))


@command(
    "robot", "motion", "part", "damping", "seed", without=("tips", "pose", "move"),
    example="maniport track placed_profile.npz --robot panda --path path.npz -o motion",
)  # fmt: skip
def track(
    config: Config,
    console: Console,
    profile: Profile,
    output: Output,
    path: Annotated[Path | None, typer.Option("--path", help="Target positions of the end effector, .npz.")] = None,
    place: Annotated[bool, typer.Option("--place", help="Place the path first.")] = False,
    overwrite: Overwrite = False,
) -> None:
    """Plan a robot motion that follows a target profile and path."""
    from maniport.pipeline import follow_profile
    from maniport.report.write import EXECUTION_FILES, export_files, write_results
    from maniport.util.atomic_io import require_free
    from maniport.util.files import load_ellipsoids, load_path
    from maniport.util.validation import as_times

    require_free(output, EXECUTION_FILES, overwrite)
    export_files(config.motion.export)
    arm = config.robot.load()
    target, time = load_ellipsoids(profile)
    positions, path_time = (None, None) if path is None else load_path(path)
    times, file = (path_time, path) if time is None else (time, profile)  # the times of one file are enough
    times = None if times is None else as_times(times, f"time in {str(file)!r}", fewest=2)
    with console.progress() as progress:
        result = follow_profile(
            arm, [target], times, None if positions is None else [positions], config, place=place, progress=progress
        )
        files = tuple(str(file) for file in (profile, path) if file is not None)
        result = replace(result, sources=files)
        report = write_results(result, output, progress, config.motion.export, overwrite=overwrite)
    console.tell(report, output=str(output))
