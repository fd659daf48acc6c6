"""Sampling a domain."""

from pathlib import Path
from typing import Annotated

import typer

from maniport.cli.application import app
from maniport.cli.options import AsJson, Frame, Kind, Part, Quiet, Seed, require_npz
from maniport.telling.console import Console


@app.command(epilog="Example: maniport domain panda -n 16384 -o panda.npz")
def domain(
    arm: Annotated[str, typer.Argument(help="Name of an arm, or its URDF or MJCF file.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="File of ellipsoids, .npz.")],
    n: Annotated[int, typer.Option("-n", help="Number of ellipsoids.")] = 4096,
    frame: Frame = None,
    kind: Kind = "velocity",
    part: Part = "translation",
    sequence: Annotated[str, typer.Option(help="sobol or uniform joint samples.")] = "sobol",
    seed: Seed = 0,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Sample the ellipsoids that an arm can make."""
    from maniport.bodies import EllipsoidSpec, load_arm
    from maniport.domain import sample_domain
    from maniport.files import save_ellipsoids

    console = Console(as_json, quiet)
    require_npz(output)
    body = load_arm(arm, frame=frame)
    spec = EllipsoidSpec(kind, part)
    ellipsoids = sample_domain(body, n, seed, sequence, spec)
    save_ellipsoids(output, ellipsoids)
    console.finish(
        {"arm": body.name, "frame": body.frame, "ellipsoids": len(ellipsoids), "output": str(output)},
        f"{len(ellipsoids)} {spec} of {body.name} at {body.frame} → {output}",
    )
