"""The recordings and robots of a batch: each once, with a name of its own, and with a digest of its content."""

import glob
import hashlib
import inspect
import itertools
import os
import pickle
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, field, fields, is_dataclass
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

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


@dataclass(frozen=True)
class Source:
    """A recording, and its name in the results: a relative path without the folders that all have in common."""

    name: str
    path: Path


@dataclass(frozen=True)
class Robot:
    """A robot of a batch with its options; robots with the same key are equal."""

    key: str  # digest of the settings
    name: str = field(compare=False)  # of its folder
    job: Settings = field(compare=False)
    settings: Mapping[str, str] = field(compare=False)  # digests of options by name


def find_recordings(patterns: Sequence[str | os.PathLike[str]], without: Path) -> list[Source]:
    """Find the recordings that files, folders and patterns name, but those in the folder `without`; sorted by name."""
    if isinstance(patterns, str | os.PathLike):
        raise InvalidInputError(
            f"recordings must be a sequence, such as [{str(patterns)!r}]; found a name alone"
        )
    sources: dict[Path, str] = {}
    for pattern in patterns:
        for path, name in _matches(os.fspath(pattern)):
            if without not in path.resolve().parents:
                sources.setdefault(path.resolve(), name)
    if not sources:
        raise InvalidInputError(
            "recordings must name at least one file, folder or pattern; found none"
        )
    # Frames of a folder of keypoints are no recordings of their own.
    sources = {
        path: name for path, name in sources.items() if sources.keys().isdisjoint(path.parents)
    }
    return sorted(
        (Source(name, path) for path, name in _unique(sources).items()),
        key=lambda source: source.name,
    )


def _matches(text: str) -> list[tuple[Path, str]]:
    """Return the files that one argument names, with their names below it."""
    path = Path(text)
    if not text:
        raise InvalidInputError("recordings: a file, folder or pattern must not be empty")
    if path.is_dir() and not _has_frames(path):
        files = [file for file in _files_below(path) if _is_recording(file)]
        if not files:
            raise InvalidInputError(
                f"recordings: below {text!r} no file ends with {', '.join(_endings())}; "
                f"name others by a pattern, such as '{path}/**/*.npz'"
            )
        return [(file, _name(file, path)) for file in files]
    if path.exists():
        return [(path, _name(path))]
    if text in SHIPPED:
        return [(shipped_recording(text), shipped_recording(text).name)]
    if not glob.has_magic(text):
        raise InvalidInputError(f"recordings: there is no file, folder or pattern {text!r}")
    files = [
        file
        for file in map(Path, glob.glob(text, recursive=True))
        if file.is_file() or _has_frames(file)
    ]
    if not files:
        raise InvalidInputError(f"recordings: no file matches {text!r}")
    fixed = Path(*itertools.takewhile(lambda part: not glob.has_magic(part), path.parts))
    return [(file, _name(file, fixed)) for file in files]


def _files_below(folder: Path) -> Iterator[Path]:
    """Yield all files below a folder; `Path.rglob` raises an error where a folder vanishes meanwhile."""
    for parent, _, names in os.walk(folder):
        for name in names:
            yield Path(parent, name)


def _has_frames(path: Path) -> bool:
    """Whether a path is a folder of keypoints, one JSON file a frame: no result, and no recordings in other formats."""
    files = list(path.iterdir()) if path.is_dir() else []
    other = any(file.name in (ABOUT, SUMMARY) or _is_recording(file) for file in files)
    return not other and any(file.suffix == ".json" for file in files)


def _is_recording(path: Path) -> bool:
    return path.suffix.lower() in _endings() and path.is_file()


def _endings() -> list[str]:
    """Return the endings of recordings in a folder; extensions may have added some."""
    return [ending for ending in READERS if ending not in AMBIGUOUS]


def _name(path: Path, folder: Path | None = None) -> str:
    """Return a path below a folder, or its last part; it never leads upwards."""
    absolute = Path(os.path.abspath(path))
    top = absolute.parent if folder is None else Path(os.path.abspath(folder))
    return printable(
        (absolute.relative_to(top) if top in absolute.parents else Path(absolute.name)).as_posix()
    )


