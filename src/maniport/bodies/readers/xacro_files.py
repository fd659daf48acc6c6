"""Xacro: URDF with macros, which the package xacrodoc writes out."""

from pathlib import Path

from maniport.bounds import MEGABYTE, ROBOT_BYTES
from maniport.errors import FileFormatError
from maniport.optional import xacrodoc


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
        text = str(module.xacro.process_file(str(path)).toxml())
    except Exception as error:  # noqa: BLE001 - a file evaluates what it likes, which fails in many ways
        reason = " ".join(str(error).split())
        raise FileFormatError(f"{path}: xacro cannot expand it: {reason or type(error).__name__}") from None
    if len(text) > ROBOT_BYTES:
        raise FileFormatError(f"{path}: is {len(text) / MEGABYTE:.4g} MB when expanded; too large")
    return text
