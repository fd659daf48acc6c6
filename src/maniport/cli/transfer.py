"""Commands that transfer recordings to robots, and the steps that place a path and plan a motion without a person."""

import sys
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer

from maniport.cli.application import NO_ROBOT, RECORDING, Output, Overwrite, command, names_robot
from maniport.errors import InvalidInputError, unknown_name
from maniport.pipeline.config import BATCH, CONFIG, Config
from maniport.report.console import Console
from maniport.util.defaults import AUTO, BOTH

Profile = Annotated[Path | None, typer.Argument(help="Target ellipsoids, .npz.")]
HandPath = Annotated[Path | None, typer.Option("--path", help="Positions of the hand, one for each ellipsoid, .npz.")]
DEMOS = ("freeform", "ladder")  # bundled recordings: an easy and a hard one


@command("transfer", "motion", "payload", "payload_center", "seed",
         example="maniport demo;  maniport demo ladder -o on-the-ladder")  # fmt: skip
def demo(
    config: Config,
    console: Console,
    recording: Annotated[str, typer.Argument(help="Bundled recording: freeform, or ladder (hard).")] = DEMOS[0],
    output: Output = Path("maniport-demo"),
    overwrite: Overwrite = False,
) -> None:
    """Transfer a bundled recording to the Franka Panda."""
    if recording not in DEMOS:
        raise unknown_name("recording", recording, DEMOS)
    transfer(replace(config.changed(recording=recording), verb="transfer"), console, output, overwrite=overwrite)


@command(
    "human", "robot", "transfer", "motion", "seed", example="maniport transfer walk.bvh --robot ur5.urdf -o results"
)
def transfer(
    config: Config,
    console: Console,
    output: Output,
    recording: Annotated[str | None, typer.Argument(help=RECORDING)] = None,
    overwrite: Overwrite = False,
) -> None:
    """Transfer a recorded arm motion to a robot."""
    from maniport.pipeline.transfer import settings_of, transfer_recording
    from maniport.report.write import export_files, require_free_results, write_results

    if recording is not None:
        config = config.changed(recording=recording)
    if len(config.recording) != 1:
        raise InvalidInputError(
            f"recording: exactly one file is required, as an argument or in --config; found {len(config.recording)}"
        )
    require_free_results(output, ("left", "right") if config.human.side == BOTH else (), overwrite)
    export_files(config.motion.export)  # raises where a package is missing
    with console.progress() as progress:
        settings, motion = settings_of(config, progress), config.human.read(config.recording[0])
        console.print(f"{Path(motion.source).stem.capitalize()} → {settings.robot.name}: {motion.duration:.1f} s")
        for text in motion.quality_warnings:  # before the long work, and in the result once more
            console.warn(text)
        result = transfer_recording(motion, settings)
        report = write_results(result, output, progress, config.motion.export, overwrite=overwrite)
    console.print_report(report, output=str(output))


def _execution(help: str, *flags: str) -> Any:
    return typer.Option(*flags, help=help, rich_help_panel="Execution")


