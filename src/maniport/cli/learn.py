"""The command that learns a profile from several demonstrations; a robot may follow it."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer

from maniport.cli.application import NO_ROBOT, RECORDING, Output, Overwrite, command, optional_robot
from maniport.errors import InvalidInputError
from maniport.pipeline.config import Config
from maniport.report.console import Console
from maniport.report.values import Report
from maniport.util.defaults import AUTO
from maniport.util.progress import Progress


@command(
    "human", "robot", "transfer", "motion", "learning", "seed", without=("tips", "pose", "move"), defaults=NO_ROBOT,
    example="maniport learn jumps.bvh --segments auto -o learned;  maniport learn anna.c3d ben.bvh -o learned",
)  # fmt: skip
def learn(
    config: Config,
    console: Console,
    output: Output,
    recordings: Annotated[list[Path] | None, typer.Argument(help=RECORDING)] = None,
    overwrite: Overwrite = False,
) -> None:
    """Learn a profile from several demonstrations of a motion.

    With --robot the robot follows the profile; these results are in OUTPUT-robot.
    """
    from maniport.report.renderings import as_numbers
    from maniport.report.write import LEARNED_FILES
    from maniport.util.atomic_io import require_free

    require_free(output, LEARNED_FILES, overwrite)
    config = config.changed(recording=recordings) if recordings else config
    follows = Path(f"{output}-robot")
    moves = _follows(config, follows, overwrite)
    with console.progress() as progress:
        learned, report = _learned(config, output, overwrite, progress)
        followed = _followed(learned, config, follows, overwrite, progress) if moves else None
    if followed is None:
        console.tell(report, output=str(output))
        return
    console.tell(report, output=str(output), robot={**as_numbers(followed), "output": str(follows)})
    if not console.as_json:
        console.tell(followed, output=str(follows))


def _follows(config: Config, folder: Path, overwrite: bool) -> bool:
    """Return whether a robot follows the profile; its options are checked before the long work."""
    from maniport.pipeline.transfer import settings_of
    from maniport.report.write import RUN_FILES, export_files
    from maniport.util.atomic_io import require_free

    if optional_robot(config) is None:
        if config.motion.export:
            raise InvalidInputError("--export needs --robot")
        return False
    require_free(folder, RUN_FILES, overwrite)
    export_files(config.motion.export)
    settings_of(config)
    return True


def _learned(config: Config, folder: Path, overwrite: bool, progress: Progress) -> tuple[Any, Report]:
    """Learn the profile, and write the results."""
    from maniport.pipeline import learn
    from maniport.report.write import write_results

    parts = _segments(config.learning.segments, len(config.recording))
    options = {**config.human.fit_options, "spec": config.transfer.spec, **config.transfer.regularization}
    options |= {name: getattr(config.learning, name) for name in ("lengths", "components")}
    data = [config.human.read(file) for file in config.recording]
    learned = replace(learn(data, parts, random_state=config.seed, progress=progress, **options), config=config)
    return learned, write_results(learned, folder, progress, overwrite=overwrite)


def _followed(learned: Any, config: Config, folder: Path, overwrite: bool, progress: Progress) -> Report:
    """Transfer the learned profile to a robot, and write the results."""
    from maniport.pipeline import transfer_recording
    from maniport.report.write import write_results

    result = transfer_recording(learned, config, progress=progress)
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
