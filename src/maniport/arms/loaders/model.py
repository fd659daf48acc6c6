"""Robots as trees of bodies, as readers of robot files describe them."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from maniport.arms.chain import PRISMATIC, Joint, Shape
from maniport.util.validation import Array


@dataclass(frozen=True)
class Follower:
    """A joint whose position is ``factor · leader + offset``; without a leader it is constant."""

    leader: str | None
    factor: float
    offset: float
    linear: bool = True


@dataclass(frozen=True, eq=False)
class RobotBody:
    """A body, and the joints that move it against its parent."""

    name: str
    parent: str | None
    placement: Array  # its pose (4, 4) in the frame of the last of its joints, or of the parent without joints
    joints: tuple[Joint, ...] = ()  # the first is placed in the frame of the parent
    blocked: str = ""  # type of a joint with several axes, which is at rest
    inertia: Array | None = None  # spatial inertia (6, 6) in its frame; None if only shapes determine it
    welds: tuple[str, ...] = ()  # names of fixed joints, which files may declare as mimic joints


@dataclass(eq=False)
class RobotModel:
    """Bodies of a robot with a parent before its children, sites, and limits of all joints with one axis."""

    path: Path
    name: str
    shapes: Callable[..., Iterable[Shape]]  # of an XML document; see `maniport.arms.loaders.document.read_shapes`
    bodies: dict[str, RobotBody] = field(default_factory=dict)
    sites: dict[str, tuple[str, Array]] = field(default_factory=dict)  # body, and the pose (4, 4) in its frame
    followers: dict[str, Follower] = field(default_factory=dict)
    bounds: dict[str, tuple[float, float]] = field(default_factory=dict)  # [rad] or [m]
    speeds: dict[str, float] = field(default_factory=dict)  # infinite where unknown
    efforts: dict[str, float] = field(default_factory=dict)  # infinite where unknown
    unlimited: list[str] = field(default_factory=list)
    closed: dict[str, tuple[float, float]] = field(default_factory=dict)  # limits that exclude all positions

    def joint(
        self,
        name: str,
        kind: str,
        axis: Array,
        placement: Array,
        bounds: tuple[float, float],
        speed: float = np.inf,
        effort: float = np.inf,
    ) -> Joint:
        """Make a joint with one axis and note its limits."""
        huge = 100.0 if kind == PRISMATIC else 20 * np.pi  # what is larger means "no limit" [m or rad]
        if bounds[0] >= bounds[1] and any(bounds):
            self.closed[name] = bounds
        if not (-huge < bounds[0] < bounds[1] < huge):
            self.unlimited.append(name)
            bounds = (-np.inf, np.inf) if kind == PRISMATIC else (-np.pi, np.pi)
        self.bounds[name] = bounds
        self.speeds[name], self.efforts[name] = (limit if 0 < limit < 1e6 else np.inf for limit in (speed, effort))
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):  # `Joint` checks the axis
            return Joint(name, kind, axis / np.linalg.norm(axis), placement)

    def line(self, body: str) -> list[str]:
        """Return a body and all bodies that carry it, the nearest first."""
        names = [body]
        while (parent := self.bodies[names[-1]].parent) is not None:
            names.append(parent)
        return names