@command(
    "human", "robot", "transfer", "motion", "batch", "seed", defaults=BATCH,
    example="maniport batch 'recordings/**/*.bvh' --robot panda -o dataset",
)  # fmt: skip
def batch(
    config: Config,
    console: Console,
    output: Output,
    recordings: Annotated[
        list[str] | None, typer.Argument(help="Recordings, folders of them, and quoted patterns 'a/**/*.bvh'.")
    ] = None,
    processes: Annotated[int | None, _execution("Processes; default: number of cores.")] = None,
    dask: Annotated[str | None, _execution("HOST:PORT of a Dask scheduler.")] = None,
    ray: Annotated[bool, _execution("Use Ray.", "--ray")] = False,
    overwrite: Overwrite = False,
) -> None:
    """Process recordings on robots; resume an interrupted run."""
    from maniport.batch import transfer_batch
    from maniport.batch.table import PAGE, failures
    from maniport.util.process import ending_in_order, interrupt

    config = config.changed(recording=recordings) if recordings else config
    options: dict[str, Any] = {"processes": processes, "dask": dask, "ray": ray, "overwrite": overwrite}
    try:
        with console.progress() as progress, ending_in_order(interrupt):
            result = transfer_batch(config.recording, config.robot.robot, output, config, progress=progress, **options)
    except KeyboardInterrupt as interrupted:
        print(f"maniport: interrupted{f'; {interrupted}' if str(interrupted) else ''}", file=sys.stderr)
        raise typer.Exit(130) from None
    config.save(output / CONFIG)
    failed, pairs = failures(result.failed), len(result.table)
    count = f"{pairs - len(result.failed)} of {pairs} pairs are done, {len(result.failed)} failed"
    lines = [f"  {row['recording']} → {', '.join(row['robots'])}: {row['reason']}" for row in failed]
    values = {"pairs": pairs, "done_before": result.kept, "failed": failed, "seconds": result.seconds}
    text = "\n".join([f"{count}{':' if lines else '.'}", *lines, f"Overview {output / PAGE}"])
    console.finish({**values, "output": str(output)}, text)
    if failed:
        raise typer.Exit(1)


@command(
    "human", "robot", "transfer", "motion", "learning", "seed", without=("move",), defaults=NO_ROBOT,
    example="maniport learn jumps.bvh --segments auto -o learned",
)  # fmt: skip
def learn(
    config: Config,
    console: Console,
    output: Output,
    recordings: Annotated[list[Path] | None, typer.Argument(help=RECORDING)] = None,
    overwrite: Overwrite = False,
) -> None:
    """Learn a profile from several demonstrations of a motion.

    With --robot, a robot follows the profile (folder OUTPUT-robot).
    """
    from maniport.pipeline.transfer import settings_of, transfer_recording
    from maniport.report.renderings import as_numbers
    from maniport.report.write import LEARNED_FILES, RUN_FILES, export_files, write_results
    from maniport.util.atomic_io import require_free

    require_free(output, LEARNED_FILES, overwrite)
    config = config.changed(recording=recordings) if recordings else config
    folder, exports, followed, settings = Path(f"{output}-robot"), config.motion.export, None, None
    if names_robot(config):  # its options are checked before the long work
        require_free(folder, RUN_FILES, overwrite)
        export_files(exports)
        settings = settings_of(config)
    with console.progress() as progress:
        learned = _learned(config, progress)
        report = write_results(learned, output, progress, overwrite=overwrite)
        if settings is not None:
            result = transfer_recording(learned, replace(settings, progress=progress))
            followed = write_results(result, folder, progress, exports, overwrite=overwrite)
    robot = {} if followed is None else {"robot": {**as_numbers(followed), "output": str(folder)}}
    console.print_report(report, output=str(output), **robot)
    if followed is not None and not console.as_json:
        console.print_report(followed, output=str(folder))


def _learned(config: Config, progress: Any) -> Any:
    """Learn the profile from the recordings and segments of a configuration."""
    from maniport.pipeline import learn

    texts, count = config.learning.segments, len(config.recording)
    texts = texts * count if texts == (AUTO,) else texts
    if len(texts) not in (0, count):
        raise InvalidInputError(f"--segments is needed for each of the {count} recordings; found {len(texts)}")
    segments = [AUTO if text == AUTO else [_interval(part) for part in text.split(",")] for text in texts]
    data = [config.human.read(file) for file in config.recording]
    return replace(learn(data, segments or None, config, progress=progress), config=config)


def _interval(text: str) -> tuple[float, float]:
    try:
        start, stop = map(float, text.split(":"))
    except ValueError:
        raise InvalidInputError(f"--segments must be {AUTO}, or times such as 2:4,4:5.6 [s]; found {text!r}") from None
    return start, stop


