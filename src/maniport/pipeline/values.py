"""Values that the stages pass on; those of each arm are tuples over the arms, for two arms of a person left first."""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from maniport.arms import Arm, ArmGroup, EllipsoidSpec, as_group
from maniport.arms.human import hand_rotations
from maniport.errors import ManiportWarning
from maniport.evaluation import Evaluation
from maniport.mocap import ArmFit, HumanMotion, Recording
from maniport.motion import Placement, Planner, PlanSettings, RobotMotion, SeedBank
from maniport.motion.objective import Damping
from maniport.motion.search import interpolated_distance
from maniport.pipeline.config import Config
from maniport.pipeline.options import CONSTANT, FREE
from maniport.transfer import DomainAdapter
from maniport.transfer.rotation_group import orthonormal, rotation_angle
from maniport.util.defaults import DAMPING
from maniport.util.progress import Progress, no_progress
from maniport.util.sampling import evenly_spaced
from maniport.util.validation import Array, as_points

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
            motion=self.motion.only(rows),
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
    evaluation: Evaluation | None = None  # of a selected method


@dataclass(frozen=True, eq=False)
class Moved:
    """Motion of all arms, and where their paths were placed."""

    motion: RobotMotion
    placements: tuple[Placement, ...] | None


@dataclass(frozen=True, eq=False)
class MotionTargets:
    """Velocity ellipsoids (n, d, d), and paths (n, 3) [m] and rotations (n, 3, 3) of the end effectors, of each arm."""

    time: Array  # (n,) [s]
    profiles: tuple[Array, ...]
    paths: tuple[Array, ...] | None
    spec: EllipsoidSpec
    damping: Damping
    map_rotation: Array | None = None  # rotation of the ellipsoids by the maps, and of the paths (3, 3)
    rotations: tuple[Array, ...] | None = None
    direction: Array | None = None  # z axis of the end effectors in the base frame (3,), instead of rotations
    pointwise_bests: tuple[Array, ...] | None = None  # distances of the pointwise optima (n,), once placed

    def placement_rows(self, most: int = 80) -> NDArray[np.intp]:
        """Rows of the waypoints that a path is placed by, evenly spaced; more of them change little."""
        count = len(self.time)
        return np.arange(0, count, 1 + (count - 1) // most)

    def placed(self, placements: tuple[Placement, ...]) -> "MotionTargets":
        """Return the targets where the paths were placed, in the robot's base frame."""
        assert self.paths is not None
        rows, count, rotations = self.placement_rows(), len(self.time), self.rotations
        if rotations is not None:
            pairs = zip(placements, rotations, strict=True)
            rotations = tuple(np.asarray(own.rotation @ own.map_rotation @ rotation) for own, rotation in pairs)
        return replace(
            self,
            profiles=tuple(own.turned(profile) for own, profile in zip(placements, self.profiles, strict=True)),
            paths=tuple(own.apply(path) for own, path in zip(placements, self.paths, strict=True)),
            rotations=rotations,
            pointwise_bests=tuple(interpolated_distance(rows, own.pointwise_best, count) for own in placements),
        )

    @property
    def base_rotations(self) -> tuple[Array, ...] | None:
        """Target orientations in the base frame (n, 3, 3) of each arm, None where they are free."""
        if self.direction is None:
            return self.rotations
        z = self.direction / np.linalg.norm(self.direction)
        across = np.linalg.svd(z[None])[2][1]
        rotation = np.stack([across, np.cross(z, across), z], axis=1)
        return (np.tile(rotation, (len(self.time), 1, 1)),) * len(self.profiles)


def bounded_profiles(profiles: Sequence[Array], spec: EllipsoidSpec) -> tuple[Array, ...]:
    """Return profiles (n, d, d) as `EllipsoidSpec.bounded` has them: the inverses of force ellipsoids."""
    if spec.kind != "force":
        return tuple(profiles)
    return tuple(np.asarray(np.linalg.inv(as_points(profile, "profile"))) for profile in profiles)


def targets_of(human: Human, maps: Sequence[FittedMap], settings: Settings, largest_turn: float = 5.0) -> MotionTargets:
    """Map the demonstrated ellipsoids; collect all targets of the robot's motion.

    All paths get the mean rotation of the maps, with a warning where two differ by more than `largest_turn` [deg].
    """
    adapters, orientation = [own.adapter for own in maps], settings.config.motion.orientation
    profiles = [adapter.transform(profile) for adapter, profile in zip(adapters, human.profiles, strict=True)]
    strongest = max((own.student_regularization for own in adapters), key=lambda own: own.epsilon)
    turn = adapters[0].map_rotation_
    if len(adapters) > 1:
        turns = [adapter.map_rotation_ for adapter in adapters]
        angle = max(float(np.degrees(rotation_angle(turn, other))) for other in turns)
        if angle > largest_turn:
            text = (
                f"the adapters rotate ellipsoids by up to {angle:.0f}° differently; the paths get their mean rotation"
            )
            warnings.warn(text, ManiportWarning, stacklevel=2)
        turn = orthonormal(np.sum(turns, axis=0))
    targets = MotionTargets(
        human.fits[0].time,
        bounded_profiles(profiles, settings.spec),
        human.hands,
        settings.spec.bounded,
        strongest if strongest.epsilon > 0.0 and settings.spec.kind != "force" else DAMPING,
        turn,
    )
    if not isinstance(orientation, str):
        return replace(targets, direction=np.array(orientation))
    if orientation == FREE:
        return targets
    hands = [hand_rotations(fit.arm, fit.joint_angles) for fit in human.fits]
    if orientation == CONSTANT:
        hands = [np.broadcast_to(hand[0], hand.shape) for hand in hands]
    return replace(targets, rotations=tuple(hands))
