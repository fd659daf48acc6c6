"""From options to objects: the recording of a configuration, and settings that are checked for its robot."""

import json
import os
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from maniport.arms import PERSONS, Arm, ArmGroup, EllipsoidSpec, as_group
from maniport.arms.collisions import Collisions
from maniport.errors import (
    FileFormatError,
    InvalidInputError,
    ManiportWarning,
    argument,
    shown,
)
from maniport.mocap import Recording, read_recording
from maniport.mocap.arm_ik import require_person
from maniport.mocap.roles import Markers
from maniport.motion import MotionLimits, PlanOptions
from maniport.pipeline.config import Config
from maniport.pipeline.direction_files import GivenLines, given_lines
from maniport.pipeline.extensions import costs_of, load_extensions
from maniport.pipeline.options import (
    HumanOptions,
    MotionOptions,
    TransferOptions,
)
from maniport.pipeline.robots import load_robot
from maniport.transfer import METHODS, DomainAdapter, RiemannianICP, method_of
from maniport.util.defaults import AUTO, BOTH
from maniport.util.input_limits import SETTINGS_BYTES, read_whole
from maniport.util.progress import Progress, no_progress
from maniport.util.validation import as_choice


@dataclass(frozen=True, eq=False)
class Settings:
    """A configuration with the robot loaded and all options checked for it."""

    config: Config
    robot: Arm | ArmGroup
    plan: PlanOptions | None  # resolved for the robot; None where it is not moved
    adapter: DomainAdapter | None = None  # unfitted; None where a method is selected
    given_lines: tuple[GivenLines, ...] = ()  # from files, one for each arm; empty: the person's
    progress: Progress = no_progress

    @property
    def arms(self) -> tuple[Arm, ...]:
        """All arms of the robot."""
        return as_group(self.robot).arms

    @property
    def specs(self) -> tuple[EllipsoidSpec, ...]:
        """Ellipsoids of each arm."""
        return as_group(self.robot).specs(self.config.spec)


def settings_of(config: Config, progress: Progress | None = None) -> Settings:
    """Load the robot of a configuration, and check all options for it."""
    for fault in load_extensions():
        warnings.warn(fault, ManiportWarning, stacklevel=2)
    side = config.side
    require_person(config.person, AUTO if side == BOTH else side, config.smooth)
    marker_roles(config)
    limited = with_limits(load_robot(config), config)
    robot = limited.robot
    group = as_group(robot)
    if len(group) == 2 and side == AUTO:
        config = config.changed(side=BOTH)
    elif side == BOTH and len(group) != 2:
        raise InvalidInputError(
            f"{argument('side', BOTH)} is for a robot of two arms; found {len(group)}"
        )
    group.specs(config.spec)
    PERSONS[config.person]().checked_spec(config.spec)
    if len(group) > 1 and not isinstance(config.joint_weights, str | None):
        raise InvalidInputError("joint_weights must not be of single joints for several arms")
    lines = given_lines(config, len(group))
    selects = (
        isinstance(config.method, str)
        and as_choice(config.method, "method", (AUTO, *METHODS)) == AUTO
    )
    if selects:
        _ = config.rotation  # raises where it is unknown or wrong
    adapter = None if selects else adapter_of(config)
    plan = plan_options(config, robot, limited.limits) if config.move else None
    return Settings(config, robot, plan, adapter, lines, progress or no_progress)


def adapter_of(config: TransferOptions) -> DomainAdapter:
    """Return the unfitted adapter of the method; ICP estimates a base rotation that is unknown."""
    adapter = method_of(
        config.method,
        damping=config.damping or None,
        random_state=config.seed,
        base_rotation=config.known_rotation,
    )
    if not isinstance(adapter, RiemannianICP):
        _ = config.rotation  # raises where it is unknown
    return adapter


