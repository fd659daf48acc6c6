"""The main job: a recording in, a frozen result out, by stages that are functions from frozen values to a frozen value.

    load → fit_human → sample_robot → fit_transfer → targets_of → move → evaluate

One arm is a group of one: values that belong to an arm are tuples over the arms, for two arms of a person left first.
"""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from maniport.arms import Arm, as_group
from maniport.arms.human import hand_rotations
from maniport.arms.manipulability import JOINT_LIMITS
from maniport.domain import sample_domain
from maniport.errors import InvalidInputError, ManiportWarning, RecordingError, collected_warnings
from maniport.evaluation import Capability, Evaluation, compare_capabilities, select_method
from maniport.evaluation import evaluate as compare_with_baselines
from maniport.evaluation.comparison import with_feasible_set
from maniport.mocap import ArmFit, HumanMotion, Recording, fit_arms
from maniport.motion import Placement, Planner, RobotMotion
from maniport.motion.arm_model import require_trackable
from maniport.motion.targets import TargetTrajectory, damping_of
from maniport.pipeline.config import Config
from maniport.pipeline.demonstrations import LearnedProfile
from maniport.pipeline.following import (
    SampledRobot,
    bounded_profiles,
    measure,
    move,
    planner_of,
)
from maniport.pipeline.options import TransferOptions
from maniport.pipeline.results import ArmTransfer, TransferResult
from maniport.pipeline.settings import Settings, fit_options, read_part, settings_of
from maniport.spd.regularization import Regularization
from maniport.transfer import DomainAdapter, method_of, name_of
from maniport.transfer.rotation_group import orthonormal, rotation_angle
from maniport.util.defaults import DAMPING
from maniport.util.progress import Progress, Step
from maniport.util.sampling import evenly_spaced
from maniport.util.validation import Array

MIN_FRAMES = 3  # frames without which there is no motion


def transfer_recording(
    recording: Recording | LearnedProfile | str | Path,
    config: TransferOptions | None = None,
    *,
    progress: Progress | None = None,
    **options: Any,
) -> TransferResult:
    """Transfer a recorded motion of one or both arms of a person to a robot.

    With both arms, the left arm of the person is mapped to the first arm of the robot and the right one to the second.
    Both paths get one placement, so that the hands keep their relation, and both arms one time.

    Parameters
    ----------
    recording : Recording, LearnedProfile, str or Path
        A recording, its file, or a profile that `maniport.learn` made from several.
    config : TransferOptions, optional
        Options of the run, such as a `Config` of a file.
    progress : callable, optional
        Called with the name of a stage, the fraction done and, at its end, a message.
    **options
        Options by name, which override those of `config`; `maniport.pipeline.options` describes them. ``robot`` may
        also be an `Arm` or an `ArmGroup`, ``method`` a `DomainAdapter`, ``base_rotation`` a matrix (3, 3) from the
        person's trunk frame (x forward, y left, z up) to the robot's base frame. ``costs`` are further costs of the
        motion, see `maniport.motion.Cost`.

    Returns
    -------
    TransferResult

    Raises
    ------
    ManiportError
        When an option does not exist or an input cannot be used; options are checked before any long work.
    """
    config = Config.of(config).changed(allowed=("human", "robot", "transfer", "motion"), **options)
    settings = settings_of(_with_source(config, recording), progress)
    if isinstance(recording, LearnedProfile):
        return transfer_part(recording, settings)
    with collected_warnings() as texts:
        part = load(recording, settings)
    result = transfer_part(part, settings)
    return replace(result, warnings=tuple(dict.fromkeys((*texts, *result.warnings))))


def transfer_part(recording: Recording | LearnedProfile, settings: Settings) -> TransferResult:
    """Transfer the part of a recording that is used."""
    with (
        threadpool_limits(1),
        collected_warnings() as texts,
    ):  # one thread: sums round equally with any number of cores
        human = fit_human(recording, settings)
        robot = sample_robot(settings)
        maps = fit_transfer(human, robot, settings)
        moved = None
        if robot.planner is not None:
            targets = targets_of(human, maps, robot.planner, settings)
            moved = move(targets, robot, settings, mean_rotation(maps))
        result = evaluate(human, robot, maps, moved, settings)
    return replace(result, warnings=tuple(texts))


