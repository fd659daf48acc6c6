"""The command line: one verb for each arrow of the main job. Parses, calls, prints; nothing else."""

import json
import signal
import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from maniport import __version__
from maniport.console import Console
from maniport.describe import adapter_facts, as_lines, describe
from maniport.errors import FileFormatError, InvalidInputError, ManiportError

app = typer.Typer(
    name="maniport",
    help="Let a robot arm take over the way a person uses their arm.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)

Seed = Annotated[int, typer.Option("--seed", help="Seed of everything that is drawn.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print the numbers as JSON, and nothing else.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but errors.")]
Person = Annotated[str, typer.Option("--person", help="Model of the human arm: myoarm or rhuman.")]
Robot = Annotated[str, typer.Option("--robot", help="Name of an arm, or its URDF or MJCF file.")]
Frame = Annotated[str | None, typer.Option("--frame", help="Frame at the tip of the arm.")]
Method = Annotated[str, typer.Option("--method", help="icp, parallel-transport or nearest-neighbor.")]
Kind = Annotated[str, typer.Option("--kind", help="velocity or force ellipsoids.")]
Part = Annotated[str, typer.Option("--part", help="translation, rotation or full.")]
Damping = Annotated[float, typer.Option("--damping", help="Relative damping of singular ellipsoids; 0 for none.")]
Floor = Annotated[float | None, typer.Option("--floor", help="Lift eigenvalues below it, instead of damping.")]
Mounting = Annotated[
    tuple[float, float, float],
    typer.Option("--mounting", help="Roll, pitch, yaw [deg] from the teacher's base frame to the student's."),
]
DAMPING = 0.01


@app.command(epilog="Example: maniport demo -o maniport-demo")
def demo(
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder for the results.")] = Path("maniport-demo"),
    seed: Seed = 0,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Run the main job on a shipped recording: a person on a ladder, and the Franka Panda."""
    from maniport.demonstrations import shipped_recording

    console = Console(as_json, quiet)
    console.say(f"A person climbs a ladder and reaches overhead; a Panda shall do it their way. Damping {DAMPING:g}.")
    _transfer(console, output, recording=shipped_recording("ladder"), damping=DAMPING, random_state=seed)


@app.command(epilog="Example: maniport transfer walk.bvh --robot ur5.urdf -o results")
def transfer(
    recording: Annotated[Path, typer.Argument(help="A recording: .bvh or .c3d.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder for the results.")],
    person: Person = "myoarm",
    robot: Robot = "panda",
    frame: Frame = None,
    method: Method = "icp",
    kind: Kind = "velocity",
    part: Part = "translation",
    damping: Damping = DAMPING,
    floor: Floor = None,
    mounting: Mounting = (0.0, 0.0, 0.0),
    markers: Annotated[Path | None, typer.Option(help="JSON file: lists of point names by role.")] = None,
    unit: Annotated[str | None, typer.Option(help="Unit of length, when it is not recognised.")] = None,
    up: Annotated[str | None, typer.Option(help="Axis that points up in the recording.")] = None,
    start: Annotated[float | None, typer.Option(help="Use the recording from this time on [s].")] = None,
    stop: Annotated[float | None, typer.Option(help="Use the recording up to this time [s].")] = None,
    seed: Seed = 0,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Turn a recording into the ellipsoids that a robot should make: the whole way."""
    from maniport.bodies import load_arm
    from maniport.demonstrations import read_recording
    from maniport.results import require_free

    console = Console(as_json, quiet)
    require_free(output)
    rho, lowest = _regularization(damping, floor)
    motion = read_recording(recording, unit=unit, up=up)
    if start is not None or stop is not None:
        motion = motion.crop(start, stop)
    console.say(f"Singular ellipsoids: {f'damping {rho:g}' if lowest is None else f'floor {lowest:g}'}.")
    _transfer(
        console,
        output,
        recording=motion,
        person=person,
        robot=load_arm(robot, frame=frame),
        method=method,
        kind=kind,
        part=part,
        markers=_read_markers(markers),
        mounting=_rotation(mounting),
        damping=rho,
        floor=lowest,
        random_state=seed,
    )


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
    from maniport.bodies import load_arm
    from maniport.domain import sample_domain
    from maniport.files import save_ellipsoids

    console = Console(as_json, quiet)
    _require_npz(output)
    body = load_arm(arm, frame=frame)
    ellipsoids = sample_domain(body, n, seed, sequence, kind=kind, part=part)
    save_ellipsoids(output, ellipsoids)
    console.finish(
        {"arm": body.name, "frame": body.frame, "ellipsoids": len(ellipsoids), "output": str(output)},
        f"{len(ellipsoids)} {kind} ellipsoids ({part}) of {body.name} at {body.frame} → {output}",
    )


@app.command(epilog="Example: maniport fit person.npz panda.npz -o adapter.npz")
def fit(
    teacher: Annotated[Path, typer.Argument(help="Ellipsoids of the teacher's domain, .npz.")],
    student: Annotated[Path, typer.Argument(help="Ellipsoids of the student's domain, .npz.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="File of the adapter, .npz.")],
    method: Method = "icp",
    damping: Damping = DAMPING,
    floor: Floor = None,
    mounting: Mounting = (0.0, 0.0, 0.0),
    unknown_mounting: Annotated[
        bool, typer.Option("--unknown-mounting", help="Search the rotation in all directions (icp).")
    ] = False,
    seed: Seed = 0,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Fit the map from a teacher's domain to a student's."""
    from maniport.files import load_ellipsoids
    from maniport.pipeline import make_adapter, mounting_for

    console = Console(as_json, quiet)
    _require_npz(output)
    rho, lowest = _regularization(damping, floor)
    teacher_domain, student_domain = load_ellipsoids(teacher)[0], load_ellipsoids(student)[0]
    turn = None
    if not unknown_mounting:
        turn = mounting_for(_rotation(mounting), "full" if teacher_domain.shape[-1] == 6 else "translation")
    adapter = make_adapter(method, rho, lowest, turn, seed)
    with console.progress() as tell:
        tell("fit the adapter", 0.0)
        adapter.fit(teacher_domain, student_domain)
        tell("fit the adapter", 1.0, f"{adapter.n_iter_} iterations, {adapter.stop_reason_}")
    adapter.save(output)
    console.finish({**adapter_facts(adapter), "output": str(output)}, f"adapter → {output}")


@app.command(epilog="Example: maniport apply adapter.npz profile.npz -o adapted.npz")
def apply(
    adapter: Annotated[Path, typer.Argument(help="A fitted adapter, .npz.")],
    profile: Annotated[Path, typer.Argument(help="Ellipsoids, .npz.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="File of the adapted ellipsoids, .npz.")],
    inverse: Annotated[bool, typer.Option("--inverse", help="From the student back to the teacher.")] = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
    seed: Seed = 0,
) -> None:
    """Map ellipsoids with a fitted adapter."""
    from maniport.files import load_ellipsoids, save_ellipsoids
    from maniport.transfer import load_adapter

    console = Console(as_json, quiet)
    _require_npz(output)
    fitted = load_adapter(adapter)
    points, time = load_ellipsoids(profile)
    mapped = fitted.inverse_transform(points) if inverse else fitted.transform(points)
    save_ellipsoids(output, mapped, time)
    console.finish({"ellipsoids": len(mapped), "output": str(output)}, f"{len(mapped)} ellipsoids → {output}")


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
    facts = describe(what, frame)
    console.finish(facts, as_lines(facts))


def _transfer(console: Console, output: Path, **job: Any) -> None:
    from maniport.pipeline import transfer_recording
    from maniport.results import require_free
    from maniport.summary import as_markdown

    require_free(output)
    with console.progress() as tell:
        result = transfer_recording(**job, progress=tell)
        tell("write the results", 0.0)
        result.save(output)
        tell("write the results", 1.0, f"in {output}/")
    summary = result.summary()
    console.finish({**summary, "output": str(output)}, as_markdown(summary), markdown=True)


def _regularization(damping: float, floor: float | None) -> tuple[float | None, float | None]:
    if floor is not None:
        return None, floor
    return (None if damping == 0 else damping), None


def _rotation(mounting: tuple[float, float, float]) -> Any:
    """Rotation matrix from roll, pitch, yaw [deg] about fixed axes, as in URDF."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_euler("xyz", mounting, degrees=True).as_matrix()


def _read_markers(path: Path | None) -> dict[str, Any] | None:
    if path is None:
        return None
    try:
        markers = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, json.JSONDecodeError) as error:
        raise FileFormatError(f"marker file {str(path)!r} is not readable JSON: {error}") from None
    if not isinstance(markers, dict):
        raise FileFormatError(
            f'marker file {str(path)!r} must map roles to lists of point names, such as {{"elbow": ["RELB", "RIEL"]}}'
        )
    return markers


def _require_npz(path: Path) -> None:
    if path.suffix != ".npz":
        raise InvalidInputError(f"output must be an .npz file; found {str(path)!r}")


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"maniport {__version__}")
        raise typer.Exit


@app.callback()
def _root(
    version: Annotated[bool, typer.Option("--version", callback=_version, is_eager=True, help="Show version.")] = False,
) -> None:
    pass


class _Interrupted(BaseException):
    """Ctrl-C; not KeyboardInterrupt, which the command-line library would answer itself."""


def main() -> None:
    """Run the command line; errors end with exit code 2 and one sentence, Ctrl-C with 130."""
    signal.signal(signal.SIGINT, _interrupt)
    try:
        app()
    except ManiportError as error:
        print(f"maniport: {error}", file=sys.stderr)
        sys.exit(2)
    except _Interrupted:
        print("maniport: interrupted; nothing was written", file=sys.stderr)
        sys.exit(130)


def _interrupt(signum: int, frame: Any) -> None:
    raise _Interrupted
