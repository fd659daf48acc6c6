"""Ctrl-C for what goes on until somebody ends it."""

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any


@contextmanager
def ending_in_order(end: Callable[[], Any]) -> Iterator[None]:
    """Let Ctrl-C, or a termination signal, call `end` once, and a second one end at once; only in the main thread."""
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}

    def restore() -> None:
        for number, handler in before.items():
            signal.signal(number, handler)

    def ended(number: int, frame: Any) -> None:
        restore()
        end()

    for number in before:
        signal.signal(number, ended)
    try:
        yield
    finally:
        restore()


@contextmanager
def raising() -> Iterator[None]:
    """Let the first Ctrl-C raise `KeyboardInterrupt`; a second one does what it did before. In the main thread only."""
    before = signal.getsignal(signal.SIGINT)

    def interrupt(number: int, frame: Any) -> None:
        signal.signal(signal.SIGINT, before)
        raise KeyboardInterrupt

    signal.signal(signal.SIGINT, interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
