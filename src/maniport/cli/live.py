"""A robot that follows a person as they move: frames in, joint positions out."""

import gc
import io
import os
import socket
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from maniport.cli.application import RECORDING, Quiet, Robot, app
from maniport.cli.motion import Motion, moves
from maniport.cli.recorded import Recorded, takes_recording, transfers
from maniport.cli.robots import Chain, takes_chain
from maniport.cli.transfer import at_work
from maniport.errors import InvalidInputError
from maniport.report.console import Console
from maniport.util.defaults import ROBOT
from maniport.util.ports import LOOPBACK, is_loopback

if TYPE_CHECKING:
    from maniport.live import Live
    from maniport.live.serving import Summary
    from maniport.live.transport import Datagrams, Pipe


def _transport(help: str, **more: Any) -> Any:
    return typer.Option(help=help, rich_help_panel="How frames come in", **more)


@app.command(epilog="Example: maniport live walk.bvh --robot ur5.urdf --udp 9000;  sensor | maniport live walk.bvh")
@moves
@takes_chain
@takes_recording
@transfers
def live(
    motion: Motion,
    chain: Chain,
    recorded: Recorded,
    job: dict[str, Any],
    recording: Annotated[
        Path, typer.Argument(help=f"The person, as the frames will show them, moving as they will. {RECORDING}")
    ],
    udp: Annotated[
        int | None, _transport("Take frames from this UDP port instead of standard input; 0 takes a free one.")
    ] = None,
    host: Annotated[str, _transport("Address of that port; others than the default open it to others.")] = LOOPBACK,
    send: Annotated[
        int | None, _transport("Send answers to this UDP port of that address; by default to who sent the frame.")
    ] = None,
    no_drop: Annotated[
        bool, _transport("Process every frame of a file in order, none before its time; otherwise skip to the newest.")
    ] = False,
    robot: Robot = ROBOT,
    quiet: Quiet = False,
) -> None:
    """Follow a person as they move: frames come in as lines of JSON, a robot's joint positions go out.

    First the recording is transferred as by maniport transfer: it tells the person's lengths, which points to look at,
    and where the hand's path lies before the robot. Then one line says what is expected, and every frame, such as
    {"t": 0.02, "points": {"NAME": [0.1, 0.2, 0.3]}}, is answered by one line. Ctrl-C brings the robot to rest and ends
    it, with exit code 0.
    """
    if motion.export:
        raise InvalidInputError("--export writes a motion, of which there is none before it is made")
    if send is not None and udp is None:
        raise InvalidInputError("--send is for frames that come by UDP; give --udp, too")
    if sys.stdin is None and udp is None:
        raise InvalidInputError("standard input is closed; give frames there, or --udp")
    try:
        os.write(sys.stdout.fileno(), b"")
    except io.UnsupportedOperation:  # no file, as a test's output
        pass
    except (AttributeError, OSError):
        raise InvalidInputError("standard output is closed; the first line goes there, and answers, too") from None
    from maniport.live.transport import Datagrams, Pipe

    out = sys.stdout.buffer  # ports that cannot be opened are reported before any long work
    transport = Pipe(sys.stdin.fileno(), out.fileno()) if udp is None else Datagrams(udp, host, send, out)
    console = Console(quiet=quiet)
    with at_work(console) as tell:
        from maniport.pipeline import transfer_recording

        arm = chain.load(robot)
        given = recorded.read(recording)
        for doubt in given.quality_warnings:
            console.say(f"! {doubt}")
        from maniport.live import Live

        result = transfer_recording(
            given,
            robot=arm,
            markers=recorded.roles(),
            orientation=motion.orientation,
            progress=tell,
            **motion.control(arm),
            **job,
        )
        follower = Live.of(result, progress=tell)
    if udp is not None and not is_loopback(host):
        console.say("! the port is open to other machines: whoever can reach it moves the robot")
    summary = _served(follower, transport, no_drop)
    console.say(str(summary))
    if udp is None and summary.skipped > summary.answered:
        console.say(
            "! most frames were skipped: the file was read faster than recorded; --no-drop processes all of them"
        )


def _served(follower: "Live", transport: "Pipe | Datagrams", no_drop: bool) -> "Summary":
    """Answer frames until they end, or Ctrl-C."""
    from threadpoolctl import threadpool_limits

    from maniport.live.serving import serve
    from maniport.util.signals import ending_in_order

    stop, signal = socket.socketpair()
    gc.collect()
    gc.freeze()  # what is there now stays, and need not be looked through while frames wait
    try:
        with stop, signal, threadpool_limits(1), ending_in_order(lambda: signal.send(b"!")):
            return serve(follower, transport, stop, no_drop)
    finally:
        gc.unfreeze()
