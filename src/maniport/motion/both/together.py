"""Targets of both arms, and one motion of both from what each does alone: refined in slow time, then timed."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from maniport.arms import ArmGroup
from maniport.arms.collisions import Collisions
from maniport.motion.both.planner import ArmsPlanner
from maniport.motion.kernels import add_residual
from maniport.motion.motion_limits import MotionLimits
from maniport.motion.objective import Targets
from maniport.motion.plan.optimizer import (
    CLEARANCE,
    CLEARANCE_WEIGHT,
    POSITION_WEIGHTS,
    TrajectoryCost,
    optimize,
    optimize_to_tolerance,
)
from maniport.motion.plan.plan_motion import PlanRequest, TimedPath
from maniport.motion.plan.planner import coarse_terms, interpolated, smoothness_share, stages_of, time_parameterized
from maniport.motion.plan.roadmap import JOINT_MOTION_WEIGHT, shortest_path
from maniport.motion.plan.time_parameterization import Timed, retime
from maniport.motion.search.descent import PathCost
from maniport.motion.search.pointwise import STARTS, search_pointwise
from maniport.motion.search.seed_bank import SeedBank
from maniport.util.progress import Part
from maniport.util.validation import Array

PLACED, RELATIVE = "placed", "relative"
"""What is kept of the tips' paths: where they are, or the way from the left tip to the right one alone."""


@dataclass(frozen=True)
class BothTargets:
    """Targets of a left and of a right arm, in the joints of the pair: the cost is the sum of theirs."""

    arm: ArmGroup
    each: tuple[Targets, Targets]
    way: Array | None = None  # (n, 3), target vector from the left to the right end effector [m]

    @classmethod
    def relative(cls, arm: ArmGroup, each: tuple[Targets, Targets]) -> "BothTargets":
        """Those that keep of both paths the way from the left tip to the right one alone."""
        left, right = each
        assert left.positions is not None
        assert right.positions is not None
        free = replace(left, positions=None), replace(right, positions=None)
        return cls(arm, free, right.positions - left.positions)

    def __getitem__(self, rows: Any) -> "BothTargets":
        left, right = (one[rows] for one in self.each)
        return BothTargets(self.arm, (left, right), None if self.way is None else self.way[rows])

    def __len__(self) -> int:
        return len(self.each[0])

    def weighing(self, position_weight: float) -> "BothTargets":
        """The same with another weight of the tips' places [1/m]."""
        left, right = (one.weighing(position_weight) for one in self.each)
        return BothTargets(self.arm, (left, right), self.way)

    @property
    def position_weight(self) -> float:
        """What a metre counts for that a tip is beside its place, or the way between them beside what it shall be."""
        return self.each[0].objective.position_weight

    def distance(self, q: Array) -> Array:
        """Root of the sum of both arms' squared distances (n,)."""
        return np.asarray(np.hypot(*self.distances(q)))

    def distances(self, q: Array) -> tuple[Array, Array]:
        """Affine-invariant distance of target and achieved ellipsoids of each arm (n,)."""
        left, right = (one.distance(part) for one, part in zip(self.each, self.arm.split(q), strict=True))
        return left, right

    def beside(self, q: Array) -> Array:
        """By how much the way from tip to tip is another one than it shall be [m], shape (n, 3)."""
        assert self.way is not None
        tips = self.arm.forward(q)[:, :, :3, 3]
        return np.asarray(tips[:, 1] - tips[:, 0] - self.way)

    def evaluate(self, q: Array) -> tuple[Array, Array, Array]:
        """As `Targets.evaluate`, in the joints of both arms."""
        square = np.zeros(len(q))
        gradient, hessian = np.zeros(q.shape), np.zeros((*q.shape, q.shape[1]))
        for one, columns in zip(self.each, self.arm.columns, strict=True):
            length, slope, curvature = one.evaluate(q[:, columns])
            square += length**2
            gradient[:, columns] += slope
            hessian[:, columns[:, None], columns] += curvature
        if self.way is not None:
            away, moves = self.position_weight * self.beside(q), self.arm.jacobian(q)[:, :, :3]
            add_residual(away, self.position_weight * (moves[:, 1] - moves[:, 0]), gradient, hessian)
            square += np.sum(away**2, axis=1)
        return np.sqrt(square), gradient, hessian

    def tip_error(self, q: Array) -> Array | None:
        """Distance of each tip from its target [m], shape (n, 2), or of the way between them (n,); None without."""
        if self.way is not None:
            return np.asarray(np.linalg.norm(self.beside(q), axis=1))
        errors = [one.tip_error(part) for one, part in zip(self.each, self.arm.split(q), strict=True)]
        found = [error for error in errors if error is not None]
        return np.stack(found, axis=1) if found else None


def floors_of(targets: BothTargets, banks: Sequence[SeedBank], known: Sequence[Array]) -> tuple[Array, Array]:
    """Smallest distances (n,) of the left and of the right arm, in sum of squares, at each point by itself."""
    starts = np.empty((len(targets), STARTS, targets.arm.dof))
    for one, bank, columns in zip(targets.each, banks, targets.arm.columns, strict=True):
        starts[..., columns] = bank.starts_for(one, STARTS)
    return targets.distances(search_pointwise(targets, starts, known).joint_positions)


