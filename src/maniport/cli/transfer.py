"""Commands that move a robot: the whole transfer, and its last steps alone."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from math import radians
from pathlib import Path
from typing import Annotated, Any

import typer

from maniport.cli.application import RECORDING, Overwrite, Part, Robot, Seed, Share, app, prints
from maniport.cli.motion import Effort, Motion, Table, Workspace, moves
from maniport.cli.recorded import Recorded, takes_recording, transfers
from maniport.cli.robots import Chain, Pair, takes_chain, takes_pair
from maniport.errors import InvalidInputError
from maniport.report.console import Console
from maniport.report.values import Report
from maniport.util.defaults import BOTH, DAMPING, EFFORT, ROBOT
from maniport.util.progress import Progress

LOAD = "load the program"  # Name of the first step
DEMOS = {
    "freeform": "A person moves the right arm freely for 8 s; the motion is transferred to a Panda.",
    "ladder": "A person climbs a ladder for 38 s, the hard case; the motion is transferred to a Panda.",
}
"""Shipped recordings and their descriptions."""


@app.command(epilog="Example: maniport demo;  maniport demo ladder -o on-the-ladder")
@moves
@prints
def demo(
    motion: Motion,
    console: Console,
    recording: Annotated[str, typer.Argument(help="freeform; or ladder, the hard case.")] = next(iter(DEMOS)),
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder for the results.")] = Path("maniport-demo"),
    overwrite: Overwrite = False,
    seed: Seed = 0,
) -> None:
    """Transfer a shipped recording to the Franka Panda."""
    with at_work(console) as tell:
        from maniport.arms import load_arm
        from maniport.mocap import shipped_recording

        job: dict[str, Any] = {"recording": shipped_recording(recording), "damping": DAMPING, "random_state": seed}
        console.say(DEMOS[recording])
        _require_free(output, overwrite)
        facts = _transfer(tell, output, overwrite, motion, load_arm(ROBOT), job)
    console.tell(facts, output=str(output))


@app.command(epilog="Example: maniport transfer walk.bvh --robot ur5.urdf -o results")
@moves
@takes_chain
@takes_pair
@takes_recording
@transfers
@prints
def transfer(
    motion: Motion,
    chain: Chain,
    pair: Pair,
    recorded: Recorded,
    job: dict[str, Any],
    console: Console,
    recording: Annotated[Path, typer.Argument(help=RECORDING)],
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder for the results.")],
    robot: Robot = ROBOT,
    move: Annotated[
        bool, typer.Option(help="Plan the robot's motion; otherwise end with its target ellipsoids.")
    ] = True,
    overwrite: Overwrite = False,
) -> None:
    """Transfer a recorded arm motion to a robot: the whole way."""
    if motion.export and not move:
        raise InvalidInputError("--export writes the robot's motion, of which there is none with --no-move")
    both = job["side"] == BOTH
    if not both:
        pair.require_none()
    with at_work(console) as tell:
        _require_free(output, overwrite, both)
        data = recorded.read(recording)
        for doubt in data.quality_warnings:  # before the long work, and in the result once more
            console.say(f"! {doubt}")
        job |= {"recording": data, "markers": recorded.roles(), "move": move}
        if both:
            from maniport.mocap.both_arms import markers_of_each

            del job["side"]
            job |= {} if pair.tips is None else {"tips": pair.tips}
            arms = pair.load(robot, chain)
            markers_of_each(data, job["markers"])
            facts = _transfer(tell, output, overwrite, motion, arms, job)
        else:
            facts = _transfer(tell, output, overwrite, motion, chain.load(robot), job)
    console.tell(facts, output=str(output))


@app.command(epilog="Example: maniport place target_profile.npz --path hand.npz --robot panda --tilt free -o placed")
@takes_chain
@prints
def place(
    chain: Chain,
    console: Console,
    profile: Annotated[Path, typer.Argument(help="Target velocity ellipsoids, .npz.")],
    path: Annotated[Path, typer.Option("--path", help="Hand positions, one for each ellipsoid, .npz.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder for the placed profile and path.")],
    robot: Robot = ROBOT,
    workspace: Workspace = None,
    table: Table = None,
    tilt: Annotated[
        str | None, typer.Option("--tilt", help="Tilt of the base [deg], or free to find the best base_rotation.")
    ] = None,
    rank: Annotated[int, typer.Option("--rank", help="Rank of the placement that is written, from 1.")] = 1,
    planning_effort: Effort = EFFORT,
    part: Part = "translation",
    damping: Share = DAMPING,
    overwrite: Overwrite = False,
    seed: Seed = 0,
) -> None:
    """Find the best placements of a path relative to a robot, and list them."""
    from maniport.arms import EllipsoidSpec
    from maniport.arms.collisions import Collisions
    from maniport.motion import place_path
    from maniport.motion.placement.placed_path import DATA_FILES
    from maniport.report.metrics import facts_of
    from maniport.util.atomic_io import require_free
    from maniport.util.files import load_ellipsoids, load_path

    require_free(output, DATA_FILES, overwrite)
    leaning, arm = _tilt(tilt), chain.load(robot)
    target, time = load_ellipsoids(profile)
    positions, path_time = load_path(path)
    time = time if time is not None else path_time
    with console.progress() as tell:
        placed = place_path(
            positions,
            target,
            arm,
            time=time,
            tilt=leaning,
            workspace=None if workspace is None else [workspace[i : i + 2] for i in (0, 2, 4)],
            spec=EllipsoidSpec(part=part),
            damping=damping,
            collisions=Collisions.of(arm, table=table),
            planning_effort=planning_effort,
            rank=rank,
            random_state=seed,
            progress=tell,
        )
    placed.save(output, time, overwrite=overwrite)
    console.tell(facts_of(placed), output=str(output))


@app.command(epilog="Example: maniport track placed_profile.npz --robot panda --path path.npz -o motion")
@moves
@takes_chain
@prints
def track(
    motion: Motion,
    chain: Chain,
    console: Console,
    profile: Annotated[Path, typer.Argument(help="Target velocity ellipsoids with times, .npz.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder for the results.")],
    robot: Robot = ROBOT,
    path: Annotated[Path | None, typer.Option("--path", help="Target positions of the end effector, .npz.")] = None,
    place: Annotated[bool, typer.Option("--place", help="First find the best placement of the path.")] = False,
    part: Part = "translation",
    damping: Share = DAMPING,
    overwrite: Overwrite = False,
    seed: Seed = 0,
) -> None:
    """Plan a robot motion whose ellipsoids follow a target profile, and its end effector a target path."""
    from maniport.arms import EllipsoidSpec
    from maniport.pipeline.follow import follow
    from maniport.report.write import EXECUTION_FILES, write_results
    from maniport.util.atomic_io import require_free
    from maniport.util.files import load_ellipsoids, load_path
    from maniport.util.validation import as_times

    require_free(output, EXECUTION_FILES, overwrite)
    motion.require_exports()
    arm = chain.load(robot)
    control, direction = motion.control(arm), motion.direction()
    target, time = load_ellipsoids(profile)
    positions, path_time = (None, None) if path is None else load_path(path)
    times, file = (path_time, path) if time is None else (time, profile)  # the times of one file are enough
    with console.progress() as tell:
        execution = follow(
            arm,
            target,
            None if times is None else as_times(times, f"time in {str(file)!r}", fewest=2),
            positions,
            place=place,
            spec=EllipsoidSpec(part=part),
            damping=damping,
            direction=direction,
            random_state=seed,
            progress=tell,
            **control,
        )
        files = tuple(str(file) for file in (profile, path) if file is not None)
        execution = replace(execution, sources=files, options=motion.typed)
        facts = write_results(execution, output, tell, motion.export, overwrite=overwrite)
    console.tell(facts, output=str(output))


@contextmanager
def at_work(console: Console) -> Iterator[Progress]:
    """Show progress from the first second on, while large modules are loaded."""
    with console.progress() as tell:
        tell(LOAD, 0.0)
        yield tell


def _require_free(output: Path, overwrite: bool, both: bool = False) -> None:
    """Raise unless the results of a transfer may be written to a folder."""
    from maniport.report.write import RUN_FILES, require_free_for_both
    from maniport.util.atomic_io import require_free

    require_free_for_both(output, overwrite) if both else require_free(output, RUN_FILES, overwrite)


def _transfer(tell: Progress, output: Path, overwrite: bool, motion: Motion, robot: Any, job: dict[str, Any]) -> Report:
    """Transfer to an arm or a pair of arms, and write the results."""
    from maniport.arms import Arm
    from maniport.pipeline import transfer_both, transfer_recording
    from maniport.report.write import write_results

    motion.require_exports()
    one = isinstance(robot, Arm)
    control = motion.control(robot) if one or job["move"] else {}
    tell(LOAD, 1.0)
    run: Any = transfer_recording if one else transfer_both
    result = run(robot=robot, orientation=motion.orientation, progress=tell, **control, **job)
    if one and result.execution is not None:
        result = replace(result, execution=replace(result.execution, options=motion.typed))
    return write_results(result, output, tell, motion.export, overwrite=overwrite)


def _tilt(text: str | None) -> float | str | None:
    """Convert a tilt from degrees; None and the word for a free tilt stay."""
    from maniport.motion.placement.arguments import FREE

    if text is None or text == FREE:
        return text
    try:
        return radians(float(text))
    except ValueError:
        raise InvalidInputError(f"tilt must be a number [deg] or {FREE!r}; found {text!r}") from None
