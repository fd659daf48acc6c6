"""Metrics of a robot's motion with their warnings: those of each arm, and those of all arms together.

Terminal, Markdown, JSON and notebook (`maniport.report.render`), the page (`maniport.report.page`) and the table of
a batch render the same `Report`.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from maniport.errors import argument
from maniport.evaluation import Capability
from maniport.motion import ArmMotion, RobotMotion
from maniport.motion.motion_limits import DERIVATIVES, TORQUES
from maniport.motion.status import FAR, NEAR_DISTANCE, REACHED
from maniport.motion.trajectory import Clearance, Trajectory
from maniport.pipeline.results import ArmResult, ArmTransfer
from maniport.report.describe.robots import add_collision_shapes, warn_of_collisions, warn_of_limits
from maniport.report.values import Report, Section, Statistics, Value, at_time, listed
from maniport.util.sampling import statistics
from maniport.util.validation import Array

STATISTICS = {
    "distance": ("Ellipsoid distance", "", "0.1: one axis is 5 % too long; 1: 65 %."),
    "position_error": (
        "Position error",
        "mm",
        "Of the end effector; it has priority over ellipsoids.",
    ),
    "orientation_error": (
        "Orientation error",
        "°",
        "Between the constrained axes and their target.",
    ),
    "feasibility_gap": ("Distance to the feasible set", "", "Of the target; an upper bound."),
    "major_axis_angle": (
        "Angle between longest axes",
        "°",
        "Where both ellipsoids have a longest axis.",
    ),
    "relative_position_error": (
        "Relative position error",
        "mm",
        "From the scaled vector between the hands.",
    ),
}
"""Label, unit and description of statistics over waypoints, by key."""

LEAST_GAIN = 0.95
"""Smallest ratio of force or speed to that of positions only without a warning; less is within the spread of seeds."""

ALONG = {
    "person": {"force": "where person is strong", "velocity": "where person is fast"},
    "path": {"force": "along the path", "velocity": "along the path"},
    "direction": {"force": "along the direction", "velocity": "along the direction"},
}
"""Lines of force and speed in words."""

MISSED_SHARE = 0.05
"""Largest share of waypoints that may be missed without a warning."""


def add_statistics(
    section: Section,
    key: str,
    values: ArrayLike,
    time: ArrayLike,
    tolerance: float | None = None,
    far_share: float | None = None,
) -> Statistics:
    """Add and return statistics of values (n,) at times [s]; tolerance and share are in JSON only."""
    label, unit, about = STATISTICS[key]
    numbers = statistics(values, time)
    result = Statistics(
        median=numbers["median"],
        p95=numbers["p95"],
        maximum=numbers["max"],
        time_of_maximum=numbers["max_at_s"],
        tolerance=tolerance,
        far_share=far_share,
    )
    text = f"median {result.median:.2f}, 95th percentile {result.p95:.2f}, max {result.maximum:.2f}"
    section.add(
        label,
        key,
        result,
        f"{text} {at_time(result.time_of_maximum)}",
        about,
        unit=unit,
        main=key in ("distance", "position_error", "orientation_error"),
        times=(result.time_of_maximum,),
    )
    return result


def motion_report(motion: ArmMotion | RobotMotion) -> Report:
    """Describe the motion of one or several arms."""
    arms = motion.arms if isinstance(motion, RobotMotion) else (motion,)
    time = arms[0].time
    title = " and ".join(f"{arm.arm} at {arm.frame}" for arm in arms)
    lead = f"{len(time)} target ellipsoids in {np.ptp(time):.2f} s."
    sections = tuple(motion_section(arm, arm.time) for arm in arms)
    return Report(title, lead, sections)


def motion_section(
    motion: ArmMotion, time: Array, result: ArmResult | None = None, alone: bool = True
) -> Section:
    """Describe the motion of an arm, of a result; `time` (n,): reported times of its waypoints [s].

    What concerns the trajectory of several arms together is in `group_section`.
    """
    section = Section("Robot motion", key="motion")
    add_statistics(section, "distance", motion.distance, time)
    _add_position_error(section, motion, time)
    if motion.orientation_error is not None:
        add_statistics(section, "orientation_error", np.degrees(motion.orientation_error), time)
    if alone:
        teacher = None if result is None else result.teacher
        _add_trajectory(section, motion, motion.clearance, motion.demonstrated_time, time, teacher)
    if result is not None:
        _add_capabilities(section, result)
        _add_mean_distance(section, motion, result)

    _add_waypoints(section, motion)
    best = motion.pointwise_best
    if best is not None and np.median(best) > 0.01:  # else the ratio has no meaning
        _add_pointwise_ratio(section, motion)
    if result is not None:
        _add_feasibility_gap(section, result, time)
    _add_major_axis_angle(section, motion, result, time)
    if result is not None:
        _add_lowest_point(section, motion, time, result)

    _warn_of_motion(section, motion)
    if motion.limits is not None:
        warn_of_limits(section, motion.limits)
        if alone:
            collisions = None if result is None else result.collisions
            unchecked = () if collisions is None else collisions.unchecked
            warn_of_collisions(section, motion.clearance, unchecked)
    elif "velocity limit" in motion.status:
        text = "the motion is too fast for the robot in places: give it more time"
        section.warn("too-fast", text)
    return section


def _add_position_error(section: Section, motion: ArmMotion, time: Array) -> None:
    """Add the position error of a motion that follows a path, with a warning where it is large."""
    error = motion.position_error
    if error is None:
        return
    share = float(np.mean(error > FAR * motion.position_tolerance))
    tolerance = 1e3 * motion.position_tolerance  # [mm]
    added = add_statistics(section, "position_error", 1e3 * error, time, tolerance, share)
    if share > 0.0:
        at = added.time_of_maximum
        text = f"the position error is up to {added.maximum:.1f} mm (at {at:.1f} s)"
        section.warn("position-error", f"{text}; tolerance {tolerance:g} mm", times=(at,))


def _add_capabilities(section: Section, result: ArmResult) -> None:
    """Add force and speed along the lines in which the person has most."""
    if not isinstance(result, ArmTransfer):
        return
    for capability in result.capabilities:
        _add_capability(section, capability)


def _add_mean_distance(section: Section, motion: ArmMotion, result: ArmResult) -> None:
    """Add the mean distance with its parts, as a sum of rounded numbers."""
    if result.gap is None:
        return
    parts = result.mean_distance
    summands = dict(parts)
    if motion.path is None:
        summands["infeasible"] += summands.pop("path")
    rounded = []
    texts = []
    for name, summand in summands.items():
        number = round(summand, 3)
        rounded.append(number)
        texts.append(f"{name} {number:.3f}")
    text = f"{sum(rounded):.3f} = {' + '.join(texts)}"
    about = "Infeasible: distance to the feasible set. Path: added by the path constraint. Motion: added by limits."
    value = {"mean": float(np.mean(motion.distance)), **parts}
    section.add("Mean distance", "mean_distance", value, text, about, main=True)


def _add_waypoints(section: Section, motion: ArmMotion) -> None:
    """Add how many waypoints are reached and why others are not."""
    status = Counter(motion.status)
    total = len(motion.status)
    missed_count = 0
    numbers = []
    for name, count in status.items():
        if name not in REACHED:
            missed_count += count
            numbers.append(f"{name.removesuffix(' missed')}: {count}")
    reasons = ""
    if numbers:
        reasons = f" ({listed(numbers)})"
    if missed_count > MISSED_SHARE * total:
        section.warn("targets-missed", f"{missed_count} of {total} waypoints are missed{reasons}")

    value = {"count": total, "missed": missed_count, "status": dict(status)}
    text = f"{total - missed_count} of {total} reached{reasons}"
    about = "Position error within the tolerance."
    if not motion.directed:
        about = f"Distance at most {NEAR_DISTANCE:g}, position error within the tolerance."
    section.add("Waypoints", "waypoints", value, text, about)


def _add_pointwise_ratio(section: Section, motion: ArmMotion | RobotMotion) -> None:
    """Add the ratio, without a text where nothing better than the motion was found."""
    ratio = motion.pointwise_ratio
    if ratio == 1.0:
        section.numbers(pointwise_ratio=ratio)
        return
    label = "Ratio to the best pointwise distances found"
    about = "Of root mean squares; no bound."
    section.add(label, "pointwise_ratio", ratio, f"{ratio:.2f}", about)


def _add_feasibility_gap(section: Section, result: ArmResult, time: Array) -> None:
    """Add the distance of the targets to the feasible set, with a warning where it is large."""
    if result.gap is None:
        return
    gap = add_statistics(section, "feasibility_gap", result.gap, time).median
    directed = result.motion is not None and result.motion.directed
    if gap > NEAR_DISTANCE and not directed:
        text = f"the targets are infeasible: median distance to the feasible set {gap:.2f}"
        section.warn("infeasible-targets", text)


def _add_major_axis_angle(
    section: Section, motion: ArmMotion, result: ArmResult | None, time: Array
) -> None:
    """Add the angle between longest axes where they exist, with a warning where it is large."""
    angle = motion.major_axis_angle if result is None else result.major_axis_angle
    degrees = np.degrees(angle)
    if not np.isfinite(degrees).any():
        return
    median = add_statistics(section, "major_axis_angle", degrees, time).median
    if median > 30.0 and not motion.directed:
        text = (
            f"the longest axis of the ellipsoid is {median:.0f}° (median) from that of the target"
        )
        section.warn("longest-axis", text)


def _add_lowest_point(section: Section, motion: ArmMotion, time: Array, result: ArmResult) -> None:
    """Add the lowest point of a motion; without a table, it must be above the plane that the base stands on."""
    if not result.robot.chain.stands:
        return
    lowest = result.lowest
    if lowest is None:
        text = "the height above the base plane is unknown: no link has a shape"
        section.warn("unchecked-floor", text)
        return

    height = 1e3 * lowest.height  # [mm]
    at = float(np.interp(lowest.time, motion.time, time))
    has_table = result.collisions is not None and result.collisions.table is not None
    if height < 0.0 and not has_table:
        text = f"{lowest.link} is up to {-height:.0f} mm below the base plane (at {at:.1f} s)"
        advice = f"{argument('table', 0)} keeps the robot above it"
        section.warn("below-base-plane", f"{text}. {advice}", times=(at,))

    value = {"link": lowest.link, "height_mm": height, "at_s": at}
    text = f"{height:.0f} mm, {lowest.link} {at_time(at)}"
    about = "Of the moving links, above the base plane."
    section.add("Lowest point", "lowest_point", value, text, about, times=(at,))


def _warn_of_motion(section: Section, motion: ArmMotion) -> None:
    """Warn of control steps that violate limits, and of joints without a velocity limit."""
    if motion.held.any():
        count = motion.held.sum()
        text = f"at {count} control steps not all limits were satisfied, or the robot braked before a collision"
        section.warn("held", text, severity="error")
    unlimited = []
    for name, limit in zip(motion.joint_names, motion.velocity_limits, strict=True):
        if np.isinf(limit):
            unlimited.append(name)
    if unlimited:
        text = f"no velocity limit is available for {listed(unlimited)}"
        section.warn("unchecked-velocity-limits", text)


def group_section(
    motion: RobotMotion, time: Array, unchecked: Sequence[str] = (), teacher: str | None = None
) -> Section:
    """Describe what concerns several arms together; `time`: reported times of the waypoints [s].

    `teacher` is the robot whose motion this is, None of a person's.
    """
    section = Section("All arms", key="arms")
    _add_trajectory(section, motion.trajectory, motion.clearance, time, time, teacher)
    _add_pointwise_ratio(section, motion)
    if motion.relative_error is not None:
        largest = 1e3 * motion.relative_error.max(axis=1)  # [mm]
        add_statistics(section, "relative_position_error", largest, time)
    warn_of_collisions(section, motion.clearance, unchecked)
    return section


def _add_trajectory(
    section: Section,
    trajectory: Trajectory,
    clearance: Clearance,
    demonstrated: Array | None,
    time: Array,
    teacher: str | None,
) -> None:
    """Add duration, limits and collisions of a planned motion; `time`: reported times of its waypoints [s]."""
    if demonstrated is not None:
        robot = float(np.ptp(trajectory.control_time))
        shown = float(np.ptp(demonstrated))
        value = {"robot": robot, "person": shown}
        text = f"{robot:.1f} s (person {shown:.1f} s)"
        if teacher is not None:
            value = {"robot": robot, "teacher": shown}
            text = f"{robot:.1f} s (teacher {shown:.1f} s)"
        about = "Time-scaled to satisfy the limits; other times are demonstrated."
        section.add("Duration", "duration", value, text, about, unit="s", main=True)
    if trajectory.limits is None or trajectory.limit_use is None:
        return

    sources = trajectory.limits.sources
    limit_uses: dict[str, LimitUse] = {}
    torque_uses: dict[str, LimitUse] = {}
    for name, (joint, share, at) in trajectory.limit_use.items():
        reported_at = float(np.interp(at, trajectory.time, time))
        use = LimitUse(joint, share, reported_at)
        if name in TORQUES:
            torque_uses[name] = use
        else:
            limit_uses[name] = use

    about = "Largest value relative to the limit"
    limit_sources = {}
    torque_sources = {}
    for name, text in sources.items():
        if name in DERIVATIVES:
            limit_sources[name] = text
        else:
            torque_sources[name] = text
    _add_limit_uses(section, "limits", limit_uses, limit_sources, f"{about}.")
    _add_limit_uses(
        section, "torques", torque_uses, torque_sources, f"{about}, by inverse dynamics."
    )
    at = float(np.interp(clearance.time, trajectory.time, time))
    _add_collisions(section, clearance, at)


class LimitUse(NamedTuple):
    """Largest use of a limit of the robot."""

    joint: str
    share: float  # value over limit
    time: float  # reported [s]

    @property
    def exceeds(self) -> bool:
        """Whether the limit is exceeded by more than the rounding of a report."""
        return self.share > 1.001


def _add_limit_uses(
    section: Section,
    key: str,
    uses: Mapping[str, LimitUse],
    sources: Mapping[str, str],
    about: str,
) -> None:
    """Add the use of limits, or of torques, by name, with an error where one is exceeded."""
    if not uses:
        return
    texts = []
    times = []
    for name, use in uses.items():
        if use.exceeds:
            times_limit = f"{use.joint} at {use.share:.2f} times its {name} limit"
            texts.append(f"{times_limit} {at_time(use.time)}")
            times.append(use.time)
    if texts:
        text = f"the motion exceeds limits of the robot: {listed(texts)}"
        section.warn(f"{key}-exceeded", text, severity="error", times=times)

    used = {}
    shares = []
    for name, use in uses.items():
        used[name] = {"joint": use.joint, "share": use.share, "at_s": use.time}
        if name != "position":  # its limit cannot be exceeded
            shares.append(f"{name} {100 * use.share:.0f} %")
    value = {"used": used, "sources": sources}
    is_main = key == "limits"
    section.add(key.capitalize(), key, value, listed(shares), about, main=is_main)


def _add_collisions(section: Section, clearance: Clearance, at: float) -> None:
    """Add collisions and the least clearance, which is at a time [s]."""
    millimeters = None
    if not clearance.checked:
        text = "not checked"
    elif not np.isfinite(clearance.distance):
        text = "none possible"
    else:
        millimeters = 1e3 * clearance.distance
        pair = f"{' and '.join(clearance.pair)} {at_time(at)}"
        share = "none"
        if clearance.share:
            share = f"in {100 * clearance.share:.1f} % of the time"
        if clearance.share > 0.0:
            error = f"the robot collides {share}: {pair}"
            section.warn("collision", error, severity="error", times=(at,))
        text = f"{share}; clearance {millimeters:.0f} mm ({pair})"

    value = {
        "checked": clearance.checked,
        "share": clearance.share,
        "at_s": at,
        "pair": clearance.pair,
        "clearance_mm": millimeters,
    }
    about = "Between shapes of links, table and obstacles."
    section.add("Collisions", "collisions", value, text, about, main=True, times=(at,))
    add_collision_shapes(section, clearance.shapes)


def _add_capability(section: Section, capability: Capability) -> None:
    """Add force or speed of a motion, of those through the positions alone, and of the person."""
    name = "Speed"
    unit = "m/s"
    adjective = "slower"
    if capability.kind == "force":
        name = "Force"
        unit = "N"
        adjective = "weaker"
    label = f"{name} {ALONG[capability.along][capability.kind]}"
    robot = _levels(capability.robot)
    value: dict[str, Value] = {"robot": robot}
    others = []
    compared = ""
    if capability.position_only is not None:
        levels = _levels(capability.position_only)
        value["position_only"] = levels
        compared = f" (positions only {levels['median']:.3g})"
    if capability.same_path is not None:
        levels = _levels(capability.same_path)
        value["same_path"] = levels
        others.append(f"positions only on the same path {levels['median']:.3g} {unit}")
    if capability.person is not None:
        levels = _levels(capability.person)
        value["person"] = levels
        others.append(f"person {levels['median']:.3g} {unit}")
    value["min_at_s"] = float(capability.time[capability.robot.argmin()])
    value["resemblance"] = _number(capability.resemblance)
    value["position_only_resemblance"] = _number(capability.position_only_resemblance)

    text = f"{robot['median']:.3g} {unit}{compared}, 5th percentile {robot['p5']:.3g}"
    about = "Median over the waypoints, in the weaker sense of the line, within the limits of all joints."
    section.add(label, capability.kind, value, text, about, unit=unit, main=True)
    if others:
        section.add(f"{name} to compare", "", None, listed(others), "Medians along the same lines.")
    if capability.gain < LEAST_GAIN and capability.is_target:
        section.warn(
            adjective, f"the motion is {adjective} than through the positions alone: {text}"
        )


def _number(value: float) -> float | None:
    """Return a number for JSON, which has no nan."""
    return float(value) if np.isfinite(value) else None


def _levels(values: Array) -> dict[str, float]:
    """Return median, 5th percentile and minimum of values (n,)."""
    return {
        "median": float(np.median(values)),
        "p5": float(np.percentile(values, 5)),
        "min": float(values.min()),
    }
