"""Commands that transfer recordings to robots, and the steps that place a path and plan a motion without a person."""

import os
import sys
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer
from typer.models import OptionInfo

from maniport import pipeline
from maniport.cli.application import (
    NO_ROBOT,
    Output,
    Overwrite,
    command,
    names_robot,
    output_folder,
    require_output,
)
from maniport.errors import InvalidInputError, collected_warnings, unknown_name
from maniport.pipeline.config import BATCH, CONFIG, Config
from maniport.report.console import Console
from maniport.report.describe import report_of
from maniport.report.render import as_numbers
from maniport.util.atomic_io import folder_written_whole, require_free, written
from maniport.util.files import load_ellipsoids, load_path, save_ellipsoids
from maniport.util.process import ending_in_order
from maniport.util.validation import Array, as_times

if TYPE_CHECKING:
    from maniport.batch.table import Row
    from maniport.mocap import Recording
    from maniport.pipeline import Transfer
    from maniport.pipeline.results import MotionResult

DEMOS = ("freeform", "ladder")  # bundled recordings: an easy and a hard one
MOST_FAILURES = 100
"""Recordings that failed, as a batch prints them; the table has all."""
COMPILED_PART = (1.4, 2.4)  # of the easy one [s]; enough to call all that transfers call
COMPILED_SAMPLES = (128, 256)  # of the person and the robot


CAPABILITY_OPTIONS = ("capability", "capability_weight", "direction", "directions")
"""Options of motions of a person, whose force and speed count."""


@command(
    "transfer",
    "motion",
    "payload",
    "payload_center",
    "seed",
    example="maniport demo;  maniport demo ladder -o on-the-ladder",
)
def demo(
    config: Config,
    console: Console,
    recording: Annotated[
        str, typer.Argument(help="Bundled recording: freeform, or ladder (hard).")
    ] = DEMOS[0],
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder for the results.")] = Path(
        "maniport-demo"
    ),
    overwrite: Overwrite = False,
) -> None:
    """Transfer a bundled recording to the Franka Panda."""
    if recording not in DEMOS:
        raise unknown_name("recording", recording, DEMOS)
    transfer(replace(config, recording=(recording,), verb="transfer"), console, output, overwrite)


@command(
    "recording",
    "human",
    "robot",
    "transfer",
    "motion",
    "seed",
    "teacher",
    "teacher_frame",
    "episode",
    "joint_unit",
    "columns",
    example="maniport transfer walk.bvh --robot ur5.urdf -o results",
)
def transfer(
    config: Config, console: Console, output: Output = None, overwrite: Overwrite = False
) -> None:
    """Transfer a recorded arm motion to a robot; with --teacher, that of another robot in a dataset."""
    from maniport.pipeline.results import RESULT_FILES
    from maniport.report.write import export_files, write_results

    export_files(config.export)  # raises where a package is missing
    folder = output_folder(output, [named_recording(config)], config.robot, overwrite)
    require_free(folder, RESULT_FILES, overwrite)
    with console.progress() as progress:
        result: MotionResult
        if config.teacher is not None:
            from maniport.pipeline.robot_teacher import transfer_episode

            named_recording(config)
            result = transfer_episode(config, progress)
        else:
            job = pipeline.Transfer.of(config, progress)
            recording = only_recording(job, config, console)
            result = job.run(job.human(recording))
        report = write_results(result, folder, progress, config.export, overwrite=overwrite)
    console.name_folder(folder, chosen=output is None)
    console.print_report(report, output=str(folder))


def named_recording(config: Config) -> str:
    """Return the name of the only recording of a configuration."""
    if len(config.recording) != 1:
        raise InvalidInputError(
            f"recording: exactly one file is required, as an argument or in --config; found {len(config.recording)}"
        )
    return config.recording[0]


def only_recording(job: "Transfer", config: Config, console: Console) -> "Recording":
    """Read the recording of a configuration; print its warnings before the long work."""
    recording = job.read_part(named_recording(config))
    for text in recording.quality_warnings:
        console.warn(text)
    return recording


