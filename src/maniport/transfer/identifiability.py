"""Identifiability of the rotation between two domains (`docs/method/identifiability.md`).

The fitted rotation is perturbed by 30° in every direction; the change of the distance between the clouds is measured
without matching (see `CloudPair`). In symmetric clouds that share ellipsoids, these coincide only at one rotation.
"""

from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from maniport.spd.matrix_functions import roots
from maniport.transfer.adapter_file import Attribute, Schema, as_flags, require_arrays
from maniport.transfer.cloud_pair import CloudPair
from maniport.transfer.rotation_group import rotation_from_vector
from maniport.util.notebook import NotebookDisplay
from maniport.util.validation import Array, as_finite

LARGEST_EXAMINED = 6
"""Largest size d whose rotations are examined: their m = d (d − 1) / 2 directions need about 2 m² distances between the
clouds, and descents from rival starts take m × m derivatives in each step: minutes for d = 12."""

ADVICE = (
    "give base_rotation= (orientation of the student's base in the teacher's) or fit(..., pairs=) (ellipsoids of the "
    "same task at the same time)"
)
"""Remedies where the rotation is not determined."""


@dataclass(frozen=True, eq=False)
class Identifiability(NotebookDisplay):
    """Which directions of the rotation between two domains they determine."""

    rotation: Array  # (d, d): the fitted one, R
    curvature: Array  # (m,): m = d (d − 1) / 2
    standard_error: Array  # (m,): of `curvature`, over draws of the clouds
    directions: Array  # (m, m): rows: the principal directions, as rotation vectors of recentered student ellipsoids
    flat: NDArray[np.bool_]  # (m,)
    axes: Array  # (m, 3): for d = 3 the directions as axes in the student's base frame

    @property
    def examined(self) -> bool:
        """Whether the directions were examined; beyond d = 6 they are too many."""
        return len(self.curvature) > 0

    @property
    def determined(self) -> bool:
        """Whether the clouds determine the rotation in every direction."""
        return self.examined and not bool(self.flat.any())

    @property
    def flat_axes(self) -> Array:
        """For d = 3 the axes about which the rotation is free, in the student's base frame, shape (k, 3)."""
        return self.axes[self.flat] if len(self.axes) else self.axes

    schema: ClassVar[Schema] = {
        "rotation": Attribute(("d", "d"), as_finite),
        "curvature": Attribute(("k",), as_finite),
        "standard_error": Attribute(("k",), as_finite),
        "directions": Attribute(("k", "m"), as_finite),
        "flat": Attribute(("k",), as_flags),
        "axes": Attribute(("axes", "space"), as_finite),
    }

    @classmethod
    def read(cls, arrays: dict[str, Any]) -> Self:
        """Return the object of the arrays in a file, which are checked."""
        result = cls(**arrays)
        require_arrays(arrays, cls.schema)
        return result

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Identifiability) and all(
            np.array_equal(value, getattr(other, name)) for name, value in vars(self).items()
        )

    __hash__ = None  # type: ignore[assignment]  # as arrays have none

    def __repr__(self) -> str:
        return f"Identifiability({self.in_words()})"

    def in_words(self) -> str:
        """Return whether the rotation is determined, and if not, about which axes it is free."""
        if not self.examined:
            d = len(self.rotation)
            return (
                f"whether the domains determine the rotation was not examined for d = {d} with its "
                f"{d * (d - 1) // 2} directions (up to d = {LARGEST_EXAMINED} they are)"
            )
        if self.determined:
            return "the domains determine the rotation in every direction"
        count, total = int(self.flat.sum()), len(self.flat)
        if not len(self.axes):
            where = "" if total == 1 else f" in {count} of {total} directions"
            return f"the domains do not determine the rotation{where}"
        if count == total:
            return "the domains do not determine the rotation about any axis"
        names = []
        for axis in self.flat_axes:
            nearest = int(np.argmax(np.abs(axis)))
            off = float(np.rad2deg(np.arccos(min(1.0, abs(float(axis[nearest]))))))
            upward = ", ".join(f"{part:.2f}" for part in axis * np.sign(axis[nearest]))
            names.append(
                f"the {'xyz'[nearest]} axis of the student's base ({off:.1f}° off)"
                if off <= 15.0
                else f"the axis ({upward}) of the student's base"
            )
        return f"the domains do not determine the rotation about {' and '.join(names)}"


