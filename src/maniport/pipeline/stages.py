"""The method as stages, each a function from frozen values to a frozen value.

    load → fit_human → sample_robot → fit_transfer → targets_of → place → plan → evaluate

One arm is a group of one: values that belong to an arm are tuples over the arms, for two arms of a person left first.
"""

import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from maniport.arms import Arm, as_group
from maniport.arms.manipulability import JOINT_LIMITS
from maniport.domain import sample_domain
from maniport.errors import InvalidInputError, ManiportWarning, RecordingError
from maniport.evaluation import Capability, compare_capabilities, select_method
from maniport.evaluation import evaluate as compare_with_baselines
from maniport.evaluation.comparison import with_feasible_set
from maniport.mocap import ArmFit, HumanMotion, Recording, fit_arms
from maniport.motion import (
    MotionLimits,
    Placement,
    Planner,
    nearest_feasible,
    place_path,
    plan_motion,
)  # fmt: skip
from maniport.motion.arm_model import require_trackable
from maniport.motion.demands import demands_of
from maniport.motion.plan.plan_motion import PLACED
from maniport.pipeline.demonstrations import LearnedProfile
from maniport.pipeline.results import ArmResult, ArmTransfer, TransferResult
from maniport.pipeline.values import MIN_FRAMES, FittedMap, Human, MotionTargets, Moved, SampledRobot, Settings
from maniport.transfer import LengthField, method_of, name_of
from maniport.util.sampling import evenly_spaced
from maniport.util.validation import Array

REAL_TIME_SCALES = (0.2, 1.0)  # Range of scales at the person's speed; smaller motions are of little use


def load(recording: Recording | str | Path, settings: Settings) -> Recording:
    """Read a recording, or the part of it that is used."""
    settings.progress("Read recording", 0.0)
    motion = settings.config.human.read(recording)
    _require_frames(motion, len(motion), "frames")
    settings.progress("Read recording", 1.0, f"{len(motion)} frames, {motion.duration:.1f} s at {motion.rate:.4g} Hz")
    return motion


def fit_human(recording: Recording | LearnedProfile, settings: Settings) -> Human:
    """Fit one or both arms of the person; a learned profile has its arms already."""
    if isinstance(recording, LearnedProfile):
        if recording.spec != settings.spec:
            raise InvalidInputError(
                f"spec must be that of the learned profile, {recording.spec}; found {settings.spec}"
            )
        parts, reference = recording.each_arm(), recording.reference
        profiles, hands = [part.profile for part in parts], [part.path for part in parts]
        recording, motion = reference.recording, reference.motion
    else:
        motion = fit_arms(recording, **settings.config.human.fit_options, progress=settings.progress)
        _require_frames(recording, len(motion), "frames with the arm fully observed")
        profiles = [fit.arm.ellipsoids(fit.joint_angles, settings.spec) for fit in motion.arms]
        hands = list(motion.hands)
    own, count = len(motion.arms), len(settings.arms)
    if own > count:
        raise InvalidInputError(f"the profile is of {own} arms, and the robot has {count}")
    if own < count:  # each robot arm moves in front of its own base
        stands = np.array(settings.stands)
        bases = stands - stands.mean(axis=0)
        motion, profiles = HumanMotion(motion.arms * count, bases), profiles * count
        hands = [hands[0] + base for base in bases]
    return Human(recording, motion, tuple(profiles), tuple(hands))


def sample_robot(settings: Settings) -> SampledRobot:
    """Make the planner, unless the robot cannot or shall not move, and sample the robot's domains."""
    generator, planner = np.random.default_rng(settings.config.seed), None
    if settings.control is not None:
        try:
            for arm, spec in zip(settings.arms, settings.specs, strict=True):
                require_trackable(arm, spec)
        except InvalidInputError as error:
            warnings.warn(f"the robot was not moved: {error}", ManiportWarning, stacklevel=2)
        else:
            planner = planner_of(settings, generator)
    weightless = [arm.name for arm in settings.arms if arm.chain.inertia is None]
    if settings.spec.kind == "force" and settings.spec.joint_weights == JOINT_LIMITS and weightless:
        text = f"forces are without gravity: the description of {weightless[0]!r} has no masses"
        warnings.warn(text, ManiportWarning, stacklevel=2)
    step, count, seed = "Sample robot ellipsoids", settings.config.transfer.n_student, settings.config.seed + 1
    settings.progress(step, 0.0)
    options: dict[str, Any] = {"collisions": None if planner is None else planner.collisions, "spec": settings.spec}
    domains = sample_domain(settings.robot, count, seed, **options)
    settings.progress(step, 1.0)
    return SampledRobot(planner, tuple(domains) if domains.ndim == 4 else (domains,), generator)


