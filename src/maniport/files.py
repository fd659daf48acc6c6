"""Writing files and folders so that a reader never finds half of one, and the file that holds ellipsoids."""

import math
import os
import zipfile
from collections.abc import Collection, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import ArrayLike

from maniport.bounds import ARRAYS_BYTES, MEGABYTE, as_path, existing_file
from maniport.errors import FileFormatError, OutputError
from maniport.temporaries import place, temporary_beside
from maniport.validation import Array, as_finite, as_positive_semidefinite, as_times, require_shape
from maniport.wording import argument


@contextmanager
def written_whole(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Give a temporary path next to `path`; when the block ends well it takes the place of `path`."""
    file = as_path(path)
    with _output_errors(file):
        target = _writable_target(file)
        with temporary_beside(target) as temporary:
            yield temporary
            place(temporary, target)


def require_room(path: str | os.PathLike[str], folder: bool = False) -> None:
    """Raise `OutputError` unless a file or folder can be written at `path`; called before any long work starts."""
    file = as_path(path)
    with _output_errors(file), temporary_beside(_writable_target(file, folder), folder):
        pass


@contextmanager
def _output_errors(target: Path) -> Iterator[None]:
    """Raise the operating system's errors as `OutputError` with the name of the target."""
    try:
        yield
    except OutputError:
        raise
    except OSError as error:
        raise OutputError(f"cannot write {str(target)!r}: {error.strerror or error}") from None


def _writable_target(path: Path, folder: bool = False) -> Path:
    """Follow symbolic links; raise `OutputError` or `OSError` where nothing can be written. Writes nothing."""
    target = Path(os.path.realpath(path))
    if not target.name:
        raise OutputError(f"cannot write {str(path)!r}: it is the root of the file system")
    if not target.parent.is_dir():
        raise OutputError(f"cannot write {str(path)!r}: there is no folder {str(target.parent)!r}")
    with suppress(FileNotFoundError):
        os.stat(target)  # a name may be too long, links may form a loop
    if target.is_dir() and not folder:
        raise OutputError(f"cannot write {str(path)!r}: it is a folder")
    if target.exists() and not (target.is_dir() or target.is_file()):
        raise OutputError(f"cannot write {str(path)!r}: it is a pipe, a socket or a device")
    return target


def save_arrays(path: str | os.PathLike[str], arrays: dict[str, Any]) -> None:
    """Write named arrays to a compressed ``.npz`` file, whole or not at all."""
    with written_whole(path) as temporary, open(temporary, "wb") as stream:
        np.savez_compressed(stream, **arrays)


def load_arrays(path: str | os.PathLike[str], what: str, names: Collection[str] | None = None) -> dict[str, Any]:
    """Read arrays of an ``.npz`` file."""
    with _archive(path, what) as archive:
        chosen = {name: info for name, info in _members(archive).items() if names is None or name in names}
        unpacked = sum(info.file_size for info in chosen.values())
        if unpacked > ARRAYS_BYTES:
            raise FileFormatError(
                f"{what} {str(path)!r}: its arrays have {unpacked / MEGABYTE:.4g} MB; at most "
                f"{ARRAYS_BYTES / MEGABYTE:.4g} MB are read"
            )
        return {name: _array(archive, info) for name, info in chosen.items()}


def array_names(path: str | os.PathLike[str], what: str) -> list[str]:
    """Names of the arrays in an ``.npz`` file; raises as `load_arrays` does."""
    with _archive(path, what) as archive:
        return sorted(_members(archive))


@contextmanager
def _archive(path: str | os.PathLike[str], what: str) -> Iterator[zipfile.ZipFile]:
    """Open an ``.npz`` file; every error of zipfile and NumPy becomes a `FileFormatError`."""
    file = existing_file(path, (), ARRAYS_BYTES)
    try:
        with zipfile.ZipFile(file) as archive:
            yield archive
    except FileFormatError:
        raise
    except Exception as error:  # noqa: BLE001 - decompressors and NumPy raise errors of a dozen types on damaged files
        raise FileFormatError(f"{what} {str(path)!r} is not a readable .npz file: {error}") from None


def _members(archive: zipfile.ZipFile) -> dict[str, zipfile.ZipInfo]:
    """Members by the names of their arrays; a name with the ending ``.npy`` precedes one without."""
    infos = sorted(archive.infolist(), key=lambda info: info.filename.endswith(".npy"))
    return {info.filename.removesuffix(".npy"): info for info in infos}


def _array(archive: zipfile.ZipFile, info: zipfile.ZipInfo) -> Any:
    """Read one array of an archive."""
    try:
        with archive.open(info) as stream:
            return read_npy(stream, info.file_size)
    except Exception as error:  # noqa: BLE001 - errors of any type, as in `_archive`
        raise ValueError(f"the array {info.filename.removesuffix('.npy')!r}: {error}") from None


def read_npy(stream: IO[bytes], size: int) -> Any:
    """Read an array from a stream of `size` bytes in NumPy's format; may raise errors of any type."""
    version = np.lib.format.read_magic(stream)
    read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    shape, _, dtype = read(stream)
    if math.prod(shape) * max(dtype.itemsize, 1) > size:
        raise ValueError(f"its header declares the shape {shape} of {dtype}, more than there is")
    stream.seek(0)
    array = np.lib.format.read_array(stream, allow_pickle=False)
    if array.dtype.kind in "UV":
        array.tolist()  # raises an error where characters are no Unicode, which is not checked in reading
    return array


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
    """Read ellipsoids (n, d, d) and, where the file has them, their times (n,) in seconds."""
    arrays = _with_array(path, "ellipsoid file", "manipulability")
    points = arrays["manipulability"]
    if points.ndim != 3 or not len(points):
        raise FileFormatError(
            f"ellipsoid file {str(path)!r}: 'manipulability' must have shape (n, d, d) with n ≥ 1; found {points.shape}"
        )
    ellipsoids = as_positive_semidefinite(points, f"manipulability in {str(path)!r}")
    if "time" not in arrays:
        return ellipsoids, None
    time = as_times(arrays["time"], f"time in {str(path)!r}")
    if len(time) != len(points):
        raise FileFormatError(
            f"ellipsoid file {str(path)!r}: {len(points)} ellipsoids, but 'time' has shape {time.shape}"
        )
    return ellipsoids, time


def _with_array(path: str | os.PathLike[str], what: str, name: str) -> dict[str, Any]:
    """The array of that name, and its times where there are any."""
    arrays = load_arrays(path, what, (name, "time"))
    if name not in arrays:
        raise FileFormatError(
            f"{what} {str(path)!r} has no array {name!r}; it holds {array_names(path, what) or 'nothing'}"
        )
    return arrays


def save_path(path: str | os.PathLike[str], positions: ArrayLike, time: ArrayLike | None = None) -> None:
    """Write positions (n, 3) [m], and their times (n,) in seconds where there are any, to an ``.npz`` file."""
    arrays = {"path": as_finite(positions, "path")}
    require_shape(arrays["path"], "path", ("n", 3))
    if time is not None:
        arrays["time"] = as_finite(time, "time")
    save_arrays(path, arrays)


def load_path(path: str | os.PathLike[str]) -> tuple[Array, Array | None]:
    """Read positions (n, 3) [m] and, where the file has them, their times (n,) in seconds."""
    arrays = _with_array(path, "path file", "path")
    positions = as_finite(arrays["path"], f"path in {str(path)!r}")
    if positions.ndim != 2 or positions.shape[1] != 3:
        raise FileFormatError(f"path file {str(path)!r}: 'path' must have shape (n, 3); found {positions.shape}")
    time = as_times(arrays["time"], f"time in {str(path)!r}", len(positions)) if "time" in arrays else None
    return positions, time


@contextmanager
def folder_written_whole(
    folder: str | os.PathLike[str], own: Collection[str], overwrite: bool = False
) -> Iterator[Path]:
    """Give a temporary folder; when the block ends well it takes the place of `folder`, else it is removed."""
    path = as_path(folder, "folder")
    with _output_errors(path):
        target = _writable_target(path, folder=True)
        _require_own(path, own, overwrite)
        with temporary_beside(target, folder=True) as staging:
            yield staging
            _require_own(path, own, overwrite)  # files that others wrote there in the meantime stay as well
            place(staging, target)


def require_free(folder: Path, own: Collection[str], overwrite: bool = False) -> None:
    """Raise `OutputError` unless results may be written to `folder`; called before any long work starts."""
    require_room(folder, folder=True)
    _require_own(folder, own, overwrite)


def _require_own(folder: Path, own: Collection[str], overwrite: bool) -> None:
    """Raise `OutputError` where something is at `folder` that is not to be replaced."""
    if folder.exists() and not folder.is_dir():
        raise OutputError(f"cannot write {str(folder)!r}: it is a file")
    if folder.is_dir():
        held = sorted(entry.name for entry in folder.iterdir())
        if others := [name for name in held if name not in own]:
            raise OutputError(f"{str(folder)!r} holds other things ({_some(others)}); give a new folder with -o")
        if held and not overwrite:
            raise OutputError(
                f"{str(folder)!r} holds an earlier result ({_some(held)}); give {argument('overwrite')} to replace it, "
                "or a new folder"
            )
    if folder.exists() and not os.access(folder, os.W_OK):
        raise OutputError(f"cannot write {str(folder)!r}: permission denied")


def _some(names: list[str]) -> str:
    """The first of them, and how many more there are."""
    return ", ".join(map(repr, names[:5])) + (f" and {len(names) - 5} more" if len(names) > 5 else "")
