"""A robot's motion along target ellipsoids and paths: placed, planned and measured; with a person or without."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maniport.arms import Arm, ArmGroup, EllipsoidSpec, as_group
from maniport.errors import InvalidInputError, argument
from maniport.motion import (
    MotionLimits,
    Placement,
    Planner,
    RobotMotion,
    SeedBank,
    nearest_feasible,
    place_path,
    plan_motion,
)
from maniport.motion.demands import demands_of
from maniport.motion.search import interpolated_distance
from maniport.motion.targets import Damping, damping_of
from maniport.pipeline.config import Config
from maniport.pipeline.options import TransferOptions
from maniport.pipeline.results import ArmResult, MotionResult
from maniport.pipeline.settings import Settings, plan_settings, with_limits
from maniport.util.progress import Progress, Step, no_progress
from maniport.util.sampling import evenly_spaced
from maniport.util.validation import Array, as_finite, as_points, as_times

REAL_TIME_SCALES = (
    0.3,
    1.0,
)  # Range of scales at the person's speed; smaller motions are of little use


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
class MotionTargets:
    """Velocity ellipsoids (n, d, d), and paths (n, 3) [m] and rotations (n, 3, 3) of the end effectors, of each arm."""

    time: Array  # (n,) [s]
    profiles: tuple[Array, ...]
    paths: tuple[Array, ...] | None
    spec: EllipsoidSpec
    damping: Damping
    map_rotation: Array | None = (
        None  # rotation of the ellipsoids by the maps, and of the paths (3, 3)
    )
    hand_rotations: tuple[Array, ...] | None = (
        None  # they become `rotations` where the paths are placed
    )
    rotations: tuple[Array, ...] | None = None  # in the base frame
    pointwise_bests: tuple[Array, ...] | None = (
        None  # distances of the pointwise optima (n,), once placed
    )

    @property
    def rows(self) -> NDArray[np.intp]:
        """Rows of the waypoints that the paths are placed by, evenly spaced; more than 80 change little."""
        return np.arange(0, len(self.time), 1 + (len(self.time) - 1) // 80)

    def placed(self, placements: tuple[Placement, ...]) -> "MotionTargets":
        """Return the targets where the paths were placed, in the robot's base frame."""
        assert self.paths is not None
        rotations = self.rotations
        if self.hand_rotations is not None:
            pairs = zip(placements, self.hand_rotations, strict=True)
            rotations = tuple(
                np.asarray(own.rotation @ own.map_rotation @ hand) for own, hand in pairs
            )
        return replace(
            self,
            profiles=tuple(
                own.turned(profile) for own, profile in zip(placements, self.profiles, strict=True)
            ),
            paths=tuple(own.apply(path) for own, path in zip(placements, self.paths, strict=True)),
            rotations=rotations,
            pointwise_bests=tuple(
                interpolated_distance(self.rows, own.pointwise_best, len(self.time))
                for own in placements
            ),
        )


def bounded_profiles(profiles: Sequence[Array], spec: EllipsoidSpec) -> tuple[Array, ...]:
    """Return profiles (n, d, d) as `EllipsoidSpec.bounded` has them: the inverses of force ellipsoids."""
    if spec.kind != "force":
        return tuple(profiles)
    return tuple(np.asarray(np.linalg.inv(as_points(profile, "profile"))) for profile in profiles)


def along(direction: Sequence[float], count: int) -> Array:
    """Return rotations (count, 3, 3) of an end effector whose z axis has a direction (3,) in the base frame."""
    z = np.array(direction) / np.linalg.norm(direction)
    across = np.linalg.svd(z[None])[2][1]
    return np.tile(np.stack([across, np.cross(z, across), z], axis=1), (count, 1, 1))


def planner_of(settings: Settings, generator: np.random.Generator) -> Planner:
    """Sample the robot within its limits."""
    assert settings.control is not None
    limits = settings.control.motion_limits
    assert isinstance(limits, MotionLimits)
    step = Step(settings.progress, "Sample robot")
    planner = Planner.of(
        limits, settings.config.spec.bounded, settings.control.collisions, generator
    )
    step.end()
    return planner


def move(
    targets: MotionTargets, robot: SampledRobot, settings: Settings, placed: bool = True
) -> tuple[RobotMotion, tuple[Placement, ...] | None]:
    """Place the paths and plan a motion along them; where it collides, again with the second best placement."""
    if not placed:
        return plan(targets, robot, settings), None
    placements = place(targets, robot, settings)
    motion = plan(targets.placed(placements), robot, settings)
    if motion.clearance.share > 0.0 and len(placements[0].candidates) > 1:
        others = place(targets, robot, settings, rank=2)
        other = plan(targets.placed(others), robot, settings)
        if other.clearance.share < motion.clearance.share:
            placements, motion = others, other
    return motion, placements if settings.config.hand_targets == "placed" else None


def place(
    targets: MotionTargets, robot: SampledRobot, settings: Settings, rank: int = 1
) -> tuple[Placement, ...]:
    """Place the paths relative to the robot, by some of their waypoints; `rank` as in `place_path`."""
    assert targets.paths is not None
    assert robot.planner is not None
    arms, config, rows, demands = robot.planner.arms, settings.config, targets.rows, None
    scale: Any = config.scale
    if config.real_time:
        scale = REAL_TIME_SCALES if scale is None else scale
        pairs = zip(arms, targets.paths, strict=True)
        demands = [demands_of(own.limits, targets.time, path, rows) for own, path in pairs]
    placements: tuple[Placement, ...] = place_path(
        [path[rows] for path in targets.paths], [profile[rows] for profile in targets.profiles],
        [own.limits.arm for own in arms], time=targets.time[rows], map_rotation=targets.map_rotation,
        demands=demands, scale=scale, workspace=config.bounds.T,
        reachability_map=[own.reachability_map for own in arms],
        bank=[own.bank for own in arms], rank=rank, spec=targets.spec, damping=targets.damping,
        random_state=robot.random, progress=settings.progress,
    )  # fmt: skip
    return placements


