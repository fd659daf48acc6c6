"""The command that checks the motions of a dataset for a robot."""

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from maniport.cli.application import NO_ROBOT, Overwrite, command, output_folder
from maniport.errors import InvalidInputError
from maniport.pipeline.config import Config
from maniport.report.console import Console
from maniport.util.atomic_io import folder_written_whole, require_free
from maniport.util.validation import as_number

if TYPE_CHECKING:
    from maniport.audit.checks import Checks


@command(
    "robot",
    "limits",
    "collisions",
    "table",
    "obstacles",
    "srdf",
    without=("hand_targets",),
    defaults=NO_ROBOT,
    example="maniport audit my_dataset --robot panda --unit rad -o audited",
)
def audit(
    config: Config,
    console: Console,
    dataset: Annotated[
        str,
        typer.Argument(help="LeRobot dataset, file of joint motions, or folder of such files."),
    ],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Folder for the results.")
    ] = None,
    unit: Annotated[
        str | None,
        typer.Option(
            "--unit", help="Unit of revolute joints where the dataset states none: rad, deg."
        ),
    ] = None,
    columns: Annotated[
        str | None,
        typer.Option(
            "--columns", metavar="J1,J2,-,…", help="Joint of each column; - for one that is none."
        ),
    ] = None,
    feature: Annotated[
        str | None,
        typer.Option("--feature", help="Feature, or topic of a bag; default observation.state."),
    ] = None,
    fps: Annotated[
        float | None, typer.Option("--fps", help="Frame rate of a CSV without times [Hz].")
    ] = None,
    fail_on: Annotated[
        str | None,
        typer.Option(
            "--fail-on",
            metavar="KIND,…",
            help="Findings that count: position, velocity, acceleration, torque, collision.",
        ),
    ] = None,
    tolerance: Annotated[
        float, typer.Option("--tolerance", help="Tolerance of limits of resampled motions [%].")
    ] = 5.0,
    processes: Annotated[
        int | None, typer.Option("--processes", help="Processes; default: number of cores.")
    ] = None,
    overwrite: Overwrite = False,
) -> None:
    """Check the motions of a dataset against the limits of a robot.

    Exit code 0 without findings, 1 with findings, 2 where it cannot be decided.
    """
    from joblib import cpu_count

    from maniport.audit.audit import AuditOptions, audit_dataset
    from maniport.audit.write import (
        AUDIT_FILES,
        FRAMES,
        PAGE,
        FrameFile,
        as_numbers,
        lines,
        write_audit,
    )

    if not config.robot:
        raise InvalidInputError("--robot is needed")
    share = as_number(tolerance, "--tolerance [%]", minimum=0.0, maximum=100.0) / 100.0
    options = AuditOptions(
        unit=unit,
        columns=_words(columns),
        feature=feature,
        rate=fps,
        fail_on=_words(fail_on),
        tolerance=share,
        processes=cpu_count() if processes is None else processes,
    )
    folder = output_folder(output, [dataset], config.robot, overwrite)
    require_free(folder, AUDIT_FILES, overwrite)
    with console.progress() as progress:
        checks = _checks(config, share)
        with folder_written_whole(folder, AUDIT_FILES, overwrite) as staging:
            with FrameFile(staging / FRAMES, checks.robot.joint_names) as frames:
                result = audit_dataset(
                    dataset,
                    checks,
                    options,
                    robot_file=str(config.robot[0]),
                    write_frames=frames.write,
                    progress=progress,
                )
            write_audit(staging, result)
    console.name_folder(folder, chosen=output is None)
    text = "\n".join([*lines(result), f"Report {folder / PAGE}"])
    console.finish({**as_numbers(result), "output": str(folder)}, text)
    if result.failed:
        raise typer.Exit(1)


def _words(text: str | None) -> tuple[str, ...]:
    """Split text at commas."""
    if text is None:
        return ()
    return tuple(word.strip() for word in text.split(","))


def _checks(config: Config, tolerance: float) -> "Checks":
    """Load the robot with its limits, without a margin, and its collision model."""
    from maniport.arms.collisions import Collisions
    from maniport.audit.checks import TORQUE, VELOCITY, Checks
    from maniport.motion import MotionLimits
    from maniport.pipeline.robots import load_robot
    from maniport.pipeline.settings import with_limits

    config = config.changed(joint_limit_margin=0.0)
    limited = with_limits(load_robot(config), config)
    robot = limited.robot
    limits = limited.limits
    if limits is None:
        limits = MotionLimits.of(robot, config.limits, 0.0)
    collisions = None
    if config.collisions is not False:
        collisions = Collisions.of(
            limits.arm, table=config.table, obstacles=config.obstacles, srdf=config.srdf
        )
    stated = []
    if config.limits is not None:
        file = os.fspath(str(config.limits))
        for kind, key in ((VELOCITY, "velocity"), (TORQUE, "effort")):
            if file in limits.sources.get(key, ""):
                stated.append(kind)
    return Checks.of(robot, limits, collisions, tolerance, stated)
