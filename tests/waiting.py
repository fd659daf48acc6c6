"""Wait in tests."""

import time


def wait(condition, seconds=60.0):
    """Wait until a condition holds."""
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "it does not hold"
        time.sleep(5e-3)