def identify(pair: CloudPair, rotation: Array, student_mean: Array) -> Identifiability:
    """Examine which directions of a rotation (d, d) the clouds determine."""
    d = len(rotation)
    m = d * (d - 1) // 2
    if d <= LARGEST_EXAMINED:
        curvature, errors, directions, flat = _curvatures(pair, rotation)
    else:
        curvature, errors, directions, flat = np.empty(0), np.empty(0), np.empty((0, m)), np.zeros(0, bool)
    axes = np.empty((0, 3))
    if d == 3:
        # S̄^½ Q S̄^-½, which a turn Q about v is in the base frame, leaves S̄^½ v where it is
        axes = directions @ roots(student_mean)[0]
        axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    return Identifiability(
        rotation=rotation,
        curvature=curvature,
        standard_error=errors,
        directions=directions,
        flat=flat,
        axes=axes,
    )


def _curvatures(
    pair: CloudPair, rotation: Array, turn: float = np.pi / 6.0, least: float = 1e-3
) -> tuple[Array, Array, Array, NDArray[np.bool_]]:
    """Relative curvatures, their standard errors, principal directions, and which of them are flat.

    `turn` is the angle of the finite differences [rad]; much smaller ones measure the graininess of the samples. A
    direction is flat where the curvature, relative to the mean distance, is below `least` [1/rad²], or not above zero
    by two standard errors. Measured: 1e-4 to 2.4e-4 about the Panda's base axis and 2e-3 to 3e-3 across it, at most
    4e-4 in the plane of a planar arm of two joints, at least 8.5e-3 in clouds with random covariance.
    """
    middle = pair.distances(rotation)
    here, d = float(middle[0].mean()), len(rotation)

    def both_sides(step: Array) -> list[Array]:
        return [rotation_from_vector(sign * step) @ rotation for sign in (-1.0, 1.0)]

    def change(step: Array) -> float:
        """Second difference of the mean distance."""
        return sum(pair.mean_distance(side) for side in both_sides(step)) - 2.0 * here

    directions = np.eye(d * (d - 1) // 2)
    # at 30° oblique directions are off by up to 6°; measured again along those of 15° a flat axis is exact to 0.1°
    for angle in (0.5 * turn, turn) if d <= 3 else (turn,):
        steps, hessian = angle * directions, np.empty(directions.shape)
        for a, first in enumerate(steps):
            hessian[a, a] = change(first)
            for b, second in enumerate(steps[:a]):
                along, across = (first + second) / np.sqrt(2.0), (first - second) / np.sqrt(2.0)
                hessian[a, b] = hessian[b, a] = 0.5 * (change(along) - change(across))
        values, vectors = np.linalg.eigh(hessian / angle**2)
        directions = vectors.T @ directions
    errors, flat = np.empty_like(values), np.empty(len(values), bool)
    for k, step in enumerate(turn * directions):
        sides = both_sides(step)
        terms = [(1.0, pair.distances(side)) for side in sides]
        errors[k] = pair.combination([*terms, (-2.0, middle)]).standard_error / turn**2
        flat[k] = values[k] < least * here or values[k] < 2.0 * errors[k]
        if flat[k]:  # unless certainly more ellipsoids coincide here than on either side
            nearest = pair.nearest(rotation)
            flat[k] = any(pair.coincidence(pair.nearest(side), nearest).certainty < 3.0 for side in sides)
    return values / here, errors / here, directions, flat
