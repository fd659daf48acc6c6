"""The application, its exit codes, and the options that several commands share."""

import inspect
import os
import sys
from collections.abc import Callable, Mapping
from functools import wraps
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from maniport.errors import InvalidInputError, ManiportError, on_the_command_line, printable
from maniport.report.console import Console
from maniport.util.defaults import RECORDINGS
from maniport.version import __version__

Verb = Callable[..., None]


class _Verbs(TyperGroup):
    """The commands: panels in help pages, plain lines in error messages, which can be searched."""

    def main(self, *args: Any, **options: Any) -> Any:
        """Run a command."""
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
    for folder in mesh_folder or ():  # readers of robots look in the folders of ROS
        before = os.environ.get("ROS_PACKAGE_PATH")
        os.environ["ROS_PACKAGE_PATH"] = os.pathsep.join([str(folder.absolute()), *([before] if before else [])])


def main() -> None:
    """Run the command line; errors end with exit code 2 and one sentence."""
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="replace")  # encodings without ✓ get a question mark
    try:
        with on_the_command_line():
            app()
    except ManiportError as error:
        print(f"maniport: {error}", file=sys.stderr)
        sys.exit(2)
    except OSError as error:  # such as a name that is too long
        where = f"{error.filename!s:.80}: " if error.filename else ""
        print(f"maniport: {printable(f'{where}{error.strerror or error}')}", file=sys.stderr)
        sys.exit(2)


def group(
    parameter: str, options: Callable[..., Any], make: Callable[..., Any] | None = None, **defaults: Any
) -> Callable[[Verb], Verb]:
    """Give commands a group of options.

    Parameters
    ----------
    parameter : str
        Parameter of the command that takes the result of `make`.
    options : callable
        Its parameters are the options.
    make : callable, optional
        Called with the values of the options, by name; default: `options` itself.
    **defaults
        Defaults that differ for these commands.
    """
    make = options if make is None else make
    written = inspect.signature(options, eval_str=True).parameters
    shared = {name: one.replace(default=defaults.get(name, one.default)) for name, one in written.items()}

    def decorate(verb: Verb) -> Verb:
        own = inspect.signature(verb, eval_str=True).parameters.values()

        @wraps(verb)
        def with_options(**given: Any) -> None:
            made = make(**{name: given.pop(name) for name in shared})
            verb(**given, **{parameter: made})

        every = [*(one for one in own if one.name != parameter), *shared.values()]
        every.sort(key=lambda one: one.default is not inspect.Parameter.empty)
        with_options.__signature__ = inspect.Signature(every)  # type: ignore[attr-defined]
        with_options.__annotations__ = {one.name: one.annotation for one in every}
        return with_options

    return decorate


def require_none(options: Mapping[str, Any], what: str, why: str) -> None:
    """Raise if an option was given; `what` says what it is for, `why` the reason for which it is refused here."""
    for name, value in options.items():
        if value is not None:
            raise InvalidInputError(f"--{name} {what}; {why}")


Seed = Annotated[int, typer.Option("--seed", help="Random seed.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print only errors and the output of --json.")]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace an earlier result in the folder of --output.")]
Person = Annotated[str, typer.Option("--person", help="Model of the human arm: myoarm or rhuman.")]
Side = Annotated[
    str,
    typer.Option(
        "--arm",
        help="Arm of the person: right, left, or auto, the one that moves more; for transfer and view also both.",
    ),
]
Height = Annotated[
    float | None, typer.Option("--height", help="Body height [m], for lengths that are unknown otherwise.")
]
Robot = Annotated[str, typer.Option("--robot", help="Name of an arm, or its URDF, MJCF or xacro file.")]
METHODS = "icp, length-field, parallel-transport, nearest-neighbor, mean-transport, identity"
Method = Annotated[str, typer.Option("--method", help=f"Transfer method: auto, {METHODS}.")]
NamedMethod = Annotated[str, typer.Option("--method", help=f"Transfer method: {METHODS}.")]
Kind = Annotated[str, typer.Option("--kind", help="velocity or force ellipsoids.")]
Part = Annotated[str, typer.Option("--part", help="translation, rotation or full.")]
Damping = Annotated[float, typer.Option("--damping", help="Relative damping of singular ellipsoids; 0 for none.")]
RECORDING = f"A recording: {', '.join(RECORDINGS)}, or a folder of keypoints."
Share = Annotated[
    float, typer.Option("--damping", help="Damping before comparison, as a share of the mean eigenvalue.")
]
Floor = Annotated[
    float | None, typer.Option("--eigenvalue-floor", help="Lift eigenvalues below it, instead of damping.")
]
Mounting = Annotated[
    tuple[float, float, float],
    typer.Option("--base-rotation", help="Roll, pitch, yaw [deg] from the teacher's base frame to the student's."),
]


def _console(
    as_json: Annotated[bool, typer.Option("--json", help="Print the numbers as JSON, and nothing else.")] = False,
    quiet: Quiet = False,
) -> Console:
    return Console(as_json, quiet)


prints = group("console", _console)  # Gives a command that has a parameter `console` the options of printing


def regularization(damping: float, eigenvalue_floor: float | None) -> dict[str, float | None]:
    """Return damping and floor for the library: one of them, or neither."""
    if eigenvalue_floor is not None:
        return {"damping": None, "eigenvalue_floor": eigenvalue_floor}
    return {"damping": None if damping == 0 else damping, "eigenvalue_floor": None}


def rotation(base_rotation: tuple[float, float, float]) -> Any:
    """Rotation matrix from roll, pitch, yaw [deg] about fixed axes, as in URDF."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_euler("xyz", base_rotation, degrees=True).as_matrix()


def require_npz(path: Path) -> None:
    """Raise unless an .npz file can be written there."""
    from maniport.util.atomic_io import require_room

    if path.suffix != ".npz":
        raise InvalidInputError(f"output must be an .npz file; found {str(path)!r}")
    require_room(path)