def planner_of(settings: Settings, generator: np.random.Generator) -> Planner:
    """Sample the robot within its limits."""
    assert settings.control is not None
    limits = settings.control.motion_limits
    assert isinstance(limits, MotionLimits)
    settings.progress("Sample robot", 0.0)
    planner = Planner.of(limits, settings.spec.bounded, settings.control.collisions, generator)
    settings.progress("Sample robot", 1.0)
    return planner


def fit_transfer(human: Human, robot: SampledRobot, settings: Settings) -> tuple[FittedMap, ...]:
    """Fit the map of ellipsoids for each arm, by the method of the settings or a selected one."""
    return tuple(
        fit_map(fit.arm, profile, robot, settings, arm)
        for arm, (fit, profile) in enumerate(zip(human.fits, human.profiles, strict=True))
    )


def fit_map(person: Arm, profile: Array | None, robot: SampledRobot, settings: Settings, arm: int = 0) -> FittedMap:
    """Fit the map from a person's arm to an arm of the robot; a selection needs the demonstrated profile (n, d, d)."""
    teacher, student, spec = sample_teacher(person, settings), robot.domains[arm], settings.specs[arm]
    bank, progress = robot.bank(arm, spec), settings.progress
    seed, options = settings.config.seed, settings.config.transfer
    if settings.adapter is None:
        assert profile is not None
        adapter, evaluation = select_method(
            teacher, student, profile, robot=settings.arms[arm], spec=spec, bank=bank,
            random_state=seed, progress=progress, base_rotation=options.rotation, damping=options.damping or None,
        )  # fmt: skip
        return FittedMap(adapter, teacher, evaluation)
    progress("Fit transfer", 0.0)
    adapter = with_feasible_set(method_of(settings.adapter), settings.arms[arm], spec, bank, seed)
    adapter.fit(teacher, student)
    if isinstance(adapter, LengthField) and (failures := adapter.report_.failures()):
        text = "the length field maps this robot badly, parallel-transport does not: " + "; ".join(failures)
        warnings.warn(text, ManiportWarning, stacklevel=2)
    progress("Fit transfer", 1.0, f"{adapter.n_iter_} iterations; {adapter.stop_reason_}")
    return FittedMap(adapter, teacher)


def sample_teacher(person: Arm, settings: Settings) -> Array:
    """Sample the domain of a person's arm, shape (n_teacher, d, d)."""
    step, count = "Sample human ellipsoids", settings.config.transfer.n_teacher
    settings.progress(step, 0.0)
    domain = sample_domain(person, count, settings.config.seed, spec=settings.spec)
    settings.progress(step, 1.0)
    return domain


def place(targets: MotionTargets, robot: SampledRobot, settings: Settings, rank: int = 1) -> tuple[Placement, ...]:
    """Place the paths relative to the robot, by some of their waypoints; `rank` as in `place_path`."""
    assert targets.paths is not None
    assert settings.control is not None
    assert robot.planner is not None
    arms, options, rows, demands = robot.planner.arms, settings.config.motion, targets.placement_rows(), None
    scale: Any = options.scale
    if options.real_time:
        scale = REAL_TIME_SCALES if scale is None else scale
        pairs = zip(arms, targets.paths, strict=True)
        demands = [demands_of(own.limits, targets.time, path, rows) for own, path in pairs]
    placements: tuple[Placement, ...] = place_path(
        [path[rows] for path in targets.paths], [profile[rows] for profile in targets.profiles],
        [own.limits.arm for own in arms], time=targets.time[rows], map_rotation=targets.map_rotation,
        demands=demands, scale=scale, workspace=options.bounds.T,
        reachability_map=[own.reachability_map for own in arms],
        bank=[own.bank for own in arms], rank=rank, spec=targets.spec, damping=targets.damping,
        random_state=robot.random, progress=settings.progress,
    )  # fmt: skip
    return placements


def plan(
    targets: MotionTargets, placements: tuple[Placement, ...] | None, robot: SampledRobot, settings: Settings
) -> Moved:
    """Plan a motion of all arms along the placed targets; where it collides, again with the second best placement."""
    moved = plan_at(placements, targets, robot, settings)
    if placements is None or moved.motion.clearance.share == 0.0 or len(placements[0].candidates) < 2:
        return moved
    again = plan_at(place(targets, robot, settings, rank=2), targets, robot, settings)
    return min(moved, again, key=lambda result: result.motion.clearance.share)


