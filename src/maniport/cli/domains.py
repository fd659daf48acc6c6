"""Commands on ellipsoids: sample domains, fit a map between them, apply and evaluate it."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer

from maniport.cli.application import NO_ROBOT, Overwrite, command, names_robot, require_suffix
from maniport.errors import InvalidInputError
from maniport.pipeline.config import Config
from maniport.report.console import Console
from maniport.report.renderings import as_numbers, write_report
from maniport.report.values import report_of
from maniport.util.defaults import AUTO

Methods = Annotated[str | None, typer.Option("--methods", help="Methods to compare, separated by commas, or all.")]
TeacherDomain = Annotated[Path, typer.Argument(help="Ellipsoids of the teacher's domain, .npz.")]
StudentDomain = Annotated[Path, typer.Argument(help="Ellipsoids of the student's domain, .npz.")]
Adapter = Annotated[Path, typer.Argument(help="A fitted adapter, .npz.")]
CHAIN = ("frame", "joints", "base", "lock", "mesh_folders")
EllipsoidFile = Annotated[Path, typer.Option("--output", "-o", help="File of ellipsoids, .npz.")]


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
    from maniport.domain import sample_domain
    from maniport.util.files import save_ellipsoids

    require_suffix(output, ".npz")
    human, spec = config.human, config.transfer.spec
    body: Any = replace(config.robot, robot=(arm,)).load_arm(human.side)
    ellipsoids = sample_domain(body, n, config.seed, spec=spec)
    save_ellipsoids(output, ellipsoids)
    console.finish(
        {"arm": body.name, "frame": body.frame, "ellipsoids": len(ellipsoids), "output": str(output)},
        f"{len(ellipsoids)} {spec} of {body.name} at {body.frame} → {output}",
    )


@command(
    "robot", *CHAIN, "method", "damping", "base_rotation", "ellipsoids", "part", "seed",
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
    from maniport.transfer import method_of
    from maniport.util.files import load_ellipsoids

    require_suffix(output, ".npz")
    if (transfer := config.transfer).method == AUTO:
        raise InvalidInputError(f"--method {AUTO} needs a motion: use maniport transfer, or name a method")
    arm, seed = config.robot.load_arm() if names_robot(config) else None, config.seed
    domains = load_ellipsoids(teacher)[0], load_ellipsoids(student)[0]
    rotation = None if unknown_base_rotation else transfer.rotation
    adapter = method_of(transfer.method, damping=transfer.damping or None, base_rotation=rotation, random_state=seed)
    if arm is not None:
        adapter = with_feasible_set(adapter, arm, transfer.spec, random_state=seed)
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
    from maniport.transfer import load_adapter
    from maniport.util.files import load_ellipsoids, save_ellipsoids

    require_suffix(output, ".npz")
    fitted = load_adapter(adapter)
    points, time = load_ellipsoids(profile)
    with console.progress():  # prints warnings
        mapped = fitted.inverse_transform(points) if inverse else fitted.transform(points)
    save_ellipsoids(output, mapped, time)
    console.finish({"ellipsoids": len(mapped), "output": str(output)}, f"{len(mapped)} ellipsoids → {output}")


@command(
    "robot", *CHAIN, "ellipsoids", "part", "seed", without=("hand_targets", "pose"), defaults=NO_ROBOT,
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
    from maniport.evaluation import evaluate
    from maniport.evaluation.metrics import BASELINES
    from maniport.transfer import load_adapter
    from maniport.util.files import load_ellipsoids

    if output is not None:
        require_suffix(output, ".md", ".json")
    arm, fitted = config.robot.load_arm() if names_robot(config) else None, load_adapter(adapter)
    sets = [load_ellipsoids(path)[0] for path in (teacher, student, profile)]
    with console.progress() as progress:
        evaluation = evaluate(
            fitted, *sets, robot=arm, spec=config.transfer.spec, rows=_rows(methods) or BASELINES,
            random_state=config.seed, progress=progress,
        )  # fmt: skip
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
    overwrite: Overwrite = False,
    quick: Annotated[bool, typer.Option("--quick", help="Task study: four recordings on the Panda only.")] = False,
    robots: Annotated[str | None, typer.Option("--robots", help="Task study: robots, separated by commas.")] = None,
    recordings: Annotated[Path | None, typer.Option("--recordings", help="Task study: folder of BVH files.")] = None,
    score: Annotated[Path | None, typer.Option("--score", help="Task study: joint positions to score, .csv.")] = None,
    task: Annotated[Path | None, typer.Option("--task", help="Task study: task of the joints, .json.")] = None,
) -> None:
    """Repeat the paper's experiments, or run the task study."""
    if which == "tasks":
        if overwrite:
            raise InvalidInputError("tasks takes no --overwrite")
        if (score is None) != (task is None):
            raise InvalidInputError("--score and --task: expected both or neither")
        from maniport.studies.tasks.run import score_file, study_tasks

        if score is not None and task is not None:
            console.print_report(score_file(score, task))
            return
        folder = output or Path("maniport-tasks")
        with console.progress() as progress:
            names = [name.strip() for name in robots.split(",")] if robots else ()
            study = study_tasks(folder, config.seed, progress, quick=quick, robots=names, recordings=recordings)
        console.print_report(report_of(study), output=str(folder))
        return
    if quick or robots or recordings or score or task:
        raise InvalidInputError("--quick, --robots, --recordings, --score and --task are options of tasks")
    from maniport.studies.paper.run import reproduce

    output = output or Path("maniport-paper")
    with console.progress() as progress:
        result = reproduce(which, output, config.seed, progress, overwrite=overwrite)
    console.print_report(report_of(result), output=str(output))


def _rows(methods: str | None) -> tuple[str, ...]:
    """Split names of rows at commas; "all" means every row, None the default rows."""
    from maniport.transfer import METHODS
    from maniport.util.validation import as_choice

    if methods is None or methods == "all":
        return tuple(METHODS) if methods else ()
    return tuple(as_choice(name.strip(), "method", (*METHODS, "all")) for name in methods.split(","))
