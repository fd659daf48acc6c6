"""Where before a robot a path goes best, and how the robot should be mounted."""

from math import radians
from pathlib import Path
from typing import Annotated

import typer

from maniport.cli.application import AsJson, Overwrite, Part, Quiet, Robot, Seed, Share, app
from maniport.cli.chain import Chain, takes_chain
from maniport.cli.motion import Effort, Table, Workspace
from maniport.defaults import DAMPING, EFFORT, ROBOT
from maniport.errors import InvalidInputError
from maniport.telling.console import Console


@app.command(epilog="Example: maniport place target_profile.npz --path hand.npz --robot panda --tilt free -o placed")
@takes_chain
def place(
    chain: Chain,
    profile: Annotated[Path, typer.Argument(help="Target velocity ellipsoids, .npz.")],
    path: Annotated[Path, typer.Option("--path", help="Hand positions, one for each ellipsoid, .npz.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder for the placed profile and path.")],
    robot: Robot = ROBOT,
    workspace: Workspace = None,
    table: Table = None,
    tilt: Annotated[
        str | None, typer.Option("--tilt", help="By how much the base leans [deg], or free: how to mount it.")
    ] = None,
    rank: Annotated[
        int, typer.Option("--rank", help="Which of the places to take, from 1: the table of a run tells them.")
    ] = 1,
    effort: Effort = EFFORT,
    part: Part = "translation",
    damping: Share = DAMPING,
    overwrite: Overwrite = False,
    seed: Seed = 0,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Find where before a robot a path goes best, and tell the places in their order."""
    from maniport.atomic_io import require_free
    from maniport.bodies import EllipsoidSpec
    from maniport.bodies.collisions import Collisions
    from maniport.files import load_ellipsoids, load_path
    from maniport.telling.facts import facts_of
    from maniport.tracking import place_path
    from maniport.tracking.placement.placed_path import DATA_FILES

    console = Console(as_json, quiet)
    require_free(output, DATA_FILES, overwrite)
    leaning, arm = _leaning(tilt), chain.load(robot)
    target, time = load_ellipsoids(profile)
    positions, path_time = load_path(path)
    time = time if time is not None else path_time
    bounds = None if workspace is None else [workspace[i : i + 2] for i in (0, 2, 4)]
    with console.progress() as tell:
        placed = place_path(
            positions,
            target,
            arm,
            time=time,
            tilt=leaning,
            workspace=bounds,
            spec=EllipsoidSpec(part=part),
            damping=damping,
            collisions=Collisions.of(arm, table=table),
            effort=effort,
            rank=rank,
            random_state=seed,
            progress=tell,
        )
    placed.save(output, time, overwrite=overwrite)
    console.tell(facts_of(placed), output=str(output))


def _leaning(tilt: str | None) -> float | str | None:
    """What `place_path` takes for a tilt in degrees, or the word that leaves it free."""
    from maniport.tracking.placement.arguments import FREE

    if tilt is None or tilt == FREE:
        return tilt
    try:
        return radians(float(tilt))
    except ValueError:
        raise InvalidInputError(f"tilt must be a number [deg] or {FREE!r}; found {tilt!r}") from None
