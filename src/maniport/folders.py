"""A folder of results that is written whole or not at all."""

import os
import secrets
import shutil
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path

from maniport.errors import OutputError


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