@command(
    "robot", "scale", "workspace", "table", "ellipsoids", "part", "joint_weights", "damping", "tilt", "rank", "seed",
    without=("hand_targets", "pose"), common=("workspace",),
    example="maniport place target_profile.npz --path hand.npz --robot panda --tilt free -o placed",
)  # fmt: skip
def place(
    config: Config,
    console: Console,
    output: Output,
    profile: Profile = None,
    path: HandPath = None,
    overwrite: Overwrite = False,
) -> None:
    """Find the best placements of a path relative to a robot."""
    from maniport.motion import place_path
    from maniport.motion.placement.placement import DATA_FILES
    from maniport.pipeline.values import bounded_profiles
    from maniport.report.values import report_of
    from maniport.util.atomic_io import folder_written_whole, require_free
    from maniport.util.files import save_ellipsoids

    require_free(output, files := (*DATA_FILES, CONFIG), overwrite)
    config, target, positions, time = _targets(config, profile, path)
    if positions is None:
        raise InvalidInputError("--path is needed: a file of positions of the hand")
    spec = config.transfer.spec
    (targets,) = bounded_profiles([target], spec)
    control, options = config.motion.control(arm := config.robot.load_arm()), config.placement
    with console.progress() as progress:
        placed = place_path(
            positions, targets, arm, time=time, scale=config.motion.scale, tilt=options.tilt,
            workspace=config.motion.bounds.T, rank=options.rank, spec=spec.bounded,
            damping=config.transfer.damping or 0.0, collisions=control.collisions, random_state=config.seed,
            progress=progress,
        )  # fmt: skip
    with folder_written_whole(output, files, overwrite) as staging:
        placed.write_data(staging, time)
        save_ellipsoids(staging / DATA_FILES[0], bounded_profiles([placed.profile], spec)[0], time)  # of that kind
        config.save(staging / CONFIG)
    console.print_report(report_of(placed), output=str(output))


@command(
    "robot", "motion", "ellipsoids", "part", "joint_weights", "damping", "place", "seed",
    without=("hand_targets", "pose", "move"),
    example="maniport track placed_profile.npz --robot panda --path path.npz -o motion",
)  # fmt: skip
def track(
    config: Config,
    console: Console,
    output: Output,
    profile: Profile = None,
    path: HandPath = None,
    overwrite: Overwrite = False,
) -> None:
    """Plan a robot motion that follows a target profile and path."""
    from maniport.pipeline import follow_profile
    from maniport.report.write import EXECUTION_FILES, export_files, write_results
    from maniport.util.atomic_io import require_free
    from maniport.util.validation import as_times

    require_free(output, EXECUTION_FILES, overwrite)
    export_files(config.motion.export)
    config, target, positions, time = _targets(config, profile, path)
    arm, paths = config.robot.load_arm(), None if positions is None else [positions]
    time = None if time is None else as_times(time, f"time of {config.profile!r}", fewest=2)
    with console.progress() as progress:
        result = follow_profile(arm, [target], time, paths, config, progress=progress)
        report = write_results(result, output, progress, config.motion.export, overwrite=overwrite)
    console.print_report(report, output=str(output))


def _targets(config: Config, profile: Path | None, path: Path | None) -> tuple[Config, Any, Any, Any]:
    """Read ellipsoids, positions if there are some, and the times of either; a typed profile has a path of its own."""
    from maniport.util.files import load_ellipsoids, load_path

    if profile is not None:
        config = config.changed(profile=profile, path=path)
    elif path is not None:
        config = config.changed(path=path)
    if config.profile is None:
        raise InvalidInputError("a file of target ellipsoids is needed, as an argument or in --config")
    target, time = load_ellipsoids(config.profile)
    positions, path_time = (None, None) if config.path is None else load_path(config.path)
    times = [values for values in (time, path_time) if values is not None]
    if len(times) == 2 and not (len(times[0]) == len(times[1]) and abs(times[0] - times[1]).max() < 1e-6):
        raise InvalidInputError(
            f"{config.path}: its times must be those of {config.profile}, {times[0][0]:g} to {times[0][-1]:g} s; "
            f"found {times[1][0]:g} to {times[1][-1]:g} s"
        )
    return config, target, positions, path_time if time is None else time
