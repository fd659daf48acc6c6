"""The method as stages, each a function from frozen values to a frozen value.

    load → fit_human → sample_robot → fit_transfer → targets_of → place → plan → evaluate

One arm is a group of one: values that belong to an arm are tuples over the arms, for two arms of a person left first.
"""

import copy
import time as clock
import warnings
from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from maniport.arms import Arm, ArmGroup, as_group
from maniport.domain import sample_domain, sample_domains
from maniport.errors import InvalidInputError, ManiportWarning, RecordingError
from maniport.evaluation import choose
from maniport.evaluation import evaluate as compared_with_baselines
from maniport.feasibility import knowing
from maniport.mocap import HumanMotion, Recording, fit_arm, fit_arms, read_recording
from maniport.motion import Planner, SeedBank
from maniport.motion.arm_model import require_trackable
from maniport.pipeline.learned import LearnedProfile
from maniport.pipeline.motion_stages import measure, place_and_plan, planner_of
from maniport.pipeline.results import ArmResult, ArmTransfer, TransferResult
from maniport.pipeline.targets import targets_of
from maniport.pipeline.values import (
    MIN_FRAMES,
    FittedMap,
    Human,
    Moved,
    SampledRobot,
    Settings,
)
from maniport.transfer import DomainAdapter, LengthField, method_of, name_of
from maniport.util.defaults import BOTH
from maniport.util.validation import Array


def load(recording: Recording | str | Path, settings: Settings) -> Recording:
    """Read a recording."""
    settings.progress("Read recording", 0.0)
    motion = recording if isinstance(recording, Recording) else read_recording(recording)
    _require_frames(motion, len(motion), "frames")
    text = f"{len(motion)} frames, {motion.duration:.1f} s at {motion.rate:.4g} Hz"
    settings.progress("Read recording", 1.0, text)
    return motion


def fit_human(recording: Recording | LearnedProfile, settings: Settings) -> Human:
    """Fit one or both arms of the person; a learned profile has its arm already."""
    if isinstance(recording, LearnedProfile):
        if recording.spec != settings.spec:
            raise InvalidInputError(
                f"spec must be that of the learned profile, {recording.spec}; found {settings.spec}"
            )
        reference = recording.reference
        motion = HumanMotion((reference.fit,), np.zeros((1, 3)))
        return Human(reference.recording, motion, (recording.profile,), (recording.path,))
    options = {**settings.person, "progress": settings.progress}
    if options["side"] == BOTH:
        del options["side"]
        motion = fit_arms(recording, **options)
    else:
        motion = HumanMotion((fit_arm(recording, **options),), np.zeros((1, 3)))
        if len(settings.arms) > 1:  # each robot arm moves in front of its own base
            stands = [np.zeros(3) if arm.chain.stand is None else arm.chain.stand[:3, 3] for arm in settings.arms]
            motion = HumanMotion(motion.arms * len(stands), np.array(stands) - np.mean(stands, axis=0))
    _require_frames(recording, len(motion), "frames with the arm fully observed")
    profiles = tuple(fit.arm.ellipsoids(fit.joint_angles, settings.spec) for fit in motion.arms)
    return Human(recording, motion, profiles, tuple(motion.hands))


def sample_robot(settings: Settings) -> SampledRobot:
    """Sample the robot's domains, and what the planner needs to know of it."""
    generator = np.random.default_rng(settings.random_state)
    planner = _planner(settings, generator)
    step, count = "Sample robot ellipsoids", settings.n_student
    settings.progress(step, 0.0)
    options: dict[str, Any] = {"collisions": None if planner is None else planner.collisions, "spec": settings.spec}
    robot, seed = settings.robot, settings.random_state + 1
    if isinstance(robot, ArmGroup):
        domains = sample_domains(robot, count, seed, **options)
    else:
        domains = (sample_domain(robot, count, seed, **options),)
    settings.progress(step, 1.0, f"{count} ellipsoids of {robot.name}")
    return SampledRobot(planner, domains, generator)


