"""The command that learns a profile from several demonstrations; a robot may follow it."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer

from maniport.cli.application import NO_ROBOT, RECORDING, Output, Overwrite, command, optional_robot
from maniport.errors import InvalidInputError
from maniport.pipeline.config import Config
from maniport.report.console import Console
from maniport.util.defaults import AUTO, BOTH


@command(
    "human", "robot", "transfer", "motion", "learning", "seed", without=("move",), defaults=NO_ROBOT,
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
    from maniport.pipeline import transfer_recording
    from maniport.report.renderings import as_numbers
    from maniport.report.write import LEARNED_FILES, write_results
    from maniport.util.atomic_io import require_free

    require_free(output, LEARNED_FILES, overwrite)
    config = config.changed(recording=recordings) if recordings else config
    folder, exports, followed = Path(f"{output}-robot"), config.motion.export, None
    moves = _is_followed(config, folder, overwrite)
    with console.progress() as progress:
        learned = _learned(config, progress)
        report = write_results(learned, output, progress, overwrite=overwrite)
        if moves:
            result = transfer_recording(learned, config, progress=progress)
            followed = write_results(result, folder, progress, exports, overwrite=overwrite)
    robot = {} if followed is None else {"robot": {**as_numbers(followed), "output": str(folder)}}
    console.print_report(report, output=str(output), **robot)
    if followed is not None and not console.as_json:
        console.print_report(followed, output=str(folder))


def _is_followed(config: Config, folder: Path, overwrite: bool) -> bool:
    """Return whether a robot follows the profile; its options are checked before the long work."""
    from maniport.pipeline.transfer import settings_of
    from maniport.report.write import RUN_FILES, export_files
    from maniport.util.atomic_io import require_free

    if optional_robot(config, config.human.side == BOTH) is None:
        if config.motion.export:
            raise InvalidInputError("--export needs --robot")
        return False
    require_free(folder, RUN_FILES, overwrite)
    export_files(config.motion.export)
    settings_of(config)
    return True


def _learned(config: Config, progress: Any) -> Any:
    """Learn the profile from the recordings and segments of a configuration."""
    from maniport.pipeline import learn

    texts, count = config.learning.segments, len(config.recording)
    texts = texts * count if texts == (AUTO,) else texts
    if len(texts) not in (0, count):
        raise InvalidInputError(f"--segments is needed for each of the {count} recordings; found {len(texts)}")
    segments = [AUTO if text == AUTO else [_interval(part) for part in text.split(",")] for text in texts]
    data = [config.human.read(file) for file in config.recording]
    options = {**config.human.fit_options, **config.transfer.regularization, "spec": config.transfer.spec}
    options |= {name: getattr(config.learning, name) for name in ("lengths", "components")}
    learned = learn(data, segments or None, random_state=config.seed, progress=progress, **options)
    return replace(learned, config=config)


def _interval(text: str) -> tuple[float, float]:
    try:
        start, stop = map(float, text.split(":"))
    except ValueError:
        raise InvalidInputError(f"--segments must be {AUTO}, or times such as 2:4,4:5.6 [s]; found {text!r}") from None
    return start, stop
