"""The main job: a recording in, the motion of a robot out.

    Transfer(robot, options)              options checked; the robot is sampled when first needed
      .read(recording)  -> Human          the part that is used, and the arms of the person in it
      .with_method(…)   -> Transfer       another method or base orientation, the same samples of the robot
      .fit(human)       -> FittedTransfer one map for each arm
      .run(recording)   -> TransferResult

    FittedTransfer
      .map(human)       -> targets        of each arm, not placed yet
      .place(targets)   -> placements     from the best to the worst
      .run(human)       -> TransferResult map, place, plan, evaluate

Command, batches, live control, the view and `transfer_recording` use these objects. One arm is a group of one: values
that belong to an arm are tuples over the arms, for two arms of a person left first.
"""

import os
import warnings
from collections.abc import Sequence
from copy import deepcopy
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from maniport.arms import Arm, ArmGroup, as_group
from maniport.arms.human import hand_rotations
from maniport.domain import sample_domain
from maniport.errors import InvalidInputError, ManiportWarning, collected_warnings
from maniport.evaluation import Capability, Evaluation, select_method
from maniport.evaluation import evaluate as compare_with_baselines
from maniport.evaluation.comparison import with_feasible_set
from maniport.mocap import ArmFit, Recording
from maniport.motion import Placement, PlacementOptions, Planner
from maniport.motion.targets import TargetTrajectory, damping_of
from maniport.pipeline.capability import (
    Comparison,
    DirectionTargets,
    PlacedMotion,
    directions_of,
    with_directions,
)
from maniport.pipeline.config import Config
from maniport.pipeline.demonstrations import LearnedProfile
from maniport.pipeline.following import SampledRobot, bounded_profiles, measure, move, place
from maniport.pipeline.human import Human, fit_human, origin_of, read_usable_part
from maniport.pipeline.options import TransferOptions
from maniport.pipeline.results import ArmResult, ArmTransfer, TransferResult
from maniport.pipeline.settings import Settings, adapter_of, settings_of
from maniport.spd.regularization import Regularization
from maniport.transfer import DomainAdapter, load_adapter, method_of, name_of
from maniport.transfer.rotation_group import orthonormal, rotation_angle
from maniport.util.atomic_io import folder_written_whole
from maniport.util.defaults import DAMPING
from maniport.util.files import load_ellipsoids, save_ellipsoids
from maniport.util.progress import Progress, Step
from maniport.util.validation import Array


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
    return Transfer.of(config, progress).run(recording)


@dataclass(frozen=True, eq=False)
class FittedMap:
    """A fitted map of ellipsoids from an arm of the person to an arm of the robot."""

    adapter: DomainAdapter
    teacher: Array  # domain of the person's arm (m, d, d)
    evaluation: Evaluation | None = None  # of a selected method
    warnings: tuple[str, ...] = ()


