"""The interactive 3D view."""

import sys
import threading
from pathlib import Path
from typing import Annotated

import typer

from maniport.cli.application import RECORDING, command
from maniport.pipeline.config import Config
from maniport.report.console import Console
from maniport.util.defaults import BOTH


@command(
    "person", "side", "height", "robot", "base_rotation", "seed", without=("hand_targets",),
    example="maniport view;  maniport view --recording ladder;  maniport view --robot ur5.urdf",
)  # fmt: skip
def view(
    config: Config,
    console: Console,
    recording: Annotated[Path | None, typer.Option("--recording", help=RECORDING)] = None,
    adapter: Annotated[Path | None, typer.Option("--adapter", help="A fitted adapter, .npz.")] = None,
    host: Annotated[str, typer.Option(help="Address; other addresses open the page to the network.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(help="Port; 0: a free one.")] = 0,
) -> None:
    """Open an interactive 3D view in the browser; Ctrl-C ends it."""
    from maniport.util.optional import viser
    from maniport.util.ports import is_loopback
    from maniport.util.signals import ending_in_order
    from maniport.viewer.prepare import prepare
    from maniport.viewer.server import LiveView, require_free

    viser()  # a missing package is reported before any long work
    require_free(host, port)
    human, turned = config.human, config.transfer.base_rotation != Config().transfer.base_rotation
    with console.progress() as progress:
        state, method, turn = prepare(
            human.person, config.robot.load(human.side == BOTH), recording=recording, side=human.side,
            height=human.height, adapter=adapter, base_rotation=config.transfer.rotation if turned else None,
            random_state=config.seed, progress=progress,
        )  # fmt: skip
        page = LiveView(state, method, turn, host, port)
    if not is_loopback(host):
        console.warn("the page is open to other machines: whoever has its address can see and move the arms")
    if page.no_surface:
        console.warn(f"the robot is drawn as a skeleton: {page.no_surface}")
    stop = threading.Event()
    try:
        with ending_in_order(stop.set):  # by Ctrl-C or a termination signal; a second one ends at once
            console.finish({"url": page.url}, f"{page.url}  (Ctrl-C ends it)")
            sys.stdout.flush()  # a reader of a pipe waits for it
            page.run(stop)
    finally:
        page.stop()
