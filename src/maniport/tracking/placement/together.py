"""A place and the motions there, improved at once: banded Gauss-Newton, the place a border of the motions' equations.

What the numbers of a place change is written as if they were joints: a path that turns is an arm that turns the other
way. The normal equations of motion q and place p, of several arms with a q for each,

    [A  B] [q]     [g]
    [Bᵀ C] [p] = − [h],

are solved for the place first, (C − Bᵀ A⁻¹ B) p = Bᵀ A⁻¹ g − h, where A is banded.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from maniport.spd.kernels import compose
from maniport.tracking.kernels import add_log_residual, add_residual
from maniport.tracking.objective import Targets
from maniport.tracking.placement.journey import SIZE, Journey
from maniport.tracking.placement.sides import Sides
from maniport.tracking.plan.refinement import Asked, Motion, descend
from maniport.validation import Array

State = tuple[Array, tuple[Array, ...]]
"""A place (7,) and joint positions (n, dof) of each arm."""

RIDGE = 1e-9
"""Share of what a number of a place counts for that is added: path and arm may turn together at no cost."""


def improved_together(sides: Sides, whole: Sides, place: Array, q: tuple[Array, ...], asked: Sequence[Asked]) -> State:
    """Descend in the place and the motions there together, all points of the whole paths in their workspace."""
    both = Together(sides, whole, asked)
    return descend(
        both, (place, tuple(one.within(each) for one, each in zip(both.motions, q, strict=True))), both.enough
    )


class Bordered(NamedTuple):
    """Slopes of a motion and, of the numbers of its place that are free, h (k,), B (n, dof, k) and C (k, k)."""

    gradient: Array
    hessian: Array
    band: Array
    h: Array
    mixed: Array
    square: Array


class Together:
    """What a place and the motions there cost."""

    def __init__(self, sides: Sides, whole: Sides, asked: Sequence[Asked]):
        self.sides, self.whole, self.enough = sides, whole, asked[0].enough
        self.borne = [Borne(one) for one in sides.journeys]
        self.motions = [
            Motion(borne.journey.objective.arm, borne, borne.journey.time, one)
            for borne, one in zip(self.borne, asked, strict=True)
        ]

    def evaluate(self, state: State) -> tuple[float, list[Bordered]]:
        """Cost, and slopes of each arm."""
        (place, every), free = state, self.sides.common.free
        total, slopes = 0.0, []
        for borne, motion, q in zip(self.borne, self.motions, every, strict=True):
            borne.go(place)
            cost, (gradient, blocks, band) = motion.evaluate(q)
            total, shares, dof = total + cost, motion.shares, q.shape[1]
            h, hessian = shares @ borne.gradient[:, dof:][:, free], borne.hessian[:, :, dof:][:, :, free]
            mixed, square = shares[:, None, None] * hessian[:, :dof], np.tensordot(shares, hessian[:, dof:][:, free], 1)
            slopes.append(Bordered(gradient, blocks, band, h, mixed, square))
        return total, slopes

    def trial(self, state: State, slopes: list[Bordered], damping: float) -> tuple[State, float]:
        """Where a damped step leads, within the limits, and by how much it should lower the cost."""
        (place, every), common = state, self.sides.common
        h, square = np.sum([one.h for one in slopes], axis=0), np.sum([one.square for one in slopes], axis=0)
        inner, pull, solved, damped = square, h, [], []
        for motion, q, one in zip(self.motions, every, slopes, strict=True):
            own = damping * (np.einsum("nii->ni", one.hessian) + one.band[0])
            sides, stuck = np.concatenate([one.gradient[..., None], one.mixed], axis=2), motion.stuck(q, one.gradient)
            found = motion.solved(sides, one.hessian, one.band, stuck, own)
            inner = inner - np.tensordot(one.mixed, found[..., 1:], ((0, 1), (0, 1)))
            pull = pull - np.tensordot(found[..., 0], one.mixed, 2)
            solved.append(found)
            damped.append(own)
        at, least, most = place[common.free], common.least[common.free], common.most[common.free]
        weight = np.diag(square)
        loose = ~(((at <= least) & (h > 0.0)) | ((at >= most) & (h < 0.0)) | (weight <= 0.0))
        inner = inner + np.diag((damping + RIDGE) * weight)
        step = np.zeros(len(at))
        step[loose] = -np.linalg.solve(inner[np.ix_(loose, loose)], pull[loose])
        moved = place.copy()
        moved[common.free] = np.clip(at + step, least, most)
        moved = self.whole.within(moved[None])[0][0]
        along = [-(found[..., 0] + found[..., 1:] @ step) for found in solved]
        expected = float(step @ (damping * weight * step - h))
        for way, own, one in zip(along, damped, slopes, strict=True):
            expected += float(np.sum(way * (own * way - one.gradient)))
        trial = tuple(one.within(q + way) for one, q, way in zip(self.motions, every, along, strict=True))
        return (moved, trial), expected


class Borne:
    """A path that is borne to places; what is evaluated has all seven numbers of the place after the joints."""

    targets: Targets
    gradient: Array
    hessian: Array

    def __init__(self, journey: Journey):
        self.journey = journey

    def go(self, place: Array) -> None:
        """Be at a place (7,) from now on."""
        self.targets = self.journey.targets(place)
        self._shifts, self._turns = self.journey.moves(place)

    def cost(self, q: Array) -> Array:
        """As that of the targets."""
        return self.targets.cost(q)

    def evaluate(self, q: Array) -> tuple[Array, Array, Array]:
        """As that of the targets; the derivatives in the place are kept beside these."""
        targets, count = self.targets, q.shape[1] + SIZE
        values, vectors, frames, singular, changes, jacobian, tips = targets.differentials(q)
        achieved = targets.root @ compose(values, vectors) @ targets.root
        turned = achieved[:, None] @ self._turns - self._turns @ achieved[:, None]
        assert targets.positions is not None
        assert tips is not None
        weight = targets.objective.position_weight
        away = weight * (tips[:, :3, 3] - targets.positions)
        self.gradient, self.hessian = np.zeros((len(q), count)), np.zeros((len(q), count, count))
        add_log_residual(values, frames, np.concatenate([changes, turned], axis=1), self.gradient, self.hessian)
        add_residual(
            away, weight * np.concatenate([jacobian[:, :3], -self._shifts], axis=2), self.gradient, self.hessian
        )
        square = np.sum(np.log(values) ** 2, axis=1) + np.sum(away**2, axis=1)
        dof = q.shape[1]
        return np.sqrt(np.where(singular, np.inf, square)), self.gradient[:, :dof], self.hessian[:, :dof, :dof]
