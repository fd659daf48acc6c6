"""Metrics of a robot's motion with their warnings: those of each arm, and those of all arms together.

Terminal, Markdown, JSON and notebook (`maniport.report.render`), the page (`maniport.report.page`) and the table of
a batch render the same `Report`.
"""

from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from maniport.errors import argument
from maniport.evaluation import Capability
from maniport.motion import ArmMotion, RobotMotion
from maniport.motion.motion_limits import DERIVATIVES, TORQUES
from maniport.motion.status import FAR, NEAR_DISTANCE, REACHED
from maniport.motion.trajectory import Clearance, Trajectory
from maniport.pipeline.results import ArmResult
from maniport.report.describe.robots import add_collision_shapes, warn_of_collisions, warn_of_limits
from maniport.report.values import Report, Section, at_time, listed
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

MISSED_SHARE = 0.05
"""Largest share of waypoints that may be missed without a warning."""


def add_statistics(
    section: Section, key: str, values: ArrayLike, time: ArrayLike, **more: Any
) -> dict[str, float]:
    """Add and return median, 95th percentile and maximum of values (n,) at times [s]; `more` are in JSON only."""
    (label, unit, about), numbers = STATISTICS[key], statistics(values, time)
    text = "median {median:.2f}, 95th percentile {p95:.2f}, max {max:.2f} ".format(**numbers)
    main = key in ("distance", "position_error", "orientation_error")
    largest_at = numbers["max_at_s"]
    section.add(
        label,
        key,
        numbers | more,
        text + at_time(largest_at),
        about,
        unit=unit,
        main=main,
        times=(largest_at,),
    )
    return numbers


def motion_report(motion: ArmMotion | RobotMotion) -> Report:
    """Describe the motion of one or several arms."""
    arms = motion.arms if isinstance(motion, RobotMotion) else (motion,)
    lead = f"{len(arms[0].time)} target ellipsoids in {np.ptp(arms[0].time):.2f} s."
    sections = tuple(motion_section(arm, arm.time) for arm in arms)
    return Report(" and ".join(f"{arm.arm} at {arm.frame}" for arm in arms), lead, sections)


def motion_section(
    motion: ArmMotion, time: Array, result: ArmResult | None = None, alone: bool = True
) -> Section:
    """Describe the motion of an arm, of a result; `time` (n,): reported times of its waypoints [s].

    What concerns the trajectory of several arms together is in `group_section`.
    """
    section = Section("Robot motion", key="motion")
    add_statistics(section, "distance", motion.distance, time)
    if (error := motion.position_error) is not None:
        share, tolerance = (
            float(np.mean(error > FAR * motion.position_tolerance)),
            1e3 * motion.position_tolerance,
        )
        own = add_statistics(
            section, "position_error", 1e3 * error, time, tolerance=tolerance, far_share=share
        )
        if share > 0.0:
            text = f"the position error is up to {own['max']:.1f} mm (at {own['max_at_s']:.1f} s)"
            times = (own["max_at_s"],)
            section.warn("position-error", f"{text}; tolerance {tolerance:g} mm", times=times)
    if motion.orientation_error is not None:
        add_statistics(section, "orientation_error", np.degrees(motion.orientation_error), time)
    if alone:
        _add_trajectory(section, motion, motion.clearance, motion.demonstrated_time, time)
    if result is not None:
        for capability in getattr(result, "capabilities", ()):
            main = (capability.kind == "velocity") == (result.spec.kind == "velocity")
            _add_capability(section, capability, main)
        if result.gap is not None:
            _add_mean_distance(section, motion, result)
    _add_waypoints(section, motion)
    if (
        motion.pointwise_best is not None and np.median(motion.pointwise_best) > 0.01
    ):  # else the ratio has no meaning
        _add_pointwise_ratio(section, motion)
    if result is not None and result.gap is not None:
        gap = add_statistics(section, "feasibility_gap", result.gap, time)["median"]
        if gap > NEAR_DISTANCE:
            text = f"the targets are infeasible: median distance to the feasible set {gap:.2f}"
            section.warn("infeasible-targets", text)
    angle = np.degrees(motion.major_axis_angle if result is None else result.major_axis_angle)
    if np.isfinite(angle).any():
        median = add_statistics(section, "major_axis_angle", angle, time)["median"]
        if median > 30.0:
            text = f"the longest axis of the ellipsoid is {median:.0f}° (median) from that of the target"
            section.warn("longest-axis", text)
    if result is not None:
        _add_lowest_point(section, motion, time, result)
    if motion.held.any():
        count = motion.held.sum()
        text = f"at {count} control steps not all limits were satisfied, or the robot braked before a collision"
        section.warn("held", text, severity="error")
    pairs = zip(motion.joint_names, motion.velocity_limits, strict=True)
    if free := [name for name, limit in pairs if np.isinf(limit)]:
        section.warn(
            "unchecked-velocity-limits", f"no velocity limit is available for {listed(free)}"
        )
    if motion.limits is not None:
        warn_of_limits(section, motion.limits)
        if alone:
            collisions = None if result is None else result.collisions
            warn_of_collisions(
                section, motion.clearance, () if collisions is None else collisions.unchecked
            )
    elif "velocity limit" in motion.status:
        section.warn(
            "too-fast", "the motion is too fast for the robot in places: give it more time"
        )
    return section


