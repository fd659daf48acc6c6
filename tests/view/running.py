"""The loop of a page, in a thread."""

import contextlib
import threading


@contextlib.contextmanager
def running(view):
    """Run the loop of a view meanwhile."""
    stop = threading.Event()
    loop = threading.Thread(target=view.run, args=(stop,))
    loop.start()
    try:
        yield
    finally:
        stop.set()
        loop.join(60.0)
    assert not loop.is_alive()
