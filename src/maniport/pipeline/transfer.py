"""The main job as one function: a recording in, a frozen result out; and its last stages alone."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from threadpoolctl import threadpool_limits

from maniport.arms import PERSONS, Arm, ArmGroup, as_group
from maniport.errors import InvalidInputError, argument, collected_warnings
from maniport.mocap import Recording
from maniport.mocap.arm_ik import require_person
from maniport.motion import MotionLimits, Planner, PlanSettings
from maniport.motion.objective import Damping, Objective
from maniport.motion.plan.plan_motion import RELATIVE
from maniport.pipeline import stages
from maniport.pipeline.config import Config
from maniport.pipeline.demonstrations import LearnedProfile
from maniport.pipeline.options import FREE
from maniport.pipeline.results import MotionResult, TransferResult
from maniport.pipeline.values import MotionTargets, SampledRobot, Settings, bounded_profiles, targets_of
from maniport.transfer import METHODS, method_of
from maniport.util.defaults import AUTO, BOTH
from maniport.util.progress import Progress, no_progress
from maniport.util.validation import as_choice, as_finite, as_times


def transfer_recording(
    recording: Recording | LearnedProfile | str | Path,
    config: Config | Settings | None = None,
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
    config : Config or Settings, optional
        Options of the run; settings are those of `settings_of`, and have the progress and all options.
    progress : callable, optional
        Called with the name of a stage, the fraction done and, at its end, a message.
    **options
        Options by name, which override those of `config`; `maniport.pipeline.config` describes them. ``robot`` may
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
    if isinstance(config, Settings):
        settings = config
    else:
        config = (config or Config()).changed(allowed=("human", "robot", "transfer", "motion"), **options)
        settings = settings_of(_with_source(config, recording), progress)
    with threadpool_limits(1), collected_warnings() as texts:  # one thread: sums round equally with any number of cores
        if not isinstance(recording, LearnedProfile):
            recording = stages.load(recording, settings)
        human = stages.fit_human(recording, settings)
        robot = stages.sample_robot(settings)
        maps = stages.fit_transfer(human, robot, settings)
        moved = None
        if robot.planner is not None:
            targets = targets_of(human, maps, settings)
            moved = stages.plan(targets, stages.place(targets, robot, settings), robot, settings)
        result = stages.evaluate(human, robot, maps, moved, settings)
    return replace(result, warnings=tuple(texts), config=settings.config)


def settings_of(config: Config, progress: Progress | None = None) -> Settings:
    """Load the robot of a configuration, and check all options for it."""
    transfer, human, side = config.transfer, config.human, config.human.side
    require_person(human.person, AUTO if side == BOTH else side, human.smooth)
    human.roles()
    robot = _with_limits(config.robot.load(side == BOTH), config)
    group = as_group(robot)
    if len(group) == 2 and side == AUTO:
        config = config.changed(side=BOTH)
    elif side == BOTH and len(group) != 2:
        raise InvalidInputError(f"{argument('side', BOTH)} is for a robot of two arms; found {len(group)}")
    group.specs(transfer.spec)
    PERSONS[config.human.person]().checked_spec(transfer.spec)
    if len(group) > 1 and not isinstance(transfer.joint_weights, str | None):
        raise InvalidInputError("joint_weights must not be of single joints for several arms")
    adapter, shared = None, {"random_state": config.seed, "base_rotation": transfer.rotation}
    if not isinstance(transfer.method, str) or as_choice(transfer.method, "method", (AUTO, *METHODS)) != AUTO:
        adapter = method_of(transfer.method, damping=transfer.damping or None, **shared)
    control = _control_of(robot, config) if config.motion.move else None
    return Settings(config, robot, control, adapter, progress or no_progress)


def _with_limits(robot: Arm | ArmGroup, config: Config) -> Arm | ArmGroup:
    """Return an arm with the velocity and effort limits of the file for the motion, which ellipsoids weight by."""
    source = config.motion.limits
    if source is None or isinstance(source, MotionLimits) or not isinstance(robot, Arm):
        return robot
    limits = MotionLimits.of(robot, source)
    velocity = None if limits.assumed["velocity"] else limits.velocity
    return robot.with_limits(velocity, limits.effort if np.isfinite(limits.effort).all() else None)


def _control_of(robot: Arm | ArmGroup, config: Config) -> PlanSettings:
    """Look up limits and collisions, and check the options of the motion for the robot."""
    motion = config.motion
    if config.robot.hand_targets == RELATIVE and len(as_group(robot)) == 1:
        raise InvalidInputError(f"{argument('hand_targets', RELATIVE)} needs several arms; found {robot.name}")
    if config.robot.hand_targets == RELATIVE and motion.workspace is not None:
        raise InvalidInputError("workspace bounds paths, which end effectors leave with hand_targets='relative'")
    return motion.control(robot)


def _with_source(config: Config, recording: Recording | LearnedProfile | str | Path) -> Config:
    """Return the configuration with the file of the recording and its part, unless it has one."""
    if config.recording or isinstance(recording, LearnedProfile):
        return config
    if not isinstance(recording, Recording):
        return config.changed(recording=recording)
    part: dict[str, Any] = {"start": float(recording.time[0]), "stop": float(recording.time[-1])}
    return config.changed(recording=str(recording.source), **part) if recording.source else config


def follow_profile(
    robot: Arm | ArmGroup,
    profiles: Sequence[ArrayLike],
    time: ArrayLike | None,
    paths: Sequence[ArrayLike] | None = None,
    config: Config | None = None,
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
    config : Config, optional
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
        raise InvalidInputError("the profile has no times; write it with an array 'time' (n,) in seconds")
    config = (config or Config()).changed(allowed=("robot", "transfer", "motion", "placement"), **options)
    config, place = replace(config, verb="track"), config.placement.place
    orientation, spec = config.motion.orientation, config.transfer.spec.bounded
    if isinstance(orientation, str) and orientation != FREE:
        text = f"{argument('orientation')} must be {FREE} or a vector without a person; found {orientation!r}"
        raise InvalidInputError(text)
    robot = _with_limits(robot, config)
    settings = Settings(config, robot, _control_of(robot, config), progress=progress or no_progress)
    for name in ("workspace", "scale"):
        if getattr(config.motion, name) is not None and (paths is None or not place):
            raise InvalidInputError(f"{argument(name)} is for a path that is placed; found none")
    group, generator = as_group(robot), np.random.default_rng(config.seed)
    times = as_times(time)
    for name, values in (("profiles", profiles), ("paths", paths)):
        shapes = [] if values is None else [np.shape(value) for value in values]
        if values is not None and [shape[:1] for shape in shapes] != [(len(times),)] * len(group):
            raise InvalidInputError(
                f"{name} must be {len(group)}, one for each arm, of shape ({len(times)}, ...) as time; found {shapes}"
            )
    damping = config.transfer.damping if damping is None else damping
    targets = MotionTargets(
        times,
        bounded_profiles([as_finite(profile, "profile") for profile in profiles], config.transfer.spec),
        None if paths is None else tuple(as_finite(path, "path") for path in paths),
        spec,
        Objective.of(group.arms[0], spec, damping, positive=True).damping,
        direction=None if isinstance(orientation, str) else np.array(orientation),
    )
    sampled = SampledRobot(stages.planner_of(settings, generator) if planner is None else planner, (), generator)
    placements = stages.place(targets, sampled, settings) if place and targets.paths is not None else None
    moved = stages.plan(targets, placements, sampled, settings)
    names = group.names if len(group) > 1 else (group.arms[0].name,)
    arms = stages.measure(moved, sampled.planner, names, settings)
    return MotionResult(robot=group, arms=arms, motion=moved.motion, random_state=config.seed, config=config)
