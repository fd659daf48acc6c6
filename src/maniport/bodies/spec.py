"""Which ellipsoids are meant: said once, instead of in the arguments of every function."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from maniport.validation import Array, as_choice, as_numbers

KINDS = ("velocity", "force")
VELOCITY_LIMITS = "velocity-limits"
SLOWEST = 1e-12
"""Least joint weight; the largest is its inverse. Products of squares beyond them leave the floating-point numbers."""
ROWS = {"translation": slice(0, 3), "rotation": slice(3, 6), "full": slice(0, 6)}
"""Rows of a Jacobian, linear ones first, by the part of the motion that counts."""

UNITS = {
    ("velocity", "translation"): "m/s per rad/s",
    ("velocity", "rotation"): "rad/s per rad/s",
    ("force", "translation"): "N per N m",
    ("force", "rotation"): "N m per N m",
}


@dataclass(frozen=True)
class EllipsoidSpec:
    """Which ellipsoids of an arm: of velocity or of force, of which part of the motion, with which weights.

    Attributes
    ----------
    kind : {"velocity", "force"}
        M = J W² Jᵀ, or its inverse.
    part : {"translation", "rotation", "full"}
        Which rows of the Jacobian count: d = 3, 3 or 6. ``"full"`` mixes metres and radians.
    joint_weights : None, "velocity-limits" or sequence of float
        Diagonal of W, from 1e-12 to 1e12, one for each joint: the joint velocity that counts as one. Default: all one.
        ``"velocity-limits"``: the arm's own. Numbers are kept as a tuple.

    Raises
    ------
    InvalidInputError
        When a value is none of these.

    See Also
    --------
    Arm.manipulability : the ellipsoids of an arm.

    References
    ----------
    Yoshikawa, Manipulability of robotic mechanisms, IJRR 4, 1985.
    """

    kind: str = "velocity"
    part: str = "translation"
    joint_weights: ArrayLike | None = None

    def __post_init__(self) -> None:
        as_choice(self.kind, "kind", KINDS)
        as_choice(self.part, "part", tuple(ROWS))
        weights = self.joint_weights
        if isinstance(weights, str):
            as_choice(weights, "joint_weights", (VELOCITY_LIMITS,))
        elif weights is not None:
            numbers = as_numbers(weights, "joint_weights", above=0.0)
            as_numbers(numbers, "joint_weights", minimum=SLOWEST, maximum=1.0 / SLOWEST)
            object.__setattr__(self, "joint_weights", tuple(numbers.tolist()))

    @property
    def size(self) -> int:
        """Number d of rows of an ellipsoid."""
        return 6 if self.part == "full" else 3

    @property
    def unit(self) -> str:
        """Unit of semi-axes for arms with revolute joints; empty where rows mix units."""
        return UNITS.get((self.kind, self.part), "")

    @property
    def rows(self) -> slice:
        """Which rows of a Jacobian count, linear ones first."""
        return ROWS[self.part]

    @property
    def velocity(self) -> "EllipsoidSpec":
        """The same of velocity: the inverses where these are of force."""
        return EllipsoidSpec("velocity", self.part, self.joint_weights)

    def weights(self, dof: int) -> Array:
        """Diagonal of W, shape (dof,); ones where there are no joint weights.

        Raises
        ------
        InvalidInputError
            When they are as many as another arm's joints, or the velocity limits of an arm, which only the arm knows.
        """
        if self.joint_weights is None:
            return np.ones(dof)
        return as_numbers(self.joint_weights, "joint_weights", dof, above=0.0)

    def rotation(self, turn: Array) -> Array:
        """Rotation of these ellipsoids, shape (d, d), for one of their frame, shape (3, 3)."""
        return np.asarray(np.kron(np.eye(self.size // 3), turn), dtype=np.float64)

    def __str__(self) -> str:
        return f"{self.kind} ellipsoids ({self.part})"


VELOCITY = EllipsoidSpec()
"""The default: velocity ellipsoids of the translation."""