def read_part(recording: Recording | str | os.PathLike[str], config: HumanOptions) -> Recording:
    """Read a recording, or the part of it that is used."""
    if not isinstance(recording, Recording):
        return read_recording(
            recording,
            unit=config.unit,
            rate=config.fps,
            height=config.height,
            markers=marker_roles(config),
            side=config.side,
            start=config.start,
            stop=config.stop,
        )
    if config.start is None and config.stop is None:
        return recording
    return recording.crop(config.start, config.stop)


def fit_options(config: HumanOptions) -> dict[str, Any]:
    """Return arguments of `maniport.fit_arm`."""
    return {
        "person": config.person,
        "side": config.side,
        "smooth": config.smooth,
        "markers": marker_roles(config),
    }


def marker_roles(config: HumanOptions) -> Markers:
    """Return the names of points by role, from the file if there is one."""
    if config.markers is None or isinstance(config.markers, Mapping):
        return config.markers
    if not isinstance(config.markers, str):
        raise InvalidInputError(
            f"{argument('markers')} must be a file, or roles with their points; "
            f"found {shown(config.markers)}"
        )
    where = f"marker file {config.markers!r}"
    try:
        roles = json.loads(
            read_whole(config.markers, (), SETTINGS_BYTES)
        )  # bytes: in UTF-8 or UTF-16
    except (ValueError, RecursionError) as error:  # also for integers of thousands of digits
        raise FileFormatError(f"{where} is not readable JSON: {error}") from None
    if not isinstance(roles, dict):
        raise FileFormatError(
            f'{where} must map roles to lists of points, such as {{"elbow": ["RELB", "RIEL"]}}'
        )
    return roles


class LimitedRobot(NamedTuple):
    """A robot with the limits of a file, which its ellipsoids may be weighted by."""

    robot: Arm | ArmGroup
    limits: MotionLimits | None = None  # of its motion; None where the options name no file


def with_limits(robot: Arm | ArmGroup, config: MotionOptions) -> LimitedRobot:
    """Return an arm with the velocity and effort limits of the file for the motion."""
    source: str | MotionLimits | None = config.limits
    if source is None or isinstance(source, MotionLimits) or not isinstance(robot, Arm):
        return LimitedRobot(robot)
    limits = MotionLimits.of(robot, source, config.joint_limit_margin)
    velocity = None if limits.assumed["velocity"] else limits.velocity
    effort = None
    if np.isfinite(limits.effort).all():
        effort = limits.effort
    limits = replace(limits, arm=limits.arm.with_limits(velocity, effort))
    return LimitedRobot(robot.with_limits(velocity, effort), limits)


def plan_options(
    config: Config, arm: Arm | ArmGroup, limits: MotionLimits | None = None
) -> PlanOptions:
    """Return the options of `maniport.motion.plan_motion` for a robot, with its limits and collisions, checked."""
    if config.hand_targets == "relative" and len(as_group(arm)) == 1:
        raise InvalidInputError(
            f"{argument('hand_targets', 'relative')} needs several arms; found {arm.name}"
        )
    if config.hand_targets == "relative" and config.workspace is not None:
        raise InvalidInputError(
            "workspace bounds paths, which end effectors leave with hand_targets='relative'"
        )
    source: str | MotionLimits | None = config.limits
    if isinstance(source, MotionLimits):
        limits = source
    elif limits is None:
        limits = MotionLimits.of(arm, source, config.joint_limit_margin)
    model: Collisions | bool = config.collisions
    if config.table is not None or config.obstacles is not None or config.srdf is not None:
        model = Collisions.of(
            limits.arm,
            table=config.table,
            obstacles=config.obstacles,
            srdf=config.srdf,
        )
    options = PlanOptions(
        position_tolerance=config.position_tolerance,
        speed_scale=config.speed_scale,
        real_time=config.real_time,
        rate=config.rate,
        motion_limits=limits,
        joint_limit_margin=config.joint_limit_margin,
        collisions=model,
        orientation_axes=config.orientation_axes,
        home=config.home,
        costs=costs_of(config.costs, limits.arm),
        hand_targets=config.hand_targets,
    )
    return options.resolved(arm)
