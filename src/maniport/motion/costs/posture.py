"""Cost of the distance from a reference configuration."""

from dataclasses import dataclass

from maniport.util.validation import Array


@dataclass(frozen=True, eq=False)
class PostureCost:
    """Cost w (q − q_ref), the same at all times."""

    reference: Array  # q_ref, (dof,)
    weight: float  # w [1/rad or 1/m]
