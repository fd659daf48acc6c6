"""Which recordings are meant: files, folders and patterns, each recording once and with a name of its own."""

import glob
import os
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from maniport.defaults import RECORDINGS
from maniport.demonstrations import shipped_recording
from maniport.demonstrations.readers import SHIPPED
from maniport.errors import InvalidInputError, as_text
from maniport.telling.renderings import SUMMARY

ABOUT = "batch.json"
"""The file by which a folder is known as that of a batch."""

AMBIGUOUS = (".npz", ".npy", ".csv", ".tsv", ".json")
"""Endings of files that may be anything: of a folder they are not taken, since results have them as well."""

ENDINGS = [ending for ending in RECORDINGS if ending not in AMBIGUOUS]

WILD = "*?["


@dataclass(frozen=True)
class Source:
    """A recording, and what it is called in the results: a path of its own, without what all have in common."""

    name: str
    path: Path


def sources(given: Sequence[str | os.PathLike[str]], without: Path) -> list[Source]:
    """Find the recordings that are meant, in the order of their names."""
    if isinstance(given, str | os.PathLike):
        raise InvalidInputError(f"recordings must be a sequence, such as [{str(given)!r}]; found a name alone")
    found: dict[Path, str] = {}
    for one in given:
        for path, name in _meant(os.fspath(one)):
            if without not in path.resolve().parents:
                found.setdefault(path.resolve(), name)
    if not found:
        raise InvalidInputError("recordings must name at least one file, folder or pattern; found none")
    found = {path: name for path, name in found.items() if found.keys().isdisjoint(path.parents)}  # frames of a folder
    return sorted((Source(name, path) for path, name in _told_apart(found).items()), key=lambda one: one.name)


def _meant(text: str) -> list[tuple[Path, str]]:
    """The files that one argument means, with their names below what it says."""
    path = Path(text)
    if not text:
        raise InvalidInputError("recordings: a file, folder or pattern must not be empty")
    if path.is_dir() and not _has_frames(path):
        return _below(path)
    if path.exists():
        return [(path, _name(path))]
    if text in SHIPPED:
        return [(shipped_recording(text), shipped_recording(text).name)]
    if not any(sign in text for sign in WILD):
        raise InvalidInputError(f"recordings: there is no file, folder or pattern {text!r}")
    matching = [Path(one) for one in glob.glob(text, recursive=True)]
    files = [one for one in matching if one.is_file() or _has_frames(one)]
    if not files:
        raise InvalidInputError(f"recordings: no file matches {text!r}")
    fixed = Path(*_fixed(path.parts))
    return [(one, _name(one, fixed)) for one in files]


def _has_frames(path: Path) -> bool:
    """Whether a path is a folder of keypoints, one file a frame: no result, and not one of recordings beside JSON."""
    if not path.is_dir() or not any(path.glob("*.json")):
        return False
    return not any(one.name in (ABOUT, SUMMARY) or _is_recording(one) for one in path.iterdir())


def _name(path: Path, folder: Path | None = None) -> str:
    """What a path is called below a folder, or by itself; nothing in it leads upwards."""
    here = Path(os.path.abspath(path))
    top = here.parent if folder is None else Path(os.path.abspath(folder))
    return as_text((here.relative_to(top) if top in here.parents else Path(here.name)).as_posix())


def _fixed(parts: Sequence[str]) -> list[str]:
    """The first parts of a pattern, in which nothing varies, without the file's name."""
    wild = next(i for i, part in enumerate(parts) if any(sign in part for sign in WILD))
    return list(parts[:wild])


def _below(folder: Path) -> list[tuple[Path, str]]:
    found = [one for one in folder.rglob("*") if _is_recording(one)]
    if not found:
        raise InvalidInputError(
            f"recordings: below {str(folder)!r} no file ends with {', '.join(ENDINGS)}; name others by a pattern, "
            f"such as '{folder}/**/*.npz'"
        )
    return [(one, _name(one, folder)) for one in found]


def _is_recording(path: Path) -> bool:
    """Whether a file's ending says that it is a recording."""
    return path.suffix.lower() in ENDINGS and path.is_file()


def _told_apart(found: dict[Path, str]) -> dict[Path, str]:
    """The same with as many folders before names as it takes that none is another's, nor a folder of another's."""
    names = dict(found)
    while again := _clashing(list(names.values())):
        for path, name in names.items():
            if name in again:
                parts = [path.drive.rstrip(":"), *path.parts[1:]] if path.drive else path.parts[1:]
                names[path] = as_text("/".join(parts[-name.count("/") - 2 :]))
    return names


def _clashing(names: Sequence[str]) -> set[str]:
    """Names that occur again, or that are the beginning of another's path, and these."""
    again = {name for name, count in Counter(names).items() if count > 1}
    every = set(names)
    for name in names:
        for parent in PurePosixPath(name).parents:
            if str(parent) in every:
                again |= {str(parent), name}
    return again
