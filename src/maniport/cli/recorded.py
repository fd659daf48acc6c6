"""Options of recordings and of their transfer, for commands that take a recording."""

import json
import shlex
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from maniport.cli import application as cli
from maniport.errors import FileFormatError
from maniport.util.defaults import AUTO, BATCH_METHOD, DAMPING, KEEP, METHOD, PERSON
from maniport.util.input_limits import SETTINGS_BYTES, read_whole

if TYPE_CHECKING:
    from maniport.mocap import Recording


def _option(help: str) -> Any:
    return typer.Option(help=help, rich_help_panel="What the recording does not say")


@dataclass
class Recorded:
    """Facts about a recording that its file may lack, and the part of it that is used."""

    unit: Annotated[str | None, _option("Unit of length: m, dm, cm, mm, inch or CMU.")] = None
    up: Annotated[str | None, _option("Vertical axis: x, y, z, -x, -y or -z.")] = None
    fps: Annotated[float | None, _option("Frames per second.")] = None
    start: Annotated[float | None, _option("Start of the part that is used [s].")] = None
    stop: Annotated[float | None, _option("End of the part that is used [s].")] = None
    markers: Annotated[
        Path | None, _option("JSON file: names of points by role; maniport info FILE prints one to fill in.")
    ] = None

    def read(self, file: str | Path) -> "Recording":
        """Read the recording, or the part of it that is used."""
        from maniport.mocap import read_recording

        recording = read_recording(file, unit=self.unit, up=self.up, rate=self.fps)
        return recording if self.start is None and self.stop is None else recording.crop(self.start, self.stop)

    def reading(self) -> dict[str, Any]:
        """Return the options as `maniport.batch` takes them."""
        return {"unit": self.unit, "up": self.up, "rate": self.fps, "start": self.start, "stop": self.stop}

    def command(self, file: str | Path) -> str:
        """Return the file and the options but for the markers, as another command takes them."""
        given = {name: value for name, value in vars(self).items() if value is not None and name != "markers"}
        return shlex.join([str(file), *(word for name, value in given.items() for word in (f"--{name}", f"{value}"))])

    def require_none(self, why: str) -> None:
        """Raise if one of the options was given."""
        cli.require_none(vars(self), "is for recordings", why)

    def roles(self) -> dict[str, Any] | None:
        """Read the names of points by role, if a file was given."""
        if self.markers is None:
            return None
        where = f"marker file {str(self.markers)!r}"
        try:
            roles = json.loads(read_whole(self.markers, (), SETTINGS_BYTES))  # bytes: in UTF-8 or UTF-16
        except (UnicodeDecodeError, json.JSONDecodeError, RecursionError) as error:
            raise FileFormatError(f"{where} is not readable JSON: {error}") from None
        if not isinstance(roles, dict):
            example = '{"elbow": ["RELB", "RIEL"]}'
            raise FileFormatError(f"{where} must map roles to lists of point names, such as {example}")
        return roles


takes_recording = cli.group("recorded", Recorded)  # Gives a command that has a parameter `recorded` these options


def _job(
    person: cli.Person = PERSON,
    side: cli.Side = AUTO,
    height: cli.Height = None,
    smooth: Annotated[
        str,
        typer.Option("--smooth", help="Smoothing of noisy points: auto, off, or the highest frequency followed [Hz]."),
    ] = AUTO,
    jumps: Annotated[
        str,
        typer.Option("--jumps", help="Where joints jump: keep it, smooth it, or split there, for the longest part."),
    ] = KEEP,
    method: cli.Method = METHOD,
    kind: cli.Kind = "velocity",
    part: cli.Part = "translation",
    damping: cli.Damping = DAMPING,
    eigenvalue_floor: cli.Floor = None,
    base_rotation: cli.Mounting = (0.0, 0.0, 0.0),
    seed: cli.Seed = 0,
) -> dict[str, Any]:
    """Return the options as `maniport.transfer_recording` takes them."""
    from maniport.arms import EllipsoidSpec

    ellipsoids = {"spec": EllipsoidSpec(kind, part), **cli.regularization(damping, eigenvalue_floor)}
    fit = {"person": person, "side": side, "height": height, "smooth": smooth, "jumps": jumps}
    return {**fit, "method": method, **ellipsoids, "base_rotation": cli.rotation(base_rotation), "random_state": seed}


transfers = cli.group("job", _job)  # Gives a command that has a parameter `job` the options of a transfer

transfers_many = cli.group("job", _job, method=BATCH_METHOD)  # The same for commands that transfer many recordings
