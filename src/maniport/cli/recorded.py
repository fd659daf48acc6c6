"""What the user says of a recording: options that all verbs share which read one."""

import json
import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from maniport.cli.groups import group, require_none
from maniport.errors import FileFormatError
from maniport.input_limits import SETTINGS_BYTES, read_whole

if TYPE_CHECKING:
    from maniport.demonstrations import Recording


class Recorded:
    """What the options below were set to.

    Parameters
    ----------
    unit, up, fps
        As `maniport.read_recording` takes them.
    start, stop : float or None
        The part that is used [s].
    markers : path or None
        A JSON file: which points play which role.
    """

    def __init__(
        self,
        unit: str | None,
        up: str | None,
        fps: float | None,
        start: float | None,
        stop: float | None,
        markers: Path | None,
    ):
        self._said: dict[str, Any] = {"unit": unit, "up": up, "rate": fps}
        self._start, self._stop, self._markers = start, stop, markers

    def read(self, file: str | Path) -> "Recording":
        """The recording in a file, or the part of it that is meant."""
        from maniport.demonstrations import read_recording

        recording = read_recording(file, **self._said)
        return recording if self._start is None and self._stop is None else recording.crop(self._start, self._stop)

    def reading(self) -> dict[str, Any]:
        """What was said, as `maniport.batch` takes it."""
        return {**self._said, "start": self._start, "stop": self._stop}

    def command(self, file: str | Path) -> str:
        """How a further command names the file, with what was said of it but for the markers."""
        said = self._given().items()
        options = (word for name, value in said if value is not None for word in (f"--{name}", f"{value}"))
        return shlex.join([str(file), *options])

    def require_none(self, why: str) -> None:
        """Raise when one of the options was given; `why` says what the file is."""
        require_none({**self._given(), "markers": self._markers}, "is for recordings", why)

    def _given(self) -> dict[str, Any]:
        """What was said of the file but for the markers, by option."""
        said = {"unit": self._said["unit"], "up": self._said["up"], "fps": self._said["rate"]}
        return {**said, "start": self._start, "stop": self._stop}

    def markers(self) -> dict[str, Any] | None:
        """Which points play which role, where the user says it."""
        if self._markers is None:
            return None
        where = f"marker file {str(self._markers)!r}"
        try:
            markers = json.loads(read_whole(self._markers, (), SETTINGS_BYTES))  # bytes: in UTF-8 or UTF-16
        except (UnicodeDecodeError, json.JSONDecodeError, RecursionError) as error:
            raise FileFormatError(f"{where} is not readable JSON: {error}") from None
        if not isinstance(markers, dict):
            raise FileFormatError(
                f'{where} must map roles to lists of point names, such as {{"elbow": ["RELB", "RIEL"]}}'
            )
        return markers


def _option(help: str, **more: Any) -> Any:
    return typer.Option(help=help, rich_help_panel="What the recording does not say", **more)


def _options(
    unit: Annotated[str | None, _option("Unit of length: m, dm, cm, mm, inch or CMU.")] = None,
    up: Annotated[str | None, _option("Axis that points up: x, y, z, -x, -y or -z.")] = None,
    fps: Annotated[float | None, _option("Frames per second.")] = None,
    start: Annotated[float | None, _option("Use it from this time on [s].")] = None,
    stop: Annotated[float | None, _option("Use it up to this time [s].")] = None,
    markers: Annotated[
        Path | None, _option("JSON file: names of points by role; maniport info FILE prints one to fill in.")
    ] = None,
) -> None:
    """Nothing: its parameters are the options."""


takes_recording = group("recorded", _options, Recorded)
"""Gives a verb that has a parameter `recorded` these options."""
