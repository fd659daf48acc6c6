"""Values that the stages of the main job pass on; those of each arm are tuples over the arms."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from maniport.arms import Arm, ArmGroup, EllipsoidSpec, as_group
from maniport.evaluation import Choice
from maniport.mocap import ArmFit, HumanMotion, Recording
from maniport.motion import Cost, Placement, PlanControl, Planner, RobotMotion
from maniport.motion.plan.plan_motion import PLACED
from maniport.transfer import DomainAdapter
from maniport.util.progress import Progress
from maniport.util.subsample import evenly_spaced
from maniport.util.validation import Array

MIN_FRAMES = 3  # frames without which there is no motion


@dataclass(frozen=True, eq=False)
class MotionSettings:
    """Checked settings of the motion."""

    robot: Arm | ArmGroup
    plan: PlanControl  # resolved for the robot
    progress: Progress
    costs: Sequence[Cost] = ()
    tracking: Mapping[str, Any] | None = None  # arguments of `track`; None without a controller
    tips: str = PLACED


@dataclass(frozen=True, eq=False)
class Settings:
    """Checked settings of a run; `maniport.pipeline.transfer.settings_of` makes them."""

    person: Mapping[str, Any]  # arguments of `fit_arm`
    robot: Arm | ArmGroup
    adapter: DomainAdapter | Mapping[str, Any]  # unfitted, or parameters of one that is selected
    spec: EllipsoidSpec
    base_rotation: Array
    n_teacher: int
    n_student: int
    orientation: str | tuple[float, ...]  # a word, or the z axis of the end effector in the base frame
    motion: MotionSettings | None  # None where the robot is not moved
    random_state: int
    progress: Progress

    @property
    def arms(self) -> tuple[Arm, ...]:
        """All arms of the robot."""
        return as_group(self.robot).arms

    @property
    def specs(self) -> tuple[EllipsoidSpec, ...]:
        """Ellipsoids of each arm."""
        return as_group(self.robot).specs(self.spec)


@dataclass(frozen=True, eq=False)
class Human:
    """Fitted arms of a person, with their ellipsoids (n, d, d) and hand paths (n, 3) [m] in one frame."""

    recording: Recording
    motion: HumanMotion
    profiles: tuple[Array, ...]
    hands: tuple[Array, ...]

    @property
    def fits(self) -> tuple[ArmFit, ...]:
        """Fit of each arm."""
        return self.motion.arms

    def subsampled(self, rate: float) -> "Human":
        """Keep at most so many frames a second [Hz], evenly spaced."""
        count = max(MIN_FRAMES, int(np.ceil(np.ptp(self.motion.time) * rate)) + 1)
        rows = evenly_spaced(len(self.motion), count)
        return replace(
            self,
            motion=replace(self.motion, arms=tuple(fit.thinned(count) for fit in self.fits)),
            profiles=tuple(profile[rows] for profile in self.profiles),
            hands=tuple(hand[rows] for hand in self.hands),
        )


@dataclass(frozen=True, eq=False)
class SampledRobot:
    """A robot's domains and planner, which many recordings share."""

    planner: Planner | None  # None where the robot is not moved
    domains: tuple[Array, ...]  # (m, d, d) of each arm
    random: np.random.Generator  # state after sampling; each motion uses a copy


@dataclass(frozen=True, eq=False)
class FittedMap:
    """A fitted map of ellipsoids from an arm of the person to an arm of the robot."""

    adapter: DomainAdapter
    teacher: Array  # domain of the person's arm (m, d, d)
    seconds: float
    choice: Choice | None = None


@dataclass(frozen=True, eq=False)
class Moved:
    """Motion of all arms, and where their paths were placed."""

    motion: RobotMotion
    free: RobotMotion | None
    placements: tuple[Placement, ...] | None
