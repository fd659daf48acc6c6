"""Unitree's CSV of a humanoid's motion: a row for each frame, without a header.

Columns: position of the base x, y, z [m], its quaternion x, y, z, w, and the joints [rad], by default the 29 of a G1.
A frame number may be the first column. The rate is 30 Hz unless stated otherwise.
"""

import io
import os
from collections.abc import Sequence

import numpy as np

from maniport.datasets.joint_motion import RADIANS, JointMotion, times_of
from maniport.errors import FileFormatError, InvalidInputError
from maniport.util.atomic_io import write_text
from maniport.util.input_limits import FRAMES, RECORDING_BYTES, read_whole, require_at_most
from maniport.util.validation import Array, as_number

RATE = 30.0  # of the retargeted LAFAN1 motions [Hz]
ROOT = 7  # columns of the base

_LEG = ("hip_pitch", "hip_roll", "hip_yaw", "knee", "ankle_pitch", "ankle_roll")
_WAIST = ("waist_yaw", "waist_roll", "waist_pitch")
_ARM = (
    *("shoulder_pitch", "shoulder_roll", "shoulder_yaw", "elbow"),
    *("wrist_roll", "wrist_pitch", "wrist_yaw"),
)
G1_JOINTS = (
    *(f"left_{name}_joint" for name in _LEG),
    *(f"right_{name}_joint" for name in _LEG),
    *(f"{name}_joint" for name in _WAIST),
    *(f"left_{name}_joint" for name in _ARM),
    *(f"right_{name}_joint" for name in _ARM),
)
"""Joints of the Unitree G1 with 29 degrees of freedom, in the order of its files."""


def read_unitree_csv(
    path: str | os.PathLike[str], joint_names: Sequence[str] = G1_JOINTS, rate: float = RATE
) -> JointMotion:
    """Read a motion.

    Parameters
    ----------
    path : str or path
    joint_names : sequence of str
        Joints in the order of the columns. Default: those of the G1, 36 columns with the base.
    rate : float
        Frames a second [Hz].

    Raises
    ------
    FileFormatError
        When the file has another number of columns, a header, or numbers that are not finite.
    """
    frequency = as_number(rate, "rate", above=0.0)
    text = read_whole(path, (), RECORDING_BYTES).decode("utf-8", "replace").lstrip("\ufeff")
    require_at_most(text.count("\n"), FRAMES, "frames", path)
    if not text.strip():
        raise FileFormatError(f"{os.fspath(path)}: at least 2 frames are needed; found none")
    try:
        table = np.loadtxt(io.StringIO(text), delimiter=",", ndmin=2, comments=None)
    except ValueError as error:
        raise FileFormatError(
            f"{os.fspath(path)}: must hold numbers with commas and no header: {error}"
        ) from None
    count = ROOT + len(joint_names)
    if table.shape[1] == count + 1 and _counts_frames(table[:, 0]):
        table = table[:, 1:]
    if table.shape[1] != count:
        raise FileFormatError(
            f"{os.fspath(path)}: {count} columns are needed (x, y, z and the quaternion x, y, z, w "
            f"of the base, and {len(joint_names)} joints), or a frame number before them; found "
            f"{table.shape[1]}"
        )
    source = os.fspath(path)
    return JointMotion.checked(
        source,
        table[:, ROOT:],
        times_of(source, len(table), frequency),
        joint_names,
        RADIANS,
        (table[:, :3], table[:, 3:ROOT]),
    )


def write_unitree_csv(path: str | os.PathLike[str], motion: JointMotion) -> None:
    """Write a motion of a robot with a floating base at its own rate, in the order of its columns.

    `InvalidInputError` for a motion without a base, or with joints in other units than radians.
    """
    if motion.root_positions is None or motion.root_rotations is None:
        raise InvalidInputError(f"{motion.name}: the CSV needs the motion of the base; found none")
    require_radians(motion)
    table = np.column_stack([motion.root_positions, motion.root_rotations, motion.positions])
    lines = [",".join(f"{value:.9g}" for value in row) for row in table.tolist()]
    write_text(path, "\n".join(lines) + "\n")


def require_radians(motion: JointMotion) -> None:
    """Require that all columns of a motion are in radians."""
    others = [unit or "unknown" for unit in motion.units if unit != RADIANS]
    if others:
        raise InvalidInputError(
            f"{motion.name}: all joints must be in rad to be written; found {others[0]}"
        )


def _counts_frames(column: Array) -> bool:
    """Whether a column counts the frames from any number."""
    return bool(np.all(np.diff(column) == 1.0))
