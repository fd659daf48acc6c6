"""What an arm or a file is."""

from pathlib import Path
from typing import Annotated

import typer

from maniport.cli.application import AsJson, Quiet, Seed, app
from maniport.cli.chain import Chain, takes_chain
from maniport.telling.console import Console
from maniport.telling.facts import Fact, Facts, Section, facts_of


@app.command(epilog="Example: maniport info panda;  maniport info adapter.npz;  maniport info walk.bvh")
@takes_chain
def info(
    chain: Chain,
    what: Annotated[str, typer.Argument(help="Name of an arm, or a file: recording, ellipsoids, adapter, URDF, MJCF.")],
    as_json: AsJson = False,
    quiet: Quiet = False,
    seed: Seed = 0,
) -> None:
    """Tell what an arm or a file is."""
    console = Console(as_json, quiet)
    console.tell(_facts(what, chain))


def _facts(what: str, chain: Chain) -> Facts:
    """Tell what a name or a file is, by its ending."""
    suffix = Path(what).suffix.lower()
    if suffix == ".npz":
        return _of_arrays(what)
    if suffix in (".bvh", ".c3d"):
        from maniport.demonstrations import read_recording

        return facts_of(read_recording(what))
    return facts_of(chain.load(what))


def _of_arrays(path: str) -> Facts:
    from maniport.files import array_names, load_ellipsoids
    from maniport.transfer import load_adapter

    known = array_names(path, "file")
    if "adapter" in known:
        return facts_of(load_adapter(path))
    if "positions" in known:
        from maniport.demonstrations import read_recording

        return facts_of(read_recording(path))
    points, time = load_ellipsoids(path)
    n, d = points.shape[:2]
    facts = [Fact("Ellipsoids", f"{n} of {d} × {d}", key="count", value=n), Fact("", "", key="dimension", value=d)]
    if time is not None:
        seconds = round(float(time[-1] - time[0]), 3)
        facts.append(Fact("Duration", f"{seconds:g} s", key="duration", value=seconds, unit="s"))
    return Facts(path, "", (Section("", tuple(facts), key="ellipsoids"),))