def _with_source(config: Config, recording: Recording | LearnedProfile | str | Path) -> Config:
    """Return the configuration with the file of the recording and its part, unless it has one."""
    if config.recording or isinstance(recording, LearnedProfile):
        return config
    if not isinstance(recording, Recording):
        return config.changed(recording=recording)
    if not recording.source:
        return config
    part: dict[str, Any] = {}
    if config.start is None:
        part["start"] = float(recording.time[0])
    if config.stop is None:
        part["stop"] = float(recording.time[-1])
    return config.changed(recording=str(recording.source), **part)


@dataclass(frozen=True, eq=False)
class Human:
    """Fitted arms of a person, with their ellipsoids (n, d, d) and hand paths (n, 3) [m] in one frame."""

    recording: Recording
    motion: HumanMotion
    ellipsoids: tuple[Array, ...]
    hand_paths: tuple[Array, ...]

    def subsampled(self, rate: float) -> "Human":
        """Keep at most so many frames a second [Hz], evenly spaced."""
        count = max(MIN_FRAMES, int(np.ceil(np.ptp(self.motion.time) * rate)) + 1)
        rows = evenly_spaced(len(self.motion), count)
        return Human(
            self.recording,
            self.motion.only(rows),
            tuple(ellipsoids[rows] for ellipsoids in self.ellipsoids),
            tuple(path[rows] for path in self.hand_paths),
        )


@dataclass(frozen=True, eq=False)
class FittedMap:
    """A fitted map of ellipsoids from an arm of the person to an arm of the robot."""

    adapter: DomainAdapter
    teacher: Array  # domain of the person's arm (m, d, d)
    evaluation: Evaluation | None = None  # of a selected method


def load(recording: Recording | str | Path, settings: Settings) -> Recording:
    """Read a recording, or the part of it that is used."""
    step, motion = Step(settings.progress, "Read recording"), read_part(recording, settings.config)
    _require_frames(motion, len(motion), "frames")
    step.end(f"{len(motion)} frames, {motion.duration:.1f} s at {motion.rate:.4g} Hz")
    return motion


def _require_frames(recording: Recording, count: int, what: str) -> None:
    if count < MIN_FRAMES:
        raise RecordingError(
            f"{what} of {recording.source!r}: {count}; at least {MIN_FRAMES} are needed"
        )


def fit_human(recording: Recording | LearnedProfile, settings: Settings) -> Human:
    """Fit one or both arms of the person; a learned profile has its arms already."""
    if isinstance(recording, LearnedProfile):
        if recording.config.spec != settings.config.spec:
            raise InvalidInputError(
                f"spec must be that of the learned profile, {recording.config.spec}; found {settings.config.spec}"
            )
        demonstrated = recording.each_arm()
        ellipsoids = [arm.profile for arm in demonstrated]
        hand_paths = [arm.path for arm in demonstrated]
        motion = recording.reference.motion
        recording = recording.reference.recording
    else:
        motion = fit_arms(recording, **fit_options(settings.config), progress=settings.progress)
        _require_frames(recording, len(motion), "frames with the arm fully observed")
        spec = settings.config.spec
        ellipsoids = [fit.arm.ellipsoids(fit.joint_angles, spec) for fit in motion.arms]
        hand_paths = list(motion.hands)

    arms = len(motion.arms)
    count = len(settings.arms)
    if arms > count:
        raise InvalidInputError(f"the profile is of {arms} arms, and the robot has {count}")
    if arms < count:  # each robot arm moves in front of its own base
        origins = as_group(settings.robot).base_positions
        bases = origins - origins.mean(axis=0)
        motion = HumanMotion(motion.arms * count, bases)
        ellipsoids = ellipsoids * count
        hand_paths = [hand_paths[0] + base for base in bases]
    return Human(recording, motion, tuple(ellipsoids), tuple(hand_paths))


