"""Reachability map: samples of an arm by the positions of their end effector, and nodes of roadmaps made of them.

Many arms turn as a whole about the axis of their first joint: as q₁ changes by α, end effector and ellipsoid turn by α
about it. The samples of such an arm count for all these rotations, so that two coordinates instead of three separate
them: the distance from the axis and the position along it. Joints without effect, such as the last of a Panda, stay
in the middle of their range.
"""

from collections.abc import Sequence
from copy import deepcopy
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from maniport.arms import Arm, EllipsoidSpec
from maniport.arms.collisions import Collisions, as_collisions, free_configurations
from maniport.arms.directional import half_sphere
from maniport.arms.manipulability import JOINT_LIMITS, LOAD
from maniport.motion.arm_model import Axis
from maniport.motion.demands import EXCESS_WEIGHT, Demand, regularized_inverses
from maniport.motion.directions import (
    REFERENCE_FACTOR,
    REFERENCE_LINES,
    REFERENCE_PERCENTILE,
    REFERENCE_SAMPLES,
    DirectionTarget,
)
from maniport.motion.plan.roadmap import IN_PLACE, Roadmap, moved_to_positions, turned_to_rotations
from maniport.motion.problem import ArmProblem
from maniport.motion.targets import TargetTrajectory
from maniport.spd.kernels import compose, congruence, distances, eigh
from maniport.util.validation import SPD_TOLERANCE, Array, as_count, as_generator

SAMPLES = 100_000  # With 30 000 the planned motion of the demo's recording is 3 % farther from its targets
GAP_WEIGHT = 30.0  # Weight of the distance between a position and its nearest sample [1/m]
MIN_NODES = 16  # Where fewer nodes reach a position, the nearest so many are taken: the position may be out of reach
BLOCK = 1024  # Number of targets compared with their samples at a time: their data stays in the processor's cache


class LineForms(NamedTuple):
    """Matrices A of ellipsoids uᵀ A u ≤ 1 at samples, whose extents along lines are about those of polytopes."""

    matrices: Array  # (n, 3, 3)
    log_reference: float  # of the extents of samples along random lines, as `extent_reference`

    @classmethod
    def of(cls, matrices: Array) -> "LineForms":
        """Find the reference from some of the samples."""
        some = matrices[:REFERENCE_SAMPLES]
        lines = half_sphere(REFERENCE_LINES)
        squares = np.einsum("ki,nij,kj->nk", lines, some, lines, optimize=True)
        logs = -0.5 * np.log(np.maximum(squares, 1e-300))
        reference = np.percentile(logs, REFERENCE_PERCENTILE) + np.log(REFERENCE_FACTOR)
        return cls(matrices, float(reference))


