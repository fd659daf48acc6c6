"""Where the command begins: ready for Ctrl-C before anything large is loaded, and for outputs that nobody reads on."""

import os
import signal
import sys
from contextlib import suppress
from typing import Any

ONE_THREAD = "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"
"""Read when NumPy is loaded. Threads of BLAS wait for one another, matrices are small: the demo takes 46 s of processor
time with two of them and 17 s with one, and sums are rounded alike however many processors there are."""


class _Output:
    """Standard output or error that may be closed or full: what cannot be written is dropped, and the work goes on."""

    def __init__(self, stream: Any):
        self._stream = stream
        self.fault: OSError | None = None

    def write(self, text: str) -> int:
        """Write, or drop it."""
        self._attempt(self._stream.write, text)
        return len(text)

    def flush(self) -> None:
        """Hand on what is written, or drop it."""
        self._attempt(self._stream.flush)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def _attempt(self, act: Any, *arguments: Any) -> None:
        if self.fault is not None:
            return
        try:
            act(*arguments)
        except OSError as error:
            self.fault = error
            nowhere = os.open(os.devnull, os.O_WRONLY)  # what is left in the buffer goes there when Python ends
            os.dup2(nowhere, self._stream.fileno())
            os.close(nowhere)


def main() -> None:
    """Run the command line in this process."""
    signal.signal(signal.SIGINT, _end)
    _occupy_closed_descriptors()
    outputs = tuple(
        _Output(os.fdopen(number, "w", encoding="utf-8", closefd=False) if stream is None else stream)
        for number, stream in ((1, sys.stdout), (2, sys.stderr))
    )
    sys.stdout, sys.stderr = outputs
    for name in ONE_THREAD:
        os.environ.setdefault(name, "1")
    from maniport.cli import main as run

    try:
        run()
    finally:
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # it is over: results are written, or nothing is
        for one in outputs:
            one.flush()
        fault = outputs[0].fault
        if fault is not None and not isinstance(fault, BrokenPipeError):
            print(f"maniport: cannot print the result: {fault.strerror}", file=sys.stderr)
            sys.exit(1)


def _occupy_closed_descriptors() -> None:
    """Open the null device for each standard stream that is closed (``>&-``), so that no other file gets its number."""
    while (descriptor := os.open(os.devnull, os.O_RDONLY)) <= 2:
        os.set_inheritable(descriptor, True)
    os.close(descriptor)


def _end(signum: int, frame: Any) -> None:
    """End at once, with nothing half written: an exception would be lost in an import or compiled code."""
    done = None
    atomic_io: Any = sys.modules.get("maniport.util.atomic_io")
    if hasattr(atomic_io, "last_result"):  # loaded; before that, nothing was written
        atomic_io.discard()
        done = atomic_io.last_result()
    text = "interrupted; nothing was written" if done is None else f"interrupted; {str(done)!r} was written before"
    cursor = "\r\x1b[2K\x1b[?25h" if os.isatty(2) else ""  # a bar hides it
    with suppress(OSError):
        os.write(2, f"{cursor}maniport: {text}\n".encode())
    os._exit(130)


if __name__ == "__main__":
    main()