def sample_robot(settings: Settings) -> SampledRobot:
    """Make the planner, unless the robot cannot or shall not move, and sample the robot's domains."""
    generator, planner, seed = (
        np.random.default_rng(settings.config.seed),
        None,
        settings.config.seed + 1,
    )
    if settings.plan is not None:
        try:
            for arm, spec in zip(settings.arms, settings.specs, strict=True):
                require_trackable(arm, spec)
        except InvalidInputError as error:
            warnings.warn(f"the robot was not moved: {error}", ManiportWarning, stacklevel=2)
        else:
            planner = planner_of(settings, generator)
    weightless = [arm.name for arm in settings.arms if arm.chain.inertia is None]
    if (
        settings.config.spec.kind == "force"
        and settings.config.spec.joint_weights == JOINT_LIMITS
        and weightless
    ):
        text = f"forces are without gravity: the description of {weightless[0]!r} has no masses"
        warnings.warn(text, ManiportWarning, stacklevel=2)
    step = Step(settings.progress, "Sample robot ellipsoids")
    collisions = None if planner is None else planner.collisions
    domains = sample_domain(
        settings.robot,
        settings.config.n_student,
        seed,
        spec=settings.config.spec,
        collisions=collisions,
    )
    step.end()
    return SampledRobot(planner, tuple(domains) if domains.ndim == 4 else (domains,), generator)


def fit_transfer(human: Human, robot: SampledRobot, settings: Settings) -> tuple[FittedMap, ...]:
    """Fit the map of ellipsoids for each arm, by the method of the settings or a selected one."""
    pairs = enumerate(zip(human.motion.arms, human.ellipsoids, strict=True))
    return tuple(fit_map(fit.arm, profile, robot, settings, arm) for arm, (fit, profile) in pairs)


def fit_map(
    person: Arm, profile: Array | None, robot: SampledRobot, settings: Settings, arm: int = 0
) -> FittedMap:
    """Fit the map from a person's arm to an arm of the robot; a selection needs the demonstrated profile (n, d, d)."""
    teacher, student, spec = (
        sample_teacher(person, settings),
        robot.domains[arm],
        settings.specs[arm],
    )
    bank, config = robot.bank(arm, spec), settings.config
    if settings.adapter is None:
        assert profile is not None
        adapter, evaluation = select_method(
            teacher, student, profile, robot=settings.arms[arm], spec=spec, bank=bank, random_state=config.seed,
            progress=settings.progress, base_rotation=config.rotation, damping=config.damping or None,
        )  # fmt: skip
        return FittedMap(adapter, teacher, evaluation)
    step = Step(settings.progress, "Fit transfer")
    adapter = with_feasible_set(
        method_of(settings.adapter), settings.arms[arm], spec, bank, config.seed
    )
    adapter.fit(teacher, student)
    failures = adapter.failures()
    if failures:
        text = "the length field maps this robot badly, parallel-transport does not: "
        text += "; ".join(failures)
        warnings.warn(text, ManiportWarning, stacklevel=2)
    step.end(f"{adapter.n_iter_} iterations; {adapter.stop_reason_}")
    return FittedMap(adapter, teacher)


def sample_teacher(person: Arm, settings: Settings) -> Array:
    """Sample the domain of a person's arm, shape (n_teacher, d, d)."""
    step = Step(settings.progress, "Sample human ellipsoids")
    domain = sample_domain(
        person, settings.config.n_teacher, settings.config.seed, spec=settings.config.spec
    )
    step.end()
    return domain


def targets_of(
    human: Human, maps: Sequence[FittedMap], planner: Planner, settings: Settings
) -> tuple[TargetTrajectory, ...]:
    """Map the demonstrated ellipsoids of each arm; paths and rotations of the hands are those of the person.

    The ellipsoids are those of `EllipsoidSpec.bounded`: the inverses of force ellipsoids. All arms have the strongest
    damping of the maps.
    """
    spec = settings.config.spec
    adapters = [fitted.adapter for fitted in maps]
    strongest = max((each.student_regularization for each in adapters), key=_epsilon)
    maps_damp = strongest.epsilon > 0.0 and spec.kind != "force"

    targets = []
    arms = zip(adapters, human.ellipsoids, human.hand_paths, human.motion.arms, strict=True)
    for i, (adapter, ellipsoids, hand_path, fit) in enumerate(arms):
        (mapped,) = bounded_profiles([adapter.transform(ellipsoids)], spec)
        damping = strongest
        if not maps_damp:
            damping = damping_of(planner.arms[i].limits.arm, spec.bounded, DAMPING)
        target = TargetTrajectory(
            time=human.motion.time,
            ellipsoids=mapped,
            spec=spec.bounded,
            damping=damping,
            positions=hand_path,
            rotations=_hand_rotations(fit, settings.config.orientation),
        )
        targets.append(target)
    return tuple(targets)