def plan_at(
    placements: tuple[Placement, ...] | None, targets: MotionTargets, robot: SampledRobot, settings: Settings
) -> Moved:
    """Plan a motion at given placements."""
    planner, control, options = robot.planner, settings.control, settings.config.motion
    hand_targets = settings.config.robot.hand_targets
    assert planner is not None
    assert control is not None
    placed = targets if placements is None else targets.placed(placements)
    motion = plan_motion(
        planner.group, placed.profiles, time=placed.time, paths=placed.paths, rotations=placed.base_rotations,
        spec=placed.spec, damping=placed.damping, costs=options.costs, hand_targets=hand_targets, planner=planner,
        pointwise_bests=placed.pointwise_bests, random_state=robot.random, progress=settings.progress, **vars(control),
    )  # fmt: skip
    return Moved(motion, placements if hand_targets == PLACED else None)


def measure(
    moved: Moved | None, planner: Planner | None, names: Sequence[str], settings: Settings
) -> tuple[ArmResult, ...]:
    """Return the motion of each arm with the feasibility gap of its targets."""
    if moved is None:
        return tuple(
            ArmResult(name=name, robot=arm, spec=spec)
            for name, arm, spec in zip(names, settings.arms, settings.specs, strict=True)
        )
    assert planner is not None
    assert settings.control is not None
    budget, results = settings.control.budget, []
    for i, (own, motion) in enumerate(zip(planner.arms, moved.motion.arms, strict=True)):
        rows = evenly_spaced(len(motion.target), budget.gap_points)
        nearest = nearest_feasible(
            own.limits.arm, motion.target[rows], bank=own.bank, spec=motion.spec, damping=motion.damping,
            progress=settings.progress, n_starts=budget.gap_starts,
        )  # fmt: skip
        results.append(
            ArmResult(
                name=names[i],
                robot=settings.arms[i],
                spec=settings.specs[i],
                placement=None if moved.placements is None else moved.placements[i],
                motion=motion,
                gap=np.interp(np.arange(len(motion.target)), rows, nearest.distance),
                collisions=own.reachability_map.collisions,
            )
        )
    return tuple(results)


def evaluate(
    human: Human,
    robot: SampledRobot,
    maps: Sequence[FittedMap],
    moved: Moved | None,
    settings: Settings,
    baselines: bool = True,
) -> TransferResult:
    """Compare each map with baselines, and measure the motion."""
    names, transfers = [str(fit.arm.side or arm.name) for fit, arm in zip(human.fits, settings.arms, strict=True)], []
    if len(set(names)) < len(names):
        names = list(as_group(settings.robot).names)
    parts = measure(moved, robot.planner, names, settings)
    for i, (part, own, profile) in enumerate(zip(parts, maps, human.profiles, strict=True)):
        evaluation = own.evaluation
        if evaluation is None and baselines:
            evaluation = compare_with_baselines(
                own.adapter, own.teacher, robot.domains[i], profile, robot=part.robot,
                spec=settings.specs[i], bank=robot.bank(i, settings.spec), n_domain=0,
                random_state=settings.config.seed, progress=settings.progress,
            )  # fmt: skip
        transfers.append(
            ArmTransfer(
                **vars(part),
                fit=human.fits[i], person_base=human.motion.bases[i], time=human.fits[i].time,
                method=name_of(own.adapter), adapter=own.adapter, evaluation=evaluation,
                demonstrated_profile=profile, target_profile=own.adapter.transform(profile),
                teacher_domain=own.teacher, student_domain=robot.domains[i],
                capabilities=_capabilities(human.fits[i], part, own, settings),
            )
        )  # fmt: skip
    return TransferResult(
        robot=as_group(settings.robot), arms=tuple(transfers), motion=None if moved is None else moved.motion,
        random_state=settings.config.seed, recording=human.recording, spec=settings.spec,
        base_rotation=settings.config.transfer.rotation,
    )  # fmt: skip


def _capabilities(fit: ArmFit, part: ArmResult, own: FittedMap, settings: Settings) -> tuple[Capability, ...]:
    """Compare force and speed of the translation of a motion with the person's; nothing where there is no motion."""
    if part.motion is None or settings.spec.part == "rotation":
        return ()
    place = part.placement
    rotation = own.adapter.map_rotation_[:3, :3] if place is None else place.rotation @ place.map_rotation
    return compare_capabilities(fit.arm, fit.joint_angles, part.robot, part.motion.joint_positions, fit.time, rotation)


def _require_frames(recording: Recording, count: int, what: str) -> None:
    if count < MIN_FRAMES:
        raise RecordingError(f"{what} of {recording.source!r}: {count}; at least {MIN_FRAMES} are needed")
