"""Xacro: URDF with macros, which the package xacrodoc writes out."""

import re
import subprocess
import sys
from contextlib import AbstractContextManager, redirect_stderr
from io import StringIO
from pathlib import Path
from typing import Any

from maniport.bodies.readers import xacro_child
from maniport.errors import FileFormatError
from maniport.input_limits import MEGABYTE, ROBOT_BYTES
from maniport.optional import xacrodoc

LONGEST = 30.0
"""Macros that are expanded for longer than this never end [s]."""
MEMORY = 2048 * MEGABYTE
"""Of the process that expands them."""

_MISSING = re.compile(r"Package not found: (\S+)")


def silent() -> AbstractContextManager[Any]:
    """Keep back what xacro writes on standard error, once for every reading: what it finds old-fashioned."""
    return redirect_stderr(StringIO())


def expanded(path: Path) -> str:
    """The URDF that a xacro file stands for, with the defaults of its arguments."""
    xacrodoc()
    child = [sys.executable, "-P", xacro_child.__file__, str(path), str(ROBOT_BYTES), str(MEMORY)]
    try:
        done = subprocess.run(child, stdin=subprocess.DEVNULL, capture_output=True, timeout=LONGEST, check=False)
    except subprocess.TimeoutExpired:
        raise FileFormatError(f"{path}: xacro cannot expand it: it takes more than {LONGEST:g} s") from None
    text = done.stdout.decode(errors="replace")
    if done.returncode != 0:
        reason = " ".join(text.split()) or f"it ended with {done.returncode}"
        if (package := _MISSING.search(reason)) is not None:
            reason = (
                f"there is no package {package[1]!r} above its folder or in ROS_PACKAGE_PATH; --mesh-folder on the "
                "command line adds a folder of packages"
            )
        raise FileFormatError(f"{path}: xacro cannot expand it: {reason}")
    if len(text) > ROBOT_BYTES:
        raise FileFormatError(f"{path}: is {len(text) / MEGABYTE:.4g} MB when expanded; too large")
    return text