def _planner(settings: Settings, generator: np.random.Generator) -> Planner | None:
    """Make the planner, unless the robot cannot or shall not move."""
    if settings.motion is None:
        return None
    for arm, spec in zip(settings.arms, settings.specs, strict=True):
        try:
            require_trackable(arm, spec)
        except InvalidInputError as error:
            warnings.warn(f"the robot was not moved: {error}", ManiportWarning, stacklevel=2)
            return None
    settings.progress("Sample robot", 0.0)
    planner = planner_of(settings.motion, settings.spec.velocity, generator)
    text = " and ".join(f"{len(own.reachability_map)} configurations" for own in planner.arms)
    settings.progress("Sample robot", 1.0, text)
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
    bank, started, progress = _bank(robot, settings, arm), clock.perf_counter(), settings.progress
    if not isinstance(settings.adapter, DomainAdapter):
        assert profile is not None
        choice = choose(
            teacher, student, profile, robot=settings.arms[arm], spec=spec, bank=bank,
            random_state=settings.random_state, progress=progress, **settings.adapter,
        )  # fmt: skip
        return FittedMap(choice.adapter, teacher, clock.perf_counter() - started, choice)
    progress("Fit transfer", 0.0)
    adapter = knowing(method_of(settings.adapter), settings.arms[arm], spec, bank, settings.random_state)
    adapter.fit(teacher, student)
    if isinstance(adapter, LengthField) and (failures := adapter.report_.failures()):
        text = "the length field maps this robot badly, parallel-transport does not: " + "; ".join(failures)
        warnings.warn(text, ManiportWarning, stacklevel=2)
    progress("Fit transfer", 1.0, f"{adapter.n_iter_} iterations; {adapter.stop_reason_}")
    return FittedMap(adapter, teacher, clock.perf_counter() - started)


def sample_teacher(person: Arm, settings: Settings) -> Array:
    """Sample the domain of a person's arm, shape (n_teacher, d, d)."""
    step, count = "Sample human ellipsoids", settings.n_teacher
    settings.progress(step, 0.0)
    domain = sample_domain(person, count, settings.random_state, spec=settings.spec)
    settings.progress(step, 1.0, f"{count} ellipsoids of {person.name}")
    return domain


def evaluate(
    human: Human,
    robot: SampledRobot,
    maps: Sequence[FittedMap],
    moved: Moved | None,
    settings: Settings,
    baselines: bool = True,
) -> TransferResult:
    """Compare each map with baselines, and measure the motion."""
    names = [str(fit.arm.side or arm.name) for fit, arm in zip(human.fits, settings.arms, strict=True)]
    if len(set(names)) < len(names):
        names = list(as_group(settings.robot).names)
    results = tuple(ArmResult(name=name, robot=own) for name, own in zip(names, settings.arms, strict=True))
    if moved is not None and robot.planner is not None and settings.motion is not None:
        results = measure(moved, names, robot.planner, settings.motion)
    transfers = []
    for i, (result, own) in enumerate(zip(results, maps, strict=True)):
        evaluation = None if own.choice is None else own.choice.evaluation
        if evaluation is None and baselines:
            evaluation = compared_with_baselines(
                own.adapter, own.teacher, robot.domains[i], human.profiles[i], robot=result.robot,
                spec=settings.specs[i], bank=_bank(robot, settings, i), n_domain=0,
                random_state=settings.random_state, progress=settings.progress,
            )  # fmt: skip
        transfers.append(
            ArmTransfer(
                **{field.name: getattr(result, field.name) for field in fields(result)},
                fit=human.fits[i],
                person_base=human.motion.bases[i],
                method=name_of(own.adapter),
                adapter=own.adapter,
                choice=own.choice,
                evaluation=evaluation,
                time=human.fits[i].time,
                demonstrated_profile=human.profiles[i],
                target_profile=own.adapter.transform(human.profiles[i]),
                teacher_domain=own.teacher,
                student_domain=robot.domains[i],
                seconds_to_fit=own.seconds,
            )
        )
    return TransferResult(
        robot=as_group(settings.robot),
        arms=tuple(transfers),
        motion=None if moved is None else moved.motion,
        random_state=settings.random_state,
        recording=human.recording,
        spec=settings.spec,
        base_rotation=settings.base_rotation,
    )


def transfer(
    human: Human, robot: SampledRobot, maps: Sequence[FittedMap], settings: Settings, baselines: bool = True
) -> TransferResult:
    """Run the stages from the fitted maps on."""
    moved = None
    if robot.planner is not None and settings.motion is not None:
        generator = copy.deepcopy(robot.random)
        moved = place_and_plan(targets_of(human, maps, settings), robot.planner, settings.motion, generator)
    return evaluate(human, robot, maps, moved, settings, baselines)


def _bank(robot: SampledRobot, settings: Settings, arm: int) -> SeedBank | None:
    """Return the planner's samples of an arm where they are of these ellipsoids."""
    if robot.planner is None or settings.spec.kind != "velocity":
        return None
    return robot.planner.arms[arm].bank


def _require_frames(recording: Recording, count: int, what: str) -> None:
    if count < MIN_FRAMES:
        raise RecordingError(f"{what} of {recording.source!r}: {count}; at least {MIN_FRAMES} are needed")
