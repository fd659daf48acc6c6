"""The planner of a motion problem: each arm by itself in five steps, then all arms together where they interact."""

from collections.abc import Sequence
from copy import deepcopy
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from maniport.arms import Arm, ArmGroup, EllipsoidSpec, as_group
from maniport.arms.collisions import Collisions, as_collisions
from maniport.errors import InvalidInputError
from maniport.motion.arm_model import require_alike
from maniport.motion.motion_limits import MotionLimits
from maniport.motion.objective import Targets
from maniport.motion.plan.arm_planner import ArmPlanner
from maniport.motion.plan.coupling import coupled_motion
from maniport.motion.plan.plan_control import PlanControl
from maniport.motion.plan.time_parameterization import Timed
from maniport.motion.problem import MotionProblem
from maniport.util.progress import Part, nobody, pieces
from maniport.util.validation import as_generator


@dataclass(frozen=True)
class Planner:
    """An arm or a group of arms with limits, samples and collision model, for any number of plans.

    Attributes
    ----------
    limits : MotionLimits
        ``limits.arm`` has the margin of the limits.
    spec : EllipsoidSpec
        Which ellipsoids, of each arm.
    arms : tuple of ArmPlanner
        Each arm with all joints that move it: ``limits``, ``reachability_map``, ``bank`` and ``collisions``.
    collisions : Collisions, optional
        Of all arms with themselves, with each other and with obstacles.
    """

    limits: MotionLimits
    spec: EllipsoidSpec
    arms: tuple[ArmPlanner, ...]
    collisions: Collisions | None = None

    @classmethod
    def of(
        cls, limits: MotionLimits, spec: EllipsoidSpec, collisions: Collisions | bool = True, random_state: Any = 0
    ) -> "Planner":
        """Sample the arms within their limits, each with the same seed; ``collisions=True``: self-collisions.

        Raises
        ------
        InvalidInputError
            When an arm has too few joints, or coupled ones.
        """
        group, model = as_group(limits.arm), as_collisions(collisions, limits.arm)
        alone = (None,) * len(group) if model is None else model.of_arms
        generators = _copies(as_generator(random_state), len(group))
        parts = zip(group.arms, group.columns, group.specs(spec), alone, generators, strict=True)
        arms = tuple(
            ArmPlanner.of(limits.of_joints(arm, columns), own, around, random)
            for arm, columns, own, around, random in parts
        )
        return cls(limits, spec, arms, model)

    @property
    def group(self) -> ArmGroup:
        """All arms, with the margin of their limits."""
        return as_group(self.limits.arm)

    def require_fits(self, arm: Arm | ArmGroup, spec: EllipsoidSpec) -> None:
        """Raise InvalidInputError unless this plans for such arms, within limits of their own, and `spec`."""
        own, other = self.group.arms, as_group(arm).arms
        if len(own) != len(other):
            raise InvalidInputError(f"the planner was made for {len(own)} arms; found {len(other)}")
        for pair in zip(own, other, strict=True):
            require_alike("the planner was made for", pair, (self.spec, spec), limits=False)

    def solve(
        self,
        problem: MotionProblem,
        settings: PlanControl,
        random_state: Any = 0,
        progress: Part = nobody,
        separate: Sequence[Targets] | None = None,
    ) -> tuple[Timed, bool]:
        """Plan a motion, as fast as limits allow and at most as fast as the demonstration.

        Parameters
        ----------
        problem : MotionProblem
        settings : PlanControl
        random_state : None, int or numpy.random.Generator
        progress : callable
            Called with the fraction done.
        separate : sequence of Targets, optional
            Targets of each arm while it is planned by itself. Default: those of the problem.

        Returns
        -------
        timed : Timed
        coupled : bool
            Whether several arms were optimized together.
        """
        count, random = len(self.arms), as_generator(random_state)
        parts = []
        shares = zip(self.arms, separate or problem.targets, _copies(random, count), strict=True)
        for (arm, targets, own), part in zip(shares, pieces(progress, *count * [1.0]), strict=True):
            costs = problem.costs if count == 1 else ()
            alone = replace(problem, targets=(targets,), limits=arm.limits, collisions=arm.collisions, costs=costs)
            q, timed = arm.solve(alone, settings, own, part)
            parts.append(q)
        return (timed, False) if count == 1 else coupled_motion(self.arms, problem, parts, settings, random)


def _copies(generator: np.random.Generator, count: int) -> list[np.random.Generator]:
    """Return a generator for each arm, all in the same state; the last is the original."""
    return [*(deepcopy(generator) for _ in range(count - 1)), generator]
