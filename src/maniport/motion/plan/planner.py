"""The planner in five steps: reachability map, roadmap, graph search, optimizer, time parameterization."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d

from maniport.arms import Arm, EllipsoidSpec
from maniport.arms.collisions import Collisions, as_collisions
from maniport.motion.arm_model import require_alike, require_trackable
from maniport.motion.effort import Effort
from maniport.motion.motion_limits import MotionLimits
from maniport.motion.objective import Targets
from maniport.motion.plan.optimizer import (
    CLEARANCE,
    POSITION_WEIGHTS,
    TrajectoryTerms,
    optimize,
    optimize_to_tolerance,
    time_weights,
)
from maniport.motion.plan.reachability_map import ReachabilityMap
from maniport.motion.plan.roadmap import JOINT_MOTION_WEIGHT, Roadmap, shortest_path, turned_to_rotations
from maniport.motion.plan.time_parameterization import Timed, retime
from maniport.motion.search.descent import PathCost
from maniport.motion.search.seed_bank import SeedBank
from maniport.util.validation import Array, as_generator

PLANNING_TIME_SCALE = 4.0
"""Trajectories are planned as if they took so many times the demonstrated time; time parameterization comes last."""
COARSE_TOLERANCE = 1e-3  # Smallest position tolerance before the time parameterization [m]
SMOOTHNESS = 0.04  # Factor of the smoothness costs for a demonstration of 1 s; see `smoothness_share`
FAR = 3.0  # Position errors of so many times the tolerance of the 95th percentile are large
SPEED_SHARE = 0.9  # Share of the limits of velocity and acceleration that the optimizer uses


@dataclass(frozen=True)
class Planner:
    """An arm with its limits, collision model and samples, for any number of plans.

    Attributes
    ----------
    limits : MotionLimits
    reachability_map : ReachabilityMap
        Reachability map of ``limits.arm``.
    bank : SeedBank
    collisions : Collisions, optional
    """

    limits: MotionLimits
    reachability_map: ReachabilityMap
    bank: SeedBank
    collisions: Collisions | None = None

    @classmethod
    def of(
        cls, limits: MotionLimits, spec: EllipsoidSpec, collisions: Collisions | bool, random_state: Any
    ) -> "Planner":
        """Sample the arm within its limits; ``collisions=True`` checks for self-collisions.

        Raises
        ------
        InvalidInputError
            When the arm has too few joints, or coupled ones.
        """
        require_trackable(limits.arm, spec)
        generator, model = as_generator(random_state), as_collisions(collisions, limits.arm)
        reachability_map = ReachabilityMap(limits.arm, spec, random_state=generator, collisions=model)
        return cls(limits, reachability_map, SeedBank.build(limits.arm, random_state=generator, spec=spec), model)

    def require_fits(self, arm: Arm, spec: EllipsoidSpec) -> None:
        """Raise InvalidInputError unless this plans for an arm like `arm`, within limits of its own, and `spec`."""
        require_alike(
            "the planner was made for", (self.limits.arm, arm), (self.reachability_map.spec, spec), limits=False
        )

    def plan(
        self,
        targets: Targets,
        time: Array,
        tolerance: float,
        planning_effort: Effort,
        random: np.random.Generator,
        progress: Callable[[float], None],
    ) -> Array:
        """Find joint positions at all waypoints (n, dof), at times (n,) on the planning time scale."""
        smoothness = smoothness_share(time)
        terms = coarse_terms(self.limits, self.collisions, smoothness, planning_effort)
        stages = stages_of(time, planning_effort.stage)
        # short paths get more nodes: of a UR5's motion of 10 s the distance is 14 % less with 700 than with 300
        more = float(np.clip(150.0 / len(stages), 1.0, 2.4))
        nodes = self.roadmap(targets[stages], int(more * planning_effort.nodes), random)
        progress(0.4)
        weight, largest = smoothness * JOINT_MOTION_WEIGHT, self.largest_changes(time[stages])
        q = nodes.q[shortest_path(nodes, time[stages], largest, weight)]
        progress(0.6)
        q = optimize(targets[stages], time[stages], q, terms, POSITION_WEIGHTS[0])
        q = interpolated(time[stages], q, time)
        return optimize_to_tolerance(targets, time, q, terms, max(tolerance, COARSE_TOLERANCE))[0]

    def roadmap(self, targets: Targets, count: int, random: np.random.Generator) -> Roadmap:
        """Make nodes on the path, or, without one, with similar ellipsoids; collision-free where possible."""
        if targets.positions is not None:
            nodes = self.reachability_map.nodes(targets, count, random)
        else:
            q = self.bank.starts_for(targets, count)
            q[..., self.reachability_map.idle] = (0.5 * (self.limits.lower + self.limits.upper))[
                self.reachability_map.idle
            ]
            owner, first = np.repeat(np.arange(len(q)), q.shape[1]), np.arange(len(q) + 1) * q.shape[1]
            q = q.reshape(-1, q.shape[-1])
            q = turned_to_rotations(targets[owner], q) if targets.turned else q
            nodes = Roadmap(q, targets[owner].cost(q), first)
        return nodes if self.collisions is None else nodes.without(self.collisions.collides(nodes.q))

    def largest_changes(self, time: Array) -> Array:
        """Largest joint changes from stage to stage at `time`, shape (stages, dof); larger ones are jumps."""
        gaps = np.diff(time, prepend=time[0] - 1.0)[:, None]
        largest = np.array([{"rad": 0.6, "m": 0.2}[unit] for unit in self.limits.arm.joint_units])
        return np.asarray(np.minimum(SPEED_SHARE * self.limits.velocity * gaps, largest))


def smoothness_share(time: Array) -> float:
    """Factor of the smoothness costs for times (n,) on the planning time scale.

    Less smoothness is more accurate, but the limits then slow the trajectory down: by about the same share, which is
    more seconds for a long recording. The factor grows with the root of the demonstrated duration.
    """
    return SMOOTHNESS * float(np.sqrt((time[-1] - time[0]) / PLANNING_TIME_SCALE))


def coarse_terms(
    limits: MotionLimits, collisions: Collisions | None, smoothness: float, planning_effort: Effort
) -> TrajectoryTerms:
    """Cost of a trajectory on the planning time scale."""
    return TrajectoryTerms(
        smoothness * 0.12,
        smoothness * 4e-3,
        velocity=SPEED_SHARE * limits.velocity,
        collisions=collisions,
        rel_tol=planning_effort.rel_tol,
    )


def stages_of(time: Array, longest: float) -> NDArray[np.intp]:
    """Rows of waypoints at most `longest` [s] apart where the waypoints allow, the first and last included."""
    rows, last = [0], len(time) - 1
    for i in range(1, last + 1):
        if i == last or time[i + 1] - time[rows[-1]] > longest:
            rows.append(i)
    return np.array(rows)


def interpolated(known: Array, q: Array, time: Array) -> Array:
    """Joint positions at times (n,), linear between those at known times (m,)."""
    return np.stack([np.interp(time, known, column) for column in q.T], axis=1)


def time_parameterized(
    limits: MotionLimits,
    collisions: Collisions | None,
    targets: PathCost,
    time: Array,
    q: Array,
    tolerance: float,
    rate: float,
    planning_effort: Effort,
) -> tuple[Array, Timed]:
    """Time a trajectory, optimize it with the smoothness that its time demands, and time it again.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Earliest times of the waypoints [s].
    tolerance : float
        Of the 95th percentile of the position error [m].
    """
    at = retime(limits, time, q, rate=rate).at
    terms = TrajectoryTerms(
        3e-3,
        1e-6,
        time_weights(time) * (at[-1] - at[0]) / (time[-1] - time[0]),
        SPEED_SHARE * limits.velocity,
        SPEED_SHARE * limits.acceleration,
        collisions,
        planning_effort.rel_tol,
    )
    q, weight = optimize_to_tolerance(targets, at, q, terms, tolerance)
    timed = retime(limits, time, q, rate=rate)
    other = relaxed(targets, at, q, terms, weight, tolerance) if planning_effort.relaxation else q
    if other is q:
        return q, timed
    other_timed = retime(limits, time, other, rate=rate)
    if colliding_share(collisions, other_timed) > colliding_share(collisions, timed):
        return q, timed
    return other, other_timed


def colliding_share(collisions: Collisions | None, timed: Timed) -> float:
    """Share of the samples that collide."""
    return 0.0 if collisions is None else float(collisions.collides(timed.positions).mean())


def relaxed(
    targets: PathCost,
    time: Array,
    q: Array,
    terms: TrajectoryTerms,
    weight: float,
    tolerance: float,
    rounds: int = 6,
) -> Array:
    """Optimize again with half the clearance and 1.5 times the duration around large errors, as long as that helps.

    The position has priority: where a path leads through a narrow passage, or from one branch of configurations to
    another, clearance and duration alone cause large position errors. Those above `FAR` tolerances count.
    """
    clearance = np.full(len(time), CLEARANCE)
    error = _largest_error(targets, q)
    for _ in range(rounds):
        far = maximum_filter1d(error > FAR * tolerance, 5)
        if not far.any():
            break
        clearance = np.where(far, np.maximum(0.5 * clearance, 0.003), clearance)
        time = np.append(time[0], time[0] + np.cumsum(np.where(far[1:] & far[:-1], 1.5, 1.0) * np.diff(time)))
        # few waypoints are a small share of the cost
        changed = replace(terms, clearance=clearance, rel_tol=0.1 * terms.rel_tol)
        trial = optimize(targets, time, q, changed, weight)
        trial_error = _largest_error(targets, trial)
        if terms.collisions is not None and terms.collisions.collides(trial[far]).any():
            break
        if trial_error[far].max() > 0.95 * error[far].max():
            break
        q, error = trial, trial_error
    return q


def _largest_error(targets: PathCost, q: Array) -> Array:
    """Largest position error of all arms (n,) [m]; zero without a path."""
    error = targets.tip_error(q)
    return np.zeros(len(q)) if error is None else error.reshape(len(q), -1).max(axis=1)
