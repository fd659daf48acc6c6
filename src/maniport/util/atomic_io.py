"""Write files and folders atomically: a reader never finds half of one, whatever ends the process that writes.

Everything is written to a temporary file or folder in the target's folder, which then takes the target's place. A
killed process may leave it there, under a name with a leading dot.
"""

import json
import os
import secrets
import shutil
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager, suppress
from itertools import islice
from pathlib import Path

from maniport.errors import OutputError, argument
from maniport.util.input_limits import as_path

EARLIER = ".earlier"
"""Suffix of the former target where two folders cannot be exchanged in one operation."""

_targets: dict[Path, Path] = {}  # targets that this process is writing, by temporary path

_written: dict[Path, str] = {}
"""Text before the name of each target that this process has written, without what is in the target."""


@contextmanager
def written_whole(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Give a temporary path next to `path`; when the block ends well it takes the place of `path`."""
    with _writable_target(as_path(path)) as target, temporary_sibling(target) as temporary:
        yield temporary
        place(temporary, target)


def write_text(path: str | os.PathLike[str], text: str) -> None:
    """Write a text file, whole or not at all."""
    with written_whole(path) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="")


@contextmanager
def folder_written_whole(
    folder: str | os.PathLike[str], own: Collection[str], overwrite: bool = False
) -> Iterator[Path]:
    """Give a temporary folder; when the block ends well it takes the place of `folder`, else it is removed.

    An existing folder is replaced only with `overwrite`, and only if all files below it have names of `own`.
    """
    path = as_path(folder, "folder")
    with _writable_target(path, folder=True) as target:
        _require_own(path, own, overwrite)
        with temporary_sibling(target, folder=True) as staging:
            yield staging
            # files that others wrote there in the meantime stay as well
            _require_own(path, own, overwrite)
            place(staging, target)


def claim(
    folder: Path, marker: str, content: Mapping[str, object], same: Collection[str] = ()
) -> None:
    """Write a marker to a new folder; raise `OutputError` for another one, or where its marker differs in `same`."""
    file = folder / marker
    # looked for first: a process that claims the folder at the same time writes the marker before anything else
    has_others = folder.is_dir() and any(
        not entry.name.startswith(".") for entry in folder.iterdir()
    )
    try:
        earlier = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        earlier = None
    if not isinstance(earlier, dict) or not content.keys() <= earlier.keys():
        if has_others:
            raise OutputError(
                f"{str(folder)!r} holds other things; give a new folder with {argument('output')}"
            )
    elif any(earlier[name] != content[name] for name in same):
        raise OutputError(
            f"{str(folder)!r} holds results of another {' or '.join(same)}; give a new folder with {argument('output')}"
        )
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise OutputError(f"cannot write {str(folder)!r}: {error.strerror or error}") from None
    _written[Path(os.path.realpath(folder))] = "parts of "
    write_text(file, json.dumps(content) + "\n")


def require_room(path: str | os.PathLike[str], folder: bool = False) -> None:
    """Raise `OutputError` unless a file or folder can be written at `path`; called before any long work starts."""
    with _writable_target(as_path(path), folder) as target, temporary_sibling(target, folder):
        pass


def require_free(folder: Path, own: Collection[str], overwrite: bool = False) -> None:
    """Raise `OutputError` unless results may be written to `folder`; called before any long work starts."""
    require_room(folder, folder=True)
    _require_own(folder, own, overwrite)


def free_path(path: Path, *suffixes: str) -> Path:
    """Return the path, or with -2, -3, … at its end the first that does not exist, with each of the suffixes either."""
    number = 1
    free = path
    while any(os.path.lexists(f"{free}{suffix}") for suffix in ("", *suffixes)):
        number += 1
        free = path.with_name(f"{path.name}-{number}")
    return free


@contextmanager
def temporary_sibling(target: Path, folder: bool = False) -> Iterator[Path]:
    """Give a new empty file or folder in the folder of `target`; when the block ends it is removed."""
    path = target.with_name(f".{target.stem[:50]}-{secrets.token_hex(4)}{target.suffix}")
    _targets[path] = target  # registered first, so that an interruption finds it
    try:
        if folder:
            path.mkdir()
        else:
            path.touch(exist_ok=False)
        yield path
    finally:
        _remove(path, target)
        del _targets[path]


def place(temporary: Path, target: Path) -> None:
    """Move a temporary file or folder to `target`, which is the old or the new one at any moment."""
    if not target.is_dir():
        os.replace(temporary, target)
    elif not _exchange(temporary, target):
        os.rename(target, temporary.with_name(temporary.name + EARLIER))
        os.rename(temporary, target)
    if not any(folder in _targets or folder in _written for folder in target.parents):
        _written[target] = ""


def written() -> str:
    """Describe what this process has written, for the message of an interruption."""
    names = ", ".join(f"{text}{str(path)!r}" for path, text in _written.items())
    if names:
        return f"already written: {names}"
    return "nothing was written"


def discard() -> None:
    """Remove whatever this process is writing; it must not write afterwards."""
    for path, target in _targets.items():
        _remove(path, target)


@contextmanager
def _writable_target(path: Path, folder: bool = False) -> Iterator[Path]:
    """Follow symbolic links to a place where something can be written; errors of the system become `OutputError`."""
    refused = f"cannot write {str(path)!r}"
    try:
        target = Path(os.path.realpath(path))
        if not target.name:
            raise OutputError(f"{refused}: it is the root of the file system")
        if not target.parent.is_dir():
            raise OutputError(f"{refused}: there is no folder {str(target.parent)!r}")
        with suppress(FileNotFoundError):
            os.stat(target)  # a name may be too long, links may form a loop
        if target.is_dir() and not folder:
            raise OutputError(f"{refused}: it is a folder")
        if target.exists() and not (target.is_dir() or target.is_file()):
            raise OutputError(f"{refused}: it is a pipe, a socket or a device")
        yield target
    except OutputError:
        raise
    except OSError as error:
        raise OutputError(f"{refused}: {error.strerror or error}") from None


def _require_own(folder: Path, own: Collection[str], overwrite: bool) -> None:
    """Raise `OutputError` where the content of `folder` must not be replaced."""
    if not folder.exists():
        return
    if not folder.is_dir():
        raise OutputError(f"cannot write {str(folder)!r}: it is a file")
    names = ", ".join(map(repr, islice(_other_entries(folder, own), 5)))
    if names:
        raise OutputError(
            f"{str(folder)!r} holds other things ({names}); give a new folder with {argument('output')}"
        )
    if not overwrite and any(folder.iterdir()):
        advice = f"give {argument('overwrite')} to replace it, or a new folder"
        raise OutputError(f"{str(folder)!r} holds an earlier result; {advice}")
    if not os.access(folder, os.W_OK):
        raise OutputError(f"cannot write {str(folder)!r}: permission denied")


def _other_entries(folder: Path, own: Collection[str]) -> Iterator[str]:
    """Give the files and empty folders below a folder that have other names."""
    for entry in folder.rglob("*"):
        if entry.is_dir() and any(entry.iterdir()):
            continue
        if entry.name not in own:
            yield entry.relative_to(folder).as_posix()


def _remove(path: Path, target: Path) -> None:
    """Remove a temporary file or folder and the former target, which is restored if there is no new one."""
    earlier = path.with_name(path.name + EARLIER)
    with suppress(OSError):
        if not target.exists():
            os.rename(earlier, target)
    for entry in (path, earlier):
        if entry.is_dir():
            shutil.rmtree(entry, ignore_errors=True)
        else:
            with suppress(OSError):
                entry.unlink()


def _exchange(first: Path, second: Path) -> bool:
    """Exchange two folders in one operation of Linux; False where the system cannot."""
    import ctypes

    # AT_FDCWD, RENAME_EXCHANGE
    here = -100
    exchange = 2
    with suppress(AttributeError, OSError, TypeError):
        rename = ctypes.CDLL(None).renameat2
        return bool(rename(here, os.fsencode(first), here, os.fsencode(second), exchange) == 0)
    return False
