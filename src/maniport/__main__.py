"""Entry point of the command line: handles Ctrl-C before large imports, and closed or full outputs."""

import os
import signal
import sys
from contextlib import suppress
from typing import Any

ONE_THREAD = "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"
"""Environment variables that NumPy reads when it is loaded. One thread suits small matrices: the demo takes 17 s of
processor time instead of 46 s with two, and sums are rounded equally on any number of processors."""


class _Output:
    """Standard output or error that may be closed or full: drops text that cannot be written."""

    def __init__(self, stream: Any):
        self._stream = stream
        self.fault: OSError | None = None

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        self._attempt(self._stream.write, text)
        return len(text)

    def flush(self) -> None:
        self._attempt(self._stream.flush)

    def _attempt(self, act: Any, *arguments: Any) -> None:
        if self.fault is not None:
            return
        try:
            act(*arguments)
        except OSError as error:
            self.fault = error
            nowhere = os.open(
                os.devnull, os.O_WRONLY
            )  # the rest of the buffer goes there when Python ends
            os.dup2(nowhere, self._stream.fileno())
            os.close(nowhere)


def main() -> None:
    """Run the command line in this process."""
    signal.signal(signal.SIGINT, _interrupt)
    _occupy_closed_descriptors()
    sys.stdout, sys.stderr = outputs = [
        _Output(
            os.fdopen(number, "w", encoding="utf-8", closefd=False) if stream is None else stream
        )
        for number, stream in ((1, sys.stdout), (2, sys.stderr))
    ]
    for name in ONE_THREAD:
        os.environ.setdefault(name, "1")
    from maniport.cli import main as run

    try:
        run()
    finally:
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # results are written, or nothing is
        for output in outputs:
            output.flush()
        fault = outputs[0].fault
        if fault is not None and not isinstance(fault, BrokenPipeError):
            print(f"maniport: cannot print the result: {fault.strerror}", file=sys.stderr)
            sys.exit(1)


def _occupy_closed_descriptors() -> None:
    """Open the null device for each standard stream that is closed (``>&-``), so that no other file gets its number."""
    while (descriptor := os.open(os.devnull, os.O_RDONLY)) <= 2:
        os.set_inheritable(descriptor, True)
    os.close(descriptor)


def _interrupt(signum: int, frame: Any) -> None:
    """Exit with code 130 and no partial result; an exception could be lost in an import or compiled code."""
    atomic_io: Any = sys.modules.get("maniport.util.atomic_io")
    written = "nothing was written"
    if hasattr(atomic_io, "discard"):  # is loaded
        atomic_io.discard()
        written = atomic_io.written()
    cursor = b"\r\x1b[2K\x1b[?25h" if os.isatty(2) else b""  # a progress bar hides it
    with suppress(OSError):
        os.write(2, cursor + f"maniport: interrupted; {written}\n".encode(errors="replace"))
    os._exit(130)


if __name__ == "__main__":
    main()
