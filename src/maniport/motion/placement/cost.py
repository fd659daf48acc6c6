"""Cost of placements with trajectories of the arms there, of many of them at once."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from maniport.arms import EllipsoidSpec
from maniport.motion.configurations import Configurations
from maniport.motion.costs.capability import CapabilityCost
from maniport.motion.costs.cost import NormalEquations
from maniport.motion.costs.ellipsoid import EllipsoidCost
from maniport.motion.costs.position import PositionCost
from maniport.motion.costs.smoothness import SmoothnessCost
from maniport.motion.demands import EXCESS_WEIGHT, regularized_inverses
from maniport.motion.directions import DirectionTarget
from maniport.motion.kernels import add_log_residual, add_residual
from maniport.motion.placement.placement import SCALE, ArmPath, PlacementProblem
from maniport.motion.plan.optimizer import (
    TrajectoryTerms,
    add_clearance_cost,
    blocked_joints,
    solve_banded,
    time_weights,
)
from maniport.motion.search import LARGEST_DAMPING, LEAST_GAIN
from maniport.motion.trajectory import interpolated
from maniport.spd.kernels import congruence
from maniport.util.validation import Array


@dataclass(frozen=True)
class PlacedMotions:
    """Placements with trajectories of the arms there, and their costs."""

    time: Array  # (n,), of the waypoints [s]
    places: Array  # (b, 7)
    q: tuple[Array, ...]  # (b, n, dof) of each arm
    cost: Array  # (b,), nan before they are known

    def only(self, rows: NDArray[np.intp]) -> "PlacedMotions":
        """Return some of them."""
        trajectories = tuple(q[rows] for q in self.q)
        return PlacedMotions(self.time, self.places[rows], trajectories, self.cost[rows])

    def at_waypoints(self, time: Array) -> "PlacedMotions":
        """Return the trajectories at other times (m,)."""
        if len(time) == len(self.time):
            return self
        trajectories = []
        for q in self.q:
            joints_last = np.moveaxis(q, 1, 0)
            at = interpolated(self.time, joints_last.reshape(len(self.time), -1), time)
            trajectories.append(np.moveaxis(at.reshape(len(time), *joints_last.shape[1:]), 0, 1))
        return replace(self, time=time, q=tuple(trajectories))


@dataclass(frozen=True)
class ArmEquations:
    """Normal equations of the trajectories of an arm."""

    gradient: Array  # g, (b, n, dof)
    hessian: Array  # blocks of A, (b, n, dof, dof)
    band: Array  # diagonals of A that couple waypoints, (b, 4, n, dof)
    coupling: Array  # B, (b, n, dof, k)


@dataclass(frozen=True)
class PlacementEquations:
    """Costs and normal equations of placements with trajectories; k components of a placement are free."""

    cost: Array  # (b,)
    arms: tuple[ArmEquations, ...]
    gradient: Array  # h, (b, k)
    hessian: Array  # C, (b, k, k)

    def only(self, rows: NDArray[np.intp]) -> "PlacementEquations":
        """Return those of some placements."""
        arms = []
        for arm in self.arms:
            arms.append(
                ArmEquations(
                    arm.gradient[rows], arm.hessian[rows], arm.band[rows], arm.coupling[rows]
                )
            )
        return PlacementEquations(
            self.cost[rows], tuple(arms), self.gradient[rows], self.hessian[rows]
        )


class PlacementCost:
    """Cost of placements with trajectories, on the time scale and with the smoothness of `terms`.

    With `avoiding`, links that are nearer than the clearance cost as in the planner.
    """

    def __init__(
        self,
        problem: PlacementProblem,
        terms: TrajectoryTerms,
        position_weight: float,
        *,
        avoiding: bool,
    ):
        self.problem = problem
        self.terms = terms
        self.avoiding = avoiding
        self.weights = np.ones(1)
        if len(problem.time) > 1:
            self.weights = time_weights(problem.time)
        self.costs = [ArmPlacementCost(arm, position_weight, problem.free) for arm in problem.arms]
        self.smoothness = []
        for arm in problem.arms:
            factors = (terms.velocity_cost, terms.jerk_cost)
            limits = (arm.velocity, np.inf)
            self.smoothness.append(SmoothnessCost(problem.time, factors, limits))

    def evaluate(self, motions: PlacedMotions) -> PlacementEquations:
        """Return costs and normal equations."""
        count = len(motions.places)
        free = int(self.problem.free.sum())
        total = np.zeros(count)
        gradient = np.zeros((count, free))
        hessian = np.zeros((count, free, free))
        weights = self.weights[:, None]
        arms = []
        for arm, cost, smoothness, q in zip(
            self.problem.arms, self.costs, self.smoothness, motions.q, strict=True
        ):
            dof = q.shape[2]
            equations = cost.normal_equations(motions.places, q)
            square = equations.distance**2
            of_joints = np.ascontiguousarray(equations.gradient[:, :dof])
            blocks = np.ascontiguousarray(equations.hessian[:, :dof, :dof])
            if self.avoiding and arm.reachability_map.collisions is not None:
                flat = q.reshape(-1, dof)
                collisions = arm.reachability_map.collisions
                add_clearance_cost(collisions, flat, square, of_joints, blocks)
            shape = q.shape[:2]
            total += square.reshape(shape) @ self.weights
            of_joints = weights * of_joints.reshape(*shape, dof)
            blocks = weights[..., None] * blocks.reshape(*shape, dof, dof)
            band = np.zeros((min(4, shape[1]), shape[1], count, dof))
            along = np.ascontiguousarray(np.swapaxes(of_joints, 0, 1))
            total += smoothness.add(np.swapaxes(q, 0, 1), 0.0, along, band)
            slopes = equations.gradient[:, dof:].reshape(*shape, free)
            border = equations.hessian[:, :, dof:].reshape(*shape, dof + free, free)
            gradient += np.einsum("n,bnk->bk", self.weights, slopes)
            hessian += np.einsum("n,bnkm->bkm", self.weights, border[:, :, dof:])
            arms.append(
                ArmEquations(
                    gradient=np.swapaxes(along, 0, 1),
                    hessian=blocks,
                    band=np.moveaxis(band, 2, 0),
                    coupling=weights[..., None] * border[:, :, :dof],
                )
            )
        return PlacementEquations(total, tuple(arms), gradient, hessian)

    def trial(
        self, motions: PlacedMotions, equations: PlacementEquations, damping: Array
    ) -> tuple[PlacedMotions, Array]:
        """Return motions after steps with a damping (b,), within the limits, and expected decreases of the cost."""
        free = self.problem.free
        inner = equations.hessian.copy()
        pull = equations.gradient.copy()
        solutions = []
        added = []
        scale = damping[:, None, None]
        for arm, of_arm, q in zip(self.problem.arms, equations.arms, motions.q, strict=True):
            diagonal = np.einsum("bnii->bni", of_arm.hessian) + of_arm.band[:, 0]
            damped = scale * diagonal
            sides = np.concatenate([of_arm.gradient[..., None], of_arm.coupling], axis=3)
            blocked = blocked_joints(arm.arm, q, of_arm.gradient)
            solution = np.empty_like(sides)
            for i in range(len(sides)):
                solution[i] = solve_banded(
                    sides[i], of_arm.hessian[i], of_arm.band[i], blocked[i], damped[i]
                )
            inner -= np.einsum("bnim,bnik->bmk", of_arm.coupling, solution[..., 1:])
            pull -= np.einsum("bni,bnim->bm", solution[..., 0], of_arm.coupling)
            solutions.append(solution)
            added.append(damped)

        at = motions.places[:, free]
        lower = self.problem.lower[free]
        upper = self.problem.upper[free]
        weight = np.einsum("bkk->bk", equations.hessian)
        outward = ((at <= lower) & (equations.gradient > 0.0)) | (
            (at >= upper) & (equations.gradient < 0.0)
        )
        loose = ~(outward | (weight <= 0.0))
        # path and arm may turn together at no cost
        diagonal = np.where(loose, (damping[:, None] + 1e-9) * weight, 1.0)
        inner *= loose[:, :, None] & loose[:, None, :]
        inner += diagonal[:, :, None] * np.eye(inner.shape[1])
        step = -np.linalg.solve(inner, np.where(loose, pull, 0.0)[..., None])[..., 0]

        places = motions.places.copy()
        places[:, free] = np.clip(at + step, lower, upper)
        places, _ = self.problem.within(places)
        expected = np.sum(step * (damping[:, None] * weight * step - equations.gradient), axis=1)
        trajectories = []
        for arm, of_arm, q, solution, damped in zip(
            self.problem.arms, equations.arms, motions.q, solutions, added, strict=True
        ):
            change = -(solution[..., 0] + np.einsum("bnik,bk->bni", solution[..., 1:], step))
            expected += np.sum(change * (damped * change - of_arm.gradient), axis=(1, 2))
            trajectories.append(np.clip(q + change, arm.arm.lower, arm.arm.upper))
        trial = replace(motions, places=places, q=tuple(trajectories))
        return trial, expected

    def improved(self, motions: PlacedMotions, steps: int) -> PlacedMotions:
        """Descend from all placements with their trajectories, at most so many steps; none gets worse."""
        places = motions.places.copy()
        trajectories = []
        for arm, q in zip(self.problem.arms, motions.q, strict=True):
            trajectories.append(np.clip(q, arm.arm.lower, arm.arm.upper))
        count = len(places)
        damping = np.full(count, 1e-3)
        growth = np.full(count, 2.0)
        active = np.arange(count)
        now = replace(motions, places=places, q=tuple(trajectories))
        equations = self.evaluate(now)
        cost = equations.cost.copy()
        for _ in range(steps):
            trial, expected = self.trial(now, equations, damping[active])
            trial_equations = self.evaluate(trial)
            with np.errstate(invalid="ignore"):
                gained = equations.cost - trial_equations.cost
            taken = (gained > LEAST_GAIN * expected) & (expected > 0.0)
            rows = active[taken]
            places[rows] = trial.places[taken]
            for q, of_trial in zip(trajectories, trial.q, strict=True):
                q[rows] = of_trial[taken]
            cost[rows] = trial_equations.cost[taken]
            ratio = np.minimum(gained[taken] / expected[taken], 1e3)
            damping[rows] *= np.maximum(1.0 / 3.0, 1.0 - (2.0 * ratio - 1.0) ** 3)
            growth[rows] = 2.0
            lost = active[~taken]
            damping[lost] *= growth[lost]
            growth[lost] *= 2.0

            change = np.where(taken, gained, expected)
            going_on = (change > self.terms.rel_tol * cost[active]) & (
                damping[active] < LARGEST_DAMPING
            )
            active = active[going_on]
            if not len(active):
                break
            now = PlacedMotions(
                motions.time, places[active], tuple(q[active] for q in trajectories), cost[active]
            )
            equations = joined_equations(equations, trial_equations, taken).only(
                np.flatnonzero(going_on)
            )
        return PlacedMotions(motions.time, places, tuple(trajectories), cost)

    def distances(self, motions: PlacedMotions) -> list[Array]:
        """Return affine-invariant distances (b, n) of each arm."""
        result = []
        for cost, q in zip(self.costs, motions.q, strict=True):
            result.append(cost.distance(motions.places, q))
        return result


def joined_equations(
    before: PlacementEquations, after: PlacementEquations, taken: NDArray[np.bool_]
) -> PlacementEquations:
    """Take the equations after a step where it was taken, those before it elsewhere."""

    def chosen(first: Array, second: Array) -> Array:
        return np.where(taken.reshape(-1, *[1] * (first.ndim - 1)), second, first)

    arms = []
    for first, second in zip(before.arms, after.arms, strict=True):
        arms.append(
            ArmEquations(
                gradient=chosen(first.gradient, second.gradient),
                hessian=chosen(first.hessian, second.hessian),
                band=chosen(first.band, second.band),
                coupling=chosen(first.coupling, second.coupling),
            )
        )
    return PlacementEquations(
        cost=chosen(before.cost, after.cost),
        arms=tuple(arms),
        gradient=chosen(before.gradient, after.gradient),
        hessian=chosen(before.hessian, after.hessian),
    )


class ArmPlacementCost:
    """Waypoint costs of an arm at placements; derivatives have the placement's free components last."""

    def __init__(self, arm: ArmPath, position_weight: float, free: NDArray[np.bool_]):
        self.arm = arm
        self.position_weight = position_weight
        self.free = free
        self.ellipsoid = EllipsoidCost.of(arm.target)

    def targets(self, places: Array) -> tuple[EllipsoidCost, PositionCost]:
        """Return the costs of targets at placements (b, 7), a row for each waypoint of each placement."""
        rotations = self.arm.rotations(places)[:, None]
        size = self.arm.target.spec.size
        ellipsoid = replace(
            self.ellipsoid,
            damped=congruence(rotations, self.ellipsoid.damped).reshape(-1, size, size),
            whitening=congruence(rotations, self.ellipsoid.whitening).reshape(-1, size, size),
        )
        positions = self.arm.positions(places).reshape(-1, 3)
        return ellipsoid, PositionCost(positions, self.position_weight)

    def at(self, q: Array) -> Configurations:
        """Return the configurations (b, n, dof) as rows."""
        flat = np.ascontiguousarray(q.reshape(-1, q.shape[2]))
        return Configurations(self.arm.arm, flat, np.tile(self.arm.target.time, len(q)))

    def distance(self, places: Array, q: Array) -> Array:
        """Return affine-invariant distances, shape (b, n)."""
        ellipsoid, _ = self.targets(places)
        return ellipsoid.distance(self.at(q)).reshape(q.shape[:2])

    def normal_equations(self, places: Array, q: Array) -> NormalEquations:
        """Return sums over the costs of configurations q (b, n, dof), with b · n rows."""
        waypoints = q.shape[1]
        ellipsoid, position = self.targets(places)
        at = self.at(q)
        spectrum = ellipsoid.spectrum(at, with_changes=True)
        shifts, generators, turns = self.arm.derivatives(places, self.free)
        generators = np.repeat(generators, waypoints, axis=0)

        # rotating the target one way changes as much as rotating the achieved ellipsoid the other way
        achieved = spectrum.achieved[:, None]
        turned = achieved @ generators - generators @ achieved
        changes = np.concatenate([spectrum.changes, turned], axis=1)
        shifts = shifts.reshape(len(at), *shifts.shape[2:])
        position_changes = self.position_weight * np.concatenate(
            [at.jacobians[:, :3], -shifts], axis=2
        )

        equations = NormalEquations.zeros(len(at), changes.shape[1])
        sums = (equations.square, equations.gradient, equations.hessian)
        if self.arm.target.with_ellipsoids:
            add_log_residual(spectrum.values, spectrum.vectors, ellipsoid.whitening, changes, *sums)
            equations.ellipsoid_square[spectrum.singular] = np.inf
        for direction in self.arm.directions(places):
            _add_capability(at, direction, turns, equations)
        add_residual(position.residual(at), position_changes, *sums)
        for spec, vectors in self.arm.demands(places):
            self._add_excess(at, spec, vectors.reshape(-1, 3), turns, equations)
        return equations

    def _add_excess(
        self,
        at: Configurations,
        spec: EllipsoidSpec,
        vectors: Array,
        turns: Array,
        equations: NormalEquations,
    ) -> None:
        """Add the cost of vectors (b · n, 3) that exceed ellipsoids; `turns` generate rotations (b, k, 3, 3)."""
        changes = at.ellipsoid_derivatives(spec)
        ellipsoids = at.ellipsoids(spec)
        needed = (regularized_inverses(ellipsoids) @ vectors[..., None])[..., 0]
        share = np.sqrt(np.maximum(np.sum(vectors * needed, axis=1), 1e-12))
        excess = EXCESS_WEIGHT * np.maximum(share - 1.0, 0.0)
        turns = np.repeat(turns, len(at) // len(turns), axis=0)
        of_joints = -0.5 * np.einsum("ni,nkij,nj->nk", needed, changes, needed)
        of_place = np.einsum("ni,nkij,nj->nk", needed, turns, vectors)
        if self.free[SCALE]:  # the first of the free components
            of_place[:, 0] = share**2
        slopes = np.concatenate([of_joints, of_place], axis=1)
        slopes *= EXCESS_WEIGHT * ((share > 1.0) / share)[:, None]
        sums = (equations.square, equations.gradient, equations.hessian)
        add_residual(excess[:, None], slopes[:, None], *sums)


def _add_capability(
    at: Configurations, direction: DirectionTarget, turns: Array, equations: NormalEquations
) -> None:
    """Add the cost of too little force or speed along lines; `turns` generate rotations (b, k, 3, 3)."""
    residuals = CapabilityCost(direction).residuals(at)
    of_place = np.zeros((*residuals.residual.shape, turns.shape[1]))
    if direction.follows_path:
        each = np.repeat(turns, len(at) // len(turns), axis=0)
        changes = np.einsum("nkxy,nly->nlkx", each, direction.lines)
        of_place = np.einsum("nlkx,nlx->nlk", changes, residuals.line_changes)
    slopes = np.concatenate([residuals.joint_changes, of_place], axis=2)
    sums = (equations.square, equations.gradient, equations.hessian)
    add_residual(residuals.residual, slopes, *sums)
