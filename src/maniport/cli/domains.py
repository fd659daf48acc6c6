"""Commands on ellipsoids: sample domains, fit a map between them, apply and evaluate it."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

import maniport
from maniport.cli.application import NO_ROBOT, Overwrite, command, names_robot, require_suffix
from maniport.errors import InvalidInputError
from maniport.pipeline.config import Config
from maniport.report.console import Console
from maniport.report.renderings import as_numbers, write_report
from maniport.report.values import report_of
from maniport.util.defaults import AUTO
from maniport.util.files import load_ellipsoids, save_ellipsoids
from maniport.util.validation import as_choice

Methods = Annotated[str | None, typer.Option("--methods", help="Methods to compare, separated by commas, or all.")]
TeacherDomain = Annotated[Path, typer.Argument(help="Ellipsoids of the teacher's domain, .npz.")]
StudentDomain = Annotated[Path, typer.Argument(help="Ellipsoids of the student's domain, .npz.")]
Adapter = Annotated[Path, typer.Argument(help="A fitted adapter, .npz.")]
EllipsoidFile = Annotated[Path, typer.Option("--output", "-o", help="File of ellipsoids, .npz.")]
CHAIN = ("frame", "joints", "base", "lock", "mesh_folders")


@command(*CHAIN, "side", "ellipsoids", "part", "seed", common=("ellipsoids", "part"),
         example="maniport domain panda -n 16384 -o panda.npz")  # fmt: skip
def domain(
    config: Config,
    console: Console,
    arm: Annotated[str, typer.Argument(help="Name of an arm, or its URDF or MJCF file.")],
    output: EllipsoidFile,
    n: Annotated[int, typer.Option("-n", help="Number of ellipsoids.")] = 4096,
) -> None:
    """Sample the ellipsoids of an arm within its joint limits."""
    from maniport.pipeline.settings import load_single_arm

    require_suffix(output, ".npz")
    body, spec = load_single_arm(config.changed(robot=arm), config.side), config.spec
    ellipsoids = maniport.sample_domain(body, n, config.seed, spec=spec)
    save_ellipsoids(output, ellipsoids)
    console.finish(
        {"arm": body.name, "frame": body.frame, "ellipsoids": len(ellipsoids), "output": str(output)},
        f"{len(ellipsoids)} {spec} of {body.name} at {body.frame} → {output}",
    )


@command(
    "robot", "method", "damping", "base_rotation", "ellipsoids", "part", "seed",
    common=("damping", "base_rotation"), defaults=NO_ROBOT.changed(method="icp"),
    without=("hand_targets", "pose"),
    example="maniport fit person.npz panda.npz -o adapter.npz",
)  # fmt: skip
def fit(
    config: Config,
    console: Console,
    teacher: TeacherDomain,
    student: StudentDomain,
    output: Annotated[Path, typer.Option("--output", "-o", help="File of the adapter, .npz.")],
    unknown_base_rotation: Annotated[
        bool, typer.Option("--unknown-base-rotation", help="Search all base rotations (icp).")
    ] = False,
) -> None:
    """Fit the map from a teacher's domain to a student's."""
    from maniport.evaluation.comparison import with_feasible_set
    from maniport.pipeline.settings import load_single_arm
    from maniport.transfer import method_of

    require_suffix(output, ".npz")
    if config.method == AUTO:
        raise InvalidInputError(f"--method {AUTO} needs a motion: use maniport transfer, or name a method")
    arm = load_single_arm(config) if names_robot(config) else None
    domains = load_ellipsoids(teacher)[0], load_ellipsoids(student)[0]
    rotation, damping = None if unknown_base_rotation else config.rotation, config.damping or None
    adapter = method_of(config.method, damping=damping, base_rotation=rotation, random_state=config.seed)
    adapter = with_feasible_set(adapter, arm, config.spec, random_state=config.seed)
    with console.progress() as progress:
        progress("Fit transfer", 0.0)
        adapter.fit(*domains)
        progress("Fit transfer", 1.0, f"{adapter.n_iter_} iterations, {adapter.stop_reason_}")
    adapter.save(output)
    console.finish({**as_numbers(report_of(adapter)), "output": str(output)}, f"adapter → {output}")


@command(example="maniport apply adapter.npz profile.npz -o adapted.npz")
def apply(
    console: Console,
    adapter: Adapter,
    profile: Annotated[Path, typer.Argument(help="Ellipsoids, .npz.")],
    output: EllipsoidFile,
    inverse: Annotated[bool, typer.Option("--inverse", help="Map from student to teacher.")] = False,
) -> None:
    """Map ellipsoids with a fitted adapter."""
    require_suffix(output, ".npz")
    fitted = maniport.load_adapter(adapter)
    points, time = load_ellipsoids(profile)
    with console.progress():  # prints warnings
        mapped = fitted.inverse_transform(points) if inverse else fitted.transform(points)
    save_ellipsoids(output, mapped, time)
    console.finish({"ellipsoids": len(mapped), "output": str(output)}, f"{len(mapped)} ellipsoids → {output}")


@command(
    "robot", "ellipsoids", "part", "seed", without=("hand_targets", "pose"), defaults=NO_ROBOT,
    example="maniport evaluate adapter.npz person.npz panda.npz profile.npz --robot panda -o report.md",
)  # fmt: skip
def evaluate(
    config: Config,
    console: Console,
    adapter: Adapter,
    teacher: TeacherDomain,
    student: StudentDomain,
    profile: Annotated[Path, typer.Argument(help="The teacher's ellipsoids along a motion, .npz.")],
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Report, .md or .json.")] = None,
    methods: Methods = None,
) -> None:
    """Compare a fitted adapter with baselines."""
    from maniport.evaluation.summary import BASELINES
    from maniport.pipeline.settings import load_single_arm

    if output is not None:
        require_suffix(output, ".md", ".json")
    arm, fitted = load_single_arm(config) if names_robot(config) else None, maniport.load_adapter(adapter)
    sets = [load_ellipsoids(path)[0] for path in (teacher, student, profile)]
    rows = _rows(methods) or BASELINES
    with console.progress() as progress:
        evaluation = maniport.evaluate(
            fitted, *sets, robot=arm, spec=config.spec, rows=rows, random_state=config.seed, progress=progress
        )
    report = replace(report_of(evaluation), title=f"{adapter.name} on {profile.name}")
    if output is not None:
        write_report(output, report)
    console.print_report(report)


@command("seed", example="maniport reproduce all -o paper")
def reproduce(
    config: Config,
    console: Console,
    which: Annotated[str, typer.Argument(help="toy, two-dof, human-robot, all, or tasks.")] = "all",
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Folder for the results.")] = None,
    methods: Methods = None,
    overwrite: Overwrite = False,
    quick: Annotated[bool, typer.Option("--quick", help="Task study: four recordings on the Panda only.")] = False,
    robots: Annotated[str | None, typer.Option("--robots", help="Task study: robots, separated by commas.")] = None,
    recordings: Annotated[Path | None, typer.Option("--recordings", help="Task study: folder of BVH files.")] = None,
    score: Annotated[Path | None, typer.Option("--score", help="Task study: joint positions to score, .csv.")] = None,
    task: Annotated[Path | None, typer.Option("--task", help="Task study: task of the joints, .json.")] = None,
) -> None:
    """Repeat the paper's experiments, or run the task study."""
    if which != "tasks":
        if quick or robots or recordings or score or task:
            raise InvalidInputError("--quick, --robots, --recordings, --score and --task are options of tasks")
        from maniport.studies.paper.run import reproduce

        output = output or Path("maniport-paper")
        with console.progress() as progress:
            result = reproduce(which, output, config.seed, progress, methods=_rows(methods), overwrite=overwrite)
        console.print_report(report_of(result), output=str(output))
        return
    if methods is not None or overwrite:
        raise InvalidInputError("tasks takes no --methods or --overwrite")
    if (score is None) != (task is None):
        raise InvalidInputError("--score and --task: expected both or neither")
    from maniport.studies.tasks.run import score_file, study_tasks

    if score is not None and task is not None:
        console.print_report(score_file(score, task))
        return
    output = output or Path("maniport-tasks")
    names = [name.strip() for name in robots.split(",")] if robots else ()
    with console.progress() as progress:
        study = study_tasks(output, config.seed, progress, quick=quick, robots=names, recordings=recordings)
    console.print_report(report_of(study), output=str(output))


def _rows(methods: str | None) -> tuple[str, ...]:
    """Split names of rows at commas; "all" means every row, None the default rows."""
    from maniport.transfer import METHODS

    if methods is None or methods == "all":
        return tuple(METHODS) if methods else ()
    return tuple(as_choice(name.strip(), "method", (*METHODS, "all")) for name in methods.split(","))
