"""The command that learns one profile from several demonstrations; a robot may follow it."""

from pathlib import Path
from typing import Annotated, Any

import typer

from maniport.cli.application import RECORDING, Overwrite, app, prints
from maniport.cli.motion import Motion, moves
from maniport.cli.recorded import Recorded, takes_recording, transfers
from maniport.cli.robots import Chain, takes_chain
from maniport.errors import InvalidInputError
from maniport.report.console import Console
from maniport.util.defaults import AUTO


@app.command(
    epilog="Example: maniport learn jumps.bvh --segments auto -o learned;  maniport learn anna.c3d ben.bvh -o learned"
)
@moves
@takes_chain
@takes_recording
@transfers
@prints
def learn(
    motion: Motion,
    chain: Chain,
    recorded: Recorded,
    job: dict[str, Any],
    console: Console,
    recordings: Annotated[list[Path], typer.Argument(help=f"{RECORDING} One or several.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder for the results.")],
    segments: Annotated[
        list[str] | None,
        typer.Option(
            "--segments",
            help="Demonstrations of a recording [s], or auto for each motion of the hand out and back; once for all "
            "recordings, or once for each.",
            metavar="auto|START:STOP,…",
        ),
    ] = None,
    components: Annotated[
        str, typer.Option("--components", help="Number of Gaussians; auto minimizes the BIC.")
    ] = AUTO,
    lengths: Annotated[
        str, typer.Option("--lengths", help="Segment lengths: mean of all persons, or own of each.")
    ] = "mean",
    robot: Annotated[
        str | None,
        typer.Option("--robot", help="Robot that follows the learned profile; its results go to OUTPUT-robot."),
    ] = None,
    overwrite: Overwrite = False,
) -> None:
    """Learn a profile and its dispersion from several demonstrations of a motion."""
    from maniport.pipeline import learn, transfer_recording
    from maniport.report.renderings import as_numbers
    from maniport.report.write import LEARNED_FILES, RUN_FILES, write_results
    from maniport.util.atomic_io import require_free

    require_free(output, LEARNED_FILES, overwrite)
    followed = None if robot is None else _followed(robot, job, chain, motion)
    follows = Path(f"{output}-robot")
    if followed is not None:
        require_free(follows, RUN_FILES, overwrite)
    elif motion.export:
        raise InvalidInputError("--export writes a robot's motion; give --robot")
    taught = {name: value for name, value in job.items() if name not in ("method", "base_rotation")}
    taught |= {"markers": recorded.roles(), "lengths": lengths, "components": _count(components)}
    parts = None if segments is None else _segments(segments, len(recordings))
    with console.progress() as tell:
        given = [recorded.read(file) for file in recordings]
        for file, recording in zip(recordings, given, strict=True):
            for doubt in recording.quality_warnings:  # before the long work, and in the result once more
                console.say(f"! {file.name}: {doubt}")
        learned = learn(given, parts, progress=tell, **taught)
        facts = write_results(learned, output, tell, overwrite=overwrite)
        if followed is not None:
            result = transfer_recording(learned, progress=tell, **followed)
            moved = write_results(result, follows, tell, motion.export, overwrite=overwrite)
    if followed is None:
        console.tell(facts, output=str(output))
        return
    console.tell(facts, output=str(output), robot={**as_numbers(moved), "output": str(follows)})
    if not console.as_json:
        console.tell(moved, output=str(follows))


def _followed(robot: str, job: dict[str, Any], chain: Chain, motion: Motion) -> dict[str, Any]:
    """Return the options of the transfer to a robot, checked before the long work."""
    from maniport.pipeline.transfer import checked
    from maniport.transfer import method_of

    motion.require_exports()
    if job["method"] != AUTO:
        method_of(job["method"])
    arm = chain.load(robot)
    control = motion.control(arm)
    checked(arm, orientation=motion.orientation, **control)
    known = {
        name: job[name] for name in ("method", "base_rotation", "spec", "damping", "eigenvalue_floor", "random_state")
    }
    return {**known, "robot": arm, "orientation": motion.orientation, **control}


def _count(text: str) -> int | None:
    if text == AUTO:
        return None
    try:
        return int(text)
    except ValueError:
        raise InvalidInputError(f"--components must be {AUTO} or a whole number; found {text!r}") from None


def _segments(texts: list[str], recordings: int) -> list[str | list[tuple[float, float]]]:
    """Convert texts such as 2:4,4:5.6 to times of each recording; auto stays."""
    texts = texts * recordings if texts == [AUTO] else texts
    if len(texts) != recordings:
        raise InvalidInputError(
            f"--segments must be given once for each of the {recordings} recordings; found {len(texts)}"
        )
    found: list[str | list[tuple[float, float]]] = []
    for text in texts:
        if text == AUTO:
            found.append(AUTO)
            continue
        try:
            ends = [tuple(float(end) for end in part.split(":")) for part in text.split(",")]
            found.append([(start, stop) for start, stop in ends])
        except ValueError:
            raise InvalidInputError(
                f"--segments must be {AUTO}, or times such as 2:4,4:5.6 from start to stop [s]; found {text!r}"
            ) from None
    return found
