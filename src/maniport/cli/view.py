"""The live view to play with."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from maniport.cli import application as cli
from maniport.cli.robots import Chain, Pair, takes_chain, takes_pair
from maniport.report.console import Console
from maniport.util.defaults import AUTO, BOTH, PERSON, ROBOT

STRAIGHT = (0.0, 0.0, 0.0)


@cli.app.command(epilog="Example: maniport view;  maniport view --recording ladder;  maniport view --robot ur5.urdf")
@takes_chain
@takes_pair
@cli.prints
def view(
    chain: Chain,
    pair: Pair,
    console: Console,
    person: cli.Person = PERSON,
    side: cli.Side = AUTO,
    height: cli.Height = None,
    robot: cli.Robot = ROBOT,
    recording: Annotated[
        Path | None,
        typer.Option("--recording", help=f"A motion to play. {cli.RECORDING} Or a shipped one, such as ladder."),
    ] = None,
    adapter: Annotated[Path | None, typer.Option("--adapter", help="A fitted adapter to show, .npz.")] = None,
    base_rotation: cli.Mounting = STRAIGHT,
    host: Annotated[
        str, typer.Option("--host", help="Address to listen on; others than the default open the page to others.")
    ] = "127.0.0.1",
    port: Annotated[int, typer.Option("--port", help="Port to listen on; 0 takes a free one.")] = 0,
    seed: cli.Seed = 0,
) -> None:
    """Play with it in the browser: move the person's arm, and the robot follows. Ctrl-C ends it, with exit code 0."""
    from maniport.util.optional import viser
    from maniport.util.ports import is_loopback
    from maniport.viewer.prepare import prepare
    from maniport.viewer.server import LiveView, require_free

    both = side == BOTH
    if not both:
        pair.require_none()
    cli.require_none({"tips": pair.tips}, "is for motions that are planned", "the live view follows at once")
    viser()  # what is missing is told before any long work
    require_free(host, port)
    with console.progress() as tell:
        state, method, turn = prepare(
            person,
            pair.load(robot, chain) if both else chain.load(robot),
            recording=recording,
            side=side,
            height=height,
            adapter=adapter,
            base_rotation=None if base_rotation == STRAIGHT else cli.rotation(base_rotation),
            random_state=seed,
            progress=tell,
        )
        page = LiveView(state, method, turn, host, port)
    if not is_loopback(host):
        console.say("! the page is open to other machines: whoever has its address can see and move the arms")
    if page.no_surface:
        console.say(f"! the robot is shown as a skeleton: {page.no_surface}")

    def announce() -> None:
        console.finish({"url": page.url}, f"{page.url}  (Ctrl-C ends it)")
        sys.stdout.flush()  # who reads it from a pipe waits for it

    try:
        page.run_until_interrupted(announce)
    finally:
        page.stop()
    console.say("Ended.")
