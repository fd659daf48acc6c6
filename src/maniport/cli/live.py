"""A robot that follows a person as they move: frames in, joint positions out."""

import gc
import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from maniport.cli.application import (
    RECORDING,
    Damping,
    Floor,
    Height,
    Kind,
    Leaps,
    Method,
    Mounting,
    Part,
    Person,
    Quiet,
    Robot,
    Seed,
    Side,
    Smooth,
    app,
    regularization,
    rotation,
)
from maniport.cli.chain import Chain, takes_chain
from maniport.cli.motion import Motion, moves
from maniport.cli.recorded import Recorded, takes_recording
from maniport.defaults import AUTO, DAMPING, KEEP, METHOD, PERSON, ROBOT
from maniport.errors import InvalidInputError
from maniport.ports import LOOPBACK, is_loopback
from maniport.telling.console import Console

DOOR = "How frames come in"


def _door(help: str, **more: Any) -> Any:
    return typer.Option(help=help, rich_help_panel=DOOR, **more)


@app.command(epilog="Example: maniport live walk.bvh --robot ur5.urdf --udp 9000;  sensor | maniport live walk.bvh")
@moves
@takes_chain
@takes_recording
def live(
    motion: Motion,
    chain: Chain,
    recorded: Recorded,
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
    person: Person = PERSON,
    side: Side = AUTO,
    height: Height = None,
    smooth: Smooth = AUTO,
    leaps: Leaps = KEEP,
    robot: Robot = ROBOT,
    method: Method = METHOD,
    kind: Kind = "velocity",
    part: Part = "translation",
    damping: Damping = DAMPING,
    floor: Floor = None,
    mounting: Mounting = (0.0, 0.0, 0.0),
    seed: Seed = 0,
    quiet: Quiet = False,
) -> None:
    """Follow a person as they move: frames come in as lines of JSON, a robot's joint positions go out.

    First the recording is transferred as by maniport transfer: it tells the person's lengths, which points to look at,
    and where the hand's path lies before the robot. Then one line says what is expected, and every frame is answered by
    one line. Ctrl-C brings the robot to rest and ends it, with exit code 0.
    """
    from threadpoolctl import threadpool_limits

    from maniport.bodies import EllipsoidSpec
    from maniport.interruption import ending_in_order
    from maniport.live import Live
    from maniport.live.door.openings import Datagrams, Pipe
    from maniport.live.door.serving import Bell, serve
    from maniport.pipeline import transfer_recording

    if motion.export:
        raise InvalidInputError("--export writes a motion, of which there is none before it is made")
    if send is not None and udp is None:
        raise InvalidInputError("--send is for frames that come by UDP; give --udp, too")
    # what cannot be opened is told before any long work
    out = sys.stdout.buffer
    opening = Pipe(sys.stdin.fileno(), out) if udp is None else Datagrams(udp, host, send, out)
    console = Console(quiet=quiet)
    rho, lowest = regularization(damping, floor)
    arm = chain.load(robot)
    control = motion.control(arm)
    given = recorded.read(recording)
    for doubt in given.doubts:
        console.say(f"! {doubt}")
    with console.progress() as tell:
        result = transfer_recording(
            given,
            person,
            arm,
            method,
            spec=EllipsoidSpec(kind, part),
            markers=recorded.markers(),
            side=side,
            height=height,
            smooth=smooth,
            leaps=leaps,
            mounting=rotation(mounting),
            damping=rho,
            floor=lowest,
            orientation=motion.orientation,
            random_state=seed,
            progress=tell,
            **control,
        )
        follower = Live.of(result)
    if udp is not None and not is_loopback(host):
        console.say("! the port is open to other machines: whoever can reach it moves the robot")
    bell = Bell()
    gc.collect()
    gc.freeze()  # what is there now stays, and need not be looked through while frames wait
    try:
        with threadpool_limits(1), ending_in_order(bell.ring):
            summary = serve(follower, opening, bell, every)
    finally:
        gc.unfreeze()
    console.say(str(summary))
