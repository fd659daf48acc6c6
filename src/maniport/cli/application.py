"""The application: commands generated from functions and the options of `maniport.pipeline.options`, and exit codes."""

import inspect
import os
import re
import sys
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from contextlib import AbstractContextManager, suppress
from dataclasses import replace
from functools import wraps
from math import inf, isfinite, radians
from pathlib import Path
from typing import Annotated, Any, Protocol

import typer
from typer.core import TyperArgument, TyperCommand, TyperOption
from typer.models import ArgumentInfo, OptionInfo

from maniport.errors import (
    InvalidInputError,
    ManiportError,
    UnknownNameError,
    on_the_command_line,
    printable,
)
from maniport.pipeline.config import Config
from maniport.pipeline.extensions import load_extensions
from maniport.pipeline.option import ASSIGNED, Flag, Option
from maniport.pipeline.options import OPTIONS, SECTIONS
from maniport.report.console import Console
from maniport.util.atomic_io import free_path, require_room
from maniport.util.defaults import BOTH
from maniport.version import __version__

LONGEST_PART = 60  # characters of the name of an input in the name of a folder
UsageError: Any = typer.BadParameter.__base__  # Typer has no public name for it
NO_ROBOT = Config(robot=())  # defaults of commands that need no robot

app = typer.Typer(
    name="maniport",
    help="Transfer manipulability from a human arm to a robot arm.",
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)


def main() -> None:
    """Run the command line: exit code 0 when done, 2 for wrong input, with one sentence on standard error."""
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="replace")  # encodings without ✓ get a question mark
    try:
        with on_the_command_line():
            sys.exit(app(prog_name="maniport", standalone_mode=False))
    except UsageError as error:
        if type(error).__name__ == "NoArgsIsHelpError":
            error.show()
            sys.exit(2)
        message = error.format_message()
    except ManiportError as error:
        message = str(error)
    except OSError as error:  # such as a name that is too long
        message = str(error.strerror or error)
        if error.filename:
            message = f"{error.filename!s:.80}: {message}"
    print(f"maniport: {printable(message)}", file=sys.stderr)
    sys.exit(2)


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"maniport {__version__}")
        raise typer.Exit


@app.callback()
def _root(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show version.")
    ] = False,
) -> None:
    """Define the options of the application; installed extensions are registered before a command."""
    for fault in load_extensions():
        print(f"! {printable(fault)}", file=sys.stderr)


class _HelpFormatter(Protocol):
    """What is used of the object that writes a help page."""

    def section(self, name: str) -> AbstractContextManager[None]:
        """Begin a section with a title."""

    def write_dl(self, rows: list[tuple[str, str]], col_max: int = ...) -> None:
        """Write names and descriptions in two columns."""


class _Command(TyperCommand):
    """A command whose help page has the options in groups."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse arguments; several values may follow the option of xacro arguments."""
        return super().parse_args(ctx, _with_repeated_flag(args))

    def format_options(self, ctx: Any, formatter: _HelpFormatter) -> None:
        """Write the options; those that are not common with ``--help-all`` only."""
        groups: dict[str, list[tuple[str, str]]] = {}
        for parameter in self.get_params(ctx):
            hidden = getattr(parameter, "hidden", False)
            if hidden and "all" not in ctx.meta:
                continue
            if isinstance(parameter, TyperArgument | TyperOption):
                parameter.hidden = False
            row = parameter.get_help_record(ctx)
            if isinstance(parameter, TyperArgument | TyperOption):
                parameter.hidden = hidden
            if row is None:
                continue
            name, help = row
            title = "Options"
            if not name.startswith("-"):
                title = "Arguments"
                name = name.partition(" <")[0]
            title = getattr(parameter, "rich_help_panel", None) or title
            groups.setdefault(title, []).append((name, help))
        for title, rows in groups.items():
            with formatter.section(title):
                formatter.write_dl(rows, col_max=32)


def _with_repeated_flag(args: list[str]) -> list[str]:
    """Write the option of xacro arguments before each of several values that follow it."""
    flag = OPTIONS["xacro_args"].flag
    repeated: list[str] = []
    for arg in args:
        follows = len(repeated) > 1 and repeated[-2] == flag
        if follows and ASSIGNED in arg and not arg.startswith("-"):
            repeated.append(flag)
        repeated.append(arg)
    return repeated


def _help_all(context: typer.Context, wanted: bool) -> None:
    """Print the help page with all options."""
    if wanted:
        context.meta["all"] = True
        typer.echo(context.get_help())
        raise typer.Exit


