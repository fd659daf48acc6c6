"""A robot's motion along target ellipsoids and paths: placed, planned and measured; with a person or without."""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from maniport.arms import Arm, ArmGroup, EllipsoidSpec, as_group
from maniport.arms.manipulability import JOINT_LIMITS
from maniport.domain import sample_domain
from maniport.errors import InvalidInputError, ManiportWarning, argument, collected_warnings
from maniport.motion import (
    MotionLimits,
    Placement,
    PlacementOptions,
    Planner,
    RobotMotion,
    SeedBank,
    nearest_feasible,
    place_path,
)
from maniport.motion.arm_model import require_trackable
from maniport.motion.plan.plan_motion import plan_checked
from maniport.motion.plan.planner import ArmPlanner
from maniport.motion.robot_motion import ArmMotion
from maniport.motion.targets import (
    TargetTrajectory,
    as_rotations,
    damping_of,
    targets_of_arms,
)
from maniport.pipeline.config import Config
from maniport.pipeline.options import TransferOptions
from maniport.pipeline.results import ArmResult, MotionResult
from maniport.pipeline.robots import load_robot
from maniport.pipeline.settings import Settings, plan_options, with_limits
from maniport.util.progress import Progress, Step, no_progress
from maniport.util.sampling import evenly_spaced
from maniport.util.validation import Array, as_points


@dataclass(frozen=True, eq=False)
class SampledRobot:
    """A robot's domains and planner, which many recordings share."""

    planner: Planner | None  # None where the robot is not moved
    domains: tuple[Array, ...]  # (m, d, d) of each arm
    random: np.random.Generator  # state after sampling; each motion uses a copy
    warnings: tuple[str, ...] = ()

    @classmethod
    def sample(cls, settings: Settings) -> "SampledRobot":
        """Make the planner, unless the robot cannot or shall not move, and sample the robot's domains."""
        config = settings.config
        generator = np.random.default_rng(config.seed)
        with collected_warnings() as texts:
            planner = None
            if settings.plan is not None and _is_trackable(settings):
                planner = planner_of(settings, generator)
            _warn_without_gravity(settings)
            step = Step(settings.progress, "Sample robot ellipsoids")
            domains = sample_domain(
                settings.robot,
                config.n_student,
                config.seed + 1,
                spec=config.spec,
                collisions=None if planner is None else planner.collisions,
            )
            step.end()
        if domains.ndim == 3:
            domains = domains[None]
        return cls(planner, tuple(domains), generator, tuple(texts))

    def bank(self, arm: int, spec: EllipsoidSpec) -> SeedBank | None:
        """Return the planner's samples of an arm where they are of these ellipsoids."""
        if self.planner is None or spec.bounded != spec:
            return None
        return self.planner.arms[arm].bank


def _is_trackable(settings: Settings) -> bool:
    """Whether all arms can follow ellipsoids, with a warning where one cannot."""
    try:
        for arm, spec in zip(settings.arms, settings.specs, strict=True):
            require_trackable(arm, spec)
    except InvalidInputError as error:
        warnings.warn(f"the robot was not moved: {error}", ManiportWarning, stacklevel=2)
        return False
    return True


def _warn_without_gravity(settings: Settings) -> None:
    """Warn where forces are limited by torques, and gravity is unknown."""
    spec = settings.config.spec
    if spec.kind != "force" or spec.joint_weights != JOINT_LIMITS:
        return
    weightless = [arm.name for arm in settings.arms if arm.chain.inertia is None]
    if weightless:
        text = f"forces are without gravity: the description of {weightless[0]!r} has no masses"
        warnings.warn(text, ManiportWarning, stacklevel=2)


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
    assert settings.plan is not None
    limits = settings.plan.motion_limits
    assert isinstance(limits, MotionLimits)
    step = Step(settings.progress, "Sample robot")
    planner = Planner.of(limits, settings.config.spec.bounded, settings.plan.collisions, generator)
    step.end()
    return planner


