"""Values that the stages pass on; those of each arm are tuples over the arms, for two arms of a person left first."""

from dataclasses import dataclass, replace

import numpy as np

from maniport.arms import Arm, ArmGroup, EllipsoidSpec, as_group
from maniport.evaluation import Evaluation
from maniport.mocap import ArmFit, HumanMotion, Recording
from maniport.motion import Placement, Planner, PlanSettings, RobotMotion, SeedBank
from maniport.pipeline.config import Config
from maniport.transfer import DomainAdapter
from maniport.util.progress import Progress, no_progress
from maniport.util.sampling import evenly_spaced
from maniport.util.validation import Array

MIN_FRAMES = 3  # frames without which there is no motion


@dataclass(frozen=True, eq=False)
class Settings:
    """A configuration with the robot loaded and all options checked for it."""

    config: Config
    robot: Arm | ArmGroup
    control: PlanSettings | None  # resolved for the robot; None where it is not moved
    adapter: DomainAdapter | None = None  # unfitted; None where a method is selected
    progress: Progress = no_progress

    @property
    def arms(self) -> tuple[Arm, ...]:
        """All arms of the robot."""
        return as_group(self.robot).arms

    @property
    def stands(self) -> list[Array]:
        """Origin of the base of each arm in the robot's frame [m]."""
        return [np.zeros(3) if arm.chain.stand is None else arm.chain.stand[:3, 3] for arm in self.arms]

    @property
    def spec(self) -> EllipsoidSpec:
        """Ellipsoids of the robot."""
        return self.config.transfer.spec

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
            motion=replace(self.motion, arms=tuple(fit.only(rows) for fit in self.fits)),
            profiles=tuple(profile[rows] for profile in self.profiles),
            hands=tuple(hand[rows] for hand in self.hands),
        )


@dataclass(frozen=True, eq=False)
class SampledRobot:
    """A robot's domains and planner, which many recordings share."""

    planner: Planner | None  # None where the robot is not moved
    domains: tuple[Array, ...]  # (m, d, d) of each arm
    random: np.random.Generator  # state after sampling; each motion uses a copy

    def bank(self, arm: int, spec: EllipsoidSpec) -> SeedBank | None:
        """Return the planner's samples of an arm where they are of these ellipsoids."""
        return None if self.planner is None or spec.bounded != spec else self.planner.arms[arm].bank


@dataclass(frozen=True, eq=False)
class FittedMap:
    """A fitted map of ellipsoids from an arm of the person to an arm of the robot."""

    adapter: DomainAdapter
    teacher: Array  # domain of the person's arm (m, d, d)
    seconds: float
    evaluation: Evaluation | None = None  # of a selected method


@dataclass(frozen=True, eq=False)
class Moved:
    """Motion of all arms, and where their paths were placed."""

    motion: RobotMotion
    placements: tuple[Placement, ...] | None
