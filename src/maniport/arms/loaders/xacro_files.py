"""Xacro files expanded to URDF, in a process with limits."""

import hashlib
import json
import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from maniport.arms.loaders import xacro_child
from maniport.errors import FileFormatError, argument, typed, unknown_name
from maniport.util.input_limits import MEGABYTE, ROBOT_BYTES
from maniport.util.optional import xacrodoc

LONGEST_XACRO = 30.0  # time limit for endless macros [s]


@dataclass(frozen=True)
class Expansion:
    """A URDF, and the digests of the files that it was made of, by their paths."""

    urdf: str
    digests: Mapping[str, str]

    def is_current(self) -> bool:
        """Return whether all files have the content that they had."""
        return all(_digest(file) == digest for file, digest in self.digests.items())


MOST_EXPANSIONS = 8  # that are kept, the latest
_EXPANSIONS: dict[str, Expansion] = {}  # by what an expansion depends on, except for the files


def expanded(path: Path, folders: Sequence[Path], arguments: Mapping[str, str]) -> str:
    """Expand a xacro file to a URDF, once until a file that it reads changes."""
    order = json.dumps(
        {
            "path": os.path.abspath(path),
            "most": ROBOT_BYTES,
            "memory": 2048 * MEGABYTE,
            "folders": [os.path.abspath(folder) for folder in folders],
            "arguments": dict(arguments),
        }
    )
    surroundings = json.dumps([order, os.getcwd(), sorted(os.environ.items())])
    known = _EXPANSIONS.pop(surroundings, None)
    if known is None or not known.is_current():
        known = _expand(path, order, arguments)
    _EXPANSIONS[surroundings] = known
    for oldest in list(_EXPANSIONS)[:-MOST_EXPANSIONS]:
        _EXPANSIONS.pop(oldest, None)
    return known.urdf


def _expand(path: Path, order: str, arguments: Mapping[str, str]) -> Expansion:
    """Expand a xacro file in a process with limits; `order` is the argument of that process."""
    xacrodoc()
    child = [sys.executable, "-P", xacro_child.__file__, order]
    try:
        done = subprocess.run(
            child, stdin=subprocess.DEVNULL, capture_output=True, timeout=LONGEST_XACRO, check=False
        )
    except subprocess.TimeoutExpired:
        raise FileFormatError(
            f"{path}: xacro cannot expand it: it takes more than {LONGEST_XACRO:g} s"
        ) from None
    try:
        answer = json.loads(done.stdout)
    except ValueError:  # ended by the system, without an answer
        answer = {"error": f"exit code {done.returncode}"}
    _require_arguments(path, answer, arguments)

    if answer.get("package"):
        raise FileFormatError(
            f"{path}: xacro cannot expand it: there is no package {answer['package']!r} above its folder or in "
            f"ROS_PACKAGE_PATH or AMENT_PREFIX_PATH; {argument('mesh_folders')} adds a folder that contains it"
        )
    text = answer.get("urdf")
    if text is None:
        reason = " ".join(str(answer.get("error")).split())
        raise FileFormatError(f"{path}: xacro cannot expand it: {reason}")
    if len(text) > ROBOT_BYTES:
        raise FileFormatError(f"{path}: is {len(text) / MEGABYTE:.4g} MB when expanded; too large")
    return Expansion(str(text), answer["opened"])


def _digest(path: str) -> str:
    """SHA-256 of the content of a file; empty where it cannot be read."""
    try:
        with open(path, "rb") as stream:
            return hashlib.sha256(stream.read()).hexdigest()
    except (OSError, ValueError):
        return ""


def _require_arguments(
    path: Path, answer: Mapping[str, Sequence[str]], given: Mapping[str, str]
) -> None:
    """Raise where arguments of a xacro file have no value, or where a given one does not exist."""
    missing = answer.get("missing", ())
    declared = answer.get("declared", ())
    unknown = [name for name in given if name not in declared]
    if missing:
        listed = ", ".join(map(repr, missing))
        others = [repr(name) for name in declared if name not in missing]
        text = f"{path}: the xacro arguments without a default need values: {listed}"
        if others:
            text += f" (further arguments: {', '.join(others)})"
        if unknown:
            text += f"; it has no argument {', '.join(map(repr, unknown))}"
        raise FileFormatError(f"{text}; give them with {xacro_arguments(missing)}")
    if unknown and "urdf" in answer:
        raise unknown_name("xacro argument", unknown[0], declared, f"in '{path}'")


def xacro_arguments(names: Sequence[str]) -> str:
    """Write how values are given to arguments of a xacro file, in a command or in Python."""
    if typed():
        values = " ".join(f"{name}:=VALUE" for name in names)
        return f"{argument('xacro_args')} {values}"
    values = ", ".join(f"{name!r}: 'VALUE'" for name in names)
    return f"{argument('xacro_args')}{{{values}}}"
