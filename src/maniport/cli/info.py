"""Commands on names and files: describe them, and draw the figures of a result."""

import json
import shlex
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer

from maniport.cli.application import command
from maniport.errors import FileFormatError, InvalidInputError, UnknownNameError, printable
from maniport.pipeline.config import Config
from maniport.report.console import Console
from maniport.report.renderings import SUMMARY
from maniport.report.values import Metric, Report, Section, numbers, report_of
from maniport.report.values import info as info_metric
from maniport.util.defaults import AUTO, RECORDINGS
from maniport.util.input_limits import KEYPOINTS_BYTES, read_whole


@command(
    *("unit", "fps", "start", "stop", "markers", "side"),
    *("frame", "joints", "base", "lock", "mesh_folders"),
    example="maniport info panda;  maniport info walk.bvh;  maniport info walk.c3d --markers roles.json",
)
def info(
    config: Config,
    console: Console,
    what: Annotated[
        str, typer.Argument(help="Name of an arm, or a file: recording, robot, ellipsoids, adapter; a result folder.")
    ],
) -> None:
    """Describe an arm, a recording, ellipsoids or results."""
    files = [Path(what) / name for name in (SUMMARY, "summary.md")]
    if not all(file.is_file() for file in files):
        console.print_report(_description(what, config))
        return
    for section in ("human", "robot"):
        _require_none(config, section, f"{what!r} is a folder of results")
    data, text = (read_whole(file, (), KEYPOINTS_BYTES).decode("utf-8", "replace") for file in files)
    try:
        values = dict(json.loads(data))
    except (ValueError, TypeError, RecursionError) as error:
        raise FileFormatError(f"{files[0]}: is no summary of a run: {error}") from None
    console.finish(values, "\n".join(map(printable, text.splitlines())), markdown=True)


@command(example="maniport figures maniport-demo -o paper/figures")
def figures(
    console: Console,
    result: Annotated[Path, typer.Argument(help="Folder of transfer, demo, track or learn.")],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Folder for the figures; default: that of the result.")
    ] = None,
) -> None:
    """Draw the figures of a saved result as PNG and SVG files."""
    from maniport.report.figures import write_figures

    with console.progress() as progress:
        progress("Draw figures", 0.0)
        files = write_figures(result, output)
        progress("Draw figures", 1.0, f"{len(files)} files")
    console.finish({"files": [str(file) for file in files]}, "\n".join(map(str, files)))


def _description(what: str, config: Config) -> Report:
    """Describe the thing with a name or a path."""
    if _is_recording(what):
        _require_none(config, "robot", f"{what!r} is a recording")
        from maniport.report.recording import recording_report

        human = config.human
        changes = config.changed(markers=None, side=AUTO).changes("human")
        words = " ".join(word for option in changes for word in option.words(config.value(option.name)))
        return recording_report(
            human.read(what), human.roles(), human.side, command=f"{shlex.quote(what)} {words}".strip()
        )
    _require_none(config.changed(side=AUTO), "human", f"{what!r} is no recording")
    if Path(what).suffix.lower() != ".npz":
        return _of_robot(what, config)
    _require_none(config, "robot", f"{what!r} holds arrays")
    return _of_arrays(what)


def _require_none(config: Config, section: str, why: str) -> None:
    """Raise if an option of a section differs from its default."""
    for option in config.changes(section):
        raise InvalidInputError(f"{option.flag} cannot be used here: {why}")


def _is_recording(what: str) -> bool:
    """Whether it is a recording: of files, all are that are no robots and hold no ellipsoids."""
    from maniport.arms import READERS

    file = Path(what)
    suffix = file.suffix.lower()
    if suffix == ".npz":
        from maniport.util.files import array_names

        return not {"adapter", "manipulability", "path"} & set(array_names(what, "file"))
    if suffix in READERS:
        return False
    if file.is_file() or suffix in RECORDINGS or (file.is_dir() and any(file.glob("*.json"))):
        return True
    from maniport.mocap.readers import SHIPPED

    return what in SHIPPED


def _of_robot(what: str, config: Config) -> Report:
    """Describe an arm and the limbs of its robot; the limbs alone if none of several was chosen."""
    from maniport.arms.loaders import robot_limbs
    from maniport.mocap.readers import SHIPPED
    from maniport.report.robot import robot_report

    try:
        limbs, default = robot_limbs(what)
    except UnknownNameError as error:
        if Path(what).exists():
            raise
        raise UnknownNameError(
            f"{what!r} is no file, no result folder and no bundled recording ({', '.join(SHIPPED)}): {error}"
        ) from None
    robot = replace(config.robot, robot=(what,))
    if limbs and default is None and not robot.frame and not robot.joints:
        return robot_report(what, limbs, None)
    arm: Any = robot.load_arm(config.human.side)
    return robot_report(what, limbs, arm)


def _of_arrays(path: str) -> Report:
    """Describe an adapter, ellipsoids, a path or a robot motion."""
    from maniport.transfer import load_adapter
    from maniport.util.files import array_names, load_arrays, load_ellipsoids, load_path

    names = array_names(path, "file")
    if "adapter" in names:
        return report_of(load_adapter(path))
    is_path = "manipulability" not in names
    values, time = (load_path if is_path else load_ellipsoids)(path)
    n, d = values.shape[:2]
    metrics = [Metric("Path", f"{n} positions", key="count", value=n)]
    if not is_path:
        metrics = [Metric("Ellipsoids", f"{n} of {d} × {d}", key="count", value=n), *numbers(dimension=d)]
    if "joint_names" in names:
        joints = load_arrays(path, "file", ("joint_names",))["joint_names"].tolist()
        metrics.insert(0, info_metric("Robot motion", "joints", joints))
    if time is not None:
        seconds = round(float(time[-1] - time[0]), 3)
        metrics.append(Metric("Duration", f"{seconds:g} s", key="duration", value=seconds, unit="s"))
    return Report(path, "", (Section("", tuple(metrics), key="path" if is_path else "ellipsoids"),))
