"""Processes that end with the one that began them, and without a word; light, since every worker loads it."""

import os
import signal
import threading
import time

PERIOD = 0.5
"""How often one looks [s]."""


def end_with_parent(parent: int) -> None:
    """Let this process end when the one that began it has ended, however it did, and at Ctrl-C without a word."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    if os.name == "posix":
        threading.Thread(target=_watch, args=(parent,), daemon=True).start()


def _watch(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(PERIOD)
    os._exit(1)
