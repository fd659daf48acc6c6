"""Processes that end with the one that began them, and without a word; light, since every worker loads it."""

import os
import signal
import threading
import time

PERIOD = 0.5
"""How often one looks [s]."""


def end_with_parent(parent: int) -> None:
    """Let this process end when the one that began it has ended, however it did, and at Ctrl-C without a word.

    `parent` is its number, which it says itself: it may have ended before this process could ask.

    Of a worker whose sender was killed nobody wants the result, and it waits for its next task for ever. Where
    processes keep the number of a parent that has ended, or of a launcher (Windows), nothing is noticed.
    """
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    if os.name == "posix":
        threading.Thread(target=_watch, args=(parent,), daemon=True).start()


def _watch(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(PERIOD)
    os._exit(1)
