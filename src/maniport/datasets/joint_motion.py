"""Motions of the joints of a robot, as files of datasets hold them."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maniport.errors import FileFormatError
from maniport.util.validation import Array

RADIANS = "rad"
DEGREES = "deg"
METERS = "m"
UNITS = (RADIANS, DEGREES)
"""Units of joint positions that a caller may state; prismatic joints are in meters with both."""
UNKNOWN = ""  # unit of a column of which the file states nothing

QUATERNION_TOLERANCE = 0.05  # of the norm of a quaternion; files have at least three digits
STEP_TOLERANCE = (
    0.02  # share by which steps of a constant rate may differ; stamps have milliseconds
)


@dataclass(frozen=True, eq=False)
class JointMotion:
    """One motion of the joints of a robot; make it with `JointMotion.checked`.

    Attributes
    ----------
    name : str
        Name of the episode or file, for reports.
    positions : ndarray, shape (n, k)
        A column for each joint, in the units of `units`; n ≥ 2.
    time : ndarray, shape (n,)
        Increasing [s].
    columns : tuple of str
        Names of the columns as the file has them; empty where it has none.
    units : tuple of str
        Unit of each column, ``"rad"``, ``"deg"`` or ``"m"``; ``""`` where the file states none.
    root_positions : ndarray, shape (n, 3), or None
        Positions of the floating base in the world [m].
    root_rotations : ndarray, shape (n, 4), or None
        Rotations of the floating base as unit quaternions x, y, z, w.
    notes : tuple of str
        Facts on how the file was read, such as an identified order of joints.
    """

    name: str
    positions: Array
    time: Array
    columns: tuple[str, ...] = ()
    units: tuple[str, ...] = ()
    root_positions: Array | None = None
    root_rotations: Array | None = None
    notes: tuple[str, ...] = field(default_factory=tuple)

    @classmethod
    def checked(
        cls,
        source: str,
        positions: ArrayLike,
        time: ArrayLike,
        columns: Sequence[str] = (),
        unit: str = UNKNOWN,
        root: tuple[ArrayLike, ArrayLike] | None = None,
        name: str = "",
    ) -> "JointMotion":
        """Make a motion from what a file holds.

        Parameters
        ----------
        source : str
            The file, and its part, for messages.
        positions : array_like, shape (n, k)
        time : array_like, shape (n,)
        columns : sequence of str, optional
            Names of the columns, all different.
        unit : str
            Unit of all columns; empty where the file states none.
        root : tuple of array_like, shapes (n, 3) and (n, 4), optional
            Position [m] and quaternion x, y, z, w of the floating base.
        name : str
            Default: `source`.

        Raises
        ------
        FileFormatError
            When shapes differ, a number is not finite, times do not increase, names repeat, or a
            quaternion is far from unit length.
        """
        values = _as_table(source, "joint positions", positions)
        count = values.shape[1]
        if len(values) < 2:
            raise FileFormatError(f"{source}: at least 2 frames are needed; found {len(values)}")
        times = _as_table(source, "times", np.asarray(time, dtype=np.float64)[:, None])[:, 0]
        if len(times) != len(values):
            raise FileFormatError(
                f"{source}: times and joint positions must have the same number of frames; "
                f"found {len(times)} and {len(values)}"
            )
        steps = np.diff(times)
        if not np.all(steps > 0.0):
            row = int(np.argmin(steps > 0.0)) + 1
            raise FileFormatError(
                f"{source}: times must increase; found {times[row]:.9g} s after "
                f"{times[row - 1]:.9g} s in frame {row}"
            )
        names = tuple(columns)
        if names and len(names) != count:
            raise FileFormatError(
                f"{source}: one name for each of {count} columns is needed; found {len(names)}"
            )
        repeated = sorted({column for column in names if names.count(column) > 1})
        if repeated:
            raise FileFormatError(
                f"{source}: columns must have different names; found twice: {', '.join(repeated)}"
            )
        root_positions, root_rotations = _as_root(source, root, len(values))
        return cls(
            name=name or source,
            positions=values,
            time=times,
            columns=names,
            units=(unit,) * count,
            root_positions=root_positions,
            root_rotations=root_rotations,
        )

    def __len__(self) -> int:
        return len(self.time)

    @property
    def rate(self) -> float:
        """Mean number of frames a second [Hz]."""
        return (len(self.time) - 1) / float(self.time[-1] - self.time[0])

    @property
    def has_constant_rate(self) -> bool:
        """Whether all steps of time are equal to 2 %."""
        steps = np.diff(self.time)
        return bool(np.ptp(steps) <= STEP_TOLERANCE * steps.mean())

    def named(self, columns: Sequence[str]) -> "JointMotion":
        """Return the motion with names for its columns; `FileFormatError` for another number of names."""
        count = self.positions.shape[1]
        if len(columns) != count:
            raise FileFormatError(
                f"{self.name}: names for {count} columns are needed; found {len(columns)}: "
                f"{', '.join(columns)}"
            )
        return replace(self, columns=tuple(columns))

    def select(self, rows: slice | NDArray[np.intp]) -> "JointMotion":
        """Return some frames of the motion."""
        root_positions = self.root_positions
        root_rotations = self.root_rotations
        return replace(
            self,
            positions=self.positions[rows],
            time=self.time[rows],
            root_positions=None if root_positions is None else root_positions[rows],
            root_rotations=None if root_rotations is None else root_rotations[rows],
        )


def times_of(source: str, count: int, rate: object) -> Array:
    """Return times (count,) [s] from 0 at a rate [Hz] that a file states; `FileFormatError` for no rate."""
    try:
        value = float(np.asarray(rate, dtype=np.float64).reshape(-1)[0])
    except (TypeError, ValueError, IndexError, OverflowError):
        value = np.nan
    if not 0.0 < value < np.inf:
        raise FileFormatError(f"{source}: the frame rate must be above 0 Hz; found {value:g}")
    return np.arange(count) / value


def _as_table(source: str, what: str, values: ArrayLike) -> Array:
    """Require finite numbers (n, k), and return them as float64."""
    try:
        table = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise FileFormatError(f"{source}: {what} must be numbers: {error}") from None
    if table.ndim != 2 or not table.shape[1]:
        raise FileFormatError(
            f"{source}: {what} must be a table, a row for each frame; found shape {table.shape}"
        )
    wrong = ~np.isfinite(table)
    if np.any(wrong):
        row, column = np.argwhere(wrong)[0].tolist()
        raise FileFormatError(
            f"{source}: {what} must be finite; found {table[row, column]} in frame {row}, column "
            f"{column} ({int(wrong.sum())} such numbers)"
        )
    return table


def _as_root(
    source: str, root: tuple[ArrayLike, ArrayLike] | None, count: int
) -> tuple[Array | None, Array | None]:
    """Require positions (n, 3) and quaternions (n, 4) of unit length of a floating base."""
    if root is None:
        return None, None
    positions = _as_table(source, "positions of the base", root[0])
    rotations = _as_table(source, "quaternions of the base", root[1])
    if positions.shape != (count, 3) or rotations.shape != (count, 4):
        raise FileFormatError(
            f"{source}: the base needs positions ({count}, 3) and quaternions ({count}, 4); found "
            f"shapes {positions.shape} and {rotations.shape}"
        )
    norms = np.linalg.norm(rotations, axis=1)
    wrong = np.abs(norms - 1.0) > QUATERNION_TOLERANCE
    if np.any(wrong):
        row = int(wrong.argmax())
        raise FileFormatError(
            f"{source}: quaternions of the base must have length 1; found {norms[row]:.4g} in "
            f"frame {row}"
        )
    return positions, rotations / norms[:, None]
