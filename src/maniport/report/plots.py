"""A figure for each kind of object: what its method ``plot`` draws. The type of the object says which."""

from functools import singledispatch

import numpy as np

from maniport.arms import Arm
from maniport.errors import InvalidInputError
from maniport.mocap import ArmFit, Recording
from maniport.motion import ArmMotion, RobotMotion
from maniport.pipeline import MotionResult
from maniport.report import figures
from maniport.report.describe.motions import STATISTICS
from maniport.report.page.animation import panels_of
from maniport.report.page.content import ACHIEVED, PERSON, REFERENCE, Line, Panel
from maniport.util.optional import matplotlib

matplotlib()  # raises MissingPackageError

from matplotlib.figure import Figure  # noqa: E402

RESULT_TOPICS = ("Force and speed", "Distance and position error")


@singledispatch
def plot(thing: object) -> Figure:
    """Draw an object."""
    raise InvalidInputError(f"no plot of a {type(thing).__name__}")


@plot.register
def plot_recording(recording: Recording) -> Figure:
    """Draw the coordinates of all points over time."""
    panels = []
    for column, axis in enumerate("xyz"):
        lines = []
        for values in recording.positions[:, :, column].T:
            lines.append(Line("point", values, PERSON.name))
        panels.append(Panel(f"{axis} of all points", "m", tuple(lines)))
    return figures.panel_figure(recording.time, panels)


@plot.register
def plot_arm(arm: Arm) -> Figure:
    """Draw an arm in the middle of its joint ranges, with its ellipsoid."""
    limited = np.isfinite(arm.upper - arm.lower)
    middle = np.where(limited, (arm.upper + arm.lower) / 2.0, 0.0)[None]
    ellipsoid = arm.manipulability(middle)
    return figures.arms({arm.name: arm.skeleton(middle)}, {arm.name: ellipsoid})


@plot.register
def plot_fit(fit: ArmFit) -> Figure:
    """Draw the arm of a person at some times, with its ellipsoids."""
    skeletons = {"person": fit.arm.skeleton(fit.joint_angles)}
    ellipsoids = {"person": fit.arm.manipulability(fit.joint_angles)}
    return figures.arms(skeletons, ellipsoids, roles={"person": PERSON.name})


@plot.register
def plot_motion(motion: ArmMotion) -> Figure:
    """Draw ellipsoid distance and position error of an arm over time."""
    label, unit, _ = STATISTICS["distance"]
    panels = [Panel(label, unit, (Line("achieved", motion.distance, ACHIEVED.name),))]
    if motion.position_error is not None:
        tolerance = np.full(len(motion.time), 1e3 * motion.position_tolerance)
        lines = (
            Line("end effector", 1e3 * motion.position_error),
            Line("tolerance", tolerance, REFERENCE.name, 1),
        )
        label, unit, _ = STATISTICS["position_error"]
        panels.append(Panel(label, unit, lines))
    return figures.panel_figure(motion.time, panels)


@plot.register
def plot_robot_motion(motion: RobotMotion) -> Figure:
    """Draw the ellipsoid distances of all arms over time."""
    label, unit, _ = STATISTICS["distance"]
    panels = []
    for arm in motion.arms:
        line = Line("achieved", arm.distance, ACHIEVED.name)
        panels.append(Panel(f"{arm.arm}: {label}", unit, (line,)))
    return figures.panel_figure(motion.arms[0].time, panels)


@plot.register
def plot_result(result: MotionResult) -> Figure:
    """Draw force, speed, ellipsoid distance and position error of all arms over time."""
    panels = []
    time = None
    for arm in result.arms:
        if arm.motion is None:
            continue
        time = arm.motion.time
        for topic, drawn in panels_of(result, arm, result.config.spec):
            if topic in RESULT_TOPICS:
                panels.extend(drawn)
    if time is None:
        raise InvalidInputError("the result has no motion to plot; transfer it with move=True")
    return figures.panel_figure(time, panels)