def _execution(help: str, *flags: str) -> OptionInfo:
    option: OptionInfo = typer.Option(*flags, help=help, rich_help_panel="Execution")
    return option


@command(example="maniport compile")
def compile(console: Console) -> None:
    """Compile what transfers need, for this processor, so that the first run does not."""
    from maniport.pipeline import transfer_recording

    start, stop = COMPILED_PART
    n_teacher, n_student = COMPILED_SAMPLES
    with console.progress() as progress, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of the short recording
        transfer_recording(
            DEMOS[0],
            progress=progress,
            start=start,
            stop=stop,
            n_teacher=n_teacher,
            n_student=n_student,
        )
    console.finish({"compiled": True}, "Transfers are compiled for this processor.")


@command(
    "recording",
    "human",
    "robot",
    "transfer",
    "motion",
    "batch",
    "seed",
    defaults=BATCH,
    example="maniport batch 'recordings/**/*.bvh' --robot panda -o dataset",
)
def batch(
    config: Config,
    console: Console,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", help="Folder for the results, which a later call continues."
        ),
    ] = None,
    files: Annotated[Path | None, _execution("Text file of recordings, one a line.")] = None,
    packed: Annotated[
        bool, _execution("Write few Parquet files, no folder for each pair.", "--packed")
    ] = False,
    shard: Annotated[
        str | None, _execution("Part i/n, packed; default: task of a Slurm array.")
    ] = None,
    merge: Annotated[bool, _execution("Join the shards of the output folder.", "--merge")] = False,
    processes: Annotated[int | None, _execution("Processes; default: number of cores.")] = None,
    dask: Annotated[str | None, _execution("HOST:PORT of a Dask scheduler.")] = None,
    ray: Annotated[bool, _execution("Use Ray.", "--ray")] = False,
    overwrite: Overwrite = False,
) -> None:
    """Process recordings, folders and patterns on robots; continue an earlier run."""
    from maniport.batch import Clip, PackedDataset, Shard, read_list, transfer_batch
    from maniport.batch.inputs import find_recordings, find_robots
    from maniport.batch.table import PAGE

    if merge:
        if config.recording or files or shard:
            raise InvalidInputError("--merge joins what is done: give --output alone")
        _merge(require_output(output), console)
        return
    recordings: list[str | Clip] = [*config.recording]
    if files is not None:
        with collected_warnings() as texts:
            recordings += read_list(files)
        for text in texts:
            console.warn(text)
    packed = packed or shard is not None
    part = Shard()
    if shard is not None:
        part = Shard.parse(shard)
    elif packed:
        part = Shard.of_slurm(os.environ)
    if output is None:
        find_recordings(recordings, without=Path(os.devnull))
        find_robots(config.robot, config, ())
    folder = require_output(output)
    target: Path | PackedDataset = folder
    if packed:
        target = PackedDataset(folder, str(part))

    try:
        with console.progress() as progress, ending_in_order():
            result = transfer_batch(
                recordings,
                config.robot,
                target,
                config,
                processes=processes,
                dask=dask,
                ray=ray,
                overwrite=overwrite,
                progress=progress,
            )
    except KeyboardInterrupt as interrupted:
        print(f"maniport: interrupted; {str(interrupted) or written()}", file=sys.stderr)
        raise typer.Exit(130) from None
    config.save(result.folder / CONFIG)
    place = f"Overview {folder / PAGE}"
    if packed:
        place = f"Tables {result.folder}"
    values = {"done_before": result.kept, "seconds": result.seconds}
    _finish_batch(console, result.pairs, result.failed, folder, place, values)


def _merge(folder: Path, console: Console) -> None:
    """Join the shards of a packed batch."""
    from maniport.batch import PackedDataset

    with console.progress() as progress:
        merged = PackedDataset(folder).merge(progress)
    _finish_batch(console, merged.pairs, merged.failed, folder, f"Tables {folder}", {})


