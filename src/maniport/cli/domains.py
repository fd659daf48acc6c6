"""Sampling domains, fitting a map between them, and applying it."""

from pathlib import Path
from typing import Annotated

import typer

from maniport.cli.application import (
    AsJson,
    Damping,
    Floor,
    Height,
    Kind,
    Mounting,
    NamedMethod,
    Part,
    Quiet,
    Seed,
    Side,
    app,
    regularization,
    require_npz,
    rotation,
)
from maniport.cli.chain import NO_ROBOT, Chain, takes_chain
from maniport.defaults import AUTO, DAMPING, FIT_METHOD
from maniport.errors import InvalidInputError
from maniport.telling.console import Console
from maniport.telling.facts import facts_of
from maniport.telling.renderings import as_numbers


@app.command(epilog="Example: maniport domain panda -n 16384 -o panda.npz")
@takes_chain
def domain(
    chain: Chain,
    arm: Annotated[str, typer.Argument(help="Name of an arm, or its URDF or MJCF file.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="File of ellipsoids, .npz.")],
    n: Annotated[int, typer.Option("-n", help="Number of ellipsoids.")] = 4096,
    side: Side = AUTO,
    height: Height = None,
    kind: Kind = "velocity",
    part: Part = "translation",
    sequence: Annotated[str, typer.Option(help="sobol or uniform joint samples.")] = "sobol",
    seed: Seed = 0,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Sample the ellipsoids that an arm can make."""
    from maniport.bodies import EllipsoidSpec
    from maniport.domain import sample_domain
    from maniport.files import save_ellipsoids

    console = Console(as_json, quiet)
    require_npz(output)
    body = chain.load(arm, side, height)
    spec = EllipsoidSpec(kind, part)
    ellipsoids = sample_domain(body, n, seed, sequence, spec)
    save_ellipsoids(output, ellipsoids)
    console.finish(
        {"arm": body.name, "frame": body.frame, "ellipsoids": len(ellipsoids), "output": str(output)},
        f"{len(ellipsoids)} {spec} of {body.name} at {body.frame} → {output}",
    )


@app.command(epilog="Example: maniport fit person.npz panda.npz -o adapter.npz")
@takes_chain
def fit(
    chain: Chain,
    teacher: Annotated[Path, typer.Argument(help="Ellipsoids of the teacher's domain, .npz.")],
    student: Annotated[Path, typer.Argument(help="Ellipsoids of the student's domain, .npz.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="File of the adapter, .npz.")],
    method: NamedMethod = FIT_METHOD,
    damping: Damping = DAMPING,
    floor: Floor = None,
    mounting: Mounting = (0.0, 0.0, 0.0),
    unknown_mounting: Annotated[
        bool, typer.Option("--unknown-mounting", help="Search the rotation in all directions (icp).")
    ] = False,
    robot: Annotated[
        str | None, typer.Option("--robot", help="The student's arm, for methods that ask what it can make.")
    ] = None,
    kind: Kind = "velocity",
    part: Part = "translation",
    seed: Seed = 0,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Fit the map from a teacher's domain to a student's."""
    from maniport.bodies import EllipsoidSpec
    from maniport.feasibility import knowing
    from maniport.files import load_ellipsoids
    from maniport.transfer import method_of

    console = Console(as_json, quiet)
    require_npz(output)
    if method == AUTO:
        raise InvalidInputError(f"--method {AUTO} chooses by a motion: use maniport transfer, or name a method")
    if robot is None:
        chain.require_none(NO_ROBOT)
    rho, lowest = regularization(damping, floor)
    teacher_domain, student_domain = load_ellipsoids(teacher)[0], load_ellipsoids(student)[0]
    turn = None if unknown_mounting else rotation(mounting)
    adapter = method_of(method, damping=rho, floor=lowest, mounting=turn, random_state=seed)
    if robot is not None:
        adapter = knowing(adapter, chain.load(robot), EllipsoidSpec(kind, part), random_state=seed)
    with console.progress() as tell:
        tell("fit the adapter", 0.0)
        adapter.fit(teacher_domain, student_domain)
        tell("fit the adapter", 1.0, f"{adapter.n_iter_} iterations, {adapter.stop_reason_}")
    adapter.save(output)
    console.finish({**as_numbers(facts_of(adapter)), "output": str(output)}, f"adapter → {output}")


@app.command(epilog="Example: maniport apply adapter.npz profile.npz -o adapted.npz")
def apply(
    adapter: Annotated[Path, typer.Argument(help="A fitted adapter, .npz.")],
    profile: Annotated[Path, typer.Argument(help="Ellipsoids, .npz.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="File of the adapted ellipsoids, .npz.")],
    inverse: Annotated[bool, typer.Option("--inverse", help="From the student back to the teacher.")] = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
    seed: Seed = 0,
) -> None:
    """Map ellipsoids with a fitted adapter."""
    from maniport.files import load_ellipsoids, save_ellipsoids
    from maniport.transfer import load_adapter

    console = Console(as_json, quiet)
    require_npz(output)
    fitted = load_adapter(adapter)
    points, time = load_ellipsoids(profile)
    with console.progress():  # for the warnings
        mapped = fitted.inverse_transform(points) if inverse else fitted.transform(points)
    save_ellipsoids(output, mapped, time)
    console.finish({"ellipsoids": len(mapped), "output": str(output)}, f"{len(mapped)} ellipsoids → {output}")
