"""Configuration of a run: all options, from Python, the command line or a YAML file such as ``run.yaml``."""

import os
from collections.abc import Collection
from dataclasses import dataclass, field, fields, replace
from typing import Any, Self

import yaml

from maniport.errors import FileFormatError, InvalidInputError, unknown_name
from maniport.pipeline.option import Option, Options, option, options_of, plain
from maniport.pipeline.options import (
    BatchOptions,
    HumanOptions,
    LearningOptions,
    MotionOptions,
    PlacementOptions,
    RobotOptions,
    TransferOptions,
)
from maniport.util.atomic_io import written_whole
from maniport.util.files import line_of, read_settings
from maniport.version import __version__

CONFIG = "run.yaml"  # file of the configuration in a result folder


@dataclass(frozen=True, kw_only=True)
class Config(Options):
    """Configuration of a run.

    Attributes
    ----------
    recording : tuple of str
        Files, or names of bundled recordings.
    profile, path : str or None
        Files of a target profile and path, instead of a recording.
    human, robot, transfer, motion, placement, learning, batch
        Sections of options.
    seed : int
        Random seed.
    verb : str
        Command that a saved configuration repeats.

    Raises
    ------
    InvalidInputError
        When a value is not allowed.
    """

    recording: tuple[str, ...] = option((), "Recording: file, folder of keypoints, or bundled name", is_file=True)
    profile: str | None = option(None, "Target velocity ellipsoids, .npz", is_file=True)
    path: str | None = option(None, "Positions of the hand, one for each ellipsoid, .npz", is_file=True, common=True)
    human: HumanOptions = field(default_factory=HumanOptions)
    robot: RobotOptions = field(default_factory=RobotOptions)
    transfer: TransferOptions = field(default_factory=TransferOptions)
    motion: MotionOptions = field(default_factory=MotionOptions)
    placement: PlacementOptions = field(default_factory=PlacementOptions)
    learning: LearningOptions = field(default_factory=LearningOptions)
    batch: BatchOptions = field(default_factory=BatchOptions)
    seed: int = option(0, "Random seed", minimum=0, common=True)
    verb: str = field(default="transfer", compare=False)

    def changed(self, *, allowed: Collection[str] = (), **options: Any) -> Self:
        """Return the same with other values of options, by their names in any section.

        Parameters
        ----------
        allowed : collection of str, optional
            Sections whose options are used, in addition to those without a section. Default: all.
        **options

        Raises
        ------
        UnknownNameError
            When there is no option of a name, or its section is not allowed.
        InvalidInputError
            When a value is not allowed.
        """
        parts: dict[str, dict[str, Any]] = {}
        names = [name for name, (section, _) in OPTIONS.items() if not (allowed and section) or section in allowed]
        for name, value in options.items():
            if name not in names:
                raise unknown_name("option", name, names)
            parts.setdefault(OPTIONS[name][0], {})[name] = value
        own = parts.pop("", {})
        return replace(self, **own, **{name: replace(getattr(self, name), **part) for name, part in parts.items()})

    def value(self, name: str) -> Any:
        """Return the value of an option in any section."""
        section = OPTIONS[name][0]
        return getattr(getattr(self, section) if section else self, name)

    def changes(self, section: str) -> list[Option]:
        """Return the options of a section that differ from their defaults."""
        part, usual = getattr(self, section), SECTIONS[section]()
        described = options_of(SECTIONS[section])
        return [item for name, item in described.items() if getattr(part, name) != getattr(usual, name)]

    def as_yaml(self) -> str:
        """Return the configuration as a file's text, with absolute paths; objects of Python become their names."""
        method: Any = self.transfer.method
        if not isinstance(method, str):
            from maniport.transfer import name_of

            method = name_of(method)
        named = replace(self, robot=self.robot.named(), transfer=replace(self.transfer, method=method))
        content: dict[str, Any] = {}
        for name, (section, described) in OPTIONS.items():
            if described.typed:
                part = content.setdefault(section, {}) if section else content
                part[name] = plain(named.value(name), described.is_file)
        head = f"# maniport {__version__}; SI units. Repeat: maniport {self.verb} --config {CONFIG} -o FOLDER\n"
        return head + str(yaml.safe_dump(content, sort_keys=False, allow_unicode=True, width=110))

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the configuration as YAML."""
        with written_whole(path) as temporary:
            temporary.write_text(self.as_yaml(), encoding="utf-8")

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
        config, file = base or cls(), os.fspath(path)
        for key, value in read_settings(path, [item.name for item in fields(cls) if item.name != "verb"]).items():
            if key in SECTIONS and not isinstance(value, dict):
                kind = type(value).__name__
                raise FileFormatError(f"{file}{line_of(path, key)}: {key} must be a mapping of options; found {kind}")
            section = key if key in SECTIONS else ""
            described = {name: item for name, (place, item) in OPTIONS.items() if place == section and item.typed}
            for name, setting in value.items() if section else [(key, value)]:
                try:
                    if name not in described:
                        raise unknown_name("key", name, described)
                    described[name].check(setting)
                    if name in names or not names:
                        config = config.changed(**{name: setting})
                except InvalidInputError as error:
                    raise FileFormatError(f"{file}{line_of(path, section, name)}: {error}") from None
        return config


SECTIONS = {
    "human": HumanOptions,
    "robot": RobotOptions,
    "transfer": TransferOptions,
    "motion": MotionOptions,
    "placement": PlacementOptions,
    "learning": LearningOptions,
    "batch": BatchOptions,
}
OPTIONS: dict[str, tuple[str, Option]] = {
    name: (section, described)
    for section, kind in {"": Config, **SECTIONS}.items()
    for name, described in options_of(kind).items()
}
"""Sections and descriptions of all options by name."""

BATCH = Config(
    transfer=TransferOptions(method="length-field"),  # one for all pairs, since a selection takes seconds for each
    motion=MotionOptions(rate=100.0),  # [Hz], as data for learning
    verb="batch",
)
"""Defaults of a batch."""

LIVE = Config(motion=MotionOptions(real_time=True), verb="live")
"""Defaults of live control."""
