"""Xacro: URDF with macros, which the package xacrodoc writes out."""

import re
from contextlib import AbstractContextManager, redirect_stderr
from io import StringIO
from pathlib import Path
from typing import Any

from maniport.bounds import MEGABYTE, ROBOT_BYTES
from maniport.errors import FileFormatError
from maniport.optional import xacrodoc

_MISSING = re.compile(r"Package not found: (\S+)")


def silent() -> AbstractContextManager[Any]:
    """Keep back what xacro writes on standard error, once for every reading: what it finds old-fashioned."""
    return redirect_stderr(StringIO())


def expanded(path: Path) -> str:
    """The URDF that a xacro file stands for, with the defaults of its arguments.

    Packages that it finds files in are those above its folder and those of ROS.

    Raises
    ------
    MissingPackageError
        When xacrodoc is not installed.
    FileFormatError
        When xacro cannot expand the file; the message is its own.
    """
    module = xacrodoc()
    try:
        module.packages.walk_up_from(path)
        with silent():
            text = str(module.xacro.process_file(str(path)).toxml())
    except Exception as error:  # noqa: BLE001 - a file evaluates what it likes, which fails in many ways
        if (package := _MISSING.search(str(error))) is not None:
            raise FileFormatError(
                f"{path}: xacro cannot expand it: there is no package {package[1]!r} above its folder or in "
                "ROS_PACKAGE_PATH; --mesh-folder on the command line adds a folder of packages"
            ) from None
        reason = " ".join(str(error).split())
        raise FileFormatError(f"{path}: xacro cannot expand it: {reason or type(error).__name__}") from None
    if len(text) > ROBOT_BYTES:
        raise FileFormatError(f"{path}: is {len(text) / MEGABYTE:.4g} MB when expanded; too large")
    return text
