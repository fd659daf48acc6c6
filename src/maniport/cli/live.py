"""A robot that follows a person as they move: frames in, joint positions out."""

import gc
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from maniport.cli.application import RECORDING, Quiet, Robot, app
from maniport.cli.chain import Chain, takes_chain
from maniport.cli.motion import Motion, moves
from maniport.cli.recorded import Recorded, takes_recording
from maniport.cli.transfer import at_work
from maniport.cli.transferred import transfers
from maniport.defaults import ROBOT
from maniport.errors import InvalidInputError
from maniport.ports import LOOPBACK, is_loopback
from maniport.telling.console import Console

if TYPE_CHECKING:
    from maniport.live import Live
    from maniport.live.door.openings import Datagrams, Pipe
    from maniport.live.door.serving import Summary
    from maniport.pipeline import TransferResult

DOOR = "How frames come in"
LONG = 1.0
"""Without a frame the robot brakes meanwhile [s]."""


def _door(help: str, **more: Any) -> Any:
    return typer.Option(help=help, rich_help_panel=DOOR, **more)


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
        int | None, _door("Take frames from this UDP port instead of standard input; 0 takes a free one.")
    ] = None,
    host: Annotated[str, _door("Address of that port; others than the default open it to others.")] = LOOPBACK,
    send: Annotated[
        int | None, _door("Send answers to this UDP port of that address; by default to who sent the frame.")
    ] = None,
    every: Annotated[
        bool, _door("Work every frame, however late, as those of a file; otherwise of those that wait the newest.")
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
    except (AttributeError, OSError):  # without a file, or one that cannot be written to
        raise InvalidInputError("standard output is closed; the first line goes there, and answers, too") from None
    from maniport.live.door.openings import Datagrams, Pipe

    out = sys.stdout.buffer  # what cannot be opened is told before any long work
    opening = Pipe(sys.stdin.fileno(), out.fileno()) if udp is None else Datagrams(udp, host, send, out)
    console = Console(quiet=quiet)
    with at_work(console) as tell:
        from maniport.pipeline import transfer_recording

        arm = chain.load(robot)
        given = recorded.read(recording)
        for doubt in given.doubts:
            console.say(f"! {doubt}")
        follower = _ready(
            transfer_recording(
                given,
                robot=arm,
                markers=recorded.markers(),
                orientation=motion.orientation,
                progress=tell,
                **motion.control(arm),
                **job,
            )
        )
    if udp is not None and not is_loopback(host):
        console.say("! the port is open to other machines: whoever can reach it moves the robot")
    summary = _served(follower, opening, every)
    console.say(str(summary))
    if udp is None and summary.skipped > summary.worked:
        console.say("! most frames were skipped, as a file is read faster than it was recorded: --every works them all")


def _ready(result: "TransferResult") -> "Live":
    """A robot that follows; what its frames need is compiled."""
    from maniport.live import Live

    tried, frames = Live.of(result), result.fit.frames[:3]
    shown = result.recording.select(tried.points)
    for points, t in zip(shown.positions[frames], shown.time[frames], strict=True):
        tried.step(points, t)
    tried.step(None, shown.time[frames[-1]] + LONG)
    return Live.of(result)


def _served(follower: "Live", opening: "Pipe | Datagrams", every: bool) -> "Summary":
    """Answer frames until they end, or Ctrl-C."""
    from threadpoolctl import threadpool_limits

    from maniport.interruption import ending_in_order
    from maniport.live.door.serving import Bell, serve

    bell = Bell()
    gc.collect()
    gc.freeze()  # what is there now stays, and need not be looked through while frames wait
    try:
        with threadpool_limits(1), ending_in_order(bell.ring):
            return serve(follower, opening, bell, every)
    finally:
        gc.unfreeze()
        bell.close()
