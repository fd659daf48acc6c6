"""Configuration of a run: all options, from Python, the command line or a YAML file such as ``run.yaml``."""

import os
from collections.abc import Collection
from dataclasses import dataclass, field, fields, replace
from typing import TYPE_CHECKING, Self

import numpy as np

from maniport.errors import FileFormatError, InvalidInputError, unknown_name
from maniport.pipeline.option import plain
from maniport.pipeline.options import OPTIONS, SECTIONS, TransferOptions
from maniport.util.atomic_io import write_text
from maniport.util.files import line_of, read_settings, settings_text
from maniport.version import __version__

if TYPE_CHECKING:
    from maniport.arms import Arm, ArmGroup
    from maniport.util.validation import Array

CONFIG = "run.yaml"  # file of the configuration in a result folder


@dataclass(frozen=True, kw_only=True)
class Config(TransferOptions):
    """Options of a transfer with those that only commands have, as a file holds them.

    ``maniport COMMAND --help-all`` describes the options; ``costs`` are in Python only.

    Attributes
    ----------
    verb : str
        Command that a saved configuration repeats.

    Raises
    ------
    InvalidInputError
        When a value is not allowed.
    """

    # files
    recording: tuple[str, ...] = ()
    profile: str | None = None
    path: str | None = None

    # a robot as teacher
    teacher: str | None = None
    teacher_frame: tuple[str, ...] = ()
    episode: int = 0
    joint_unit: str | None = None
    columns: tuple[str, ...] = ()

    # maniport place, maniport track
    place: bool = False
    tilt: str | float | None = None  # [rad], or "free"
    rank: int = 1

    # maniport learn
    segments: tuple[str, ...] = ()
    components: int | None = None

    # maniport batch
    profile_rate: float = 10.0  # [Hz]
    pages: bool = False

    verb: str = field(default="transfer", compare=False)

    @classmethod
    def of(cls, options: TransferOptions | None) -> Self:
        """Return options of a transfer as a configuration; None: the defaults."""
        if options is None:
            return cls()
        if isinstance(options, cls):
            return options
        values = {item.name: getattr(options, item.name) for item in fields(TransferOptions)}
        return cls(**values)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write YAML with absolute paths; objects of Python become names, or files that load the same arm."""
        values = self._named()
        content: dict[str, object] = {}
        for section in ("", *SECTIONS):
            described = [option for option in _IN_FILES if option.section == section]
            settings = {}
            for option in described:
                settings[option.name] = plain(values[option.name], option.is_file)
            content |= {section: settings} if section else settings

        head = f"# maniport {__version__}; SI units. Repeat: maniport {self.verb} --config {CONFIG} -o FOLDER\n"
        write_text(path, head + settings_text(content))

    def _named(self) -> dict[str, object]:
        """Return the values by name, with objects of Python as names or files."""
        from maniport.arms import Arm, ArmGroup
        from maniport.transfer import name_of

        values = {name: getattr(self, name) for name in OPTIONS}
        if not isinstance(self.method, str):
            values["method"] = name_of(self.method)

        robot = self.robot[0] if self.robot else None
        if isinstance(robot, Arm):
            values |= _options_of_arm(robot)
        elif isinstance(robot, ArmGroup):
            values |= _options_of_group(robot)
        return values

    @classmethod
    def load(
        cls, path: str | os.PathLike[str], base: "Config | None" = None, names: Collection[str] = ()
    ) -> "Config":
        """Read a configuration.

        Parameters
        ----------
        path : str or path
        base : Config, optional
            Values of options that the file lacks. Default: those of this class.
        names : collection of str
            Options that are used. Default: all.

        Raises
        ------
        FileFormatError
            When the file is no readable YAML, has an unknown key or a value that is not allowed.
        """
        config = base or cls()
        file = os.fspath(path)
        top = [option.name for option in _IN_FILES if not option.section]
        for key, value in read_settings(path, [*top, *SECTIONS]).items():
            section = ""
            settings = {key: value}
            if key in SECTIONS:
                section = key
                settings = value
            if not isinstance(settings, dict):
                kind = type(settings).__name__
                raise FileFormatError(
                    f"{file}{line_of(path, key)}: {key} must be a mapping of options; found {kind}"
                )

            allowed = [option.name for option in _IN_FILES if option.section == section]
            for name, setting in settings.items():
                try:
                    if name not in allowed:
                        raise unknown_name("key", name, allowed)
                    OPTIONS[name].check_setting(setting)
                    if name in names or not names:
                        config = replace(config, **{name: setting})
                except InvalidInputError as error:
                    raise FileFormatError(
                        f"{file}{line_of(path, section, name)}: {error}"
                    ) from None
        return config


def _options_of_arm(arm: "Arm") -> dict[str, object]:
    """Return the options that load an arm; the joints that do not move are locked."""
    chain = arm.chain
    return {
        "robot": (chain.source or arm.name,),
        "frame": (arm.frame,),
        "joints": (),
        "base": chain.base if chain.base_pose is None else None,
        "lock": dict(chain.locked) or None,
        "pose": (),
        "xacro_args": dict(chain.xacro_args) or None,
    }


def _options_of_group(group: "ArmGroup") -> dict[str, object]:
    """Return the options that load the arms of one robot, or several robots in one world."""
    first = group.arms[0].chain
    poses = [arm.chain.base_pose for arm in group.arms]
    standing = [_base_numbers(pose) for pose in poses if pose is not None]
    robots = [arm.chain.source or arm.name for arm in group.arms]
    if not standing:
        robots = robots[:1]
    return {
        "robot": tuple(robots),
        "frame": tuple(arm.frame for arm in group.arms),
        "joints": (),
        "base": None,
        "lock": dict(group.locked) or None,
        "pose": tuple(standing),
        "xacro_args": dict(first.xacro_args) or None,
    }


def _base_numbers(base_pose: "Array") -> tuple[float, ...] | tuple[tuple[float, ...], ...]:
    """Return x, y, z [m] and the yaw [rad] of an upright base, and the rows of another pose (4, 4)."""
    from maniport.arms.chain import pose

    x, y, z = base_pose[:3, 3].tolist()
    yaw = float(np.arctan2(base_pose[1, 0], base_pose[0, 0]))
    if np.allclose(pose((x, y, z), (0.0, 0.0, yaw)), base_pose, rtol=0.0, atol=1e-12):
        return x, y, z, yaw
    return tuple(tuple(row) for row in base_pose.tolist())


_IN_FILES = [option for option in OPTIONS.values() if option.typed]

BATCH = Config(
    method="length-field", rate=100.0, verb="batch"
)  # a selection would take seconds for each pair
LIVE = Config(real_time=True, verb="live")
"""Defaults of a batch, and of live control."""
