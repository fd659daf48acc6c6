"""The command that learns a profile from several demonstrations; a robot may follow it."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer

from maniport.cli.application import RECORDING, Output, Overwrite, command
from maniport.cli.transfer import job_of
from maniport.errors import InvalidInputError
from maniport.pipeline.config import Config
from maniport.report.console import Console
from maniport.report.metrics import Report
from maniport.util.defaults import AUTO
from maniport.util.progress import Progress


@command(
    "human", "robot", "transfer", "motion", "learning", "seed", without=("tips", "pose", "move", "robot"),
    example="maniport learn jumps.bvh --segments auto -o learned;  maniport learn anna.c3d ben.bvh -o learned",
)  # fmt: skip
def learn(
    config: Config,
    console: Console,
    output: Output,
    recordings: Annotated[list[Path] | None, typer.Argument(help=RECORDING)] = None,
    robot: Annotated[
        str | None, typer.Option("--robot", help="Robot that follows the profile; results in OUTPUT-robot.")
    ] = None,
    overwrite: Overwrite = False,
) -> None:
    """Learn a profile from several demonstrations of a motion."""
    from maniport.pipeline import learn
    from maniport.report.renderings import as_numbers
    from maniport.report.write import LEARNED_FILES, RUN_FILES, write_results
    from maniport.util.atomic_io import require_free

    follows = Path(f"{output}-robot")
    require_free(output, LEARNED_FILES, overwrite)
    config = config.changed(recording=recordings) if recordings else config
    if robot is not None:
        require_free(follows, RUN_FILES, overwrite)
        config = config.changed(robot=robot)
        prepared = _prepared(config)
    elif config.motion.export:
        raise InvalidInputError("--export needs --robot")
    parts = _segments(config.learning.segments, len(config.recording))
    options = {**config.human.fit_options, "spec": config.transfer.spec, **config.transfer.regularization}
    options |= {name: getattr(config.learning, name) for name in ("lengths", "components")}
    with console.progress() as progress:
        data = [config.human.read(file) for file in config.recording]
        learned = replace(learn(data, parts, random_state=config.seed, progress=progress, **options), config=config)
        report = write_results(learned, output, progress, overwrite=overwrite)
        followed = None if robot is None else _followed(learned, prepared, config, follows, progress, overwrite)
    if followed is None:
        console.tell(report, output=str(output))
        return
    console.tell(report, output=str(output), robot={**as_numbers(followed), "output": str(follows)})
    if not console.as_json:
        console.tell(followed, output=str(follows))


def _prepared(config: Config) -> dict[str, Any]:
    """Return the arguments of the transfer to a robot, checked before the long work."""
    from maniport.pipeline.job import checked_control
    from maniport.report.write import export_files
    from maniport.transfer import method_of

    export_files(config.motion.export)
    if config.transfer.method != AUTO:
        method_of(config.transfer.method)
    arm = config.robot.load()
    options = {name: value for name, value in job_of(config, arm).items() if name not in config.human.fit_options}
    control = {name: options[name] for name in vars(config.motion.control(arm))}
    return {"robot": arm, **options, **checked_control(arm, control, config.motion.orientation, True)}


def _followed(
    learned: Any, options: dict[str, Any], config: Config, folder: Path, progress: Progress, overwrite: bool
) -> Report:
    """Transfer the learned profile to a robot, and write the results."""
    from maniport.pipeline import transfer_recording
    from maniport.report.write import write_results

    result = replace(transfer_recording(learned, progress=progress, **options), config=config)
    return write_results(result, folder, progress, config.motion.export, overwrite=overwrite)


def _segments(texts: tuple[str, ...], recordings: int) -> list[str | list[tuple[float, float]]] | None:
    """Convert texts such as 2:4,4:5.6 to times of each recording; auto stays."""
    if not texts:
        return None
    texts = texts * recordings if texts == (AUTO,) else texts
    if len(texts) != recordings:
        raise InvalidInputError(f"--segments is needed for each of the {recordings} recordings; found {len(texts)}")
    return [AUTO if text == AUTO else [_interval(part) for part in text.split(",")] for text in texts]


def _interval(text: str) -> tuple[float, float]:
    try:
        start, stop = map(float, text.split(":"))
    except ValueError:
        raise InvalidInputError(f"--segments must be {AUTO}, or times such as 2:4,4:5.6 [s]; found {text!r}") from None
    return start, stop