def _add_mean_distance(section: Section, motion: ArmMotion, result: ArmResult) -> None:
    """Add the mean distance with its parts, as a sum of rounded numbers."""
    parts = result.mean_distance
    written = dict(parts)
    if motion.path is None:
        written["infeasible"] += written.pop("path")
    rounded = {name: round(part, 3) for name, part in written.items()}
    text = f"{sum(rounded.values()):.3f} = {' + '.join(f'{name} {part:.3f}' for name, part in rounded.items())}"
    about = "Infeasible: distance to the feasible set. Path: added by the path constraint. Motion: added by limits."
    value = {"mean": float(np.mean(motion.distance)), **parts}
    section.add("Mean distance", "mean_distance", value, text, about, main=True)


def _add_waypoints(section: Section, motion: ArmMotion) -> None:
    """Add how many waypoints are reached and why others are not."""
    status, total = Counter(motion.status), len(motion.status)
    missed = {name: count for name, count in status.items() if name not in REACHED}
    numbers = listed(f"{name.removesuffix(' missed')}: {count}" for name, count in missed.items())
    reasons, count = f" ({numbers})" if missed else "", sum(missed.values())
    if count > MISSED_SHARE * total:
        section.warn("targets-missed", f"{count} of {total} waypoints are missed{reasons}")
    about = f"Distance at most {NEAR_DISTANCE:g}, position error within the tolerance."
    value = {"count": total, "missed": count, "status": dict(status)}
    section.add(
        "Waypoints", "waypoints", value, f"{total - count} of {total} reached{reasons}", about
    )


def _add_pointwise_ratio(section: Section, motion: ArmMotion | RobotMotion) -> None:
    """Add the ratio, without a text where nothing better than the motion was found."""
    ratio = motion.pointwise_ratio
    if ratio == 1.0:
        section.numbers(pointwise_ratio=ratio)
        return
    label, about = "Ratio to the best pointwise distances found", "Of root mean squares; no bound."
    section.add(label, "pointwise_ratio", ratio, f"{ratio:.2f}", about)


def _add_lowest_point(section: Section, motion: ArmMotion, time: Array, result: ArmResult) -> None:
    """Add the lowest point of a motion; without a table, it must be above the plane that the base stands on."""
    if not result.robot.chain.stands:
        return
    if (lowest := result.lowest) is None:
        section.warn(
            "unchecked-floor", "the height above the base plane is unknown: no link has a shape"
        )
        return
    height, at = 1e3 * lowest.height, float(np.interp(lowest.time, motion.time, time))
    if height < 0.0 and (result.collisions is None or result.collisions.table is None):
        text = f"{lowest.link} is up to {-height:.0f} mm below the base plane (at {at:.1f} s)"
        advice = f"{argument('table', 0)} keeps the robot above it"
        section.warn("below-base-plane", f"{text}. {advice}", times=(at,))
    value = {"link": lowest.link, "height_mm": height, "at_s": at}
    text, about = (
        f"{height:.0f} mm, {lowest.link} {at_time(at)}",
        "Of the moving links, above the base plane.",
    )
    section.add("Lowest point", "lowest_point", value, text, about, times=(at,))


def group_section(motion: RobotMotion, time: Array, unchecked: Sequence[str] = ()) -> Section:
    """Describe what concerns several arms together; `time`: reported times of the waypoints [s]."""
    section = Section("All arms", key="arms")
    _add_trajectory(section, motion.trajectory, motion.clearance, time, time)
    _add_pointwise_ratio(section, motion)
    if motion.relative_error is not None:
        add_statistics(
            section, "relative_position_error", 1e3 * motion.relative_error.max(axis=1), time
        )
    warn_of_collisions(section, motion.clearance, unchecked)
    return section