Output = Annotated[
    Path | None,
    typer.Option(
        "--output",
        "-o",
        help="Folder for the results; default: maniport-RECORDING-ROBOT, a new one.",
    ),
]
Overwrite = Annotated[
    bool, typer.Option("--overwrite", help="Replace an earlier result in the output folder.")
]
FLAGS = {
    "help_all": typer.Option(
        "--help-all", callback=_help_all, is_eager=True, help="Show help with all options."
    ),
    "json": typer.Option("--json", help="Print the result as JSON."),
    "quiet": typer.Option("--quiet", "-q", help="Print only errors and the result table."),
    "verbose": typer.Option("--verbose", "-v", help="Print the complete report."),
}
"""Flags of all commands."""
FILE = typer.Option(
    "--config", help="YAML file of options, as run.yaml in a result folder.", metavar="FILE"
)
PANELS = {
    "human": "Recording and person",
    "robot": "Robot",
    "transfer": "Transfer",
    "motion": "Motion",
}


def command(
    *names: str, example: str, defaults: Config | None = None, without: Iterable[str] = ()
) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Add a command with a parameter for each option of `names`, which are sections of the configuration or options.

    The function gets them as `config`; a `console` has the flags of all commands.
    """
    chosen = []
    for option in OPTIONS.values():
        is_named = option.name in names or option.section in names
        if is_named and option.typed and option.name not in without:
            chosen.append(option)

    def decorate(verb: Callable[..., None]) -> Callable[..., None]:
        usual = replace(defaults or Config(), verb=verb.__name__)

        @wraps(verb)
        def run(**typed: Any) -> None:
            _, *flags = [typed.pop(name) for name in FLAGS]
            console = Console(*flags)
            if not chosen:
                verb(**typed, console=console)
                return
            file = typed.pop("config_file")
            texts = {option.name: typed.pop(option.name) for option in chosen}
            # domain and info name the robot by an argument
            robot = typed.get("arm") or typed.get("what")
            config = _configuration(usual, file, texts, robot)
            verb(**typed, console=console, config=config)

        signature = _signature(verb, chosen, usual)
        run.__signature__ = signature  # type: ignore[attr-defined]
        for name, parameter in signature.parameters.items():
            run.__annotations__[name] = parameter.annotation
        app.command(cls=_Command, epilog=f"Example: {example}")(run)
        return verb

    return decorate


def _configuration(
    usual: Config, file: Path | None, texts: Mapping[str, object], robot: str | None
) -> Config:
    """Return the configuration of a file, if there is one, with the options that were typed."""
    config = usual
    if file is not None:
        config = Config.load(file, usual, {"recording", "profile", "path", *texts})

    values: dict[str, object] = {}
    for name, text in texts.items():
        if text not in (None, []):
            values[name] = OPTIONS[name].parse(text)
    if "profile" in values:
        values.setdefault("path", None)  # that of a file belongs to the profile of the file
    config = config.changed(allowed=SECTIONS, **values)
    return in_si_units(config, values, robot or config.robot)


def _signature(
    verb: Callable[..., None], chosen: Sequence[Option], usual: Config
) -> inspect.Signature:
    """Return the parameters of a command: its own, one for each option and the flags of all commands."""
    annotations = {option.name: _annotation(option, usual) for option in chosen}
    if chosen:
        annotations["config_file"] = Annotated[Path | None, FILE]
    for name, flag in FLAGS.items():
        annotations[name] = Annotated[bool | None, flag]

    parameters = []
    for name, parameter in inspect.signature(verb, eval_str=True).parameters.items():
        if name not in ("config", "console"):
            parameters.append(parameter)
    for name, annotation in annotations.items():
        parameter = inspect.Parameter(
            name,
            inspect.Parameter.KEYWORD_ONLY,
            default=None,
            annotation=annotation,
        )
        parameters.append(parameter)
    parameters.sort(key=lambda parameter: parameter.default is not inspect.Parameter.empty)
    return inspect.Signature(parameters)


def _annotation(option: Option, usual: Config) -> object:
    """Make the annotation of an option's parameter; None is a value that was not typed."""
    if option.name in ("recording", "profile"):
        settings = typer.Argument(help=option.help, metavar=option.name)
    else:
        settings = _settings(option, usual)
    if option.listed:
        return Annotated[list[str] | None, settings]
    if isinstance(option, Flag):
        return Annotated[bool | None, settings]
    return Annotated[str | None, settings]


def _metavar(option: Option) -> str:
    """Return what stands for the value of an option on the help page."""
    if option.metavar:
        return option.metavar
    words = "|".join(option.choices)
    if words and len(words) <= 24:
        return words
    if option.unit:
        return option.unit
    if option.is_file:
        return "FILE"
    return option.placeholder


def _settings(option: Option, usual: Config) -> ArgumentInfo | OptionInfo:
    """Return name, help and completion of an option."""
    metavar = _metavar(option)
    help = option.help
    if option.choices and metavar == "NAME":
        help += f": {', '.join(option.choices)}"
    default = getattr(usual, option.name)
    if default not in (None, ()):
        help += f" (default {option.text(default)})"

    flag = option.flag
    if isinstance(option, Flag):
        flag = f"{flag}/--no-{flag[2:]}"
    completion = None
    if option.choices:
        completion = _completion(option.choices)
    settings: OptionInfo = typer.Option(
        flag,
        help=help,
        hidden=not option.common,
        metavar=metavar,
        rich_help_panel=PANELS.get(option.section),
        autocompletion=completion,
    )
    return settings


