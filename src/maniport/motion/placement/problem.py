"""Placement problem: paths with their ellipsoids that may be put anywhere before their arms.

A placement is a row of seven numbers: log scale, yaw, tilt and heading of the base [rad], and the position of the
path's center [m]. The path is turned about the vertical by the yaw; the base leans by the tilt towards the heading, so
that the vertical turns by the inverse in its frame.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from maniport.motion.objective import Objective, Targets
from maniport.motion.plan.reachability_map import ReachabilityMap
from maniport.spd.kernels import congruence
from maniport.util.subsample import evenly_spaced
from maniport.util.validation import Array

SCALE, YAW, TILT, HEADING, OFFSET = 0, 1, 2, 3, slice(4, 7)
SIZE = 7
ROUNDING = 1e-9  # How far beyond a workspace a path may be by rounding [m]


def base_rotations(places: Array) -> Array:
    """Rotations of the base in a world whose z axis is up, shape (k, 3, 3)."""
    heading = _about(2, places[:, HEADING])
    return np.asarray(heading @ _about(1, places[:, TILT]) @ np.swapaxes(heading, 1, 2))


def path_rotations(places: Array) -> Array:
    """Rotations of the path in the frame of the base, shape (k, 3, 3)."""
    level = places[:, TILT, None, None] == 0.0
    base = np.where(level, np.eye(3), np.swapaxes(base_rotations(places), 1, 2))
    return np.asarray(base @ _about(2, places[:, YAW]))


def wrapped(angles: Array) -> Array:
    """The same angles within ±π."""
    return np.asarray(np.remainder(angles + np.pi, 2.0 * np.pi) - np.pi)


def _about(axis: int, angles: Array) -> Array:
    first, second = (axis + 1) % 3, (axis + 2) % 3
    rotations = np.tile(np.eye(3), (len(angles), 1, 1))
    rotations[:, first, first] = rotations[:, second, second] = np.cos(angles)
    rotations[:, second, first] = np.sin(angles)
    rotations[:, first, second] = -rotations[:, second, first]
    return rotations


@dataclass(frozen=True)
class PlacementProblem:
    """A path around its center with its ellipsoids, the objective of its arm, and bounds of placements."""

    objective: Objective
    path: Array  # (n, 3), relative to the center [m], turned as the ellipsoids were
    profile: Array  # (n, d, d), target ellipsoids of a path that is not turned, without damping
    time: Array  # (n,) [s]
    given: Array  # (7,), the placement as far as it is given; nan where it is free
    least: Array  # (7,), bounds of placements
    most: Array  # (7,)
    workspace: Array  # (2, 3), lower and upper bounds of the path [m]

    @property
    def free(self) -> NDArray[np.bool_]:
        """Which numbers of a placement are searched, shape (7,)."""
        return np.isnan(self.given)

    def thinned(self, count: int) -> "PlacementProblem":
        """The same with `count` evenly spaced waypoints."""
        rows = evenly_spaced(len(self.path), count)
        return replace(self, path=self.path[rows], profile=self.profile[rows], time=self.time[rows])

    def placed(self, places: Array) -> tuple[Array, Array]:
        """Positions (k, n, 3) and ellipsoids (k, n, d, d) at placements (k, 7)."""
        rotations, spec = path_rotations(places), self.objective.spec
        scale = np.exp(places[:, SCALE])[:, None, None]
        positions = scale * self.path @ np.swapaxes(rotations, 1, 2) + places[:, None, OFFSET]
        return positions, congruence(spec.rotation(rotations)[:, None], self.profile)

    def targets(self, place: Array) -> Targets:
        """Targets of the arm at a placement (7,)."""
        positions, profile = self.placed(place[None])
        return self.objective.targets(profile[0], positions[0])

    def costs(self, reachability_map: ReachabilityMap, places: Array, samples: int) -> Array:
        """Mean cost of placements (k, 7) by the samples next to each waypoint, shape (k,)."""
        positions, profiles = self.placed(places)
        flat = profiles.reshape(-1, *profiles.shape[2:])
        costs = reachability_map.costs(self.objective, flat, positions.reshape(-1, 3), samples)
        return np.asarray(costs.reshape(positions.shape[:2]).mean(axis=1))

    def within(self, places: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Shift placements (k, 7) into the workspace, and shrink the path, where free; and which fit, (k,)."""
        places, free = places.copy(), self.free
        if not np.any(np.isfinite(self.workspace)):
            return places, np.ones(len(places), bool)
        turned = self.path @ np.swapaxes(path_rotations(places), 1, 2)
        low, high = turned.min(axis=1), turned.max(axis=1)
        if free[SCALE]:
            size = self.workspace[1] - self.workspace[0]
            with np.errstate(divide="ignore", invalid="ignore"):
                largest = size / (high - low)
                fixed = np.fmin(
                    (self.workspace[1] - places[:, OFFSET]) / high, (self.workspace[0] - places[:, OFFSET]) / low
                )
                largest = np.where(free[OFFSET], largest, np.maximum(fixed, 0.0)).min(axis=1)
                places[:, SCALE] = np.minimum(places[:, SCALE], np.log(largest) - ROUNDING)
        scale = np.exp(places[:, SCALE, None])
        ends = self.workspace[0] - scale * low, self.workspace[1] - scale * high
        inside = np.minimum(np.maximum(places[:, OFFSET], ends[0]), ends[1])
        places[:, OFFSET] = np.where(free[OFFSET], inside, places[:, OFFSET])
        kept = (places[:, OFFSET] >= ends[0] - ROUNDING) & (places[:, OFFSET] <= ends[1] + ROUNDING)
        return places, kept.all(axis=1) & (places[:, SCALE] >= self.least[SCALE] - ROUNDING)

    def derivatives(self, place: Array) -> tuple[Array, Array]:
        """Derivatives of positions in a placement (n, 3, 7), and generators of rotations (7, d, d)."""
        positions = self.placed(place[None])[0][0] - place[OFFSET]
        vertical = path_rotations(place[None])[0, :, 2]
        axes = np.zeros((SIZE, 3))
        axes[YAW] = vertical
        axes[TILT] = np.sin(place[HEADING]), -np.cos(place[HEADING]), 0.0
        axes[HEADING] = np.array([0.0, 0.0, 1.0]) - vertical
        shifts = np.cross(axes, positions[:, None]).swapaxes(1, 2)
        shifts[:, :, SCALE] = positions
        shifts[:, :, OFFSET] = np.eye(3)
        return shifts, self.objective.spec.rotation(np.cross(np.eye(3), axes[:, None]))


