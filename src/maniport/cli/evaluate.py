"""Whether a fit is better than doing nothing, and what the paper's experiments give."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from maniport.cli.application import AsJson, Kind, Overwrite, Part, Quiet, Seed, app
from maniport.cli.chain import NO_ROBOT, Chain, takes_chain
from maniport.telling.console import Console

ALL = "all"
"""What is said for every method that there is."""

Methods = Annotated[
    str | None,
    typer.Option("--methods", help="Methods to compare with, separated by commas, or all."),
]


@app.command(
    epilog="Example: maniport evaluate adapter.npz person.npz panda.npz profile.npz --robot panda -o report.md"
)
@takes_chain
def evaluate(
    chain: Chain,
    adapter: Annotated[Path, typer.Argument(help="A fitted adapter, .npz.")],
    teacher: Annotated[Path, typer.Argument(help="The teacher's domain that it was fitted to, .npz.")],
    student: Annotated[Path, typer.Argument(help="The student's domain, .npz.")],
    profile: Annotated[Path, typer.Argument(help="The teacher's ellipsoids along a motion, .npz.")],
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Page to write, .md or .json.")] = None,
    robot: Annotated[str | None, typer.Option("--robot", help="The student's arm, for the feasibility gap.")] = None,
    person: Annotated[str | None, typer.Option("--person", help="The teacher's arm: with it, fresh draws.")] = None,
    truth: Annotated[Path | None, typer.Option("--truth", help="What the profile should become, .npz.")] = None,
    methods: Methods = None,
    kind: Kind = "velocity",
    part: Part = "translation",
    seed: Seed = 0,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Measure a fitted adapter beside doing nothing and other cheap alternatives."""
    from maniport.atomic_io import require_room
    from maniport.bodies import EllipsoidSpec, load_arm
    from maniport.errors import InvalidInputError
    from maniport.evaluation import evaluate as measure
    from maniport.evaluation.baselines import ROWS
    from maniport.files import load_ellipsoids
    from maniport.telling.facts import facts_of
    from maniport.telling.renderings import write_facts
    from maniport.transfer import load_adapter

    console = Console(as_json, quiet)
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


@app.command(epilog="Example: maniport reproduce all -o paper")
def reproduce(
    which: Annotated[str, typer.Argument(help="toy, two-dof, human-robot or all.")] = "all",
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder for tables and figures.")] = Path(
        "maniport-paper"
    ),
    methods: Methods = None,
    overwrite: Overwrite = False,
    seed: Seed = 0,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Run the paper's experiments again: its numbers beside ours, and a figure for each of its figures."""
    from maniport.studies.paper.run import reproduce as run
    from maniport.telling.facts import facts_of

    console = Console(as_json, quiet)
    with console.progress() as tell:
        result = run(which, output, seed, tell, methods=() if methods is None else _rows(methods), overwrite=overwrite)
    console.tell(facts_of(result), output=str(output))


def _rows(methods: str) -> tuple[str, ...]:
    """Rows that are asked for by names with commas."""
    from maniport.evaluation.baselines import EVERY_ROW, as_row

    if methods == ALL:
        return EVERY_ROW
    names = (name.strip() for name in methods.split(","))
    return tuple(as_row(name, "method", ALL) for name in names)