def _completion(choices: Iterable[str]) -> Callable[[], list[str]]:
    def complete() -> list[str]:
        return list(choices)

    return complete


def in_si_units(
    config: Config, typed: Collection[str], robot: str | Sequence[str] | None
) -> Config:
    """Convert `lock` and `home`, where they are among the typed options, to rad or m; this loads the robot."""
    if not robot:
        return config
    if "lock" in typed and config.lock:
        with suppress(UnknownNameError):  # is raised again where the robot is loaded
            joints = _joints(config.changed(robot=robot))
            config = config.changed(lock=_converted("--lock", config.lock, joints))
    if "home" in typed and config.home is not None:
        config = config.changed(home=_home(config, config.home))
    return config


def _home(config: Config, home: Sequence[float]) -> tuple[float, ...]:
    """Convert a configuration of the robot to rad or m, and require its limits."""
    from maniport.motion import MotionLimits
    from maniport.pipeline.robots import load_robot

    arm = MotionLimits.of(load_robot(config), config.limits, config.joint_limit_margin).arm
    if len(home) != arm.dof:
        names = ", ".join(arm.joint_names)
        raise InvalidInputError(
            f"--home must have {arm.dof} numbers, for {names}; found {len(home)}"
        )
    ranges = zip(arm.joint_units, arm.lower, arm.upper, strict=True)
    joints = dict(zip(arm.joint_names, ranges, strict=True))
    values = _converted("--home", dict(zip(arm.joint_names, home, strict=True)), joints)
    return tuple(values.values())


def _joints(config: Config) -> dict[str, tuple[str, float, float]]:
    """Return unit, lower and upper limit of all joints by name, also of those that do not move."""
    from maniport.arms.loaders import read_arm
    from maniport.pipeline.robots import load_robot, names_several

    if config.side == BOTH or names_several(config):
        robot = load_robot(config.changed(lock=None))
        ranges = zip(robot.joint_units, robot.lower, robot.upper, strict=True)
        return dict(zip(robot.joint_names, ranges, strict=True))
    frame = None
    if config.frame:
        frame = config.frame[0]
    chain = read_arm(
        config.robot[0],
        frame,
        config.joints or None,
        config.base,
        config.mesh_folders,
        xacro_args=config.xacro_args,
    )
    ranges = zip(chain.units, chain.lower, chain.upper, strict=True)
    return dict(zip(chain.coordinates, ranges, strict=True))


def _converted(
    option: str,
    values: Mapping[str, float],
    joints: dict[str, tuple[str, float, float]],
    rounding: float = 5e-3,
) -> dict[str, float]:
    """Convert positions of joints from degrees, and require the limits; a limit rounded as printed counts as it."""
    converted = {}
    for name, value in values.items():
        # unknown joints are refused when the robot is loaded
        unit, low, high = joints.get(name, ("", -inf, inf))
        factor = 1.0
        sign = " m"
        if unit == "rad":
            factor = radians(1.0)
            sign = "°"
        least = low / factor
        most = high / factor
        if isfinite(least) and not least - rounding <= value <= most + rounding:
            raise InvalidInputError(
                f"{option}: {name} is {value:g}{sign}; allowed are {least:.2f}{sign} to {most:.2f}{sign}"
            )
        converted[name] = min(max(value * factor, float(low)), float(high))
    return converted


def names_robot(config: Config) -> bool:
    """Whether a robot was named; raise where its options are without one."""
    if not config.robot and (config.export or len(config.changes("robot")) > 1):
        raise InvalidInputError("options of a robot, and --export, need --robot")
    return bool(config.robot)


def output_folder(
    output: Path | None,
    inputs: Sequence[str],
    robots: Sequence[str],
    overwrite: bool,
    *suffixes: str,
) -> Path:
    """Return the folder for the results: by default a new one, named after input and robot.

    A folder with each of the `suffixes` at its end is new, too.
    """
    if output is not None:
        return output
    if overwrite:
        raise InvalidInputError("--overwrite needs --output, the folder of the earlier result")
    names = list[str]()
    for file in dict.fromkeys((*inputs, *robots)):
        name = re.sub(r"[^\w.-]+", "_", Path(os.path.abspath(file)).stem)
        names.append(name[:LONGEST_PART])
    return free_path(Path("-".join(["maniport", *names])), *suffixes)


def require_output(output: Path | None) -> Path:
    """Return the output; raise where there is none, after the other arguments were checked."""
    if output is None:
        raise InvalidInputError("Missing option '--output' / '-o'")
    return output


def require_suffix(output: Path | None, *suffixes: str) -> None:
    """Raise unless a file with one of these suffixes can be written there; None passes."""
    if output is None:
        return
    if output.suffix not in suffixes:
        raise InvalidInputError(
            f"output must end in {' or '.join(suffixes)}; found {str(output)!r}"
        )
    require_room(output)