def _finish_batch(
    console: Console,
    pairs: int,
    failed_rows: Sequence["Row"],
    folder: Path,
    place: str,
    values: Mapping[str, object],
) -> None:
    """Print how many pairs are done and which failed; end with 1 where any did."""
    from maniport.batch.table import failures

    failed = failures(failed_rows)
    count = f"{pairs - len(failed_rows)} of {pairs} pairs are done, {len(failed_rows)} failed"
    lines = [f"{count}{':' if failed else '.'}"]
    for row in failed[:MOST_FAILURES]:
        lines.append(f"  {row['recording']} → {', '.join(row['robots'])}: {row['reason']}")
    if len(failed) > MOST_FAILURES:
        lines.append(f"  and {len(failed) - MOST_FAILURES} more recordings")
    lines.append(place)
    numbers = {"pairs": pairs, "failed": failed, **values}
    console.finish({**numbers, "output": str(folder)}, "\n".join(lines))
    if failed:
        raise typer.Exit(1)


@command(
    "recording",
    "human",
    "robot",
    "transfer",
    "motion",
    "learning",
    "seed",
    defaults=NO_ROBOT,
    example="maniport learn jumps.bvh --segments auto -o learned",
)
def learn(
    config: Config, console: Console, output: Output = None, overwrite: Overwrite = False
) -> None:
    """Learn a profile from several demonstrations of a motion.

    With --robot, a robot follows the profile (folder OUTPUT-robot).
    """
    from maniport.pipeline.results import RESULT_FILES
    from maniport.report.write import export_files, write_results

    folder = output_folder(output, config.recording[:1], config.robot, overwrite, "-robot")
    require_free(folder, RESULT_FILES, overwrite)
    robot_folder = Path(f"{folder}-robot")
    if names_robot(config):  # its options are checked before the long work
        require_free(robot_folder, RESULT_FILES, overwrite)
        export_files(config.export)
        pipeline.settings_of(config)
    followed = None
    with console.progress() as progress:
        learned = pipeline.learn(config.recording, config, progress=progress)
        report = write_results(learned, folder, progress, overwrite=overwrite)
        if config.robot:
            result = pipeline.transfer_recording(learned, config, progress=progress)
            followed = write_results(
                result, robot_folder, progress, config.export, overwrite=overwrite
            )
    robot = {}
    if followed is not None:
        place = str(robot_folder)
        robot = {"robot": {**as_numbers(followed, place), "output": place}}
    console.name_folder(folder, chosen=output is None)
    console.print_report(report, output=str(folder), **robot)
    if followed is not None and not console.as_json:
        console.print_report(followed, output=str(robot_folder))


@command(
    "profile",
    "path",
    "robot",
    "scale",
    "workspace",
    "table",
    "ellipsoids",
    "part",
    "joint_weights",
    "damping",
    "tilt",
    "rank",
    "seed",
    without=("hand_targets", "pose"),
    example="maniport place target_profile.npz --path hand.npz --robot panda --tilt free -o placed",
)
def place(
    config: Config, console: Console, output: Output = None, overwrite: Overwrite = False
) -> None:
    """Find the best placements of a path relative to a robot."""
    from maniport.motion import TargetTrajectory, place_path
    from maniport.pipeline.following import bounded_profiles
    from maniport.pipeline.results import RESULT_FILES
    from maniport.pipeline.settings import plan_options
    from maniport.report.describe.placements import placements_table

    folder = output_folder(output, [_profile(config)], config.robot, overwrite)
    require_free(folder, RESULT_FILES, overwrite)
    files = _targets(config)
    if files.positions is None:
        raise InvalidInputError("--path is needed: a file of positions of the hand")
    spec = config.spec
    arm = pipeline.load_single_arm(config)
    (ellipsoids,) = bounded_profiles([files.ellipsoids], spec)
    plan = plan_options(config, arm)
    targets = TargetTrajectory.checked(
        arm,
        files.time,
        ellipsoids,
        spec=spec.bounded,
        damping=config.damping,
        positions=files.positions,
    )
    with console.progress() as progress:
        ranked = place_path(
            arm,
            targets,
            replace(config.placement, tilt=config.tilt or 0.0),
            plan=plan,
            random_state=config.seed,
            progress=progress,
        )
    if config.rank > len(ranked):
        raise InvalidInputError(
            f"--rank must be at most {len(ranked)}, the number of placements; found {config.rank}"
        )
    placed = ranked[config.rank - 1]
    with folder_written_whole(folder, RESULT_FILES, overwrite) as staging:
        placed.write_data(staging, files.time)
        (profile,) = bounded_profiles([placed.profile], spec)  # of the kind of the options
        save_ellipsoids(staging / "placed_profile.npz", profile, files.time)
        config.save(staging / CONFIG)
    console.name_folder(folder, chosen=output is None)
    report = report_of(placed)
    report.sections[0].tables = (placements_table(ranked),)
    console.print_report(report, output=str(folder))


