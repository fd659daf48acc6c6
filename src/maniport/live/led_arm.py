"""An arm of the person that leads one of the robot."""

from typing import NamedTuple

import numpy as np

from maniport.arms import EllipsoidSpec
from maniport.errors import InvalidInputError, NotSPDError
from maniport.live.person import ArmEstimate, OneEuroFilter, Person
from maniport.motion import Placement
from maniport.transfer import DomainAdapter
from maniport.util.validation import Array


class Target(NamedTuple):
    """The target of an arm in the base frame."""

    ellipsoid: Array  # (d, d)
    position: Array | None  # (3,), of the end effector [m]
    velocity: Array | None = None  # (3,), of the position between the last two frames [m/s]


class LedArm:
    """An arm of the robot and of the person who leads it: the person's estimate, and the target of the robot."""

    def __init__(
        self,
        person: Person,
        rows: list[int],
        adapter: DomainAdapter,
        base: Array,
        path: Placement | None,
        spec: EllipsoidSpec,
    ):
        self.person, self._rows, self._map, self._spec, self._path = person, rows, adapter.compiled(), spec, path
        if (size := len(adapter.teacher_mean_)) != spec.size:
            raise InvalidInputError(f"adapter must map {spec.size}×{spec.size} ellipsoids; found {size}×{size}")
        if path is not None:  # an affine map is determined by its images of the origin and of the axes
            self._turn, self._origin = spec.rotation(path.rotation), path.apply(base)
            self._axes = path.apply(base + np.eye(3)) - self._origin
        self.forget()

    def forget(self) -> None:
        """Forget all frames."""
        self._last_seen = -np.inf
        self._filter = OneEuroFilter(self.person.count) if self.person.is_noisy else None
        self.estimate: ArmEstimate | None = None
        self.target: Target | None = None
        self.demonstrated: Array | None = None  # (d, d)

    def update(self, positions: Array, now: float, hold_after: float, resting: bool) -> bool:
        """Update estimate and target with a frame; False where the arm is not seen in it, or jumps."""
        vectors, before, last = self.person.vectors(positions[self._rows]), self.estimate, self.target
        directions, dt = self.person.directions(vectors), now - self._last_seen
        if directions is None or (before is not None and self.person.jumps(before, directions, dt)):
            return False
        if self._filter is not None:
            directions = self.person.directions(self._filter(vectors, now))
            if directions is None:
                return False
        if before is None or resting or dt > hold_after:
            estimate = self.person.begin(directions, None if before is None else before.q)
        else:
            estimate = self.person.follow(before, directions, dt)
            if self.person.is_too_fast(before, estimate, dt):
                return False
        try:
            self.demonstrated, target = self.target_of(estimate.q)
        except NotSPDError:  # a flat ellipsoid, which an adapter without damping does not map
            return False
        self.estimate, self._last_seen = estimate, now
        if last is not None and last.position is not None and target.position is not None and dt <= hold_after:
            target = target._replace(velocity=(target.position - last.position) / dt)
        self.target = target
        return True

    def target_of(self, angles: Array) -> tuple[Array, Target]:
        """Demonstrated ellipsoid, and the target of the robot, for joint angles of the person."""
        demonstrated, hand = self.person.hand(angles, self._spec)
        target = self._map(demonstrated)
        if self._spec.kind == "force":
            target = np.asarray(np.linalg.inv(target))
        if self._path is None:
            return demonstrated, Target(target, None)
        turned = self._turn @ target @ self._turn.T
        return demonstrated, Target(0.5 * (turned + turned.T), hand @ self._axes + self._origin)