def together(
    planner: ArmsPlanner,
    requests: list[PlanRequest],
    courses: list[TimedPath],
    relative: bool,
    random: np.random.Generator,
    tell: Part,
) -> tuple[Timed, bool]:
    """One motion of both, and whether it was refined as one."""
    request, limits, apart = requests[0], planner.limits, planner.collisions
    ways = [one.q for one in courses]
    (left, slow, fastest, _), (right, *_) = (
        one.finer(own.limits) for one, own in zip(requests, planner.each, strict=True)
    )

    def others() -> list[Array]:
        """What else may be begun with, where all else collides."""
        if planner.arms.shared or apart is None or left.positions is None:
            return []
        return parted(planner, (left, right), slow, ways, random)

    if relative:
        tell(0.1)
        between = BothTargets.relative(planner.arms, (left, right))
        return _refined(limits, between, apart, (slow, fastest), _starts(planner, ways), request, others), True
    starts = _starts(planner, ways)
    near = apart is not None and apart.between.known and bool(np.any(apart.between.clearance(starts[0]) < CLEARANCE))
    if not (planner.arms.shared or near):
        return retime(limits, fastest, starts[0], rate=request.settings.rate), False
    tell(0.1)
    both = BothTargets(planner.arms, (left, right))
    return _refined(limits, both, apart, (slow, fastest), starts, request, others), True


def _refined(
    limits: MotionLimits,
    targets: PathCost,
    apart: Collisions | None,
    times: tuple[Array, Array],
    starts: list[Array],
    request: PlanRequest,
    others: Callable[[], list[Array]] = list,
) -> Timed:
    """Optimize the best of some starts and time it; where it collides, of others, too, then with more tolerance."""
    (slow, fastest), settings = times, request.settings
    terms = coarse_terms(limits, apart, smoothness_share(slow), request.planning_effort)
    begun: list[Array] = []
    for relaxation, more in _tries(starts, others):
        begun += [optimize(targets, slow, q, terms, POSITION_WEIGHTS[0]) for q in more]
        best = min(begun, key=lambda q: TrajectoryCost(targets.arm, targets, slow, terms).evaluate(q)[0])
        tolerance = relaxation * settings.position_tolerance
        q, _ = optimize_to_tolerance(targets, slow, best, terms, tolerance)
        _, timed = time_parameterized(
            limits, apart, targets, fastest, q, tolerance, settings.rate, request.planning_effort
        )
        if apart is None or not apart.collides(timed.positions).any():
            break
    return timed


def _tries(starts: list[Array], others: Callable[[], list[Array]]) -> Iterator[tuple[float, list[Array]]]:
    """Factors of the position tolerance and further starts, in turn, until nothing collides."""
    yield 1.0, starts
    if more := others():
        yield 1.0, more
    for relaxation in (3.0, np.inf):
        yield relaxation, []


def _starts(planner: ArmsPlanner, courses: list[Array]) -> list[Array]:
    """Postures of both as each arm has them by itself; shared joints amid both, as the left has them, or the right."""
    arms = planner.arms
    q = np.empty((len(courses[0]), arms.dof))
    for course, columns in zip(courses, arms.columns, strict=True):
        q[:, columns] = course
    if not arms.shared:
        return [q]
    shared = np.intersect1d(arms.columns[0], arms.columns[1])
    of_left, of_right = (
        course[:, [int(np.flatnonzero(columns == i)[0]) for i in shared]]
        for course, columns in zip(courses, arms.columns, strict=True)
    )
    found = []
    for share in (0.5, 1.0, 0.0):
        found.append(q.copy())
        found[-1][:, shared] = share * of_left + (1.0 - share) * of_right
    return found


def parted(
    planner: ArmsPlanner, each: Sequence[Targets], time: Array, courses: Sequence[Array], random: np.random.Generator
) -> list[Array]:
    """Motions of both (n, dof) in which one arm makes way for the other, and then the other for it."""
    found = []
    for first in (1, 0):
        ways = list(courses)
        for side in (first, 1 - first):
            ways[side] = _beside(planner, side, each[side], time, ways[1 - side], random)
        found.append(planner.arms.joined(*ways))
    return found


def _beside(
    planner: ArmsPlanner, side: int, targets: Targets, time: Array, other: Array, random: np.random.Generator
) -> Array:
    """The best way of an arm through nodes, each of which costs by how near it is to the other arm at that moment."""
    own, columns, apart = planner.each[side], planner.arms.columns, planner.collisions
    assert apart is not None
    rows = stages_of(time, 0.55)
    nodes = own.reachability_map.nodes(targets[rows], 150, random)
    both = np.empty((len(nodes.q), planner.arms.dof))
    both[:, columns[side]] = nodes.q
    both[:, columns[1 - side]] = np.repeat(other[rows], np.diff(nodes.first), axis=0)
    cost = nodes.cost.copy()
    near, distance, _ = apart.between.gradient(both, CLEARANCE)
    np.add.at(cost, near, (CLEARANCE_WEIGHT * (CLEARANCE - distance)) ** 2)
    if own.collisions is not None:
        cost += 1e4 * own.collisions.collides(nodes.q)
    nodes = replace(nodes, cost=cost)
    way = nodes.q[
        shortest_path(nodes, time[rows], own.largest_changes(time[rows]), smoothness_share(time) * JOINT_MOTION_WEIGHT)
    ]
    return interpolated(time[rows], way, time)
