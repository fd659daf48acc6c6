"""Temporary files and folders beside what is written: known by their names, locked while they are written.

What a killed process leaves is told from what another one is writing by its lock, which the system takes back when a
process ends, however it ends. The next that writes the same target removes it. Where file systems have no locks nothing
is removed, nor what another computer left: some lock for one computer alone.
"""

import os
import platform
import re
import secrets
import shutil
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

try:
    import fcntl
except ImportError:  # Windows: nothing is locked, and nothing removed
    fcntl = None  # type: ignore[assignment]

CLIPPED = 50
"""Characters of a target's name in that of a temporary one, which shall not become too long."""
EARLIER = ".earlier"
"""Ends the name of what was there before, where two folders cannot change places at once."""
EXCHANGE, HERE = 2, -100
"""RENAME_EXCHANGE and AT_FDCWD of Linux."""

_targets: dict[Path, Path] = {}
"""What this process writes now: targets by temporary names."""
_last: Path | None = None


@contextmanager
def temporary_beside(target: Path, folder: bool = False) -> Iterator[Path]:
    """Give an empty file, or folder, of a name of its own beside `target`; when the block ends it is removed."""
    clean(target)
    lock = None
    while lock is None:
        path = target.with_name(f"{_prefix(target)}{secrets.token_hex(4)}{target.suffix}")
        _targets[path] = target  # before it is there: an interruption shall find it
        try:
            lock = _made(path, folder)
        finally:
            if lock is None:
                _forget(path)
    try:
        yield path
    finally:
        _forget(path)
        os.close(lock)


def place(temporary: Path, target: Path) -> None:
    """Let a temporary file or folder take the place of `target`, which is the old or the new one at any moment."""
    if not target.is_dir():
        os.replace(temporary, target)
    elif not _exchanged(temporary, target):
        earlier = _earlier(temporary)
        os.rename(target, earlier)
        os.rename(temporary, target)
    global _last
    if not any(one in target.parents for one in _targets):  # what is part of a larger one is no result yet
        _last = target


def clean(target: Path) -> None:
    """Remove what killed processes of this computer left beside a target; bring back what one of them had taken."""
    name = re.compile(f"{re.escape(_prefix(target))}[0-9a-f]{{8}}{re.escape(target.suffix)}({re.escape(EARLIER)})?")
    with suppress(OSError):  # what cannot be listed can mostly not be written to either, which is told there
        left = [target.with_name(one) for one in os.listdir(target.parent) if name.fullmatch(one)]
        for path in {path.with_name(path.name.removesuffix(EARLIER)) for path in left}:
            _clean_one(path, target)


def discard() -> None:
    """Remove what this process is writing; nothing is written afterwards."""
    for path in list(_targets):
        _forget(path)


def last_result() -> Path | None:
    """What this process put in place last."""
    return _last


def _prefix(target: Path) -> str:
    """How temporary names begin: with the target's, and the computer's as a number."""
    return f".{target.stem[:CLIPPED]}.{zlib.crc32(platform.node().encode()):08x}-"


def _earlier(temporary: Path) -> Path:
    return temporary.with_name(temporary.name + EARLIER)


def _made(path: Path, folder: bool) -> int | None:
    """Make a file or folder and lock it; the descriptor that holds the lock, None when another one took it for left."""
    if folder:
        path.mkdir()
    else:
        os.close(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666))
    try:
        lock = _locked(path)
    except OSError as error:
        if isinstance(error, (BlockingIOError, FileNotFoundError)):
            return None
        return os.open(os.devnull, os.O_RDONLY)  # no locks here
    if path.exists():
        return lock
    os.close(lock)
    return None


def _locked(path: Path) -> int:
    """Lock a file or folder; raises `OSError` when it is locked, gone, or nothing can be locked here."""
    if fcntl is None:
        raise OSError("no locks")
    descriptor = os.open(path, (os.O_RDONLY if path.is_dir() else os.O_RDWR) | os.O_NOFOLLOW)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(descriptor)
        raise
    return descriptor


def _clean_one(path: Path, target: Path) -> None:
    """Remove one temporary file or folder, unless it is being written."""
    try:
        lock = _locked(path)
    except FileNotFoundError:  # it was put in place, and only what was there before is left
        _settle(path, target)
    except OSError:
        return
    else:
        _settle(path, target)
        os.close(lock)


def _forget(path: Path) -> None:
    """Remove what this process was writing."""
    _settle(path, _targets[path])
    del _targets[path]


def _settle(path: Path, target: Path) -> None:
    """Remove a temporary file or folder, and what was there before the target; bring that back where it is alone."""
    earlier = _earlier(path)
    with suppress(OSError):
        if not target.exists():
            os.rename(earlier, target)
    for one in (path, earlier):
        if one.is_dir():
            shutil.rmtree(one, ignore_errors=True)
        else:
            with suppress(OSError):
                one.unlink()


def _exchanged(first: Path, second: Path) -> bool:
    """Let two folders change places at once; False where the system cannot."""
    import ctypes

    with suppress(AttributeError, OSError, TypeError):
        rename = ctypes.CDLL(None).renameat2
        return bool(rename(HERE, os.fsencode(first), HERE, os.fsencode(second), EXCHANGE) == 0)
    return False
