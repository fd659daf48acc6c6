"""Commands that run until they are stopped: a robot that follows a moving person, and the interactive 3D view."""

import gc
import io
import os
import socket
import sys
import threading
from importlib.util import find_spec
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Annotated

import typer
from typer.models import OptionInfo

import maniport
from maniport import pipeline
from maniport.cli.application import command
from maniport.cli.transfer import only_recording
from maniport.errors import InvalidInputError
from maniport.pipeline.config import LIVE, Config
from maniport.pipeline.options import OPTIONS
from maniport.report.console import Console
from maniport.util.optional import how_to_install
from maniport.util.process import LOOPBACK, ending_in_order, is_loopback

if TYPE_CHECKING:
    from maniport.arms import Arm
    from maniport.live import Live
    from maniport.live.transport import Datagrams, Pipe
    from maniport.mocap import Recording


def _transport(help: str, *flags: str) -> OptionInfo:
    option: OptionInfo = typer.Option(*flags, help=help, rich_help_panel="Transport")
    return option


@command(
    "recording",
    "human",
    "robot",
    "transfer",
    "motion",
    "seed",
    without=("hand_targets", "move", "export", "rate"),
    defaults=LIVE,
    example="maniport live walk.bvh --robot ur5.urdf --udp 9000",
)
def live(
    config: Config,
    console: Console,
    udp: Annotated[
        int | None, _transport("UDP port for frames, instead of standard input; 0: any port.")
    ] = None,
    host: Annotated[str, _transport("Address; others open it to the network.")] = LOOPBACK,
    send: Annotated[
        int | None, _transport("Local UDP port for answers; default: the sender's.")
    ] = None,
    no_drop: Annotated[
        bool, _transport("Process every frame in order, instead of the newest only.", "--no-drop")
    ] = False,
    delay: Annotated[
        float, typer.Option(help="Delay of the robot, to 0.5 [s].", rich_help_panel="Motion")
    ] = 0.15,
    auto_engage: Annotated[
        bool,
        _transport("Follow without consent; for simulated robots only.", "--auto-engage"),
    ] = False,
    simulate: Annotated[
        bool, _transport("Control a simulated robot with the recording.", "--simulate")
    ] = False,
) -> None:
    """Follow a moving person: points in, joint positions out.

    The recording is transferred first: it determines segment lengths, points and placement. The first line of output
    contains the point names. A frame is a line such as {"t": 0.02, "points": {"NAME": [0.1, 0.2, 0.3]}}; the answer is
    one line. The robot follows after the line {"engage": true}. Ctrl-C stops it.
    """
    from threadpoolctl import threadpool_limits

    from maniport.live.live import as_delay
    from maniport.live.serving import Server

    as_delay(delay)
    if simulate and (no_drop or (udp, host, send) != (None, LOOPBACK, None)):
        raise InvalidInputError(
            "--simulate takes the frames of the recording; leave out all options of the transport"
        )
    with console.progress() as progress:
        transport = None
        clock = None
        if not simulate:
            transport = _opened(udp, host, send)  # raises where a port cannot be opened
            clock = monotonic
        job = pipeline.Transfer.of(config, progress)
        recording = only_recording(job, config, console)
        result = job.run(job.human(recording))
        for arm in result.arms:
            for text in arm.fit.quality_warnings:
                console.warn(text)
        follower = maniport.Live.of(
            result,
            delay=delay,
            auto_engage=auto_engage or simulate,
            clock=clock,
            progress=progress,
        )
    placement = result.arms[0].placement
    if placement is not None:
        console.print(
            f"Scale {placement.scale:.2f} of the person's motion; the robot follows {delay:g} s later"
        )
    if transport is None:
        _simulate(console, follower, result.arms[0].fit.arm, recording)
        return
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
    if summary.never_engaged:
        console.warn(
            'the robot waited for the line {"engage": true}; --auto-engage does without it in simulation'
        )
    if udp is None and summary.skipped > summary.answered:
        console.warn(
            "most frames were skipped, since they arrived faster than recorded; --no-drop processes all"
        )