def _epsilon(regularization: Regularization) -> float:
    return regularization.epsilon


def _hand_rotations(fit: ArmFit, orientation: str | Sequence[float]) -> Array | None:
    """Return the rotations of the hand (n, 3, 3) that the end effector shall have, unless it is free or has others."""
    if not isinstance(orientation, str) or orientation == "free":
        return None
    rotations = hand_rotations(fit.arm, fit.joint_angles)
    if orientation == "constant":
        return np.broadcast_to(rotations[0], rotations.shape)
    return rotations


def mean_rotation(maps: Sequence[FittedMap], largest_turn: float = 5.0) -> Array:
    """Return the mean rotation (3, 3) of the maps, which all paths get.

    There is a warning where two differ by more than `largest_turn` [deg].
    """
    rotations = [fitted.adapter.map_rotation_ for fitted in maps]
    if len(rotations) == 1:
        return rotations[0]
    angles = [np.degrees(rotation_angle(rotations[0], rotation)) for rotation in rotations[1:]]
    angle = float(max(angles))
    if angle > largest_turn:
        text = f"the adapters rotate ellipsoids by up to {angle:.0f}° differently; the paths get their mean rotation"
        warnings.warn(text, ManiportWarning, stacklevel=2)
    return orthonormal(np.sum(rotations, axis=0))


def evaluate(
    human: Human,
    robot: SampledRobot,
    maps: Sequence[FittedMap],
    moved: tuple[RobotMotion, tuple[Placement, ...] | None] | None,
    settings: Settings,
    baselines: bool = True,
) -> TransferResult:
    """Compare each map with baselines, and measure the motion and its placements."""
    fits, transfers = human.motion.arms, list[ArmTransfer]()
    names = [str(fit.arm.side or arm.name) for fit, arm in zip(fits, settings.arms, strict=True)]
    if len(set(names)) < len(names):
        names = list(as_group(settings.robot).names)
    motion, placements = moved or (None, None)
    parts = measure(motion, placements, robot.planner, names, settings)
    for i, (part, own, profile, fit) in enumerate(
        zip(parts, maps, human.ellipsoids, fits, strict=True)
    ):
        evaluation, place, capabilities = own.evaluation, part.placement, tuple[Capability, ...]()
        if evaluation is None and baselines:
            evaluation = compare_with_baselines(
                own.adapter, own.teacher, robot.domains[i], profile, robot=part.robot, spec=settings.specs[i],
                bank=robot.bank(i, settings.config.spec), random_state=settings.config.seed, progress=settings.progress,
            )  # fmt: skip
        if part.motion is not None and settings.config.spec.part != "rotation":
            turn = (
                own.adapter.map_rotation_[:3, :3]
                if place is None
                else place.rotation @ place.map_rotation
            )
            joints = part.motion.joint_positions
            capabilities = compare_capabilities(
                fit.arm, fit.joint_angles, part.robot, joints, fit.time, turn
            )
        transfers.append(ArmTransfer(
            **vars(part), fit=fit, person_base=human.motion.bases[i], time=fit.time, method=name_of(own.adapter),
            adapter=own.adapter, evaluation=evaluation, demonstrated_profile=profile,
            target_profile=own.adapter.transform(profile), teacher_domain=own.teacher, student_domain=robot.domains[i],
            capabilities=capabilities,
        ))  # fmt: skip
    return TransferResult(
        robot=as_group(settings.robot), arms=tuple(transfers), config=settings.config, motion=motion,
        recording=human.recording,
    )  # fmt: skip