def plan(targets: MotionTargets, robot: SampledRobot, settings: Settings) -> RobotMotion:
    """Plan a motion of all arms along targets in the base frame."""
    assert robot.planner is not None
    assert settings.control is not None
    return plan_motion(
        robot.planner.group, targets.profiles, time=targets.time, paths=targets.paths, rotations=targets.rotations,
        spec=targets.spec, damping=targets.damping, costs=settings.config.costs,
        hand_targets=settings.config.hand_targets, planner=robot.planner, pointwise_bests=targets.pointwise_bests,
        random_state=robot.random, progress=settings.progress, **vars(settings.control),
    )  # fmt: skip


def measure(
    motion: RobotMotion | None,
    placements: tuple[Placement, ...] | None,
    planner: Planner | None,
    names: Sequence[str],
    settings: Settings,
) -> tuple[ArmResult, ...]:
    """Return the motion of each arm with the feasibility gap of its targets."""
    results = []
    for i, (name, arm, spec) in enumerate(zip(names, settings.arms, settings.specs, strict=True)):
        result = ArmResult(name=name, robot=arm, spec=spec)
        if motion is not None and planner is not None and settings.control is not None:
            own, part, budget = planner.arms[i], motion.arms[i], settings.control.budget
            rows = evenly_spaced(len(part.target), budget.gap_points)
            nearest = nearest_feasible(
                own.limits.arm, part.target[rows], bank=own.bank, spec=part.spec, damping=part.damping,
                progress=settings.progress, n_starts=budget.gap_starts,
            )  # fmt: skip
            gap = np.interp(np.arange(len(part.target)), rows, nearest.distance)
            if part.pointwise_best is not None:  # its configurations are feasible, too
                gap = np.minimum(gap, part.pointwise_best)
            placement = None if placements is None else placements[i]
            result = replace(
                result,
                placement=placement,
                motion=part,
                gap=gap,
                collisions=own.reachability_map.collisions,
            )
        results.append(result)
    return tuple(results)


def follow_profile(
    robot: Arm | ArmGroup,
    profiles: Sequence[ArrayLike],
    time: ArrayLike | None,
    paths: Sequence[ArrayLike] | None = None,
    config: TransferOptions | None = None,
    *,
    damping: Damping | None = None,
    planner: Planner | None = None,
    progress: Progress | None = None,
    **options: Any,
) -> MotionResult:
    """Plan a motion of a robot along target ellipsoids without a person.

    Parameters
    ----------
    robot : Arm or ArmGroup
    profiles : sequence of array_like, shape (n, d, d)
        Target ellipsoids of each arm in its base frame, without damping, n ≥ 2.
    time : array_like, shape (n,)
        Increasing [s].
    paths : sequence of array_like, shape (n, 3), optional
        Target positions of each end effector [m].
    config : TransferOptions, optional
        Options of the ellipsoids, the motion and the seed; ``place`` places the paths relative to the robot first.
    damping : float or Regularization, optional
        Regularization of the ellipsoids. Default: the damping of the options.
    planner : Planner, optional
        A planner of this robot, as for `maniport.motion.plan_motion`.
    progress, **options
        As in `transfer_recording`; ``orientation`` must be free or a direction in the base frame, shape (3,).

    Raises
    ------
    ManiportError
        When an option does not exist or an input cannot be used.
    """
    if time is None:
        raise InvalidInputError(
            "the profile has no times; write it with an array 'time' (n,) in seconds"
        )
    config = Config.of(config).changed(
        allowed=("robot", "transfer", "motion", "placement"), **options
    )
    config, orientation = replace(config, verb="track"), config.orientation
    if isinstance(orientation, str) and orientation != "free":
        text = f"{argument('orientation')} must be free or a vector without a person; found {orientation!r}"
        raise InvalidInputError(text)
    robot = with_limits(robot, config)
    settings = Settings(
        config, robot, plan_settings(config, robot), progress=progress or no_progress
    )
    for name in ("workspace", "scale"):
        if getattr(config, name) is not None and (paths is None or not config.place):
            raise InvalidInputError(f"{argument(name)} is for a path that is placed; found none")
    group, generator, times = as_group(robot), np.random.default_rng(config.seed), as_times(time)
    for name, values in (("profiles", profiles), ("paths", paths)):
        shapes = [] if values is None else [np.shape(value) for value in values]
        if values is not None and [shape[:1] for shape in shapes] != [(len(times),)] * len(group):
            raise InvalidInputError(
                f"{name} must be {len(group)}, one for each arm, of shape ({len(times)}, ...) as time; found {shapes}"
            )
    spec, damping = config.spec.bounded, config.damping if damping is None else damping
    targets = MotionTargets(
        times,
        bounded_profiles([as_finite(profile, "profile") for profile in profiles], config.spec),
        None if paths is None else tuple(as_finite(path, "path") for path in paths),
        spec,
        damping_of(group.arms[0], spec, damping, positive=True),
        rotations=None
        if isinstance(orientation, str)
        else (along(orientation, len(times)),) * len(group),
    )
    sampled = SampledRobot(
        planner_of(settings, generator) if planner is None else planner, (), generator
    )
    motion, placements = move(targets, sampled, settings, placed=config.place and paths is not None)
    names = group.names if len(group) > 1 else (group.arms[0].name,)
    arms = measure(motion, placements, sampled.planner, names, settings)
    return MotionResult(robot=group, arms=arms, motion=motion, config=config)