class Transfer:
    """A robot that motions of people are transferred to.

    All options are checked when the object is made; the robot is sampled when it is first needed, and then serves all
    recordings.

    Parameters
    ----------
    robot : Arm, ArmGroup, str or Path
    options : TransferOptions, optional
    progress : callable, optional
        Called with the name of a stage, the fraction done and, at its end, a message.

    Raises
    ------
    ManiportError
        When an option does not fit the robot, or the robot cannot be loaded.

    Attributes
    ----------
    settings : Settings
        Options with the robot, its limits and collisions.
    """

    def __init__(
        self,
        robot: Arm | ArmGroup | str | os.PathLike[str],
        options: TransferOptions | None = None,
        *,
        progress: Progress | None = None,
    ) -> None:
        self.settings = settings_of(Config.of(options).changed(robot=robot), progress)

    @classmethod
    def of(cls, options: Config | Settings, progress: Progress | None = None) -> "Transfer":
        """Return a transfer to the robot that the options name, or that settings have."""
        if not isinstance(options, Settings):
            options = settings_of(options, progress)
        transfer = cls.__new__(cls)
        transfer.settings = options
        return transfer

    def with_method(self, method: str | DomainAdapter, base_rotation: Array) -> "Transfer":
        """Return a transfer by another method at a base orientation (3, 3), to the same samples of the robot."""
        config = self.settings.config.changed(method=method, base_rotation=base_rotation)
        settings = replace(self.settings, config=config, adapter=adapter_of(config))
        transfer = Transfer.of(settings)
        transfer.robot = self.robot
        return transfer

    @cached_property
    def robot(self) -> SampledRobot:
        """The robot with its samples, which are drawn when this is first read."""
        with threadpool_limits(1):
            return SampledRobot.sample(self.settings)

    def read_part(self, recording: Recording | str | Path) -> Recording:
        """Read a recording, or the part of it that is used."""
        return read_usable_part(recording, self.settings)

    def human(self, part: Recording | LearnedProfile) -> Human:
        """Fit the arms of the person in a recording, all of which is used; a learned profile has them already."""
        with threadpool_limits(1):
            return fit_human(part, self.settings)

    def read(self, recording: Recording | LearnedProfile | str | Path) -> Human:
        """Read a recording, or the part of it that is used, and fit the arms of the person in it."""
        if isinstance(recording, LearnedProfile):
            return self.human(recording)
        origin = origin_of(recording, self.settings.config)
        with threadpool_limits(1), collected_warnings() as texts:
            part = self.read_part(recording)
        human = self.human(part)
        return replace(human, origin=origin, warnings=(*texts, *human.warnings))

    def fit(self, human: Human) -> "FittedTransfer":
        """Fit a map for each arm, by the method of the options or a selected one."""
        maps = []
        for i, (fit, ellipsoids) in enumerate(
            zip(human.motion.arms, human.ellipsoids, strict=True)
        ):
            maps.append(self.fit_arm(fit.arm, i, ellipsoids))
        return self.fitted(maps)

    def fitted(self, maps: Sequence[FittedMap]) -> "FittedTransfer":
        """Return the transfer with maps that are fitted, one for each arm."""
        return FittedTransfer(self.settings, self.robot, tuple(maps))

    def fit_arm(self, person: Arm, arm: int = 0, ellipsoids: Array | None = None) -> FittedMap:
        """Fit the map from a person's arm to an arm of the robot.

        A selection needs the demonstrated ellipsoids (n, d, d).
        """
        robot = self.robot
        with threadpool_limits(1), collected_warnings() as texts:
            fitted = fit_map(person, ellipsoids, robot, self.settings, arm)
        return replace(fitted, warnings=tuple(texts))

    def load(self, folder: str | os.PathLike[str]) -> "FittedTransfer":
        """Read the maps that `FittedTransfer.save` wrote, for the same robot and options."""
        maps = []
        for name in map_files(len(self.settings.arms)):
            teacher, _ = load_ellipsoids(Path(folder) / name.domain)
            maps.append(FittedMap(load_adapter(Path(folder) / name.adapter), teacher))
        return self.fitted(maps)

    def run(self, recording: Recording | LearnedProfile | str | Path | Human) -> TransferResult:
        """Transfer a recording, or a person whose arms are fitted."""
        human = recording
        if not isinstance(human, Human):
            human = self.read(human)
        return self.fit(human).run(human)


@dataclass(frozen=True)
class MapFiles:
    """Files of the map of an arm."""

    adapter: str
    domain: str  # of the person's arm


def map_files(count: int) -> list[MapFiles]:
    """Return the files of the maps of all arms."""
    return [MapFiles(f"adapter-{i}.npz", f"person-{i}.npz") for i in range(1, count + 1)]


