"""The recordings and robots of a batch: each once, with a name of its own, and with a digest of its content."""

import glob
import hashlib
import inspect
import itertools
import os
import pickle
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, field, fields, is_dataclass
from pathlib import Path, PurePosixPath
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from maniport.arms import Arm, ArmGroup
from maniport.errors import InvalidInputError, printable
from maniport.mocap import Recording, shipped_recording
from maniport.mocap.readers import READERS
from maniport.pipeline.config import Config
from maniport.pipeline.options import OPTIONS
from maniport.pipeline.settings import Settings, marker_roles, settings_of
from maniport.report.render import SUMMARY
from maniport.util.defaults import ABOUT, SHIPPED
from maniport.version import __version__

AMBIGUOUS = (".npz", ".npy", ".csv", ".tsv", ".json", ".zip")
"""Endings of recordings that are not searched for in a folder: they may be anything, such as earlier results."""


class Clip(NamedTuple):
    """A recording of a list, and its person where the list names it."""

    path: str
    person: str = ""


@dataclass(frozen=True)
class Source:
    """A recording, and its name in the results: a relative path without the folders that all have in common."""

    name: str
    path: Path
    person: str = ""  # as a list names it


@dataclass(frozen=True)
class Robot:
    """A robot of a batch with its options; robots with the same key are equal."""

    key: str  # digest of the settings
    name: str = field(compare=False)  # of its folder
    job: Settings = field(compare=False)
    settings: Mapping[str, str] = field(compare=False)  # digests of options by name


def find_recordings(
    patterns: Sequence[str | os.PathLike[str] | Clip], without: Path
) -> list[Source]:
    """Find the recordings that files, folders and patterns name, but those in the folder `without`; sorted by name."""
    if isinstance(patterns, str | os.PathLike):
        raise InvalidInputError(
            f"recordings must be a sequence, such as [{str(patterns)!r}]; found a name alone"
        )
    sources: dict[Path, str] = {}
    persons: dict[Path, str] = {}
    folders: dict[Path, Path] = {}
    for pattern in patterns:
        person = ""
        if isinstance(pattern, Clip):
            pattern, person = pattern
        for match, name in _matches(os.fspath(pattern)):
            path = resolved(match, folders)
            if without not in path.parents:
                sources.setdefault(path, name)
                persons.setdefault(path, person)
    if not sources:
        raise InvalidInputError(
            "recordings must name at least one file, folder or pattern; found none"
        )

    # Frames of a folder of keypoints are no recordings of their own.
    recordings = {}
    for path, name in sources.items():
        if sources.keys().isdisjoint(path.parents):
            recordings[path] = name

    named = []
    for path, name in _unique(recordings).items():
        named.append(Source(name, path, persons[path]))
    return sorted(named, key=lambda source: source.name)


def resolved(path: Path, folders: dict[Path, Path]) -> Path:
    """Return what `Path.resolve` returns; `folders` are those that are known, which many files share."""
    if path.name in ("", "..") or path.is_symlink():
        return path.resolve()
    if path.parent not in folders:
        folders[path.parent] = path.parent.resolve()
    return folders[path.parent] / path.name


def _matches(text: str) -> list[tuple[Path, str]]:
    """Return the files that one argument names, with their names below it."""
    path = Path(text)
    if not text:
        raise InvalidInputError("recordings: a file, folder or pattern must not be empty")
    if path.is_dir() and not _has_frames(path):
        return _named_below(path, _recordings_below(path))
    if path.exists():
        return [(path, _name(path))]
    if text in SHIPPED:
        return [(shipped_recording(text), shipped_recording(text).name)]
    if not glob.has_magic(text):
        raise InvalidInputError(f"recordings: there is no file, folder or pattern {text!r}")

    matching = []
    for match in glob.glob(text, recursive=True):
        file = Path(match)
        if file.is_file() or _has_frames(file):
            matching.append(file)
    if not matching:
        raise InvalidInputError(f"recordings: no file matches {text!r}")
    fixed = itertools.takewhile(lambda part: not glob.has_magic(part), path.parts)
    return _named_below(Path(*fixed), matching)


def _recordings_below(folder: Path) -> list[Path]:
    """Return all recordings below a folder by their endings; there must be one."""
    recordings = [file for file in _files_below(folder) if _is_recording(file)]
    if not recordings:
        raise InvalidInputError(
            f"recordings: below {str(folder)!r} no file ends with {', '.join(_endings())}; "
            f"name others by a pattern, such as '{folder}/**/*.npz'"
        )
    return recordings


def _named_below(folder: Path, files: Iterable[Path]) -> list[tuple[Path, str]]:
    """Return files with their names below a folder."""
    return [(file, _name(file, folder)) for file in files]


def _files_below(folder: Path) -> Iterator[Path]:
    """Yield all files below a folder; `Path.rglob` raises an error where a folder vanishes meanwhile."""
    for parent, _, names in os.walk(folder):
        for name in names:
            yield Path(parent, name)


def _has_frames(path: Path) -> bool:
    """Whether a path is a folder of keypoints, one JSON file a frame: no result, and no recordings in other formats."""
    if not path.is_dir():
        return False
    frames = False
    for file in path.iterdir():
        if file.name in (ABOUT, SUMMARY) or _is_recording(file):
            return False
        frames |= file.suffix == ".json"
    return frames


def _is_recording(path: Path) -> bool:
    return path.suffix.lower() in _endings() and path.is_file()


def _endings() -> list[str]:
    """Return the endings of recordings in a folder; extensions may have added some."""
    return [ending for ending in READERS if ending not in AMBIGUOUS]


