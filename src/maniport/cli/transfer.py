"""The whole way, recording in and results out, and its last part alone: the robot follows."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer

from maniport.cli.application import (
    RECORDING,
    AsJson,
    Overwrite,
    Part,
    Quiet,
    Robot,
    Seed,
    Share,
    app,
)
from maniport.cli.chain import Chain, takes_chain
from maniport.cli.motion import Motion, moves
from maniport.cli.pair import Pair, takes_pair
from maniport.cli.recorded import Recorded, takes_recording
from maniport.cli.transferred import transfers
from maniport.defaults import BOTH, DAMPING, ROBOT
from maniport.errors import InvalidInputError
from maniport.telling.console import Console, Tell
from maniport.telling.facts import Facts

LOAD = "load the program"
"""The first step of all."""
DEMOS = {
    "freeform": "A person moves the right arm as they like, for 8 s; a Panda shall do it their way.",
    "ladder": "A person climbs a ladder and hangs from it, for 38 s: the hard case. A Panda shall do it their way.",
}
"""Shipped recordings, the one on which the result convinces first, and what they show."""


@app.command(epilog="Example: maniport demo;  maniport demo ladder -o on-the-ladder")
@moves
def demo(
    motion: Motion,
    recording: Annotated[str, typer.Argument(help="freeform; or ladder, the hard case.")] = next(iter(DEMOS)),
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder for the results.")] = Path("maniport-demo"),
    overwrite: Overwrite = False,
    seed: Seed = 0,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Run the main job on a shipped recording and the Franka Panda."""
    console = Console(as_json, quiet)
    with at_work(console) as tell:
        from maniport.demonstrations import shipped_recording

        file = shipped_recording(recording)
        console.say(DEMOS[recording])
        job: dict[str, Any] = {"recording": file, "damping": DAMPING, "random_state": seed}
        facts = _transfer(tell, output, overwrite, motion, **job)
    console.tell(facts, output=str(output))


@app.command(epilog="Example: maniport transfer walk.bvh --robot ur5.urdf -o results")
@moves
@takes_chain
@takes_pair
@takes_recording
@transfers
def transfer(
    motion: Motion,
    chain: Chain,
    pair: Pair,
    recorded: Recorded,
    job: dict[str, Any],
    recording: Annotated[Path, typer.Argument(help=RECORDING)],
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder for the results.")],
    robot: Robot = ROBOT,
    move: Annotated[bool, typer.Option(help="Let the robot follow; otherwise end with its target ellipsoids.")] = True,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Turn a recording into a robot's motion that makes the adapted ellipsoids: the whole way."""
    console = Console(as_json, quiet)
    if motion.export and not move:
        raise InvalidInputError("--export writes the robot's motion, of which there is none with --no-move")
    both = job["side"] == BOTH
    if not both:
        pair.require_none()
    with at_work(console) as tell:
        from maniport.atomic_io import require_free
        from maniport.telling.write import RUN_FILES, require_free_for_both

        require_free_for_both(output, overwrite) if both else require_free(output, RUN_FILES, overwrite)
        given = recorded.read(recording)
        for doubt in given.doubts:  # before the long work, and in the result once more
            console.say(f"! {doubt}")
        job |= {"recording": given, "markers": recorded.markers(), "move": move}
        if both:
            job |= pair.tips
            facts = _transfer_both(tell, output, overwrite, motion, pair.load(robot, chain), **job)
        else:
            facts = _transfer(tell, output, overwrite, motion, robot=chain.load(robot), **job)
    console.tell(facts, output=str(output))


@app.command(epilog="Example: maniport track placed_profile.npz --robot panda --path path.npz -o motion")
@moves
@takes_chain
def track(
    motion: Motion,
    chain: Chain,
    profile: Annotated[Path, typer.Argument(help="Target velocity ellipsoids with times, .npz.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder for the results.")],
    robot: Robot = ROBOT,
    path: Annotated[Path | None, typer.Option("--path", help="Target positions of the robot's tip, .npz.")] = None,
    place: Annotated[
        bool, typer.Option("--place", help="First move the path to where the robot can follow best.")
    ] = False,
    part: Part = "translation",
    damping: Share = DAMPING,
    overwrite: Overwrite = False,
    seed: Seed = 0,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Move a robot so that its ellipsoids follow target ones, and its tip a target path."""
    from maniport.atomic_io import require_free
    from maniport.bodies import EllipsoidSpec
    from maniport.files import load_ellipsoids, load_path
    from maniport.pipeline.follow import follow
    from maniport.telling.write import EXECUTION_FILES, write_results
    from maniport.validation import as_times

    console = Console(as_json, quiet)
    require_free(output, EXECUTION_FILES, overwrite)
    motion.require_exports()
    arm = chain.load(robot)
    control, direction = motion.control(arm), motion.direction()
    target, time = load_ellipsoids(profile)
    positions, path_time = (None, None) if path is None else load_path(path)
    given, file = (path_time, path) if time is None else (time, profile)  # one file's times do for both
    if given is not None:
        time = as_times(given, f"time in {str(file)!r}", fewest=2)
    with console.progress() as tell:
        execution = follow(
            arm,
            target,
            time,
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
def at_work(console: Console) -> Iterator[Tell]:
    """Show that something happens from the first second on, while large modules are loaded."""
    with console.progress() as tell:
        tell(LOAD, 0.0)
        yield tell


def _transfer(
    tell: Tell,
    output: Path,
    overwrite: bool,
    motion: Motion,
    robot: Any = ROBOT,
    **job: Any,
) -> Facts:
    from maniport.atomic_io import require_free
    from maniport.bodies import Arm, load_arm
    from maniport.pipeline import transfer_recording
    from maniport.telling.write import RUN_FILES, write_results

    require_free(output, RUN_FILES, overwrite)
    motion.require_exports()
    arm = robot if isinstance(robot, Arm) else load_arm(robot)
    control = motion.control(arm)
    tell(LOAD, 1.0)
    result = transfer_recording(robot=arm, orientation=motion.orientation, progress=tell, **control, **job)
    if result.execution is not None:
        result = replace(result, execution=replace(result.execution, options=motion.typed))
    return write_results(result, output, tell, motion.export, overwrite=overwrite)


def _transfer_both(
    tell: Tell, output: Path, overwrite: bool, motion: Motion, arms: Any, side: str, **job: Any
) -> Facts:
    from maniport.demonstrations.both_arms import markers_of_each
    from maniport.pipeline import transfer_both
    from maniport.telling.write import write_results

    markers_of_each(job["recording"], job["markers"])
    motion.require_exports()
    control = motion.control(arms) if job["move"] else {}
    tell(LOAD, 1.0)
    result = transfer_both(robot=arms, orientation=motion.orientation, progress=tell, **control, **job)
    return write_results(result, output, tell, motion.export, overwrite=overwrite)
