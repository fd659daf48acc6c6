"""Tell who displays progress that functions are compiled; light, since commands start without Numba."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

Watcher = Callable[[bool], None]
"""Called with True when compiling begins and with False when it ends."""

_watchers: list[Watcher] = []


@contextmanager
def watched(watcher: Watcher) -> Iterator[None]:
    """Call a watcher of the compiling that happens in the context."""
    _watchers.append(watcher)
    try:
        yield
    finally:
        _watchers.remove(watcher)


def announce(compiling: bool) -> None:
    """Tell all watchers that compiling begins or ends."""
    for watcher in tuple(_watchers):
        watcher(compiling)