@dataclass(frozen=True, eq=False)
class FittedTransfer:
    """Maps from the arms of a person to those of a robot, for any recording of this person.

    Attributes
    ----------
    settings : Settings
    robot : SampledRobot
    maps : tuple of FittedMap
        Adapter, domain of the person's arm, and the evaluation of a selected method, for each arm.
    """

    settings: Settings
    robot: SampledRobot
    maps: tuple[FittedMap, ...]

    @property
    def adapters(self) -> tuple[DomainAdapter, ...]:
        """Fitted adapters of each arm."""
        return tuple(fitted.adapter for fitted in self.maps)

    def map(
        self, human: Human, directions: Sequence[DirectionTargets] | None = None
    ) -> tuple[TargetTrajectory, ...]:
        """Return the targets of each arm, whose paths are not placed relative to the robot yet.

        `directions` are those of the method of this name, where they are known.
        """
        if self.robot.planner is None:
            raise InvalidInputError("the robot is not moved: there are no targets for it")
        targets = targets_of(human, self.maps, self.robot.planner, self.settings)
        if directions is None:
            directions = self.directions(human)
        return with_directions(targets, directions, self.settings.config.capability)

    def directions(self, human: Human) -> list[DirectionTargets]:
        """Return lines of force and speed for each arm, along which a result is compared, before the placement."""
        if self.robot.planner is None or self.settings.config.spec.part == "rotation":
            return [()] * len(self.maps)
        return directions_of(human, self.adapters, self.robot.planner, self.settings)

    def place(
        self, targets: Sequence[TargetTrajectory], options: PlacementOptions | None = None
    ) -> list[tuple[Placement, ...]]:
        """Return placements of the paths of all arms, from the best to the worst; default: by the own options."""
        robot = replace(self.robot, random=deepcopy(self.robot.random))
        with threadpool_limits(1):
            rotation = mean_rotation(self.maps)
            return place(tuple(targets), robot, self.settings, rotation, options)

    def run(self, human: Human, *, baselines: bool = True) -> TransferResult:
        """Map, place and plan a motion of a person; without `baselines` only a selection is evaluated."""
        # as many threads everywhere, so that sums round equally; a state of the generator that all motions share
        robot = replace(self.robot, random=deepcopy(self.robot.random))
        moved = None
        with threadpool_limits(1), collected_warnings() as texts:
            comparison = None
            if robot.planner is not None:
                directions = self.directions(human)
                targets = self.map(human, directions)
                map_rotation = mean_rotation(self.maps)
                unmoved = replace(robot, random=deepcopy(robot.random))
                moved = PlacedMotion(*move(targets, robot, self.settings, map_rotation))
                comparison = Comparison.of(moved, targets, unmoved, self.settings, map_rotation)
            motion = None if moved is None else moved.motion
            placements = None if moved is None else moved.placements
            names = arm_names(human, self.settings)
            results = measure(motion, placements, robot.planner, names, self.settings)
            arms = []
            for i, result in enumerate(results):
                capabilities: tuple[Capability, ...] = ()
                if comparison is not None:
                    capabilities = comparison.capabilities(
                        i,
                        result.robot,
                        human.motion.arms[i],
                        directions[i],
                        self.adapters[i].map_rotation_[:3, :3],
                        self.settings.config,
                    )
                arms.append(self._arm_transfer(human, i, result, capabilities, baselines))
        return TransferResult(
            robot=as_group(self.settings.robot),
            arms=tuple(arms),
            config=human.config(self.settings.config),
            motion=motion,
            recording=human.recording,
            warnings=self._warnings(human, texts),
            fitted=self,
        )

    def save(self, folder: str | os.PathLike[str], *, overwrite: bool = False) -> None:
        """Write the adapter and the domain of the person of each arm to a folder, whole or not at all."""
        files = map_files(len(self.maps))
        names = [name for file in files for name in (file.adapter, file.domain)]
        with folder_written_whole(folder, names, overwrite) as staging:
            for file, fitted in zip(files, self.maps, strict=True):
                fitted.adapter.save(staging / file.adapter)
                save_ellipsoids(staging / file.domain, fitted.teacher)

    def _warnings(self, human: Human, of_motion: Sequence[str]) -> tuple[str, ...]:
        """Join the warnings of all stages, each once."""
        texts = [*human.warnings, *self.robot.warnings]
        for fitted in self.maps:
            texts += fitted.warnings
        return tuple(dict.fromkeys((*texts, *of_motion)))

    def _arm_transfer(
        self,
        human: Human,
        i: int,
        result: ArmResult,
        capabilities: tuple[Capability, ...],
        baselines: bool,
    ) -> ArmTransfer:
        """Compare the map of an arm with baselines, and what person and robot are capable of."""
        settings = self.settings
        fitted = self.maps[i]
        fit = human.motion.arms[i]
        evaluation = fitted.evaluation
        if evaluation is None and baselines:
            evaluation = compare_with_baselines(
                fitted.adapter,
                fitted.teacher,
                self.robot.domains[i],
                human.ellipsoids[i],
                robot=result.robot,
                spec=settings.specs[i],
                bank=self.robot.bank(i, settings.config.spec),
                random_state=settings.config.seed,
                progress=settings.progress,
            )
        return ArmTransfer(
            name=result.name,
            robot=result.robot,
            spec=result.spec,
            placement=result.placement,
            motion=result.motion,
            gap=result.gap,
            collisions=result.collisions,
            fit=fit,
            person_base=human.motion.bases[i],
            time=fit.time,
            method=name_of(fitted.adapter),
            adapter=fitted.adapter,
            evaluation=evaluation,
            demonstrated_profile=human.ellipsoids[i],
            target_profile=fitted.adapter.transform(human.ellipsoids[i]),
            teacher_domain=fitted.teacher,
            student_domain=self.robot.domains[i],
            capabilities=capabilities,
        )


def arm_names(human: Human, settings: Settings) -> list[str]:
    """Return names of the arms in the result: sides of the person, or where they are equal, names in the group."""
    names = []
    for fit, arm in zip(human.motion.arms, settings.arms, strict=True):
        names.append(str(fit.arm.side or arm.name))
    if len(set(names)) < len(names):
        return list(as_group(settings.robot).names)
    return names


def fit_map(
    person: Arm, profile: Array | None, robot: SampledRobot, settings: Settings, arm: int = 0
) -> FittedMap:
    """Fit the map from a person's arm to an arm of the robot; a selection needs the demonstrated profile (n, d, d)."""
    teacher = sample_teacher(person, settings)
    student = robot.domains[arm]
    spec = settings.specs[arm]
    bank = robot.bank(arm, spec)
    config = settings.config
    if settings.adapter is None:
        assert profile is not None
        adapter, evaluation = select_method(
            teacher,
            student,
            profile,
            robot=settings.arms[arm],
            spec=spec,
            bank=bank,
            random_state=config.seed,
            progress=settings.progress,
            base_rotation=config.rotation,
            damping=config.damping or None,
        )
        return FittedMap(adapter, teacher, evaluation)
    step = Step(settings.progress, "Fit transfer")
    adapter = with_feasible_set(
        method_of(settings.adapter), settings.arms[arm], spec, bank, config.seed
    )
    adapter.fit(teacher, student)
    failures = adapter.failures()
    if failures:
        text = "the length field maps this robot badly, --method auto takes a transport: "
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
