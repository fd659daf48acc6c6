"""Pairs of arms, and of targets, that are mirror images: a motion of one arm then serves the other."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from maniport.bodies import Arms, EllipsoidSpec
from maniport.bodies.collisions import Collisions
from maniport.tracking.motion_limits import DERIVATIVES, MotionLimits
from maniport.tracking.plan.optimizer import DistanceWatch
from maniport.tracking.plan.time_parameterization import Timed
from maniport.tracking.schedule import Schedule
from maniport.validation import Array

MIRROR = np.diag([1.0, -1.0, 1.0])
"""Reflection in the plane of x and z, between left and right."""


@dataclass(frozen=True)
class Image:
    """A pair whose left arm moves as the mirror image of the right one, described by the right arm's joints."""

    arms: Arms
    signs: Array  # (right.dof,), of q_left = signs · q_right

    @classmethod
    def of(cls, limits: MotionLimits, left: Schedule, right: Schedule, spec: EllipsoidSpec) -> "Image | None":
        """Make one where arms and what they are asked for are images of one another; None where they are not."""
        signs = mirror_signs(limits) if mirrored(left, right, spec) else None
        return None if signs is None else cls(limits.arm, signs)

    def within(self, own: MotionLimits) -> MotionLimits:
        """The right arm's limits; joints that move both arms, which an image moves the other way, stay at zero."""
        bound = np.isin(self.arms.columns[1], self.arms.columns[0]) & (self.signs < 0.0)
        ends = (np.where(bound, 0.0, end) for end in (own.lower, own.upper))
        return replace(own, arm=own.arm.narrowed(*ends))

    def pair(self, right: Array) -> Array:
        """Joints of both (n, dof), or their changes, for those of the right arm (n, right.dof)."""
        q = np.empty((len(right), self.arms.dof))
        q[:, self.arms.columns[0]], q[:, self.arms.columns[1]] = self.signs * right, right
        return q

    def both(self, timed: Timed) -> Timed:
        """The motion of both for one of the right arm."""
        return replace(
            timed,
            positions=self.pair(timed.positions),
            velocities=self.pair(timed.velocities),
            accelerations=self.pair(timed.accelerations),
            deviation=np.abs(self.pair(timed.deviation[None])[0]),
        )


@dataclass(frozen=True)
class Apart:
    """Collision model of a pair that moves as an image."""

    image: Image
    collisions: Collisions

    def watch(self, threshold: float) -> "_ImageWatch":
        """As `maniport.bodies.collisions.Collisions.watch`, in the right arm's joints."""
        return _ImageWatch(self.image, self.collisions.watch(threshold))

    def collides(self, q: Array) -> NDArray[np.bool_]:
        """Whether postures of the right arm (n, dof) let anything collide."""
        return self.collisions.collides(self.image.pair(q))


@dataclass(frozen=True)
class _ImageWatch:
    image: Image
    watch: DistanceWatch

    def gradient(self, q: Array) -> tuple[NDArray[np.intp], Array, Array]:
        """Rows, distances and slopes in the right arm's joints."""
        rows, distance, slope = self.watch.gradient(self.image.pair(q))
        left, right = self.image.arms.columns
        own = slope[:, right] + np.where(np.isin(right, left), 0.0, self.image.signs * slope[:, left])
        return rows, distance, own


def mirror_signs(limits: MotionLimits) -> Array | None:
    """Signs s (dof,) with which postures of the right arm are images of those of the left one: q_right = s q_left."""
    arms: Arms = limits.arm
    if arms.left.dof != arms.right.dof or arms.left.joint_units != arms.right.joint_units:
        return None
    zero = np.zeros(arms.left.dof)
    left, right = arms.left.jacobian(zero), arms.right.jacobian(zero)
    image = np.concatenate([MIRROR @ left[:3], -MIRROR @ left[3:]])  # a turn's direction is turned once more
    signs = np.where(np.sum(image * right, axis=0) < 0.0, -1.0, 1.0)
    tips = arms.left.forward(zero)[:3, 3] @ MIRROR, arms.right.forward(zero)[:3, 3]
    ends = np.sort(signs * np.stack([arms.left.lower, arms.left.upper]), axis=0)
    pairs = [(image, signs * right), tips, (ends, np.stack([arms.right.lower, arms.right.upper]))]
    for name in DERIVATIVES:
        values = getattr(limits, name)
        pairs.append((values[arms.columns[0]], values[arms.columns[1]]))
    return signs if all(_alike(*pair) for pair in pairs) else None


def mirrored(left: Schedule, right: Schedule, spec: EllipsoidSpec) -> bool:
    """Whether two arms are asked for images of one another; rotations and weights have none."""
    if any(one.rotations is not None or one.weights is not None for one in (left, right)):
        return False
    full = np.kron(np.diag([1.0, -1.0]), MIRROR)[spec.rows, spec.rows]
    images = [(full @ left.ellipsoids @ full, right.ellipsoids)]
    if left.positions is not None and right.positions is not None:
        images.append((left.positions @ MIRROR, right.positions))
    return (left.positions is None) == (right.positions is None) and all(_alike(*pair) for pair in images)


def _alike(one: Array, other: Array) -> bool:
    return bool(np.abs(one - other).max() <= 1e-9 * max(1.0, float(np.abs(other).max())))
