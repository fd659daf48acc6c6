"""Options of the planner, checked and resolved for an arm or a group."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

from numpy.typing import ArrayLike

from maniport.arms import Arm, ArmGroup
from maniport.arms.collisions import Collisions, as_collisions
from maniport.errors import InvalidInputError
from maniport.motion.costs.cost import Cost
from maniport.motion.costs.orientation import axis_weights
from maniport.motion.motion_limits import MotionLimits
from maniport.util.defaults import MARGIN, POSITION_TOLERANCE, RATE
from maniport.util.validation import Array, as_choice, as_number

HAND_TARGETS = ("placed", "relative")


class PlacementRound(NamedTuple):
    """One round of the search of a placement."""

    kept: int  # placements with trajectories that it improves
    waypoints: int
    position_weight: float  # [1/m]
    steps: int


PLACEMENT_ROUNDS = (
    PlacementRound(512, 8, 30.0, 6),
    PlacementRound(128, 12, 60.0, 6),
    PlacementRound(40, 24, 200.0, 6),
    PlacementRound(12, 64, 200.0, 6),
    PlacementRound(3, 64, 200.0, 60),
)
"""The first round has two trajectories of 256 placements; with 96, three of four searches miss the best branch of an
xArm7. The position weight grows, since a stiff one has more local minima. The last round avoids collisions."""


@dataclass(frozen=True)
class SearchBudget:
    """Search budget of placement and planning."""

    candidates: int = 2048  # placements compared by samples
    rounds: tuple[PlacementRound, ...] = PLACEMENT_ROUNDS
    nodes: int = (
        300  # nodes per stage of the roadmap of a plan; up to 2.4 times as many for short paths
    )
    stage: float = 0.55  # longest time between stages at the planning time scale [s]
    rel_tol: float = 1e-4  # smallest relative decrease of the cost for another optimizer step
    pointwise_starts: int = 32  # samples for the best pointwise solution at a waypoint
    gap_points: int = 250  # most waypoints at which the feasibility gap is searched
    gap_starts: int = 48  # samples for each of them

    def reduced(self, factor: int) -> "SearchBudget":
        """Return a budget with a share of the placements and nodes, for problems with few local minima."""
        rounds = []
        for each in self.rounds:
            rounds.append(each._replace(kept=max(1, each.kept // factor)))
        return replace(
            self,
            candidates=max(2, self.candidates // factor),
            rounds=tuple(rounds),
            nodes=max(32, self.nodes // 2),
        )


DEFAULT_BUDGET = SearchBudget()


def default_budget() -> SearchBudget:
    """Return the search budget of options without one; studies and tests replace it."""
    return DEFAULT_BUDGET


@dataclass(frozen=True)
class PlanOptions:
    """Options of `plan_motion`.

    Attributes
    ----------
    position_tolerance : float
        Position tolerance of the end effector, for the 95th percentile of the position error [m]. It is used, mostly
        for a shorter duration.
    speed_scale : float
        Largest speed relative to the demonstration. Where limits demand it, the motion is slower.
    real_time : bool
        Plan joint motions for the largest speed. By default they are planned for a quarter of the demonstrated speed,
        which lowers the ellipsoid distance, but limits slow the motion down more.
    rate : float
        Samples of the result per second [Hz].
    motion_limits : MotionLimits, path, mapping or None
        See `MotionLimits.of`.
    joint_limit_margin : float
        Share of each joint's range that is kept free at either end, unless `motion_limits` are `MotionLimits` already.
    collisions : Collisions or bool
        Collision model; True: self-collisions.
    orientation_axes : {"pointing", "whole"}
        Which axes of target orientations count: z, or all.
    home : array_like, shape (dof,), optional
        Configuration at which the motion begins and ends, at rest [rad or m].
    costs : sequence of Cost
        Further costs, over all joints; see `maniport.motion.Cost`. The pointwise optimum ignores them.
    hand_targets : {"placed", "relative"}
        Whether the end effectors follow their positions, or only keep the vectors from the first end effector to the
        others; the arms of the result then have no paths.
    budget : SearchBudget
        How much is searched.
    """

    position_tolerance: float = POSITION_TOLERANCE
    speed_scale: float = 1.0
    real_time: bool = False
    rate: float = RATE
    motion_limits: MotionLimits | str | os.PathLike[str] | Mapping[str, object] | None = None
    joint_limit_margin: float = MARGIN
    collisions: Collisions | bool = True
    orientation_axes: str = "pointing"
    home: ArrayLike | None = None
    costs: Sequence[Cost] = ()
    hand_targets: str = "placed"
    budget: SearchBudget = field(default_factory=default_budget)

    def __post_init__(self) -> None:
        as_number(self.position_tolerance, "position_tolerance", above=0.0)
        as_number(self.speed_scale, "speed_scale", above=0.0)
        as_number(self.rate, "rate", minimum=10.0)
        axis_weights(self.orientation_axes)
        as_choice(self.hand_targets, "hand_targets", HAND_TARGETS)
        as_number(self.joint_limit_margin, "joint_limit_margin", minimum=0.0, maximum=0.4)

    def resolved(self, arm: Arm | ArmGroup, planner: Any = None) -> "PlanOptions":
        """Look up limits and collisions of the arms, or take those of a planner; check the home configuration."""
        limits = self.motion_limits if planner is None else planner.limits
        if not isinstance(limits, MotionLimits):
            limits = MotionLimits.of(arm, limits, self.joint_limit_margin)
        limits.require_held()
        model = as_collisions(
            self.collisions if planner is None else planner.collisions, limits.arm
        )
        if self.home is None:
            home = None
        else:
            home = require_free(self.home, "home", limits, model)
        return replace(self, motion_limits=limits, collisions=model or False, home=home)


def require_free(
    configuration: ArrayLike, name: str, limits: MotionLimits, collisions: Collisions | None
) -> Array:
    """Require one configuration (dof,) within the limits and without collisions."""
    q: Array = limits.arm.require_within_limits(configuration, name, single=True)
    if collisions is not None and collisions.collides(q):
        nearest = collisions.nearest(q)
        raise InvalidInputError(
            f"{name}: {nearest.first} and {nearest.second} of {limits.arm.name!r} collide, by "
            f"{-1e3 * float(nearest.distance):.0f} mm; give a collision-free configuration"
        )
    return q
