"""Commands on ellipsoids: sample domains, fit a map between them, apply and evaluate it; the paper's experiments."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from maniport.cli import application as cli
from maniport.cli.robots import NO_ROBOT, Chain, takes_chain
from maniport.errors import InvalidInputError
from maniport.report.console import Console
from maniport.report.metrics import facts_of
from maniport.report.renderings import as_numbers, write_facts
from maniport.util.defaults import AUTO, DAMPING, FIT_METHOD

Methods = Annotated[str | None, typer.Option("--methods", help="Methods to compare with, separated by commas, or all.")]
TeacherDomain = Annotated[Path, typer.Argument(help="Ellipsoids of the teacher's domain, .npz.")]
StudentDomain = Annotated[Path, typer.Argument(help="Ellipsoids of the student's domain, .npz.")]
Adapter = Annotated[Path, typer.Argument(help="A fitted adapter, .npz.")]


@cli.app.command(epilog="Example: maniport domain panda -n 16384 -o panda.npz")
@takes_chain
@cli.prints
def domain(
    chain: Chain,
    console: Console,
    arm: Annotated[str, typer.Argument(help="Name of an arm, or its URDF or MJCF file.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="File of ellipsoids, .npz.")],
    n: Annotated[int, typer.Option("-n", help="Number of ellipsoids.")] = 4096,
    side: cli.Side = AUTO,
    height: cli.Height = None,
    kind: cli.Kind = "velocity",
    part: cli.Part = "translation",
    sequence: Annotated[str, typer.Option(help="sobol or uniform joint samples.")] = "sobol",
    seed: cli.Seed = 0,
) -> None:
    """Sample the ellipsoids of an arm within its joint limits."""
    from maniport.arms import EllipsoidSpec
    from maniport.domain import sample_domain
    from maniport.util.files import save_ellipsoids

    cli.require_npz(output)
    body = chain.load(arm, side, height)
    spec = EllipsoidSpec(kind, part)
    ellipsoids = sample_domain(body, n, seed, sequence, spec)
    save_ellipsoids(output, ellipsoids)
    console.finish(
        {"arm": body.name, "frame": body.frame, "ellipsoids": len(ellipsoids), "output": str(output)},
        f"{len(ellipsoids)} {spec} of {body.name} at {body.frame} → {output}",
    )


@cli.app.command(epilog="Example: maniport fit person.npz panda.npz -o adapter.npz")
@takes_chain
@cli.prints
def fit(
    chain: Chain,
    console: Console,
    teacher: TeacherDomain,
    student: StudentDomain,
    output: Annotated[Path, typer.Option("--output", "-o", help="File of the adapter, .npz.")],
    method: cli.NamedMethod = FIT_METHOD,
    damping: cli.Damping = DAMPING,
    eigenvalue_floor: cli.Floor = None,
    base_rotation: cli.Mounting = (0.0, 0.0, 0.0),
    unknown_mounting: Annotated[
        bool, typer.Option("--unknown-mounting", help="Search the rotation in all directions (icp).")
    ] = False,
    robot: Annotated[
        str | None, typer.Option("--robot", help="The student's arm, for methods that use its feasible set.")
    ] = None,
    kind: cli.Kind = "velocity",
    part: cli.Part = "translation",
    seed: cli.Seed = 0,
) -> None:
    """Fit the map from a teacher's domain to a student's."""
    from maniport.arms import EllipsoidSpec
    from maniport.feasibility import knowing
    from maniport.transfer import method_of
    from maniport.util.files import load_ellipsoids

    cli.require_npz(output)
    if method == AUTO:
        raise InvalidInputError(f"--method {AUTO} chooses by a motion: use maniport transfer, or name a method")
    if robot is None:
        chain.require_none(NO_ROBOT)
    teacher_domain, student_domain = load_ellipsoids(teacher)[0], load_ellipsoids(student)[0]
    turn = None if unknown_mounting else cli.rotation(base_rotation)
    adapter = method_of(method, **cli.regularization(damping, eigenvalue_floor), base_rotation=turn, random_state=seed)
    if robot is not None:
        adapter = knowing(adapter, chain.load(robot), EllipsoidSpec(kind, part), random_state=seed)
    with console.progress() as tell:
        tell("fit the adapter", 0.0)
        adapter.fit(teacher_domain, student_domain)
        tell("fit the adapter", 1.0, f"{adapter.n_iter_} iterations, {adapter.stop_reason_}")
    adapter.save(output)
    console.finish({**as_numbers(facts_of(adapter)), "output": str(output)}, f"adapter → {output}")


@cli.app.command(epilog="Example: maniport apply adapter.npz profile.npz -o adapted.npz")
@cli.prints
def apply(
    console: Console,
    adapter: Adapter,
    profile: Annotated[Path, typer.Argument(help="Ellipsoids, .npz.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="File of the adapted ellipsoids, .npz.")],
    inverse: Annotated[bool, typer.Option("--inverse", help="From the student back to the teacher.")] = False,
    seed: cli.Seed = 0,
) -> None:
    """Map ellipsoids with a fitted adapter."""
    from maniport.transfer import load_adapter
    from maniport.util.files import load_ellipsoids, save_ellipsoids

    cli.require_npz(output)
    fitted = load_adapter(adapter)
    points, time = load_ellipsoids(profile)
    with console.progress():  # shows warnings
        mapped = fitted.inverse_transform(points) if inverse else fitted.transform(points)
    save_ellipsoids(output, mapped, time)
    console.finish({"ellipsoids": len(mapped), "output": str(output)}, f"{len(mapped)} ellipsoids → {output}")


@cli.app.command(
    epilog="Example: maniport evaluate adapter.npz person.npz panda.npz profile.npz --robot panda -o report.md"
)
@takes_chain
@cli.prints
def evaluate(
    chain: Chain,
    console: Console,
    adapter: Adapter,
    teacher: TeacherDomain,
    student: StudentDomain,
    profile: Annotated[Path, typer.Argument(help="The teacher's ellipsoids along a motion, .npz.")],
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Page to write, .md or .json.")] = None,
    robot: Annotated[str | None, typer.Option("--robot", help="The student's arm, for the feasibility gap.")] = None,
    person: Annotated[str | None, typer.Option("--person", help="The teacher's arm, for new random samples.")] = None,
    truth: Annotated[Path | None, typer.Option("--truth", help="True images of the profile, .npz.")] = None,
    methods: Methods = None,
    kind: cli.Kind = "velocity",
    part: cli.Part = "translation",
    seed: cli.Seed = 0,
) -> None:
    """Compare a fitted adapter with baselines, such as no transfer."""
    from maniport.arms import EllipsoidSpec, load_arm
    from maniport.evaluation import evaluate as measure
    from maniport.evaluation.baselines import ROWS
    from maniport.transfer import load_adapter
    from maniport.util.atomic_io import require_room
    from maniport.util.files import load_ellipsoids

    if output is not None and output.suffix not in (".md", ".json"):
        raise InvalidInputError(f"output must end in .md or .json; found {str(output)!r}")
    if output is not None:
        require_room(output)
    if robot is None:
        chain.require_none(NO_ROBOT)
    fitted = load_adapter(adapter)
    sets = [load_ellipsoids(path)[0] for path in (teacher, student, profile)]
    with console.progress() as tell:
        found = measure(
            fitted,
            *sets,
            robot=None if robot is None else chain.load(robot),
            person=None if person is None else load_arm(person),
            truth=None if truth is None else load_ellipsoids(truth)[0],
            spec=EllipsoidSpec(kind, part),
            rows=ROWS if methods is None else _rows(methods),
            random_state=seed,
            progress=tell,
        )
    facts = replace(facts_of(found), title=f"{adapter.name} on {profile.name}")
    if output is not None:
        write_facts(output, facts)
    console.tell(facts)


@cli.app.command(epilog="Example: maniport reproduce all -o paper")
@cli.prints
def reproduce(
    console: Console,
    which: Annotated[str, typer.Argument(help="toy, two-dof, human-robot or all.")] = "all",
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder for tables and figures.")] = Path(
        "maniport-paper"
    ),
    methods: Methods = None,
    overwrite: cli.Overwrite = False,
    seed: cli.Seed = 0,
) -> None:
    """Repeat the paper's experiments: its numbers and ours, and each of its figures."""
    from maniport.studies.paper.run import reproduce as run

    with console.progress() as tell:
        result = run(which, output, seed, tell, methods=() if methods is None else _rows(methods), overwrite=overwrite)
    console.tell(facts_of(result), output=str(output))


def _rows(methods: str) -> tuple[str, ...]:
    """Split names of rows at commas; "all" stands for every row."""
    from maniport.evaluation.baselines import EVERY_ROW, as_row

    if methods == "all":
        return EVERY_ROW
    return tuple(as_row(name.strip(), "method", "all") for name in methods.split(","))
