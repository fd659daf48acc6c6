"""The main job as one function: a recording in, a frozen result out; and its last stages alone."""

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike
from threadpoolctl import threadpool_limits

from maniport.arms import VELOCITY, Arm, ArmGroup, EllipsoidSpec, as_group, load_arm, load_arms
from maniport.errors import InvalidInputError, ManiportWarning, argument
from maniport.mocap import Recording
from maniport.mocap.arm_ik import require_person
from maniport.motion import Control, PlanControl, Planner
from maniport.motion.objective import Damping, Objective
from maniport.motion.plan.plan_motion import PLACED, RELATIVE
from maniport.pipeline import stages
from maniport.pipeline.config import Config
from maniport.pipeline.learned import LearnedProfile
from maniport.pipeline.results import MotionResult, TransferResult
from maniport.pipeline.targets import CONSTANT, DEMONSTRATED, FREE, MotionTargets, facing
from maniport.pipeline.values import MotionSettings, Settings
from maniport.spd.regularization import Regularization
from maniport.transfer import METHODS, DomainAdapter, method_of
from maniport.util.defaults import (
    AUTO,
    BOTH,
    DAMPING,
    KEEP,
    METHOD,
    PERSON,
    ROBOT,
    STUDENT_SAMPLES,
    TEACHER_SAMPLES,
)
from maniport.util.progress import Progress, no_progress
from maniport.util.validation import as_choice, as_count, as_finite, as_generator, as_rotation, as_times

T = TypeVar("T")


