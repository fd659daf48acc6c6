"""Signals: Ctrl-C in commands that run until they are stopped, and workers that end with their parent process."""

import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any


@contextmanager
def ending_in_order(end: Callable[[], Any]) -> Iterator[None]:
    """Call `end` at the first Ctrl-C or termination signal; a second one ends at once. In the main thread only."""
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


def interrupt() -> None:
    """Raise `KeyboardInterrupt`."""
    raise KeyboardInterrupt


def end_with_parent(parent: int) -> None:
    """End this process without a message soon after its parent has ended, and at Ctrl-C."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)

    def watch(period: float = 0.5) -> None:
        while os.getppid() == parent:
            time.sleep(period)
        os._exit(1)

    if os.name == "posix":
        threading.Thread(target=watch, daemon=True).start()
