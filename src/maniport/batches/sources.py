"""Which recordings are meant: files, folders and patterns, each recording once and with a name of its own."""

import glob
import os
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from maniport.defaults import RECORDINGS
from maniport.demonstrations import shipped_recording
from maniport.demonstrations.readers import SHIPPED
from maniport.errors import InvalidInputError

AMBIGUOUS = (".npz", ".npy", ".csv", ".tsv", ".json")
"""Endings of files that may be anything: of a folder they are not taken, since results have them as well."""

WILD = "*?["


@dataclass(frozen=True)
class Source:
    """A recording, and what it is called in the results: a path of its own, without what all have in common."""

    name: str
    path: Path


def sources(given: Sequence[str | os.PathLike[str]], without: Path) -> list[Source]:
    """Find the recordings that are meant, in the order of their names.

    Parameters
    ----------
    given : sequence of str or path
        Files, folders of keypoints, names of shipped recordings; folders, for all recordings below them whose ending no
        other file has; patterns such as ``recordings/**/*.bvh``.
    without : Path
        A folder in which nothing is looked for: that of the results.

    Raises
    ------
    InvalidInputError
        When one of them names nothing, or none is given.
    """
    if isinstance(given, str | os.PathLike):
        raise InvalidInputError(f"recordings must be a sequence, such as [{str(given)!r}]; found a name alone")
    found: dict[Path, str] = {}
    for one in given:
        for path, name in _meant(os.fspath(one)):
            if without not in path.resolve().parents:
                found.setdefault(path.resolve(), name)
    if not found:
        raise InvalidInputError("recordings must name at least one file, folder or pattern; found none")
    return sorted((Source(name, path) for path, name in _told_apart(found).items()), key=lambda one: one.name)


def _meant(text: str) -> list[tuple[Path, str]]:
    """The files that one argument means, with their names below what it says."""
    path = Path(text)
    if path.is_dir() and not any(path.glob("*.json")):
        return _below(path)
    if path.exists():
        return [(path, path.name)]
    if text in SHIPPED:
        return [(shipped_recording(text), shipped_recording(text).name)]
    if not any(sign in text for sign in WILD):
        raise InvalidInputError(f"recordings: there is no file, folder or pattern {text!r}")
    matching = [Path(one) for one in glob.glob(text, recursive=True)]
    files = [one for one in matching if one.is_file() or (one.is_dir() and any(one.glob("*.json")))]
    if not files:
        raise InvalidInputError(f"recordings: no file matches {text!r}")
    fixed = Path(*_fixed(path.parts))
    return [(one, one.relative_to(fixed).as_posix()) for one in files]


def _fixed(parts: Sequence[str]) -> list[str]:
    """The first parts of a pattern, in which nothing varies, without the file's name."""
    wild = next(i for i, part in enumerate(parts) if any(sign in part for sign in WILD))
    return list(parts[:wild])


def _below(folder: Path) -> list[tuple[Path, str]]:
    endings = [ending for ending in RECORDINGS if ending not in AMBIGUOUS]
    found = [one for one in folder.rglob("*") if one.suffix.lower() in endings and one.is_file()]
    if not found:
        raise InvalidInputError(
            f"recordings: below {str(folder)!r} no file ends with {', '.join(endings)}; name others by a pattern, "
            f"such as '{folder}/**/*.npz'"
        )
    return [(one, one.relative_to(folder).as_posix()) for one in found]


def _told_apart(found: dict[Path, str]) -> dict[Path, str]:
    """The same with as many folders before equal names as it takes to tell them apart."""
    names = dict(found)
    while again := {name for name, count in Counter(names.values()).items() if count > 1}:
        for path, name in names.items():
            if name in again:
                names[path] = Path(*path.parts[-len(Path(name).parts) - 1 :]).as_posix()
    return names
