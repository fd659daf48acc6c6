"""Processes that end with the one that began them, and without a word; light, since every worker loads it."""

import os
import signal
import threading
import time

PERIOD = 0.5
"""How often one looks [s]."""


def end_with_parent() -> None:
    """Let this process end when the one that began it has ended, however it did, and at Ctrl-C without a word.

    Of a worker whose sender was killed nobody wants the result, and it waits for its next task for ever. Where
    processes keep the number of a parent that has ended (Windows), nothing is noticed.
    """
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    threading.Thread(target=_watch, args=(os.getppid(),), daemon=True).start()


def _watch(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(PERIOD)
    os._exit(1)