class ReachabilityMap:
    """Samples of an arm by the positions of their end effector; those that collide are left out."""

    def __init__(
        self,
        arm: Arm,
        spec: EllipsoidSpec,
        n: int | None = None,
        random_state: int | np.random.Generator | None = 0,
        collisions: Collisions | bool | None = None,
    ):
        self.arm = arm
        self.spec = spec
        self.collisions: Collisions | None = as_collisions(collisions, arm)
        probes = arm.sample(32, 0)
        poses, jacobian, _, changes = arm.posed_differentials(probes, spec)
        self.axis = Axis.of(jacobian, poses[:, :3, 3])
        moves = np.abs(jacobian[:, :3]).max(axis=(0, 1))
        shapes = np.abs(changes).max(axis=(0, 2, 3))
        negligible = 1e-9
        self.idle = (moves <= negligible * moves.max()) & (shapes <= negligible * shapes.max())
        turns = np.abs(np.cross(jacobian[:, 3:, :, None], poses[:, :3, None, :3], axis=1)).max(
            axis=(0, 1)
        )
        # which idle joints turn which axes, (dof, 3)
        self._idle_turns = self.idle[:, None] & (turns > negligible)
        generator = as_generator(random_state)
        self._forms: dict[str, LineForms] = {}
        self._allowed = dict[EllipsoidSpec, Array]()
        self._first_limits = (arm.lower[0], arm.upper[0])
        self._count = SAMPLES if n is None else as_count(n, "n")
        self._generator = deepcopy(generator)
        # samples are drawn on first use, from a copy; the caller's generator moves on
        arm.sample(1, generator)

    @cached_property
    def _samples(self) -> Array:
        return free_configurations(
            self.arm, self._count, deepcopy(self._generator), collisions=self.collisions
        )

    @cached_property
    def q(self) -> Array:
        """The samples, turned to angle 0, joints without effect in the middle of their range, shape (n, dof)."""
        q = self._samples.copy()
        middle = 0.5 * (self.arm.lower + self.arm.upper)
        q[:, self.idle] = middle[self.idle]
        if self.axis is not None:
            q[:, 0] = 0.0
            q[:, 0] = -self.coordinates(self.arm.forward(q)[:, :3, 3])[1]
        return q

    @cached_property
    def _located(self) -> tuple[cKDTree, Array]:
        """Tree of the coordinates of `q`, and ellipsoids there (n, d, d)."""
        poses, ellipsoids = self.arm.posed_ellipsoids(self.q, self.spec.bounded)
        if self.spec.kind == "force":
            values, vectors = eigh(ellipsoids)
            singular = SPD_TOLERANCE * values.sum(axis=1, keepdims=True)
            ellipsoids = compose(1.0 / np.maximum(values, singular), vectors)
        return cKDTree(self.coordinates(np.ascontiguousarray(poses[:, :3, 3]))[0]), ellipsoids

    @cached_property
    def _orientations(self) -> Array:
        """Orientations of the end effector, idle joints as sampled, shape (n, 3, 3)."""
        return np.asarray(self.arm.forward(np.where(self.idle, self._samples, self.q))[:, :3, :3])

    @cached_property
    def reach(self) -> Array:
        """Positions of the end effector at the samples, the first joint as sampled, shape (n, 3) [m]."""
        return np.ascontiguousarray(self.arm.forward(self._samples)[:, :3, 3])

    def coordinates(self, points: Array) -> tuple[Array, Array]:
        """Coordinates without the arm's rotation (..., 2), or (..., 3) without an axis, and that rotation (...)."""
        if self.axis is None:
            return (points, np.zeros(points.shape[:-1]))
        return self.axis.cylindrical(points)

    def costs(self, target: TargetTrajectory, count: int, demands: Sequence[Demand] = ()) -> Array:
        """Cost d² + (`GAP_WEIGHT` · gap)² of samples next to the positions of targets, shape (n,).

        d is the distance between damped ellipsoids; too little force or speed along lines adds to d².

        It is the mean of the best sixteenth of `count` samples, since a trajectory may not reach the best one. The gap
        is from a position to a sample that is turned there as far as the first joint's limits allow. Demands that
        exceed what a sample allows add to its cost.
        """
        result = np.empty(len(target))
        for begin in range(0, len(target), BLOCK):
            part = slice(begin, begin + BLOCK)
            rows, gaps, first, angles, cost = self._near(
                target[part], target.ellipsoids[part], count
            )
            beyond = first - np.clip(first, *self._first_limits)
            radius = self.coordinates(target.path[part])[0][:, :1]
            cost += GAP_WEIGHT**2 * (gaps**2 + (2.0 * radius * np.sin(0.5 * beyond)) ** 2)
            for spec, vectors in demands:
                turned = (self._turns(-angles) @ vectors[part, :, None])[..., 0]
                shares = np.sqrt(
                    np.einsum("ni,nkij,nj->nk", turned, self._inverses(spec)[rows], turned)
                )
                cost += (EXCESS_WEIGHT * np.maximum(shares - 1.0, 0.0)) ** 2
            best = max(cost.shape[1] // 16, 1)
            result[part] = np.partition(cost, best - 1, axis=1)[:, :best].mean(axis=1)
        return result

    def _near(
        self, target: TargetTrajectory, ellipsoids: Array, count: int
    ) -> tuple[NDArray[np.intp], Array, Array, Array, Array]:
        """Return rows of near samples, gaps [m], first joints turned there (n, k), angles (n,), and d² (n, k).

        `ellipsoids` are those of the target.
        """
        coordinates, angles = self.coordinates(target.path)
        tree, samples = self._located
        gaps, rows = tree.query(coordinates, k=[*range(1, min(count, len(self.q)) + 1)])
        turns = self._turns(-angles)
        square = np.zeros(rows.shape)
        if target.with_ellipsoids:
            damped = congruence(self.spec.rotation(turns), ellipsoids) + target.shift
            square = distances(damped[:, None], samples[rows] + target.shift) ** 2
        for direction in target.directions:
            lines = direction.lines @ np.swapaxes(turns, 1, 2)
            square += self._lacking(direction, lines, rows)
        first = self.q[rows, 0]
        if self.axis is not None:  # next to the middle of its limits
            lowest = 0.5 * (self.arm.lower[0] + self.arm.upper[0]) - np.pi
            first = lowest + np.remainder(first + angles[:, None] - lowest, 2.0 * np.pi)
        return rows, gaps, first, angles, square

    def _lacking(self, direction: DirectionTarget, lines: Array, rows: NDArray[np.intp]) -> Array:
        """Cost of too little force or speed along lines (n, k, 3) at samples (n, m), by ellipsoids; shape (n, m)."""
        forms = self._line_forms(direction.kind)
        count, k = lines.shape[:2]
        products = (lines[..., None] * lines[..., None, :]).reshape(count, k, 9)
        matrices = forms.matrices[rows].reshape(*rows.shape, 9)
        squares = matrices @ products.swapaxes(1, 2)  # uᵀ A u, (n, m, k)
        lacking = np.maximum(0.5 * np.log(np.maximum(squares, 1e-300)) + forms.log_reference, 0.0)
        costs = lacking**2 @ (4.0 * direction.weights)[..., None]
        return np.asarray(costs[..., 0])

    def _line_forms(self, kind: str) -> "LineForms":
        """Ellipsoids of the extents at `q`."""
        if kind not in self._forms:
            spec = EllipsoidSpec(LOAD if kind == "force" else kind, joint_weights=JOINT_LIMITS)
            ellipsoids = self.arm.ellipsoids(self.q, spec)
            if kind == "velocity":
                ellipsoids = regularized_inverses(ellipsoids)
            self._forms[kind] = LineForms.of(ellipsoids)
        return self._forms[kind]

    def _inverses(self, spec: EllipsoidSpec) -> Array:
        """Inverses of translational ellipsoids at `q`, shape (n, 3, 3)."""
        if spec not in self._allowed:
            self._allowed[spec] = regularized_inverses(self.arm.ellipsoids(self.q, spec))
        return self._allowed[spec]

    def nodes(self, problem: ArmProblem, count: int, random: np.random.Generator) -> Roadmap:
        """At most `count` configurations for each target, with the end effector at its position.

        Of the samples next to that position half are those with the nearest ellipsoids, half are random. Newton steps
        bring the end effector to its position, and turn it where its orientation counts. Where the first joint may turn
        more than once, the same configurations a turn away are nodes, too.
        """
        # few samples next to a position have similar orientations: more are needed where the orientation counts
        nearest_samples = 2 * count if problem.orientation is None else 8 * count
        q, cost, _ = self._turned_samples(problem, nearest_samples)
        order = np.argsort(cost, axis=1, kind="stable")
        half = count // 2
        drawn = random.permuted(order[:, half:], axis=1)[:, : count - half]
        chosen = np.concatenate([order[:, :half], np.sort(drawn, axis=1)], axis=1)
        possible = np.isfinite(np.take_along_axis(cost, chosen, axis=1))
        q = np.take_along_axis(q, chosen[..., None], axis=1)[possible]
        owner = np.nonzero(possible)[0]
        if problem.orientation is not None:
            q = turned_to_rotations(problem[owner], q)
        q, error = moved_to_positions(self.arm, q, problem.path[owner])
        kept = error <= IN_PLACE
        short = np.bincount(owner[kept], minlength=len(problem)) < MIN_NODES
        if short.any():
            order = np.lexsort((error, owner))
            rank = np.arange(len(order)) - np.searchsorted(owner[order], owner[order])
            nearest = order[rank < MIN_NODES]
            kept[nearest] |= short[owner[nearest]]
        q, owner = self._with_whole_turns(q[kept], owner[kept])
        return Roadmap(
            q, problem[owner].cost(q), np.searchsorted(owner, np.arange(len(problem) + 1))
        )

    def starts(self, problem: ArmProblem, samples: int, count: int) -> tuple[Array, Array]:
        """Return the best `count` of the samples next to each target's position, and their costs.

        Samples (n, count, dof) are turned to the position as far as the first joint's limits allow. The costs
        (n, count) are infinite beyond these.
        """
        q, cost, gaps = self._turned_samples(problem, samples)
        cost = cost + (GAP_WEIGHT * gaps) ** 2
        best = np.argsort(cost, axis=1, kind="stable")[:, :count]
        return np.take_along_axis(q, best[..., None], axis=1), np.take_along_axis(
            cost, best, axis=1
        )

    def _turned_samples(self, problem: ArmProblem, count: int) -> tuple[Array, Array, Array]:
        """Return samples next to each target's position, turned there (n, k, dof), their costs and gaps [m] (n, k)."""
        target = problem.target
        ellipsoids = target.damped_ellipsoids - target.shift
        rows, gaps, first, _, cost = self._near(target, ellipsoids, count)
        q = self.q[rows]
        beyond = (first < self._first_limits[0]) | (first > self._first_limits[1])
        beyond &= ~beyond.all(axis=1, keepdims=True)  # better off the position than nothing at all
        cost[beyond] = np.inf
        first = np.clip(first, *self._first_limits)
        if problem.orientation is not None:
            weights = np.array(problem.orientation.weights)
            needed = self._idle_turns @ (weights > 0.0)
            rotations = self._turns(first - q[..., 0]) @ self._orientations[rows]
            q[..., needed] = self._samples[rows][..., needed]
            offsets = weights * (rotations - problem.orientation.rotations[:, None])
            cost += np.sum(offsets**2, axis=(-2, -1))
        q[..., 0] = first
        return q, cost, gaps

    def _with_whole_turns(
        self, q: Array, owner: NDArray[np.intp]
    ) -> tuple[Array, NDArray[np.intp]]:
        """Add configurations (n, dof) a whole turn of the first joint away that its limits allow."""
        if self.axis is None:
            return q, owner
        turned = np.repeat(q[:, None], 3, axis=1)
        turned[:, :, 0] += 2.0 * np.pi * np.array([0.0, 1.0, -1.0])
        first = turned[:, :, 0]
        allowed = (first >= self.arm.lower[0]) & (first <= self.arm.upper[0])
        allowed[:, 0] = True
        return turned[allowed], np.repeat(owner, allowed.sum(axis=1))

    def _turns(self, angles: Array) -> Array:
        """Rotations (..., 3, 3) of the arm by angles (...)."""
        none = np.broadcast_to(np.eye(3), (*angles.shape, 3, 3))
        if self.axis is None:
            return none
        return self.axis.rotations(angles)
