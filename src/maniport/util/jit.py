"""Compile functions with Numba and keep the machine code in Numba's cache.

Two faults of that cache are cured here. It raises an error where one of its files is damaged or cannot be written, and
it keeps code compiled from an older version of a function that is called from another file.
"""

import hashlib
import inspect
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numba
from numba.core import event
from numba.core.caching import FunctionCache

from maniport.util.compiling import announce

if TYPE_CHECKING:
    from numba.core.compiler import CompileResult
    from numba.core.cpu import CPUContext
    from numba.core.types import Type

OPTIONS = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}


def kernel(function: Callable[..., object] | None = None, *, fastmath: bool = False) -> Any:
    """Compile a function on its first call with other types of arguments, or load it from the cache."""
    if function is None:
        return partial(kernel, fastmath=fastmath)
    compiled = numba.njit(fastmath=fastmath, **OPTIONS)(function)
    if not numba.config.DISABLE_JIT:
        with suppress(OSError, RuntimeError):  # no folder is writable: without a cache
            compiled._cache = _Cache(function)
    return compiled


def part(function: Callable[..., object] | None = None, *, fastmath: bool = False) -> Any:
    """Compile a function that only kernels call."""
    if function is None:
        return partial(part, fastmath=fastmath)
    return numba.njit(fastmath=fastmath, no_cpython_wrapper=True, **OPTIONS)(function)


class _Announcer(event.Listener):
    """Announces that Numba compiles a function, with those that it calls."""

    _depth = 0  # Numba compiles one function at a time, and within it those that it calls

    def on_start(self, event: event.Event) -> None:
        self._depth += 1
        if self._depth == 1:
            announce(True)

    def on_end(self, event: event.Event) -> None:
        self._depth -= 1
        if self._depth == 0:
            announce(False)


event.register("numba:compile", _Announcer())


class _Cache(FunctionCache):
    """Numba's cache of one function; where a file cannot be used, the function is compiled again."""

    def load_overload(
        self, sig: "tuple[Type, ...]", target_context: "CPUContext"
    ) -> "CompileResult | None":
        try:
            # Numba's own stamp covers one file; here all called functions are known, which they are not earlier
            self._cache_file._source_stamp = _digest(self._py_func)
            overload = super().load_overload(sig, target_context)
        except Exception:  # noqa: BLE001  # what a damaged file makes pickle raise
            self._ignoring_errors(self.flush)
            return None
        # two processes that store code for different arguments at once may choose the same file
        if overload is None or overload.signature.args == sig:
            return overload
        return None

    def save_overload(self, sig: "tuple[Type, ...]", data: "CompileResult") -> None:
        self._ignoring_errors(super().save_overload, sig, data)

    def _ignoring_errors(self, action: Callable[..., None], *arguments: object) -> None:
        try:
            action(*arguments)
        except OSError:  # read-only or full
            self.disable()


def _digest(function: Callable[..., object]) -> str:
    """Digest of the files of a function and of the compiled functions that it calls."""
    files = set[str]()
    waiting = [function]
    while waiting:
        function = waiting.pop()
        files.add(inspect.getfile(function))
        for name in function.__code__.co_names:
            called = getattr(function.__globals__.get(name), "py_func", None)
            if called not in (None, function):
                waiting.append(called)
    return hashlib.sha256(b"".join(Path(file).read_bytes() for file in sorted(files))).hexdigest()
