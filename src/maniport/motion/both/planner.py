"""What is known of two arms before they are asked for anything."""

from collections.abc import Sequence
from copy import deepcopy
from dataclasses import dataclass
from typing import Any

from numpy.typing import ArrayLike

from maniport.arms import ArmGroup, EllipsoidSpec
from maniport.arms.collisions import Collisions, as_collisions
from maniport.errors import InvalidInputError
from maniport.motion.arm_model import require_alike
from maniport.motion.motion_limits import MotionLimits
from maniport.motion.plan.planner import Planner
from maniport.util.validation import as_generator


@dataclass(frozen=True)
class ArmsPlanner:
    """Two arms with their limits and collision model, for any number of plans.

    Attributes
    ----------
    limits : MotionLimits
        ``limits.arm`` are the `maniport.arms.ArmGroup`, with the margin.
    spec : EllipsoidSpec
        Which ellipsoids, of each arm.
    each : (Planner, Planner)
        Planners of each arm, with all joints that move it.
    collisions : Collisions, optional
        Of the pair: each arm with itself, the other one, and obstacles.
    """

    limits: MotionLimits
    spec: EllipsoidSpec
    each: tuple[Planner, Planner]
    collisions: Collisions | None = None

    @classmethod
    def of(
        cls, limits: MotionLimits, spec: EllipsoidSpec, collisions: Collisions | bool, random_state: Any = 0
    ) -> "ArmsPlanner":
        """Sample the arms that the limits leave, both with the same seed, as one arm is sampled by `Planner.of`.

        Raises
        ------
        InvalidInputError
            When an arm has too few joints, or coupled ones.
        """
        arms, generator = as_arms(limits.arm), as_generator(random_state)
        apart = as_collisions(collisions, arms)
        alone = (None, None) if apart is None else apart.of_arms
        planners = []
        for arm, columns, meant, around in zip(arms.arms, arms.columns, arms.specs(spec), alone, strict=True):
            planners.append(Planner.of(limits.of_joints(arm, columns), meant, around or False, deepcopy(generator)))
        return cls(limits, spec, (planners[0], planners[1]), apart)

    @property
    def arms(self) -> ArmGroup:
        """The arms, with the margin of their limits."""
        return as_arms(self.limits.arm)

    def require_fits(self, arms: ArmGroup, spec: EllipsoidSpec) -> None:
        """Raise InvalidInputError unless this plans for arms like `arms`, within limits of their own, and `spec`."""
        for mine, other in zip(self.arms.arms, arms.arms, strict=True):
            require_alike("the planner was made for", (mine, other), (self.spec, spec), limits=False)


def as_arms(value: Any) -> ArmGroup:
    """Require two arms."""
    if not isinstance(value, ArmGroup):
        raise InvalidInputError(f"arms must be two, as maniport.load_arms makes them; found {type(value).__name__}")
    return value


def two(value: Sequence[ArrayLike] | None, name: str) -> Sequence[ArrayLike | None]:
    """Require one thing for each arm, or none."""
    if value is None:
        return (None, None)
    if not hasattr(value, "__len__") or len(value) != 2:
        raise InvalidInputError(f"{name} must be two, of the left and of the right arm; found {type(value).__name__}")
    return value
