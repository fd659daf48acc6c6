"""The application that the verbs belong to, how it ends, and the options that several of them share."""

import os
import sys
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from maniport.defaults import RECORDINGS
from maniport.errors import InvalidInputError, ManiportError, on_the_command_line, printable
from maniport.version import __version__


class _Verbs(TyperGroup):
    """The verbs: their help is laid out in panels, mistakes are told in plain lines that can be searched."""

    def main(self, *args: Any, **options: Any) -> Any:
        """Run one of them."""
        self.rich_markup_mode = None
        return super().main(*args, **options)


app = typer.Typer(
    name="maniport",
    cls=_Verbs,
    help="Let a robot arm take over the way a person uses their arm.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode="markdown",
    pretty_exceptions_enable=False,
)


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"maniport {__version__}")
        raise typer.Exit


@app.callback()
def _root(
    version: Annotated[bool, typer.Option("--version", callback=_version, is_eager=True, help="Show version.")] = False,
    mesh_folder: Annotated[
        list[Path] | None,
        typer.Option(
            exists=True, file_okay=False, help="Folder from which robots may take meshes besides their own; repeatable."
        ),
    ] = None,
) -> None:
    for folder in mesh_folder or ():  # to the readers of robots they are as those that ROS has been told
        before = os.environ.get("ROS_PACKAGE_PATH")
        os.environ["ROS_PACKAGE_PATH"] = os.pathsep.join([str(folder.absolute()), *([before] if before else [])])


def main() -> None:
    """Run the command line; errors end with exit code 2 and one sentence."""
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="replace")  # where there is no sign for ✓ a question mark does
    try:
        with on_the_command_line():
            app()
    except ManiportError as error:
        print(f"maniport: {error}", file=sys.stderr)
        sys.exit(2)
    except OSError as error:  # of names too long and the like, which no reader and no writer expects
        where = f"{error.filename!s:.80}: " if error.filename else ""
        print(f"maniport: {printable(f'{where}{error.strerror or error}')}", file=sys.stderr)
        sys.exit(2)


Seed = Annotated[int, typer.Option("--seed", help="Seed of everything that is drawn.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print the numbers as JSON, and nothing else.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but errors and what --json prints.")]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace an earlier result in the folder of --output.")]
Person = Annotated[str, typer.Option("--person", help="Model of the human arm: myoarm or rhuman.")]
Side = Annotated[
    str,
    typer.Option(
        "--arm",
        help="Which arm of the person: right, left, auto: the one that moves more; transfer, view: or both.",
    ),
]
Height = Annotated[
    float | None, typer.Option("--height", help="Body height [m], for lengths that are not known otherwise.")
]
Smooth = Annotated[
    str, typer.Option("--smooth", help="Smooth points that jitter: auto, off, or the highest frequency followed [Hz].")
]
Leaps = Annotated[
    str, typer.Option("--leaps", help="Where joints leap: keep it, smooth it, or split there, for the longest part.")
]
Robot = Annotated[str, typer.Option("--robot", help="Name of an arm, or its URDF, MJCF or xacro file.")]
METHODS = "icp, lengths-field, parallel-transport, nearest-neighbor, recentring, raw-copy"
Method = Annotated[str, typer.Option("--method", help=f"Transfer method: auto, {METHODS}.")]
NamedMethod = Annotated[str, typer.Option("--method", help=f"Transfer method: {METHODS}.")]
Kind = Annotated[str, typer.Option("--kind", help="velocity or force ellipsoids.")]
Part = Annotated[str, typer.Option("--part", help="translation, rotation or full.")]
Damping = Annotated[float, typer.Option("--damping", help="Relative damping of singular ellipsoids; 0 for none.")]
RECORDING = f"A recording: {', '.join(RECORDINGS)}, or a folder of keypoints."
Share = Annotated[
    float, typer.Option("--damping", help="Damping before comparison, as a share of the mean eigenvalue.")
]
Floor = Annotated[float | None, typer.Option("--floor", help="Lift eigenvalues below it, instead of damping.")]
Mounting = Annotated[
    tuple[float, float, float],
    typer.Option("--mounting", help="Roll, pitch, yaw [deg] from the teacher's base frame to the student's."),
]


def regularization(damping: float, floor: float | None) -> tuple[float | None, float | None]:
    """Return damping and floor as the library takes them: one of them, or neither."""
    if floor is not None:
        return None, floor
    return (None if damping == 0 else damping), None


def rotation(mounting: tuple[float, float, float]) -> Any:
    """Rotation matrix from roll, pitch, yaw [deg] about fixed axes, as in URDF."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_euler("xyz", mounting, degrees=True).as_matrix()


def require_npz(path: Path) -> None:
    """Raise unless an .npz file can be written there."""
    from maniport.atomic_io import require_room

    if path.suffix != ".npz":
        raise InvalidInputError(f"output must be an .npz file; found {str(path)!r}")
    require_room(path)
