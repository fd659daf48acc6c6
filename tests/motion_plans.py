"""Plans of arms from plain arrays, for tests."""

from collections.abc import Mapping

from maniport.arms import VELOCITY
from maniport.motion import PlanOptions, RobotMotion, TargetTrajectory, plan_motion
from maniport.util.defaults import DAMPING

ARGUMENTS = ("planner", "starts", "random_state", "progress")


def planned_motion(
    robot, profiles, paths=None, *, time, rotations=None, spec=VELOCITY, damping=DAMPING, **options
) -> RobotMotion:
    """Plan a motion of a group along arrays of each arm; further keywords are arguments or options of the plan."""
    arms = getattr(robot, "arms", (robot,))
    targets = []
    for i, arm in enumerate(arms):
        target = TargetTrajectory.checked(
            arm,
            time,
            profiles[i],
            positions=None if paths is None else paths[i],
            rotations=None if rotations is None else rotations[i],
            spec=spec,
            damping=damping,
        )
        targets.append(target)
    arguments = {name: options.pop(name) for name in ARGUMENTS if name in options}
    return plan_motion(robot, targets, PlanOptions(**options), **arguments)


def planned_arm(arm, profile, path=None, *, rotations=None, **options: Mapping) -> RobotMotion:
    """Plan a motion of one arm, as `planned_motion`."""
    paths = None if path is None else [path]
    turns = None if rotations is None else [rotations]
    return planned_motion(arm, [profile], paths, rotations=turns, **options)
