"""The command with which a robot follows a moving person: frames in, joint positions out."""

import gc
import io
import os
import socket
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from maniport.cli.application import command
from maniport.errors import InvalidInputError
from maniport.pipeline.config import Config
from maniport.report.console import Console
from maniport.util.defaults import AUTO, BOTH
from maniport.util.ports import LOOPBACK, is_loopback
from maniport.util.signals import ending_in_order

if TYPE_CHECKING:
    from maniport.live.transport import Datagrams, Pipe


def _transport(help: str, *flags: str) -> Any:
    return typer.Option(*flags, help=help, rich_help_panel="Transport")


@command(
    "human", "robot", "transfer", "motion", "seed", without=("hand_targets", "move", "export"),
    example="maniport live walk.bvh --robot ur5.urdf --udp 9000;  sensor | maniport live walk.bvh",
)  # fmt: skip
def live(
    config: Config,
    console: Console,
    recording: Annotated[Path, typer.Argument(help="Recording of the same person and points")],
    udp: Annotated[int | None, _transport("UDP port for frames instead of standard input; 0: a free one.")] = None,
    host: Annotated[str, _transport("Address of that port; other addresses open it to the network.")] = LOOPBACK,
    send: Annotated[int | None, _transport("UDP port for answers; default: the sender's.")] = None,
    no_drop: Annotated[
        bool, _transport("Process every frame in order; otherwise skip to the newest.", "--no-drop")
    ] = False,
) -> None:
    """Follow a moving person: points in, joint positions out.

    The recording is transferred first, as by maniport transfer: it determines segment lengths, points and placement.
    The first line of output describes the expected frames, such as {"t": 0.02, "points": {"NAME": [0.1, 0.2, 0.3]}};
    each frame is answered by one line. Ctrl-C stops the robot and ends the command with exit code 0.
    """
    from maniport.mocap.arm_ik import require_person

    human = config.human
    require_person(human.person, AUTO if human.side == BOTH else human.side, human.height)
    transport = _opened(udp, host, send)  # ports that cannot be opened are reported before any long work
    with console.progress() as progress:
        from threadpoolctl import threadpool_limits

        from maniport.live import Live
        from maniport.live.serving import Server
        from maniport.pipeline import transfer_recording

        motion = config.human.read(recording)
        for text in motion.quality_warnings:
            console.warn(text)
        result = transfer_recording(motion, config, progress=progress)
        follower = Live.of(result, progress=progress)
    if udp is not None and not is_loopback(host):
        console.warn("the port accepts frames from other machines, which can move the robot")
    stop, signal = socket.socketpair()
    gc.collect()
    gc.freeze()  # objects that exist now stay, and need not be scanned while frames wait
    try:
        with stop, signal, threadpool_limits(1), ending_in_order(lambda: signal.send(b"!")):
            summary = Server(follower, transport, stop, no_drop).run()
    finally:
        gc.unfreeze()
    console.print(str(summary))
    if udp is None and summary.skipped > summary.answered:
        console.warn("most frames were skipped, since they arrived faster than recorded; --no-drop processes all")


def _opened(udp: int | None, host: str, send: int | None) -> "Pipe | Datagrams":
    """Open standard streams or a port for frames and answers."""
    from maniport.live.transport import Datagrams, Pipe

    if send is not None and udp is None:
        raise InvalidInputError("--send needs --udp")
    if sys.stdin is None and udp is None:
        raise InvalidInputError("standard input is closed; frames come from there, or from --udp")
    try:
        os.write(sys.stdout.fileno(), b"")
    except io.UnsupportedOperation:  # no file, as a test's output
        pass
    except (AttributeError, OSError):
        raise InvalidInputError("standard output is closed; the description and answers go there") from None
    out = sys.stdout.buffer
    return Pipe(sys.stdin.fileno(), out.fileno()) if udp is None else Datagrams(udp, host, send, out)
