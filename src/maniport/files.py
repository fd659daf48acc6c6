"""Writing files and folders so that a reader never finds half of one, and the file that holds ellipsoids."""

import os
import secrets
import shutil
import struct
import zipfile
import zlib
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from maniport.errors import FileFormatError, OutputError, nearest_first
from maniport.validation import Array, as_finite, as_positive_semidefinite, require_shape

UNREADABLE = (
    OSError, ValueError, EOFError, AttributeError, TypeError, KeyError, RuntimeError, MemoryError,
    struct.error, zipfile.BadZipFile, zlib.error,
)  # fmt: skip
"""What NumPy and zipfile raise on files that are damaged or something else."""


@contextmanager
def written_whole(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Give a temporary path beside `path`; when the block ends well it takes the place of `path`, else it is removed.

    Raises
    ------
    OutputError
        When the folder does not exist or cannot be written.
    """
    target = Path(path)
    if not target.parent.is_dir():
        raise OutputError(f"cannot write {str(target)!r}: there is no folder {str(target.parent)!r}")
    if target.is_dir():
        raise OutputError(f"cannot write {str(target)!r}: it is a folder")
    temporary = target.with_name(f".{target.stem}.{secrets.token_hex(4)}{target.suffix}")
    try:
        yield temporary
        os.replace(temporary, target)
    except OSError as error:
        raise OutputError(f"cannot write {str(target)!r}: {error.strerror or error}") from None
    finally:
        temporary.unlink(missing_ok=True)


def existing_file(path: str | os.PathLike[str], suffixes: Collection[str], hint: str = "") -> Path:
    """Check what can be checked of a file before it is read.

    Parameters
    ----------
    path : str or path
        Where it shall be.
    suffixes : collection of str
        Those that can be read, lower case.
    hint : str
        What else there is or helps, said when the file is missing or of another suffix.

    Raises
    ------
    FileFormatError
        When it is missing, a folder, unreadable, empty or of another suffix; the message lists what would do.
    """
    file = Path(path)
    if not file.exists():
        raise FileFormatError(f"{file}: there is no such file{_similar(file, suffixes)}{hint}")
    if file.is_dir():
        raise FileFormatError(f"{file}: this is a folder; give a file with suffix {', '.join(suffixes)}")
    if file.suffix.lower() not in suffixes:
        raise FileFormatError(f"{file}: suffix {file.suffix!r} is not known; allowed are {', '.join(suffixes)}{hint}")
    try:
        with open(file, "rb") as stream:
            first = stream.read(1)
    except OSError as error:
        raise FileFormatError(f"{file}: cannot be read: {error.strerror}") from None
    if not first:
        raise FileFormatError(f"{file}: the file is empty")
    return file


def _similar(file: Path, suffixes: Collection[str]) -> str:
    """Name the files that lie where the missing one was looked for."""
    if not file.parent.is_dir():
        return f", nor a folder {str(file.parent)!r}"
    others = [other.name for other in file.parent.iterdir() if other.suffix.lower() in suffixes]
    return f"; there are {', '.join(map(repr, nearest_first(file.name, others)[:5]))}" if others else ""


def save_arrays(path: str | os.PathLike[str], arrays: dict[str, Any]) -> None:
    """Write named arrays to a compressed ``.npz`` file, whole or not at all."""
    with written_whole(path) as temporary, open(temporary, "wb") as stream:
        np.savez_compressed(stream, **arrays)


def load_arrays(path: str | os.PathLike[str], what: str) -> dict[str, Any]:
    """Read all arrays of an ``.npz`` file; `what` names the content for the error messages.

    Raises
    ------
    FileFormatError
        When the file does not exist, is no ``.npz`` file, is truncated, or holds Python objects.
    """
    if not Path(path).is_file():
        raise FileFormatError(f"{what} {str(path)!r}: there is no such file")
    try:
        with open(path, "rb") as stream, np.lib.npyio.NpzFile(stream, allow_pickle=False) as archive:
            return {key: archive[key] for key in archive.files}
    except UNREADABLE as error:
        raise FileFormatError(f"{what} {str(path)!r} is not a readable .npz file: {error}") from None


def save_ellipsoids(path: str | os.PathLike[str], manipulability: ArrayLike, time: ArrayLike | None = None) -> None:
    """Write ellipsoids (n, d, d), and their times (n,) in seconds where there are any, to an ``.npz`` file."""
    points = as_finite(manipulability, "manipulability")
    require_shape(points, "manipulability", ("n", "d", "d"), " with n ≥ 1")
    arrays = {"manipulability": as_positive_semidefinite(points, "manipulability")}
    if time is not None:
        arrays["time"] = as_finite(time, "time")
        require_shape(arrays["time"], "time", (len(points),))
    save_arrays(path, arrays)


def load_ellipsoids(path: str | os.PathLike[str]) -> tuple[Array, Array | None]:
    """Read ellipsoids (n, d, d) and, where the file has them, their times (n,) in seconds.

    Raises
    ------
    FileFormatError
        When the file cannot be read or has no array ``manipulability`` of that shape.
    NotSPDError
        When an ellipsoid is asymmetric or has a negative eigenvalue.
    """
    arrays = load_arrays(path, "ellipsoid file")
    if "manipulability" not in arrays:
        raise FileFormatError(
            f"ellipsoid file {str(path)!r} has no array 'manipulability'; it holds {sorted(arrays) or 'nothing'}"
        )
    points = arrays["manipulability"]
    if points.ndim != 3 or not len(points):
        raise FileFormatError(
            f"ellipsoid file {str(path)!r}: 'manipulability' must have shape (n, d, d) with n ≥ 1; found {points.shape}"
        )
    ellipsoids = as_positive_semidefinite(points, f"manipulability in {str(path)!r}")
    if "time" not in arrays:
        return ellipsoids, None
    time = as_finite(arrays["time"], f"time in {str(path)!r}")
    if time.shape != (len(points),):
        raise FileFormatError(
            f"ellipsoid file {str(path)!r}: {len(points)} ellipsoids, but 'time' has shape {time.shape}"
        )
    return ellipsoids, time


def save_path(path: str | os.PathLike[str], positions: ArrayLike, time: ArrayLike | None = None) -> None:
    """Write positions (n, 3) [m], and their times (n,) in seconds where there are any, to an ``.npz`` file."""
    arrays = {"path": as_finite(positions, "path")}
    require_shape(arrays["path"], "path", ("n", 3))
    if time is not None:
        arrays["time"] = as_finite(time, "time")
    save_arrays(path, arrays)


def load_path(path: str | os.PathLike[str]) -> tuple[Array, Array | None]:
    """Read positions (n, 3) [m] and, where the file has them, their times (n,) in seconds.

    Raises
    ------
    FileFormatError
        When the file cannot be read or has no array ``path`` of that shape.
    """
    arrays = load_arrays(path, "path file")
    if "path" not in arrays:
        raise FileFormatError(f"path file {str(path)!r} has no array 'path'; it holds {sorted(arrays) or 'nothing'}")
    positions = as_finite(arrays["path"], f"path in {str(path)!r}")
    if positions.ndim != 2 or positions.shape[1] != 3:
        raise FileFormatError(f"path file {str(path)!r}: 'path' must have shape (n, 3); found {positions.shape}")
    time = as_finite(arrays["time"], f"time in {str(path)!r}") if "time" in arrays else None
    return positions, time


@contextmanager
def folder_written_whole(folder: str | os.PathLike[str], own: Collection[str]) -> Iterator[Path]:
    """Give a temporary folder; when the block ends well it takes the place of `folder`, else it is removed.

    Parameters
    ----------
    folder : str or path-like
        Made; one that holds nothing but files of the names `own` is replaced.
    own : collection of str
        Names of the files that may be written.

    Raises
    ------
    OutputError
        When the folder holds other things, or cannot be written.
    """
    target = Path(folder)
    require_free(target, own)
    target = target.resolve()
    staging = target.with_name(f".{target.name}.{secrets.token_hex(4)}")
    earlier = staging.with_name(f"{staging.name}.earlier")
    try:
        staging.mkdir()
        yield staging
        if target.exists():
            target.rename(earlier)
        staging.rename(target)
    except OSError as error:
        raise OutputError(f"cannot write {str(folder)!r}: {error.strerror or error}") from None
    finally:
        if earlier.exists() and not target.exists():
            earlier.rename(target)  # stopped between the two renames: the earlier result comes back
        shutil.rmtree(earlier, ignore_errors=True)
        shutil.rmtree(staging, ignore_errors=True)


def require_free(folder: Path, own: Collection[str]) -> None:
    """Raise `OutputError` unless results may be written to `folder`; called before any long work starts."""
    if not folder.resolve().parent.is_dir():
        raise OutputError(f"cannot write {str(folder)!r}: there is no folder {str(folder.resolve().parent)!r}")
    if folder.exists() and not folder.is_dir():
        raise OutputError(f"cannot write {str(folder)!r}: it is a file")
    if folder.is_dir():
        others = sorted(entry.name for entry in folder.iterdir() if entry.name not in own)
        if others:
            shown = ", ".join(map(repr, others[:5])) + (f" and {len(others) - 5} more" if len(others) > 5 else "")
            raise OutputError(f"{str(folder)!r} holds other things ({shown}); give a new folder with -o")
    if not os.access(folder if folder.exists() else folder.resolve().parent, os.W_OK):
        raise OutputError(f"cannot write {str(folder)!r}: permission denied")
