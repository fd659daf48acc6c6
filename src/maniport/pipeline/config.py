"""Configuration of a run: all options, from Python, the command line or a YAML file such as ``run.yaml``."""

import os
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any, Self

import yaml

from maniport.errors import FileFormatError, InvalidInputError, unknown_name
from maniport.pipeline.options import HumanOptions, LearningOptions, MotionOptions, RobotOptions, TransferOptions
from maniport.util import defaults
from maniport.util.atomic_io import written_whole
from maniport.util.files import line_of, read_settings
from maniport.util.options import Option, Options, absolute, option, options_of, plain
from maniport.version import __version__

CONFIG = "run.yaml"  # file of the configuration in a result folder


@dataclass(frozen=True, kw_only=True)
class Config(Options):
    """Configuration of a run.

    Attributes
    ----------
    recording : str or tuple of str, optional
        Files, or names of bundled recordings.
    human, robot, transfer, motion, learning
        Sections of options.
    seed : int
        Random seed.

    Raises
    ------
    InvalidInputError
        When a value is not allowed.
    """

    recording: tuple[str, ...] = option((), "Recording: file, folder of keypoints, or bundled name", is_file=True)
    human: HumanOptions = field(default_factory=HumanOptions)
    robot: RobotOptions = field(default_factory=RobotOptions)
    transfer: TransferOptions = field(default_factory=TransferOptions)
    motion: MotionOptions = field(default_factory=MotionOptions)
    learning: LearningOptions = field(default_factory=LearningOptions)
    seed: int = option(0, "Random seed", minimum=0, common=True)

    def changed(self, **options: Any) -> Self:
        """Return the same with other values of options, by their names in any section.

        Raises
        ------
        UnknownNameError
            When there is no option of a name.
        InvalidInputError
            When a value is not allowed.
        """
        parts: dict[str, dict[str, Any]] = {}
        for name, value in options.items():
            if name not in OPTIONS:
                raise unknown_name("option", name, OPTIONS)
            parts.setdefault(OPTIONS[name][0], {})[name] = value
        own = parts.pop("", {})
        return replace(self, **own, **{name: replace(getattr(self, name), **part) for name, part in parts.items()})

    def words(self, section: str) -> list[str]:
        """Return the arguments of the command line for the options of a section that differ from their defaults."""
        part, usual = getattr(self, section), SECTIONS[section]()
        return [
            word
            for name, option in options_of(SECTIONS[section]).items()
            if getattr(part, name) != getattr(usual, name)
            for word in option.words(getattr(part, name))
        ]

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the configuration as YAML, with absolute paths; objects of Python become their names."""
        with written_whole(path) as temporary:
            Path(temporary).write_text(self.as_yaml(), encoding="utf-8")

    def as_yaml(self) -> str:
        """Return the content of the file that `save` writes."""
        content: dict[str, Any] = {}
        for name, (section, described) in OPTIONS.items():
            part: Any = self.robot.named() if section == "robot" else getattr(self, section) if section else self
            value = plain(absolute(getattr(part, name)) if described.is_file else getattr(part, name))
            if name == "method":
                value = part.method_name
            if described.typed:
                (content.setdefault(section, {}) if section else content)[name] = value
        head = f"# maniport {__version__}; SI units. Repeat: maniport transfer --config run.yaml -o FOLDER\n"
        return head + str(yaml.safe_dump(content, sort_keys=False, allow_unicode=True, width=110))

    @classmethod
    def load(cls, path: str | os.PathLike[str], base: "Config | None" = None, names: Collection[str] = ()) -> "Config":
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
        for section, name, value in _entries(path):
            allowed = {key: option for key, option in options_of(SECTIONS.get(section, cls)).items() if option.typed}
            try:
                if name not in allowed:
                    raise unknown_name("key", name, allowed)
                allowed[name].check(value)
                if name in names or not names:
                    config = config.changed(**{name: value})
            except InvalidInputError as error:
                raise FileFormatError(f"{os.fspath(path)}{line_of(path, section, name)}: {error}") from None
        return config


SECTIONS = {
    "human": HumanOptions,
    "robot": RobotOptions,
    "transfer": TransferOptions,
    "motion": MotionOptions,
    "learning": LearningOptions,
}
OPTIONS: dict[str, tuple[str, Option]] = {
    name: (section, described)
    for section, kind in {"": Config, **SECTIONS}.items()
    for name, described in options_of(kind).items()
}
"""Sections and descriptions of all options by name."""

BATCH = Config(
    transfer=TransferOptions(method=defaults.BATCH_METHOD),
    motion=MotionOptions(planning_effort=defaults.BATCH_EFFORT, rate=defaults.BATCH_RATE),
)
"""Defaults of a batch."""


def _entries(path: str | os.PathLike[str]) -> Iterator[tuple[str, Any, Any]]:
    """Yield section, name and value of each option in a file."""
    content = read_settings(path, [item.name for item in fields(Config)])
    for key, value in content.items():
        if key not in SECTIONS:
            yield "", key, value
        elif not isinstance(value, dict):
            where = f"{os.fspath(path)}{line_of(path, key)}"
            raise FileFormatError(f"{where}: {key} must be a mapping of options; found {type(value).__name__}")
        else:
            yield from ((key, name, item) for name, item in value.items())