@command(
    "profile",
    "path",
    "robot",
    "motion",
    "ellipsoids",
    "part",
    "joint_weights",
    "damping",
    "place",
    "seed",
    without=("hand_targets", "pose", "move", *CAPABILITY_OPTIONS),
    example="maniport track placed_profile.npz --robot panda --path path.npz -o motion",
)
def track(
    config: Config, console: Console, output: Output = None, overwrite: Overwrite = False
) -> None:
    """Plan a robot motion that follows a target profile and path."""
    from maniport.arms import Arm
    from maniport.motion import TargetTrajectory
    from maniport.pipeline.results import RESULT_FILES
    from maniport.pipeline.settings import with_limits
    from maniport.report.write import export_files, write_results

    folder = output_folder(output, [_profile(config)], config.robot, overwrite)
    require_free(folder, RESULT_FILES, overwrite)
    export_files(config.export)
    files = _targets(config)
    time = as_times(files.time, f"time of {config.profile!r}", fewest=2)
    without_payload = config.changed(payload=(), payload_center=(0.0, 0.0, 0.0))
    arm = with_limits(pipeline.load_single_arm(without_payload), config).robot
    assert isinstance(arm, Arm)  # limits do not make a group of a single arm
    targets = TargetTrajectory.checked(
        arm,
        time,
        files.ellipsoids,
        positions=files.positions,
        spec=config.spec,
        damping=config.damping,
    )
    with console.progress() as progress:
        result = pipeline.follow_profile(arm, targets, config, progress=progress)
        result = replace(result, config=config)  # with the names and files that were typed
        report = write_results(result, folder, progress, config.export, overwrite=overwrite)
    console.name_folder(folder, chosen=output is None)
    console.print_report(report, output=str(folder))


def _profile(config: Config) -> str:
    """Return the file of the target ellipsoids."""
    if config.profile is None:
        raise InvalidInputError(
            "a file of target ellipsoids is needed, as an argument or in --config"
        )
    return config.profile


class TargetFiles(NamedTuple):
    """What files say of the targets of an arm."""

    ellipsoids: Array  # (n, d, d)
    time: Array  # (n,) [s]
    positions: Array | None  # (n, 3) [m]


def _targets(config: Config) -> TargetFiles:
    """Read ellipsoids, positions if there are some, and the times of either."""
    ellipsoids, time = load_ellipsoids(_profile(config))
    positions = None
    if config.path is not None:
        positions, path_time = load_path(config.path)
        if time is None:
            time = path_time
        elif path_time is not None:
            _require_same_times(time, path_time, config)
    if time is None:
        raise InvalidInputError(
            "the profile has no times; write it with an array 'time' (n,) in seconds"
        )
    return TargetFiles(ellipsoids, time, positions)


def _require_same_times(time: Array, path_time: Array, config: Config) -> None:
    if len(time) == len(path_time) and abs(time - path_time).max() < 1e-6:
        return
    raise InvalidInputError(
        f"{config.path}: its times must be those of {config.profile}, {time[0]:g} to {time[-1]:g} s; "
        f"found {path_time[0]:g} to {path_time[-1]:g} s"
    )