def transfer_recording(
    recording: Recording | LearnedProfile | str | Path,
    config: Config | None = None,
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
    config : Config, optional
        Options of the run.
    progress : callable, optional
        Called with the name of a stage, the fraction done and, at its end, a message.
    **options
        Options by name, which override those of `config`; `maniport.pipeline.options` describes them. ``robot`` may
        also be an `Arm` or an `ArmGroup`, ``method`` a `DomainAdapter`, ``base_rotation`` a matrix (3, 3) from the
        person's trunk frame (x forward, y left, z up) to the robot's base frame. ``tracking`` has the arguments of a
        controller that follows the planned motion, see `maniport.motion.Control`.

    Returns
    -------
    TransferResult

    Raises
    ------
    ManiportError
        When an option does not exist or an input cannot be used; options are checked before any long work.
    """
    config = _with_source((config or Config()).changed(**options), recording)
    settings = settings_of(config, progress)
    if not isinstance(recording, LearnedProfile):
        recording = config.human.read(recording)
    with threadpool_limits(1):  # sums round alike with any number of cores, and threads would wait for one another
        result, texts = recorded(lambda: run(recording, settings))
    return replace(result, warnings=texts, config=config)


def settings_of(config: Config, progress: Progress | None = None) -> Settings:
    """Load the robot of a configuration, and check all options for it."""
    arm = config.robot.load(config.human.side == BOTH)
    return checked(arm, **arguments_of(config, arm), tips=config.robot.tips, progress=progress)


def arguments_of(config: Config, arm: Arm | ArmGroup) -> dict[str, Any]:
    """Return the arguments of `checked` for an arm."""
    transfer, motion = config.transfer, config.motion
    return {
        **config.human.fit_options,
        "method": transfer.method,
        "spec": transfer.spec,
        **transfer.regularization,
        "base_rotation": transfer.rotation,
        "n_teacher": transfer.n_teacher,
        "n_student": transfer.n_student,
        "orientation": motion.orientation,
        "move": motion.move,
        "random_state": config.seed,
        **({**vars(motion.control(arm)), **(motion.tracking or {})} if motion.move else {}),
    }


def _with_source(config: Config, recording: Recording | LearnedProfile | str | Path) -> Config:
    """Return the configuration with the file of the recording and its part, unless it has one."""
    if config.recording or isinstance(recording, LearnedProfile):
        return config
    if not isinstance(recording, Recording):
        return config.changed(recording=recording)
    part = {"start": float(recording.time[0]), "stop": float(recording.time[-1])}
    return config.changed(recording=str(recording.source), **part) if recording.source else config


def run(recording: Recording | LearnedProfile | str | Path, settings: Settings) -> TransferResult:
    """Run all stages."""
    if not isinstance(recording, LearnedProfile):
        recording = stages.load(recording, settings)
    human = stages.fit_human(recording, settings)
    robot = stages.sample_robot(settings)
    maps = stages.fit_transfer(human, robot, settings)
    return stages.transfer(human, robot, maps, settings)


def follow_profile(
    robot: Arm | ArmGroup,
    profiles: Sequence[ArrayLike],
    time: ArrayLike | None,
    paths: Sequence[ArrayLike] | None = None,
    *,
    place: bool = True,
    direction: ArrayLike | None = None,
    spec: EllipsoidSpec = VELOCITY,
    damping: Damping = DAMPING,
    planner: Planner | None = None,
    random_state: int = 0,
    progress: Progress | None = None,
    **options: Any,
) -> MotionResult:
    """Plan a motion of a robot along target ellipsoids without a person.

    Parameters
    ----------
    robot : Arm or ArmGroup
    profiles : sequence of array_like, shape (n, d, d)
        Target velocity ellipsoids of each arm in its base frame, without damping, n ≥ 2.
    time : array_like, shape (n,)
        Increasing [s].
    paths : sequence of array_like, shape (n, 3), optional
        Target positions of each end effector [m].
    place : bool
        Whether the paths are placed relative to the robot first.
    direction : array_like, shape (3,), optional
        Target z axis of the end effectors in the base frame.
    spec, damping, planner, random_state, progress, **options
        As in `maniport.motion.plan_motion`; with options of the controller it follows the planned motion.

    Raises
    ------
    ManiportError
        When an input cannot be used.
    """
    if time is None:
        raise InvalidInputError("the profile has no times; write it with an array 'time' (n,) in seconds")
    settings = motion_settings(robot, options, FREE if direction is None else direction, progress=progress)
    if settings.plan.workspace is not None and (paths is None or not place):
        raise InvalidInputError("workspace bounds a path that is placed; found none")
    group, generator = as_group(robot), as_generator(random_state)
    arms = group.arms
    times = as_times(time)
    for name, values in (("profiles", profiles), ("paths", paths)):
        shapes = [] if values is None else [np.shape(value) for value in values]
        if values is not None and [shape[:1] for shape in shapes] != [(len(times),)] * len(arms):
            raise InvalidInputError(
                f"{name} must be {len(arms)}, one for each arm, of shape ({len(times)}, ...) as time; found {shapes}"
            )
    targets = MotionTargets(
        times,
        tuple(as_finite(profile, "profile") for profile in profiles),
        None if paths is None else tuple(as_finite(path, "path") for path in paths),
        spec,
        Objective.of(arms[0], spec, damping, positive=True).damping,
        direction=None if direction is None else as_finite(direction, "direction"),
    )
    planner = stages.planner_of(settings, spec, generator) if planner is None else planner
    if place and targets.paths is not None:
        moved = stages.place_and_plan(targets, planner, settings, generator)
    else:
        moved = stages.plan(targets, None, planner, settings, generator)
    names = group.names if len(arms) > 1 else (arms[0].name,)
    results = stages.measure(moved, names, planner, settings)
    return MotionResult(robot=group, arms=results, motion=moved.motion, random_state=random_state)


def checked(
    robot: Arm | ArmGroup | str | Path = ROBOT,
    person: str = PERSON,
    method: str | DomainAdapter = METHOD,
    *,
    spec: EllipsoidSpec = VELOCITY,
    markers: Mapping[str, Any] | None = None,
    side: str = AUTO,
    height: float | None = None,
    smooth: str | float = AUTO,
    jumps: str = KEEP,
    base_rotation: ArrayLike | None = None,
    damping: float | None = DAMPING,
    eigenvalue_floor: float | None = None,
    n_teacher: int = TEACHER_SAMPLES,
    n_student: int = STUDENT_SAMPLES,
    move: bool = True,
    orientation: str | ArrayLike = FREE,
    tips: str = PLACED,
    random_state: int = 0,
    progress: Progress | None = None,
    **options: Any,
) -> Settings:
    """Check the options of `transfer_recording`, and look up limits and collisions of the robot."""
    require_person(person, AUTO if side == BOTH else side, height, smooth, jumps)
    if not isinstance(robot, Arm | ArmGroup):
        robot = load_arms(robot) if side == BOTH else load_arm(robot)
    count = len(as_group(robot))
    side = BOTH if count == 2 and side == AUTO else side
    if side == BOTH and count != 2:
        raise InvalidInputError(f"{argument('side', BOTH)} is for a robot of two arms; found {count}")
    as_group(robot).specs(spec)
    if count > 1 and not isinstance(spec.joint_weights, str | None):
        raise InvalidInputError("spec must have no weights of single joints for several arms")
    Regularization(damping, eigenvalue_floor)
    seed = as_count(random_state, "random_state", minimum=0)
    rotation = np.eye(3) if base_rotation is None else as_rotation(base_rotation, "base_rotation", 3)
    shared = {"damping": damping, "eigenvalue_floor": eigenvalue_floor, "base_rotation": rotation}
    selects = isinstance(method, str) and as_choice(method, "method", (AUTO, *METHODS)) == AUTO
    motion = motion_settings(robot, options, orientation, tips, progress, resolve=move)
    return Settings(
        person={"person": person, "markers": markers, "side": side, "height": height, "smooth": smooth, "jumps": jumps},
        robot=robot,
        adapter=shared if selects else method_of(method, random_state=seed, **shared),
        spec=spec,
        base_rotation=rotation,
        n_teacher=as_count(n_teacher, "n_teacher", minimum=2),
        n_student=as_count(n_student, "n_student", minimum=2),
        orientation=orientation if isinstance(orientation, str) else as_finite(orientation, "orientation"),
        motion=motion if move else None,
        random_state=seed,
        progress=progress or no_progress,
    )


def motion_settings(
    robot: Arm | ArmGroup,
    options: Mapping[str, Any],
    orientation: str | ArrayLike = FREE,
    tips: str = PLACED,
    progress: Progress | None = None,
    resolve: bool = True,
) -> MotionSettings:
    """Check options of the plan and the controller; `resolve`: look up limits and collisions."""
    planned, tracked = ({field.name for field in fields(kind)} for kind in (PlanControl, Control))
    if unknown := sorted(set(options) - planned - tracked):
        raise TypeError(f"unexpected option {unknown[0]!r}; there are {', '.join(sorted(planned | tracked))}")
    plan = PlanControl(**{name: value for name, value in options.items() if name in planned})
    tracking = {}
    if own := sorted(set(options) - planned):
        if len(as_group(robot)) > 1:
            raise TypeError(f"unexpected option {own[0]!r}: a controller follows the plan of one arm only")
        tracking = {name: value for name, value in options.items() if name in tracked}
        Control(**tracking)
    if isinstance(orientation, str):
        as_choice(orientation, "orientation", (FREE, DEMONSTRATED, CONSTANT))
    else:
        facing(orientation, plan.orientation_axes)
    if as_choice(tips, "tips", (PLACED, RELATIVE)) == RELATIVE and plan.workspace is not None:
        raise InvalidInputError("workspace bounds paths, which end effectors leave with tips='relative'")
    return MotionSettings(robot, plan.resolved(robot) if resolve else plan, progress or no_progress, tracking, tips)


def recorded(work: Callable[[], T]) -> tuple[T, tuple[str, ...]]:
    """Return the result of `work` and the texts of its warnings, each once."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", ManiportWarning)
        result = work()
    texts = (str(warning.message) for warning in caught if issubclass(warning.category, ManiportWarning))
    return result, tuple(dict.fromkeys(texts))
