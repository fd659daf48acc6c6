"""The robot follows: from a profile of ellipsoids to a joint trajectory."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from maniport.cli.application import app
from maniport.cli.options import AsJson, Frame, Part, Quiet, Robot, Seed, Tempo
from maniport.defaults import ROBOT
from maniport.telling.console import Console


@app.command(epilog="Example: maniport track placed_profile.npz --robot panda --path path.npz -o motion")
def track(
    profile: Annotated[Path, typer.Argument(help="Target velocity ellipsoids with times, .npz.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder for the results.")],
    robot: Robot = ROBOT,
    frame: Frame = None,
    path: Annotated[Path | None, typer.Option("--path", help="Target positions of the robot's tip, .npz.")] = None,
    place: Annotated[
        bool, typer.Option("--place", help="First move the path to where the robot can follow best.")
    ] = False,
    part: Part = "translation",
    tempo: Tempo = 1.0,
    rate: Annotated[float, typer.Option("--rate", help="Control steps a second [Hz].")] = 100.0,
    damping: Annotated[
        float, typer.Option("--damping", help="Added to ellipsoids before they are compared: share of their mean axis.")
    ] = 0.01,
    acceleration_limit: Annotated[
        float | None, typer.Option("--acceleration-limit", help="Of every joint [rad/s²].")
    ] = None,
    seed: Seed = 0,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Move a robot so that its ellipsoids follow target ones, and its tip a target path."""
    from maniport.bodies import EllipsoidSpec, load_arm
    from maniport.files import load_ellipsoids, load_path, require_free
    from maniport.pipeline.execution import follow
    from maniport.telling.write import EXECUTION_FILES, write_results

    console = Console(as_json, quiet)
    require_free(output, EXECUTION_FILES)
    arm = load_arm(robot, frame=frame)
    target, time = load_ellipsoids(profile)
    positions, path_time = (None, None) if path is None else load_path(path)
    with console.progress() as tell:
        execution = follow(
            arm,
            target,
            time if time is not None else path_time,
            positions,
            place=place,
            spec=EllipsoidSpec(part=part),
            tempo=tempo,
            rate=rate,
            damping=damping,
            acceleration_limits=acceleration_limit,
            random_state=seed,
            progress=tell,
        )
        execution = replace(execution, sources=tuple(str(file) for file in (profile, path) if file is not None))
        facts = write_results(execution, output, progress=tell)
    console.tell(facts, output=str(output))
