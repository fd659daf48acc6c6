"""Settings of the tracker."""

from collections.abc import Sequence
from dataclasses import dataclass

from numpy.typing import ArrayLike

from maniport.errors import InvalidInputError
from maniport.motion.controller import LM_DAMPING
from maniport.motion.limits import Limit
from maniport.motion.objective import FOLLOWING_WEIGHT, ORIENTATION_WEIGHT, POINTING, axis_weights
from maniport.motion.problem import Cost
from maniport.util.validation import as_choice, as_number


@dataclass(frozen=True)
class Control:
    """Settings of the tracker.

    Attributes
    ----------
    rate : float
        Control rate [Hz]; there is at least one step for each time of the profile.
    interpolation : {"cubic", "linear"}
        Interpolation of targets: splines (of logarithms for ellipsoids), or geodesics and straight lines.
    velocity_limits, acceleration_limits : array_like, shape (dof,) or one number, optional
        [rad/s], [rad/s²], or in meters. Default: the arm's own velocity limits, and no acceleration limits.
    lm_damping : float
        Levenberg-Marquardt damping of the ellipsoid cost, not negative.
    position_cost : float
        Weight of position errors [1/m].
    orientation_axes, orientation_weight
        As in `maniport.motion.PlanControl`.
    costs : sequence of Cost
        Further costs, see `maniport.motion.Cost`.
    limits : sequence of Limit
        Further hard limits, see `maniport.motion.Limit`.

    Raises
    ------
    InvalidInputError
        When a value is out of its range, or is no cost or limit.
    """

    rate: float = 100.0
    interpolation: str = "cubic"
    velocity_limits: ArrayLike | None = None
    acceleration_limits: ArrayLike | None = None
    lm_damping: float = LM_DAMPING
    position_cost: float = FOLLOWING_WEIGHT
    orientation_axes: str = POINTING
    orientation_weight: float = ORIENTATION_WEIGHT
    costs: Sequence[Cost] = ()
    limits: Sequence[Limit] = ()

    def __post_init__(self) -> None:
        as_number(self.rate, "rate", above=0.0)
        as_choice(self.interpolation, "interpolation", ("cubic", "linear"))
        as_number(self.position_cost, "position_cost", above=0.0)
        axis_weights(self.orientation_axes, as_number(self.orientation_weight, "orientation_weight", above=0.0))
        as_number(self.lm_damping, "lm_damping", minimum=0.0)
        for name in ("costs", "limits"):
            if not isinstance(getattr(self, name), Sequence) or isinstance(getattr(self, name), str):
                raise InvalidInputError(f"{name} must be a sequence; found {getattr(self, name)!r}")
        for i, limit in enumerate(self.limits):
            if not isinstance(limit, Limit):
                raise InvalidInputError(f"limits[{i}] must have the method inequalities; found {limit!r}")
