"""Commands on names and files: describe them; sample domains, fit a map between them, apply and evaluate it."""

import json
import shlex
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

import maniport
from maniport import pipeline
from maniport.cli.application import (
    NO_ROBOT,
    Overwrite,
    command,
    names_robot,
    require_output,
    require_suffix,
)
from maniport.errors import FileFormatError, InvalidInputError, UnknownNameError, printable
from maniport.pipeline.config import Config
from maniport.pipeline.options import MOST_SAMPLES, OPTIONS
from maniport.report.console import Console
from maniport.report.describe import report_of
from maniport.report.render import SUMMARY, as_numbers, write_report
from maniport.report.values import Report, Section
from maniport.util.defaults import ABOUT, AUTO, RECORDINGS, SHIPPED
from maniport.util.files import array_names, load_ellipsoids, load_path, save_ellipsoids
from maniport.util.input_limits import KEYPOINTS_BYTES, read_whole
from maniport.util.validation import as_count

Methods = Annotated[
    str | None, typer.Option("--methods", help="Methods to compare, separated by commas, or all.")
]
TeacherDomain = Annotated[Path, typer.Argument(help="Ellipsoids of the teacher's domain, .npz.")]
StudentDomain = Annotated[Path, typer.Argument(help="Ellipsoids of the student's domain, .npz.")]
Adapter = Annotated[Path, typer.Argument(help="A fitted adapter, .npz.")]
EllipsoidFile = Annotated[
    Path | None, typer.Option("--output", "-o", help="File of ellipsoids, .npz.")
]


@command(
    "frame",
    "joints",
    "base",
    "lock",
    "mesh_folders",
    "xacro_args",
    "side",
    "ellipsoids",
    "part",
    "seed",
    example="maniport domain panda -n 16384 -o panda.npz",
)
def domain(
    config: Config,
    console: Console,
    arm: Annotated[str, typer.Argument(help="Name of an arm, or its URDF or MJCF file.")],
    output: EllipsoidFile = None,
    n: Annotated[int, typer.Option("-n", help="Number of ellipsoids.")] = 4096,
) -> None:
    """Sample the ellipsoids of an arm within its joint limits."""
    require_suffix(output, ".npz")
    body = pipeline.load_single_arm(config.changed(robot=arm), config.side)
    spec = config.spec
    as_count(n, "n", maximum=MOST_SAMPLES)
    file = require_output(output)
    ellipsoids = maniport.sample_domain(body, n, config.seed, spec=spec)
    save_ellipsoids(file, ellipsoids)
    console.finish(
        {
            "arm": body.name,
            "frame": body.frame,
            "ellipsoids": len(ellipsoids),
            "output": str(file),
        },
        f"{len(ellipsoids)} {spec} of {body.name} at {body.frame} → {file}",
    )


@command(
    "robot",
    "method",
    "damping",
    "base_rotation",
    "ellipsoids",
    "part",
    "seed",
    without=("hand_targets", "pose"),
    defaults=NO_ROBOT.changed(method="icp"),
    example="maniport fit person.npz panda.npz -o adapter.npz",
)
def fit(
    config: Config,
    console: Console,
    teacher: TeacherDomain,
    student: StudentDomain,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="File of the adapter, .npz.")
    ] = None,
) -> None:
    """Fit the map from a teacher's domain to a student's."""
    from maniport.evaluation.comparison import with_feasible_set
    from maniport.pipeline.settings import adapter_of

    require_suffix(output, ".npz")
    if config.method == AUTO:
        raise InvalidInputError(
            f"--method {AUTO} needs a motion: use maniport transfer, or name a method"
        )
    arm = None
    if names_robot(config):
        arm = pipeline.load_single_arm(config)
    domains = load_ellipsoids(teacher)[0], load_ellipsoids(student)[0]
    file = require_output(output)
    adapter = with_feasible_set(adapter_of(config), arm, config.spec, random_state=config.seed)
    with console.progress() as progress:
        progress("Fit transfer", 0.0)
        adapter.fit(*domains)
        progress("Fit transfer", 1.0, f"{adapter.n_iter_} iterations, {adapter.stop_reason_}")
    adapter.save(file)
    console.finish({**as_numbers(report_of(adapter)), "output": str(file)}, f"adapter → {file}")


