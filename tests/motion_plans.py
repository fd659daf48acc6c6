"""Plans of arms from plain arrays, for tests."""

from collections.abc import Mapping

from maniport.arms import VELOCITY
from maniport.motion import (
    PlanOptions,
    RobotMotion,
    TargetTrajectory,
    TrackOptions,
    plan_motion,
    track,
)
from maniport.util.defaults import DAMPING

ARGUMENTS = ("planner", "starts", "random_state", "start", "reference", "progress")


def targets_of(robot, profiles, paths, rotations, weights, **options) -> list[TargetTrajectory]:
    """Targets of each arm of a group from arrays of each."""
    targets = []
    for i, arm in enumerate(getattr(robot, "arms", (robot,))):
        target = TargetTrajectory.checked(
            arm,
            ellipsoids=profiles[i],
            positions=None if paths is None else paths[i],
            rotations=None if rotations is None else rotations[i],
            direction_weights=None if weights is None else weights[i],
            **options,
        )
        targets.append(target)
    return targets


def planned_motion(
    robot, profiles, paths=None, *, time, rotations=None, spec=VELOCITY, damping=DAMPING, **options
) -> RobotMotion:
    """Plan a motion of a group along arrays of each arm; further keywords are arguments or options of the plan."""
    targets = targets_of(
        robot, profiles, paths, rotations, None, time=time, spec=spec, damping=damping
    )
    arguments = {name: options.pop(name) for name in ARGUMENTS if name in options}
    return plan_motion(robot, targets, PlanOptions(**options), **arguments)


def planned_arm(arm, profile, path=None, *, rotations=None, **options: Mapping) -> RobotMotion:
    """Plan a motion of one arm, as `planned_motion`."""
    paths = None if path is None else [path]
    turns = None if rotations is None else [rotations]
    return planned_motion(arm, [profile], paths, rotations=turns, **options)


def tracked_motion(
    robot,
    profiles,
    paths=None,
    *,
    time,
    rotations=None,
    weights=None,
    spec=VELOCITY,
    damping=DAMPING,
    **options,
) -> RobotMotion:
    """Track arrays of each arm of a group; further keywords are arguments or options of the tracker."""
    targets = targets_of(
        robot, profiles, paths, rotations, weights, time=time, spec=spec, damping=damping
    )
    arguments = {name: options.pop(name) for name in ARGUMENTS if name in options}
    return track(robot, targets, TrackOptions(**options), **arguments)


def tracked_arm(arm, profile, path=None, *, rotations=None, weights=None, **options) -> RobotMotion:
    """Track arrays of one arm, as `tracked_motion`."""
    paths = None if path is None else [path]
    turns = None if rotations is None else [rotations]
    directions = None if weights is None else [weights]
    return tracked_motion(arm, [profile], paths, rotations=turns, weights=directions, **options)