def _simulate(console: Console, live: "Live", person: "Arm", recording: "Recording") -> None:
    """Play a recording to a simulated robot: again and again in the 3D view until Ctrl-C, or once without it."""
    from maniport.arms import as_group
    from maniport.live.simulation import Simulation

    simulation = Simulation(live)
    frames = recording.select(live.points)
    page = None
    if len(as_group(live.robot)) > 1:
        console.warn("the 3D view needs robots of one arm")
    elif find_spec("viser") is None:
        console.warn(f"the 3D view needs viser; {how_to_install('view')}")
    else:
        from maniport.viewer.server import Onlooker

        page = Onlooker(person, live.robot)
        _print(console, {"url": page.url}, f"{page.url}  (Ctrl-C ends it)")
    stop = threading.Event()
    begin = monotonic()
    pause = 1.0
    try:
        with ending_in_order(stop.set):
            while True:
                for points, t in zip(frames.positions, frames.time - frames.time[0], strict=True):
                    wait = 0.0
                    if page is not None:
                        wait = max(begin + t - monotonic(), 0.0)
                    if stop.wait(wait):
                        break
                    state = simulation.step(points, begin + t)
                    if page is not None:
                        page.show(state)
                _print(console, {"errors": str(simulation)}, str(simulation))
                if page is None or stop.wait(pause):
                    return
                begin += frames.duration + pause
    finally:
        if page is not None:
            page.stop()


def _print(console: Console, values: dict[str, object], text: str) -> None:
    console.finish(values, text, always=True)
    sys.stdout.flush()  # a reader of a pipe waits for it


def _opened(udp: int | None, host: str, send: int | None) -> "Pipe | Datagrams":
    """Open standard streams or a port for frames and answers."""
    from maniport.live.transport import Datagrams, Pipe

    if udp is None and (send, host) != (None, LOOPBACK):
        raise InvalidInputError("--host and --send need --udp")
    if sys.stdin is None and udp is None:
        raise InvalidInputError("standard input is closed; frames come from there, or from --udp")
    try:
        os.write(sys.stdout.fileno(), b"")
    except io.UnsupportedOperation:  # no file, as a test's output
        pass
    except (AttributeError, OSError) as error:
        reason = getattr(error, "strerror", None) or "it is closed"
        raise InvalidInputError(
            f"standard output cannot be written, where answers go: {reason}"
        ) from None
    out = sys.stdout.buffer
    if udp is None:
        return Pipe(sys.stdin.fileno(), out.fileno())
    return Datagrams(udp, host, send, out)


@command(
    "person",
    "side",
    "unit",
    "height",
    "fps",
    "markers",
    "start",
    "stop",
    "robot",
    "base_rotation",
    "seed",
    without=("payload", "payload_center", "hand_targets"),
    example="maniport view;  maniport view ladder;  maniport view walk.bvh --robot ur5.urdf",
)
def view(
    config: Config,
    console: Console,
    recording: Annotated[Path | None, typer.Argument(help=OPTIONS["recording"].help)] = None,
    named: Annotated[Path | None, typer.Option("--recording", hidden=True)] = None,
    port: Annotated[int, typer.Option(help="Port of this machine; 0: any free port.")] = 0,
) -> None:
    """Open an interactive 3D view in the browser; Ctrl-C ends it."""
    from maniport.util.optional import viser
    from maniport.viewer.server import LiveView, require_free
    from maniport.viewer.state import prepare

    if recording is not None and named is not None:
        raise InvalidInputError("the recording is named twice, as an argument and by --recording")
    recording = recording or named
    if recording is None and config.recording:
        if len(config.recording) > 1:
            raise InvalidInputError(
                f"the view shows one recording; the configuration has {len(config.recording)}: name one"
            )
        recording = Path(config.recording[0])
    viser()  # a missing package is reported before any long work
    base_rotation = config.rotation
    require_free(port)
    with console.progress() as progress:
        page = LiveView(prepare(config, recording, progress), base_rotation, port)
    if page.no_surface:
        console.warn(f"the robot is drawn as a skeleton: {page.no_surface}")
    stop = threading.Event()
    try:
        with ending_in_order(
            stop.set
        ):  # by Ctrl-C or a termination signal; a second one ends at once
            _print(console, {"url": page.url}, f"{page.url}  (Ctrl-C ends it)")
            page.run(stop)
    finally:
        page.stop()
