"""Expand a xacro file: run as a script, so that a file which never ends, or takes all memory, ends with its process.

Arguments are the file, how many bytes it and each file that it includes may have, and the memory that all of it may
take. The URDF goes to the standard output; where there is none the reason does, and the process ends with 1.
"""

import importlib
import os
import stat
import sys
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from typing import Any


def expanded(path: str, most: int) -> str:
    """The URDF that a file stands for."""
    xacro: Any = importlib.import_module("xacro")

    def regular(name: str, *args: Any, **options: Any) -> Any:
        """Open a file that has an end."""
        found = os.stat(name)
        if not stat.S_ISREG(found.st_mode):
            raise ValueError(f"{name}: this is a pipe, a socket or a device")
        if found.st_size > most:
            raise ValueError(f"{name}: has {found.st_size} bytes; at most {most} are read")
        return open(name, *args, **options)

    xacro.open = regular
    importlib.import_module("xacrodoc.packages").walk_up_from(path)
    return str(xacro.process_file(path).toxml())


def main() -> int:
    """Write the URDF, or why there is none."""
    path, most, memory = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
    try:
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    except (ImportError, ValueError, OSError):  # Windows has none, macOS takes none
        pass
    failed = 0
    with redirect_stderr(StringIO()), redirect_stdout(StringIO()):  # where xacro says what it finds old-fashioned
        try:
            text = expanded(path, most)
        except Exception as error:  # noqa: BLE001 - a file evaluates what it likes, which fails in many ways
            text, failed = str(error) or type(error).__name__, 1
    sys.stdout.buffer.write(text.encode(errors="replace"))
    return failed


if __name__ == "__main__":
    sys.exit(main())
