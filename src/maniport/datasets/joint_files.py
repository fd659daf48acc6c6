"""The joint trajectories of maniport's results: ``joints.csv`` and ``joints.npz``."""

import csv
import io
import os

import numpy as np

from maniport.datasets.joint_motion import METERS, RADIANS, UNKNOWN, JointMotion
from maniport.errors import FileFormatError, some_of
from maniport.util.files import load_arrays
from maniport.util.input_limits import FRAMES, RECORDING_BYTES, read_whole, require_at_most

TIME = "time_s"
SUFFIXES = {f"_{RADIANS}": RADIANS, f"_{METERS}": METERS}
"""Ends of the names of columns with positions."""


def read_joints_csv(path: str | os.PathLike[str]) -> JointMotion:
    """Read the positions of a table with the columns ``time_s`` and ``NAME_rad`` or ``NAME_m``.

    `FileFormatError` when the header has no such columns, or a number is not finite.
    """
    source = os.fspath(path)
    text = read_whole(path, (), RECORDING_BYTES).decode("utf-8", "replace").lstrip("\ufeff")
    require_at_most(text.count("\n"), FRAMES, "rows", path)
    header, _, body = text.partition("\n")
    names = next(csv.reader([header.strip()]))
    chosen = []
    columns = []
    units = []
    for place, name in enumerate(names):
        for suffix, unit in SUFFIXES.items():
            if name.endswith(suffix):
                chosen.append(place)
                columns.append(name.removesuffix(suffix).removeprefix("'"))
                units.append(unit)
    if TIME not in names or not chosen:
        raise FileFormatError(
            f"{source}: needs the columns {TIME} and NAME_rad or NAME_m; found {some_of(names)}"
        )
    if not body.strip():
        raise FileFormatError(f"{source}: at least 2 frames are needed; found none")
    try:
        table = np.loadtxt(io.StringIO(body), delimiter=",", ndmin=2, comments=None)
    except ValueError as error:
        raise FileFormatError(f"{source}: must hold numbers with commas: {error}") from None
    if table.shape[1] != len(names):
        raise FileFormatError(
            f"{source}: rows must have {len(names)} numbers, as the header; found {table.shape[1]}"
        )
    motion = JointMotion.checked(source, table[:, chosen], table[:, names.index(TIME)], columns)
    return JointMotion(**{**vars(motion), "units": tuple(units)})


def read_joints_npz(path: str | os.PathLike[str]) -> JointMotion:
    """Read the control steps of ``joints.npz``.

    `FileFormatError` when an array is missing or has a wrong shape, or a number is not finite.
    """
    source = os.fspath(path)
    needed = ("control_time", "control_positions", "joint_names")
    arrays = load_arrays(path, "joint trajectory", (*needed, "joint_units"))
    missing = [name for name in needed if name not in arrays]
    if missing:
        raise FileFormatError(f"{source}: lacks {', '.join(missing)}; found {some_of(arrays)}")
    names = [str(name) for name in np.atleast_1d(arrays["joint_names"]).tolist()]
    time = np.asarray(arrays["control_time"]).reshape(-1)
    motion = JointMotion.checked(source, arrays["control_positions"], time, names)
    units = tuple(str(unit) for unit in np.atleast_1d(arrays.get("joint_units", [])).tolist())
    if len(units) != len(names):
        units = (UNKNOWN,) * len(names)
    return JointMotion(**{**vars(motion), "units": units})