def move(
    targets: tuple[TargetTrajectory, ...],
    robot: SampledRobot,
    settings: Settings,
    map_rotation: Array | None = None,
    placed: bool = True,
    pointwise: bool = True,
) -> tuple[RobotMotion, tuple[Placement, ...] | None]:
    """Place the paths and plan a motion along them; where it collides, along the next best placements.

    `map_rotation` (3, 3) is that of the ellipsoids by the maps, which the paths get, too; `pointwise` as in `plan`.
    """
    if not placed:
        return plan(targets, robot, settings), None
    motions = []
    ranked = place(targets, robot, settings, map_rotation)
    for placements in ranked:
        placed_targets = []
        starts = []
        for placement, target in zip(placements, targets, strict=True):
            placed_targets.append(placement.moved(target))
            starts.append(placement.joint_positions)
        motions.append(plan(placed_targets, robot, settings, starts, pointwise))
        if motions[-1].clearance.share == 0.0:
            break
    shares = [motion.clearance.share for motion in motions]
    best = shares.index(min(shares))
    if settings.config.hand_targets != "placed":
        return motions[best], None
    return motions[best], ranked[best]


def place(
    targets: tuple[TargetTrajectory, ...],
    robot: SampledRobot,
    settings: Settings,
    map_rotation: Array | None,
    options: PlacementOptions | None = None,
) -> list[tuple[Placement, ...]]:
    """Return placements of the paths relative to the robot, from the best to the worst."""
    assert robot.planner is not None
    if options is None:
        options = settings.config.placement
    return place_path(
        robot.planner.group,
        targets,
        options,
        map_rotation=map_rotation,
        planner=robot.planner,
        plan=settings.plan,
        random_state=robot.random,
        progress=settings.progress,
    )


def plan(
    targets: Sequence[TargetTrajectory],
    robot: SampledRobot,
    settings: Settings,
    starts: Sequence[Array] | None = None,
    pointwise: bool = True,
) -> RobotMotion:
    """Plan a motion of all arms along targets in the base frame.

    `starts` are those of `plan_motion`; `pointwise`: whether the pointwise optimum is searched.
    """
    assert robot.planner is not None
    assert settings.plan is not None
    count = len(targets[0])
    orientation = settings.config.orientation
    if not isinstance(orientation, str):
        rotations = as_rotations(along(orientation, count))
        targets = [replace(target, rotations=rotations) for target in targets]
    return plan_checked(
        robot.planner,
        targets,
        settings.plan,
        starts=starts,
        random=robot.random,
        progress=settings.progress,
        pointwise=pointwise,
    )


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
        if motion is not None and planner is not None and settings.plan is not None:
            planner_arm = planner.arms[i]
            result = replace(
                result,
                placement=None if placements is None else placements[i],
                motion=motion.arms[i],
                gap=feasibility_gap(motion.arms[i], planner_arm, settings),
                collisions=planner_arm.reachability_map.collisions,
            )
        results.append(result)
    return tuple(results)


def feasibility_gap(motion: ArmMotion, planner: ArmPlanner, settings: Settings) -> Array:
    """Return distances of the targets of an arm to its feasible set, shape (n,), with its share of the limits."""
    assert settings.plan is not None
    budget = settings.plan.budget
    rows = evenly_spaced(len(motion.target), budget.gap_points)
    nearest = nearest_feasible(
        planner.limits.arm,
        motion.target[rows],
        bank=planner.bank,
        spec=motion.spec,
        damping=motion.damping,
        progress=settings.progress,
        n_starts=budget.gap_starts,
    )
    gap = np.interp(np.arange(len(motion.target)), rows, nearest.distance)
    if motion.pointwise_best is not None:  # its configurations are feasible, too
        gap = np.minimum(gap, motion.pointwise_best)
    return gap