def _unique(sources: dict[Path, str]) -> dict[Path, str]:
    """Name recordings below the folder that all share where a name is another's, or a folder of another's."""
    names = Counter(sources.values())
    folders = {str(parent) for name in names for parent in PurePosixPath(name).parents}
    if max(names.values()) == 1 and folders.isdisjoint(names):
        return sources
    common = os.path.commonpath([path.parent for path in sources])
    return {path: printable(path.relative_to(common).as_posix()) for path in sources}


def find_robots(
    robots: Sequence[Arm | str | Path], config: Config, taken: Collection[str]
) -> list[Robot]:
    """Load robots and check their options; each once, with a name of its own that is none of those taken."""
    if isinstance(robots, str | Path | Arm) or not len(robots):
        raise InvalidInputError("robots must be a sequence of at least one robot")
    distinct, names = dict[str, Robot](), {name.casefold() for name in taken}
    for robot in robots:
        job = settings_of(config.changed(robot=robot))
        values = {
            name: getattr(job.config, name)
            for name, option in OPTIONS.items()
            if not option.is_file
        }
        values |= {"maniport": __version__, "robot": job.robot, "markers": marker_roles(job.config)}
        if job.plan is not None:  # contents replace files
            values |= {"limits": job.plan.motion_limits, "collisions": job.plan.collisions}
        settings = {name: digest(value) for name, value in values.items()}
        if (key := digest(settings)) not in distinct:
            distinct[key] = Robot(key, _as_folder(job.robot.name, names), job, settings)
    return list(distinct.values())


def _as_folder(name: str, taken: set[str]) -> str:
    """Replace characters that no folder's name may have, and add a number where the name is taken; it then is taken."""
    whole = "".join(
        "-" if letter in '/\\:*?"<>|' or not letter.isprintable() else letter for letter in name
    )
    first = whole.strip(". ") or "robot"
    names = itertools.chain([first], (f"{first}-{k}" for k in itertools.count(2)))
    chosen = next(name for name in names if name.casefold() not in taken)
    taken.add(chosen.casefold())
    return chosen


def digest(*things: Any) -> str:
    """Return 128 bits of SHA-256 of values, arrays, arms and settings, and, of a `Path`, of the file's content."""
    return hashlib.sha256(repr([_described(thing) for thing in things]).encode()).hexdigest()[:32]


def _described(thing: Any) -> Any:
    """Return nested tuples and lists of texts and numbers that are equal for equal contents only."""
    if isinstance(thing, Path):
        return "file", _of_file(thing)
    if isinstance(thing, np.ndarray):
        content = (
            _described(thing.tolist())
            if thing.dtype.hasobject
            else hashlib.sha256(thing.tobytes()).hexdigest()
        )
        return "array", thing.dtype.str, thing.shape, content
    if isinstance(thing, np.generic):
        return _described(thing.item())
    if thing is None or isinstance(thing, bool | int | float | complex | str | bytes):
        return type(thing).__name__, thing
    if isinstance(thing, Mapping):
        return "mapping", sorted(
            ((_described(key), _described(value)) for key, value in thing.items()), key=repr
        )
    if isinstance(thing, Set):
        return "set", sorted(map(_described, thing), key=repr)
    if isinstance(thing, list | tuple):
        return "sequence", [_described(item) for item in thing]
    if inspect.isroutine(thing) or inspect.isclass(thing):
        return "name", f"{thing.__module__}.{thing.__qualname__}"
    return (
        "object",
        f"{type(thing).__module__}.{type(thing).__qualname__}",
        _described(_state(thing)),
    )


def _state(thing: Any) -> Any:
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
    return vars(thing) if hasattr(thing, "__dict__") else pickle.dumps(thing)


def _of_file(path: Path) -> Any:
    """Digest of a file's bytes; of a folder, names and digests of all visible files in it."""
    if path.is_dir():
        return [
            (entry.name, _of_file(entry))
            for entry in sorted(path.iterdir())
            if not entry.name.startswith(".")
        ]
    if path.exists() and not path.is_file():
        raise OSError(f"{path} is no file")  # a pipe or a device has no end
    with open(path, "rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
