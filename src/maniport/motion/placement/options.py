"""What is fixed of a placement, and what is searched."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from maniport.errors import InvalidInputError
from maniport.motion.placement.placement import HEADING, OFFSET, SCALE, SIZE, TILT, YAW
from maniport.util.validation import Array, as_choice, as_number

SCALES = (0.5, 2.0)  # Range of scales that is searched
REAL_TIME_SCALES = (0.3, 1.0)  # The same at the person's speed; smaller motions are of little use


@dataclass(frozen=True, eq=False)
class PlacementOptions:
    """What is fixed of a placement; what is None is searched.

    Attributes
    ----------
    scale : float or (float, float), optional
        Factor of the path's size, or the range to search. Default: from 0.5 to 2; in real time from 0.3 to 1.
    yaw : float, optional
        Rotation about the vertical [rad].
    tilt : float or "free"
        Tilt of the base toward the best heading [rad]; "free" searches it.
    offset : sequence of three floats, optional
        Position of the path's center in the arm's base frame [m]; None leaves a coordinate free.
    workspace : three pairs of floats, optional
        Bounds of the path ``((x0, x1), (y0, y1), (z0, z1))`` in the base frame [m]; None or ±inf: open.

    Raises
    ------
    InvalidInputError
        When a value is not allowed.
    """

    scale: float | tuple[float, float] | None = None
    yaw: float | None = None
    tilt: float | str = 0.0
    offset: Sequence[float | None] | Array | None = None
    workspace: Sequence[Sequence[float | None]] | Array | None = None

    def __post_init__(self) -> None:
        self.components(SCALES)
        self.bounds()

    def components(self, scales: tuple[float, float]) -> tuple[Array, Array, Array]:
        """Return fixed components of a placement (7,), nan where free, and lower and upper bounds of placements.

        `scales` is the range of a free scale.
        """
        fixed = np.full(SIZE, np.nan)
        if isinstance(self.scale, tuple | list):
            if len(self.scale) != 2:
                raise InvalidInputError(
                    f"scale must be one number or a range (low, high); found {self.scale!r}"
                )
            low = as_number(self.scale[0], "scale[0]", above=0.0)
            scales = (low, as_number(self.scale[1], "scale[1]", above=low))
        elif self.scale is not None:
            number = as_number(self.scale, "scale", above=0.0)
            fixed[SCALE] = np.log(number)
            scales = (number, number)
        if self.yaw is not None:
            fixed[YAW] = as_number(self.yaw, "yaw")
        if isinstance(self.tilt, str):
            as_choice(self.tilt, "tilt", ["free"])
        else:
            fixed[TILT] = as_number(self.tilt, "tilt", minimum=0.0, maximum=np.pi)
            if fixed[TILT] == 0.0:
                fixed[HEADING] = 0.0
        fixed[OFFSET] = self._fixed_offset()

        lower = np.array([np.log(scales[0]), -np.pi, 0.0, -np.pi, *[-np.inf] * 3])
        upper = np.array([np.log(scales[1]), np.pi, np.pi, np.pi, *[np.inf] * 3])
        return fixed, lower, upper

    def _fixed_offset(self) -> Array:
        fixed = np.full(3, np.nan)
        if self.offset is None:
            return fixed
        if isinstance(self.offset, Sequence | np.ndarray):
            values = list(self.offset)
        else:
            values = []
        if len(values) != 3:
            raise InvalidInputError(
                f"offset must be three numbers, None where free; found {self.offset!r}"
            )
        for i, value in enumerate(values):
            if value is not None:
                fixed[i] = as_number(value, f"offset[{i}]")
        return fixed

    def bounds(self) -> Array:
        """Return lower and upper bounds of the path, shape (2, 3) [m], infinite where it is open."""
        bounds = np.array([[-np.inf] * 3, [np.inf] * 3])
        if self.workspace is None:
            return bounds
        pairs = []
        if isinstance(self.workspace, Sequence | np.ndarray):
            pairs = list(self.workspace)
        complete = len(pairs) == 3
        for pair in pairs:
            complete = complete and isinstance(pair, Sequence | np.ndarray) and len(pair) == 2
        if not complete:
            raise InvalidInputError(
                "workspace must be ((x0, x1), (y0, y1), (z0, z1)), None where open; found "
                f"{self.workspace!r}"
            )
        for i, (low, high) in enumerate(pairs):
            if low not in (None, -np.inf):
                bounds[0, i] = as_number(low, f"workspace[{i}][0]")
            if high not in (None, np.inf):
                bounds[1, i] = as_number(high, f"workspace[{i}][1]", above=bounds[0, i])
        return bounds
