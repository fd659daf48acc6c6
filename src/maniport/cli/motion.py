"""Commands that place a path and plan a robot motion, without a person."""

from pathlib import Path
from typing import Annotated, Any

import typer

from maniport.cli.application import Output, Overwrite, command
from maniport.errors import InvalidInputError
from maniport.pipeline.config import CONFIG, Config
from maniport.report.console import Console

Profile = Annotated[Path | None, typer.Argument(help="Target ellipsoids, .npz.")]
HandPath = Annotated[Path | None, typer.Option("--path", help="Positions of the hand, one for each ellipsoid, .npz.")]


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
    from maniport.report.metrics import report_of
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