@dataclass(frozen=True)
class PlacementGroup:
    """Placement problems of one or several arms with one common placement, and the reachability maps of the arms."""

    problems: tuple[PlacementProblem, ...]
    reachability_maps: tuple[ReachabilityMap, ...]

    @property
    def common(self) -> PlacementProblem:
        """The first problem, for what they share."""
        return self.problems[0]

    def changed(self, change: Callable[[PlacementProblem], PlacementProblem]) -> "PlacementGroup":
        """Change each problem alike."""
        return replace(self, problems=tuple(change(problem) for problem in self.problems))

    def thinned(self, count: int) -> "PlacementGroup":
        """The same with `count` evenly spaced waypoints of each path."""
        return self.changed(lambda problem: problem.thinned(count))

    def within(self, places: Array) -> tuple[Array, NDArray[np.bool_]]:
        """As `PlacementProblem.within`, for all paths."""
        return replace(self.common, path=np.concatenate([problem.path for problem in self.problems])).within(places)

    def costs(self, places: Array, samples: int) -> Array:
        """As `PlacementProblem.costs`, summed over the arms."""
        pairs = zip(self.problems, self.reachability_maps, strict=True)
        return np.asarray(sum(problem.costs(own, places, samples) for problem, own in pairs))

    def centers(self, count: int, seed: np.random.Generator) -> Array:
        """Means of positions that the arms reach, shape (count, 3) [m]."""
        positions = (samples.reach for samples in self.reachability_maps)
        chosen = [reach[seed.choice(len(reach), count, replace=len(reach) < count)] for reach in positions]
        return np.asarray(np.mean(chosen, axis=0))

    def with_paths(self, paths: Sequence[Array]) -> "PlacementGroup":
        """The same with other paths (m, 3) around their center; their ellipsoids and times mean nothing."""
        problems = []
        for problem, path in zip(self.problems, paths, strict=True):
            profile = np.tile(np.eye(problem.objective.spec.size), (len(path), 1, 1))
            problems.append(replace(problem, path=path, profile=profile, time=np.arange(len(path), dtype=float)))
        return replace(self, problems=tuple(problems))