def _add_trajectory(
    section: Section,
    trajectory: Trajectory,
    clearance: Clearance,
    demonstrated: Array | None,
    time: Array,
) -> None:
    """Add duration, limits and collisions of a planned motion; `time`: reported times of its waypoints [s]."""
    if demonstrated is not None:
        robot, person = (float(np.ptp(times)) for times in (trajectory.control_time, demonstrated))
        value, text = {"robot": robot, "person": person}, f"{robot:.1f} s (human {person:.1f} s)"
        about = "Time-scaled to satisfy the limits; other times are demonstrated."
        section.add("Duration", "duration", value, text, about, unit="s", main=True)
    if trajectory.limits is None or trajectory.limit_use is None:
        return
    largest, sources_of = trajectory.limit_use, trajectory.limits.sources
    for key, is_torque in (("limits", False), ("torques", True)):
        used: dict[str, dict[str, Any]] = {
            name: {"joint": joint, "share": share, "at_s": float(np.interp(at, trajectory.time, time))}
            for name, (joint, share, at) in largest.items() if (name in TORQUES) == is_torque
        }  # fmt: skip
        if not used:
            continue
        exceeded = listed(f"{use['joint']} at {use['share']:.2f} times its {name} limit {at_time(use['at_s'])}"
                          for name, use in used.items() if use["share"] > 1.001)  # fmt: skip
        if exceeded:
            text = f"the motion exceeds limits of the robot: {exceeded}"
            times = [use["at_s"] for use in used.values() if use["share"] > 1.001]
            section.warn(f"{key}-exceeded", text, severity="error", times=times)
        sources = {
            name: text
            for name, text in sources_of.items()
            if (name not in DERIVATIVES) == is_torque
        }
        # a position limit cannot be exceeded
        text = listed(
            f"{name} {100 * use['share']:.0f} %" for name, use in used.items() if name != "position"
        )
        about = f"Largest value relative to the limit{', by inverse dynamics' * is_torque}."
        section.add(
            key.capitalize(),
            key,
            {"used": used, "sources": sources},
            text,
            about,
            main=not is_torque,
        )
    _add_collisions(section, clearance, float(np.interp(clearance.time, trajectory.time, time)))


def _add_collisions(section: Section, clearance: Clearance, at: float) -> None:
    """Add collisions and the least clearance, which is at a time [s]."""
    millimeters, text = None, "none possible" if clearance.checked else "not checked"
    if clearance.checked and np.isfinite(clearance.distance):
        millimeters, pair = (
            1e3 * clearance.distance,
            f"{' and '.join(clearance.pair)} {at_time(at)}",
        )
        share = f"in {100 * clearance.share:.1f} % of the time"
        if clearance.share > 0.0:
            text = f"the robot collides {share}: {pair}"
            section.warn("collision", text, severity="error", times=(at,))
        text = f"{share if clearance.share else 'none'}; clearance {millimeters:.0f} mm ({pair})"
    value = {"checked": clearance.checked, "share": clearance.share, "at_s": at, "pair": clearance.pair,
             "clearance_mm": millimeters}  # fmt: skip
    about = "Between shapes of links, table and obstacles."
    section.add("Collisions", "collisions", value, text, about, main=True, times=(at,))
    add_collision_shapes(section, clearance.shapes)


def _add_capability(section: Section, own: Capability, main: bool) -> None:
    """Add force or speed of a motion, of one along the positions alone, and of the person."""
    series = {"robot": own.robot, "position_only": own.position_only, "person": own.person}
    value: dict[str, Any] = {
        name: {"median": float(np.median(values)), "p5": float(np.percentile(values, 5)), "min": float(values.min())}
        for name, values in series.items() if values is not None
    }  # fmt: skip
    texts = [f"{name.replace('_', ' ')} {numbers['median']:.3g}" for name, numbers in value.items()]
    texts[0] += f" (min {value['robot']['min']:.3g})"
    value |= {"min_at_s": float(own.time[own.robot.argmin()]), "resemblance": own.resemblance,
              "position_only_resemblance": own.position_only_resemblance}  # fmt: skip
    label, unit = ("Force", "N") if own.kind == "force" else ("Speed", "m/s")
    about = "Median along the direction of the person's largest value."
    section.add(label, own.kind, value, f"{listed(texts)} {unit}", about, unit=unit, main=main)
