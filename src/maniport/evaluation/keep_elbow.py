"""The baseline beside ellipsoids: the robot's tip on its path, its elbow turned as the person's.

Tip and elbow leave three of seven joints' freedoms open: the arm may be in many postures at each point, and what it
takes at one decides what it can take at the next. So the motion is found as others are planned (`tracking.plan`): a
shortest path through many postures at each point, then all points at once by Gauss-Newton.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from maniport.bodies import Arm
from maniport.evaluation.elbow import angle_of, turned_by
from maniport.thinning import evenly
from maniport.tracking.plan.nodes import Nodes
from maniport.tracking.plan.refinement import Asked, Smoothness, descended
from maniport.tracking.plan.shortest_path import shortest_path
from maniport.validation import Array

TIP_WEIGHT, ELBOW_WEIGHT = 1000.0, 20.0
"""What a metre beside the path and a radian of the elbow count for: 1° of the elbow as much as 0.35 mm."""
NEAR = 0.3
"""What a radian from the posture before counts for: of what is free, the least motion."""
SAMPLES, STARTS, PASSED_ON, STAGES = 30_000, 64, 16, 150
"""Postures that are drawn; of these so many start at each point; of what is found so many go on to the next point; of
so many points at most."""
ALIKE = 0.3
"""So many metres is an elbow on the other side away, of samples that are looked up by tip and elbow."""
STEPS, LONGEST_STEP = 5, 0.5
"""By which postures are brought to their points, and the most that a joint changes in one [rad]."""
STEP = 1e-6
"""Of differences [m]."""


def keep_elbow(
    robot: Arm, path: Array, angles: Array, turn: Array, frames: Sequence[str], random_state: int = 0
) -> Array:
    """Joint positions with the tip on a path and the elbow at given angles, shape (n, dof), within the limits.

    Neither the robot's speed nor collisions are minded, which favours what is found.

    Parameters
    ----------
    robot : Arm
    path : ndarray, shape (n, 3)
        Of the tip, in the base frame [m].
    angles : ndarray, shape (n,)
        Of the elbow [rad]; where nan, it is left alone.
    turn : ndarray, shape (3, 3)
        As in `maniport.evaluation.elbow.elbow_angle`.
    frames : sequence of three str
        At the robot's shoulder, elbow and wrist.
    random_state : int
        Seed of the postures that are drawn.
    """
    asked = ElbowKept(robot, path, angles, turn, tuple(frames))
    time, rows = np.arange(float(len(path))), evenly(len(path), STAGES)
    nodes = asked[rows].nodes(robot.sample(SAMPLES, random_state), (time[-1] - time[0]) / max(len(rows) - 1, 1))
    anywhere = np.full((len(rows), robot.dof), np.inf)
    way = nodes.q[shortest_path(nodes, time[rows], anywhere, NEAR**2)]
    nearest = np.interp(time, rows, np.arange(len(rows))).round().astype(np.intp)  # what leaps has nothing between
    return descended(robot, asked, time, asked.brought(way[nearest]), Asked(Smoothness(NEAR**2, 0.0)))


@dataclass(frozen=True)
class ElbowKept:
    """What is asked of a robot's posture at each point: its tip there (3 residuals) and its elbow turned so (1)."""

    arm: Arm
    path: Array
    angles: Array
    turn: Array
    frames: tuple[str, ...]

    def __getitem__(self, rows: NDArray[np.intp]) -> "ElbowKept":
        return replace(self, path=self.path[rows], angles=self.angles[rows])

    def residuals(self, q: Array) -> Array:
        """Weighted, shape (n, 4); an angle that is not defined is as it should be."""
        tip = self.arm.forward(q)[:, :3, 3] - self.path
        elbow = turned_by(angle_of(self._points(q)), self.angles)
        return np.column_stack([TIP_WEIGHT * tip, ELBOW_WEIGHT * np.nan_to_num(elbow)])

    def slopes(self, q: Array) -> Array:
        """Derivatives of the residuals, shape (n, 4, dof), those of the angle along points by differences."""
        points, moves = self._points(q), self.turn.T @ self.arm.point_jacobians(q, self.frames)
        there = angle_of(points)
        along = np.zeros_like(points)
        for point in (1, 2):
            for axis in range(3):
                moved = points.copy()
                moved[:, point, axis] += STEP
                along[:, point, axis] = turned_by(angle_of(moved), there) / STEP
        along[:, 0] = -along[:, 1] - along[:, 2]  # moved as a whole, an arm keeps its angle
        elbow = np.einsum("npi,npij->nj", np.nan_to_num(along), moves) * np.isfinite(self.angles)[:, None]
        return np.concatenate([TIP_WEIGHT * self.arm.jacobian(q)[:, :3], ELBOW_WEIGHT * elbow[:, None]], axis=1)

    def cost(self, q: Array) -> Array:
        """Sums of squared residuals, shape (n,)."""
        return np.asarray(np.sum(self.residuals(q) ** 2, axis=1))

    def evaluate(self, q: Array) -> tuple[Array, Array, Array]:
        """As `maniport.tracking.plan.refinement.Postures` has it."""
        off, slope = self.residuals(q), self.slopes(q)
        back = np.swapaxes(slope, 1, 2)
        return np.linalg.norm(off, axis=1), (back @ off[..., None])[..., 0], back @ slope

    def brought(self, q: Array) -> Array:
        """Postures (n, dof) nearer to what is asked, by damped Gauss-Newton steps within the limits."""
        lower, upper, one = self.arm.lower, self.arm.upper, np.eye(self.arm.dof)
        for _ in range(STEPS):
            _, gradient, hessian = self.evaluate(q)
            free = ~(((q <= lower) & (gradient > 0.0)) | ((q >= upper) & (gradient < 0.0)))
            hessian = hessian * (free[:, :, None] & free[:, None, :]) + one
            step = -np.linalg.solve(hessian, (gradient * free)[..., None])[..., 0]
            step *= np.minimum(1.0, LONGEST_STEP / np.maximum(np.abs(step).max(axis=1, keepdims=True), LONGEST_STEP))
            q = np.clip(q + step, lower, upper)
        return q

    def nodes(self, samples: Array, gap: float) -> Nodes:
        """Postures at each point: samples with tip and elbow next to it, brought there, and what neighbours pass on.

        From the first point to the last, and back, the ends of the best ways so far are brought to the next point:
        there are postures that no sample leads to, and ways without leaps that no samples make.
        """
        angles = angle_of(self._points(samples))
        places = np.column_stack([self.arm.forward(samples)[:, :3, 3], _around(angles)])
        near = cKDTree(places).query(np.column_stack([self.path, _around(self.angles)]), k=STARTS)[1]
        count = len(near)
        each = self[np.repeat(np.arange(count), STARTS)]
        q = each.brought(samples[near.ravel()])
        known, cost = list(q.reshape(count, STARTS, -1)), list(each.cost(q).reshape(count, STARTS))
        for order in (range(count), range(count - 1, -1, -1)):
            value = gap * cost[order[0]]
            for before, here in pairwise(order):
                there, best = self[np.full(PASSED_ON, here)], np.argsort(value, kind="stable")[:PASSED_ON]
                passed = there.brought(known[before][best])
                known[here] = np.concatenate([known[here], passed])
                cost[here] = np.concatenate([cost[here], there.cost(passed)])
                ways = value + NEAR**2 / gap * cdist(known[here], known[before], "sqeuclidean")
                value = gap * cost[here] + ways.min(axis=1)
        return Nodes(np.concatenate(known), np.concatenate(cost), np.cumsum([0, *map(len, known)]))

    def _points(self, q: Array) -> Array:
        """Shoulder, elbow and wrist in the frame in which angles are counted, shape (n, 3, 3)."""
        return np.asarray(self.arm.point_positions(q, self.frames) @ self.turn)


def _around(angles: Array) -> Array:
    """Angles as points of a circle, shape (n, 2) [m]; what has no angle is equally far from all."""
    return np.nan_to_num(0.5 * ALIKE * np.column_stack([np.cos(angles), np.sin(angles)]))
