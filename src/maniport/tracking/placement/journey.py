"""A path with its ellipsoids that may be put in many places before an arm, and the ways to put it there.

A place is a row of seven numbers: log scale, yaw, tilt and heading of the base [rad], and where the path's
centre is [m]. The path is turned about the person's vertical by the yaw; the base leans by the tilt towards the
heading, so that what is upright turns by the inverse in its frame.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from maniport.spd.kernels import congruence
from maniport.subsample import evenly_spaced
from maniport.tracking.objective import Objective, Targets
from maniport.tracking.plan.atlas import Atlas
from maniport.validation import Array

SCALE, YAW, TILT, HEADING, OFFSET = 0, 1, 2, 3, slice(4, 7)
SIZE = 7
ROUNDING = 1e-9
"""How far beyond a workspace a path may be by rounding [m]."""


def mounts(places: Array) -> Array:
    """Rotations of the base in a world whose z axis is up, shape (k, 3, 3)."""
    heading = _about(2, places[:, HEADING])
    return np.asarray(heading @ _about(1, places[:, TILT]) @ np.swapaxes(heading, 1, 2))


def rotations(places: Array) -> Array:
    """Rotations of the path in the frame of the base, shape (k, 3, 3)."""
    level = places[:, TILT, None, None] == 0.0
    return np.asarray(np.where(level, np.eye(3), np.swapaxes(mounts(places), 1, 2)) @ _about(2, places[:, YAW]))


def wrapped(angles: Array) -> Array:
    """The same angles within ±π."""
    return np.asarray(np.remainder(angles + np.pi, 2.0 * np.pi) - np.pi)


def _about(axis: int, angles: Array) -> Array:
    first, second = (axis + 1) % 3, (axis + 2) % 3
    turns = np.tile(np.eye(3), (len(angles), 1, 1))
    turns[:, first, first] = turns[:, second, second] = np.cos(angles)
    turns[:, second, first] = np.sin(angles)
    turns[:, first, second] = -turns[:, second, first]
    return turns


@dataclass(frozen=True)
class Journey:
    """A path around its centre with its ellipsoids, what following it costs an arm, and where it may lie.

    Attributes
    ----------
    objective : Objective
    path : ndarray, shape (n, 3)
        Positions relative to the path's centre [m], turned as the ellipsoids were.
    profile : ndarray, shape (n, d, d)
        Target ellipsoids of a path that is not turned, without damping.
    time : ndarray, shape (n,)
        [s].
    given : ndarray, shape (7,)
        The place, as far as it is given; nan where it is free.
    least, most : ndarray, shape (7,)
        Bounds of places.
    workspace : ndarray, shape (2, 3)
        Lower and upper bounds of the path [m].
    """

    objective: Objective
    path: Array
    profile: Array
    time: Array
    given: Array
    least: Array
    most: Array
    workspace: Array

    @property
    def free(self) -> NDArray[np.bool_]:
        """Which numbers of a place are searched, shape (7,)."""
        return np.isnan(self.given)

    def rows(self, points: int) -> NDArray[np.intp]:
        """Which of the points are left when so many are, evenly spaced along the sequence."""
        return evenly_spaced(len(self.path), points)

    def thinned(self, points: int) -> "Journey":
        """The same with so many points, evenly spaced along the sequence."""
        rows = self.rows(points)
        return replace(self, path=self.path[rows], profile=self.profile[rows], time=self.time[rows])

    def weighing(self, position_weight: float) -> "Journey":
        """The same with another weight of the tip's place [1/m]."""
        return replace(self, objective=replace(self.objective, position_weight=position_weight))

    def placed(self, places: Array) -> tuple[Array, Array]:
        """Tip positions (k, n, 3) and ellipsoids (k, n, d, d) at places (k, 7)."""
        turns = rotations(places)
        tips = np.exp(places[:, 0])[:, None, None] * self.path @ np.swapaxes(turns, 1, 2) + places[:, None, OFFSET]
        spec = self.objective.spec
        both = turns if spec.size == 3 else np.stack([spec.rotation(turn) for turn in turns])
        return tips, congruence(both[:, None], self.profile)

    def targets(self, place: Array) -> Targets:
        """What an arm shall reach with the path at one place (7,)."""
        tips, profile = self.placed(place[None])
        return self.objective.targets(profile[0], tips[0])

    def costs(self, atlas: Atlas, places: Array, count: int) -> Array:
        """Mean cost of places (k, 7) by the samples next to the path, `count` at each point; (k,)."""
        tips, profiles = self.placed(places)
        flat = profiles.reshape(-1, *profiles.shape[2:])
        found = atlas.costs(self.objective, flat, tips.reshape(-1, 3), count)
        return np.asarray(found.reshape(tips.shape[:2]).mean(axis=1))

    def within(self, places: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Move places (k, 7) into the workspace and shrink the path, where that is free; and which are in it, (k,)."""
        places, free = places.copy(), self.free
        if not np.any(np.isfinite(self.workspace)):
            return places, np.ones(len(places), bool)
        turned = self.path @ np.swapaxes(rotations(places), 1, 2)
        low, high = turned.min(axis=1), turned.max(axis=1)
        if free[SCALE]:
            room = self.workspace[1] - self.workspace[0]
            with np.errstate(divide="ignore", invalid="ignore"):
                largest = room / (high - low)
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

    def unturned(self, places: Array) -> Array:
        """Places (k, 7) with the path turned back about the vertical, in one piece with the arm; others as they are."""
        if not (self.free[[YAW, 4, 5]].all() and (self.free[HEADING] or self.given[TILT] == 0.0)):
            return places
        turned, yaw = places.copy(), places[:, YAW]
        turned[:, OFFSET] = (_about(2, -yaw) @ places[:, OFFSET, None])[..., 0]
        turned[:, HEADING] = np.where(self.free[HEADING], wrapped(places[:, HEADING] - yaw), places[:, HEADING])
        turned[:, YAW] = 0.0
        return turned

    def moves(self, place: Array) -> tuple[Array, Array]:
        """How what is aimed at moves with the seven numbers of a place (7,)."""
        tips = self.placed(place[None])[0][0] - place[OFFSET]
        axes = np.zeros((SIZE, 3))
        axes[[YAW, TILT, HEADING]] = _axes(place)
        shifts = np.cross(axes, tips[:, None]).swapaxes(1, 2)
        shifts[:, :, SCALE] = tips
        shifts[:, :, OFFSET] = np.eye(3)
        turns = np.stack([self.objective.spec.rotation(np.cross(np.eye(3), axis)) for axis in axes])
        return shifts, turns

    def slopes(self, place: Array, q: Array) -> Array:
        """Derivatives of the points' costs in the place while the joints stay at q (n, dof); shape (n, 7)."""
        targets = self.targets(place)
        pull = -2.0 * self.objective.position_weight**2 * targets.tip_offset(q)
        assert targets.positions is not None
        arms = targets.positions - place[OFFSET]
        turning = np.cross(arms, pull) + _turning_slopes(targets, q)
        return np.column_stack([np.sum(pull * arms, axis=1), turning @ _axes(place).T, pull])


def _axes(place: Array) -> Array:
    """Axes about which yaw, tilt and heading turn a path, in the frame of the base, shape (3, 3)."""
    up = rotations(place[None])[0, :, 2]
    sideways = np.array([np.sin(place[HEADING]), -np.cos(place[HEADING]), 0.0])
    return np.stack([up, sideways, np.array([0.0, 0.0, 1.0]) - up])


def _turning_slopes(targets: Targets, q: Array) -> Array:
    """Derivative of d²(A, M) as A turns about x, y and z: 4 tr(log(A⁻¹ M) K), K the generator of the turn; (n, 3)."""
    spec = targets.objective.spec
    logs = targets.whitening @ targets.logarithms(q) @ targets.root
    generators = np.stack([spec.rotation(np.cross(np.eye(3), axis)) for axis in np.eye(3)])
    return np.asarray(4.0 * np.einsum("nij,kji->nk", logs, generators))