@command(example="maniport apply adapter.npz profile.npz -o adapted.npz")
def apply(
    console: Console,
    adapter: Adapter,
    profile: Annotated[Path, typer.Argument(help="Ellipsoids, .npz.")],
    output: EllipsoidFile = None,
) -> None:
    """Map ellipsoids with a fitted adapter."""
    require_suffix(output, ".npz")
    fitted = maniport.load_adapter(adapter)
    points, time = load_ellipsoids(profile)
    file = require_output(output)
    with console.progress():  # prints warnings
        mapped = fitted.transform(points)
    save_ellipsoids(file, mapped, time)
    console.finish(
        {"ellipsoids": len(mapped), "output": str(file)}, f"{len(mapped)} ellipsoids → {file}"
    )


@command(
    "robot",
    "ellipsoids",
    "part",
    "seed",
    without=("hand_targets", "pose"),
    defaults=NO_ROBOT,
    example="maniport evaluate adapter.npz person.npz panda.npz profile.npz --robot panda -o report.md",
)
def evaluate(
    config: Config,
    console: Console,
    adapter: Adapter,
    teacher: TeacherDomain,
    student: StudentDomain,
    profile: Annotated[Path, typer.Argument(help="The teacher's ellipsoids along a motion, .npz.")],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Report, .md or .json.")
    ] = None,
    methods: Methods = None,
) -> None:
    """Compare a fitted adapter with baselines."""
    from maniport.evaluation.metrics import BASELINES
    from maniport.transfer import METHODS

    if output is not None:
        require_suffix(output, ".md", ".json")
    arm = None
    if names_robot(config):
        arm = pipeline.load_single_arm(config)
    fitted = maniport.load_adapter(adapter)
    sets = [load_ellipsoids(path)[0] for path in (teacher, student, profile)]
    rows: Sequence[str] = BASELINES
    if methods == "all":
        rows = list(METHODS)
    elif methods is not None:
        rows = [name.strip() for name in methods.split(",")]
    with console.progress() as progress:
        evaluation = maniport.evaluate(
            fitted,
            *sets,
            robot=arm,
            spec=config.spec,
            rows=rows,
            random_state=config.seed,
            progress=progress,
        )
    report = replace(report_of(evaluation), title=f"{adapter.name} on {profile.name}")
    if output is not None:
        write_report(output, report)
    console.print_report(report)


@command("seed", example="maniport reproduce all -o paper")
def reproduce(
    config: Config,
    console: Console,
    which: Annotated[str, typer.Argument(help="toy, two-dof, human-robot, or all.")] = "all",
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder for the results.")] = Path(
        "maniport-paper"
    ),
    overwrite: Overwrite = False,
) -> None:
    """Repeat the paper's experiments."""
    from maniport.studies.run import reproduce

    with console.progress() as progress:
        report = reproduce(which, output, config.seed, progress, overwrite=overwrite)
    console.print_report(report, output=str(output))


@command(
    *("unit", "height", "fps", "start", "stop", "markers", "side"),
    *("frame", "joints", "base", "lock", "mesh_folders", "xacro_args"),
    example="maniport info panda;  maniport info walk.bvh;  maniport info walk.c3d --markers roles.json",
)
def info(
    config: Config,
    console: Console,
    what: Annotated[
        str,
        typer.Argument(
            help="Name of an arm, or a file: recording, robot, ellipsoids, adapter; a result folder."
        ),
    ],
) -> None:
    """Describe an arm, a recording, ellipsoids or results."""
    files = [Path(what) / name for name in (SUMMARY, "summary.md")]
    if not all(file.is_file() for file in files):
        console.print_report(_description(what, config))
        return
    _require_none(config, f"{what!r} is a folder of results", "human", "robot")
    data, text = (
        read_whole(file, (), KEYPOINTS_BYTES).decode("utf-8", "replace") for file in files
    )
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
        Path | None,
        typer.Option("--output", "-o", help="Folder for the figures; default: that of the result."),
    ] = None,
) -> None:
    """Draw the figures of a saved result as PNG and SVG files."""
    with console.progress():
        files = maniport.write_figures(result, output)
    console.finish({"files": [str(file) for file in files]}, "\n".join(map(str, files)))


