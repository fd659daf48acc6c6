"""Numba's compiler with a cache that survives damage: what cannot be read, or is not what was written, is made anew.

Numba's own cache ends the program where a file in it was cut off, emptied or written over, where its folder cannot be
written to and where the disk is full. It would also run machine code that was damaged on the disk.
"""

import contextlib
import hashlib
import logging
import os
import pickle
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numba
from numba.core.caching import FunctionCache, IndexDataCacheFile
from numba.core.runtime import rtsys

from maniport.temporaries import temporary_beside

LOG = logging.getLogger("maniport.compiling")
DIGEST = 32
"""Bytes of SHA-256 before everything that is stored."""
SUFFIX = "-sums"
"""Of the names of files that begin with a digest; Numba's own have none."""

beside: Callable[[str], bool] | None = None
"""Asked with the name of each function that is missing in the cache: whether another process has compiled it now."""

_told = False


def njit(signature: Any = None, **options: Any) -> Callable[[Callable[..., Any]], Any]:
    """Compile a function as `numba.njit` does; with ``cache=True`` by a cache that survives damage.

    What C would call it by is left out, which nobody needs and which takes time to compile.
    """
    options.setdefault("no_cfunc_wrapper", True)
    if not options.pop("cache", False) or numba.config.DISABLE_JIT:
        return numba.njit(signature, **options)  # type: ignore[no-any-return]  # Numba is untyped

    def decorate(function: Callable[..., Any]) -> Any:
        kernel = numba.njit(**options)(function)
        try:
            kernel._cache = _SoundCache(function)
        except (OSError, RuntimeError) as error:  # no folder that can be written to
            _tell(error)
        if signature is not None:  # at once, and for nothing else
            for one in signature if isinstance(signature, list) else [signature]:
                kernel.compile(one)
            kernel.disable_compile()
        return kernel

    return decorate


def name_of(function: Callable[..., Any], arguments: Any) -> str:
    """Name a function for some types of arguments, the same in every process."""
    return f"{function.__module__}.{function.__qualname__}{tuple(arguments)}"


def is_missing(kernel: Any, arguments: Any) -> bool:
    """Whether a function could be kept in the cache for some types of arguments, and is not."""
    return isinstance(kernel._cache, _SoundCache) and not kernel._cache.holds(arguments, kernel.targetctx.codegen())


class _SoundCache(FunctionCache):  # type: ignore[misc]  # Numba is untyped
    """Numba's cache of one function; faults cost a compilation and a line."""

    def __init__(self, function: Callable[..., Any]):
        super().__init__(function)
        locator = self._impl.locator
        self._cache_file = _CheckedFiles(
            self._cache_path, self._impl.filename_base + SUFFIX, locator.get_source_stamp()
        )

    def holds(self, arguments: Any, codegen: Any) -> bool:
        """Whether the function is there for some types of arguments, as far as the index knows."""
        return self._index_key(arguments, codegen) in self._cache_file._load_index()

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        found = self._kept(sig, target_context)
        if found is None and beside is not None and beside(name_of(self._py_func, sig)):
            found = self._kept(sig, target_context)
        return found

    def _kept(self, sig: Any, target_context: Any) -> Any:
        try:
            rtsys.initialize(target_context)  # Numba would get all of its compiler ready, which takes 0.1 s
            return self._load_overload(sig, target_context)
        except Exception as error:  # noqa: BLE001 - whatever a file of another program makes Numba raise
            _tell(error)
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        try:
            super().save_overload(sig, data)
        except (OSError, ValueError) as error:  # full, or read-only: this run goes without
            _tell(error)


class _CheckedFiles(IndexDataCacheFile):  # type: ignore[misc]  # Numba is untyped
    """Files of one function's cache that begin with a digest of the rest."""

    def save(self, key: Any, data: Any) -> None:
        """Store an overload under a name of its own, so that processes that store two at once mix up nothing."""
        name = self._data_name(int(hashlib.sha256(pickle.dumps(key)).hexdigest()[:8], 16))
        self._save_data(name, data)
        self._save_index({**self._load_index(), key: name})

    def _load_index(self) -> dict[Any, str]:
        with contextlib.suppress(FileNotFoundError), _told_of_damage():
            version, stamp, overloads = pickle.loads(_read(self._index_path))
            if (version, stamp) == (self._version, self._source_stamp):
                return dict(overloads)
        return {}

    def _save_index(self, overloads: dict[Any, str]) -> None:
        self._write(self._index_path, self._dump((self._version, self._source_stamp, overloads)))

    def _load_data(self, name: str) -> Any:
        with _told_of_damage():
            return pickle.loads(_read(self._data_path(name)))
        return None

    def _save_data(self, name: str, data: Any) -> None:
        self._write(self._data_path(name), self._dump(data))

    def _write(self, path: str, stored: bytes) -> None:
        with temporary_beside(Path(path)) as temporary:
            temporary.write_bytes(hashlib.sha256(stored).digest() + stored)
            os.replace(temporary, path)


class _DamagedError(Exception):
    """A file in the cache is not what was written."""


@contextlib.contextmanager
def _told_of_damage() -> Iterator[None]:
    """Go on where a file is damaged, and say so once."""
    try:
        yield
    except (_DamagedError, IsADirectoryError, PermissionError) as error:
        _tell(error)


def _read(path: str) -> bytes:
    with open(path, "rb") as stream:
        content = stream.read()
    digest, stored = content[:DIGEST], content[DIGEST:]
    if hashlib.sha256(stored).digest() != digest:
        raise _DamagedError(f"{os.path.basename(path)} is damaged")
    return stored


def _tell(error: Exception) -> None:
    """Say once for a process why something is compiled anew."""
    global _told
    if not _told:
        _told = True
        LOG.warning("compiling anew, since the cache of compiled functions cannot be used: %s", error)
