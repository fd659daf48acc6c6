"""Joint positions along a whole path: the best way through what the arm can do, then all points at once."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from maniport.bodies import Arm, EllipsoidSpec
from maniport.bodies.collisions import Collisions, as_collisions
from maniport.steps import Part, nobody
from maniport.subsample import evenly_spaced
from maniport.tracking.arm_model import require_trackable
from maniport.tracking.effort import EFFORTS, FULL, Detail, Effort
from maniport.tracking.fitting import require_alike
from maniport.tracking.motion_limits import MotionLimits
from maniport.tracking.objective import Targets
from maniport.tracking.plan.atlas import Atlas
from maniport.tracking.plan.in_place import turned_about
from maniport.tracking.plan.nodes import Nodes
from maniport.tracking.plan.pace import SHARE_OF_SPEED, near_enough
from maniport.tracking.plan.refinement import Asked, Smoothness, motion_cost, refine
from maniport.tracking.plan.shortest_path import TRAVEL, shortest_path
from maniport.tracking.search.descent import postures_along
from maniport.tracking.search.start_bank import StartBank
from maniport.validation import Array, as_generator

SLOW = Smoothness(0.12, 4e-3)
"""Of motions that are planned in slow time."""
LARGEST_CHANGE = {"rad": 0.6, "m": 0.2}
"""Between stages, of joints that turn and that slide."""
QUICKEST = {"rad": 1.6, "m": 0.5}
"""Largest speeds in slow time: a posture that is exchanged for another one shall not be a leap [1/s]."""
ROUGH_WEIGHTS = (30.0, 200.0)
TRACKED_STARTS, TRACKED_STAGES = 6, 100
KEPT = 4
"""Of the motions that were found with other detail, the best that are refined, too."""


@dataclass(frozen=True)
class Sketch:
    """Motions through the stages of a path.

    Attributes
    ----------
    detail : Detail
    rows : ndarray of int, shape (stages,)
        Which of the path's points are stages.
    time : ndarray, shape (stages,)
        Slow time [s].
    nodes : Nodes
    found : list of ndarray, shape (stages, dof)
        The best first.
    """

    detail: Detail
    rows: NDArray[np.intp]
    time: Array
    nodes: Nodes
    found: list[Array]


@dataclass(frozen=True)
class Planner:
    """An arm, within limits and apart from obstacles, that plans motions.

    Attributes
    ----------
    limits : MotionLimits
    atlas : Atlas
        Of ``limits.arm``.
    bank : StartBank
    collisions : Collisions, optional
        What is kept apart.

    See Also
    --------
    plan_motion : the same for a single motion.
    """

    limits: MotionLimits
    atlas: Atlas
    bank: StartBank
    collisions: Collisions | None = None

    @classmethod
    def of(
        cls, limits: MotionLimits, spec: EllipsoidSpec, collisions: Collisions | bool, random_state: Any
    ) -> "Planner":
        """Sample the arm that the limits leave; ``collisions=True`` keeps it apart from itself.

        Raises
        ------
        InvalidInputError
            When the arm has too few joints, or coupled ones.
        """
        require_trackable(limits.arm, spec)
        generator, apart = as_generator(random_state), as_collisions(collisions, limits.arm)
        atlas = Atlas(limits.arm, spec, random_state=generator, collisions=apart)
        return cls(limits, atlas, StartBank.build(limits.arm, random_state=generator, spec=spec), apart)

    def require_fits(self, arm: Arm, spec: EllipsoidSpec) -> None:
        """Raise InvalidInputError unless this plans for an arm like `arm`, within limits of its own, and `spec`."""
        require_alike("the planner was made for", (self.limits.arm, arm), (self.atlas.spec, spec), limits=False)

    def within(self, targets: Targets) -> Targets:
        """The same targets, for the arm that keeps the margin of its limits."""
        return replace(targets, objective=replace(targets.objective, arm=self.limits.arm))

    def stages(self, time: Array, most: float) -> NDArray[np.intp]:
        """Rows of points that are no farther apart than `most` [s] where the points allow, first and last included."""
        rows, last = [0], len(time) - 1
        for i in range(1, last + 1):
            if i == last or time[i + 1] - time[rows[-1]] > most:
                rows.append(i)
        return np.array(rows)

    def largest_changes(self, time: Array) -> Array:
        """How much joints may change on the way to each of the stages at `time`, shape (stages, dof)."""
        gaps = np.diff(time, prepend=time[0] - 1.0)[:, None]
        largest = np.array([LARGEST_CHANGE[unit] for unit in self.limits.arm.joint_units])
        return np.asarray(np.minimum(SHARE_OF_SPEED * self.limits.velocity * gaps, largest))

    def sketch(
        self,
        targets: Targets,
        time: Array,
        detail: Detail,
        random: np.random.Generator,
        before: Sketch | None = None,
        tell: Part = nobody,
        effort: Effort = EFFORTS[FULL],
    ) -> Sketch:
        """Find joint positions at some stages of a path.

        Shortest paths through the nodes and the one that goes from each posture to the best next to it are refined;
        then a shortest path through the nodes and all of these, which changes from one to the other where that is
        better.

        Parameters
        ----------
        targets : Targets
        time : ndarray, shape (n,)
            Slow time [s].
        detail : Detail
        random : numpy.random.Generator
        before : Sketch, optional
            What was found with other detail: its motions are refined, too.
        tell : callable
            Called with the fraction done of the sketch and what is made of it.
        effort : Effort
        """
        rows = self.stages(time, detail.stage)
        targets, time = targets[rows], time[rows]
        if before is not None and np.array_equal(rows, before.rows):
            nodes = before.nodes
        else:
            count = int(np.clip(np.sqrt(effort.pairs / len(rows)), effort.nodes, effort.most_nodes))
            nodes = self._nodes(targets, count, random)
            if self.collisions is not None:
                nodes = nodes.without(self.collisions.collides(nodes.q))
        tell(0.6)
        largest = self.largest_changes(time)
        anywhere = np.full_like(largest, np.inf)
        bars, starts = [largest], []
        if effort.rivals:
            earlier = self._tracked(targets, time) if before is None else (before.time, before.found[:KEPT])
            bars, starts = [largest, anywhere], [joints_between(earlier[0], q, time) for q in earlier[1]]
        posed = targets.weighing(ROUGH_WEIGHTS[-1])
        asked, travel = self._slowly(detail, effort), TRAVEL * detail.share
        # what leaps between sparse nodes may well be joined by the refinement: with and without a bar against leaps
        ways = [nodes.q[shortest_path(nodes, time, most, travel)] for most in bars]
        weights = ROUGH_WEIGHTS[: effort.weights]
        found = [refine(targets, time, q, asked, weights) for q in (*starts, *ways)]
        tell(0.8)
        if effort.rivals:
            every = nodes
            for q in found:
                every = every.joined(q, posed.cost(q))
            joined = every.q[shortest_path(every, time, anywhere, travel)]
            found.append(refine(targets, time, joined, asked, ROUGH_WEIGHTS))
        found.sort(key=lambda q: motion_cost(posed, time, q, asked))
        return Sketch(detail, rows, time, nodes, found)

    def _tracked(self, targets: Targets, time: Array) -> tuple[Array, list[Array]]:
        """The motion that goes from each posture to the best next to it, at some of the times."""
        rows = evenly_spaced(len(targets), TRACKED_STAGES)
        return time[rows], [postures_along(targets[rows], self.bank.starts_for(targets[:1], TRACKED_STARTS))[0][0]]

    def _slowly(self, detail: Detail, effort: Effort) -> Asked:
        """What is asked of motions in slow time."""
        quickest = detail.quicker * np.array([QUICKEST[unit] for unit in self.limits.arm.joint_units])
        most = np.minimum(SHARE_OF_SPEED * self.limits.velocity, quickest)
        return Asked(SLOW.times(detail.share), velocity=most, collisions=self.collisions, enough=effort.enough)

    def _nodes(self, targets: Targets, count: int, random: np.random.Generator) -> Nodes:
        """Postures with the tip in place, or, without a path, with the most similar ellipsoids."""
        if targets.positions is not None:
            return self.atlas.nodes(targets, count, random)
        q = self.bank.starts_for(targets, count)
        q[..., self.atlas.idle] = (0.5 * (self.limits.lower + self.limits.upper))[self.atlas.idle]
        flat, owner = q.reshape(-1, q.shape[-1]), np.repeat(np.arange(len(q)), q.shape[1])
        flat = turned_about(targets[owner], flat) if targets.turned else flat
        return Nodes(flat, targets[owner].cost(flat), np.arange(len(q) + 1) * q.shape[1])

    def finished(
        self, targets: Targets, time: Array, sketch: Sketch, tolerance: float, effort: Effort = EFFORTS[FULL]
    ) -> Array:
        """Joint positions at all points of a path (n, dof), from the best motion of a sketch.

        Parameters
        ----------
        targets : Targets
        time : ndarray, shape (n,)
            Slow time [s].
        sketch : Sketch
        tolerance : float
            How far beside its path the tip may be at 95 % of the points [m]; the least weight on the path is taken that
            keeps it.
        """
        start = joints_between(sketch.time, sketch.found[0], time)
        return near_enough(targets, time, start, self._slowly(sketch.detail, effort), tolerance).q

    def motion(self, targets: Targets, time: Array, tolerance: float, random: np.random.Generator) -> Array:
        """What is made of a first sketch."""
        return self.finished(targets, time, self.sketch(targets, time, EFFORTS[FULL].first, random), tolerance)


def joints_between(known: Array, q: Array, time: Array) -> Array:
    """Joint positions at times between those that are known."""
    return np.stack([np.interp(time, known, column) for column in q.T], axis=1)