def _description(what: str, config: Config) -> Report:
    """Describe the thing with a name or a path."""
    if _is_recording(what):
        from maniport.pipeline.settings import marker_roles
        from maniport.report.describe.recordings import recording_report

        _require_none(config, f"{what!r} is a recording", "robot")
        changes = config.changed(markers=None, side=AUTO).changes("human")
        words = [shlex.quote(what)]
        for name, value in changes.items():
            words += OPTIONS[name].words(value)
        return recording_report(
            pipeline.read_part(what, config),
            marker_roles(config),
            config.side,
            command=" ".join(words),
        )
    _require_none(config.changed(side=AUTO), f"{what!r} is no recording", "human")
    if Path(what).is_dir():
        raise FileFormatError(
            f"{what}: this folder holds no results ({SUMMARY}) and no keypoints (*.json)"
        )
    if Path(what).suffix.lower() != ".npz":
        return _of_robot(what, config)
    _require_none(config, f"{what!r} holds arrays", "robot")
    return _of_arrays(what)


def _require_none(config: Config, reason: str, *sections: str) -> None:
    """Raise if an option of a section differs from its default."""
    for section in sections:
        for name in config.changes(section):
            raise InvalidInputError(f"{OPTIONS[name].flag} cannot be used here: {reason}")


def _is_recording(what: str) -> bool:
    """Whether it is a recording: of files, all are that are no robots and hold no ellipsoids."""
    from maniport.arms.loaders import READERS

    file = Path(what)
    suffix = file.suffix.lower()
    if (file / ABOUT).is_file():
        raise InvalidInputError(
            f"{what!r} is the folder of a batch: its page has an overview; name the folder of a pair, "
            f"{file / 'ROBOT' / 'RECORDING'}"
        )
    if suffix == ".npz":
        return not {"adapter", "manipulability", "path"} & set(array_names(what, "file"))
    if suffix in READERS:
        return False
    folder = file.is_dir() and any(file.glob("*.json"))
    return file.is_file() or suffix in RECORDINGS or folder or what in SHIPPED


def _of_robot(what: str, config: Config) -> Report:
    """Describe an arm and the limbs of its robot; the limbs alone if none of several was chosen."""
    from maniport.arms.loaders import robot_limbs
    from maniport.report.describe.robots import robot_report

    try:
        limbs, default = robot_limbs(what, config.mesh_folders, config.xacro_args)
    except UnknownNameError as error:
        if Path(what).exists():
            raise
        raise UnknownNameError(
            f"{what!r} is no file, no result folder and no bundled recording ({', '.join(SHIPPED)}): {error}"
        ) from None
    is_ambiguous = limbs and default is None and not config.frame and not config.joints
    arm = None
    if not is_ambiguous:
        arm = pipeline.load_single_arm(config.changed(robot=what), config.side)
    return robot_report(what, limbs, arm)


def _of_arrays(path: str) -> Report:
    """Describe an adapter, ellipsoids, a path or a robot motion."""
    names = array_names(path, "file")
    if "adapter" in names:
        return report_of(maniport.load_adapter(path))
    if "manipulability" in names:
        ellipsoids, time = load_ellipsoids(path)
        n, d = ellipsoids.shape[:2]
        section = Section("", key="ellipsoids")
        section.add("Ellipsoids", "count", n, f"{n} of {d} × {d}")
        section.numbers(dimension=d)
    else:
        positions, time = load_path(path)
        n = len(positions)
        section = Section("", key="path")
        section.add("Path", "count", n, f"{n} positions")
    if time is not None:
        seconds = round(float(time[-1] - time[0]), 3)
        section.add("Duration", "duration", seconds, f"{seconds:g} s", unit="s")
    return Report(path, "", (section,))
