"""Placement search: placements are compared by samples, then by planned trajectories, and improved together with them.

The improvement is a banded Gauss-Newton descent over trajectory q and placement p. Rotating the path equals rotating
the arm the other way, so the components of p act like joints. With several arms, each has its own q, and the costs
are summed. The normal equations

    [A  B] [q]     [g]
    [Bᵀ C] [p] = − [h],

are solved for the placement first, (C − Bᵀ A⁻¹ B) p = Bᵀ A⁻¹ g − h, where A is banded.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from operator import attrgetter
from typing import Any

import numpy as np

from maniport.arms import EllipsoidSpec
from maniport.errors import InvalidInputError
from maniport.motion.configurations import Configurations
from maniport.motion.costs.cost import NormalEquations
from maniport.motion.demands import EXCESS_WEIGHT, inverses
from maniport.motion.kernels import add_log_residual, add_residual
from maniport.motion.placement.placement import SCALE, SIZE, TILT, ArmPath, PlacementProblem
from maniport.motion.plan.optimizer import (
    TrajectoryCost,
    TrajectoryTerms,
    levenberg_marquardt,
    optimize,
    time_weights,
)
from maniport.motion.plan.plan_settings import SearchBudget
from maniport.motion.plan.roadmap import LARGEST_CHANGE, shortest_path
from maniport.spd.kernels import compose
from maniport.spd.matrix_functions import apply
from maniport.util.progress import Part, ignore_fraction
from maniport.util.sampling import sobol
from maniport.util.validation import Array

SAMPLES = 64  # Samples next to a waypoint that placements are compared by; with 16, force ellipsoids are 10 % farther
PLANNED = 4  # Placements for which trajectories are planned
SEPARATION = 0.1
"""Smallest mean distance of the paths at these placements [m]; without it, two seeds of six end 30 % worse."""
REFINED = (
    2  # Placements that are improved once more, without collisions, which takes most of the time
)
COARSE_TOLERANCE = (
    1e-3  # Smallest relative decrease of the cost for another step while collisions are ignored
)
FIRST_WEIGHT, WEIGHT = 30.0, 200.0
"""Weights of the position error, of a first trajectory and of the cost of a placement [1/m]."""

State = tuple[Array, tuple[Array, ...]]  # A placement (7,) and joint positions (n, dof) of each arm


@dataclass(frozen=True)
class PlannedPlacement:
    """A placement with trajectories of the arms there."""

    place: Array  # (7,)
    q: tuple[Array, ...]  # (n, dof) of each arm
    cost: float
    distance: tuple[Array, ...]  # (n,) of each arm


def best_placements(
    problem: PlacementProblem,
    seed: np.random.Generator,
    budget: SearchBudget,
    progress: Part = ignore_fraction,
) -> list[PlannedPlacement]:
    """Search the free components; return placements with planned trajectories, best first."""
    free = bool(problem.free.any())
    places = (
        _shortlist(problem, seed, budget.candidates)
        if free
        else problem.inside(problem.fixed[None])
    )
    if not len(places):
        raise InvalidInputError(
            "workspace: the path does not fit into it, at its smallest scale of "
            f"{np.exp(problem.lower[SCALE]):.3g} and whatever else is free"
        )
    coarse = problem.thinned(len(problem.time) if problem.arms[0].demanded else 64)
    time, duration, weights = coarse.time, 1.0, np.ones(1)
    if len(time) > 1:
        duration = time[-1] - time[0]
        weights = time_weights(time) / duration
    terms = TrajectoryTerms(
        0.06 / duration, 3e-4 / duration, weights, rel_tol=budget.rel_tol
    )  # means over time
    ignoring = PlacementTrajectoryCost(
        coarse, [replace(terms, rel_tol=COARSE_TOLERANCE)] * len(coarse.arms)
    )
    avoiding = PlacementTrajectoryCost(
        coarse, [replace(terms, collisions=arm.reachability_map.collisions) for arm in coarse.arms]
    )
    progress(0.3)
    states = [(place, _planned(coarse, place, ignoring.terms, budget, seed)) for place in places]
    if free:
        states = [ignoring.improved(state) for state in states]
    placements = sorted(map(avoiding.evaluated, states), key=attrgetter("cost"))
    progress(0.7)
    if free:
        best = [
            avoiding.evaluated(avoiding.improved((own.place, own.q)))
            for own in placements[:REFINED]
        ]
        placements = sorted(best + placements[REFINED:], key=attrgetter("cost"))
    progress(1.0)
    return placements


def _shortlist(problem: PlacementProblem, seed: np.random.Generator, count: int) -> Array:
    """Return the best random placements: of all at a few waypoints, then of some at more waypoints."""
    tilted = bool(problem.free[TILT])
    count *= 5 if tilted else 1
    lower, upper = problem.lower[:4], problem.upper[:4]
    unit = sobol(4, max(count - 1, 1).bit_length(), seed)[:count]
    reached = [arm.reachability_map.reach for arm in problem.arms]
    centers = np.mean(
        [reach[seed.choice(len(reach), count, replace=len(reach) < count)] for reach in reached],
        axis=0,
    )
    places = np.column_stack([lower + unit * (upper - lower), centers])
    if tilted:
        places[::5, TILT] = (
            0.0  # upright placements may fit into the workspace where tilted ones do not
        )
    places = problem.inside(np.where(problem.free, places, problem.fixed))
    if not len(places):
        return places
    coarse = problem.thinned(8)
    places = places[np.argsort(coarse.costs(places, SAMPLES), kind="stable")[:64]]
    paths = np.concatenate([arm.placed(places)[0] for arm in coarse.arms], axis=1)
    chosen: list[int] = []
    for i in np.argsort(problem.thinned(50).costs(places, SAMPLES), kind="stable"):
        distances = np.linalg.norm(paths[chosen] - paths[i], axis=2).mean(axis=1)
        if len(chosen) < PLANNED and np.all(distances >= SEPARATION):
            chosen.append(int(i))
    return np.asarray(places[chosen])


def _planned(
    problem: PlacementProblem,
    place: Array,
    terms: Sequence[TrajectoryTerms],
    budget: SearchBudget,
    seed: np.random.Generator,
) -> tuple[Array, ...]:
    """Plan a trajectory of each arm at a placement: roadmap, graph search, optimizer."""
    trajectories = []
    for arm, own in zip(problem.arms, terms, strict=True):
        placed = arm.problem(place)
        collisions = arm.reachability_map.collisions
        nodes = arm.reachability_map.nodes(placed, budget.placement_nodes, seed)
        if collisions is not None:
            nodes = nodes.without(collisions.collides(nodes.q))
        largest = np.array([LARGEST_CHANGE[unit] for unit in arm.arm.joint_units])
        path = shortest_path(nodes, problem.time, np.tile(largest, (len(placed), 1)))
        trajectories.append(optimize(placed, problem.time, nodes.q[path], own, FIRST_WEIGHT))
    return tuple(trajectories)


class PlacementTrajectoryCost:
    """Cost of a placement and the trajectories there; `terms` are of each arm."""

    def __init__(self, problem: PlacementProblem, terms: Sequence[TrajectoryTerms]):
        self.problem, self.terms = problem, terms
        self.waypoints = [MovingPathCost(arm) for arm in problem.arms]
        self.costs = [
            TrajectoryCost(arm.arm, waypoints, problem.time, own)
            for arm, waypoints, own in zip(problem.arms, self.waypoints, terms, strict=True)
        ]

    def improved(self, state: State) -> State:
        """Descend in the placement and the trajectories; neither gets worse."""
        place, trajectories = state
        start = (
            place,
            tuple(cost.within(q) for cost, q in zip(self.costs, trajectories, strict=True)),
        )
        improved: State = levenberg_marquardt(self, start, self.terms[0].rel_tol)
        return improved

    def evaluated(self, state: State) -> PlannedPlacement:
        """Return a placement with its cost and distances."""
        cost, _ = self.evaluate(state)
        parts = zip(self.waypoints, state[1], strict=True)
        return PlannedPlacement(
            *state, cost, tuple(waypoints.problem.distance(q) for waypoints, q in parts)
        )

    def evaluate(self, state: State) -> tuple[float, Any]:
        """Cost; slopes of the trajectory of each arm with its coupling B (n, dof, k), and h (k,) and C (k, k)."""
        (place, trajectories), free = state, self.problem.free
        total, arms, gradient, hessian = (
            0.0,
            [],
            np.zeros(free.sum()),
            np.zeros((free.sum(), free.sum())),
        )
        for waypoints, cost, q in zip(self.waypoints, self.costs, trajectories, strict=True):
            waypoints.move(place)
            value, slopes = cost.evaluate(q)
            weights, dof = cost.weights, q.shape[1]
            border = waypoints.hessian[:, :, dof:][:, :, free]
            total += value
            gradient += weights @ waypoints.gradient[:, dof:][:, free]
            hessian += np.tensordot(weights, border[:, dof:][:, free], 1)
            arms.append((*slopes, weights[:, None, None] * border[:, :dof]))
        return total, (arms, gradient, hessian)

    def trial(self, state: State, slopes: Any, damping: float) -> tuple[State, float]:
        """State after a damped step, within the limits, and the expected decrease of the cost."""
        (place, trajectories), free, (arms, gradient, hessian) = state, self.problem.free, slopes
        inner, pull, solutions = hessian, gradient, []
        for cost, q, (slope, blocks, band, coupling) in zip(
            self.costs, trajectories, arms, strict=True
        ):
            damped = damping * (np.einsum("nii->ni", blocks) + band[0])
            sides = np.concatenate([slope[..., None], coupling], axis=2)
            solution = cost.solve(sides, blocks, band, cost.blocked(q, slope), damped)
            inner = inner - np.tensordot(coupling, solution[..., 1:], ((0, 1), (0, 1)))
            pull = pull - np.tensordot(solution[..., 0], coupling, 2)
            solutions.append((solution, damped))
        at, lower, upper = place[free], self.problem.lower[free], self.problem.upper[free]
        weight = np.diag(hessian)
        loose = ~(
            ((at <= lower) & (gradient > 0.0))
            | ((at >= upper) & (gradient < 0.0))
            | (weight <= 0.0)
        )
        inner = inner + np.diag(
            (damping + 1e-9) * weight
        )  # path and arm may turn together at no cost
        step = np.zeros(len(at))
        step[loose] = -np.linalg.solve(inner[np.ix_(loose, loose)], pull[loose])
        moved = place.copy()
        moved[free] = np.clip(at + step, lower, upper)
        moved = self.problem.within(moved[None])[0][0]
        expected = float(step @ (damping * weight * step - gradient))
        trial = []
        for cost, q, (solution, damped), (slope, *_) in zip(
            self.costs, trajectories, solutions, arms, strict=True
        ):
            change = -(solution[..., 0] + solution[..., 1:] @ step)
            expected += float(np.sum(change * (damped * change - slope)))
            trial.append(cost.within(q + change))
        return (moved, tuple(trial)), expected


class MovingPathCost:
    """Waypoint cost of a path at a variable placement; its derivatives have the placement after the joints."""

    gradient: Array
    hessian: Array

    def __init__(self, arm: ArmPath):
        self.arm = arm

    def move(self, place: Array) -> None:
        """Move the path to a placement (7,)."""
        self.problem = self.arm.problem(place)
        self._roots = apply(self.problem.ellipsoid.damped, np.sqrt)
        self._shifts, self._generators, self._turns = self.arm.derivatives(place)
        self._demands = [(spec, vectors[0]) for spec, vectors in self.arm.demands(place[None])]

    def normal_equations(self, q: Array) -> NormalEquations:
        """As `ArmProblem.normal_equations`; all derivatives are kept in `gradient` and `hessian`."""
        problem = self.problem
        position = problem.position
        assert position is not None
        n, dof = q.shape
        count = dof + SIZE
        at = problem.at(q)
        values, vectors, singular, changes = problem.ellipsoid.spectrum(at, with_changes=True)

        achieved = self._roots @ compose(values, vectors) @ self._roots
        turned = achieved[:, None] @ self._generators - self._generators @ achieved[:, None]
        changes = np.concatenate([changes, turned], axis=1)
        error_slopes = position.weight * np.concatenate(
            [at.jacobians[:, :3], -self._shifts], axis=2
        )

        square = np.zeros(n)
        self.gradient = np.zeros((n, count))
        self.hessian = np.zeros((n, count, count))
        sums = (square, self.gradient, self.hessian)
        add_log_residual(values, vectors, problem.ellipsoid.whitening, changes, *sums)
        add_residual(position.residual(at), error_slopes, *sums)
        for spec, demanded in self._demands:
            self._add_excess(at, spec, demanded, square)
        return NormalEquations(
            ellipsoid_square=np.where(singular, np.inf, 0.0),
            square=square,
            gradient=self.gradient[:, :dof],
            hessian=self.hessian[:, :dof, :dof],
        )

    def _add_excess(
        self, at: Configurations, spec: EllipsoidSpec, vectors: Array, square: Array
    ) -> None:
        """Add the cost of vectors (n, 3) that exceed ellipsoids to `square` (n,), and its derivatives."""
        changes = at.ellipsoid_derivatives(spec)
        ellipsoids = at.ellipsoids(spec)
        needed = (inverses(ellipsoids) @ vectors[..., None])[..., 0]
        share = np.sqrt(np.maximum(np.sum(vectors * needed, axis=1), 1e-12))
        excess = EXCESS_WEIGHT * np.maximum(share - 1.0, 0.0)
        slopes = np.concatenate(
            [
                -0.5 * np.einsum("ni,nkij,nj->nk", needed, changes, needed),
                np.einsum("ni,kij,nj->nk", needed, self._turns, vectors),
            ],
            axis=1,
        )
        dof = at.joint_positions.shape[1]
        slopes[:, dof + SCALE] = share**2
        slopes *= EXCESS_WEIGHT * ((share > 1.0) / share)[:, None]
        add_residual(excess[:, None], slopes[:, None], square, self.gradient, self.hessian)
