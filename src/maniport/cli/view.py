"""Looking at things: what a name or a file is, and the live view to play with."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from maniport.cli.application import AsJson, Frame, Mounting, Person, Quiet, Robot, Seed, app, rotation
from maniport.defaults import PERSON, ROBOT
from maniport.telling.console import Console
from maniport.telling.facts import Fact, Facts, Section, facts_of


@app.command(epilog="Example: maniport info panda;  maniport info adapter.npz;  maniport info walk.bvh")
def info(
    what: Annotated[str, typer.Argument(help="Name of an arm, or a file: recording, ellipsoids, adapter, URDF, MJCF.")],
    frame: Frame = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
    seed: Seed = 0,
) -> None:
    """Tell what an arm or a file is."""
    console = Console(as_json, quiet)
    console.tell(_facts(what, frame))


def _facts(what: str, frame: str | None) -> Facts:
    """Tell what a name or a file is, by its ending."""
    suffix = Path(what).suffix.lower()
    if suffix == ".npz":
        return _of_arrays(what)
    if suffix in (".bvh", ".c3d"):
        from maniport.demonstrations import read_recording

        return facts_of(read_recording(what))
    from maniport.bodies import load_arm

    return facts_of(load_arm(what, frame=frame))


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


STRAIGHT = (0.0, 0.0, 0.0)


@app.command(epilog="Example: maniport view;  maniport view --recording ladder;  maniport view --robot ur5.urdf")
def view(
    person: Person = PERSON,
    robot: Robot = ROBOT,
    frame: Frame = None,
    recording: Annotated[
        Path | None, typer.Option("--recording", help="A motion to play: .bvh, .c3d or .npz, or ladder or freeform.")
    ] = None,
    adapter: Annotated[Path | None, typer.Option("--adapter", help="A fitted adapter to show, .npz.")] = None,
    mounting: Mounting = STRAIGHT,
    host: Annotated[
        str, typer.Option("--host", help="Address to listen on; others than the default open the page to others.")
    ] = "127.0.0.1",
    port: Annotated[int, typer.Option("--port", help="Port to listen on; 0 takes a free one.")] = 0,
    seed: Seed = 0,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Play with it in the browser: move the person's arm, and the robot follows. Ctrl-C ends it, with exit code 0."""
    from maniport.bodies import load_arm
    from maniport.demonstrations.readers import SHIPPED, shipped_recording
    from maniport.live.door import is_loopback
    from maniport.live.prepare import prepare
    from maniport.live.server import LiveView, require_free
    from maniport.optional import viser

    viser()  # what is missing is told before any long work
    require_free(host, port)
    if recording is not None and str(recording) in SHIPPED and not recording.exists():
        recording = shipped_recording(str(recording))
    console = Console(as_json, quiet)
    with console.progress() as tell:
        state, method, turn = prepare(
            person,
            load_arm(robot, frame=frame),
            recording=recording,
            adapter=adapter,
            mounting=None if mounting == STRAIGHT else rotation(mounting),
            random_state=seed,
            progress=tell,
        )
        page = LiveView(state, method, turn, host, port)
    if not is_loopback(host):
        console.say("! the page is open to other machines: whoever has its address can see and move the arms")
    if page.bare:
        console.say(f"! the robot is shown as a skeleton: {page.bare}")

    def announce() -> None:
        console.finish({"url": page.url}, f"{page.url}  (Ctrl-C ends it)")
        sys.stdout.flush()  # who reads it from a pipe waits for it

    try:
        page.run_until_interrupted(announce)
    finally:
        page.stop()
    console.say("Ended.")