def _name(path: Path, folder: Path | None = None) -> str:
    """Return a path below a folder, or its last part; it never leads upwards."""
    absolute = Path(os.path.abspath(path))
    name = absolute.name
    if folder is not None:
        top = Path(os.path.abspath(folder))
        if top in absolute.parents:
            name = absolute.relative_to(top).as_posix()
    return printable(name)


def _unique(sources: dict[Path, str]) -> dict[Path, str]:
    """Name recordings below the folder that all share where a name is another's, or a folder of another's."""
    names = Counter(sources.values())
    folders = set[str]()
    for name in names:
        folders.update(map(str, PurePosixPath(name).parents))
    if max(names.values()) == 1 and folders.isdisjoint(names):
        return sources

    common = os.path.commonpath([path.parent for path in sources])
    unique = {}
    for path in sources:
        unique[path] = printable(path.relative_to(common).as_posix())
    return unique


def find_robots(
    robots: Sequence[Arm | str | Path], config: Config, taken: Collection[str]
) -> list[Robot]:
    """Load robots and check their options; each once, with a name of its own that is none of those taken."""
    if isinstance(robots, str | Path | Arm) or not len(robots):
        raise InvalidInputError("robots must be a sequence of at least one robot")
    distinct = dict[str, Robot]()
    names = {name.casefold() for name in taken}
    for robot in robots:
        job = settings_of(config.changed(robot=robot))
        settings = _digests_of(job)
        key = digest(settings)
        if key not in distinct:
            distinct[key] = Robot(key, _as_folder(job.robot.name, names), job, settings)
    return list(distinct.values())


def _digests_of(job: Settings) -> dict[str, str]:
    """Return digests of all settings by name; contents replace files."""
    values: dict[str, object] = {}
    for name, option in OPTIONS.items():
        if not option.is_file:
            values[name] = getattr(job.config, name)
    values["maniport"] = __version__
    values["robot"] = job.robot
    values["markers"] = marker_roles(job.config)
    values["directions"] = job.given_lines
    if job.plan is not None:
        values["limits"] = job.plan.motion_limits
        values["collisions"] = job.plan.collisions
    return {name: digest(value) for name, value in values.items()}


def _as_folder(name: str, taken: set[str]) -> str:
    """Replace characters that no folder's name may have, and add a number where the name is taken; it then is taken."""
    allowed = ""
    for letter in name:
        if letter in '/\\:*?"<>|' or not letter.isprintable():
            letter = "-"
        allowed += letter
    first = allowed.strip(". ") or "robot"

    chosen = first
    number = 1
    while chosen.casefold() in taken:
        number += 1
        chosen = f"{first}-{number}"
    taken.add(chosen.casefold())
    return chosen


def digest(*things: object) -> str:
    """Return 128 bits of SHA-256 of values, arrays, arms and settings, and, of a `Path`, of the file's content."""
    described = [_described(thing) for thing in things]
    return hashlib.sha256(repr(described).encode()).hexdigest()[:32]


def _described(thing: object) -> object:
    """Return nested tuples and lists of texts and numbers that are equal for equal contents only."""
    if isinstance(thing, Path):
        return "file", _of_file(thing)
    if isinstance(thing, np.ndarray):
        return _described_array(thing)
    if isinstance(thing, np.generic):
        return _described(thing.item())
    if thing is None or isinstance(thing, bool | int | float | complex | str | bytes):
        return type(thing).__name__, thing
    if isinstance(thing, Mapping | Set | list | tuple):
        return _described_items(thing)
    if inspect.isroutine(thing) or inspect.isclass(thing):
        return "name", f"{thing.__module__}.{thing.__qualname__}"
    kind = type(thing)
    return "object", f"{kind.__module__}.{kind.__qualname__}", _described(_state(thing))


def _described_items(
    things: Mapping[object, object] | Set[object] | Sequence[object],
) -> tuple[str, list[object]]:
    """Return the items of a collection; those without an order are sorted."""
    if isinstance(things, Mapping):
        pairs = [(_described(key), _described(value)) for key, value in things.items()]
        return "mapping", sorted(pairs, key=repr)
    items = [_described(thing) for thing in things]
    if isinstance(things, Set):
        return "set", sorted(items, key=repr)
    return "sequence", items


def _described_array(array: NDArray[np.generic]) -> tuple[object, ...]:
    """Return type, shape and content of an array; the bytes of objects are addresses."""
    if array.dtype.hasobject:
        content = _described(array.tolist())
    else:
        content = hashlib.sha256(array.tobytes()).hexdigest()
    return "array", array.dtype.str, array.shape, content


def _state(thing: object) -> object:
    """Return the content of an object; its origin counts only for recordings."""
    if isinstance(thing, Arm):
        return thing.chain
    if isinstance(thing, ArmGroup):
        return thing.arms, thing.joint_names
    if is_dataclass(thing):
        names = {item.name for item in fields(thing)}
        if not isinstance(thing, Recording):
            names -= {"source", "shapes", "notes"}  # shapes count by the hulls of `Collisions`
        return {name: getattr(thing, name) for name in names}
    if hasattr(thing, "__dict__"):
        return vars(thing)
    return pickle.dumps(thing)


def _of_file(path: Path) -> object:
    """Digest of a file's bytes; of a folder, names and digests of all visible files in it."""
    if path.is_dir():
        visible = [entry for entry in sorted(path.iterdir()) if not entry.name.startswith(".")]
        return [(entry.name, _of_file(entry)) for entry in visible]
    if path.exists() and not path.is_file():
        raise OSError(f"{path} is no file")  # a pipe or a device has no end
    with open(path, "rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
