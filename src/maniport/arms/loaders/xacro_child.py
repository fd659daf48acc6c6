"""Expand a xacro file as a script, in a process with limits of time and memory.

Arguments are the file, the largest size of it and of each included file [bytes], and the memory limit [bytes]. The
standard output is the URDF, or an error message with exit code 1.
"""

import importlib
import os
import stat
import sys
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from typing import Any


def expanded(path: str, most: int) -> str:
    """Expand a file to a URDF."""
    xacro: Any = importlib.import_module("xacro")

    def regular(name: str, *args: Any, **options: Any) -> Any:
        """Open a regular file of limited size."""
        status = os.stat(name)
        if not stat.S_ISREG(status.st_mode):
            raise ValueError(f"{name}: this is a pipe, a socket or a device")
        if status.st_size > most:
            raise ValueError(f"{name}: has {status.st_size} bytes; at most {most} are read")
        return open(name, *args, **options)

    xacro.open = regular
    importlib.import_module("xacrodoc.packages").walk_up_from(path)
    return str(xacro.process_file(path).toxml())


def main() -> int:
    """Write the URDF or the error message."""
    path, most, memory = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
    try:
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    except (ImportError, ValueError, OSError):  # not on Windows and macOS
        pass
    failed = 0
    with redirect_stderr(StringIO()), redirect_stdout(StringIO()):  # deprecation warnings of xacro
        try:
            text = expanded(path, most)
        except Exception as error:  # noqa: BLE001 - xacro files evaluate Python
            text, failed = str(error) or type(error).__name__, 1
    sys.stdout.buffer.write(text.encode(errors="replace"))
    return failed


if __name__ == "__main__":
    sys.exit(main())