def follow_profile(
    robot: Arm | ArmGroup,
    targets: TargetTrajectory | Sequence[TargetTrajectory],
    config: TransferOptions | None = None,
    *,
    planner: Planner | None = None,
    progress: Progress | None = None,
    **options: Any,
) -> MotionResult:
    """Plan a motion of a robot along target ellipsoids without a person.

    Parameters
    ----------
    robot : Arm or ArmGroup
        Without a payload; that of the options is added. Those of its other options are not used.
    targets : TargetTrajectory or sequence of TargetTrajectory
        Targets of the arm, or of each arm of a group, in its base frame. Their ellipsoids are those of the options.
    config : TransferOptions, optional
        Options of the ellipsoids, the motion and the seed; ``place`` places the paths relative to the robot first.
    planner : Planner, optional
        A planner of this robot, as for `maniport.motion.plan_motion`.
    progress, **options
        As in `transfer_recording`; ``orientation`` must be free or a direction in the base frame, shape (3,).

    Raises
    ------
    ManiportError
        When an option does not exist or an input cannot be used.
    """
    config = Config.of(config).changed(
        allowed=("robot", "transfer", "motion", "placement"), **options
    )
    config = replace(config.changed(robot=robot), verb="track")
    orientation = config.orientation
    if isinstance(orientation, str) and orientation != "free":
        text = f"{argument('orientation')} must be free or a vector without a person; found {orientation!r}"
        raise InvalidInputError(text)
    require_no_directions(config)
    limited = with_limits(load_robot(config, both=False), config)
    robot = limited.robot
    group = as_group(robot)
    settings = Settings(
        config, robot, plan_options(config, robot, limited.limits), progress=progress or no_progress
    )

    checked = targets_of_arms(robot, targets)
    if checked[0].damping.damping is not None:  # that of the options is not used
        config = config.changed(damping=checked[0].damping.damping)
    is_placed = config.place and checked[0].positions is not None
    if not is_placed:
        _require_no_placement(config)
    bounded = []
    for target, spec in zip(checked, settings.specs, strict=True):
        if target.spec != spec:
            raise InvalidInputError(
                f"targets must be of the ellipsoids of the options, {spec}; found {target.spec}"
            )
        bounded.append(bounded_targets(target, group.arms[0]))

    generator = np.random.default_rng(config.seed)
    if planner is None:
        planner = planner_of(settings, generator)
    sampled = SampledRobot(planner, (), generator)
    motion, placements = move(tuple(bounded), sampled, settings, placed=is_placed)
    names = group.names if len(group) > 1 else (group.arms[0].name,)
    arms = measure(motion, placements, sampled.planner, names, settings)
    return MotionResult(robot=group, arms=arms, motion=motion, config=config)


def _require_no_placement(config: Config) -> None:
    """Raise where options of a placement are given."""
    for name in ("workspace", "scale", "yaw", "offset"):
        if getattr(config, name) is not None:
            raise InvalidInputError(f"{argument(name)} is for a path that is placed; found none")


def require_no_directions(options: TransferOptions) -> None:
    """Raise `InvalidInputError` where files give lines: without a person, motions have none."""
    if options.directions:
        raise InvalidInputError(
            f"{argument('directions')} is for motions of a person; leave it out, or transfer a recording"
        )


def bounded_targets(target: TargetTrajectory, arm: Arm) -> TargetTrajectory:
    """Return targets of `EllipsoidSpec.bounded`: of the inverses of force ellipsoids, with the damping of an arm."""
    if target.spec.kind != "force":
        return target
    spec = target.spec.bounded
    damping = target.damping
    if damping.damping is not None:  # relative to the ellipsoids of the arm
        damping = damping_of(arm, spec, damping.damping, positive=True)
    (ellipsoids,) = bounded_profiles([target.ellipsoids], target.spec)
    return replace(target, ellipsoids=ellipsoids, spec=spec, damping=damping)
